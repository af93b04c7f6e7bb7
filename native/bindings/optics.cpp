// Skin optics: coefficients, reflectance, profiles, colour, lobes.
#include <cmath>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include "arrays.hpp"
#include "counters.hpp"
#include "sanguine/burley.hpp"
#include "sanguine/chromophores.hpp"
#include "sanguine/colour.hpp"
#include "sanguine/skin.hpp"
#include "sanguine/surface.hpp"
#include "spaces.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace sanguine;

namespace {

using ColoursIn = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

std::span<const double> view(const VectorIn& values) {
    return {values.data(), values.size()};
}

std::vector<SkinParameters> skins_from(const TableIn& rows) {
    std::vector<SkinParameters> skins;
    skins.reserve(rows.shape(0));
    for (std::size_t i = 0; i < rows.shape(0); ++i)
        skins.push_back(skin_from_row({rows.data() + i * rows.shape(1), rows.shape(1)}, i));
    return skins;
}

nb::list parameters() {
    nb::list rows;
    for (const ParameterRow& p : parameter_rows) {
        nb::dict row;
        row["id"] = nb::str(p.id.data());
        row["label"] = nb::str(p.label.data());
        row["unit"] = nb::str(p.unit.data());
        row["default"] = p.default_value;
        row["hard_min"] = p.hard_min;
        row["hard_max"] = p.hard_max;
        row["soft_min"] = p.soft_min;
        row["soft_max"] = p.soft_max;
        row["group"] = nb::str(p.group.data());
        row["channel"] = nb::str(p.channel.data());
        row["help"] = nb::str(p.help.data());
        row["source"] = nb::str(p.source.data());
        rows.append(row);
    }
    return rows;
}

nb::list derived_parameters() {
    nb::list rows;
    for (const DerivedRow& d : derived_rows) {
        nb::dict row;
        row["id"] = nb::str(d.id.data());
        row["label"] = nb::str(d.label.data());
        row["unit"] = nb::str(d.unit.data());
        row["expression"] = nb::str(d.expression.data());
        row["help"] = nb::str(d.help.data());
        rows.append(row);
    }
    return rows;
}

nb::dict py_optical_coefficients(const TableIn& rows, const VectorIn& wavelengths_nm) {
    const std::vector<SkinParameters> skins = skins_from(rows);
    const std::size_t count = wavelengths_nm.size();
    std::vector<double> out[4];
    for (auto& values : out)
        values.resize(skins.size() * count);
    for (std::size_t w = 0; w < count; ++w) {
        const Chromophores pure = chromophores_at(wavelengths_nm(w));
        for (std::size_t i = 0; i < skins.size(); ++i) {
            const OpticalCoefficients c = optical_coefficients(skins[i], pure);
            out[0][i * count + w] = c.mu_a_epidermis;
            out[1][i * count + w] = c.mu_a_dermis;
            out[2][i * count + w] = c.mu_s_prime_epidermis;
            out[3][i * count + w] = c.mu_s_prime_dermis;
        }
    }
    nb::dict result;
    const char* const keys[] = {"mu_a_epidermis_per_mm", "mu_a_dermis_per_mm", "mu_s_prime_epidermis_per_mm",
                                "mu_s_prime_dermis_per_mm"};
    for (int k = 0; k < 4; ++k)
        result[keys[k]] = to_numpy<2>(std::move(out[k]), {skins.size(), count});
    return result;
}

ArrayOut<2> py_reflectance(const TableIn& rows, const VectorIn& wavelengths_nm, int threads,
                           const ProgressIn& progress) {
    const std::vector<SkinParameters> skins = skins_from(rows);
    std::vector<double> out;
    {
        nb::gil_scoped_release release;
        out = reflectance(skins, view(wavelengths_nm), threads, with_gil(progress));
    }
    counters.spectral_solves.count += out.size();
    return to_numpy<2>(std::move(out), {skins.size(), wavelengths_nm.size()});
}

ArrayOut<2> py_surface(const TableIn& rows) {
    const std::vector<SkinParameters> skins = skins_from(rows);
    std::vector<double> out;
    for (const SkinParameters& skin : skins) {
        const SurfaceReflectance s = surface_reflectance(skin);
        out.insert(out.end(), {s.film, s.total});
    }
    return to_numpy<2>(std::move(out), {skins.size(), 2});
}

ArrayOut<1> py_default_radii_mm() {
    const std::vector<double> radii = default_radii_mm();
    return to_numpy<1>(radii, {radii.size()});
}

ArrayOut<3> py_radial_profile(const TableIn& rows, const VectorIn& wavelengths_nm, const VectorIn& radius_mm,
                              int threads, const ProgressIn& progress) {
    const std::vector<SkinParameters> skins = skins_from(rows);
    const std::size_t waves = wavelengths_nm.size(), radii = radius_mm.size();
    for (std::size_t r = 0; r < radii; ++r)
        if (!(radius_mm(r) > 0 && radius_mm(r) < INFINITY))
            throw std::invalid_argument("radius_mm: " + std::to_string(radius_mm(r)) + " is not above 0 mm and finite");
    std::vector<double> out(skins.size() * waves * radii);
    {
        nb::gil_scoped_release release;
        solve_profiles(skins, view(wavelengths_nm), threads, with_gil(progress),
                       [&](std::size_t i, std::size_t w, const RadialProfile& profile) {
                           for (std::size_t r = 0; r < radii; ++r)
                               out[(i * waves + w) * radii + r] = profile.density(radius_mm.data()[r]);
                       });
    }
    counters.profile_solves.count += skins.size() * waves;
    return to_numpy<3>(std::move(out), {skins.size(), waves, radii});
}

Illuminant illuminant_of(const std::string& name) {
    if (name != "D65" && name != "A")
        throw std::invalid_argument("illuminant: " + name + " is unknown, D65 or A");
    return name == "A" ? Illuminant::a : Illuminant::d65;
}

ArrayOut<2> py_xyz(const TableIn& spectra, const VectorIn& wavelengths_nm, const std::string& illuminant) {
    const std::vector<Colour> weights = xyz_weights(view(wavelengths_nm), illuminant_of(illuminant));
    if (spectra.shape(1) != weights.size())
        throw std::invalid_argument("spectra: " + std::to_string(spectra.shape(1)) + " columns, needs "
                                    + std::to_string(weights.size()) + ", one per wavelength");
    require_finite("spectra", spectra);
    std::vector<double> out(spectra.shape(0) * 3);
    for (std::size_t i = 0; i < spectra.shape(0); ++i)
        for (std::size_t w = 0; w < weights.size(); ++w)
            for (int c = 0; c < 3; ++c)
                out[i * 3 + c] += weights[w][c] * spectra(i, w);
    return to_numpy<2>(std::move(out), {spectra.shape(0), 3});
}

template <class Function> ArrayOut<2> map_colours(const ColoursIn& colours, Function&& function) {
    require_finite("xyz", colours);
    std::vector<double> out;
    out.reserve(colours.size());
    for (std::size_t i = 0; i < colours.shape(0); ++i) {
        const Colour mapped = function(Colour{colours(i, 0), colours(i, 1), colours(i, 2)});
        out.insert(out.end(), mapped.begin(), mapped.end());
    }
    return to_numpy<2>(std::move(out), {colours.shape(0), 3});
}

ArrayOut<1> py_delta_e_2000(const ColoursIn& lab_1, const ColoursIn& lab_2) {
    if (lab_1.shape(0) != lab_2.shape(0))
        throw std::invalid_argument("lab_2: " + std::to_string(lab_2.shape(0)) + " rows, needs "
                                    + std::to_string(lab_1.shape(0)) + ", as many as lab_1");
    std::vector<double> out;
    for (std::size_t i = 0; i < lab_1.shape(0); ++i)
        out.push_back(delta_e_2000({lab_1(i, 0), lab_1(i, 1), lab_1(i, 2)}, {lab_2(i, 0), lab_2(i, 1), lab_2(i, 2)}));
    const std::size_t count = out.size();
    return to_numpy<1>(std::move(out), {count});
}

nb::dict py_burley_lobes(const TableIn& rows, const SpaceIn& working_space, int lobe_count, int threads,
                         const ProgressIn& progress) {
    const std::vector<SkinParameters> skins = skins_from(rows);
    const Matrix3 rgb = rgb_matrix(working_space);
    std::vector<SkinLobes> lobes;
    {
        nb::gil_scoped_release release;
        lobes = skin_lobes(skins, rgb, lobe_count, threads, with_gil(progress));
    }
    counters.profile_solves.count += skins.size() * rgb_wavelength_count();
    counters.lobe_fits.count += skins.size() * 3;

    std::vector<double> weights, d_mm, clamped, fit_error, colours;
    for (const SkinLobes& skin : lobes) {
        for (int k = 0; k < lobe_count; ++k)
            for (const BurleyFit& fit : skin.channel) {
                weights.push_back(fit.weight[k]);
                d_mm.push_back(fit.d_mm[k]);
            }
        for (const BurleyFit& fit : skin.channel) {
            clamped.push_back(fit.clamped);
            fit_error.push_back(fit.fit_error);
        }
        colours.insert(colours.end(), skin.rgb.begin(), skin.rgb.end());
    }
    const std::size_t n = skins.size(), k = lobe_count;
    nb::dict result;
    result["weights"] = to_numpy<3>(std::move(weights), {n, k, 3});
    result["d_mm"] = to_numpy<3>(std::move(d_mm), {n, k, 3});
    result["clamped"] = to_numpy<2>(std::move(clamped), {n, 3});
    result["fit_error"] = to_numpy<2>(std::move(fit_error), {n, 3});
    result["rgb"] = to_numpy<2>(std::move(colours), {n, 3});
    return result;
}

}  // namespace

