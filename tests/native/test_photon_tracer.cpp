#include "sanguine/photon_tracer.hpp"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "reference_cases.hpp"
#include "sanguine/fresnel.hpp"

namespace sanguine {
namespace {

struct Totals {
    double reflected_scattered = 0, transmitted = 0, absorbed = 0, at_surface = 0, all = 0;
};

Totals trace(const std::vector<Layer>& stack, Incidence incidence, int photons, std::uint64_t seed) {
    Totals t;
    for (int p = 0; p < photons; ++p) {
        PhotonRandom random(seed, p);
        const PhotonEnd end = trace_photon(stack, incidence, random);
        t.reflected_scattered += end.fate == Fate::left_top && end.scattered;
        t.transmitted += end.fate == Fate::left_bottom;
        t.absorbed += end.fate == Fate::absorbed;
        t.at_surface += end.fate == Fate::reflected_at_surface;
    }
    for (double* value : {&t.reflected_scattered, &t.transmitted, &t.absorbed, &t.at_surface})
        *value /= photons;
    return t;
}

/// Standard error of a share of `photons` independent photons.
double standard_error(double share, int photons) {
    return std::sqrt(share * (1 - share) / photons);
}

class TracerAgainstReference : public testing::TestWithParam<reference::Case> {};

TEST_P(TracerAgainstReference, TotalsWithinFourStandardErrors) {
    // Both runs are Monte Carlo with known errors. Four of them: a fixed seed makes the outcome constant, and of a
    // dozen true comparisons one beyond three would be no surprise.
    constexpr int photons = 300000;
    const reference::Case& c = GetParam();
    const Totals t = trace(c.layers, c.incidence, photons, 7);
    const double se_r = std::hypot(standard_error(c.scattered_reflectance, photons), c.scattered_reflectance_se);
    EXPECT_NEAR(t.reflected_scattered, c.scattered_reflectance, 4 * se_r);
    const double se_t = std::hypot(standard_error(c.transmittance, photons), c.transmittance_se);
    EXPECT_NEAR(t.transmitted, c.transmittance, 4 * se_t);
}

INSTANTIATE_TEST_SUITE_P(Public, TracerAgainstReference, testing::ValuesIn(reference::cases()),
                         [](const auto& case_of) { return case_of.param.id; });

TEST(PhotonTracer, GiovanelliHalfSpace) {
    // Giovanelli 1955: albedo 0.9, isotropic, n = 1.5, normal incidence: 0.26 in all, surface 0.04 included.
    constexpr int photons = 300000;
    const Totals t = trace({{0.1, 0.9, 0, 1.5, half_space}}, Incidence::normal, photons, 1);
    EXPECT_NEAR(t.reflected_scattered + t.at_surface, 0.2600, 4 * standard_error(0.26, photons));
}

TEST(PhotonTracer, SurfaceReflectionIsFresnel) {
    constexpr int photons = 400000;
    const std::vector<Layer> black = {{1000, 1, 0, 1.4, half_space}};
    double cos_t;
    const double normal = fresnel_dielectric(1, 1, 1.4, cos_t), diffuse = diffuse_fresnel(1.4);
    EXPECT_NEAR(trace(black, Incidence::normal, photons, 2).at_surface, normal, 4 * standard_error(normal, photons));
    EXPECT_NEAR(trace(black, Incidence::diffuse, photons, 3).at_surface, diffuse, 4 * standard_error(diffuse, photons));
}

TEST(PhotonTracer, ClearLayersOnlyRefract) {
    // Beer-Lambert along the axis, no scattering: exp(-mu_a d) reaches the far side of a matched slab.
    constexpr int photons = 200000;
    const Totals t = trace({{2, 0, 0, 1, 0.1}, {3, 0, 0, 1, 0.2}}, Incidence::normal, photons, 4);
    const double expected = std::exp(-0.8);
    EXPECT_NEAR(t.transmitted, expected, 4 * standard_error(expected, photons));
    EXPECT_EQ(t.reflected_scattered, 0);
}

TEST(PhotonTracer, PathsAddUpAndRadiusIsReached) {
    const std::vector<Layer> stack = {{0.01, 5, 0.8, 1.4, 0.6}, {0.01, 2.5, 0.8, 1.4, half_space}};
    int left = 0;
    for (int p = 0; p < 2000; ++p) {
        PhotonRandom random(5, p);
        const PhotonEnd end = trace_photon(stack, Incidence::diffuse, random);
        if (end.fate != Fate::left_top)
            continue;
        ++left;
        EXPECT_GE(end.path[0] + end.path[1], end.radius * (1 - 1e-9));  // nothing is shorter than the straight line
        EXPECT_GE(end.path[1], 0);
    }
    EXPECT_GT(left, 900);
}

TEST(WeightedWalk, ExpectsWhatTheAnalogWalkExpects) {
    // Layers that meet every rule of the walk: a top that hardly scatters and absorbs, an opaque and a high-index one with
    // light held in it, a last one of low albedo; and a clear one on glass. Four standard errors: fixed seeds.
    const std::vector<std::vector<Layer>> stacks = {
        {{2, 0.1, 0.8, 1.5, 0.3}, {3, 20, 0.8, 1.4, 0.05}, {0.1, 2, -0.5, 2.5, 0.4}, {5, 2, 0, 1.2, 0.3}},
        {{0, 0, 0, 1.3, 0.1}, {0.01, 1, 0.5, 3, 0.2}, {0.5, 0, 0, 1.5, half_space}},
    };
    constexpr int photons = 100000;
    for (const std::vector<Layer>& stack : stacks)
        for (const Incidence incidence : {Incidence::normal, Incidence::diffuse}) {
            const Totals analog = trace(stack, incidence, photons, 21);
            const WeightedWalk walk(stack, incidence);
            double R = 0, R2 = 0, T = 0, T2 = 0;
            for (int p = 0; p < photons; ++p) {
                const WeightedEnd end = walk.trace(22, p);
                const double top = end.exit == WeightedEnd::Exit::top ? end.weight : 0;
                const double bottom = end.unscattered_bottom
                                    + (end.exit == WeightedEnd::Exit::bottom ? end.weight : 0);
                R += top / photons;
                R2 += top * top / photons;
                T += bottom / photons;
                T2 += bottom * bottom / photons;
            }
            const double se_R = std::sqrt((R2 - R * R) / photons), se_T = std::sqrt((T2 - T * T) / photons);
            EXPECT_NEAR(R, analog.reflected_scattered,
                        4 * std::hypot(se_R, standard_error(analog.reflected_scattered, photons)));
            EXPECT_NEAR(T, analog.transmitted, 4 * std::hypot(se_T, standard_error(analog.transmitted, photons)));
            EXPECT_LT(se_R, standard_error(analog.reflected_scattered, photons));
        }
}

TEST(WeightedWalk, StopsAtItsCap) {
    const WeightedWalk walk(std::vector<Layer>{{0, 1, 0, 1.4, half_space}}, Incidence::normal, 100);
    int cut = 0;
    for (int p = 0; p < 1000; ++p) {
        const WeightedEnd end = walk.trace(1, p);
        EXPECT_LE(end.collisions, 101u);
        cut += end.exit == WeightedEnd::Exit::cut;
        EXPECT_NEAR(end.weight, 1 - 1.0 / 36, 1e-12);  // it comes back, or is cut off: nothing absorbs
    }
    EXPECT_GT(cut, 50);
    EXPECT_LT(cut, 500);
}

TEST(PhotonRandom, IsAFunctionOfSeedAndPhoton) {
    PhotonRandom a(1, 2), b(1, 2), other_photon(1, 3), other_seed(2, 2);
    const double first = a.uniform();
    EXPECT_EQ(first, b.uniform());
    EXPECT_NE(first, other_photon.uniform());
    EXPECT_NE(first, other_seed.uniform());
}

TEST(PhotonRandom, IsUniformAcrossPhotons) {
    // First and second numbers of neighbouring sequences in 16 x 16 boxes: chi-square with 255 degrees of freedom has
    // its 99.9 % point at 330.5.
    constexpr int photons = 1 << 18, side = 16;
    std::vector<int> boxes(side * side);
    for (int p = 0; p < photons; ++p) {
        PhotonRandom random(11, p);
        const int i = static_cast<int>(random.uniform() * side), j = static_cast<int>(random.uniform() * side);
        ++boxes[i * side + j];
    }
    const double expected = double(photons) / boxes.size();
    double chi2 = 0;
    for (const int count : boxes)
        chi2 += (count - expected) * (count - expected) / expected;
    EXPECT_LT(chi2, 330.5);
}

TEST(Fresnel, ClosedFormIsTheLambertianAverage) {
    for (const double n : {1.3, 1.4, 1.5, 1.8}) {
        constexpr int steps = 20000;
        double sum = 0, cos_t;
        for (int i = 0; i < steps; ++i)  // 2 mu d mu = d mu^2: midpoints in mu^2
            sum += fresnel_dielectric(std::sqrt((i + 0.5) / steps), 1, n, cos_t);
        EXPECT_NEAR(diffuse_fresnel(n), sum / steps, 2e-6) << n;
    }
    EXPECT_NEAR(diffuse_fresnel(1.4), 0.076812, 1e-6);
}

TEST(Fresnel, LambertianAverageKeepsItsDigitsNearOne) {
    // Walsh's formula with 80 decimals, on binary fractions. The terms that remain differ by a factor of 20 at most:
    // 1e-14 is what rounding may do to them.
    const struct { double beyond_one, reflectance; } rows[] = {
        {std::ldexp(1, -40), 3.0316490057987708e-13}, {std::ldexp(1, -20), 3.1788553947385338e-07},
        {std::ldexp(1, -10), 3.2263890215062816e-04}, {std::ldexp(1, -6), 4.8044926292081539e-03},
        {0.25, 5.2897935686477243e-02},               {0.625, 1.0979833637368955e-01},
        {0.6875, 1.1858008284974840e-01},             {3, 3.6663805649767855e-01},
    };
    for (const auto& row : rows)
        EXPECT_NEAR(diffuse_fresnel(1 + row.beyond_one) / row.reflectance, 1, 1e-14) << row.beyond_one;
    EXPECT_EQ(diffuse_fresnel(1), 0);
}

TEST(Fresnel, TotalInternalReflection) {
    double cos_t;
    EXPECT_EQ(fresnel_dielectric(0.5, 1.4, 1.0, cos_t), 1);
    EXPECT_EQ(cos_t, 0);
    EXPECT_NEAR(fresnel_dielectric(1, 1.4, 1.0, cos_t), 1.0 / 36, 1e-12);
}

}  // namespace
}  // namespace sanguine
