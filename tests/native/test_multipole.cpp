// The classical multipole: what was published, in real space; where it fails, and that it says so.
#include "sanguine/multipole.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <random>

#include "effort.hpp"
#include "reference_cases.hpp"
#include "sanguine/hankel.hpp"

using namespace sanguine;

namespace {

constexpr double pi = std::numbers::pi;

std::vector<double> log_radii(double from, double to, int count) {
    std::vector<double> radii;
    for (int i = 0; i < count; ++i)
        radii.push_back(from * std::pow(to / from, i / (count - 1.0)));
    return radii;
}

/// D&J's dipole term in real space: z (1 + sigma_tr d) exp(-sigma_tr d) / (4 pi d^3).
double pole(double z, double sigma_tr, double r) {
    const double d = std::hypot(r, z);
    return z * (1 + sigma_tr * d) * std::exp(-sigma_tr * d) / (4 * pi * d * d * d);
}

/// The published sum over dipoles -n..n.
struct RealSpace {
    MultipoleLayer layer;

    double R(double r, int n) const {
        double sum = 0;
        for (int i = -n; i <= n; ++i)
            sum += pole(real(i), layer.sigma_tr, r) - pole(virtual_(i), layer.sigma_tr, r);
        return layer.reduced_albedo * sum;
    }

    double T(double r, int n) const {
        double sum = 0;
        for (int i = -n; i <= n; ++i)
            sum += pole(layer.thickness - real(i), layer.sigma_tr, r)
                 - pole(layer.thickness - virtual_(i), layer.sigma_tr, r);
        return layer.reduced_albedo * sum;
    }

    double period() const { return 2 * (layer.thickness + layer.zb_top + layer.zb_bottom); }
    double real(int i) const { return i * period() + layer.source_depth; }
    double virtual_(int i) const { return i * period() - layer.source_depth - 2 * layer.zb_top; }
};

Solution answer(std::vector<Layer> layers, std::vector<double> radii = {}, Incidence incidence = Incidence::normal) {
    const Problem problem{.layers = std::move(layers), .incidence = incidence, .radii_mm = std::move(radii)};
    EXPECT_EQ(multipole_solver().unsuited(problem), "");
    return multipole_solver().solve(problem, {});
}

bool says(const Solution& solution, const char* what) {
    for (const std::string& warning : solution.warnings)
        if (warning.find(what) != std::string::npos)
            return true;
    return false;
}

}  // namespace

TEST(Multipole, InternalReflectanceIsTheKnownFit) {
    EXPECT_NEAR(internal_reflectance(1), 0.0017, 1e-12);  // both branches of the printed fit meet there
    EXPECT_NEAR(internal_reflectance(std::nextafter(1, 0)), 0.0017, 1e-12);
    // -1.4399 / 1.96 + 0.7099 / 1.4 + 0.6681 + 0.0636 * 1.4 = -0.734643 + 0.507071 + 0.6681 + 0.08904, by hand
    EXPECT_NEAR(internal_reflectance(1.4), 0.529568, 1e-6);
}

TEST(Multipole, HalfSpaceIsTheClassicalDipole) {
    // Jensen et al. 2001, "A Practical Model for Subsurface Light Transport", their marble and skin (red), and others.
    for (const Layer& layer : {Layer{0.0021, 2.19, 0, 1.5, half_space}, Layer{0.032, 0.74, 0, 1.3, half_space},
                               Layer{1.2, 40, 0.8, 1.4, half_space}, Layer{0, 10, 0.9, 1.4, half_space}}) {
        const double scattering = layer.mu_s * (1 - layer.g), extinction = layer.mu_a + scattering;
        const double sigma_tr = std::sqrt(3 * layer.mu_a * extinction);
        const double f = -1.4399 / (layer.n * layer.n) + 0.7099 / layer.n + 0.6681 + 0.0636 * layer.n;
        const double zr = 1 / extinction, zv = zr * (1 + 4.0 / 3 * (1 + f) / (1 - f));
        const double entering = 1 - std::pow((layer.n - 1) / (layer.n + 1), 2);
        const auto radii = log_radii(1e-3, 20, 60);
        const Solution solution = answer({layer}, radii);
        for (std::size_t i = 0; i < radii.size(); ++i) {
            const double exact = entering * scattering / extinction
                               * (pole(zr, sigma_tr, radii[i]) + pole(zv, sigma_tr, radii[i]));
            // 1e-6 relative; light below 1e-13 of the whole is below what cancels in double precision.
            EXPECT_NEAR(solution.R_per_mm2[i], exact, std::max(1e-6 * exact, 1e-13 / (radii[i] * radii[i])))
                << radii[i];
        }
        EXPECT_TRUE(solution.T_per_mm2.empty());
        EXPECT_EQ(solution.Tt, 0);
    }
}

