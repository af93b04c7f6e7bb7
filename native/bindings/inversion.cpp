// Chromophores of pictures.
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "counters.hpp"
#include "sanguine/inversion.hpp"
#include "spaces.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace sanguine;

namespace {

using RowsIn = nb::ndarray<const float, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using TriplesIn = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
template <int dimensions> using FloatsOut = nb::ndarray<nb::numpy, float, nb::ndim<dimensions>>;

/// Memory that is touched only as results arrive; the array owns it.
template <int dimensions> FloatsOut<dimensions> floats(const std::array<std::size_t, dimensions>& shape) {
    std::size_t size = 1;
    for (const std::size_t n : shape)
        size *= n;
    float* data = new float[size];
    nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<float*>(p); });
    return FloatsOut<dimensions>(data, dimensions, shape.data(), owner);
}

PictureRows picture_rows(const RowsIn& rows, int first, bool srgb) {
    constexpr std::size_t limit = 1 << 20;
    if (rows.shape(2) != 3 && rows.shape(2) != 4)
        throw std::invalid_argument("rows: " + std::to_string(rows.shape(2)) + " channels, 3 or 4 are allowed");
    if (rows.shape(0) > limit || rows.shape(1) > limit)
        throw std::invalid_argument("rows: more than 1048576 rows or columns");
    return {rows.data(), int(rows.shape(1)), first, int(rows.shape(0)), int(rows.shape(2)), srgb};
}

template <class Function> FloatsOut<2> map_triples(const TriplesIn& in, Function&& function) {
    for (std::size_t i = 0; i < in.size(); ++i)
        if (!std::isfinite(in.data()[i]))
            throw std::invalid_argument("not a finite number at " + std::to_string(i));
    const auto out = floats<2>({in.shape(0), 3});
    for (std::size_t i = 0; i < in.shape(0); ++i) {
        const std::array<float, 3> mapped = function(std::array<float, 3>{in(i, 0), in(i, 1), in(i, 2)});
        for (int k = 0; k < 3; ++k)
            out(i, k) = mapped[k];
    }
    return out;
}

void make_inverse(SkinInverse* self, const VectorIn& skin, const SpaceIn& working_space, int nodes, int threads,
                  const ProgressIn& progress) {
    const SkinParameters parameters = skin_from_row({skin.data(), skin.size()}, 0);
    const Matrix3 rgb = rgb_matrix(working_space);
    nb::gil_scoped_release release;
    new (self) SkinInverse(parameters, rgb, nodes, threads, with_gil(progress));
}

Shading shading_named(const std::string& name) {
    if (name == "off") return Shading::off;
    if (name == "auto") return Shading::automatic;
    if (name == "on") return Shading::on;
    throw std::invalid_argument("shading: '" + name + "' is not one of off, auto, on");
}

std::vector<PictureModel> py_models(const SkinInverse& inverse, const std::vector<const PictureOverview*>& overviews,
                                    const std::string& shading, std::optional<double> noise, double quantum, int threads) {
    if (noise && !(*noise >= 0 && *noise < 100))
        throw std::invalid_argument("noise: " + std::to_string(*noise) + " is outside 0 to 100 (L*a*b*)");
    if (!(quantum >= 0 && quantum < 1))
        throw std::invalid_argument("quantum: " + std::to_string(quantum) + " is outside 0 to 1");
    const InversionOptions options{shading_named(shading), noise.value_or(-1), quantum};
    nb::gil_scoped_release release;
    return picture_models(inverse, overviews, options, threads);
}

nb::dict py_invert_rows(const SkinInverse& inverse, const PictureModel& model, const RowsIn& rows, int rows_first, int first,
                        int count, bool srgb, bool shaded_residual, const std::vector<std::string>& wanted, int threads,
                        const ProgressIn& progress) {
    const PictureRows in = picture_rows(rows, rows_first, srgb);
    if (count < 0 || count > model.height)
        throw std::invalid_argument("count: " + std::to_string(count) + " rows of " + std::to_string(model.height));
    const std::size_t h = count, w = rows.shape(1);
    nb::dict result;
    InversionOutput out;
    out.shaded_residual = shaded_residual;
    for (const std::string& name : wanted) {
        if (name == "skin_map") {
            const auto map = floats<3>({h, w, 4});
            out.skin = map.data(), result["skin_map"] = map;
        } else if (name == "residual") {
            const auto map = floats<3>({h, w, 3});
            out.residual = map.data(), result["residual"] = map;
        } else if (name == "mask" || name == "error" || name == "shading") {
            const auto map = floats<2>({h, w});
            (name == "mask" ? out.mask : name == "error" ? out.error : out.shading) = map.data();
            result[name.c_str()] = map;
        } else {
            throw std::invalid_argument("wanted: '" + name + "' is not one of skin_map, residual, mask, error, shading");
        }
    }
    InversionCounts counts;
    {
        nb::gil_scoped_release release;
        counts = invert_rows(inverse, model, in, first, count, out, threads, with_gil(progress));
    }
    counters.texels_inverted.count += h * w;
    result["counts"] = nb::cast(std::move(counts));
    return result;
}

}  // namespace

