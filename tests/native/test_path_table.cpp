#include "sanguine/path_table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "reference_cases.hpp"
#include "sanguine/fresnel.hpp"
#include "sanguine/photon_tracer.hpp"
#include "sanguine/radial_profile.hpp"

namespace sanguine {
namespace {

using namespace path_grid;
using Energies = std::array<double, rings>;

const PathTable& table(Incidence incidence = Incidence::diffuse) {
    return PathTable::embedded(incidence);
}

constexpr Incidence both[] = {Incidence::diffuse, Incidence::normal};

double solve(double tau, double a1, double a2, Energies& energy, Incidence incidence = Incidence::diffuse) {
    PathTable::DermisSums dermis;
    table(incidence).sum_dermis(tau, a2, dermis);
    return table(incidence).ring_energies(dermis, a1, energy);
}

/// Monte Carlo with the same layers, weighted by exp(-a L) so that dark skin too is measured well.
struct Direct {
    double total = 0, standard_error = 0;
    Energies energy{};
};

Direct trace(double tau, double a1, double a2, int photons, Incidence incidence = Incidence::diffuse) {
    const double mu_s = 1 / (1 - anisotropy), dying = std::fmin(a1, a2);
    const std::vector<Layer> stack = {{dying, mu_s, anisotropy, refractive_index, tau},
                                      {dying, mu_s * dermis_scattering, anisotropy, refractive_index,
                                       std::numeric_limits<double>::infinity()}};
    Direct d;
    double squares = 0;
    for (int p = 0; p < photons; ++p) {
        PhotonRandom random(4242, p);  // another seed than the table's
        const PhotonEnd end = trace_photon(stack, incidence, random);
        if (end.fate != Fate::left_top)
            continue;
        const double weight = std::exp(-(a1 - dying) * end.path[0] - (a2 - dying) * end.path[1]) / photons;
        d.total += weight;
        squares += weight * weight;
        d.energy[ring_of(end.radius)] += weight;
    }
    d.standard_error = std::sqrt(squares - d.total * d.total / photons);
    return d;
}

TEST(PathTable, ReferenceCaseUnderDiffuseLight) {
    // p13: measured difference of the total 0.10 %, of the rings 0.5 % in L1; table and reference have 0.1 % of noise.
    const reference::Case& c = reference::find("p13");
    const double mu_s_prime = c.layers[0].mu_s * (1 - c.layers[0].g), unit = 1 / mu_s_prime;
    Energies energy;
    const double total = solve(c.layers[0].thickness / unit, c.layers[0].mu_a * unit, c.layers[1].mu_a * unit, energy);
    EXPECT_NEAR(total / c.scattered_reflectance, 1, 0.004);

    const RadialProfile profile(energy, unit);
    double l1 = std::fabs(profile.energy_within(c.rings[0].inner) - c.below_first_ring);
    for (const reference::Ring& ring : c.rings)
        l1 += std::fabs(profile.energy_within(ring.outer) - profile.energy_within(ring.inner) - ring.fraction);
    EXPECT_LT(l1 / c.scattered_reflectance, 0.015);
}

TEST(PathTable, AgreesWithDirectTracingBetweenNodes) {
    // tau, a1, a2 and the error allowed beyond four standard errors of the direct run: interpolation between nodes and
    // bins of path length, noise of the table. 0.4 % for ordinary skin, 2 % for the strongest pigments.
    const double cases[][4] = {
        {0.6, 0.01, 0.01, 0.004},   {0.35, 0.2, 0.02, 0.004}, {0.6, 0.02, 0.3, 0.004},  {0.05, 1, 0.02, 0.004},
        {0.012, 3, 0.01, 0.004},    {3, 0.3, 0.02, 0.004},    {6.8, 0.05, 0.02, 0.004}, {0.6, 1, 0.05, 0.004},
        {13, 0.02, 0.01, 0.004},    {0.3, 0.0031, 0.0031, 0.004},
        {0.033, 0.5, 3, 0.02},      {0.6, 5, 0.1, 0.02},      {1.1, 4, 2, 0.02},        {0.01, 5.8, 0.0061, 0.01},
    };
    for (const auto& [tau, a1, a2, tolerance] : cases) {
        for (const Incidence incidence : both) {
            const Direct direct = trace(tau, a1, a2, 50000, incidence);
            Energies energy;
            const double total = solve(tau, a1, a2, energy, incidence);
            EXPECT_NEAR(total / direct.total, 1, tolerance + 4 * direct.standard_error / direct.total)
                << "tau " << tau << " a1 " << a1 << " a2 " << a2;
        }
    }
}

TEST(PathTable, RingsAgreeWithDirectTracing) {
    // 200,000 photons in some 40 rings: noise alone makes an L1 error of about 1.5 %; one of 3 % would show.
    const Direct direct = trace(0.5, 0.05, 0.04, 200000);
    Energies energy;
    solve(0.5, 0.05, 0.04, energy);
    double l1 = 0;
    for (int k = 0; k < rings; ++k)
        l1 += std::fabs(energy[k] - direct.energy[k]);
    EXPECT_LT(l1 / direct.total, 0.025);
}

TEST(PathTable, RingsAddUpToTheTotal) {
    for (const double tau : {0.0, 0.004, 0.3, 2.0, 7.3, 15.0})
        for (const double a1 : {0.003, 0.3, 5.9, 100.0})
            for (const double a2 : {0.003, 0.3, 6.8, 100.0}) {
                Energies energy;
                const double total = solve(tau, a1, a2, energy);
                double sum = 0;
                for (const double e : energy) {
                    EXPECT_GE(e, 0);
                    sum += e;
                }
                EXPECT_NEAR(sum / total, 1, 1e-12);
                // The total alone adds the same floats in another order: 1e-6 is their rounding.
                EXPECT_NEAR(table().total(tau, a1, a2) / total, 1, 1e-6);
            }
}

TEST(PathTable, FloatIsNearDouble) {
    // The bound that path_table.hpp states. Exponentials of large arguments carry most of it, so it is the opaque
    // corners that come near; where less than a millionth of the light is left, only its size is held.
    double worst = 0, worst_ring = 0;
    for (const Incidence incidence : both)
        for (const double tau : {0.0, 0.013, 0.3, 2.0, 14.9})
            for (const double a1 : {0.002, 0.05, 1.0, 30.0, 600.0})
                for (const double a2 : {0.002, 0.05, 1.0, 30.0, 600.0}) {
                    Energies energy, exact;
                    const double total = solve(tau, a1, a2, energy, incidence);
                    const double expected = table(incidence).ring_energies_in_double(tau, a1, a2, exact);
                    const double error = std::fabs(total / expected - 1);
                    EXPECT_LT(error, expected > 1e-6 ? 1e-6 : 1e-3) << tau << ' ' << a1 << ' ' << a2 << ' ' << expected;
                    if (expected > 1e-6)
                        worst = std::fmax(worst, error);
                    double l1 = 0;
                    for (int k = 0; k < rings; ++k)
                        l1 += std::fabs(energy[k] - exact[k]);
                    if (expected > 1e-6)
                        worst_ring = std::fmax(worst_ring, l1 / expected);
                }
    EXPECT_LT(worst_ring, 5e-6);
    std::printf("float against double: total %.1e, L1 of the rings %.1e\n", worst, worst_ring);
}

TEST(PathTable, GradientIsTheSlope) {
    // Central differences over 1 % of each argument; their own error is of the order of 1e-4, the rounding of float
    // 1e-6 over 2e-2 likewise.
    for (const double tau : {0.02, 0.31, 2.2, 9.1})
        for (const double a1 : {0.004, 0.06, 2.0})
            for (const double a2 : {0.004, 0.06, 2.0}) {
                const PathTable::Gradient g = table().total_with_gradient(tau, a1, a2);
                EXPECT_NEAR(g.total / table().total(tau, a1, a2), 1, 1e-6);
                const double h = 0.01;
                const auto slope = [&](double dt, double d1, double d2) {
                    return (table().total(tau + dt, a1 + d1, a2 + d2) - table().total(tau - dt, a1 - d1, a2 - d2)) / 2;
                };
                const double tolerance = 3e-4 * g.total;
                EXPECT_NEAR(g.by_a1 * a1 * h, slope(0, a1 * h, 0), tolerance * h + 2e-6 * g.total);
                EXPECT_NEAR(g.by_a2 * a2 * h, slope(0, 0, a2 * h), tolerance * h + 2e-6 * g.total);
                // The slope by tau bends at the nodes, which lie 2 % to 20 % apart.
                EXPECT_NEAR(g.by_tau * tau * h, slope(tau * h, 0, 0), 10 * tolerance * h + 2e-6 * g.total);
                // Deep below black pigment the cubic may turn a slope of nothing around.
                EXPECT_LT(g.by_a1 * a1, 1e-5 * g.total);
                EXPECT_LT(g.by_a2 * a2, 1e-5 * g.total);
            }
}

TEST(PathTable, OpaqueIsFiniteAndDarkerStill) {
    for (const Incidence incidence : both)
        for (const double tau : {0.0, 1e-6, 0.02, 0.5, 15.0}) {
            double last1 = 1, last2 = 1;
            for (double a = 0.002; a < 1e12; a *= 3) {
                Energies energy;
                const double by1 = solve(tau, a, 0.1, energy, incidence);
                for (const double e : energy)
                    ASSERT_TRUE(std::isfinite(e) && e >= 0) << tau << ' ' << a;
                const double by2 = table(incidence).total(tau, 0.1, a);
                ASSERT_TRUE(by1 >= 0 && by2 >= 0);
                ASSERT_LE(by1, last1 * (1 + 2e-6)) << tau << ' ' << a;
                ASSERT_LE(by2, last2 * (1 + 2e-6)) << tau << ' ' << a;
                last1 = by1;
                last2 = by2;
                const PathTable::Gradient g = table(incidence).total_with_gradient(tau, a, a);
                ASSERT_TRUE(std::isfinite(g.by_tau) && std::isfinite(g.by_a1) && std::isfinite(g.by_a2));
                const PathTable::Uncertainty u = table(incidence).uncertainty(tau, a, a);
                ASSERT_TRUE(u.total >= 0 && u.total <= 1 && u.profile >= 0 && u.profile <= 1) << tau << ' ' << a;
            }
        }
}

TEST(PathTable, HasNoJumpsBetweenItsNodes) {
    // Stencils change at the nodes; left and right of each the result is the same, to the rounding of float.
    for (const Incidence incidence : both)
        for (int k = 1; k + 1 < nodes; ++k)
            for (const double a1 : {0.01, 5.0}) {
                const double tau = node_thickness(k);
                Energies below, above;
                const double step = 1e-9;
                const double left = solve(tau * (1 - step), a1, 0.02, below, incidence);
                const double right = solve(tau * (1 + step), a1, 0.02, above, incidence);
                EXPECT_NEAR(left / right, 1, 2e-6);
                for (int i = 0; i < rings; ++i)
                    EXPECT_NEAR(below[i], above[i], 5e-6 * (below[i] + 1e-6 * left)) << k << ' ' << i;
            }
}

TEST(PathTable, NothingBeyondWhatEntered) {
    // Hardly any absorption, any thickness: bright, but less than the 1 - F that entered.
    for (const double tau : {0.0, 0.1, 1.0, 7.3, 15.0}) {
        const double r = table().total(tau, reference_absorption, reference_absorption);
        EXPECT_LT(r, 1 - diffuse_fresnel(refractive_index));
        EXPECT_GT(r, 0.65);
        const double beam = table(Incidence::normal).total(tau, reference_absorption, reference_absorption);
        EXPECT_LT(beam, 1 - std::pow(0.4 / 2.4, 2));
        EXPECT_GT(beam, 0.65);
    }
}

TEST(PathTable, DarkerWithEveryAbsorption) {
    for (const double tau : {0.003, 0.02, 0.3, 1.7, 7.2}) {
        for (double a = 0.006; a < 6; a *= 1.3) {
            EXPECT_GT(table().total(tau, a, 0.1), table().total(tau, a * 1.3, 0.1)) << tau << ' ' << a;
            EXPECT_GT(table().total(tau, 0.1, a), table().total(tau, 0.1, a * 1.3)) << tau << ' ' << a;
        }
    }
}

TEST(PathTable, NeverBrighterWithMoreAbsorption) {
    // The bounds that path_table.hpp states, over a fine ladder of each absorption beside any other.
    for (const Incidence incidence : both)
        for (const double tau : {1e-6, 1e-3, 0.004, 0.012, 0.03, 0.07, 0.2, 0.35, 0.6, 1.0, 2.9, 8.0, 15.0})
            for (const double other : {0.002, 0.02, 0.2, 2.0, 12.0, 20.0, 200.0, 600.0}) {
                double last1 = 1, last2 = 1;
                for (double a = 0.002; a <= 600; a *= 1.3) {
                    const double bound = std::fmax(a, other) <= 12 ? 2e-6 : 2e-3;
                    const double by1 = table(incidence).total(tau, a, other), by2 = table(incidence).total(tau, other, a);
                    ASSERT_LE(by1, last1 * (1 + bound)) << tau << ' ' << a << ' ' << other;
                    ASSERT_LE(by2, last2 * (1 + bound)) << tau << ' ' << a << ' ' << other;
                    last1 = by1;
                    last2 = by2;
                }
            }
}

TEST(PathTable, ThinEpidermisTurnsIntoBareDermis) {
    const double bare = table().total(0, 3, 0.05);
    double last = 1;
    for (const double tau : {1e-2, 1e-3, 1e-4, 1e-6}) {
        const double gap = std::fabs(table().total(tau, 3, 0.05) / bare - 1);
        EXPECT_LT(gap, last);
        last = gap;
    }
    EXPECT_LT(last, 1e-4);
    // With equal absorption in both layers a thin epidermis cannot matter at all.
    EXPECT_NEAR(table().total(0.004, 0.05, 0.05) / table().total(0, 0.05, 0.05), 1, 0.005);
}

TEST(PathTable, ThickEpidermisIsAHalfSpace) {
    // Bare dermis at tau = 0 is a half-space that scatters half as much: with half the absorption it is the same
    // problem as an epidermis without end, and 15 mean free paths with absorption 0.5 are as good as that. The same
    // random numbers made both, so that only the bins of path length can differ.
    EXPECT_NEAR(table().total(max_thickness, 0.5, 0.25) / table().total(0, 1, 0.25), 1, 0.001);
}

TEST(PathTable, EveryNodeHasItsPhotons) {
    for (const Incidence incidence : both)
        for (int k = 0; k < nodes; ++k)
            EXPECT_GT(table(incidence).photons(k), 5'000'000u) << "a quick bake was committed";
    EXPECT_EQ(node_thickness(0), 0);
    EXPECT_NEAR(node_thickness(nodes - 1), max_thickness, 1e-12);
}

TEST(PathTable, RefusesDamagedFiles) {
    EXPECT_THROW(PathTable(std::span<const std::uint8_t>()), std::runtime_error);
    const std::vector<std::uint8_t> noise(100, 7);
    EXPECT_THROW(PathTable{noise}, std::runtime_error);
}

TEST(Crc32, KnownValue) {
    const std::array<std::uint8_t, 9> text = {'1', '2', '3', '4', '5', '6', '7', '8', '9'};
    EXPECT_EQ(crc32(text), 0xcbf43926u);
}

TEST(RadialProfile, IntegratesToItsRings) {
    Energies energy;
    const double total = solve(0.6, 0.05, 0.04, energy);
    const RadialProfile profile(energy, 0.2);
    EXPECT_NEAR(profile.energy_within(1e4), total, 1e-12);
    // Midpoints in ln r, fine enough that 1e-6 is the rule's own error.
    double sum = profile.energy_within(1e-4);
    constexpr int steps = 40000;
    const double h = std::log(60 / 1e-4) / steps;
    for (int i = 0; i < steps; ++i) {
        const double r = 1e-4 * std::exp((i + 0.5) * h);
        sum += 2 * M_PI * r * r * profile.density(r) * h;
    }
    EXPECT_NEAR(sum / total, 1, 1e-6);
}

TEST(RadialProfile, IsContinuousAndNeverNegative) {
    Energies energy;
    solve(0.1, 2, 1, energy);
    const RadialProfile profile(energy, 0.1);
    for (int k = 0; k < rings - 1; ++k) {
        const double edge = 0.1 * ring_edge(k);
        const double below = profile.density(edge * (1 - 1e-9)), above = profile.density(edge * (1 + 1e-9));
        EXPECT_GE(below, 0);
        EXPECT_NEAR(below, above, 1e-6 * (below + 1e-12)) << edge;
    }
}

TEST(RadialProfile, LadderIsTheSameFunction) {
    Energies energy;
    solve(0.6, 0.05, 0.04, energy);
    for (const double unit : {0.001, 0.13, 0.25, 7.0, 1e4}) {
        const RadialProfile profile(energy, unit);
        std::vector<double> within(65);
        profile.energy_within_ladder(0.0005, within);
        double radius = 0.0005;
        for (const double w : within) {
            EXPECT_NEAR(w, profile.energy_within(radius), 1e-12) << unit << ' ' << radius;
            radius *= radius_ratio;
        }
    }
}

}  // namespace
}  // namespace sanguine