TEST(Multipole, SlabIsTheImageSum) {
    for (const Layer& layer : {Layer{0.05, 10, 0, 1.4, 1}, Layer{2, 10, 0, 1.4, 0.3}, Layer{0.001, 5, 0, 1, 2},
                               Layer{0, 10, 0, 1.4, 0.5}}) {
        constexpr int n = 2000;
        const RealSpace sum{MultipoleLayer(layer, 1, 1)};
        // What lies beyond n without absorption: pairs at distance z leave (l + zb) / (pi z^3) each, in all
        // (l + zb) / (pi period^3 n^2); 5 % for taking an integral for the sum.
        const double rest = 1.05 * (sum.layer.source_depth + sum.layer.zb_top)
                          / (pi * std::pow(sum.period(), 3) * n * n);
        const auto radii = log_radii(1e-3, 3, 30);
        const Solution solution = answer({layer}, radii);
        const double entering = 1 - solution.specular;
        for (std::size_t i = 0; i < radii.size(); ++i) {
            EXPECT_NEAR(solution.R_per_mm2[i], entering * sum.R(radii[i], n), 1e-6 * solution.R_per_mm2[i] + rest);
            EXPECT_NEAR(solution.T_per_mm2[i], entering * sum.T(radii[i], n), 1e-6 * solution.T_per_mm2[i] + rest);
        }
    }
}

TEST(Multipole, SourceBelowTheBottomIsStillThePublishedSum) {
    // 0.6 and 0.2 mean free paths: negative T, then negative R, exactly as the published sum has them.
    for (const double thickness : {0.06, 0.02, 0.001}) {
        const Layer layer{0.3, 10, 0, 1.4, thickness};
        const MultipoleLayer closed(layer, 1, 1.5), summed(layer, 1, 1.5, 4000);
        for (const double s : {0.0, 0.1, 3.0, 40.0}) {
            const MultipoleResponse a = closed(s), b = summed(s);
            EXPECT_NEAR(a.R, b.R, 1e-12);
            EXPECT_NEAR(a.T, b.T, 1e-12);
            EXPECT_NEAR(a.R_from_below, b.R_from_below, 1e-12);
            EXPECT_NEAR(a.T_from_below, b.T_from_below, 1e-12);
        }
        EXPECT_EQ(closed(0).T < 0, thickness > 0.03);
        EXPECT_EQ(closed(0).R < 0, thickness < 0.03);
        EXPECT_THROW(answer({layer}), SolverError);
    }
}

