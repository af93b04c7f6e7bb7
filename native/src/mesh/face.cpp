#include "face.hpp"

#include <algorithm>

namespace sanguine {
namespace {

/// The share of the skin that belongs to each vertex.
std::vector<double> vertex_area_mm2(const SkinSurface& surface) {
    std::vector<double> area(surface.position_mm().size(), 0);
    for (std::size_t i = 0; i < surface.triangles().size(); ++i)
        for (int k = 0; k < 3; ++k) area[surface.triangles()[i][k]] += surface.triangle_area_mm2()[i] / 3;
    return area;
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

std::optional<glm::vec3> middle_mm(const SkinSurface& surface, std::string_view region, Side side) {
    const std::span<const float> weight = surface.region(region);
    const std::vector<double> area = vertex_area_mm2(surface);
    const auto middle = [&](auto&& counts) -> std::optional<glm::dvec3> {
        glm::dvec3 sum(0);
        double total = 0;
        for (std::size_t v = 0; v < area.size(); ++v) {
            if (!counts(surface.position_mm()[v])) continue;
            sum += weight[v] * area[v] * glm::dvec3(surface.position_mm()[v]);
            total += weight[v] * area[v];
        }
        if (total == 0) return {};
        return sum / total;
    };
    const auto whole = middle([](glm::vec3) { return true; });
    if (!whole || side == Side::both) return whole;
    return middle([&](glm::vec3 p) { return (p.x > whole->x) == (side == Side::left); });
}

std::optional<FaceFrame> face_frame(const SkinSurface& surface) {
    const auto left = middle_mm(surface, "eyelids", Side::left), right = middle_mm(surface, "eyelids", Side::right);
    const auto nose = middle_mm(surface, "nose"), lips = middle_mm(surface, "lips"), chin = middle_mm(surface, "chin");
    if (!left || !right || !nose || !lips || !chin) return {};
    return FaceFrame{*left, *right, *nose, *lips, *chin, (left->x + right->x) / 2, left->x - right->x};
}

}  // namespace sanguine
