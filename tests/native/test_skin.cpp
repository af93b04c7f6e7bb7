#include "sanguine/skin.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <set>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "effort.hpp"
#include "sanguine/adding_doubling.hpp"
#include "sanguine/burley.hpp"
#include "sanguine/fresnel.hpp"

namespace sanguine {
namespace {

std::vector<double> wavelengths(double step) {
    std::vector<double> nm;
    for (double w = 380; w <= 780; w += step)
        nm.push_back(w);
    return nm;
}

/// Both ends and the middle of every hard range that reaches the tissue; where the default is an end, both ends.
std::vector<SkinParameters> extremes() {
    std::vector<SkinParameters> skins(1);
    for (const ParameterRow& p : parameter_rows) {
        if (p.group == "surface")
            continue;
        std::vector<SkinParameters> more;
        for (const SkinParameters& skin : skins)
            for (const double value : std::set{p.hard_min, p.default_value, p.hard_max}) {
                more.push_back(skin);
                more.back().*p.field = value;
            }
        skins = more;
    }
    return skins;
}

TEST(Skin, EveryExtremeIsPhysical) {
    const std::vector<SkinParameters> skins = extremes();
    const double entry = 1 - diffuse_fresnel(1.4);
    for (const double r : reflectance(skins, wavelengths(10), 0, {})) {
        ASSERT_TRUE(std::isfinite(r));
        ASSERT_GT(r, 0);
        ASSERT_LT(r, entry);
    }
}

TEST(Skin, ProfileIntegratesToReflectance) {
    const std::vector<SkinParameters> skins = extremes();
    const std::vector<double> nm = wavelengths(40);
    const std::vector<double> r = reflectance(skins, nm, 0, {});
    std::vector<double> within(r.size());
    solve_profiles(skins, nm, 0, {}, [&](std::size_t i, std::size_t w, const RadialProfile& profile) {
        within[i * nm.size() + w] = profile.energy_within(1e6);
    });
    for (std::size_t i = 0; i < r.size(); ++i)
        ASSERT_NEAR(within[i] / r[i], 1, 1e-6);  // float sums in another order
}

TEST(Skin, DarkerWithWhatAbsorbs) {
    const std::vector<double> nm = wavelengths(10);
    const std::pair<double SkinParameters::*, double> steps[] = {
        {&SkinParameters::melanin, 0.01}, {&SkinParameters::hemoglobin, 0.01}, {&SkinParameters::ink_per_mm, 0.8}};
    for (const auto& [field, step] : steps)
        for (const double thickness : {0.001, 0.02, 0.1, 0.5}) {
            std::vector<SkinParameters> skins(26);
            for (std::size_t i = 0; i < skins.size(); ++i) {
                skins[i].epidermis_thickness_mm = thickness;
                skins[i].*field = step * static_cast<double>(i);
            }
            const std::vector<double> r = reflectance(skins, nm, 0, {});
            // Under half a millimetre of pigment blood changes less than a float's last digits, which are free to move.
            for (std::size_t i = 0; i + 1 < skins.size(); ++i)
                for (std::size_t w = 0; w < nm.size(); ++w)
                    ASSERT_GT(r[i * nm.size() + w] * (1 + 1e-6), r[(i + 1) * nm.size() + w])
                        << i << ' ' << nm[w] << ' ' << thickness;
        }
}

TEST(Skin, TattoosAsAddingDoublingSeesThem) {
    // From a shadow to more ink than shows: 1 % is the project's bar for totals.
    double worst = 0;
    const std::vector<double> nm = {450, 550, 650};
    for (const double ink : {0.3, 2.0, 10.0, 20.0}) {
        SkinParameters skin;
        skin.ink_per_mm = ink;
        const std::vector<double> seen = reflectance({&skin, 1}, nm, 1, {});
        for (std::size_t w = 0; w < nm.size(); ++w) {
            const OpticalCoefficients c = optical_coefficients(skin, chromophores_at(nm[w]));
            const Problem problem{{{c.mu_a_epidermis, 5 * c.mu_s_prime_epidermis, 0.8, 1.4, skin.epidermis_thickness_mm},
                                   {c.mu_a_dermis, 5 * c.mu_s_prime_dermis, 0.8, 1.4, half_space}},
                                  Incidence::diffuse, {}};
            Effort effort;
            effort.tolerance = 1e-4;
            const double exact = adding_doubling_solver().solve(problem, effort).Rd;
            EXPECT_NEAR(seen[w] / exact, 1, 0.01) << ink << " 1/mm, " << nm[w] << " nm: " << exact;
            worst = std::fmax(worst, std::fabs(seen[w] / exact - 1));
        }
    }
    std::printf("tattoos: worst %.2f %%\n", 100 * worst);
}

TEST(Skin, RgbRingsAddUpToTheColour) {
    const std::vector<SkinParameters> skins(1);
    const Matrix3 rgb = rgb_from_xyz("rec709");
    const std::vector<RgbRings> rings = rgb_rings(skins, rgb, 1, {});
    Colour sum{};
    for (const Colour& ring : rings.front())
        for (int c = 0; c < 3; ++c)
            sum[c] += ring[c];
    const std::vector<double> nm = wavelengths(5), r = reflectance(skins, nm, 1, {});
    const std::vector<Colour> weights = xyz_weights(nm);
    Colour xyz{};
    for (std::size_t w = 0; w < nm.size(); ++w)
        for (int c = 0; c < 3; ++c)
            xyz[c] += weights[w][c] * r[w] / 100;
    const Colour expected = rgb * xyz;
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(sum[c], expected[c], 1e-6);
}

TEST(Skin, ThreadsDoNotChangeTheResult) {
    std::vector<SkinParameters> skins = extremes();
    skins.resize(60);
    const Matrix3 rgb = rgb_from_xyz("acescg");
    const auto one = rgb_rings(skins, rgb, 1, {}), three = rgb_rings(skins, rgb, 3, {});
    EXPECT_EQ(one, three);
}

TEST(Burley, LobeHasUnitEnergy) {
    EXPECT_NEAR(burley_energy_within(1e3, 0.5), 1, 1e-12);
    EXPECT_EQ(burley_energy_within(0, 0.5), 0);
    // Its derivative is 2 pi r times the lobe.
    const double r = 0.7, d = 0.5, h = 1e-5;
    const double lobe = (std::exp(-r / d) + std::exp(-r / (3 * d))) / (8 * M_PI * d * r);
    EXPECT_NEAR((burley_energy_within(r + h, d) - burley_energy_within(r - h, d)) / (2 * h), 2 * M_PI * r * lobe, 1e-8);
}

std::vector<double> rings_of(const std::vector<std::pair<double, double>>& lobes) {
    std::vector<double> energy;
    double inside = 0;
    for (const double edge : rgb_ring_edges_mm()) {
        double within = 0;
        for (const auto& [weight, d] : lobes)
            within += weight * burley_energy_within(edge, d);
        energy.push_back(within - inside);
        inside = within;
    }
    return energy;
}

TEST(Burley, RecoversLobes) {
    // The pull of the widths to their start leaves less than 2 % even where the truth lies far from it.
    const BurleyFit fit = fit_burley(rings_of({{0.3, 0.8}, {0.1, 0.05}}), rgb_ring_edges_mm(), 4);
    EXPECT_LT(fit.fit_error, 0.02);
    EXPECT_EQ(fit.clamped, 0);
    const BurleyFit single = fit_burley(rings_of({{0.3, 0.4}}), rgb_ring_edges_mm(), 1);
    EXPECT_LT(single.fit_error, 0.02);
    EXPECT_NEAR(single.d_mm[0], 0.4, 0.01);
}

TEST(Burley, KeepsEnergyAndSign) {
    const std::vector<SkinParameters> all = extremes();
    std::vector<SkinParameters> skins;
    for (std::size_t i = 0; i < all.size(); i += sweep_stride)
        skins.push_back(all[i]);
    for (const char* space : {"rec709", "acescg"})
        for (const SkinLobes& skin : skin_lobes(skins, rgb_from_xyz(space), 4, 0, {}))
            for (int c = 0; c < 3; ++c) {
                const BurleyFit& fit = skin.channel[c];
                double sum = 0;
                for (int k = 0; k < max_lobes; ++k) {
                    ASSERT_GE(fit.weight[k], 0);
                    ASSERT_TRUE(fit.d_mm[k] > 1e-5 && fit.d_mm[k] < 100) << fit.d_mm[k];
                    sum += fit.weight[k];
                }
                ASSERT_NEAR(sum, std::max(0.0, skin.rgb[c]), 1e-9);
                ASSERT_TRUE(std::isfinite(fit.fit_error) && fit.clamped >= 0);
            }
}

TEST(Burley, ChannelWithoutEnergyIsReported) {
    std::vector<double> energy = rings_of({{0.1, 0.3}});
    for (double& e : energy)
        e = -e;
    const BurleyFit fit = fit_burley(energy, rgb_ring_edges_mm(), 4);
    for (const double weight : fit.weight)
        EXPECT_EQ(weight, 0);
    EXPECT_EQ(fit.clamped, 1);
}

TEST(Burley, TakesAnyProfile) {
    // Flat, a single ring (the first, a middle one, the last), spikes of both signs, next to nothing, and all of it
    // shadowed by light that is missing: non-negative weights that add up to the energy, finite widths and errors.
    const std::size_t n = rgb_ring_edges_mm().size();
    std::vector<std::vector<double>> profiles = {std::vector<double>(n, 0.01), std::vector<double>(n, 0.0),
                                                 std::vector<double>(n, 1e-300), std::vector<double>(n, 1e-310)};
    for (const std::size_t ring : {std::size_t{0}, n / 2, n - 1})
        for (const double value : {0.4, 1e-12, 1e12, -0.4}) {
            profiles.emplace_back(n, 0.0);
            profiles.back()[ring] = value;
        }
    for (const double total : {0.5, 1e-3, 1e-9, 1e-16}) {
        profiles.emplace_back(n, 0.0);
        for (std::size_t i = 0; i < n; ++i)
            profiles.back()[i] = i % 2 == 0 ? 1 : -1;
        profiles.back()[3] += total - 1;
    }
    for (const std::vector<double>& energy : profiles)
        for (int count = 1; count <= max_lobes; ++count) {
            double total = 0;
            for (const double e : energy)
                total += e;
            const BurleyFit fit = fit_burley(energy, rgb_ring_edges_mm(), count);
            double sum = 0;
            for (int k = 0; k < max_lobes; ++k) {
                ASSERT_TRUE(fit.weight[k] >= 0 && std::isfinite(fit.weight[k])) << energy[0] << ' ' << count;
                sum += fit.weight[k];
                if (k < count) {
                    ASSERT_TRUE(std::isfinite(fit.d_mm[k]) && fit.d_mm[k] > 0);
                }
            }
            ASSERT_NEAR(sum, std::max(0.0, total), 1e-12 * std::fabs(total)) << energy[0] << ' ' << count;
            ASSERT_TRUE(std::isfinite(fit.fit_error) && std::isfinite(fit.clamped) && fit.clamped >= 0);
        }
}

TEST(Burley, NearTheFloorOfItsForm) {
    // Ordinary skins in linear Rec.709. The best non-negative sum of any number of lobes (linear programming over 90
    // widths) has a median L1 error of 8 %, single channels of bloody skin 20 % and more: skin at one wavelength is
    // narrower in ln r than a lobe. Here: median 7.4 %, worst 13.9 %.
    std::vector<SkinParameters> skins;
    for (const double melanin : {0.015, 0.03, 0.08, 0.2})
        for (const double hemoglobin : {0.005, 0.014, 0.03})
            for (const double oxygenation : {0.5, 0.72, 0.9}) {
                skins.emplace_back();
                skins.back().melanin = melanin;
                skins.back().hemoglobin = hemoglobin;
                skins.back().oxygenation = oxygenation;
            }
    std::vector<double> errors;
    for (const SkinLobes& skin : skin_lobes(skins, rgb_from_xyz("rec709"), 4, 0, {}))
        for (const BurleyFit& fit : skin.channel)
            errors.push_back(fit.fit_error);
    std::sort(errors.begin(), errors.end());
    EXPECT_LT(errors[errors.size() / 2], 0.08);
    EXPECT_LT(errors.back(), 0.15);
}

TEST(Burley, NeighboursHaveNeighbouringLobes) {
    // Steps of a look-up table: the mean of two neighbours' lobes must render like the skin between them. 0.9 % of L1
    // was measured beyond the error of a fit of its own, on a table that doubles hemoglobin from entry to entry.
    const Matrix3 rgb = rgb_from_xyz("rec709");
    for (double hemoglobin = 0.004; hemoglobin < 0.1; hemoglobin *= 2) {
        std::vector<SkinParameters> skins(3);
        for (int i = 0; i < 3; ++i)
            skins[i].hemoglobin = hemoglobin * (1 + 0.5 * i);
        const auto lobes = skin_lobes(skins, rgb, 4, 0, {});
        const auto rings = rgb_rings(skins, rgb, 0, {});
        for (int c = 0; c < 3; ++c) {
            std::vector<std::pair<double, double>> mean;
            for (int k = 0; k < max_lobes; ++k)
                mean.emplace_back((lobes[0].channel[c].weight[k] + lobes[2].channel[c].weight[k]) / 2,
                                  (lobes[0].channel[c].d_mm[k] + lobes[2].channel[c].d_mm[k]) / 2);
            const std::vector<double> between = rings_of(mean);
            double l1 = 0;
            for (std::size_t i = 0; i < between.size(); ++i)
                l1 += std::fabs(between[i] - rings[1][i][c]);
            EXPECT_LT(l1 / lobes[1].rgb[c], lobes[1].channel[c].fit_error + 0.015) << hemoglobin << ' ' << c;
        }
    }
}

TEST(Burley, LobeCountIsChecked) {
    const std::vector<SkinParameters> skins(1);
    EXPECT_THROW(skin_lobes(skins, rgb_from_xyz("rec709"), 0, 1, {}), std::invalid_argument);
    EXPECT_THROW(skin_lobes(skins, rgb_from_xyz("rec709"), 5, 1, {}), std::invalid_argument);
}

TEST(ParallelFor, RunsEveryIndexOnce) {
    for (const int threads : {0, 1, 4}) {
        std::vector<std::atomic<int>> runs(100);
        parallel_for(runs.size(), threads, {}, [&](std::size_t i) { ++runs[i]; });
        for (const auto& count : runs)
            EXPECT_EQ(count, 1);
    }
    parallel_for(0, 0, {}, [](std::size_t) { FAIL(); });
}

TEST(ParallelFor, IsCancelledOnTheCallingThread) {
    const auto caller = std::this_thread::get_id();
    std::atomic<int> runs = 0;
    EXPECT_THROW(parallel_for(1000, 2,
                              [&](std::size_t, std::size_t total) {
                                  EXPECT_EQ(std::this_thread::get_id(), caller);
                                  EXPECT_EQ(total, 1000u);
                                  return false;
                              },
                              [&](std::size_t) {
                                  ++runs;
                                  std::this_thread::sleep_for(std::chrono::milliseconds(5));
                              }),
                 Cancelled);
    EXPECT_LT(runs, 1000);
}

TEST(ParallelFor, PassesErrorsOn) {
    EXPECT_THROW(parallel_for(10, 2, {}, [](std::size_t i) { if (i == 3) throw std::invalid_argument("three"); }),
                 std::invalid_argument);
    EXPECT_THROW(parallel_for(10, -1, {}, [](std::size_t) {}), std::invalid_argument);
}

}  // namespace
}  // namespace sanguine
