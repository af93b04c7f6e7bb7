#include "sanguine/chromophores.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sanguine/path_table.hpp"
#include "sanguine/surface.hpp"

namespace sanguine {
namespace {

/// What the exception says, "" without one.
template <class Function> std::string message_of(Function&& function) {
    try {
        function();
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "";
}

std::vector<double> default_row() {
    std::vector<double> row;
    for (const ParameterRow& p : parameter_rows)
        row.push_back(p.default_value);
    return row;
}

TEST(Parameters, RowsAndStructAgree) {
    const SkinParameters defaults;
    for (const ParameterRow& p : parameter_rows) {
        EXPECT_EQ(defaults.*p.field, p.default_value) << p.id;
        EXPECT_FALSE(p.source.empty()) << p.id;
        EXPECT_FALSE(p.help.empty()) << p.id;
    }
}

TEST(Parameters, RangesAreEnforcedByTheTable) {
    for (std::size_t i = 0; i < std::size(parameter_rows); ++i) {
        const ParameterRow& p = parameter_rows[i];
        std::vector<double> row = default_row();
        for (const double good : {p.hard_min, p.hard_max}) {
            row[i] = good;
            EXPECT_EQ(skin_from_row(row, 0).*p.field, good);
        }
        for (const double bad : {p.hard_min - 1e-3, p.hard_max + 1e-3, std::nan(""), HUGE_VAL, -HUGE_VAL}) {
            row[i] = bad;
            const std::string message = message_of([&] { skin_from_row(row, 3); });
            EXPECT_NE(message.find(p.id), std::string::npos) << message;
            EXPECT_NE(message.find("skin 3"), std::string::npos) << message;
        }
    }
}

TEST(Parameters, MessageNamesValueAndRange) {
    std::vector<double> row = default_row();
    row[2] = 0.3;
    EXPECT_EQ(message_of([&] { skin_from_row(row, 0); }), "skin 0: hemoglobin: 0.3 is outside 0 to 0.25");
    row.pop_back();
    EXPECT_EQ(message_of([&] { skin_from_row(row, 0); }), "skin 0: 6 values, needs 7");
}

TEST(Chromophores, MelaninAndBaseline) {
    // Donner and Jensen 2006 by hand, 1/mm; the last digit is the tolerance.
    const struct { double nm, eumelanin, pheomelanin, baseline; } rows[] = {
        {450, 96.5, 72.4, 0.122}, {500, 67.9, 43.9, 0.0702}, {550, 49.4, 27.9, 0.0459},
        {600, 37.0, 18.5, 0.0345}, {700, 22.2, 8.9, 0.0266},
    };
    for (const auto& row : rows) {
        const Chromophores c = chromophores_at(row.nm);
        EXPECT_NEAR(c.eumelanin, row.eumelanin, 0.06) << row.nm;
        EXPECT_NEAR(c.pheomelanin, row.pheomelanin, 0.06) << row.nm;
        EXPECT_NEAR(c.baseline, row.baseline, 0.0006) << row.nm;
    }
}

TEST(Chromophores, ScatteringIsInPerMillimetre) {
    // Within 5 % of measured epidermis, Salomatina et al. 2006: 7.06, 5.84, 4.27 1/mm. Read as 1/cm: a tenth.
    EXPECT_NEAR(chromophores_at(500).epidermis_scattering / 7.06, 1, 0.05);
    EXPECT_NEAR(chromophores_at(550).epidermis_scattering / 5.84, 1, 0.05);
    EXPECT_NEAR(chromophores_at(700).epidermis_scattering / 4.27, 1, 0.05);
}

TEST(Chromophores, BloodPeaksAndIsosbesticPoints) {
    // Whole blood, 150 g/L, from Prahl's table; a table with shifted wavelengths fails here.
    EXPECT_NEAR(chromophores_at(415).oxyhemoglobin, 280.1, 0.5);
    EXPECT_NEAR(chromophores_at(542).oxyhemoglobin, 28.54, 0.05);
    EXPECT_NEAR(chromophores_at(577).oxyhemoglobin, 29.52, 0.05);
    EXPECT_NEAR(chromophores_at(560).deoxyhemoglobin, 28.80, 0.05);
    EXPECT_NEAR(chromophores_at(650).oxyhemoglobin, 0.197, 0.001);
    EXPECT_NEAR(chromophores_at(650).deoxyhemoglobin, 2.01, 0.01);
    for (const double nm : {500.2, 529.3, 545.3, 570.2, 584.1}) {
        const Chromophores c = chromophores_at(nm);
        EXPECT_NEAR(c.oxyhemoglobin / c.deoxyhemoglobin, 1, 0.01) << nm;
    }
}

TEST(Chromophores, MixtureOfTheLayers) {
    SkinParameters skin;
    skin.melanin = 0.1;
    skin.melanin_blend = 0.7;
    skin.hemoglobin = 0.02;
    skin.oxygenation = 0.8;
    const Chromophores c = chromophores_at(550);
    const OpticalCoefficients o = optical_coefficients(skin, c);
    EXPECT_NEAR(o.mu_a_epidermis, 0.1 * (0.7 * c.eumelanin + 0.3 * c.pheomelanin) + 0.9 * c.baseline, 1e-12);
    EXPECT_NEAR(o.mu_a_dermis, 0.02 * (0.8 * c.oxyhemoglobin + 0.2 * c.deoxyhemoglobin) + 0.98 * c.baseline, 1e-12);
    EXPECT_EQ(o.mu_s_prime_dermis, o.mu_s_prime_epidermis / 2);
}

TEST(Chromophores, WavelengthsOutsideTheTablesAreAnError) {
    EXPECT_EQ(message_of([] { chromophores_at(379); }), "wavelengths_nm: 379 is outside 380 to 780 nm");
    EXPECT_NE(message_of([] { chromophores_at(781); }), "");
    EXPECT_NE(message_of([] { chromophores_at(std::nan("")); }), "");
    EXPECT_EQ(message_of([] { chromophores_at(380); chromophores_at(780); }), "");
}

TEST(Chromophores, EverySkinFitsThePathTable) {
    // Least absorption and greatest optical thickness of the hard ranges.
    for (double nm = 380; nm <= 780; nm += 1) {
        const Chromophores c = chromophores_at(nm);
        const double least = std::min({c.baseline, c.eumelanin, c.pheomelanin, c.oxyhemoglobin, c.deoxyhemoglobin});
        EXPECT_GE(least / c.epidermis_scattering, path_grid::reference_absorption) << nm;
        const auto thickest = std::find_if(std::begin(parameter_rows), std::end(parameter_rows),
                                           [](const auto& p) { return p.id == "epidermis_thickness_mm"; });
        EXPECT_LE(thickest->hard_max * c.epidermis_scattering, path_grid::max_thickness) << nm;
    }
}

TEST(Surface, FilmTakesFromWhatEnters) {
    SkinParameters skin;
    skin.oil = 0;
    EXPECT_EQ(surface_reflectance(skin).film, 0);
    EXPECT_NEAR(surface_reflectance(skin).total, 0.0768, 1e-4);
    skin.oil = 1;
    const SurfaceReflectance oily = surface_reflectance(skin);
    EXPECT_NEAR(oily.film, 0.0918, 1e-4);  // diffuse Fresnel of n = 1.5
    EXPECT_NEAR(oily.total, oily.film + (1 - oily.film) * 0.0768, 1e-4);
}

}  // namespace
}  // namespace sanguine
