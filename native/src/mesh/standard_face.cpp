#include "standard_face.hpp"

#include <limits>

#include <glm/geometric.hpp>

namespace sanguine {
namespace {

// Mean distance of the pupils of adults: 62 to 64 mm (Dodgson 2004, Proc. SPIE 5291:36).
constexpr float standard_eyes_mm = 62;

/// Barycentric coordinates of the point of a triangle nearest to `p` (Ericson, Real-Time Collision Detection, 5.1.5).
glm::dvec3 nearest_barycentric(const glm::dvec3 (&t)[3], glm::dvec3 p) {
    const glm::dvec3 ab = t[1] - t[0], ac = t[2] - t[0];
    const glm::dvec3 ap = p - t[0], bp = p - t[1], cp = p - t[2];
    const double d1 = glm::dot(ab, ap), d2 = glm::dot(ac, ap);
    if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
    const double d3 = glm::dot(ab, bp), d4 = glm::dot(ac, bp);
    if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) return {1 - d1 / (d1 - d3), d1 / (d1 - d3), 0};
    const double d5 = glm::dot(ab, cp), d6 = glm::dot(ac, cp);
    if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return {1 - d2 / (d2 - d6), 0, d2 / (d2 - d6)};
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 >= d3 && d5 >= d6) {
        const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return {0, 1 - w, w};
    }
    return {va / (va + vb + vc), vb / (va + vb + vc), vc / (va + vb + vc)};
}

/// Middle of the skin of a region, on one side (-1: x below `middle_x`, 1: above) or both (0).
std::optional<glm::vec3> region_centre(const SkinSurface& surface, std::string_view id, int side = 0,
                                       float middle_x = 0) {
    const auto weight = surface.region(id);
    glm::dvec3 sum(0);
    double total = 0;
    for (std::size_t i = 0; i < surface.triangles().size(); ++i)
        for (int k = 0; k < 3; ++k) {
            const std::uint32_t v = surface.triangles()[i][k];
            const glm::vec3 place = surface.position_mm()[v];
            if (side != 0 && (place.x - middle_x) * float(side) <= 0) continue;
            const double mass = surface.triangle_area_mm2()[i] * weight[v];
            sum += mass * glm::dvec3(place);
            total += mass;
        }
    if (!(total > 0)) return {};
    return glm::vec3(sum / total);
}

}  // namespace

SurfacePoint nearest_point(const SkinSurface& surface, glm::vec3 place_mm) {
    SurfacePoint found{0, {1, 0, 0}};
    double least = std::numeric_limits<double>::infinity();
    const glm::dvec3 p(place_mm);
    for (std::uint32_t i = 0; i < surface.triangles().size(); ++i) {
        if (surface.triangle_area_mm2()[i] == 0) continue;
        const glm::uvec3 t = surface.triangles()[i];
        const glm::dvec3 corner[3] = {surface.position_mm()[t.x], surface.position_mm()[t.y],
                                      surface.position_mm()[t.z]};
        const glm::dvec3 b = nearest_barycentric(corner, p);
        const glm::dvec3 away = b.x * corner[0] + b.y * corner[1] + b.z * corner[2] - p;
        if (const double distance2 = glm::dot(away, away); distance2 < least) {
            least = distance2;
            found = {i, glm::vec3(b)};
        }
    }
    return found;
}

std::optional<StandardFace> StandardFace::of(const SkinSurface& surface) {
    const auto both = region_centre(surface, "eyelids");
    if (!both) return {};
    const auto left = region_centre(surface, "eyelids", 1, both->x);
    const auto right = region_centre(surface, "eyelids", -1, both->x);
    if (!left || !right) return {};
    const float apart = left->x - right->x;
    if (!(apart > 0)) return {};
    StandardFace frame;
    frame.scale_ = apart / standard_eyes_mm;
    frame.origin_ = (*left + *right) / 2.0F;
    return frame;
}

}  // namespace sanguine
