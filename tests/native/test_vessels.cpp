// Vessels on a surface: how they walk, fork and fill it, and what of them shows.
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include <gtest/gtest.h>

#include "features/vessels.hpp"
#include "random.hpp"
#include "sanguine/feature.hpp"
#include "skin_meshes.hpp"
#include "standard_face.hpp"
#include "surface_walk.hpp"
#include "vessel_paint.hpp"
#include "vessel_tree.hpp"

namespace sanguine {
namespace {

constexpr double degree = std::numbers::pi / 180;

/// A prism of `sides` quads round the z axis, each of `width` by `height` mm, its vertices split where it closes.
OwnedSkin prism(int sides, float width_mm, float height_mm) {
    OwnedSkin skin;
    const double radius = width_mm / 2 / std::sin(std::numbers::pi / sides);
    for (int j = 0; j <= 1; ++j)
        for (int i = 0; i <= sides; ++i) {
            const double around = 2 * std::numbers::pi * (i % sides) / sides;
            skin.corner_vertex.push_back(std::uint32_t(skin.position_mm.size()));
            skin.position_mm.push_back(
                glm::vec3(radius * std::cos(around), radius * std::sin(around), height_mm * float(j)));
            skin.uv.push_back({float(i) / float(sides), float(j)});
        }
    const auto at = [&](int i, int j) { return std::uint32_t(j * (sides + 1) + i); };
    for (int i = 0; i < sides; ++i) {
        skin.triangles.push_back({at(i, 0), at(i + 1, 0), at(i + 1, 1)});
        skin.triangles.push_back({at(i, 0), at(i + 1, 1), at(i, 1)});
    }
    return skin;
}

TEST(SurfaceWalk, GoesStraightWhereThePaperIsFlat) {
    const SkinSurface surface = flat_skin(50, 7).surface();
    Random random(4);
    for (int k = 0; k < 200; ++k) {
        const SurfacePoint start{std::uint32_t(random.bits() % 98), {0.2F, 0.3F, 0.5F}};
        const glm::dvec3 from(surface.place_mm(start));
        const double angle = random.uniform(0, 6.28F), length = random.uniform(0, 12);
        const glm::dvec3 to = from + length * glm::dvec3(std::cos(angle), 0, std::sin(angle));
        SurfaceWalk walk(surface, start, to - from);
        if (std::max(std::abs(to.x), std::abs(to.z)) > 24.9) continue;
        ASSERT_TRUE(walk.advance(length));
        // A walk keeps 1e-7 of a triangle away from vertices.
        EXPECT_LT(glm::distance(walk.place_mm(), to), 1e-4);
        EXPECT_LT(glm::distance(glm::dvec3(surface.place_mm(walk.point())), to), 1e-4);
    }
}

TEST(SurfaceWalk, IsStraightOnThePaperThatIsFolded) {
    // A prism unrolls: x of the paper is the way round, across the seam and over every fold.
    constexpr int sides = 11;
    constexpr float width = 4, height = 60;
    const SkinSurface surface = prism(sides, width, height).surface();
    const SurfacePoint start{0, {0.5F, 0.2F, 0.3F}};  // on the paper at (2, 18)
    const glm::dvec3 from(surface.place_mm(start));
    for (const double angle : {0.0, 20.0, 40.0, -15.0, 160.0, 180.0}) {
        const double length = angle == 0 || angle == 180 ? 2.5 * sides * width : 45;
        const glm::dvec3 along = glm::normalize(glm::dvec3(surface.position_mm()[1] - surface.position_mm()[0]));
        SurfaceWalk walk(surface, start, along * std::cos(angle * degree) + glm::dvec3(0, 0, std::sin(angle * degree)));
        ASSERT_TRUE(walk.advance(length)) << angle;
        const double x = 2 + length * std::cos(angle * degree), z = from.z + length * std::sin(angle * degree);
        const auto side = (int(std::floor(x / width)) % sides + sides) % sides;
        const glm::dvec3 a(surface.position_mm()[std::size_t(side)]);
        const glm::dvec3 b(surface.position_mm()[std::size_t((side + 1) % sides)]);
        const glm::dvec3 there = a + (x / width - std::floor(x / width)) * (b - a);
        EXPECT_LT(glm::distance(walk.place_mm(), glm::dvec3(there.x, there.y, z)), 1e-3) << angle;
    }
}

TEST(SurfaceWalk, EndsAtARim) {
    const SkinSurface surface = flat_skin(20, 3).surface();
    SurfaceWalk walk(surface, {0, {0.3F, 0.3F, 0.4F}}, {1, 0, 0.2});
    EXPECT_FALSE(walk.advance(1000));
    EXPECT_NEAR(walk.place_mm().x, 10, 1e-5);
    EXPECT_FALSE(walk.advance(1)) << "it stays there";
    EXPECT_NEAR(walk.place_mm().x, 10, 1e-5);
}

TEST(SurfaceWalk, TurnsByTheAngleAskedFor) {
    const SkinSurface surface = ball_skin().surface();
    SurfaceWalk walk(surface, {500, {0.2F, 0.5F, 0.3F}}, {0.3, 0.2, 1});
    const glm::dvec3 before = walk.direction();
    walk.turn(0.7);
    EXPECT_NEAR(glm::dot(walk.direction(), before), std::cos(0.7), 1e-12);
    EXPECT_NEAR(walk.angle_to(before), -0.7, 1e-12);
    walk.turn_toward(before, 0.2);
    EXPECT_NEAR(walk.angle_to(before), -0.5, 1e-12);
    walk.turn_toward(before, 2);
    EXPECT_NEAR(walk.angle_to(before), 0, 1e-12);
}

/// Needles, a fold without area, an edge of three triangles, a rim and a piece that hangs alone.
OwnedSkin broken_skin() {
    OwnedSkin skin = flat_skin(30, 6, {"cheeks"});
    const auto add = [&](glm::vec3 p) {
        skin.position_mm.push_back(p);
        skin.uv.push_back({0.5F, 0.5F});
        skin.region_weights.push_back(1);
        skin.corner_vertex.push_back(std::uint32_t(skin.position_mm.size() - 1));
        return std::uint32_t(skin.position_mm.size() - 1);
    };
    skin.triangles.push_back({10, 11, add({0, -5, 0})});                                   // a third one on an edge
    skin.triangles.push_back({3, 4, 3});                                                   // two corners the same
    skin.triangles.push_back({add({0, 1, 0}), add({9, 1, 0}), add({4, 1, 1e-6F})});        // a needle
    skin.triangles.push_back({add({50, 0, 0}), add({50.01F, 0, 0}), add({50, 0, 0.01F})}); // a crumb
    return skin;
}

TEST(SurfaceWalk, ComesToAnEndOnBrokenMeshes) {
    const SkinSurface surface = broken_skin().surface();
    Random random(8);
    for (std::uint32_t triangle = 0; triangle < surface.triangles().size(); ++triangle)
        for (int k = 0; k < 20; ++k) {
            SurfaceWalk walk(surface, {triangle, {0.1F, 0.6F, 0.3F}},
                             {random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)});
            for (int step = 0; step < 100 && walk.advance(1); ++step) walk.turn(random.uniform(-1, 1));
            const glm::dvec3 p = walk.place_mm(), d = walk.direction();
            EXPECT_TRUE(std::isfinite(p.x + p.y + p.z + d.x + d.y + d.z));
        }
}

struct Fork {
    double side_angle;  // to the main branch ahead
    int sides;
    double lost;        // of the cube of the radius
};

std::vector<Fork> forks_of(const VesselTree& tree) {
    std::map<std::uint32_t, std::vector<const VesselSegment*>> behind;
    for (const VesselSegment& s : tree.segments())
        if (s.parent != VesselTree::none) behind[s.parent].push_back(&s);
    std::vector<Fork> forks;
    for (const auto& [parent, next] : behind) {
        if (next.size() < 2) continue;
        const VesselSegment& before = tree.segments()[parent];
        const auto course = [](const VesselSegment& s) { return glm::normalize(s.to_mm - s.from_mm); };
        const auto main = std::ranges::find(next, before.branch, [](const VesselSegment* s) { return s->branch; });
        double sum = 0, angle = 0;
        for (const VesselSegment* s : next) {
            sum += std::pow(double(s->radius_mm), 3);
            if (s->branch != before.branch)
                angle += std::acos(std::clamp(double(glm::dot(course(*s), course(**main))), -1.0, 1.0));
        }
        forks.push_back({angle / double(next.size() - 1), int(next.size() - 1),
                         1 - sum / std::pow(double(before.radius_mm), 3)});
    }
    return forks;
}

VesselTree arteries_of_all(const char* region) {
    static std::map<std::string, SkinSurface> skins;  // the tree needs its surface
    return facial_arteries(skins.try_emplace(region, flat_skin(90, 9, {region}).mesh()).first->second, 5);
}

TEST(Arteries, ForkByTheAnglesOfTheirRegion) {
    struct Case {
        const char* region;
        double median_degrees;
        bool paired;
    };
    for (const Case& c : {Case{"forehead", 36, true}, {"nose", 36, true}, {"cheeks", 82, false}, {"chin", 82, false},
                          {"ears", 52, false}}) {
        std::vector<Fork> forks = forks_of(arteries_of_all(c.region));
        ASSERT_GT(forks.size(), 60U) << c.region;
        std::ranges::sort(forks, {}, &Fork::side_angle);
        const double median = forks[forks.size() / 2].side_angle / degree;
        // The standard deviation is 6 degrees: of the median of 60 forks 1. Vessels near others give way by some more.
        EXPECT_NEAR(median, c.median_degrees, 4) << c.region;
        const auto pairs = std::ranges::count(forks, 2, &Fork::sides);
        // One branch of a pair may have no room.
        if (c.paired) EXPECT_GT(double(pairs), 0.5 * double(forks.size())) << c.region;
        else EXPECT_EQ(pairs, 0) << c.region;
    }
}

TEST(Arteries, ObeyMurraysLaw) {
    for (const char* region : {"forehead", "cheeks", "ears"})
        for (const Fork& fork : forks_of(arteries_of_all(region))) EXPECT_NEAR(fork.lost, 0, 1e-5);  // float32
}

TEST(Arteries, FillTheSkinEvenly) {
    for (const auto& [region, spacing] : {std::pair{"cheeks", 2.1}, {"forehead", 2.8}, {"neck", 5.0}}) {
        const VesselTree tree = arteries_of_all(region);
        double length = 0;
        for (const VesselSegment& s : tree.segments()) length += glm::distance(s.from_mm, s.to_mm);
        // Parallel lines at their spacing have a length per area of 1 / spacing; those that fork and stop have less.
        const double per_mm2 = length / (90 * 90);
        EXPECT_GT(per_mm2 * spacing, 0.3) << region;
        EXPECT_LT(per_mm2 * spacing, 1.0) << region;
        // No hole: a place that is more than two spacings away from all vessels is rare.
        int holes = 0;
        constexpr int n = 40;
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < n; ++j)
                holes += tree.is_free({2 * i - n + 1, 0, 2 * j - n + 1}, {0, -1, 0}, float(2 * spacing));
        EXPECT_LT(holes, 0.03 * n * n) << region;
    }
}

