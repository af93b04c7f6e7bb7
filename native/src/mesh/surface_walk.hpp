// Walking straight ahead on a surface.
#pragma once

#include <glm/vec3.hpp>

#include "sanguine/skin_surface.hpp"

namespace sanguine {

/// A point that walks over the triangles along a straightest geodesic (Polthier and Schmies 1998): at an edge the next
/// triangle is unfolded into the plane of this one. A walk that meets a vertex passes it on one side, closer than can
/// be seen.
class SurfaceWalk {
public:
    /// `direction` need not lie in the surface; where it stands upright on it, the walk takes a side of the triangle.
    SurfaceWalk(const SkinSurface& surface, const SurfacePoint& start, glm::dvec3 direction);

    /// False where the surface ends before `length_mm`: at a rim, at an edge of three triangles, or among more
    /// triangles than one step may cross. The walk then stands there.
    bool advance(double length_mm);

    void turn(double angle_rad);  ///< counter-clockwise, seen from the side of the triangle's normal
    /// By at most `max_angle_rad` toward a direction, which need not lie in the surface.
    void turn_toward(glm::dvec3 direction, double max_angle_rad);
    /// Counter-clockwise angle from the walk's direction to another, seen in the surface; 0 for one upright on it.
    double angle_to(glm::dvec3 direction) const;

    SurfacePoint point() const;
    glm::dvec3 place_mm() const;
    glm::dvec3 direction() const { return direction_; }  ///< unit, in the plane of the triangle

private:
    void enter(std::uint32_t triangle);
    glm::dvec3 flattened(glm::dvec3 direction) const;

    const SkinSurface* surface_;
    std::uint32_t triangle_ = 0;
    glm::dvec3 corner_[3], normal_{}, direction_{}, barycentric_;
};

}  // namespace sanguine
