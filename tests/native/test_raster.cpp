// The UV raster against what can be said of it in closed form.
#include "sanguine/raster.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace sanguine {
namespace {

constexpr float nothing = -7.0F;

struct Mesh {
    std::vector<glm::vec2> uv;
    std::vector<glm::uvec3> triangles;
    std::vector<float> values;  // one channel unless said otherwise
    int channels = 1;
};

std::vector<float> draw(const Mesh& mesh, int width, int height, int padding_px = 0, int threads = 1) {
    std::vector<float> pixels(std::size_t(width) * std::size_t(height) * std::size_t(mesh.channels));
    const std::vector<float> fill(std::size_t(mesh.channels), nothing);
    rasterize_uv({mesh.uv, mesh.triangles, mesh.values, mesh.channels}, padding_px, fill, {pixels, width, height},
                 threads);
    return pixels;
}

/// The unit square from `low` to `high` with a value linear in u and v at the corners.
Mesh square(float low, float high) {
    const auto value = [](glm::vec2 p) { return 2.0F * p.x + 3.0F * p.y; };
    Mesh mesh{{{low, low}, {high, low}, {high, high}, {low, high}}, {{0, 1, 2}, {0, 2, 3}}, {}};
    for (const glm::vec2 p : mesh.uv) mesh.values.push_back(value(p));
    return mesh;
}

TEST(Raster, ReproducesALinearFunctionAndLeavesNoHoleOnTheDiagonal) {
    const int n = 37;
    const auto pixels = draw(square(0, 1), n, n);
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x)
            EXPECT_NEAR(pixels[std::size_t(y * n + x)], 2 * (x + 0.5) / n + 3 * (y + 0.5) / n, 1e-6) << x << ' ' << y;
}

TEST(Raster, RowZeroIsTheBottomOfV) {
    const Mesh low{{{0, 0}, {1, 0}, {0.5F, 0.4F}}, {{0, 1, 2}}, {1, 1, 1}};
    const auto pixels = draw(low, 8, 8);
    EXPECT_EQ(pixels[3], 1.0F);
    EXPECT_EQ(pixels[7 * 8 + 3], nothing);
}

TEST(Raster, CoversExactlyThePixelsWhoseCentreIsInside) {
    // 2.5 to 5.5 pixels: centres 2.5 to 5.5 inclusive, both edges being closed.
    const auto pixels = draw(square(0.25F, 0.5625F), 8, 8);
    for (int y = 0; y < 8; ++y)
        for (int x = 0; x < 8; ++x) {
            const auto inside = [](int i) { return i + 0.5 >= 2.0 && i + 0.5 <= 4.5; };
            EXPECT_EQ(pixels[std::size_t(y * 8 + x)] != nothing, inside(x) && inside(y)) << x << ' ' << y;
        }
}

TEST(Raster, WindingDoesNotMatter) {
    Mesh mesh = square(0.1F, 0.9F);
    const auto front = draw(mesh, 16, 16);
    for (glm::uvec3& t : mesh.triangles) std::swap(t.y, t.z);
    const auto back = draw(mesh, 16, 16);
    for (std::size_t i = 0; i < front.size(); ++i) EXPECT_NEAR(front[i], back[i], 1e-6);
}

TEST(Raster, PaddingTakesTheNearestPointOfTheMeshAndEndsAtItsRadius) {
    // Value = u in pixels, a square of pixels 8 to 16 in an image of 24.
    Mesh mesh{{{8, 8}, {16, 8}, {16, 16}, {8, 16}}, {{0, 1, 2}, {0, 2, 3}}, {8, 16, 16, 8}};
    for (glm::vec2& p : mesh.uv) p /= 24.0F;
    const int padding = 4;
    const auto pixels = draw(mesh, 24, 24, padding);
    for (int y = 0; y < 24; ++y)
        for (int x = 0; x < 24; ++x) {
            const double px = x + 0.5, py = y + 0.5;
            const double qx = std::clamp(px, 8.0, 16.0), qy = std::clamp(py, 8.0, 16.0);
            const double distance = std::hypot(px - qx, py - qy);
            const float expected = distance <= padding ? float(qx) : nothing;
            EXPECT_NEAR(pixels[std::size_t(y * 24 + x)], expected, 1e-4) << x << ' ' << y;
        }
}

TEST(Raster, PaddingNeverOverwritesSkin) {
    // Two islands, two pixels apart: the padding of each reaches far into the other.
    Mesh mesh{{{0, 0}, {7, 0}, {7, 16}, {0, 16}, {9, 0}, {16, 0}, {16, 16}, {9, 16}},
              {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}},
              {1, 1, 1, 1, 2, 2, 2, 2}};
    for (glm::vec2& p : mesh.uv) p /= 16.0F;
    const auto pixels = draw(mesh, 16, 16, 8);
    for (int x = 0; x < 16; ++x) EXPECT_EQ(pixels[std::size_t(x)], x < 8 ? 1.0F : 2.0F) << x;
}