void bind_optics(nb::module_& m) {
    nb::exception<Cancelled>(m, "Cancelled");

    m.attr("SKIN_INDEX") = path_grid::refractive_index;
    m.attr("OIL_FILM_INDEX") = oil_film_index;

    m.def("parameters", &parameters,
          "Rows of the schema as dicts; their order is the column order of every (N, P) array.");
    m.def("derived_parameters", &derived_parameters, "Views of stored parameters, which can be set in their place.");

    m.def("optical_coefficients", &py_optical_coefficients, "skins"_a, "wavelengths_nm"_a,
          "Absorption and reduced scattering of both layers [1/mm].\n\n"
          "skins: (N, P), columns in the order of parameters(); wavelengths_nm: (W,) within 380 to 780.\n"
          "Returns a dict of (N, W) arrays. Source: Donner and Jensen 2006.");
    m.def("reflectance", &py_reflectance, "skins"_a, "wavelengths_nm"_a, "threads"_a = 0, "progress"_a = nb::none(),
          "Diffuse reflectance (N, W) of bare skin per unit of Lambertian light that falls on it.\n\n"
          "The reflection of the surface is not in it, see surface(). `oil` plays no part.\n"
          "progress(done, total) is called on this thread a few times a second; False raises Cancelled.");
    m.def("surface", &py_surface, "skins"_a,
          "Share of Lambertian light that the surface reflects, (N, 2): oil film alone, film and skin together.\n\n"
          "Under the film the skin's reflectance is (1 - film) * reflectance().");
    m.def("default_radii_mm", &py_default_radii_mm,
          "Logarithmic radii from 0.0003 to 40 mm for radial_profile().\n\n"
          "The disk inside the first one holds 2 pi r^2 R(r): there every profile falls as 1/r.");
    m.def("radial_profile", &py_radial_profile, "skins"_a, "wavelengths_nm"_a, "radius_mm"_a, "threads"_a = 0,
          "progress"_a = nb::none(),
          "R(r) [1/mm^2], (N, W, R), for Lambertian light on one point; its plane integral is reflectance().");

    m.def("xyz", &py_xyz, "spectra"_a, "wavelengths_nm"_a, "illuminant"_a = "D65",
          "XYZ (N, 3) of reflectance spectra (N, W): CIE 1931 2 degrees, illuminant 'D65' or 'A', Y = 100 for white.");
    m.def("lab",
          [](const ColoursIn& xyz, const std::string& illuminant) {
              const Illuminant light = illuminant_of(illuminant);
              return map_colours(xyz, [&](const Colour& c) { return lab_from_xyz(c, light); });
          },
          "xyz"_a, "illuminant"_a = "D65", "CIE L*a*b* (N, 3) of XYZ (Y = 100 for white) under 'D65' or 'A'.");
    m.def("delta_e_2000", &py_delta_e_2000, "lab_1"_a, "lab_2"_a, "CIEDE2000 differences (N,) of two (N, 3) of L*a*b*.");
    m.def("linear_rgb",
          [](const ColoursIn& xyz, const SpaceIn& working_space) {
              const Matrix3 rgb = rgb_matrix(working_space);
              return map_colours(xyz, [&](Colour c) { return rgb * Colour{c[0] / 100, c[1] / 100, c[2] / 100}; });
          },
          "xyz"_a, "working_space"_a = "rec709",
          "Linear RGB (N, 3), signed, of XYZ (Y = 100 for white); perfect white is (1, 1, 1).\n\n"
          "working_space: 'rec709', 'rec2020', 'acescg', or a (3, 3) matrix from XYZ (D65, Y = 1) to RGB.");

    m.def("burley_lobes", &py_burley_lobes, "skins"_a, "working_space"_a = "rec709", "lobe_count"_a = max_lobes,
          "threads"_a = 0, "progress"_a = nb::none(),
          "Profiles in RGB as non-negative lobes (exp(-r/d) + exp(-r/(3d))) / (8 pi d r), widest first.\n\n"
          "Returns a dict: weights (N, K, 3), adding up to rgb where that is positive; d_mm (N, K, 3);\n"
          "clamped (N, 3), share of the profile that is negative; fit_error (N, 3), L1 error over the plane per\n"
          "reflectance; rgb (N, 3), the reflectance. Cycles' radius is 4 pi d.");

}
