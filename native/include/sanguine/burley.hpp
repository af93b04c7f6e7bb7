// Radial profiles as a few non-negative lobes that Cycles can render.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "sanguine/skin.hpp"

namespace sanguine {

inline constexpr int max_lobes = 4;

/// Energy within `r` of the lobe (exp(-r/d) + exp(-r/(3d))) / (8 pi d r), whose plane integral is 1 (Burley 2015,
/// "Extending the Disney BRDF to a BSDF with Integrated Subsurface Scattering", Eq. 3). Cycles' bssrdf("burley")
/// renders it with radius = 4 pi d.
double burley_energy_within(double r, double d);

/// One channel of a profile as lobes, widest first.
struct BurleyFit {
    std::array<double, max_lobes> weight{};  ///< >= 0, adds up to the channel's reflectance; 0 if that is negative
    std::array<double, max_lobes> d_mm{};
    double clamped;    ///< L1 norm of the profile's negative part over the channel's reflectance; 1 without reflectance
    double fit_error;  ///< L1 norm over the plane of lobes minus profile, over the channel's reflectance; 1 likewise
};

/// Fits lobes to the energies (signed) in rings with outer radii `edges_mm`; `count` is 1 to max_lobes. Throws
/// std::invalid_argument where the energies do not add up to a finite number.
///
/// Least squares over the rings, which are logarithmic, and over the mean radius, which decides how much light there is
/// beyond a shadow's edge. Weights are the exact solution of the small quadratic problem
/// "non-negative, energy kept". The widths start at fixed multiples of the profile's mean log radius, are improved by
/// Levenberg-Marquardt and held near their start by a weak penalty: widths that the profile does not determine then
/// do not wander, so that neighbouring skins get neighbouring lobes and a table of them may be interpolated.
///
/// The lobes are wider (in ln r) than the profile of a strongly absorbing skin at one wavelength, and a sum of
/// non-negative ones can only be wider still: an error of some 5-15 % is the floor of the form, not of the fit.
BurleyFit fit_burley(std::span<const double> energy, std::span<const double> edges_mm, int count);

/// The three channels of a skin.
struct SkinLobes {
    std::array<BurleyFit, 3> channel;
    Colour rgb;  ///< reflectance; may be negative outside the gamut
};

/// Solves and fits skins. `rgb` maps XYZ (D65, Y = 1 for white) to RGB. Throws std::invalid_argument for a lobe count
/// outside 1 to max_lobes.
std::vector<SkinLobes> skin_lobes(std::span<const SkinParameters> skins, const Matrix3& rgb, int lobe_count,
                                  int threads, const Progress& progress);

}  // namespace sanguine
