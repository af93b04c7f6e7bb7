#include "sanguine/chromophores.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <stdexcept>

#include "embedded_data.hpp"
#include "sanguine/path_table.hpp"

namespace sanguine {
namespace {

constexpr double hemoglobin_g_per_l = 150, hemoglobin_g_per_mol = 64500;  // whole blood; the tetramer (Prahl)

/// Absorption of blood [1/mm] per molar extinction [1/cm per mol/L], base 10.
constexpr double blood_per_extinction = std::numbers::ln10 * hemoglobin_g_per_l / hemoglobin_g_per_mol / 10;

}  // namespace

Chromophores chromophores_at(double nm) {
    if (!(nm >= min_wavelength_nm && nm <= max_wavelength_nm)) {
        std::ostringstream message;
        message << "wavelengths_nm: " << nm << " is outside " << min_wavelength_nm << " to "
                << max_wavelength_nm << " nm";
        throw std::invalid_argument(message.str());
    }
    const auto table = embedded_hemoglobin();
    const auto upper = std::clamp<std::ptrdiff_t>(
        std::upper_bound(table.begin(), table.end(), nm, [](double x, const auto& row) { return x < row[0]; })
            - table.begin(), 1, std::ssize(table) - 1);
    const auto& a = table[upper - 1];
    const auto& b = table[upper];
    const double t = (nm - a[0]) / (b[0] - a[0]);

    Chromophores c;
    c.oxyhemoglobin = blood_per_extinction * std::lerp(a[1], b[1], t);
    c.deoxyhemoglobin = blood_per_extinction * std::lerp(a[2], b[2], t);
    c.eumelanin = 6.6e10 * std::pow(nm, -3.33);
    c.pheomelanin = 2.9e14 * std::pow(nm, -4.75);
    c.baseline = 0.0244 + 8.53 * std::exp(-(nm - 154) / 66.2);
    // In 1/mm, twice the fit of Bashkatov et al. 2005 to whole skin; read as 1/cm it is ten times too small.
    c.epidermis_scattering = 14.74 * std::pow(nm, -0.22) + 2.2e11 * std::pow(nm, -4);
    return c;
}

OpticalCoefficients optical_coefficients(const SkinParameters& skin, const Chromophores& pure) {
    return {
        skin.melanin * std::lerp(pure.pheomelanin, pure.eumelanin, skin.melanin_blend)
            + (1 - skin.melanin) * pure.baseline,
        skin.hemoglobin * std::lerp(pure.deoxyhemoglobin, pure.oxyhemoglobin, skin.oxygenation)
            + (1 - skin.hemoglobin) * pure.baseline,
        pure.epidermis_scattering,
        path_grid::dermis_scattering * pure.epidermis_scattering,
    };
}

}  // namespace sanguine