TEST(Arteries, KeepTheirDistanceFromOtherTrees) {
    const VesselTree tree = arteries_of_all("cheeks");
    const auto segments = tree.segments();
    for (std::size_t i = 0; i < segments.size(); ++i)
        for (std::size_t j = 0; j < i; ++j) {
            if (segments[i].tree == segments[j].tree) continue;
            ASSERT_GE(glm::distance(segments[i].to_mm, segments[j].to_mm), 2.1F * 0.999F);
        }
}

TEST(Arteries, StayOnTheSurfaceAndCrossItsSeam) {
    const SkinSurface surface = ball_skin(85, 64).surface();
    const VesselTree tree = facial_arteries(surface, 9);
    ASSERT_GT(tree.segments().size(), 3000U);
    int across = 0;
    for (const VesselSegment& s : tree.segments()) {
        EXPECT_LT(glm::distance(surface.place_mm(s.end), s.to_mm), 1e-3F);
        // A facet of 64 cells lies less than 85 (1 - cos(5.6 / sqrt(2) degrees)) below the ball.
        EXPECT_NEAR(glm::length(s.to_mm), 84.8, 0.25);
        across += s.from_mm.y > 0 && s.from_mm.x * s.to_mm.x < 0;  // the seam runs down the back at x = 0
    }
    EXPECT_GT(across, 10);
}

