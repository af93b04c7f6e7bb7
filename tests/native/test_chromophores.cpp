#include "sanguine/chromophores.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "message_of.hpp"
#include "sanguine/path_table.hpp"
#include "sanguine/surface.hpp"

namespace sanguine {
namespace {

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
    const std::size_t needed = row.size() + 1;
    EXPECT_EQ(message_of([&] { skin_from_row(row, 0); }),
              "skin 0: " + std::to_string(row.size()) + " values, needs " + std::to_string(needed));
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

TEST(Chromophores, ScatterScaleMultipliesBothLayers) {
    SkinParameters skin;
    skin.scatter_scale = 1.5;
    const Chromophores c = chromophores_at(600);
    const OpticalCoefficients o = optical_coefficients(skin, c), plain = optical_coefficients({}, c);
    EXPECT_EQ(o.mu_s_prime_epidermis, 1.5 * c.epidermis_scattering);
    EXPECT_EQ(o.mu_s_prime_dermis, o.mu_s_prime_epidermis / 2);
    EXPECT_EQ(o.mu_a_epidermis, plain.mu_a_epidermis);
    EXPECT_EQ(o.mu_a_dermis, plain.mu_a_dermis);
}

TEST(Chromophores, ScatterPowerTurnsAbout600) {
    SkinParameters skin;
    skin.scatter_power = 0.6;
    for (const double nm : {400.0, 600.0, 750.0}) {
        const Chromophores c = chromophores_at(nm);
        const OpticalCoefficients o = optical_coefficients(skin, c);
        EXPECT_NEAR(o.mu_s_prime_epidermis / c.epidermis_scattering, std::pow(nm / 600, 0.6), 1e-12) << nm;
        EXPECT_EQ(o.mu_s_prime_dermis, o.mu_s_prime_epidermis / 2);
    }
}

TEST(Chromophores, VesselsPackTheirBlood) {
    // Factors of pure oxygenated blood by hand from the same table, mu_a = 280.1, 28.54, 29.52, 1.71 1/mm; the last
    // digit is the tolerance.
    const struct { double radius_mm, nm, factor; } rows[] = {
        {0.005, 415, 0.335}, {0.005, 542, 0.870}, {0.005, 577, 0.866}, {0.005, 600, 0.991},
        {0.010, 415, 0.178}, {0.010, 542, 0.762}, {0.020, 577, 0.586}, {0.050, 415, 0.036},
    };
    for (const auto& row : rows) {
        SkinParameters skin;
        skin.hemoglobin = 0.02;
        skin.oxygenation = 1;
        const Chromophores c = chromophores_at(row.nm);
        const double even = optical_coefficients(skin, c).mu_a_dermis;
        skin.vessel_radius_mm = row.radius_mm;
        const double packed = optical_coefficients(skin, c).mu_a_dermis;
        EXPECT_NEAR(1 + (packed - even) / (0.02 * c.oxyhemoglobin), row.factor, 0.0015) << row.nm;
    }
    // The limit of thin vessels is the blood spread evenly.
    SkinParameters thin;
    thin.vessel_radius_mm = 1e-12;
    const Chromophores c = chromophores_at(415);
    EXPECT_NEAR(optical_coefficients(thin, c).mu_a_dermis / optical_coefficients({}, c).mu_a_dermis, 1, 1e-8);
}

TEST(Chromophores, BilirubinIsYellow) {
    // 54,889 1/cm per mol/L at 450 nm (PhotochemCAD): ln(10) * 5488.9e-6 1/mm per umol/L. Red light passes.
    EXPECT_NEAR(chromophores_at(450).bilirubin, 0.012639, 1e-6);
    EXPECT_LT(chromophores_at(550).bilirubin, 2e-3 * chromophores_at(450).bilirubin);
    for (double nm = 380; nm <= 780; nm += 0.5)
        EXPECT_GE(chromophores_at(nm).bilirubin, 0) << nm;
    EXPECT_EQ(chromophores_at(780).bilirubin, 0);
    SkinParameters skin;
    skin.bilirubin_umol_per_l = 100;
    const Chromophores c = chromophores_at(450);
    const OpticalCoefficients o = optical_coefficients(skin, c), plain = optical_coefficients({}, c);
    EXPECT_NEAR(o.mu_a_dermis - plain.mu_a_dermis, 100 * c.bilirubin, 1e-12);
    EXPECT_EQ(o.mu_a_epidermis, plain.mu_a_epidermis);
}

TEST(Chromophores, InkIsCarbonInTheDermis) {
    SkinParameters skin;
    skin.ink_per_mm = 3;
    for (const double nm : {400.0, 600.0, 750.0}) {
        const Chromophores c = chromophores_at(nm);
        const OpticalCoefficients o = optical_coefficients(skin, c), plain = optical_coefficients({}, c);
        EXPECT_NEAR(o.mu_a_dermis - plain.mu_a_dermis, 3 * 600 / nm, 1e-12) << nm;
        EXPECT_EQ(o.mu_a_epidermis, plain.mu_a_epidermis);
        EXPECT_EQ(o.mu_s_prime_dermis, plain.mu_s_prime_dermis);
    }
}

TEST(Chromophores, WhatIsOffCostsNothing) {
    int calls = 0;
    const auto counted = [&](double x) { ++calls; return std::expm1(x); };
    SkinParameters skin;
    const Chromophores c = chromophores_at(550);
    const OpticalCoefficients off = optical_coefficients(skin, c, counted);
    EXPECT_EQ(calls, 0);
    skin.vessel_radius_mm = 0.01;
    optical_coefficients(skin, c, counted);
    EXPECT_EQ(calls, 1);
    skin.scatter_power = 0.5;
    optical_coefficients(skin, c, counted);
    EXPECT_EQ(calls, 3);
    // And to the last bit the skin of Donner and Jensen.
    EXPECT_EQ(off.mu_a_dermis, skin.hemoglobin * std::lerp(c.deoxyhemoglobin, c.oxyhemoglobin, skin.oxygenation)
                                   + (1 - skin.hemoglobin) * c.baseline);
    EXPECT_EQ(off.mu_s_prime_epidermis, c.epidermis_scattering);
}

TEST(Chromophores, WavelengthsOutsideTheTablesAreAnError) {
    EXPECT_EQ(message_of([] { chromophores_at(379); }), "wavelengths_nm: 379 is outside 380 to 780 nm");
    EXPECT_NE(message_of([] { chromophores_at(781); }), "");
    EXPECT_NE(message_of([] { chromophores_at(std::nan("")); }), "");
    EXPECT_EQ(message_of([] { chromophores_at(380); chromophores_at(780); }), "");
}

TEST(Chromophores, EverySkinFitsThePathTable) {
    // Least and greatest absorption and greatest optical thickness of the hard ranges.
    const auto row = [](std::string_view id) {
        return *std::find_if(std::begin(parameter_rows), std::end(parameter_rows),
                             [&](const auto& p) { return p.id == id; });
    };
    const double thickest = row("epidermis_thickness_mm").hard_max;
    for (double nm = 380; nm <= 780; nm += 1) {
        const Chromophores c = chromophores_at(nm);
        const double least = std::min({c.baseline, c.eumelanin, c.pheomelanin, c.oxyhemoglobin, c.deoxyhemoglobin});
        for (const double power : {row("scatter_power").hard_min, row("scatter_power").hard_max}) {
            SkinParameters skin;
            skin.scatter_scale = row("scatter_scale").hard_max;
            skin.scatter_power = power;
            const double mu_s_prime = optical_coefficients(skin, c).mu_s_prime_epidermis;
            EXPECT_GE(least / mu_s_prime, path_grid::reference_absorption) << nm;
            EXPECT_LE(thickest * mu_s_prime, path_grid::max_thickness) << nm;
            skin.scatter_scale = row("scatter_scale").hard_min;
            skin.melanin = row("melanin").hard_max;
            skin.hemoglobin = row("hemoglobin").hard_max;
            skin.bilirubin_umol_per_l = row("bilirubin_umol_per_l").hard_max;
            skin.ink_per_mm = row("ink_per_mm").hard_max;
            for (const double share : {0.0, 1.0}) {
                skin.melanin_blend = skin.oxygenation = share;
                const OpticalCoefficients darkest = optical_coefficients(skin, c);
                EXPECT_LE(std::max(darkest.mu_a_epidermis, darkest.mu_a_dermis) / darkest.mu_s_prime_epidermis,
                          path_grid::max_absorption) << nm;
            }
        }
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
