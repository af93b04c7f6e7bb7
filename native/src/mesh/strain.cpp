#include "sanguine/strain.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>

#include <glm/geometric.hpp>

#include "triangles.hpp"

namespace sanguine {
namespace {

/// A symmetric tensor in a plane, in the plane's own frame.
struct PlaneTensor {
    double xx, yy, xy;
};

/// Half the logarithm of a symmetric positive tensor, its eigenvalues held within the allowed stretches.
PlaneTensor half_log(const PlaneTensor& c) {
    const double middle = 0.5 * (c.xx + c.yy);
    const double half = 0.5 * (c.xx - c.yy);
    const double radius = std::sqrt(half * half + c.xy * c.xy);  // not std::hypot: that asks for glibc 2.35
    const auto f = [](double square) {
        return 0.5 * std::log(std::clamp(square, min_stretch * min_stretch, max_stretch * max_stretch));
    };
    const double high = f(middle + radius), low = f(middle - radius);
    // f(C) = mean + slope (C - middle): the formula in eigenvalues, without the directions, which equal ones lack.
    const double mean = 0.5 * (high + low);
    const double slope = radius > 1e-12 * (1 + middle) ? 0.5 * (high - low) / radius : 0;
    return {mean + slope * (c.xx - middle), mean + slope * (c.yy - middle), slope * c.xy};
}

/// `v` turned as the least rotation turns the unit vector `from` to `to`; these are not opposite.
glm::dvec3 turned(glm::dvec3 v, glm::dvec3 from, glm::dvec3 to) {
    const glm::dvec3 axis = glm::cross(from, to);
    const glm::dvec3 once = glm::cross(axis, v);
    return v + once + glm::cross(axis, once) / (1 + glm::dot(from, to));
}

}  // namespace

RestShape::RestShape(std::span<const glm::vec3> position, std::span<const glm::uvec3> triangles) {
    check_points(position, "position");
    check_triangles(triangles, position.size());
    std::vector<glm::dvec3> normal(position.size(), glm::dvec3(0));
    std::vector<double> area(position.size(), 0.0);
    for (const glm::uvec3 t : triangles) {
        const FlatTriangle flat(position, t);
        if (!flat.sound) continue;
        const glm::dvec3 along = glm::normalize(flat.side);
        plates_.push_back({t, {along, glm::cross(flat.normal, along)}, {}, flat.area});
        std::ranges::copy(flat.gradient, plates_.back().gradient);
        for (int k = 0; k < 3; ++k) {
            normal[t[k]] += flat.area * flat.normal;
            area[t[k]] += flat.area / 3;
        }
    }
    for (std::size_t v = 0; v < position.size(); ++v) {
        const double length = glm::length(normal[v]);
        normal_.push_back(length > 1e-6 * area[v] ? glm::vec3(normal[v] / length) : glm::vec3(0));
        area_.push_back(float(area[v]));
    }
}

std::vector<SurfaceTensor> RestShape::strain(std::span<const glm::vec3> displacement, StrainMeasure measure) const {
    if (displacement.size() != normal_.size())
        throw std::invalid_argument("displacement: " + std::to_string(displacement.size()) + " for " +
                                    std::to_string(normal_.size()) + " vertices");
    check_points(displacement, "displacement");
    std::vector<std::array<double, 6>> sum(normal_.size(), std::array<double, 6>{});
    std::vector<double> weight(normal_.size(), 0.0);
    for (const Plate& plate : plates_) {
        // Rows of the deformation gradient F = (axes + change): where the frame's two axes go.
        glm::dvec3 change[2] = {};
        for (int k = 0; k < 3; ++k)
            for (int a = 0; a < 2; ++a)
                change[a] += glm::dvec3(displacement[plate.vertex[k]]) * glm::dot(plate.gradient[k], plate.axis[a]);
        PlaneTensor e;
        if (measure == StrainMeasure::linear) {
            e = {glm::dot(plate.axis[0], change[0]), glm::dot(plate.axis[1], change[1]),
                 0.5 * (glm::dot(plate.axis[0], change[1]) + glm::dot(plate.axis[1], change[0]))};
        } else {
            const glm::dvec3 x = plate.axis[0] + change[0], y = plate.axis[1] + change[1];
            e = half_log({glm::dot(x, x), glm::dot(y, y), glm::dot(x, y)});
        }
        const glm::dvec3 facing = glm::cross(plate.axis[0], plate.axis[1]);
        for (int k = 0; k < 3; ++k) {
            const std::uint32_t v = plate.vertex[k];
            const glm::dvec3 normal(normal_[v]);
            if (glm::dot(facing, normal) < -0.999 || normal == glm::dvec3(0)) continue;  // folded back on itself
            const glm::dvec3 p = turned(plate.axis[0], facing, normal), q = turned(plate.axis[1], facing, normal);
            const auto entry = [&](int i, int j) {
                return e.xx * p[i] * p[j] + e.yy * q[i] * q[j] + e.xy * (p[i] * q[j] + q[i] * p[j]);
            };
            const double values[] = {entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)};
            for (int i = 0; i < 6; ++i) sum[v][std::size_t(i)] += plate.area * values[i];
            weight[v] += plate.area;
        }
    }
    std::vector<SurfaceTensor> mean(sum.size(), SurfaceTensor{});
    for (std::size_t v = 0; v < sum.size(); ++v)
        if (weight[v] > 0)
            for (std::size_t i = 0; i < 6; ++i) mean[v][i] = float(sum[v][i] / weight[v]);
    return mean;
}

}  // namespace sanguine