TEST(Arteries, EndAtRims) {
    const SkinSurface surface = flat_skin(30, 4, {"cheeks"}).surface();
    const VesselTree tree = facial_arteries(surface, 2);
    float reach = 0;
    for (const VesselSegment& s : tree.segments())
        reach = std::max({reach, std::abs(s.to_mm.x), std::abs(s.to_mm.z)});
    EXPECT_LE(reach, 15.0001F);
    EXPECT_GT(reach, 13);
}

TEST(Arteries, DependOnTheSeedAlone) {
    const SkinSurface surface = ball_skin().surface();
    const auto places = [&](std::uint64_t seed) {
        std::vector<float> all;
        const VesselTree tree = facial_arteries(surface, seed);
        for (const VesselSegment& s : tree.segments())
            all.insert(all.end(), {s.to_mm.x, s.to_mm.y, s.to_mm.z, s.radius_mm});
        return all;
    };
    const auto once = places(7);
    EXPECT_EQ(once, places(7));
    EXPECT_NE(once, places(8));
}

TEST(VesselTree, StopsAtItsMostSegments) {
    const SkinSurface surface = ball_skin().surface();
    const auto habit = [](const VesselTip&) { return VesselHabit{.spacing_mm = 0, .fork_every_mm = 1}; };
    VesselTree tree(surface, habit, 0.5F, 1, 500);
    tree.plant({100, {0.3F, 0.3F, 0.4F}}, {1, 0, 0}, 1);
    tree.grow();
    // The last step may make a fork.
    EXPECT_GE(tree.segments().size(), 500U);
    EXPECT_LE(tree.segments().size(), 502U);
}

