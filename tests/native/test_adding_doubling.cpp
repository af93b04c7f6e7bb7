#include "sanguine/adding_doubling.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "effort.hpp"
#include "reference_cases.hpp"
#include "sanguine/unscattered.hpp"

namespace sanguine {
namespace {

using Stack = std::vector<Layer>;

Solution solved(const Stack& stack, Incidence incidence, double tolerance = 0.01) {
    Effort effort;
    effort.tolerance = tolerance;
    return adding_doubling_solver().solve({stack, incidence, {}}, effort);
}

double sum(const Totals& t) {
    return t.Rd + t.R_unscattered + t.Tt + t.specular;
}

class AddingDoublingReference : public testing::TestWithParam<reference::Case> {};

TEST_P(AddingDoublingReference, WithinTwoTenthsOfAPercent) {
    const reference::Case& c = GetParam();
    const Solution s = solved(c.layers, c.incidence);
    // The bar of the project: 0.2 %, or three standard errors of the reference.
    EXPECT_NEAR(s.Rd, c.scattered_reflectance,
                std::max(0.002 * c.scattered_reflectance, 3 * c.scattered_reflectance_se));
    EXPECT_NEAR(s.Tt, c.transmittance, std::max(0.002 * c.transmittance, 3 * c.transmittance_se));
    EXPECT_NEAR(s.R_unscattered, c.unscattered_reflectance, 3 * c.unscattered_reflectance_se + 1e-9);
    EXPECT_TRUE(s.warnings.empty());
    // Its own convergence: 1e-4 claimed, and kept against many more directions.
    EXPECT_LE(s.error_estimate, 1e-4);
    const Totals fine = adding_doubling(c.layers, c.incidence, max_streams);
    EXPECT_NEAR(s.Rd, fine.Rd, 1e-4 * fine.Rd);
    EXPECT_NEAR(s.Tt, fine.Tt, 1e-4 * fine.Tt);
}

INSTANTIATE_TEST_SUITE_P(Cases, AddingDoublingReference, testing::ValuesIn(reference::cases()),
                         [](const auto& test) { return std::string(test.param.id); });

TEST(AddingDoubling, PublishedSlabsAndHalfSpaces) {
    // Van de Hulst 1980, as quoted by Wang, Jacques and Zheng 1995 (MCML), table 1: five digits.
    const Totals slab = adding_doubling(Stack{{1, 9, 0.75, 1, 0.2}}, Incidence::normal, 32);
    EXPECT_NEAR(slab.Rd, 0.09739, 1e-5);
    EXPECT_NEAR(slab.Tt, 0.66096, 1e-5);
    // Giovanelli 1955, the same table: four digits, with the specular reflection. His own last digit is uncertain.
    const Totals half = adding_doubling(Stack{{1, 9, 0, 1.5, half_space}}, Incidence::normal, 32);
    EXPECT_NEAR(half.Rd + half.specular, 0.2600, 1e-4);
}

/// Chandrasekhar's H function of isotropic scattering, from its closed form
/// ln H(mu) = -(mu / pi) * integral over x > 0 of ln(1 - albedo atan(x) / x) / (1 + mu^2 x^2), with x = tan(t).
double h_function(double albedo, double mu) {
    constexpr int count = 20000;
    double total = 0;
    for (int i = 0; i < count; ++i) {
        const double t = (i + 0.5) / count * std::numbers::pi / 2, c = std::cos(t), s = std::sin(t);
        total += std::log(1 - albedo * t / std::tan(t)) / (c * c + mu * mu * s * s);
    }
    return std::exp(-mu / 2 / count * total);
}

TEST(AddingDoubling, IsotropicHalfSpaceIsChandrasekhars) {
    for (const double albedo : {0.1, 0.5, 0.9, 0.99}) {
        const Stack stack{{1 - albedo, albedo, 0, 1, half_space}};
        const double exact = 1 - h_function(albedo, 1) * std::sqrt(1 - albedo);
        // 1e-6: the midpoint rule above has 20,000 points and a logarithmic end; streams converge beyond that.
        EXPECT_NEAR(adding_doubling(stack, Incidence::normal, 24).Rd / exact, 1, 1e-6) << albedo;
    }
}

TEST(AddingDoubling, ClearAndAbsorbingStacksHaveNoScatteredLight) {
    for (const Incidence incidence : {Incidence::normal, Incidence::diffuse}) {
        const Stack stack{{0, 0, 0, 1.5, 1}, {2, 0, 0.5, 1.2, 0.3}, {0, 0, 0, 3, 1e-6}};
        const UnscatteredLight light = unscattered(stack, incidence);
        const Totals t = adding_doubling(stack, incidence, 8);
        EXPECT_EQ(t.Rd, 0);
        EXPECT_EQ(t.Tt, light.transmitted);
        EXPECT_EQ(t.R_unscattered, light.reflected);
    }
}

TEST(AddingDoubling, OneScatteringIsExactInThinLayers) {
    // Isotropic, matched, first order: half of what scatters goes up. Relative precision down to nothing.
    for (const double mu_s : {1e-3, 1e-12, 1e-30, 1e-150, 5e-324}) {
        const Stack stack{{0, mu_s, 0, 1, 1e-6}};
        const Totals t = adding_doubling(stack, Incidence::normal, 8);
        // Below 1e-200 a layer counts as clear.
        const double expected = mu_s > 1e-190 ? mu_s * 1e-6 / 2 : 0;
        EXPECT_NEAR(t.Rd, expected, 1e-7 * expected) << mu_s;
    }
    // The same between two faces: doubling the little that scatters doubles the answer, trapped light included.
    const auto rd = [](double mu_s) {
        const Stack stack{{0, 0, 0, 1.7, 1}, {1, mu_s, 0.8, 1.4, 0.1}, {0, 0, 0, 2, 1}};
        return adding_doubling(stack, Incidence::normal, 8).Rd;
    };
    EXPECT_NEAR(rd(2e-12) / rd(1e-12), 2, 1e-9);
    EXPECT_NEAR(rd(2e-40) / rd(1e-40), 2, 1e-12);
}

TEST(AddingDoubling, ConservativeStacksLoseNothing) {
    for (const Incidence incidence : {Incidence::normal, Incidence::diffuse})
        for (const double mu_s : {1e-9, 1e-3, 1.0, 1e3, 1e6})
            for (const double thickness : {1e-6, 0.1, 1000.0})
                for (const double g : {-0.99, -0.5, 0.0, 0.9, 0.999})
                    for (const double n : {1.0, 1.4, 3.0}) {
                        const Totals t = adding_doubling(Stack{{0, mu_s, g, n, thickness}}, incidence, 8);
                        // Rounding errors of some forty doublings.
                        EXPECT_NEAR(sum(t), 1, 1e-9) << mu_s << " " << thickness << " " << g << " " << n;
                        EXPECT_LE(sum(t), 1 + 1e-9);
                    }
    for (const double g : {-0.99, 0.0, 0.8, 0.999})
        for (const double n : {1.0, 1.4, 3.0}) {
            const Stack stack{{0, 3, 0.5, 1.5, 0.1}, {0, 1e-3, g, n, half_space}};
            EXPECT_NEAR(sum(adding_doubling(stack, Incidence::normal, 8)), 1, 1e-8) << g << " " << n;
            EXPECT_NEAR(sum(adding_doubling(stack, Incidence::diffuse, 8)), 1, 1e-8) << g << " " << n;
        }
}

TEST(AddingDoubling, ErrorFallsAndIsTold) {
    const Stack stack{{2, 40, 0.9, 1.45, 0.1}, {0.2, 20, 0.8, 1.36, 2}};
    const Totals fine = adding_doubling(stack, Incidence::normal, max_streams);
    double allowed = 3e-2;
    for (const int streams : {8, 16, 32, 64}) {
        const Totals t = adding_doubling(stack, Incidence::normal, streams);
        const double error = std::max(std::fabs(t.Rd / fine.Rd - 1), std::fabs(t.Tt / fine.Tt - 1));
        EXPECT_LT(error, allowed) << streams;
        allowed /= 10;
    }
    for (const double tolerance : {1e-2, 1e-4, 1e-6}) {
        const Solution s = solved(stack, Incidence::normal, tolerance);
        EXPECT_LE(s.error_estimate, tolerance);
        EXPECT_LE(std::fabs(s.Rd / fine.Rd - 1), s.error_estimate + 1e-7);
        EXPECT_LE(std::fabs(s.Tt / fine.Tt - 1), s.error_estimate + 1e-7);
    }
}

TEST(AddingDoubling, SplittingALayerChangesNothing) {
    const Stack whole{{0.3, 7, 0.85, 1.4, 0.5}}, split{{0.3, 7, 0.85, 1.4, 0.013}, {0.3, 7, 0.85, 1.4, 0.487}};
    for (const Incidence incidence : {Incidence::normal, Incidence::diffuse}) {
        const Totals a = adding_doubling(whole, incidence, 8), b = adding_doubling(split, incidence, 8);
        // The start layers differ: their error is 3e-9 of the steepest stream.
        EXPECT_NEAR(a.Rd, b.Rd, 1e-9);
        EXPECT_NEAR(a.Tt, b.Tt, 1e-9);
    }
    // A half-space is what a very thick layer tends to.
    const Totals deep = adding_doubling(Stack{{0.1, 5, 0.7, 1.4, 1000}}, Incidence::normal, 8);
    const Totals endless = adding_doubling(Stack{{0.1, 5, 0.7, 1.4, half_space}}, Incidence::normal, 8);
    EXPECT_NEAR(deep.Rd, endless.Rd, 1e-8);
}

TEST(AddingDoubling, TheReversedStackTransmitsTheSame) {
    std::mt19937_64 random(11);
    std::uniform_real_distribution<double> n(1, 3), g(-0.9, 0.95), power(-3, 2), length(-3, 0);
    for (std::size_t trial = 0; trial < 60; trial += sweep_stride) {
        Stack stack(1 + trial % 8);
        for (Layer& layer : stack)
            layer = {std::pow(10, power(random) - 2), std::pow(10, power(random)), g(random), n(random),
                     std::pow(10, length(random))};
        const Stack reversed(stack.rbegin(), stack.rend());
        const Solution down = solved(stack, Incidence::diffuse, 1e-3), up = solved(reversed, Incidence::diffuse, 1e-3);
        // Exact in the discrete equations but for the share that first scatters, which is scaled from the quadrature's
        // value to the true one, differently on either side: within the errors that are claimed.
        EXPECT_LE(std::max(down.error_estimate, up.error_estimate), 1e-3) << trial;
        EXPECT_NEAR(down.Tt, up.Tt, (down.error_estimate + up.error_estimate + 1e-9) * up.Tt) << trial;
    }
}

TEST(AddingDoubling, AbsorptionOnlyDarkens) {
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> n(1, 3), g(-0.9, 0.95), power(-3, 3), length(-4, 0);
    for (int trial = 0; trial < 40; ++trial) {
        Stack stack(1 + trial % 4);
        for (Layer& layer : stack)
            layer = {0, std::pow(10, power(random)), g(random), n(random), std::pow(10, length(random))};
        const Incidence incidence = trial % 2 ? Incidence::normal : Incidence::diffuse;
        for (std::size_t i = 0; i < stack.size(); ++i) {
            double Rd = 2, Tt = 2;
            for (const double mu_a : {0.0, 1e-12, 1e-6, 1e-3, 0.1, 3.0, 100.0, 1e5}) {
                stack[i].mu_a = mu_a;
                const Totals t = adding_doubling(stack, incidence, 8);
                EXPECT_LE(t.Rd, Rd + 1e-9) << trial << " layer " << i << " " << mu_a;
                EXPECT_LE(t.Tt, Tt + 1e-9) << trial << " layer " << i << " " << mu_a;
                Rd = t.Rd;
                Tt = t.Tt;
            }
            stack[i].mu_a = 0.01;
        }
    }
}

TEST(AddingDoubling, ExtremesGiveLight) {
    std::mt19937_64 random(3);
    const auto pick = [&](std::initializer_list<double> values) {
        return values.begin()[std::uniform_int_distribution<std::size_t>(0, values.size() - 1)(random)];
    };
    double slowest = 0;
    for (int trial = 0; trial < 1500; ++trial) {
        Stack stack(1 + trial % 8);
        for (Layer& layer : stack)
            layer = {pick({0, 5e-324, 1e-300, 1e-12, 1e-3, 1, 1e3, 1e6}),
                     pick({0, 5e-324, 1e-300, 1e-12, 1e-3, 1, 1e3, 1e6}),
                     pick({-0.99, -0.5, 0, 1e-9, 0.8, 0.95, 0.999}),
                     pick({1, 1 + 1e-12, 1 + 1e-7, 1.0001, 1.33, 1.4, 1.5, 3, 4}), pick({1e-6, 1e-3, 1, 1e3})};
        if (trial % 3 == 0)
            stack.back().thickness = half_space;
        const Incidence incidence = trial % 2 ? Incidence::normal : Incidence::diffuse;
        const auto begin = std::chrono::steady_clock::now();
        const Totals t = adding_doubling(stack, incidence, trial % 5 ? 8 : 24);
        slowest = std::max(slowest, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
        for (const double value : {t.Rd, t.R_unscattered, t.Tt, t.specular}) {
            ASSERT_TRUE(std::isfinite(value)) << trial;
            ASSERT_GE(value, 0) << trial;
        }
        ASSERT_LE(sum(t), 1 + 1e-9) << trial;
    }
    // Milliseconds, but a shared machine under sanitizers may be slow.
    EXPECT_LT(slowest, 2);
}

TEST(AddingDoubling, SaysThatItHasNoProfile) {
    const Solution s = adding_doubling_solver().solve({{{1, 10, 0.8, 1.4, half_space}}, Incidence::normal, {0.1}}, {});
    EXPECT_TRUE(s.R_per_mm2.empty());
    ASSERT_EQ(s.warnings.size(), 1u);
    EXPECT_NE(s.warnings[0].find("profile"), std::string::npos);
}

TEST(AddingDoubling, CanBeStopped) {
    Effort effort;
    effort.progress = [](std::size_t, std::size_t) { return false; };
    EXPECT_THROW(adding_doubling_solver().solve({{{1, 10, 0.8, 1.4, half_space}}, Incidence::normal, {}}, effort),
                 Cancelled);
}

}  // namespace
}  // namespace sanguine
