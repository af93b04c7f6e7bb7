#include "standard_face.hpp"

#include <array>
#include <limits>

#include <glm/geometric.hpp>

#include "triangle.hpp"

namespace sanguine {
namespace {

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

std::vector<float> by_region(const SkinSurface& surface,
                             std::initializer_list<std::pair<std::string_view, float>> values, float elsewhere) {
    std::vector<float> blend(surface.position_mm().size(), elsewhere);
    for (const auto& [id, value] : values) {
        const std::span<const float> weight = surface.region(id);
        for (std::size_t v = 0; v < blend.size(); ++v) blend[v] += weight[v] * (value - elsewhere);
    }
    return blend;
}

std::optional<glm::vec3> middle_mm(const SkinSurface& surface, std::string_view region) {
    return region_centre(surface, region);
}

SurfacePoint nearest_point(const SkinSurface& surface, glm::vec3 place_mm) {
    SurfacePoint found{0, {1, 0, 0}};
    double least = std::numeric_limits<double>::infinity();
    const glm::dvec3 p(place_mm);
    for (std::uint32_t i = 0; i < surface.triangles().size(); ++i) {
        if (surface.triangle_area_mm2()[i] == 0) continue;
        const glm::uvec3 t = surface.triangles()[i];
        const std::array<glm::dvec3, 3> corner{surface.position_mm()[t.x], surface.position_mm()[t.y],
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
    frame.scale_ = apart / eyes_mm;
    frame.origin_ = (*left + *right) / 2.0F;
    return frame;
}

}  // namespace sanguine