TEST(Features, OfVesselsAnswerOnBrokenAndTinyMeshes) {
    OwnedSkin tiny = flat_skin(0.01F, 2, {"nose"});
    OwnedSkin one = flat_skin(40, 1, {"cheeks", "eyelids"});
    for (const OwnedSkin& skin : {broken_skin(), tiny, one}) {
        const SkinSurface surface = skin.surface();
        const TexelMap map = map_texels(surface, 32, 32, 1, 1);
        for (const char* id : {"vessels", "veins", "telangiectasia"}) {
            const FeatureRow& row = feature(id).row();
            const auto layer = grow_layer(feature(id), surface, map, {70, 1, 1}, 1, 1, {});
            for (std::size_t i = 0; i < layer.size(); ++i) {
                const LayerChange& change = row.changes[i % row.changes.size()];
                EXPECT_TRUE(layer[i] >= change.low && layer[i] <= change.high) << id << ' ' << layer[i];
            }
        }
    }
}

/// The integral of what shows of a vessel along +X over a square of texels of `size_mm`.
double shown(const VesselPaint& paint, float size_mm, float side_mm = 60) {
    const int n = int(side_mm / size_mm);
    double sum = 0;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j)
            sum += paint.at({{(float(i) + 0.5F) * size_mm - side_mm / 2, 0, (float(j) + 0.5F) * size_mm - side_mm / 2},
                             {0, -1, 0}, size_mm, {}}).x * double(size_mm * size_mm);
    return sum;
}

TEST(VesselPaint, KeepsItsMeanWhateverTheTexel) {
    // Oblique, so that it does not run along the texels.
    const VesselPaint paint({{{-8, 0, -5.1F}, {7, 0, 6.3F}, {0, -1, 0}, 0.15F, {0.3F, 0}}});
    const double whole = 0.3 * std::hypot(15, 11.4);
    // Sampling: the bell is half a texel wide or more.
    for (const float size : {0.1F, 0.25F, 0.5F, 0.75F, 1.5F, 3.0F, 6.0F})
        EXPECT_NEAR(shown(paint, size), whole, 0.01 * whole) << size;
}