TEST(Raster, ATriangleTooThinForACentreStillLeavesItsValue) {
    Mesh mesh{{{4.7F, 1}, {4.8F, 1}, {4.75F, 14}}, {{0, 1, 2}}, {5, 5, 5}};
    for (glm::vec2& p : mesh.uv) p /= 16.0F;
    EXPECT_EQ(draw(mesh, 16, 16, 1)[8 * 16 + 4], 5.0F);
}

TEST(Raster, SkipsAndCountsTrianglesWithoutArea) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const Mesh mesh{{{0, 0}, {1, 1}, {0.5F, 0.5F}, {nan, 0}}, {{0, 1, 2}, {0, 0, 1}, {0, 1, 3}}, {1, 1, 1, 1}};
    for (const float p : draw(mesh, 8, 8, 2)) EXPECT_EQ(p, nothing);
    EXPECT_EQ(count_degenerate_uv(mesh.uv, mesh.triangles), 3U);
    const Mesh sound = square(0, 1);
    EXPECT_EQ(count_degenerate_uv(sound.uv, sound.triangles), 0U);
}

TEST(Raster, NeighboursThatShareAnEdgeDoNotOverlap) {
    // The diagonal of the square runs through centres of texels: they are covered, by one skin.
    const Mesh whole = square(0, 1);
    const UvCoverage coverage = uv_coverage(whole.uv, whole.triangles, 64, 64);
    EXPECT_EQ(coverage.covered, 64U * 64U);
    EXPECT_EQ(coverage.overlapping, 0U);
    EXPECT_EQ(coverage.outside, 0U);
}

TEST(Raster, OverlapsAreCountedTexelByTexelWhateverTheWinding) {
    Mesh mesh = square(0, 0.5F);
    mesh.uv.insert(mesh.uv.end(), {{0.25F, 0.25F}, {0.75F, 0.25F}, {0.75F, 0.75F}, {0.25F, 0.75F}});
    mesh.triangles.insert(mesh.triangles.end(), {{4, 6, 5}, {4, 7, 6}});  // mirrored
    const UvCoverage coverage = uv_coverage(mesh.uv, mesh.triangles, 64, 64);
    EXPECT_EQ(coverage.covered, 2U * 32 * 32 - 16 * 16);
    // The mirrored square's diagonal meets the other one's: 16 centres lie on edges of both, hence in neither.
    EXPECT_EQ(coverage.overlapping, 16U * 16 - 16);
}

TEST(Raster, TrianglesBesideTheSquareAreCounted) {
    constexpr float nan = std::numeric_limits<float>::quiet_NaN();
    const std::vector<glm::vec2> uv = {{1, 0}, {2, 0}, {2, 1}, {0, 0}, {1e30F, 0}, {0, 1e30F}, {nan, 0}};
    const std::vector<glm::uvec3> triangles = {{0, 1, 2}, {3, 4, 5}, {3, 4, 6}, {3, 3, 4}};
    const UvCoverage coverage = uv_coverage(uv, triangles, 8, 8);
    EXPECT_EQ(coverage.outside, 1U);
    EXPECT_EQ(coverage.covered, 64U);
    const std::vector<glm::uvec3> wrong = {{0, 1, 7}};
    EXPECT_THROW(uv_coverage(uv, wrong, 8, 8), std::invalid_argument);
    EXPECT_THROW(uv_coverage(uv, triangles, 0, 8), std::invalid_argument);
}

TEST(Raster, ClipsWhatLiesOutsideTheImage) {
    const auto pixels = draw(square(-1e12F, 1e12F), 8, 8, 4);
    for (const float p : pixels) EXPECT_NE(p, nothing);
    for (const float p : draw(square(2, 3), 8, 8, 4)) EXPECT_EQ(p, nothing);
}

TEST(Raster, KeepsChannelsApart) {
    Mesh mesh{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}, {{0, 1, 2}, {0, 2, 3}}, {1, 10, 1, 10, 1, 10, 1, 10}, 2};
    const auto pixels = draw(mesh, 4, 4);
    for (std::size_t i = 0; i < pixels.size(); i += 2) {
        EXPECT_FLOAT_EQ(pixels[i], 1);
        EXPECT_FLOAT_EQ(pixels[i + 1], 10);
    }
}

TEST(Raster, ThreadsDoNotChangeABit) {
    Mesh mesh = square(0.05F, 0.93F);
    EXPECT_EQ(draw(mesh, 300, 500, 6, 1), draw(mesh, 300, 500, 6, 5));
}

TEST(Raster, RefusesWhatDoesNotFit) {
    Mesh mesh = square(0, 1);
    mesh.triangles.push_back({0, 1, 4});
    EXPECT_THROW(draw(mesh, 8, 8), std::invalid_argument);
    mesh = square(0, 1);
    mesh.values.pop_back();
    EXPECT_THROW(draw(mesh, 8, 8), std::invalid_argument);
    EXPECT_THROW(draw(square(0, 1), 8, 8, -1), std::invalid_argument);
}

}  // namespace
}  // namespace sanguine
