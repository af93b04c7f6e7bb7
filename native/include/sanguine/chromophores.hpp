// What absorbs and scatters in skin: the coefficients of Donner and Jensen 2006, "A Spectral BSSRDF for Shading
// Human Skin" (EGSR), Section 3, with vessels, bilirubin and tattoo ink added.
#pragma once

#include <cmath>

#include "sanguine/parameters.hpp"

namespace sanguine {

inline constexpr double min_wavelength_nm = 380, max_wavelength_nm = 780;

/// The dermis scatters half as much as the epidermis (Donner and Jensen 2006).
inline constexpr double dermis_per_epidermis_scattering = 0.5;

/// Where ink_per_mm is the absorption of the ink.
inline constexpr double ink_pivot_nm = 600;

/// Where scatter_power changes nothing.
inline constexpr double scatter_pivot_nm = 600;

/// Coefficients of the pure substances at one wavelength, in 1/mm.
struct Chromophores {
    double eumelanin, pheomelanin;              ///< absorption of melanosomes
    double oxyhemoglobin, deoxyhemoglobin;      ///< absorption of whole blood, 150 g/L
    double baseline;                            ///< absorption of tissue without either
    double bilirubin;                           ///< absorption per umol/L
    double ink;                                 ///< absorption over that at ink_pivot_nm, not a coefficient
    double epidermis_scattering;                ///< reduced scattering mu_s' of the epidermis, at scatter_scale 1
    double log_wavelength;                      ///< ln(wavelength / scatter_pivot_nm), not a coefficient
};

/// Throws std::invalid_argument outside 380 to 780 nm.
Chromophores chromophores_at(double wavelength_nm);

/// The two layers of one skin at one wavelength, all in 1/mm.
struct OpticalCoefficients {
    double mu_a_epidermis, mu_a_dermis;
    double mu_s_prime_epidermis, mu_s_prime_dermis;
};

/// Absorption of blood [1/mm] as a beam of diffuse light meets it when it is gathered in vessels of `radius_mm`, per
/// volume of blood: mu_a times (1 - exp(-2 mu_a r)) / (2 mu_a r), Svaasand et al. 1995, van Veen et al. 2002, Opt.
/// Lett. 27:246.
/// Needs mu_a, radius > 0.
template <class Expm1> double packaged_absorption(double mu_a, double radius_mm, const Expm1& expm1) {
    return -expm1(-2 * mu_a * radius_mm) / (2 * radius_mm);
}

/// The mixture of the pure substances. `expm1` is called once for vessels, once for a scatter_power, and never for a
/// skin without either: what is off costs no transcendental function. Tests count the calls.
template <class Expm1>
OpticalCoefficients optical_coefficients(const SkinParameters& skin, const Chromophores& pure, const Expm1& expm1) {
    double blood = std::lerp(pure.deoxyhemoglobin, pure.oxyhemoglobin, skin.oxygenation);
    if (skin.vessel_radius_mm > 0)
        blood = packaged_absorption(blood, skin.vessel_radius_mm, expm1);
    double mu_s_prime = skin.scatter_scale * pure.epidermis_scattering;
    if (skin.scatter_power != 0)
        mu_s_prime *= 1 + expm1(skin.scatter_power * pure.log_wavelength);
    return {
        skin.melanin * std::lerp(pure.pheomelanin, pure.eumelanin, skin.melanin_blend)
            + (1 - skin.melanin) * pure.baseline,
        skin.hemoglobin * blood + (1 - skin.hemoglobin) * pure.baseline + skin.bilirubin_umol_per_l * pure.bilirubin
            + skin.ink_per_mm * pure.ink,
        mu_s_prime,
        dermis_per_epidermis_scattering * mu_s_prime,
    };
}

inline OpticalCoefficients optical_coefficients(const SkinParameters& skin, const Chromophores& pure) {
    return optical_coefficients(skin, pure, [](double x) { return std::expm1(x); });
}

}  // namespace sanguine
