#include "sanguine/skin_solver.hpp"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "reference_cases.hpp"
#include "sanguine/adding_doubling.hpp"

namespace sanguine {
namespace {

/// Ordinary skin at some wavelength, under a pencil beam.
Problem skin() {
    return {{{2.7, 31.4, 0.8, 1.4, 0.1}, {0.6, 15.7, 0.8, 1.4, half_space}}, Incidence::normal, {0.01, 0.1, 1, 10}};
}

double total(const Problem& problem) {
    return skin_solver().solve(problem, {}).Rd;
}

TEST(SkinSolver, ReferenceCases) {
    // The bars of the project: 1 % of the total, 4 % of the profile. The stated error has to hold as well, beyond two
    // standard errors of the reference.
    int solved = 0;
    for (const reference::Case& c : reference::cases()) {
        Problem problem{c.layers, c.incidence, {}};
        for (const reference::Ring& ring : c.rings)
            problem.radii_mm.push_back(ring.radius);
        if (!skin_solver().unsuited(problem).empty())
            continue;
        ++solved;
        const Solution s = skin_solver().solve(problem, {});
        const double noise = 2 * c.scattered_reflectance_se / c.scattered_reflectance;
        const double error = s.Rd / c.scattered_reflectance - 1;
        EXPECT_LT(std::fabs(error), 0.01) << c.id;
        double difference = 0, sum = 0;
        for (std::size_t i = 0; i < c.rings.size(); ++i) {
            const reference::Ring& ring = c.rings[i];
            const double area = M_PI * (ring.outer * ring.outer - ring.inner * ring.inner);
            difference += std::fabs(s.R_per_mm2[i] - ring.density) * area;
            sum += ring.density * area;
        }
        EXPECT_LT(difference / sum, 0.04) << c.id;
        Problem totals = problem;
        totals.radii_mm.clear();
        const double stated = skin_solver().solve(totals, {}).error_estimate;
        EXPECT_LT(std::fabs(error), stated + noise) << c.id;
        EXPECT_LT(difference / sum, 2 * s.error_estimate + noise) << c.id;  // of which it states half
        EXPECT_EQ(s.specular > 0 && s.Tt == 0 && s.R_unscattered == 0, true);
        EXPECT_NEAR(s.specular, c.specular, 1e-9) << c.id;
        std::printf("%s: Rd %+.2f %% (stated %.2f %%), profile %.2f %% (stated %.2f %%)\n", c.id, 100 * error,
                    100 * stated, 100 * difference / sum, 200 * s.error_estimate);
    }
    EXPECT_GE(solved, 4);
}

double exact(const Problem& problem) {
    Effort effort;
    effort.tolerance = 1e-4;
    return adding_doubling_solver().solve(problem, effort).Rd;
}

TEST(SkinSolver, StatedErrorHoldsAgainstAddingDoubling) {
    // Lengths in units of 1/mu_s'. Ordinary skin keeps the bar of 1 % as well; adding-doubling is good to 1e-4.
    double worst = 0, worst_share = 0;
    for (const Incidence incidence : {Incidence::normal, Incidence::diffuse})
        for (const double tau : {0.01, 0.06, 0.25, 0.7, 2.0, 6.0, 14.0})
            for (const double a1 : {0.0031, 0.05, 0.3, 1.5, 4.5, 11.0})
                for (const double a2 : {0.0031, 0.02, 0.1, 0.8, 6.0}) {
                    const Problem problem{{{a1, 5, 0.8, 1.4, tau}, {a2, 2.5, 0.8, 1.4, half_space}}, incidence, {}};
                    const Solution s = skin_solver().solve(problem, {});
                    const double error = std::fabs(s.Rd / exact(problem) - 1);
                    EXPECT_LT(error, s.error_estimate + 1e-4) << tau << ' ' << a1 << ' ' << a2;
                    worst_share = std::fmax(worst_share, error / s.error_estimate);
                    if (a1 <= 1.5 && a2 <= 0.1) {
                        EXPECT_LT(error, 0.01) << tau << ' ' << a1 << ' ' << a2;
                        worst = std::fmax(worst, error);
                    }
                }
    std::printf("ordinary skin: worst %.2f %%; worst error over stated error %.2f\n", 100 * worst, worst_share);
}

TEST(SkinSolver, ToleratedInputMovesTheTotalByLittle) {
    // The factors in solvers/skin.cpp: 2.5 per unit of n, 1 per unit of g, mu_s' being kept.
    const double skins[][4] = {{2.7, 6.28, 0.1, 0.6}, {48.6, 10.98, 0.06, 5.1}, {0.05, 6, 0.1, 0.04}, {14.8, 5.3, 0.1, 0.13}};
    for (const Incidence incidence : {Incidence::normal, Incidence::diffuse})
        for (const auto& [mu_a1, mu_s_prime, thickness, mu_a2] : skins) {
            const auto solve = [&](double n, double g) {
                return exact({{{mu_a1, mu_s_prime / (1 - g), g, n, thickness},
                               {mu_a2, mu_s_prime / 2 / (1 - g), g, n, half_space}}, incidence, {}});
            };
            const double fixed = solve(1.4, 0.8);
            for (const double sign : {-1.0, 1.0}) {
                EXPECT_LT(std::fabs(solve(1.4 + sign * 1e-3, 0.8) / fixed - 1), 2.5 * 1e-3);
                EXPECT_LT(std::fabs(solve(1.4, 0.8 + sign * 2e-3) / fixed - 1), 1 * 2e-3);
            }
        }
}

TEST(SkinSolver, TakesRoundedInput) {
    for (const auto& [epidermis, dermis] : {std::pair{31.4, 15.7}, {26.53, 13.26}, {54.86, 27.43}, {4.4, 2.2}}) {
        Problem problem = skin();
        problem.layers[0].mu_s = epidermis;
        problem.layers[1].mu_s = dermis;
        EXPECT_EQ(skin_solver().unsuited(problem), "");
    }
}

TEST(SkinSolver, NamesWhatDoesNotFit) {
    const auto refused = [](auto change, const char* what) {
        Problem problem = skin();
        change(problem);
        const std::string why = skin_solver().unsuited(problem);
        EXPECT_NE(why.find(what), std::string::npos) << "'" << why << "' does not name " << what;
    };
    refused([](Problem& p) { p.layers[0].n = 1.5; }, "layers.0.n");
    refused([](Problem& p) { p.layers[1].g = 0.9; }, "layers.1.g");
    refused([](Problem& p) { p.layers[1].thickness = 2; }, "layers.1.thickness");
    refused([](Problem& p) { p.layers.resize(3, p.layers[1]); }, "layers: 3");
    refused([](Problem& p) { p.layers[0].thickness = 5; }, "layers.0.thickness");
    refused([](Problem& p) { p.layers[0].thickness = 30 / 6.28; }, "layers.0.thickness");  // twice the range
    refused([](Problem& p) { p.layers[0].mu_a = 0; }, "layers.0.mu_a");
    refused([](Problem& p) { p.layers[1].mu_a = 0; }, "layers.1.mu_a");
    refused([](Problem& p) { p.layers[0].mu_a = 1e4; }, "layers.0.mu_a");
    refused([](Problem& p) { p.layers[1].mu_s = 31.4; }, "layers.1.mu_s");
    refused([](Problem& p) { p.layers[0].mu_s = 0; }, "layers.0.mu_s");
    refused([](Problem& p) { p.layers[0].mu_a = std::numeric_limits<double>::quiet_NaN(); }, "layers.0.mu_a");
    refused([](Problem& p) { p.layers.clear(); }, "layers: 0");
}

TEST(SkinSolver, OneLayerIsAnEpidermisOfTheSameTissue) {
    // A half-space is the same at every scale: bare dermis against any mu_s' with the same albedo, to the last bit of
    // float sums, and against the table's thickest epidermis to its noise.
    const Problem bare{{{0.5, 15.7, 0.8, 1.4, half_space}}, Incidence::normal, {}};
    const Problem finer{{{5, 157, 0.8, 1.4, half_space}}, Incidence::normal, {}};
    EXPECT_NEAR(total(finer) / total(bare), 1, 1e-6);
    const Problem deep{{{2, 31.4, 0.8, 1.4, 2.3}, {1, 15.7, 0.8, 1.4, half_space}}, Incidence::normal, {}};
    const Problem half{{{1, 15.7, 0.8, 1.4, half_space}}, Incidence::normal, {}};
    EXPECT_NEAR(total(deep) / total(half), 1, 0.003);
}

TEST(SkinSolver, TotalNeedsNoRatioOfScattering) {
    // Scaling a half-space changes nothing but the way photons go sideways.
    Problem problem = skin();
    problem.radii_mm.clear();
    const double expected = total(problem);
    problem.layers[1].mu_s *= 3;
    problem.layers[1].mu_a *= 3;
    EXPECT_EQ(skin_solver().unsuited(problem), "");
    EXPECT_NEAR(total(problem) / expected, 1, 1e-6);
}

TEST(SkinSolver, OpaqueSkinIsDarkAndStated) {
    // Pigment of hundreds of times mu_s': dark, darker with every bit of it, and with an error that admits its noise.
    double last = 1;
    for (double mu_a = 1; mu_a < 3700; mu_a *= 1.5) {
        Problem problem = skin();
        problem.layers[0].mu_a = mu_a;
        ASSERT_EQ(skin_solver().unsuited(problem), "");
        const Solution s = skin_solver().solve(problem, {});
        EXPECT_GT(s.Rd, 0);
        EXPECT_LT(s.Rd, last) << mu_a;
        last = s.Rd;
        EXPECT_GT(s.error_estimate, 0);
        EXPECT_LE(s.error_estimate, 3);
        for (const double r : s.R_per_mm2)
            EXPECT_TRUE(std::isfinite(r) && r >= 0);
    }
    EXPECT_LT(last, 1e-3);
}

}  // namespace
}  // namespace sanguine