TEST(Multipole, TermsConvergeToTheClosedForm) {
    const Layer layer{0.1, 10, 0, 1.4, 0.3};
    const MultipoleResponse closed = MultipoleLayer(layer, 1, 1)(0);
    double before = 1;
    for (const int terms : {0, 1, 2, 4, 8, 16}) {
        const MultipoleResponse some = MultipoleLayer(layer, 1, 1, terms)(0);
        const double error = std::fabs(some.R / closed.R - 1);
        EXPECT_LT(error, before);
        before = error;
    }
    EXPECT_LT(before, 1e-6);
    // Without absorption any number of pairs has the same total, the wrong one: all light comes back.
    const Layer clean{0, 10, 0, 1.4, 0.3};
    const MultipoleLayer conservative(clean, 1, 1);
    for (const int terms : {0, 5, 500}) {
        EXPECT_NEAR(MultipoleLayer(clean, 1, 1, terms)(0).R, 1, 1e-12);
        EXPECT_NEAR(MultipoleLayer(clean, 1, 1, terms)(0).T, 0, 1e-12);
    }
    const double height = 0.3 + conservative.zb_top + conservative.zb_bottom;
    EXPECT_NEAR(conservative(0).T, (0.1 + conservative.zb_top) / height, 1e-14);
    EXPECT_NEAR(conservative(0).R + conservative(0).T, 1, 1e-14);
    // The limit is approached without a jump; sigma_tr d = 5e-7 leaves 1e-12.
    const MultipoleResponse nearly = MultipoleLayer({1e-13, 10, 0, 1.4, 0.3}, 1, 1)(0);
    EXPECT_NEAR(nearly.R, conservative(0).R, 1e-11);
}

TEST(Multipole, ConservativeStacksKeepTheirLight) {
    // Any indices, layers at least a mean free path thick.
    const std::vector<Layer> slab = {{0, 20, 0.5, 1.4, 0.2}, {0, 5, 0, 1.3, 0.5}, {0, 100, 0.9, 1.5, 3}};
    const Solution finite = answer(slab);
    EXPECT_NEAR(finite.Rd + finite.Tt + finite.specular, 1, 1e-12);
    std::vector<Layer> deep = slab;
    deep.push_back({0, 10, 0.2, 1.4, half_space});
    const Solution all = answer(deep);
    EXPECT_NEAR(all.Rd + all.specular, 1, 1e-12);
}

TEST(Multipole, TotalsAreTheIntegralsOfTheProfiles) {
    for (const auto& layers : {std::vector<Layer>{{0.5, 10, 0, 1.4, half_space}},
                               std::vector<Layer>{{0.1, 30, 0.8, 1.4, 0.4}, {0.2, 10, 0, 1.4, half_space}},
                               std::vector<Layer>{{0.1, 30, 0.8, 1.4, 0.4}, {0.2, 10, 0, 1.3, 2}}}) {
        const MultipoleStack stack(layers);
        const auto at = [&](double frequency) {
            const MultipoleResponse response = stack(frequency);
            return std::array{response.R, response.T};
        };
        // Trapezoids in ln r converge quickly for a smooth bump. The profiles are flat inside 1e-5 mm and gone at 1 m.
        const auto radii = log_radii(1e-5, 1e3, 1200);
        const auto profiles = inverse_hankel(at, radii);
        const double step = std::log(radii[1] / radii[0]);
        std::array<double, 2> sum{};
        for (std::size_t i = 0; i < radii.size(); ++i)
            for (int c = 0; c < 2; ++c)
                sum[c] += 2 * pi * radii[i] * radii[i] * step * profiles[i].value[c];
        // 1e-6 is the accuracy of the transform.
        EXPECT_NEAR(sum[0], stack(0).R, 1e-6 * stack(0).R);
        EXPECT_NEAR(sum[1], stack(0).T, 1e-6 * stack(0).R);
    }
}

TEST(Multipole, StackingIsAssociativeAndEndsInAHalfSpace) {
    const std::vector<Layer> layers = {{0.1, 10, 0, 1.4, 0.3}, {0.4, 8, 0, 1.4, 0.5}, {0.2, 5, 0, 1.4, half_space}};
    std::vector<Layer> thick = layers;
    thick.back().thickness = 100;  // 180 e-foldings of sigma_tr = 1.8 / mm
    const double s = 0.7;
    const MultipoleResponse a = MultipoleStack(layers)(s), b = MultipoleStack(thick)(s);
    EXPECT_NEAR(a.R, b.R, 1e-14);
    EXPECT_NEAR(b.T, 0, 1e-60);
    // From the top down instead of from the bottom up.
    MultipoleResponse down = MultipoleLayer(layers[0], 1, 1.4)(s);
    for (const auto& [layer, below] : {std::pair{layers[1], 1.4}, std::pair{thick[2], 1.0}}) {
        const MultipoleResponse next = MultipoleLayer(layer, 1.4, below)(s);
        const double between = 1 / (1 - next.R * down.R_from_below);
        down = {down.R + down.T * next.R * down.T_from_below * between, down.T * next.T * between,
                next.R_from_below + next.T_from_below * down.R_from_below * next.T * between,
                next.T_from_below * down.T_from_below * between};
    }
    EXPECT_NEAR(down.R, b.R, 1e-14);
    EXPECT_NEAR(down.R_from_below, b.R_from_below, 1e-14);
}

