#include "sanguine/fit.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "message_of.hpp"
#include "sanguine/fresnel.hpp"
#include "sanguine/skin.hpp"

namespace sanguine {
namespace {

std::vector<double> wavelengths(double first, double last, double step) {
    std::vector<double> out;
    for (double nm = first; nm <= last; nm += step)
        out.push_back(nm);
    return out;
}

std::size_t index_of(std::string_view id) {
    const auto rows = fit_parameters();
    return std::find_if(rows.begin(), rows.end(), [&](const auto& row) { return row.id == id; }) - rows.begin();
}

/// What an instrument with specular included sees of `skin`.
std::vector<double> seen(const SkinParameters& skin, double surface, const std::vector<double>& nm) {
    std::vector<double> r = reflectance({&skin, 1}, nm, 1, {});
    for (double& value : r)
        value = surface + (1 - surface) / (1 - diffuse_fresnel(1.4)) * value;
    return r;
}

TEST(Fit, RowsAreOfTheSchemaAndInsideIt) {
    for (const FitParameter& row : fit_parameters()) {
        EXPECT_FALSE(row.source.empty());
        EXPECT_LT(row.lower, row.upper);
        EXPECT_GE(row.prior_mean, row.lower);
        EXPECT_LE(row.prior_mean, row.upper);
        EXPECT_GE(row.freed_sd, row.prior_sd);
        if (!row.field)
            continue;
        const auto schema = std::find_if(std::begin(parameter_rows), std::end(parameter_rows),
                                         [&](const auto& p) { return p.id == row.id; });
        ASSERT_NE(schema, std::end(parameter_rows)) << row.id;
        EXPECT_EQ(schema->field, row.field);
        EXPECT_GE(row.lower, schema->hard_min) << row.id;
        EXPECT_LE(row.upper, schema->hard_max) << row.id;
    }
}

TEST(Fit, FindsWhatWasPutIn) {
    const std::vector<double> nm = wavelengths(400, 700, 10);
    const struct { double melanin, hemoglobin, oxygenation, thickness, scale, power, radius, surface; } rows[] = {
        {0.015, 0.010, 0.70, 0.08, 1.3, 0.5, 0.008, 0.035}, {0.05, 0.020, 0.80, 0.06, 1.5, 0.8, 0.006, 0.030},
        {0.20, 0.030, 0.60, 0.09, 1.1, 0.6, 0.010, 0.040},  {0.03, 0.050, 0.90, 0.12, 1.0, 0.3, 0.010, 0.030},
    };
    for (const auto& row : rows) {
        SkinParameters skin;
        skin.melanin = row.melanin;
        skin.hemoglobin = row.hemoglobin;
        skin.oxygenation = row.oxygenation;
        skin.epidermis_thickness_mm = row.thickness;
        skin.scatter_scale = row.scale;
        skin.scatter_power = row.power;
        skin.vessel_radius_mm = row.radius;
        const SpectrumFit fit = fit_spectra(seen(skin, row.surface, nm), nm, default_fit_options(), 1, {}).front();
        EXPECT_TRUE(fit.converged);
        EXPECT_LT(fit.rmse, 2e-4);
        // Without noise what is left is the pull of the priors: within two of the standard errors that are stated,
        // and these are small. Pigment per area, melanin x thickness, is known better than either.
        for (std::size_t i = 0; i < fit_parameters().size(); ++i) {
            const FitParameter& p = fit_parameters()[i];
            const double truth = p.field ? skin.*p.field : row.surface;
            EXPECT_LE(std::abs(fit.value[i] - truth), 2 * fit.standard_error[i] + 1e-12) << p.id << " of " << row.melanin;
            EXPECT_FALSE(fit.at_bound[i] && std::isnan(p.held_at)) << p.id;
        }
        EXPECT_NEAR(fit.skin.hemoglobin / row.hemoglobin, 1, 0.05);
        EXPECT_NEAR(fit.skin.oxygenation, row.oxygenation, 0.01);
        EXPECT_NEAR(fit.skin.melanin * fit.skin.epidermis_thickness_mm / (row.melanin * row.thickness), 1, 0.05);
    }
}

TEST(Fit, StandardErrorsCoverTheTruth) {
    // Skins drawn from the priors, seen with the expected noise and with a third of it. A 95 % interval must hold the
    // truth in 95 % of them; the noise's scale is known from some 25 degrees of freedom, which makes it 94 %. Over
    // 2 x 300 x 9 intervals, counted as a half for what those of one spectrum share, 93-97 % leaves three standard
    // deviations. Held parameters are left out.
    const std::vector<double> nm = wavelengths(400, 700, 10);
    const auto rows = fit_parameters();
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    const auto draw = [&](const FitParameter& row) {
        for (;;) {
            double x = 0;
            switch (row.scale) {
            case FitScale::linear: x = row.prior_mean + row.prior_sd * normal(random); break;
            case FitScale::logarithm: x = row.prior_mean * std::exp(row.prior_sd * normal(random)); break;
            case FitScale::root: x = std::pow(std::sqrt(row.prior_mean) + row.prior_sd * normal(random), 2); break;
            case FitScale::logit: {
                const double odds = row.prior_mean / (1 - row.prior_mean) * std::exp(row.prior_sd * normal(random));
                x = odds / (1 + odds);
            }
            }
            if (x > row.lower && x < row.upper)
                return x;
        }
    };
    constexpr int skins = 300;
    int inside = 0, all = 0;
    for (const double level : {1.0, 1.0 / 3}) {
        std::vector<double> spectra;
        std::vector<std::vector<double>> truths;
        for (int k = 0; k < skins; ++k) {
            SkinParameters skin;
            std::vector<double> truth;
            for (const FitParameter& row : rows) {
                truth.push_back(std::isnan(row.held_at) ? draw(row) : row.held_at);
                if (row.field)
                    skin.*row.field = truth.back();
            }
            truths.push_back(truth);
            std::vector<double> r = seen(skin, truth.back(), nm);
            for (std::size_t w = 0; w < nm.size(); ++w)
                spectra.push_back(std::clamp(r[w] + level * expected_noise(r[w], nm[w]) * normal(random), 0.0, 1.0));
        }
        const std::vector<SpectrumFit> fits = fit_spectra(spectra, nm, default_fit_options(), 2, {});
        for (int k = 0; k < skins; ++k) {
            EXPECT_NEAR(std::log(fits[k].noise / level), 0, 0.7);  // 31 samples less 5: 14 %, five times
            for (std::size_t i = 0; i < rows.size(); ++i) {
                if (!std::isnan(rows[i].held_at))
                    continue;
                ++all;
                inside += std::abs(fits[k].value[i] - truths[k][i]) < 1.96 * fits[k].standard_error[i];
            }
        }
    }
    EXPECT_GT(inside, 0.93 * all);
    EXPECT_LT(inside, 0.97 * all);
}

TEST(Fit, SaysWhatTheSpectrumDoesNotTell) {
    const std::vector<double> nm = wavelengths(400, 700, 10);
    SkinParameters skin;
    skin.melanin = 0.03;
    std::vector<double> spectrum = seen(skin, 0.035, nm);
    for (std::size_t w = 0; w < nm.size(); ++w)
        spectrum[w] += (w % 2 ? 1 : -1) * expected_noise(spectrum[w], nm[w]);
    const SpectrumFit fit = fit_spectra(spectrum, nm, default_fit_options(), 1, {}).front();
    const std::size_t blend = index_of("melanin_blend"), melanin = index_of("melanin"), blood = index_of("hemoglobin"),
                      thickness = index_of("epidermis_thickness_mm"), count = fit_parameters().size();
    EXPECT_LT(fit.informed[blend], 0.1);
    EXPECT_NEAR(fit.standard_error[blend], 0.02, 0.002);  // the prior's
    EXPECT_GT(fit.informed[blood], 0.9);
    // Pigment per area is what shows.
    EXPECT_LT(fit.correlation[melanin * count + thickness], -0.7);
    EXPECT_NEAR(fit.correlation[melanin * count + thickness], fit.correlation[thickness * count + melanin], 1e-9);
}

TEST(Fit, FreedParametersFollowTheDataAndHeldOnesDoNot) {
    const std::vector<double> nm = wavelengths(400, 700, 10);
    SkinParameters skin;
    skin.melanin = 0.06;
    skin.melanin_blend = 0.2;
    skin.bilirubin_umol_per_l = 60;
    const std::vector<double> spectrum = seen(skin, 0.035, nm);
    FitOptions options = default_fit_options();
    const std::size_t blend = index_of("melanin_blend"), bile = index_of("bilirubin_umol_per_l"),
                      blood = index_of("hemoglobin");
    for (const std::size_t i : {blend, bile}) {
        options.prior_mean[i] = fit_parameters()[i].prior_mean;
        options.prior_sd[i] = fit_parameters()[i].freed_sd;
    }
    options.prior_mean[blood] = skin.hemoglobin;
    options.prior_sd[blood] = 0;
    const SpectrumFit freed = fit_spectra(spectrum, nm, options, 1, {}).front();
    EXPECT_NEAR(freed.skin.melanin_blend, 0.2, 0.1);
    EXPECT_NEAR(freed.skin.bilirubin_umol_per_l, 60, 6);
    EXPECT_EQ(freed.skin.hemoglobin, skin.hemoglobin);
    EXPECT_EQ(freed.standard_error[blood], 0);
    const SpectrumFit bound = fit_spectra(spectrum, nm, default_fit_options(), 1, {}).front();
    EXPECT_EQ(bound.skin.bilirubin_umol_per_l, 0);
    EXPECT_GT(bound.rmse, 5 * freed.rmse);
}

TEST(Fit, SpecularExcludedSeesBareSkin) {
    const std::vector<double> nm = wavelengths(380, 780, 10);
    SkinParameters skin;
    skin.melanin = 0.05;
    skin.hemoglobin = 0.02;
    FitOptions options = default_fit_options();
    options.specular_included = false;
    const SpectrumFit fit = fit_spectra(reflectance({&skin, 1}, nm, 1, {}), nm, options, 1, {}).front();
    EXPECT_LT(fit.rmse, 2e-4);
    EXPECT_NEAR(fit.skin.hemoglobin, 0.02, 0.001);
    EXPECT_EQ(fit.standard_error.back(), 0);
}

TEST(Fit, OddSpectraGiveFiniteAnswers) {
    const std::vector<double> nm = wavelengths(400, 700, 10);
    std::vector<double> spectra;
    for (const double level : {0.0, 1.0, 1e-300, 0.5})
        spectra.insert(spectra.end(), nm.size(), level);
    for (std::size_t w = 0; w < nm.size(); ++w)
        spectra.push_back(w % 2);
    for (const SpectrumFit& fit : fit_spectra(spectra, nm, default_fit_options(), 2, {})) {
        EXPECT_GT(fit.rmse, 0.01);  // none of them is skin
        for (std::size_t i = 0; i < fit_parameters().size(); ++i) {
            const FitParameter& row = fit_parameters()[i];
            EXPECT_GE(fit.value[i], std::min(row.lower, row.held_at)) << row.id;
            EXPECT_LE(fit.value[i], row.upper) << row.id;
            EXPECT_TRUE(std::isfinite(fit.standard_error[i])) << row.id;
        }
    }
}

TEST(Fit, BadInputIsNamed) {
    const FitOptions options = default_fit_options();
    const std::vector<double> nm = wavelengths(400, 700, 10);
    const auto refused = [&](std::vector<double> r, const std::vector<double>& waves, const FitOptions& o) {
        return message_of([&] { fit_spectra(r, waves, o, 1, {}); });
    };
    std::vector<double> r(2 * nm.size(), 0.3);
    r[nm.size() + 2] = std::nan("");
    EXPECT_EQ(refused(r, nm, options), "spectrum 1: 420 nm: nan is outside 0 to 1");
    r[nm.size() + 2] = 1.5;
    EXPECT_EQ(refused(r, nm, options), "spectrum 1: 420 nm: 1.5 is outside 0 to 1");
    EXPECT_NE(refused({0.3, 0.3}, {500, 400}, options).find("400 after 500 does not increase"), std::string::npos);
    EXPECT_NE(refused({0.3, 0.3}, {400, 500}, options).find("2 are too few, a fit needs 8"), std::string::npos);
    EXPECT_NE(refused({0.3}, {300}, options).find("300"), std::string::npos);
    EXPECT_NE(refused({0.3}, nm, options).find("multiple of 31"), std::string::npos);
    FitOptions outside = options;
    outside.prior_mean[0] = 2;
    EXPECT_NE(refused({}, nm, outside).find("melanin: 2 is outside"), std::string::npos);
    outside = options;
    outside.prior_sd[0] = -1;
    EXPECT_NE(refused({}, nm, outside).find("melanin"), std::string::npos);
    outside.prior_sd.pop_back();
    EXPECT_NE(refused({}, nm, outside).find("10 standard deviations, needs 11"), std::string::npos);
}

TEST(Fit, ThreadsDoNotChangeIt) {
    const std::vector<double> nm = wavelengths(400, 700, 20);
    std::vector<double> spectra;
    for (int k = 0; k < 8; ++k) {
        SkinParameters skin;
        skin.melanin = 0.01 + 0.02 * k;
        const std::vector<double> r = seen(skin, 0.035, nm);
        spectra.insert(spectra.end(), r.begin(), r.end());
    }
    const auto one = fit_spectra(spectra, nm, default_fit_options(), 1, {});
    const auto two = fit_spectra(spectra, nm, default_fit_options(), 2, {});
    for (std::size_t k = 0; k < one.size(); ++k) {
        EXPECT_EQ(one[k].value, two[k].value);
        EXPECT_EQ(one[k].standard_error, two[k].standard_error);
    }
}

}  // namespace
}  // namespace sanguine
