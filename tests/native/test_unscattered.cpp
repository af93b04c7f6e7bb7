#include "sanguine/unscattered.hpp"

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "reference_cases.hpp"
#include "sanguine/fresnel.hpp"

namespace sanguine {
namespace {

constexpr double eps = std::numeric_limits<double>::epsilon();

TEST(FresnelFace, IsFresnelAndKeepsItsComplement) {
    for (const double n : {1.0000001, 1.1, 1.4, 2.0, 4.0})
        for (double cos_above = 0.01; cos_above <= 1; cos_above += 0.01) {
            double cos_below = 0;
            const double expected = fresnel_dielectric(cos_above, 1, n, cos_below);
            const Face face = fresnel_face(1, cos_above, n, cos_below);
            EXPECT_NEAR(face.reflected, expected, 1e-15 + 1e-9 * expected);
            EXPECT_NEAR(face.reflected + face.transmitted, 1, 4 * eps);
        }
    EXPECT_EQ(fresnel_face(1.5, 0.2, 1, 0).reflected, 1);
    EXPECT_EQ(fresnel_face(1.5, 0.2, 1, 0).transmitted, 0);
    EXPECT_EQ(fresnel_face(1.3, 0, 1.3, 0).reflected, 0);
}

TEST(Unscattered, ClearSlabIsTheSeriesOfItsFaces) {
    const double r = 0.04;  // n = 1.5
    const std::vector<Layer> slab{{0, 0, 0, 1.5, 1}};
    const UnscatteredLight light = unscattered(slab, Incidence::normal);
    EXPECT_NEAR(light.specular, r, eps);
    EXPECT_NEAR(light.reflected, 2 * r / (1 + r) - r, 2 * eps);
    EXPECT_NEAR(light.transmitted, (1 - r) / (1 + r), 4 * eps);
    EXPECT_EQ(light.scattered, 0);
}

TEST(Unscattered, WeakenedByBeerAndLambert) {
    const double r = 0.04, passed = std::exp(-0.7);
    const std::vector<Layer> slab{{0.5, 0.2, 0.3, 1.5, 1}};
    const UnscatteredLight light = unscattered(slab, Incidence::normal);
    const double trips = 1 - r * r * passed * passed;
    EXPECT_NEAR(light.transmitted, (1 - r) * (1 - r) * passed / trips, 4 * eps);
    EXPECT_NEAR(light.reflected, (1 - r) * (1 - r) * passed * passed * r / trips, 4 * eps);
    // Of what is taken from the beam 2/7 scatter.
    const double taken = 1 - light.specular - light.reflected - light.transmitted;
    EXPECT_NEAR(light.scattered, taken * 2 / 7, 8 * eps);
}

TEST(Unscattered, DiffuseSpecularHasAClosedForm) {
    for (const double n : {1.0, 1 + 1e-12, 1 + 1e-6, 1.001, 1.05, 1.2, 1.4, 1.5, 2.0, 3.0, 4.0}) {
        const std::vector<Layer> stack{{1, 0, 0, n, half_space}};
        EXPECT_NEAR(unscattered(stack, Incidence::diffuse).specular, diffuse_fresnel(n), 1e-13) << n;
    }
}

TEST(Unscattered, DiffuseThroughAMatchedSlabIsAnExponentialIntegral) {
    // 2 E3(depth), by recurrence from E1.
    const auto through = [](double depth) {
        const std::vector<Layer> stack{{depth, 0, 0, 1, 1}};
        return unscattered(stack, Incidence::diffuse).transmitted;
    };
    const auto e3 = [](double x) {
        const double e1 = -std::expint(-x);
        return (std::exp(-x) - x * (std::exp(-x) - x * e1)) / 2;
    };
    for (const double depth : {1e-6, 1e-3, 0.1, 1.0, 5.0})
        EXPECT_NEAR(through(depth), 2 * e3(depth), 1e-13) << depth;
}

TEST(Unscattered, SharesAddUpAndThinLayersKeepTheirDigits) {
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> n(1, 4), power(-9, 3);
    for (int trial = 0; trial < 300; ++trial) {
        std::vector<Layer> stack(1 + trial % 8);
        for (Layer& layer : stack)
            layer = {0, trial % 3 ? std::pow(10, power(random)) : 0, 0, n(random), 0.01};
        for (const Incidence incidence : {Incidence::normal, Incidence::diffuse}) {
            const UnscatteredLight light = unscattered(stack, incidence);
            EXPECT_GE(light.reflected, 0);
            EXPECT_GE(light.transmitted, 0);
            EXPECT_GE(light.scattered, 0);
            // Nothing absorbs.
            EXPECT_NEAR(light.specular + light.reflected + light.transmitted + light.scattered, 1, 1e-12);
        }
    }
    // Once down, once up after reflection at the bottom: first order in depth.
    const std::vector<Layer> thin{{0, 1e-12, 0, 1, 1e-6}};
    EXPECT_NEAR(unscattered(thin, Incidence::normal).scattered / 1e-18, 1, 1e-14);
    EXPECT_NEAR(unscattered(thin, Incidence::diffuse).scattered / 2e-18, 1, 1e-8);
}

TEST(Unscattered, AgreesWithTheReference) {
    for (const reference::Case& c : reference::cases()) {
        const UnscatteredLight light = unscattered(c.layers, c.incidence);
        EXPECT_NEAR(light.specular, c.specular, 1e-9) << c.id;  // printed to nine digits
        EXPECT_NEAR(light.reflected, c.unscattered_reflectance, 3 * c.unscattered_reflectance_se + 1e-9) << c.id;
    }
}

}  // namespace
}  // namespace sanguine