TEST(Multipole, CuttingOneMaterialCostsAThirdOfAFreePath) {
    // Every layer starts its light anew from a source, so the method is not exact for one material cut in two. Without
    // absorption or a step of index 1/T adds up as 1/T12 = 1/T1 + 1/T2 - 1, T = (l + zb) / (d + 2 zb): the cut slab is
    // as good as one that is l - 2 zb thinner, whatever its thickness.
    for (const double thickness : {2.0, 20.0, 200.0}) {
        const Layer whole{0, 10, 0, 1, thickness}, half{0, 10, 0, 1, thickness / 2};
        const MultipoleLayer layer(whole, 1, 1);
        const double l = layer.source_depth, zb = layer.zb_top;
        const MultipoleResponse one = layer(0), two = MultipoleStack(std::vector{half, half})(0);
        EXPECT_NEAR((1 / one.T - 1 / two.T) * (l + zb), l - zb, 1e-9 * thickness);
        EXPECT_NEAR(two.R + two.T, 1, 1e-12);
    }
}

TEST(Multipole, FailsInAnAnatomicalEpidermisAndSaysSo) {
    // 0.45 mean free paths of epidermis in red light. Monte Carlo has half of the light back, the published method a
    // tenth of that, and what it has from the dermis is the product of two negative transmittances.
    const reference::Case& skin = reference::find("p06");
    const MultipoleLayer epidermis(skin.layers[0], 1, skin.layers[1].n);
    EXPECT_LT(epidermis(0).T, 0);
    EXPECT_LT(epidermis(0).T_from_below, 0);
    const Solution solution = answer(skin.layers, log_radii(0.01, 20, 40));
    EXPECT_LT(solution.Rd, 0.2 * skin.scattered_reflectance);
    EXPECT_TRUE(says(solution, "layer 0 is 0.454 mean free paths thick: its source lies below its bottom"));
    for (const double value : solution.R_per_mm2)
        EXPECT_GE(value, 0);
    // 0.25 mm of epidermis holds its source, and the result is too bright.
    const reference::Case& thick = reference::find("p05");
    const Solution bright = answer(thick.layers);
    EXPECT_FALSE(says(bright, "source lies below"));
    EXPECT_GT(bright.Rd, 1.1 * thick.scattered_reflectance);
}

TEST(Multipole, RefusesWhatItCannotKnow) {
    const auto unsuited = [](std::vector<Layer> layers) {
        return multipole_solver().unsuited({.layers = std::move(layers), .radii_mm = {}});
    };
    EXPECT_NE(unsuited({{1, 0, 0, 1.4, 1}}).find("layer 0 does not scatter"), std::string::npos);
    EXPECT_NE(unsuited({{1, 10, 0, 1.4, 1}, {1, 1e-310, 0, 1.4, 1}}).find("layer 1 does not scatter"),
              std::string::npos);
    EXPECT_NE(unsuited({{1, 10, 0, 4, 1}}).find("ratio of indices of 4"), std::string::npos);
    EXPECT_EQ(unsuited({{1, 10, 0, 3, 1}}), "");
    EXPECT_THROW(answer({{0.01, 1, 0, 1.4, 0.5}}), SolverError);    // half a free path: negative T
    EXPECT_THROW(answer({{0.01, 1, 0, 1.4, 1e-6}}), SolverError);   // a nanometre: negative R
}

