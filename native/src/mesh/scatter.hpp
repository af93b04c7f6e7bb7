// Points thrown on the surface at a given density.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "sanguine/skin_surface.hpp"

namespace sanguine {

/// Where something is to grow.
struct Seedling {
    SurfacePoint point;
    glm::vec3 place_mm;
    glm::vec3 normal;
    std::uint64_t random;  ///< a seed for what grows there
};

/// Points at `density_per_mm2` (per welded vertex, linear between; 0 or more). `spacing` keeps them apart: no two are
/// nearer than `spacing` / sqrt(density), 0 being complete chance (Poisson) and 0.6 the most that dart throwing fills
/// with the density kept.
///
/// The numbers belong to the place of each triangle: a change of the mesh elsewhere leaves the points here as they are.
std::vector<Seedling> scatter(const SkinSurface& surface, std::span<const float> density_per_mm2, float spacing,
                              std::uint64_t seed);

}  // namespace sanguine
