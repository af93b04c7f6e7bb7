// What absorbs and scatters in skin: the coefficients of Donner and Jensen 2006, "A Spectral BSSRDF for Shading
// Human Skin" (EGSR), Section 3.
#pragma once

#include "sanguine/parameters.hpp"

namespace sanguine {

inline constexpr double min_wavelength_nm = 380, max_wavelength_nm = 780;

/// Coefficients of the pure substances at one wavelength, all in 1/mm.
struct Chromophores {
    double eumelanin, pheomelanin;              ///< absorption of melanosomes
    double oxyhemoglobin, deoxyhemoglobin;      ///< absorption of whole blood, 150 g/L
    double baseline;                            ///< absorption of tissue without either
    double epidermis_scattering;                ///< reduced scattering mu_s' of the epidermis
};

/// Throws std::invalid_argument outside 380 to 780 nm.
Chromophores chromophores_at(double wavelength_nm);

/// The two layers of one skin at one wavelength, all in 1/mm.
struct OpticalCoefficients {
    double mu_a_epidermis, mu_a_dermis;
    double mu_s_prime_epidermis, mu_s_prime_dermis;
};

OpticalCoefficients optical_coefficients(const SkinParameters& skin, const Chromophores& pure);

}  // namespace sanguine
