// What features are made of: noise, scattered points, spots and the texels that ask for them.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "noise.hpp"
#include "place_grid.hpp"
#include "random.hpp"
#include "sanguine/feature.hpp"
#include "scatter.hpp"
#include "skin_meshes.hpp"
#include "spots.hpp"

namespace sanguine {
namespace {

TEST(Noise, HasTheSameBytesEverywhere) {
    // Written down once from this code: arithmetic of IEEE 754 without fused operations gives these on any machine.
    std::uint32_t hash = 0;
    for (int i = 0; i < 1000; ++i) {
        const float t = float(i) * 0.371F - 150;
        hash = hash * 31 + std::bit_cast<std::uint32_t>(gradient_noise({t, 2 * t, 0.3F * t}, 5));
    }
    EXPECT_EQ(hash, 4175219194U);
}

TEST(Noise, IsCentredBoundedAndContinuous) {
    double sum = 0, square = 0;
    constexpr int n = 100000;
    Random random(1);
    for (int i = 0; i < n; ++i) {
        const glm::vec3 p(random.uniform(-500, 500), random.uniform(-500, 500), random.uniform(-500, 500));
        const float value = gradient_noise(p, 9);
        EXPECT_LE(std::abs(value), 1);
        // The steepest gradient of this noise is below 4 a unit.
        EXPECT_LT(std::abs(gradient_noise(p + glm::vec3(1e-3F, 0, 0), 9) - value), 5e-3F);
        sum += value;
        square += value * value;
    }
    // Five standard errors of the mean.
    EXPECT_NEAR(sum / n, 0, 5 * std::sqrt(square / n / n));
    EXPECT_NEAR(std::sqrt(square / n), 0.25, 0.05);
}

TEST(Noise, FadesWhereTexelsAreTooLarge) {
    const Fbm fbm{10, 3, 0.5F, 1};
    EXPECT_EQ(fbm({1.3F, 2.1F, 7.7F}, 6), 0);
    EXPECT_NE(fbm({1.3F, 2.1F, 7.7F}, 0.1F), 0);
}

TEST(PlaceGrid, FindsEveryBoxThatHoldsThePlace) {
    Random random(3);
    std::vector<PlaceGrid::Box> boxes;
    for (int i = 0; i < 500; ++i) {
        const glm::vec3 low(random.uniform(-50, 50), random.uniform(-50, 50), random.uniform(-50, 50));
        boxes.push_back({low, low + random.uniform(0.1F, i % 50 == 0 ? 30 : 4)});
    }
    const PlaceGrid grid(boxes);
    std::size_t held = 0;
    for (int k = 0; k < 2000; ++k) {
        const glm::vec3 p(random.uniform(-60, 60), random.uniform(-60, 60), random.uniform(-60, 60));
        const auto found = grid.at(p);
        EXPECT_TRUE(std::ranges::is_sorted(found));
        for (std::uint32_t i = 0; i < boxes.size(); ++i) {
            bool inside = true;
            for (int axis = 0; axis < 3; ++axis)
                inside = inside && boxes[i].low[axis] <= p[axis] && p[axis] <= boxes[i].high[axis];
            held += inside;
            EXPECT_TRUE(!inside || std::ranges::binary_search(found, i));
        }
    }
    EXPECT_GT(held, 50U);
    EXPECT_TRUE(PlaceGrid().at({0, 0, 0}).empty());
}

TEST(Scatter, HasTheDensityAskedFor) {
    const SkinSurface surface = flat_skin(100, 12).surface();
    for (const float spacing : {0.0F, 0.3F, 0.6F}) {
        // From nothing on the left to 0.4 per mm^2 on the right: 2000 points in the mean.
        std::vector<float> density;
        for (const glm::vec3 p : surface.position_mm()) density.push_back(0.4F * (p.x + 50) / 100);
        const auto points = scatter(surface, density, spacing, 7);
        const auto right = std::ranges::count_if(points, [](const Seedling& s) { return s.place_mm.x > 0; });
        // Four standard deviations of a Poisson count, and 3 % for the series that darts_per_point rests on where the
        // density is not even. Points that keep apart scatter less than Poisson's.
        EXPECT_NEAR(double(points.size()), 2000, 4 * std::sqrt(2000) + 60 * (spacing > 0)) << spacing;
        EXPECT_NEAR(double(right), 1500, 4 * std::sqrt(1500) + 45 * (spacing > 0)) << spacing;
    }
}

TEST(Scatter, KeepsPointsApart) {
    const SkinSurface surface = flat_skin(50, 5).surface();
    const std::vector<float> density(surface.position_mm().size(), 0.25F);
    const auto points = scatter(surface, density, 0.6F, 1);
    ASSERT_GT(points.size(), 400U);
    for (std::size_t i = 0; i < points.size(); ++i)
        for (std::size_t j = 0; j < i; ++j)
            EXPECT_GE(glm::distance(points[i].place_mm, points[j].place_mm), 0.6F / 0.5F * 0.9999F);
}

TEST(Scatter, AChangeElsewhereLeavesThePointsHere) {
    const OwnedSkin skin = flat_skin(100, 10);
    OwnedSkin changed = skin;
    std::ranges::reverse(changed.triangles);
    for (glm::vec3& p : changed.position_mm)
        if (p.x > 10) p.y = 3;
    const auto grown = [](const OwnedSkin& s) {
        const SkinSurface surface = s.surface();
        const std::vector<float> density(surface.position_mm().size(), 0.1F);
        std::vector<std::array<float, 3>> places;
        for (const Seedling& point : scatter(surface, density, 0, 11))
            if (point.place_mm.x < 0) places.push_back({point.place_mm.x, point.place_mm.y, point.place_mm.z});
        std::ranges::sort(places);
        return places;
    };
    EXPECT_GT(grown(skin).size(), 300U);
    EXPECT_EQ(grown(skin), grown(changed));
}

TEST(Spots, KeepTheirMeanWhateverTheTexel) {
    constexpr float side = 64;
    Random random(2);
    std::vector<Spot> spots;
    for (int i = 0; i < 400; ++i)
        spots.push_back({{random.uniform(-24, 24), 0, random.uniform(-24, 24)}, {0, -1, 0}, random.uniform(0.3F, 0.9F),
                         random.uniform(0.5F, 1)});
    const Spots grown(spots, 0.5F);
    double expected = 0;
    for (const Spot& s : spots) expected += double(s.strength) * s.radius_mm * s.radius_mm * spot_area(0.5F);
    for (const int n : {1024, 256, 128, 64, 32, 16}) {
        const float size = side / float(n);
        double sum = 0;
        for (int j = 0; j < n; ++j)
            for (int i = 0; i < n; ++i) {
                const glm::vec3 p((float(i) + 0.5F) * size - side / 2, 0, (float(j) + 0.5F) * size - side / 2);
                const SkinPlace place{p, {0, -1, 0}, size, {}};
                sum += double(grown.sum(place, p)) * size * size;
            }
        sum += double(grown.faded_mm2(size)) * double(spots.size());
        // 2 %: texels as large as a spot sample its profile, and the table of what is faded is interpolated.
        EXPECT_NEAR(sum / expected, 1, 0.02) << n;
    }
    EXPECT_EQ(grown.sum({{0, 0, 0}, {0, 1, 0}, 0.1F, {}}, {0, 0, 0}), 0) << "seen from the other side";
}

TEST(Texels, KnowTheirPlaceAndSize) {
    const SkinSurface surface = flat_skin(50, 4).surface();
    const TexelMap map = map_texels(surface, 100, 100, 2, 0);
    ASSERT_EQ(map.place.size(), 10000U);
    for (std::size_t i = 0; i < map.place.size(); ++i) {
        const SkinPlace& place = map.place[i];
        ASSERT_EQ(map.texel[i], i);
        EXPECT_NEAR(place.place_mm.x, (float(i % 100) + 0.5F) / 2 - 25, 1e-4F);
        EXPECT_NEAR(place.place_mm.z, (float(i / 100) + 0.5F) / 2 - 25, 1e-4F);
        EXPECT_NEAR(place.size_mm, 0.5F, 1e-4F);
        EXPECT_EQ(place.normal, glm::vec3(0, -1, 0));
    }
}

TEST(Texels, BeyondTheRimShowTheNearestPlace) {
    OwnedSkin skin = flat_skin(50, 1);
    for (glm::vec2& uv : skin.uv) uv = 0.25F + 0.5F * uv;
    const SkinSurface surface = skin.surface();
    const TexelMap bare = map_texels(surface, 64, 64, 0, 1), padded = map_texels(surface, 64, 64, 3, 1);
    EXPECT_EQ(bare.texel.size(), 32U * 32U);
    EXPECT_GT(padded.texel.size(), 38U * 38U - 4U * 9U);
    EXPECT_TRUE(std::ranges::is_sorted(padded.texel));
    for (const SkinPlace& place : padded.place) {
        EXPECT_LE(std::max(std::abs(place.place_mm.x), std::abs(place.place_mm.z)), 25.0001F);
        EXPECT_NEAR(place.size_mm, 50.0F / 32, 1e-3F);
    }
}

TEST(Texels, BeyondASeamShowTheSkinOfTheOtherIsland) {
    OwnedSkin skin = ball_skin(85, 32);
    for (glm::vec2& uv : skin.uv) uv.x = 0.25F + 0.5F * uv.x;  // the seam at columns 64 and 192
    const SkinSurface surface = skin.surface();
    const TexelMap map = map_texels(surface, 256, 256, 3, 0);
    int compared = 0;
    for (std::size_t i = 0; i + 1 < map.texel.size(); ++i) {
        const std::uint32_t column = map.texel[i] % 256, row = map.texel[i] / 256;
        // Near the equator, where both islands have the same straight texels.
        if (column < 61 || column >= 64 || row < 112 || row >= 144) continue;
        const auto other = std::ranges::lower_bound(map.texel, map.texel[i] + 128) - map.texel.begin();
        ASSERT_EQ(map.texel[std::size_t(other)], map.texel[i] + 128);
        const SkinPlace& here = map.place[i];
        const SkinPlace& there = map.place[std::size_t(other)];
        // The cells narrow toward the poles, by 2 % in this band: over 2.5 texels and 16 rows some tenth of a texel.
        // The nearest place would be half a texel away and more.
        EXPECT_LT(glm::distance(here.place_mm, there.place_mm), 0.3F * here.size_mm) << column << ' ' << row;
        ++compared;
    }
    EXPECT_EQ(compared, 3 * 32);
}

TEST(Texels, BothSidesOfASeamHaveTheSameSize) {
    const OwnedSkin skin = ball_skin(85, 32);
    const SkinSurface surface = skin.surface();
    const TexelMap map = map_texels(surface, 256, 256, 0, 0);
    for (std::size_t i = 256 * 20; i < 256 * 236; i += 256)
        // Half a texel on either side of one place, where the size changes by the curvature of the grid alone.
        EXPECT_NEAR(map.place[i].size_mm / map.place[i + 255].size_mm, 1, 0.01) << i;
}

TEST(Texels, DoNotDependOnThreads) {
    const SkinSurface surface = ball_skin().surface();
    const TexelMap one = map_texels(surface, 300, 300, 4, 1), many = map_texels(surface, 300, 300, 4, 7);
    EXPECT_EQ(one.texel, many.texel);
    ASSERT_EQ(one.place.size(), many.place.size());
    for (std::size_t i = 0; i < one.place.size(); ++i) {
        EXPECT_EQ(one.place[i].place_mm, many.place[i].place_mm);
        EXPECT_EQ(one.place[i].size_mm, many.place[i].size_mm);
    }
}

class EveryFeature : public testing::TestWithParam<const Feature*> {};

TEST_P(EveryFeature, StaysInItsRange) {
    const FeatureRow& row = GetParam()->row();
    const SkinSurface surface = ball_skin().surface();
    const TexelMap map = map_texels(surface, 200, 200, 2, 0);
    for (const Person& person : {Person{30, 0.5, 0}, Person{0, 0, 0}, Person{120, 1, 1}}) {
        const auto layer = grow_layer(*GetParam(), surface, map, person, 3, 0, {});
        ASSERT_EQ(layer.size(), map.place.size() * row.changes.size());
        for (std::size_t i = 0; i < layer.size(); ++i) {
            const LayerChange& change = row.changes[i % row.changes.size()];
            ASSERT_TRUE(layer[i] >= change.low && layer[i] <= change.high)  // NaN fails
                << layer_channel_id(change.channel) << ' ' << layer[i];
        }
    }
}

TEST_P(EveryFeature, DoesNotDependOnThreads) {
    const SkinSurface surface = ball_skin().surface();
    const TexelMap map = map_texels(surface, 200, 200, 2, 0);
    const auto grown = [&](int threads) {
        return grow_layer(*GetParam(), surface, map, {60, 0.8, 0.7}, 3, threads, {});
    };
    EXPECT_EQ(grown(1), grown(5));
}

TEST_P(EveryFeature, KeepsItsMeanWhereTexelsAreLarger) {
    const FeatureRow& row = GetParam()->row();
    const std::size_t channels = row.changes.size();
    const SkinSurface surface = ball_skin().surface();
    const auto means = [&](int side) {
        const TexelMap map = map_texels(surface, side, side, 0, 0);
        const auto layer = grow_layer(*GetParam(), surface, map, {50, 0.8, 0.8}, 3, 0, {});
        // Texels weigh what they show: those of an equirectangular layout shrink toward the poles.
        std::vector<double> mean(2 * channels);
        double area = 0;
        for (std::size_t i = 0; i < map.place.size(); ++i) {
            const double weight = double(map.place[i].size_mm) * map.place[i].size_mm;
            area += weight;
            for (std::size_t c = 0; c < channels; ++c) {
                mean[c] += weight * layer[i * channels + c];
                mean[channels + c] += weight * std::abs(layer[i * channels + c]);
            }
        }
        for (double& m : mean) m /= area;
        return mean;
    };
    // The skin of this ball shows 0.7 and 2.1 mm a texel.
    const auto fine = means(768), coarse = means(256);
    for (std::size_t c = 0; c < channels; ++c) {
        const LayerChange& change = row.changes[c];
        // 4 % of what is there on average (a rim follows noise, and noise loses octaves; a limit cuts less off what is
        // blurred), and a thousandth of the range for noise whose mean is not quite 0 on one ball.
        EXPECT_NEAR(coarse[c], fine[c], 0.04 * fine[channels + c] + 1e-3 * (change.high - change.low))
            << layer_channel_id(change.channel);
    }
}

INSTANTIATE_TEST_SUITE_P(All, EveryFeature, testing::ValuesIn(features().begin(), features().end()),
                         [](const auto& test) { return std::string(test.param->row().id); });

}  // namespace
}  // namespace sanguine