TEST(Multipole, DiffuseLightLosesItsOwnShare) {
    const std::vector<Layer> layers = {{0.5, 10, 0, 1.4, half_space}};
    const Solution normal = answer(layers), diffuse = answer(layers, {}, Incidence::diffuse);
    EXPECT_NEAR(diffuse.specular, 0.076812, 1e-6);
    EXPECT_NEAR(diffuse.Rd / (1 - diffuse.specular), normal.Rd / (1 - normal.specular), 1e-15);
    EXPECT_TRUE(says(diffuse, "diffuse light"));
    const Solution faint = answer({{0.5, 10, 0, 1 + 1e-12, half_space}}, {}, Incidence::diffuse);
    EXPECT_GE(faint.specular, 0);
    EXPECT_LT(faint.specular, 1e-11);
}

TEST(Multipole, ErrorsAgainstMonteCarlo) {
    std::printf("%-5s %-28s %9s %9s %8s %8s %8s %7s  %s\n", "case", "kind", "Rd", "MC", "dRd %", "dTt %", "L1 R %", "ms",
                "");
    for (const reference::Case& c : reference::cases()) {
        std::vector<double> radii;
        for (const reference::Ring& ring : c.rings)
            radii.push_back(ring.radius);
        const Problem problem{.layers = c.layers, .incidence = c.incidence, .radii_mm = radii};
        if (const std::string why = multipole_solver().unsuited(problem); !why.empty()) {
            std::printf("%-5s %-28s %s\n", c.id, c.kind, why.c_str());
            continue;
        }
        try {
            double ms = 1e9;
            Solution solution;
            for (int repeat = 0; repeat < 7; ++repeat) {
                const auto start = std::chrono::steady_clock::now();
                solution = multipole_solver().solve(problem, {});
                ms = std::min(ms, std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
                                      .count());
            }
            double off = 0, all = 0;
            for (std::size_t i = 0; i < c.rings.size(); ++i) {
                const double area = pi * (c.rings[i].outer * c.rings[i].outer - c.rings[i].inner * c.rings[i].inner);
                off += area * std::fabs(solution.R_per_mm2[i] - c.rings[i].density);
                all += area * c.rings[i].density;
                EXPECT_GE(solution.R_per_mm2[i], 0);
            }
            EXPECT_NEAR(solution.specular, c.specular, 2e-6);
            // The estimate of the totals is the truth, but for 0.002 that it adds, 0.002 that adding-doubling may be
            // off, and the noise of the Monte Carlo.
            double truth = std::fabs(solution.Rd / c.scattered_reflectance - 1);
            double noise = c.scattered_reflectance_se / c.scattered_reflectance;
            if (c.transmittance > 0) {
                truth = std::max(truth, std::fabs(solution.Tt / c.transmittance - 1));
                noise = std::max(noise, c.transmittance_se / c.transmittance);
            }
            const double estimate = answer(c.layers, {}, c.incidence).error_estimate;
            EXPECT_NEAR(estimate, truth, (1 + truth) * (0.004 + 3 * noise));
            if (!says(solution, "source lies below") && !says(solution, "absorbs more"))
                EXPECT_GE(solution.error_estimate, off / all);
            else
                EXPECT_GE(solution.error_estimate, 1);
            std::printf("%-5s %-28s %9.5f %9.5f %8.1f %8.1f %8.1f %7.2f  est %.3g\n", c.id, c.kind, solution.Rd,
                        c.scattered_reflectance, 100 * (solution.Rd / c.scattered_reflectance - 1),
                        c.transmittance > 0 ? 100 * (solution.Tt / c.transmittance - 1) : 0, 100 * off / all, ms,
                        solution.error_estimate);
            for (const std::string& warning : solution.warnings)
                std::printf("      - %s\n", warning.c_str());
        } catch (const SolverError& error) {
            std::printf("%-5s %-28s %s\n", c.id, c.kind, error.what());
        }
    }
}

