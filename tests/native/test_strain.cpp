// Strain against deformations that can be worked out by hand, and stripes against phases that are known.
#include "sanguine/strain.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/mat3x3.hpp>
#include <gtest/gtest.h>

namespace sanguine {
namespace {

struct Grid {
    std::vector<glm::vec3> position;
    std::vector<glm::uvec3> triangles;
};

/// n x n squares of side 1 in a plane that lies askew, so that no axis of space is one of the surface.
const glm::mat3 askew = glm::mat3(glm::rotate(glm::mat4(1), 0.7F, glm::normalize(glm::vec3(1, 2, 3))));

Grid grid(unsigned n) {
    Grid mesh;
    for (unsigned y = 0; y <= n; ++y)
        for (unsigned x = 0; x <= n; ++x) mesh.position.push_back(askew * glm::vec3(x, y, 0));
    for (unsigned y = 0; y < n; ++y)
        for (unsigned x = 0; x < n; ++x) {
            const unsigned a = y * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
            mesh.triangles.push_back({a, b, d});
            mesh.triangles.push_back({a, d, c});
        }
    return mesh;
}

/// A sphere of radius 10 by latitude and longitude, without its poles.
Grid ball(unsigned rows, unsigned columns) {
    Grid mesh;
    for (unsigned i = 0; i <= rows; ++i)
        for (unsigned j = 0; j < columns; ++j) {
            const double tilt = 0.3 + 2.5 * i / rows, turn = 2 * std::numbers::pi * j / columns;
            mesh.position.push_back(10.0F * glm::vec3(std::sin(tilt) * std::cos(turn), std::sin(tilt) * std::sin(turn),
                                                      std::cos(tilt)));
        }
    for (unsigned i = 0; i < rows; ++i)
        for (unsigned j = 0; j < columns; ++j) {
            const unsigned a = i * columns + j, b = i * columns + (j + 1) % columns, c = a + columns, d = b + columns;
            mesh.triangles.push_back({a, c, d});
            mesh.triangles.push_back({a, d, b});
        }
    return mesh;
}

std::vector<glm::vec3> moved_by(const Grid& mesh, const glm::mat3& f) {
    std::vector<glm::vec3> displacement;
    for (const glm::vec3 p : mesh.position) displacement.push_back(f * p - p);
    return displacement;
}

glm::mat3 matrix(const SurfaceTensor& t) { return {{t[0], t[3], t[4]}, {t[3], t[1], t[5]}, {t[4], t[5], t[2]}}; }

void expect_near(const SurfaceTensor& found, const glm::mat3& wanted, float tolerance) {
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) EXPECT_NEAR(matrix(found)[i][j], wanted[i][j], tolerance) << i << j;
}

/// The plane tensor [[xx, xy], [xy, yy]] as it stands in space.
glm::mat3 in_space(float xx, float yy, float xy) {
    return askew * glm::mat3(xx, xy, 0, xy, yy, 0, 0, 0, 0) * glm::transpose(askew);
}

/// What a map of the plane does in space, leaving the normal alone.
glm::mat3 plane_map(float xx, float xy, float yx, float yy) {
    return askew * glm::mat3(xx, yx, 0, xy, yy, 0, 0, 0, 1) * glm::transpose(askew);
}

// Single precision positions of some units: strains are good to about 1e-6.
constexpr float rounding = 3e-6F;

TEST(Strain, UniformScaleIsItsLogarithmInEveryDirection) {
    const Grid mesh = grid(4);
    const RestShape rest(mesh.position, mesh.triangles);
    for (const float scale : {0.5F, 1.0F, 1.3F})
        for (const auto& e : rest.strain(moved_by(mesh, glm::mat3(scale)), StrainMeasure::logarithmic))
            expect_near(e, in_space(std::log(scale), std::log(scale), 0), rounding);
}

TEST(Strain, OnACurvedSurfaceTheTraceIsStillTheLogarithmOfTheArea) {
    const Grid mesh = ball(12, 24);
    const RestShape rest(mesh.position, mesh.triangles);
    const auto strain = rest.strain(moved_by(mesh, glm::mat3(1.2F)), StrainMeasure::logarithmic);
    for (std::size_t v = 0; v < strain.size(); ++v) {
        EXPECT_NEAR(strain[v][0] + strain[v][1] + strain[v][2], 2 * std::log(1.2F), rounding);
        EXPECT_NEAR(glm::length(matrix(strain[v]) * rest.normal()[v]), 0, rounding);
    }
}

TEST(Strain, ARotationIsNoStrainHoweverFar) {
    const Grid mesh = ball(8, 16);
    const RestShape rest(mesh.position, mesh.triangles);
    const glm::mat3 turn(glm::rotate(glm::mat4(1), 2.5F, glm::normalize(glm::vec3(3, -1, 2))));
    for (const auto& e : rest.strain(moved_by(mesh, turn), StrainMeasure::logarithmic))
        expect_near(e, glm::mat3(0), rounding);
}

TEST(Strain, SimpleShearHasThePrincipalStretchesOfTheTextbook) {
    const float s = 0.8F;
    const Grid mesh = grid(3);
    const auto strain = RestShape(mesh.position, mesh.triangles)
                            .strain(moved_by(mesh, plane_map(1, s, 0, 1)), StrainMeasure::logarithmic);
    // C = [[1, s], [s, 1 + s^2]]; its eigenvalues are the squares of l and 1/l with l = s/2 + sqrt(1 + s^2/4).
    const float l = s / 2 + std::sqrt(1 + s * s / 4);
    const glm::vec2 along = glm::normalize(glm::vec2(s, l * l - 1));
    const float f = std::log(l);
    for (const auto& e : strain)
        expect_near(e, in_space(f * (along.x * along.x - along.y * along.y),
                                f * (along.y * along.y - along.x * along.x), 2 * f * along.x * along.y), rounding);
}

TEST(Strain, LinearStrainIsTheSymmetricGradientAndSuperposes) {
    const Grid mesh = grid(3);
    const RestShape rest(mesh.position, mesh.triangles);
    const auto a = moved_by(mesh, plane_map(1.1F, 0.3F, 0, 1)), b = moved_by(mesh, plane_map(1, 0, 0.2F, 0.7F));
    std::vector<glm::vec3> mix;
    for (std::size_t v = 0; v < a.size(); ++v) mix.push_back(0.5F * a[v] + 0.25F * b[v]);
    for (const auto& e : rest.strain(a, StrainMeasure::linear)) expect_near(e, in_space(0.1F, 0, 0.15F), rounding);
    for (const auto& e : rest.strain(mix, StrainMeasure::linear))
        expect_near(e, in_space(0.05F, -0.075F, 0.5F * 0.15F + 0.25F * 0.1F), rounding);
}

TEST(Strain, BothMeasuresAgreeForSmallMoves) {
    const Grid mesh = ball(8, 16);
    const RestShape rest(mesh.position, mesh.triangles);
    std::vector<glm::vec3> displacement;
    for (const glm::vec3 p : mesh.position)
        displacement.push_back(1e-3F * glm::vec3(std::sin(p.x), p.y * 0.3F, std::cos(p.z)));
    const auto linear = rest.strain(displacement, StrainMeasure::linear);
    const auto exact = rest.strain(displacement, StrainMeasure::logarithmic);
    // They part by squares of gradients of some 1e-3.
    for (std::size_t v = 0; v < linear.size(); ++v) expect_near(exact[v], matrix(linear[v]), 1e-5F);
}

TEST(Strain, ACollapseStaysFinite) {
    const Grid mesh = grid(3);
    for (const auto& e : RestShape(mesh.position, mesh.triangles)
                             .strain(moved_by(mesh, glm::mat3(0)), StrainMeasure::logarithmic))
        expect_near(e, in_space(float(std::log(min_stretch)), float(std::log(min_stretch)), 0), 1e-5F);
}

TEST(Strain, TrianglesWithoutAreaTakeNoPart) {
    Grid mesh = grid(2);
    const auto before = RestShape(mesh.position, mesh.triangles)
                            .strain(moved_by(mesh, plane_map(1.2F, 0, 0, 0.9F)), StrainMeasure::logarithmic);
    mesh.position.push_back(mesh.position[1]);  // a spike of no width, and a vertex that stands alone
    mesh.position.push_back(glm::vec3(5));
    mesh.triangles.push_back({0, 1, 9});
    mesh.triangles.push_back({0, 0, 0});
    const RestShape rest(mesh.position, mesh.triangles);
    const auto after = rest.strain(moved_by(mesh, plane_map(1.2F, 0, 0, 0.9F)), StrainMeasure::logarithmic);
    for (std::size_t v = 0; v < before.size(); ++v) EXPECT_EQ(before[v], after[v]);
    EXPECT_EQ(after[9], SurfaceTensor{});
    EXPECT_EQ(after[10], SurfaceTensor{});
    EXPECT_EQ(rest.area()[10], 0.0F);
    EXPECT_TRUE(RestShape({}, {}).strain({}, StrainMeasure::linear).empty());
}

TEST(Strain, RefusesWhatDoesNotFit) {
    Grid mesh = grid(1);
    const std::vector<glm::vec3> still(4, glm::vec3(0));
    EXPECT_THROW(RestShape(mesh.position, mesh.triangles).strain({still.data(), 3}, StrainMeasure::linear),
                 std::invalid_argument);
    mesh.triangles.push_back({0, 1, 4});
    EXPECT_THROW(RestShape(mesh.position, mesh.triangles), std::invalid_argument);
    mesh = grid(1);
    mesh.position[2].y = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW(RestShape(mesh.position, mesh.triangles), std::invalid_argument);
}

TEST(Stripes, FollowAConstantDirectionWhateverTheSigns) {
    const Grid mesh = grid(8);
    const glm::vec3 across = askew * glm::vec3(0.3F, 0.1F, 0);
    std::vector<glm::vec3> field;
    for (std::size_t v = 0; v < mesh.position.size(); ++v) field.push_back(v * 7 % 3 == 0 ? across : -across);
    const std::vector<float> weight(field.size(), 2.0F);
    const auto phase = stripe_phase(mesh.position, mesh.triangles, field, weight);
    const float sign = phase[8] > phase[0] ? 1.0F : -1.0F;
    for (std::size_t v = 0; v < phase.size(); ++v)  // the small pull to a mean of 0 costs some 1e-6 of it
        EXPECT_NEAR(sign * (phase[v] - phase[0]), glm::dot(across, mesh.position[v] - mesh.position[0]), 1e-4);
}

TEST(Stripes, OnTwoSeparatePatchesEachHasItsPhase) {
    Grid mesh = grid(3);
    const auto count = unsigned(mesh.position.size());
    const std::size_t triangles = mesh.triangles.size();
    for (unsigned v = 0; v < count; ++v) mesh.position.push_back(mesh.position[v] + glm::vec3(100, 0, 0));
    for (std::size_t t = 0; t < triangles; ++t) mesh.triangles.push_back(mesh.triangles[t] + glm::uvec3(count));
    const std::vector<glm::vec3> field(mesh.position.size(), askew * glm::vec3(0.2F, 0, 0));
    const auto phase = stripe_phase(mesh.position, mesh.triangles, field, std::vector<float>(field.size(), 1.0F));
    for (unsigned v = 0; v < count; ++v)
        EXPECT_NEAR(std::abs(phase[v] - phase[0]), std::abs(phase[count + v] - phase[count]), 1e-4);
}

TEST(Stripes, WithoutDirectionsThereIsNoPhase) {
    const Grid mesh = grid(2);
    const std::vector<glm::vec3> none(mesh.position.size(), glm::vec3(0));
    for (const float w : {0.0F, 1.0F})
        for (const float p : stripe_phase(mesh.position, mesh.triangles, none, std::vector<float>(none.size(), w)))
            EXPECT_EQ(p, 0.0F);
    EXPECT_TRUE(stripe_phase({}, {}, {}, {}).empty());
    EXPECT_THROW(stripe_phase(mesh.position, mesh.triangles, none, std::vector<float>(none.size(), -1.0F)),
                 std::invalid_argument);
}

}  // namespace
}  // namespace sanguine
