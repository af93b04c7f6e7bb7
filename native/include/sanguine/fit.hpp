// What is in a skin, from its measured reflectance: maximum a posteriori estimates under the model of skin.hpp.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "sanguine/parallel.hpp"
#include "sanguine/parameters.hpp"

namespace sanguine {

/// The scale u(x) on which a parameter's prior is normal and its error symmetric.
enum class FitScale { linear, logarithm, logit, root };

/// One quantity that a fit may move.
struct FitParameter {
    std::string_view id;              ///< of the schema, or "surface_reflectance"
    double SkinParameters::*field;    ///< null for surface_reflectance
    FitScale scale;
    double lower, upper;              ///< in the parameter's own unit
    double prior_mean;                ///< in the parameter's own unit
    double prior_sd;                  ///< on the scale u
    double freed_sd;                  ///< on the scale u, when it is freed on purpose
    double held_at;                   ///< NaN: it is fitted; else the value it keeps unless it is freed
    std::string_view source;          ///< of the prior
};

/// Every quantity that can be fitted, surface_reflectance last: the share of the light that the outer surface turns
/// back. An instrument that includes the specular part sees surface + (1 - surface) / (1 - F) R, where R is
/// reflectance() of bare skin and F = 0.0768 the loss of Lambertian light at its surface, which R holds already. One
/// that excludes it is taken to see R itself.
std::span<const FitParameter> fit_parameters();

struct FitOptions {
    bool specular_included = true;
    std::vector<double> prior_mean, prior_sd;  ///< one per fit_parameters(); a standard deviation of 0 holds a value
};

/// The options that fit_parameters() states: nothing freed.
FitOptions default_fit_options();

struct SpectrumFit {
    SkinParameters skin;               ///< what is not fitted has its default
    std::vector<double> value;         ///< [fit_parameters()]
    std::vector<double> standard_error;///< of value, from the posterior covariance scaled by the residuals and by their
                                       ///< correlation from wavelength to wavelength; 0 if held
    std::vector<double> informed;      ///< share of the prior's variance on u that the data removed, 0 to 1
    std::vector<bool> at_bound;
    std::vector<double> correlation;   ///< row-major [parameter][parameter], on u; 0 with a held parameter
    std::vector<double> reflectance;   ///< as the instrument would see the fitted skin
    double rmse;
    double noise;  ///< standard deviation of the residuals per expected_noise
    int iterations;
    bool converged;
};

/// Shape of the misfit that a good fit leaves, in reflectance: 0.3 % of full scale and 1 % of the reading; half as
/// much again at 438-453 nm, where the deoxyhemoglobin of Prahl's table is 1.3 to 2.4 times that of Zijlstra et al. 2000
/// and of Dervieux et al. 2020. Exchanging it there moves the reflectance of a light face by 1.05 and of an intermediate
/// one by 0.7 times the noise elsewhere. Only the shape weighs; the scale is estimated from each spectrum.
double expected_noise(double reflectance, double wavelength_nm);

inline constexpr std::size_t min_fit_wavelengths = 8;

/// Fits every spectrum by itself: Levenberg-Marquardt on u within the bounds, with the scale of the noise estimated in
/// turn. `reflectance` is row-major [spectrum][wavelength]. Throws std::invalid_argument for wavelengths that do not
/// increase within 380 to 780 nm or are fewer than min_fit_wavelengths, and for a reflectance outside 0 to 1.
std::vector<SpectrumFit> fit_spectra(std::span<const double> reflectance, std::span<const double> wavelengths_nm,
                                     const FitOptions& options, int threads, const Progress& progress);

}  // namespace sanguine