TEST(Multipole, ExtremesAnswerOrRefuse) {
    int answered = 0, refused = 0;
    const auto check = [&](const Problem& problem) {
        ASSERT_NO_THROW(check_stack(problem.layers));
        if (!multipole_solver().unsuited(problem).empty()) {
            ++refused;
            return;
        }
        try {
            const Solution s = multipole_solver().solve(problem, {});
            ++answered;
            EXPECT_TRUE(s.Rd >= 0 && s.Tt >= 0 && s.specular >= 0 && s.Rd + s.Tt + s.specular <= 1 + 1e-9)
                << s.Rd << " " << s.Tt;
            EXPECT_TRUE(std::isfinite(s.error_estimate) && s.error_estimate >= 0);
            for (const auto* profile : {&s.R_per_mm2, &s.T_per_mm2})
                for (const double value : *profile)
                    EXPECT_TRUE(std::isfinite(value) && value >= 0) << value;
        } catch (const SolverError& error) {
            ++refused;
            EXPECT_GT(std::string(error.what()).size(), 10u);
        }
    };
    const double thickness[] = {1e-6, 1e-3, 0.1, 1, 1e3, half_space}, mu[] = {0, 1e-310, 1e-3, 1, 1e3, 1e6};
    const double g[] = {-0.99, 0, 0.9, 0.999}, n[] = {1, 1 + 1e-9, 1.4, 3};
    const auto start = std::chrono::steady_clock::now();
    for (const double d : thickness)
        for (const double mu_a : mu)
            for (const double mu_s : mu)
                for (const double g_ : g)
                    for (const double n_ : n)
                        for (const Incidence incidence : {Incidence::normal, Incidence::diffuse})
                            check({.layers = {{mu_a, mu_s, g_, n_, d}},
                                   .incidence = incidence,
                                   .radii_mm = {1e-4, 0.1, 50}});
    std::mt19937 random(5);
    const auto pick = [&](const auto& values) { return values[random() % std::size(values)]; };
    for (std::size_t i = 0; i < 2500; i += sweep_stride) {
        Problem problem{.layers = {}, .radii_mm = {1e-4, 0.01, 1, 50}};
        const std::size_t count = 1 + random() % max_layers;
        for (std::size_t k = 0; k < count; ++k)
            problem.layers.push_back({pick(mu), pick(std::array{1e-3, 1.0, 1e3, 1e6}), pick(g), pick(n),
                                      k + 1 < count ? thickness[random() % 5] : pick(thickness)});
        check(problem);
    }
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    std::printf("%d answered, %d refused in %.2f s\n", answered, refused, seconds);
    EXPECT_GT(answered, 1000);
}

TEST(Multipole, CostAndErrorOfTheNumberOfTerms) {
    // Printed for the benchmark: error of Rd and Tt of the truncated sum, against the closed form.
    const std::vector<Layer> skin = {{0.2, 29.2, 0.8, 1.4, 0.25}, {0.1, 14.6, 0.8, 1.4, half_space}};
    const std::vector<Layer> slab = {{0.01, 10, 0, 1.4, 0.5}};
    for (const auto& [name, layers] : {std::pair{"skin 0.25 mm", skin}, std::pair{"slab 0.5 mm", slab}}) {
        const MultipoleResponse closed = MultipoleStack(layers)(0);
        double last = 1;
        for (const int terms : {1, 2, 3, 5, 7, 10, 15, 20, 40, all_terms}) {
            const MultipoleStack stack(layers, terms);
            const MultipoleResponse total = stack(0);
            double keep = 0, ns = 1e9;
            for (int repeat = 0; repeat < 20; ++repeat) {
                const auto start = std::chrono::steady_clock::now();
                for (int i = 0; i < 200; ++i)
                    keep += stack(0.1 * i).R;
                ns = std::min(ns, std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - start)
                                          .count() / 200);
            }
            EXPECT_GT(keep, 0);
            last = std::fabs(total.R / closed.R - 1);
            std::printf("%-13s %3d terms: Rd %+.2e Tt %+.2e, %6.0f ns for one frequency\n", name, terms,
                        total.R / closed.R - 1, closed.T > 0 ? total.T / closed.T - 1 : 0, ns);
        }
        EXPECT_EQ(last, 0);
    }
}
