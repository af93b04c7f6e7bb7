#include "sanguine/chromophores.hpp"

#include <algorithm>
#include <array>
#include <numbers>
#include <sstream>
#include <stdexcept>

#include "embedded_data.hpp"
#include "sanguine/path_table.hpp"

namespace sanguine {
namespace {

static_assert(dermis_per_epidermis_scattering == path_grid::dermis_scattering, "the path table fixes this ratio");

constexpr double hemoglobin_g_per_l = 150, hemoglobin_g_per_mol = 64500;  // whole blood; the tetramer (Prahl)

/// Absorption [1/mm] per molar extinction [1/cm per mol/L], base 10, of one mol/L.
constexpr double absorption_per_extinction = std::numbers::ln10 / 10;

/// Columns of a table of spectra at `nm`, linear between its rows. `nm` lies inside the table.
template <int columns> std::array<double, columns - 1> lookup(SpectralRows<columns> table, double nm) {
    const auto upper = std::clamp<std::ptrdiff_t>(
        std::upper_bound(table.begin(), table.end(), nm, [](double x, const auto& row) { return x < row[0]; })
            - table.begin(), 1, std::ssize(table) - 1);
    const auto& a = table[upper - 1];
    const auto& b = table[upper];
    const double t = (nm - a[0]) / (b[0] - a[0]);
    std::array<double, columns - 1> out;
    for (int c = 1; c < columns; ++c)
        out[c - 1] = std::lerp(a[c], b[c], t);
    return out;
}

}  // namespace

Chromophores chromophores_at(double nm) {
    if (!(nm >= min_wavelength_nm && nm <= max_wavelength_nm)) {
        std::ostringstream message;
        message << "wavelengths_nm: " << nm << " is outside " << min_wavelength_nm << " to "
                << max_wavelength_nm << " nm";
        throw std::invalid_argument(message.str());
    }
    constexpr double blood = absorption_per_extinction * hemoglobin_g_per_l / hemoglobin_g_per_mol;
    const auto [oxy, deoxy] = lookup(embedded_hemoglobin(), nm);
    const auto bilirubin = embedded_bilirubin();

    Chromophores c;
    c.oxyhemoglobin = blood * oxy;
    c.deoxyhemoglobin = blood * deoxy;
    c.eumelanin = 6.6e10 * std::pow(nm, -3.33);
    c.pheomelanin = 2.9e14 * std::pow(nm, -4.75);
    c.baseline = 0.0244 + 8.53 * std::exp(-(nm - 154) / 66.2);
    c.bilirubin = nm < bilirubin.back()[0] ? absorption_per_extinction * 1e-6 * lookup(bilirubin, nm)[0] : 0;
    // Grains of carbon far smaller than the wavelength absorb as its inverse (Bond and Bergstrom 2006).
    c.ink = ink_pivot_nm / nm;
    // In 1/mm, twice the fit of Bashkatov et al. 2005 to whole skin; read as 1/cm it is ten times too small.
    c.epidermis_scattering = 14.74 * std::pow(nm, -0.22) + 2.2e11 * std::pow(nm, -4);
    c.log_wavelength = std::log(nm / scatter_pivot_nm);
    return c;
}

}  // namespace sanguine
