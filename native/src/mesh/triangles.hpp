// What work on triangles of vertices shares: checks, and the geometry of one flat triangle.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace sanguine {

inline void check_points(std::span<const glm::vec3> points, const char* name) {
    for (std::size_t i = 0; i < points.size(); ++i)
        if (!(std::isfinite(points[i].x) && std::isfinite(points[i].y) && std::isfinite(points[i].z)))
            throw std::invalid_argument(std::string(name) + ": vertex " + std::to_string(i) + " is not finite");
}

inline void check_triangles(std::span<const glm::uvec3> triangles, std::size_t vertices) {
    for (std::size_t i = 0; i < triangles.size(); ++i)
        for (int k = 0; k < 3; ++k)
            if (triangles[i][k] >= vertices)
                throw std::invalid_argument("triangles: triangle " + std::to_string(i) + " names a vertex beyond the " +
                                            std::to_string(vertices) + " there are");
}

/// One triangle in space; only `sound` is set when it has no area or is thinner than a millionth of its length.
struct FlatTriangle {
    bool sound = false;
    glm::dvec3 side{}, normal{};  ///< from the first corner to the second; unit
    glm::dvec3 gradient[3]{};     ///< of the linear function that is 1 at a corner and 0 at the others
    double area = 0;

    FlatTriangle(std::span<const glm::vec3> position, glm::uvec3 t) {
        const glm::dvec3 p[3] = {glm::dvec3(position[t.x]), glm::dvec3(position[t.y]), glm::dvec3(position[t.z])};
        const glm::dvec3 cross = glm::cross(p[1] - p[0], p[2] - p[0]);
        const double twice = glm::length(cross);
        const glm::dvec3 sides[3] = {p[2] - p[1], p[0] - p[2], p[1] - p[0]};
        double longest2 = 0;
        for (const glm::dvec3& s : sides) longest2 = std::max(longest2, glm::dot(s, s));
        if (!(twice > 1e-6 * longest2)) return;
        sound = true;
        side = sides[2];
        normal = cross / twice;
        area = 0.5 * twice;
        for (int k = 0; k < 3; ++k) gradient[k] = glm::cross(normal, sides[k]) / twice;
    }
};

}  // namespace sanguine