TEST(VesselPaint, JoinsPiecesWithoutAMark) {
    const glm::vec3 from(-6, 0, 1), to(5, 0, -2);
    std::vector<VesselStroke> pieces;
    for (int i = 0; i < 9; ++i) {
        const float a = float(i) / 9, b = float(i + 1) / 9;
        pieces.push_back({from + a * (to - from), from + b * (to - from), {0, -1, 0}, 0.4F, {1, 2}});
    }
    const VesselPaint one({{from, to, {0, -1, 0}, 0.4F, {1, 2}}}), many(pieces);
    Random random(1);
    for (int k = 0; k < 500; ++k) {
        const SkinPlace place{{random.uniform(-8, 8), 0, random.uniform(-4, 4)}, {0, -1, 0}, random.uniform(0, 2), {}};
        // float32: the distance from the vessel is a difference of squares of up to 12 mm.
        EXPECT_NEAR(one.at(place).x, many.at(place).x, 5e-5F);
        EXPECT_NEAR(one.at(place).y, 2 * one.at(place).x, 1e-5F);
    }
}

TEST(VesselPaint, IsNotSeenFromTheOtherSide) {
    const VesselPaint paint({{{-5, 0, 0}, {5, 0, 0}, {0, -1, 0}, 0.4F, {1, 0}}});
    EXPECT_GT(paint.at({{0, 0, 0}, {0, -1, 0}, 0.1F, {}}).x, 0.5F);
    EXPECT_EQ(paint.at({{0, 0.2F, 0}, {0, 1, 0}, 0.1F, {}}).x, 0);
    EXPECT_EQ(VesselPaint().at({{0, 0, 0}, {0, -1, 0}, 0.1F, {}}).x, 0);
}

TEST(VesselPaint, NeverLeavesItsLimit) {
    for (float value = 0; value < 50; value += 0.01F) {
        EXPECT_LE(held_below(0.5F, value), 0.5F);
        EXPECT_GE(held_below(0.5F, value + 0.01F), held_below(0.5F, value));
    }
    EXPECT_EQ(held_below(0.5F, 0.2F), 0.2F);
}

/// What a layer of telangiectases holds, in mm^2 times its contrast.
double telangiectasia_of(const Person& person) {
    static const SkinSurface surface = ball_skin(85, 64).surface();
    static const TexelMap map = map_texels(surface, 700, 700, 0, 0);
    double sum = 0;
    const auto layer = grow_layer(feature("telangiectasia"), surface, map, person, 3, 0, {});
    for (std::size_t i = 0; i < layer.size(); ++i)
        sum += layer[i] * double(map.place[i].size_mm * map.place[i].size_mm);
    return sum;
}

TEST(Telangiectasia, GrowsWithAgeAndSunAsMeasured) {
    // Mekic et al. 2020: 1.7 % a year; median 0.95 % of the face in women, 0.76 % in men. A tree is planted whole, and
    // vessels of less than 100 mm^2 are some 60 trees: 15 %.
    const double woman = telangiectasia_of({66.9, 0.5, 0});
    EXPECT_NEAR(telangiectasia_of({40, 0.5, 0}) / woman, std::exp(-0.017 * 26.9), 0.1);
    EXPECT_NEAR(telangiectasia_of({66.9, 0.5, 1}) / woman, 0.76 / 0.95, 0.12);
    EXPECT_NEAR(telangiectasia_of({66.9, 1, 0}) / woman, 1.5, 0.2);
    EXPECT_EQ(telangiectasia_of({4, 1, 0}), 0);
}

TEST(StandardFace, IsFoundByTheLidsAndScales) {
    const SkinSurface surface = ball_skin(85, 64).surface(), small = ball_skin(42.5F, 64).surface();
    const auto face = StandardFace::of(surface), child = StandardFace::of(small);
    ASSERT_TRUE(face && child);
    EXPECT_NEAR(face->scale() / child->scale(), 2, 1e-3);
    // On the ball the lids' middles are at (+-0.35, -0.93, 0.1) radii; their skin is cut by its curvature.
    EXPECT_NEAR(face->scale() * 62, 2 * 0.35 * 85, 2);
    EXPECT_NEAR(face->place_mm({0, 0, 0}).z, 0.1 * 85, 1);
    const glm::vec3 p(3, -40, 12);
    EXPECT_LT(glm::distance(face->place_mm(face->standard(p)), p), 1e-4F);
    const glm::vec3 out = surface.place_mm(nearest_point(surface, {0, 0, 200}));
    EXPECT_NEAR(out.z, 85, 0.2);
    EXPECT_FALSE(StandardFace::of(flat_skin(50, 4, {"nose"}).surface()));
}

}  // namespace
}  // namespace sanguine
