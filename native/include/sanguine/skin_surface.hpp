// The skin of a face as features grow on it: a triangle mesh in true millimetres, its UV layout and its regions.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

namespace sanguine {

/// A point of the surface: in a triangle, by its barycentric coordinates.
struct SurfacePoint {
    std::uint32_t triangle;
    glm::vec3 barycentric;
};

/// What the mesh is made from. A vertex on a UV seam is one vertex with several corners.
struct SkinMesh {
    std::span<const glm::vec3> position_mm;       ///< per vertex, of the neutral face; Z up, the face looks along -Y
    std::span<const glm::vec2> uv;                ///< per corner
    std::span<const glm::uvec3> triangles;        ///< of corners
    std::span<const std::uint32_t> corner_vertex; ///< the vertex of each corner
    std::span<const std::string> region_names;    ///< ids of rigs/regions.toml
    std::span<const float> region_weights;        ///< [vertex][region], 0 to 1
};

/// A checked copy with what walking on the surface needs. Immutable, hence safe to share between threads.
///
/// Vertices at the same place are one vertex here: files that split vertices along UV seams give the same surface as
/// those that do not. Triangles without area are kept in the numbering and stand outside of every neighbourhood.
class SkinSurface {
public:
    static constexpr std::uint32_t none = 0xffffffffU;

    /// Throws std::invalid_argument for indices that do not exist, values that are not finite and weights outside 0-1.
    explicit SkinSurface(const SkinMesh& mesh);

    std::span<const glm::vec3> position_mm() const { return position_mm_; }   ///< per welded vertex
    std::span<const glm::vec3> normal() const { return normal_; }             ///< per welded vertex, unit, by angle
    std::span<const glm::uvec3> triangles() const { return triangles_; }      ///< of welded vertices
    std::span<const glm::uvec3> corners() const { return corners_; }          ///< the same triangles, of UV corners
    std::span<const glm::vec2> uv() const { return uv_; }
    std::span<const double> triangle_area_mm2() const { return area_; }
    double area_mm2() const;

    /// The triangle over each side (side k lies between corner k and k + 1), or `none` at a rim.
    std::span<const std::array<std::uint32_t, 3>> neighbours() const { return neighbours_; }

    /// Weight of a region at welded vertices; all zero for a region that the face has no mask for.
    std::span<const float> region(std::string_view id) const;

    glm::vec3 place_mm(const SurfacePoint& point) const;
    glm::vec3 normal_at(const SurfacePoint& point) const;  ///< unit, smooth
    float value_at(const SurfacePoint& point, std::span<const float> per_vertex) const;

private:
    std::vector<glm::vec3> position_mm_, normal_;
    std::vector<glm::vec2> uv_;
    std::vector<glm::uvec3> triangles_, corners_;
    std::vector<std::array<std::uint32_t, 3>> neighbours_;
    std::vector<double> area_;
    std::vector<std::string> region_names_;
    std::vector<std::vector<float>> region_weights_;  // [region][welded vertex]
    std::vector<float> no_region_;
};

}  // namespace sanguine
