#include "surface_walk.hpp"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

namespace sanguine {
namespace {

constexpr int max_crossings = 512;      // of one step, so that slivers cannot hold a walk for ever
constexpr double least_share = 1e-7;    // of a barycentric coordinate: keeps a walk off the vertices

glm::dvec3 across(glm::dvec3 v, glm::dvec3 unit) { return v - unit * glm::dot(v, unit); }

}  // namespace

SurfaceWalk::SurfaceWalk(const SkinSurface& surface, const SurfacePoint& start, glm::dvec3 direction)
    : surface_(&surface), barycentric_(start.barycentric) {
    barycentric_ = glm::max(barycentric_, least_share);
    barycentric_ /= barycentric_.x + barycentric_.y + barycentric_.z;
    enter(start.triangle);
    direction_ = flattened(direction);
    if (direction_ == glm::dvec3(0)) direction_ = flattened(corner_[1] - corner_[0]);
}

void SurfaceWalk::enter(std::uint32_t triangle) {
    triangle_ = triangle;
    const glm::uvec3 t = surface_->triangles()[triangle];
    for (int k = 0; k < 3; ++k) corner_[k] = surface_->position_mm()[t[k]];
    const glm::dvec3 n = glm::cross(corner_[1] - corner_[0], corner_[2] - corner_[0]);
    const double length = glm::length(n);
    normal_ = length > 0 ? n / length : glm::dvec3(0);  // a triangle without area cannot be walked on
}

/// Unit and in the plane of the triangle, or 0.
glm::dvec3 SurfaceWalk::flattened(glm::dvec3 direction) const {
    const glm::dvec3 flat = across(direction, normal_);
    const double length = glm::length(flat);
    return length > 1e-9 * glm::length(direction) && length > 0 ? flat / length : glm::dvec3(0);
}

bool SurfaceWalk::advance(double length_mm) {
    for (int crossing = 0; crossing < max_crossings; ++crossing) {
        if (normal_ == glm::dvec3(0) || direction_ == glm::dvec3(0)) return false;
        const double twice_area = glm::dot(glm::cross(corner_[1] - corner_[0], corner_[2] - corner_[0]), normal_);
        glm::dvec3 rate;  // of the barycentric coordinates, per mm
        double reach = length_mm;
        int exit = -1;
        for (int k = 0; k < 3; ++k) {
            const glm::dvec3 opposite = corner_[(k + 2) % 3] - corner_[(k + 1) % 3];
            rate[k] = glm::dot(glm::cross(normal_, opposite), direction_) / twice_area;
            if (rate[k] < 0 && -barycentric_[k] / rate[k] < reach) {
                reach = std::max(0.0, -barycentric_[k] / rate[k]);
                exit = k;
            }
        }
        barycentric_ = glm::clamp(barycentric_ + rate * reach, 0.0, 1.0);
        barycentric_ /= barycentric_.x + barycentric_.y + barycentric_.z;
        if (exit < 0) return true;
        length_mm -= reach;

        const std::uint32_t next = surface_->neighbours()[triangle_][std::size_t((exit + 1) % 3)];
        if (next == SkinSurface::none) return false;
        const glm::uvec3 here = surface_->triangles()[triangle_];
        const glm::uvec3 there = surface_->triangles()[next];
        const int first = (exit + 1) % 3, second = (exit + 2) % 3;
        glm::dvec3 entered(0);
        int opposite = -1;
        for (int k = 0; k < 3; ++k) {
            if (there[k] == here[first]) entered[k] = std::max(barycentric_[first], least_share);
            else if (there[k] == here[second]) entered[k] = std::max(barycentric_[second], least_share);
            else opposite = k;
        }
        if (opposite < 0) return false;  // the same triangle twice

        // The direction keeps its share along the edge and its share across it.
        const glm::dvec3 edge = glm::normalize(corner_[second] - corner_[first]);
        const glm::dvec3 outward = -across(corner_[exit] - corner_[first], edge);
        const double along = glm::dot(direction_, edge);
        const double over = std::max(glm::dot(direction_, outward) / glm::length(outward), 1e-6);
        const glm::dvec3 from = corner_[first];
        enter(next);
        const glm::dvec3 inward = across(corner_[opposite] - from, edge);
        direction_ = flattened(edge * along + inward / glm::length(inward) * over);
        barycentric_ = entered / (entered.x + entered.y + entered.z);
    }
    return false;
}

void SurfaceWalk::turn(double angle_rad) {
    direction_ = flattened(direction_ * std::cos(angle_rad) + glm::cross(normal_, direction_) * std::sin(angle_rad));
}

double SurfaceWalk::angle_to(glm::dvec3 direction) const {
    const glm::dvec3 flat = flattened(direction);
    return std::atan2(glm::dot(glm::cross(direction_, flat), normal_), glm::dot(direction_, flat));
}

void SurfaceWalk::turn_toward(glm::dvec3 direction, double max_angle_rad) {
    turn(std::clamp(angle_to(direction), -max_angle_rad, max_angle_rad));
}

SurfacePoint SurfaceWalk::point() const { return {triangle_, glm::vec3(barycentric_)}; }

glm::dvec3 SurfaceWalk::place_mm() const {
    return corner_[0] * barycentric_.x + corner_[1] * barycentric_.y + corner_[2] * barycentric_.z;
}

}  // namespace sanguine