void bind_inversion(nb::module_& m) {
    m.attr("INVERSION_HALO") = inversion_halo;
    m.attr("INVERSION_NODES") = default_inversion_nodes;

    m.def("inversion_axes",
          [] {
              nb::list out;
              for (const InversionAxis& a : inversion_axes()) {
                  nb::dict row;
                  row["id"] = nb::str(a.id.data());
                  row["lower"] = a.lower;
                  row["upper"] = a.upper;
                  row["mean"] = a.mean;
                  row["sd"] = a.sd;
                  row["source"] = nb::str(a.source.data());
                  out.append(row);
              }
              return out;
          },
          "The axes of a skin point, ln melanin, ln hemoglobin and oxygenation, as dicts: id, lower and upper, mean and sd\n"
          "of the prior, all on the axis; source.");

    nb::class_<SkinInverse>(m, "SkinInverse",
                            "Tables from colour to skin point for one skin, of which all but melanin, hemoglobin and\n"
                            "oxygenation is given. Immutable; a few megabytes.")
        .def("__init__", &make_inverse, "skin"_a, "working_space"_a = "rec709", "nodes"_a = default_inversion_nodes, "threads"_a = 0,
             "progress"_a = nb::none(),
             "skin: (P,) in the order of parameters(). working_space: of the pictures, as in linear_rgb(). nodes: per axis of\n"
             "L*a*b*, 5 to 129. progress(done, total) is called a few times a second; False raises Cancelled.")
        .def_prop_ro("nodes", &SkinInverse::nodes)
        .def_prop_ro("lab_range", &SkinInverse::lab_range, "L*a*b* of the first and of the last nodes.")
        .def_prop_ro("bytes", &SkinInverse::bytes, "Size of the tables.")
        .def("lab", [](const SkinInverse& s, const TriplesIn& points) { return map_triples(points, [&](const auto& p) { return s.lab(p); }); },
             "points"_a, "L*a*b* (N, 3) of skin points (N, 3), as the forward table has it.")
        .def("point", [](const SkinInverse& s, const TriplesIn& lab) { return map_triples(lab, [&](const auto& c) { return s.point(c); }); },
             "lab"_a, "Skin points (N, 3) of L*a*b* (N, 3), as the inverse table has it.")
        .def("lab_of_rgb", [](const SkinInverse& s, const TriplesIn& rgb) { return map_triples(rgb, [&](const auto& c) { return s.lab_of_rgb(c); }); },
             "rgb"_a, "L*a*b* (N, 3) of linear RGB (N, 3) of the working space.")
        .def("rgb_of_lab", [](const SkinInverse& s, const TriplesIn& lab) { return map_triples(lab, [&](const auto& c) { return s.rgb_of_lab(c); }); },
             "lab"_a, "Linear RGB (N, 3) of the working space of L*a*b* (N, 3).");

    nb::class_<PictureOverview>(m, "PictureOverview", "A small picture of a large one, and samples of its noise.")
        .def(nb::init<int, int>(), "width"_a, "height"_a)
        .def("add",
             [](PictureOverview& o, const RowsIn& rows, int first, bool srgb, int threads) {
                 const PictureRows in = picture_rows(rows, first, srgb);
                 nb::gil_scoped_release release;
                 o.add(in, threads);
             },
             "rows"_a, "first"_a = 0, "srgb"_a = false, "threads"_a = 0,
             "Rows (N, width, 3 or 4) float32 from row `first` on, each row once, in any order; the fourth channel is alpha.\n"
             "srgb: encoded as sRGB, else linear. How the rows are cut does not matter.");

    nb::class_<PictureModel>(m, "PictureModel", "Noise, shading and what is skin in a picture.")
        .def_ro("width", &PictureModel::width)
        .def_ro("height", &PictureModel::height)
        .def_ro("noise_sd", &PictureModel::noise_sd, "Standard deviation of the noise, mean over L*, a*, b*.")
        .def_ro("centre", &PictureModel::centre, "Median skin point of the skin.")
        .def_ro("spread", &PictureModel::spread, "Robust standard deviation of the skin's points.")
        .def_ro("skin_share", &PictureModel::skin_share)
        .def_ro("shading_found", &PictureModel::shading_found, "Standard deviation of ln shading, before what is kept of it.")
        .def_ro("shading_pigment", &PictureModel::shading_pigment, "The same as oxygenation alone could feign it.")
        .def_ro("exposure", &PictureModel::exposure, "ln of a factor on the whole picture that is in the shading.")
        .def_ro("shading_kept", &PictureModel::shading_kept, "Share of the found shading that is kept, 0 to 1.");

    m.def("picture_models", &py_models, "inverse"_a, "overviews"_a, "shading"_a = "auto", "noise"_a = nb::none(),
          "quantum"_a = 0.0, "threads"_a = 0,
          "Models of pictures that belong together, as the tiles of a UDIM set do.\n\n"
          "shading: 'off', 'auto' (as far as it is more than pigment explains) or 'on'. noise: standard deviation in L*a*b*;\n"
          "None estimates it. quantum: step between two values of the file, 1/255 for 8 bits, 0 for floats.");

    nb::class_<InversionCounts>(m, "InversionCounts", "Counts over texels, to be added up over bands and tiles.")
        .def(nb::init<>())
        .def("__iadd__", [](InversionCounts& a, const InversionCounts& b) -> InversionCounts& { a += b; return a; }, nb::rv_policy::none)
        .def_ro("texels", &InversionCounts::texels)
        .def_ro("there", &InversionCounts::there, "Texels that are finite and whose alpha is above 0.")
        .def_ro("skin", &InversionCounts::skin, "Texels with a mask above 1/2.")
        .def("error_at", &InversionCounts::error_at, "share"_a, "Delta E 2000 below which this share of the skin lies.")
        .def("point_at", &InversionCounts::point_at, "axis"_a, "share"_a,
             "Value of an axis of inversion_axes() below which this share of the skin lies.");

    m.def("invert_rows", &py_invert_rows, "inverse"_a, "model"_a, "rows"_a, "rows_first"_a, "first"_a, "count"_a,
          "srgb"_a = false, "shaded_residual"_a = false,
          "wanted"_a = std::vector<std::string>{"skin_map", "residual", "mask", "error"}, "threads"_a = 0,
          "progress"_a = nb::none(),
          R"(Chromophores of the rows `first` to `first + count` of a picture.

Parameters
----------
rows : (N, width, 3 or 4) float32, from row `rows_first` on: the wanted ones and INVERSION_HALO more on either side,
    where the picture has them
srgb : encoded as sRGB, else linear
shaded_residual : the shading is in the residual
wanted : any of skin_map, residual, mask, error, shading

Returns
-------
dict of float32 arrays, and "counts" (InversionCounts): skin_map (count, width, 4): hemoglobin, melanin, oil, oxygenation;
residual (count, width, 3): picture / (look of the estimate x shading); mask: probability of skin; error: CIEDE2000 between
picture / shading and the look of the estimate; shading: factor on the light. How the rows are cut and the number of threads
change nothing.)");

    m.def("delta_e_2000_fast",
          [](const TriplesIn& lab_1, const TriplesIn& lab_2) {
              if (lab_1.shape(0) != lab_2.shape(0))
                  throw std::invalid_argument("lab_2: needs as many rows as lab_1");
              const std::size_t n = lab_1.shape(0);
              std::vector<float> planes(6 * n);
              for (std::size_t i = 0; i < n; ++i)
                  for (int k = 0; k < 3; ++k)
                      planes[k * n + i] = lab_1(i, k), planes[(3 + k) * n + i] = lab_2(i, k);
              const auto out = floats<1>({n});
              delta_e_2000_fast(n, planes.data(), planes.data() + 3 * n, out.data());
              return out;
          },
          "lab_1"_a, "lab_2"_a, "CIEDE2000 (N,) in single precision, as invert_rows() computes it.");
}
