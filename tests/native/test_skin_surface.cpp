// The surface that features grow on: welding, neighbours, and what it refuses.
#include "sanguine/skin_surface.hpp"

#include <limits>

#include <gtest/gtest.h>

#include "message_of.hpp"
#include "skin_meshes.hpp"

namespace sanguine {
namespace {

TEST(SkinSurface, WeldsWhatAFileSplitsAlongASeam) {
    const OwnedSkin ball = ball_skin(85, 24);
    const SkinSurface surface = ball.surface();
    // 25 x 25 corners: the last column is the first one, and each pole one place.
    EXPECT_EQ(surface.position_mm().size(), 24U * 23U + 2U);
    EXPECT_EQ(surface.triangles().size(), ball.triangles.size());
    // A ball has no rim: only the triangles without area at the poles have no neighbours.
    for (std::size_t i = 0; i < surface.triangles().size(); ++i)
        for (const std::uint32_t n : surface.neighbours()[i])
            EXPECT_EQ(n == SkinSurface::none, surface.triangle_area_mm2()[i] == 0) << i;
    // The area of the 24 x 24 facets lies a little below that of the ball.
    EXPECT_NEAR(surface.area_mm2() / (4 * std::numbers::pi * 85 * 85), 0.99, 0.01);
    for (std::size_t v = 0; v < surface.position_mm().size(); ++v)
        EXPECT_GT(glm::dot(surface.normal()[v], glm::normalize(surface.position_mm()[v])), 0.99F);
}

TEST(SkinSurface, NeighboursLieOverTheirSides) {
    const SkinSurface surface = flat_skin(10, 3).surface();
    int rims = 0;
    for (std::uint32_t i = 0; i < surface.triangles().size(); ++i)
        for (int k = 0; k < 3; ++k) {
            const std::uint32_t other = surface.neighbours()[i][std::size_t(k)];
            if (other == SkinSurface::none) {
                ++rims;
                continue;
            }
            const glm::uvec3 a = surface.triangles()[i], b = surface.triangles()[other];
            const auto holds = [&](std::uint32_t v) { return b.x == v || b.y == v || b.z == v; };
            EXPECT_TRUE(holds(a[k]) && holds(a[(k + 1) % 3]));
        }
    EXPECT_EQ(rims, 4 * 3);
}

TEST(SkinSurface, AnEdgeOfThreeTrianglesIsARim) {
    OwnedSkin fin{{{0, 0, 0}, {1, 0, 0}, {0, 0, 1}, {0, 0, -1}, {0, 1, 0}},
                  {{0, 0}, {1, 0}, {0, 1}, {0, 0}, {1, 1}},
                  {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}},
                  {0, 1, 2, 3, 4},
                  {},
                  {}};
    const SkinSurface surface = fin.surface();
    for (const auto& sides : surface.neighbours())
        for (const std::uint32_t n : sides) EXPECT_EQ(n, SkinSurface::none);
}

TEST(SkinSurface, ATriangleWithoutAreaKeepsItsNumberAndHasNoNeighbours) {
    OwnedSkin skin = flat_skin(10, 2);
    skin.triangles.insert(skin.triangles.begin(), {0, 0, 1});
    skin.triangles.push_back({0, 1, 2});  // on a line
    const SkinSurface surface = skin.surface();
    EXPECT_EQ(surface.triangles().size(), skin.triangles.size());
    for (const std::size_t i : {std::size_t(0), skin.triangles.size() - 1}) {
        EXPECT_EQ(surface.triangle_area_mm2()[i], 0);
        for (const std::uint32_t n : surface.neighbours()[i]) EXPECT_EQ(n, SkinSurface::none);
    }
    EXPECT_NEAR(surface.area_mm2(), 100, 1e-3);
}

TEST(SkinSurface, AnswersForPlacesInTriangles) {
    const SkinSurface surface = flat_skin(10, 1).surface();
    const SurfacePoint middle{0, {0.25F, 0.25F, 0.5F}};
    EXPECT_EQ(surface.place_mm(middle), glm::vec3(2.5F, 0, 0));
    EXPECT_EQ(surface.normal_at(middle), glm::vec3(0, -1, 0));
    const std::vector<float> values{0, 4, 0, 8};  // vertices: low left, low right, high left, high right
    EXPECT_EQ(surface.value_at(middle, values), 0.25F * 4 + 0.5F * 8);
    EXPECT_EQ(surface.region("lips").size(), surface.position_mm().size());
    EXPECT_EQ(surface.region("lips")[0], 0);
}

TEST(SkinSurface, RefusesWhatItCannotBe) {
    const auto broken = [](auto change) {
        OwnedSkin skin = flat_skin(10, 2, {"nose"});
        change(skin);
        return message_of([&] { skin.surface(); });
    };
    constexpr float nan = std::numeric_limits<float>::quiet_NaN();
    EXPECT_EQ(broken([](OwnedSkin&) {}), "");
    EXPECT_EQ(broken([](OwnedSkin& s) { s.triangles[3].y = 9; }),
              "skin surface: triangle 3 names a corner that does not exist");
    EXPECT_EQ(broken([](OwnedSkin& s) { s.corner_vertex[2] = 0xffffffffU; }),
              "skin surface: corner 2 names a vertex that does not exist");
    EXPECT_EQ(broken([](OwnedSkin& s) { s.corner_vertex.pop_back(); }),
              "skin surface: corner_vertex and uv differ in length");
    EXPECT_EQ(broken([](OwnedSkin& s) { s.position_mm[1].z = nan; }),
              "skin surface: position_mm of vertex 1 is not a finite number below 1e6");
    EXPECT_EQ(broken([](OwnedSkin& s) { s.uv[4].x = nan; }), "skin surface: uv of corner 4 is not finite");
    EXPECT_EQ(broken([](OwnedSkin& s) { s.region_weights[5] = 1.5F; }),
              "skin surface: weight of region 'nose' at vertex 5 is not within 0 to 1");
    EXPECT_EQ(broken([](OwnedSkin& s) { s.region_weights[5] = nan; }),
              "skin surface: weight of region 'nose' at vertex 5 is not within 0 to 1");
    EXPECT_EQ(broken([](OwnedSkin& s) { s.region_weights.pop_back(); }),
              "skin surface: region_weights are not vertices * regions");
    EXPECT_EQ(broken([](OwnedSkin& s) { s.triangles.clear(); }), "skin surface: the mesh has no triangles");
    EXPECT_EQ(broken([](OwnedSkin& s) { s.position_mm.assign(9, glm::vec3(1)); }),
              "skin surface: no triangle has an area");
    EXPECT_EQ(broken([](OwnedSkin& s) {
                  for (glm::vec3& p : s.position_mm) p *= 1000.0F;
              }),
              "skin surface: an area of more than 10 m^2: position_mm has to be in millimetres");
}

}  // namespace
}  // namespace sanguine
