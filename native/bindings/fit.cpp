// Fits of measured spectra.
#include <cmath>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>

#include "arrays.hpp"
#include "counters.hpp"
#include "sanguine/fit.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace sanguine;

namespace {

using PriorIn = std::optional<nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>>;

const char* scale_name(FitScale scale) {
    switch (scale) {
    case FitScale::logarithm: return "logarithm";
    case FitScale::logit: return "logit";
    case FitScale::root: return "root";
    case FitScale::linear: break;
    }
    return "linear";
}

nb::list py_fit_parameters() {
    nb::list out;
    for (const FitParameter& p : fit_parameters()) {
        nb::dict row;
        row["id"] = nb::str(p.id.data());
        row["scale"] = scale_name(p.scale);
        row["lower"] = p.lower;
        row["upper"] = p.upper;
        row["prior_mean"] = p.prior_mean;
        row["prior_sd"] = p.prior_sd;
        row["freed_sd"] = p.freed_sd;
        row["held_at"] = std::isnan(p.held_at) ? nb::none() : nb::object(nb::float_(p.held_at));
        row["source"] = nb::str(p.source.data());
        out.append(row);
    }
    return out;
}

nb::dict py_fit(const TableIn& spectra, const VectorIn& wavelengths_nm, bool specular_included, const PriorIn& prior,
                int threads, const ProgressIn& progress) {
    if (spectra.shape(1) != wavelengths_nm.size())
        throw std::invalid_argument("spectra: " + std::to_string(spectra.shape(1)) + " columns, needs "
                                    + std::to_string(wavelengths_nm.size()) + ", one per wavelength");
    FitOptions options = default_fit_options();
    options.specular_included = specular_included;
    if (prior) {
        options.prior_mean.clear();
        options.prior_sd.clear();
        for (std::size_t i = 0; i < prior->shape(0); ++i) {
            options.prior_mean.push_back((*prior)(i, 0));
            options.prior_sd.push_back((*prior)(i, 1));
        }
    }
    std::vector<SpectrumFit> fits;
    {
        nb::gil_scoped_release release;
        fits = fit_spectra({spectra.data(), spectra.size()}, {wavelengths_nm.data(), wavelengths_nm.size()}, options,
                           threads, with_gil(progress));
    }
    const std::size_t n = fits.size(), f = fit_parameters().size();
    std::vector<double> value, error, informed, bound, correlation, reflectance, rmse, noise, iterations, converged;
    const auto append = [](std::vector<double>& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    for (const SpectrumFit& fit : fits) {
        append(value, fit.value);
        append(error, fit.standard_error);
        append(informed, fit.informed);
        append(bound, fit.at_bound);
        append(correlation, fit.correlation);
        append(reflectance, fit.reflectance);
        rmse.push_back(fit.rmse);
        noise.push_back(fit.noise);
        iterations.push_back(fit.iterations);
        converged.push_back(fit.converged);
        counters.spectra_fitted.count += 1;
    }
    nb::dict result;
    result["value"] = to_numpy<2>(std::move(value), {n, f});
    result["standard_error"] = to_numpy<2>(std::move(error), {n, f});
    result["informed"] = to_numpy<2>(std::move(informed), {n, f});
    result["at_bound"] = to_numpy<2>(std::move(bound), {n, f});
    result["correlation"] = to_numpy<3>(std::move(correlation), {n, f, f});
    result["reflectance"] = to_numpy<2>(std::move(reflectance), {n, wavelengths_nm.size()});
    result["rmse"] = to_numpy<1>(std::move(rmse), {n});
    result["noise"] = to_numpy<1>(std::move(noise), {n});
    result["iterations"] = to_numpy<1>(std::move(iterations), {n});
    result["converged"] = to_numpy<1>(std::move(converged), {n});
    return result;
}

}  // namespace

void bind_fit(nb::module_& m) {
    m.def("fit_parameters", &py_fit_parameters,
          "What a fit may move, as dicts: id, scale (on which prior and error are normal), lower, upper, prior_mean and\n"
          "held_at (in the unit of the parameter; None where it is fitted), prior_sd and freed_sd (on the scale, as it is\n"
          "and when freed on purpose), source.");
    m.def("fit", &py_fit, "spectra"_a, "wavelengths_nm"_a, "specular_included"_a = true, "prior"_a = nb::none(),
          "threads"_a = 0, "progress"_a = nb::none(),
          "Skins whose reflectance is nearest to measured spectra (N, W), 0 to 1, under the priors.\n\n"
          "wavelengths_nm: (W,) increasing within 380 to 780. specular_included: the spectra hold the surface's\n"
          "reflection. prior: (F, 2) mean and standard deviation per row of fit_parameters(); 0 holds a value.\n"
          "Returns a dict: value, standard_error, informed (share of the prior's variance that the data removed),\n"
          "at_bound (1 or 0), all (N, F); correlation (N, F, F); reflectance (N, W), the fitted one; rmse, noise (per\n"
          "expected noise), iterations, converged (1 or 0), all (N,).\n"
          "progress(done, total) is called on this thread a few times a second; False raises Cancelled.");
}
