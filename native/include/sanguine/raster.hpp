// Values on the corners of a mesh, drawn into its UV layout.
#pragma once

#include <cstddef>
#include <span>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

namespace sanguine {

/// Triangles in UV space. Corners are the loops of the mesh: a vertex on a seam has one per side.
struct UvMesh {
    std::span<const glm::vec2> uv;          ///< one per corner; (0,0) to (1,1) is the image
    std::span<const glm::uvec3> triangles;  ///< indices of corners, either winding
    std::span<const float> values;          ///< `channels` per corner, interleaved
    int channels;
};

/// Where to draw. Row 0 is the bottom row (V = 0), as in Blender's images; pixel (x, y) has its centre at
/// ((x + 0.5) / width, (y + 0.5) / height).
struct RasterTarget {
    std::span<float> pixels;  ///< height * width * channels, interleaved
    int width;
    int height;
};

/// Draw the mesh into `target`.
///
/// A pixel whose centre lies in a triangle takes the value interpolated there (in the later triangle, if several
/// overlap). One that lies in none but within `padding_px` of the mesh takes the value at the nearest point of it:
/// texture filtering then finds skin on both sides of a seam, and triangles too thin to hold a centre are not
/// lost. All others take `fill`. Triangles outside the unit square are clipped, those without area skipped.
///
/// `threads` = 0 uses every core; the result does not depend on it. Throws std::invalid_argument.
void rasterize_uv(const UvMesh& mesh, int padding_px, std::span<const float> fill, const RasterTarget& target,
                  int threads = 0);

/// How many triangles have no area in UV space, or a coordinate that is not finite: those that are skipped.
std::size_t count_degenerate_uv(std::span<const glm::vec2> uv, std::span<const glm::uvec3> triangles);

/// How a UV layout fills the unit square, counted on the texels of a map.
struct UvCoverage {
    std::size_t covered = 0;      ///< texels whose centre lies in a triangle
    std::size_t overlapping = 0;  ///< those whose centre lies in more than one: two places of the skin share them
    std::size_t outside = 0;      ///< triangles with area and without a point in the unit square
};

/// An edge that two triangles share is no overlap. Throws std::invalid_argument.
UvCoverage uv_coverage(std::span<const glm::vec2> uv, std::span<const glm::uvec3> triangles, int width, int height);

}  // namespace sanguine
