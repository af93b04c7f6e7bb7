#include "sanguine/skin_surface.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <stdexcept>
#include <unordered_map>

#include <glm/geometric.hpp>

namespace sanguine {
namespace {

constexpr float weld_mm = 1e-3F;        // an instrument's error, a thousandth of the finest feature
constexpr double max_area_mm2 = 1e7;    // 10 m^2; a whole body has 2
constexpr float max_coordinate_mm = 1e6F;

void require(bool condition, const std::string& message) {
    if (!condition) throw std::invalid_argument("skin surface: " + message);
}

void validate(const SkinMesh& mesh) {
    require(!mesh.triangles.empty(), "the mesh has no triangles");
    require(mesh.corner_vertex.size() == mesh.uv.size(), "corner_vertex and uv differ in length");
    require(mesh.region_weights.size() == mesh.position_mm.size() * mesh.region_names.size(),
            "region_weights are not vertices * regions");
    for (std::size_t i = 0; i < mesh.position_mm.size(); ++i)
        for (int k = 0; k < 3; ++k)  // written so that NaN fails
            require(std::abs(mesh.position_mm[i][k]) <= max_coordinate_mm,
                    "position_mm of vertex " + std::to_string(i) + " is not a finite number below 1e6");
    for (std::size_t i = 0; i < mesh.uv.size(); ++i)
        require(std::isfinite(mesh.uv[i].x) && std::isfinite(mesh.uv[i].y),
                "uv of corner " + std::to_string(i) + " is not finite");
    for (std::size_t i = 0; i < mesh.corner_vertex.size(); ++i)
        require(mesh.corner_vertex[i] < mesh.position_mm.size(),
                "corner " + std::to_string(i) + " names a vertex that does not exist");
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const glm::uvec3 t = mesh.triangles[i];
        require(std::max({t.x, t.y, t.z}) < mesh.uv.size(),
                "triangle " + std::to_string(i) + " names a corner that does not exist");
    }
    for (std::size_t i = 0; i < mesh.region_weights.size(); ++i)
        require(mesh.region_weights[i] >= 0 && mesh.region_weights[i] <= 1,
                "weight of region '" + mesh.region_names[i % mesh.region_names.size()] + "' at vertex " +
                    std::to_string(i / mesh.region_names.size()) + " is not within 0 to 1");
    for (std::size_t i = 0; i < mesh.region_names.size(); ++i)
        require(std::ranges::count(mesh.region_names, mesh.region_names[i]) == 1,
                "region '" + mesh.region_names[i] + "' is there twice");
}

struct Cell {
    std::int64_t x, y, z;
    bool operator==(const Cell&) const = default;
};
struct CellHash {
    std::size_t operator()(const Cell& c) const {
        return std::size_t(c.x * 73856093) ^ std::size_t(c.y * 19349663) ^ std::size_t(c.z * 83492791);
    }
};

/// For each vertex the first one at its place, in the order of the vertices.
std::vector<std::uint32_t> weld(std::span<const glm::vec3> positions) {
    std::unordered_map<Cell, std::vector<std::uint32_t>, CellHash> first_in;
    first_in.reserve(positions.size());
    std::vector<std::uint32_t> to(positions.size());
    for (std::uint32_t i = 0; i < positions.size(); ++i) {
        // Cells of twice the tolerance: what is within it lies in one of the eight nearest cells.
        const glm::dvec3 scaled = glm::dvec3(positions[i]) / double(2 * weld_mm);
        const Cell low{std::int64_t(std::floor(scaled.x - 0.5)), std::int64_t(std::floor(scaled.y - 0.5)),
                       std::int64_t(std::floor(scaled.z - 0.5))};
        to[i] = i;
        for (int k = 0; k < 8; ++k) {
            const auto found = first_in.find({low.x + (k & 1), low.y + (k >> 1 & 1), low.z + (k >> 2)});
            if (found == first_in.end()) continue;
            for (const std::uint32_t other : found->second)
                if (glm::distance(positions[i], positions[other]) <= weld_mm) to[i] = std::min(to[i], other);
        }
        if (to[i] == i)
            first_in[{std::int64_t(std::floor(scaled.x)), std::int64_t(std::floor(scaled.y)),
                      std::int64_t(std::floor(scaled.z))}].push_back(i);
    }
    return to;
}

double angle_between(glm::dvec3 a, glm::dvec3 b) {
    return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

}  // namespace

SkinSurface::SkinSurface(const SkinMesh& mesh) : uv_(mesh.uv.begin(), mesh.uv.end()) {
    validate(mesh);

    const std::vector<std::uint32_t> first = weld(mesh.position_mm);
    std::vector<std::uint32_t> welded(first.size());
    const std::size_t regions = mesh.region_names.size();
    region_names_.assign(mesh.region_names.begin(), mesh.region_names.end());
    region_weights_.resize(regions);
    for (std::size_t i = 0; i < first.size(); ++i) {
        if (first[i] == i) {
            welded[i] = std::uint32_t(position_mm_.size());
            position_mm_.push_back(mesh.position_mm[i]);
            for (std::size_t r = 0; r < regions; ++r) region_weights_[r].push_back(0);
        } else {
            welded[i] = welded[first[i]];
        }
        for (std::size_t r = 0; r < regions; ++r)
            region_weights_[r][welded[i]] =
                std::max(region_weights_[r][welded[i]], mesh.region_weights[i * regions + r]);
    }
    no_region_.assign(position_mm_.size(), 0);

    corners_.assign(mesh.triangles.begin(), mesh.triangles.end());
    triangles_.reserve(corners_.size());
    area_.reserve(corners_.size());
    std::vector<glm::dvec3> normals(position_mm_.size(), glm::dvec3(0));
    for (const glm::uvec3 c : corners_) {
        const glm::uvec3 t(welded[mesh.corner_vertex[c.x]], welded[mesh.corner_vertex[c.y]],
                           welded[mesh.corner_vertex[c.z]]);
        triangles_.push_back(t);
        const glm::dvec3 p[3] = {position_mm_[t.x], position_mm_[t.y], position_mm_[t.z]};
        const glm::dvec3 across = glm::cross(p[1] - p[0], p[2] - p[0]);
        const double twice = glm::length(across);
        const bool has_area = t.x != t.y && t.y != t.z && t.z != t.x && twice > 1e-9;
        area_.push_back(has_area ? twice / 2 : 0);
        if (!has_area) continue;
        for (int k = 0; k < 3; ++k)
            normals[t[k]] += across / twice * angle_between(p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
    }
    require(area_mm2() > 0, "no triangle has an area");
    require(area_mm2() <= max_area_mm2, "an area of more than 10 m^2: position_mm has to be in millimetres");
    normal_.reserve(normals.size());
    for (const glm::dvec3 n : normals) {
        const double length = glm::length(n);
        normal_.push_back(length > 1e-12 ? glm::vec3(n / length) : glm::vec3(0, 0, 1));
    }

    neighbours_.assign(triangles_.size(), {none, none, none});
    struct Side {
        std::uint32_t triangle, side, count;
    };
    std::map<std::pair<std::uint32_t, std::uint32_t>, Side> sides;
    for (std::uint32_t i = 0; i < triangles_.size(); ++i) {
        if (area_[i] == 0) continue;
        for (std::uint32_t k = 0; k < 3; ++k) {
            const std::uint32_t a = triangles_[i][int(k)], b = triangles_[i][int((k + 1) % 3)];
            const auto [found, is_new] = sides.try_emplace(std::minmax(a, b), Side{i, k, 1});
            if (is_new) continue;
            Side& other = found->second;
            // An edge of three triangles has no "other side": it counts as a rim.
            if (++other.count == 2) {
                neighbours_[i][k] = other.triangle;
                neighbours_[other.triangle][other.side] = i;
            } else if (const std::uint32_t second = neighbours_[other.triangle][other.side]; second != none) {
                neighbours_[other.triangle][other.side] = none;
                std::ranges::replace(neighbours_[second], other.triangle, none);
            }
        }
    }
}

double SkinSurface::area_mm2() const { return std::accumulate(area_.begin(), area_.end(), 0.0); }

std::span<const float> SkinSurface::region(std::string_view id) const {
    const auto found = std::ranges::find(region_names_, id);
    return found == region_names_.end() ? no_region_ : region_weights_[std::size_t(found - region_names_.begin())];
}

glm::vec3 SkinSurface::place_mm(const SurfacePoint& point) const {
    const glm::uvec3 t = triangles_[point.triangle];
    const glm::vec3 b = point.barycentric;
    return b.x * position_mm_[t.x] + b.y * position_mm_[t.y] + b.z * position_mm_[t.z];
}

glm::vec3 SkinSurface::normal_at(const SurfacePoint& point) const {
    const glm::uvec3 t = triangles_[point.triangle];
    const glm::vec3 b = point.barycentric;
    const glm::vec3 n = b.x * normal_[t.x] + b.y * normal_[t.y] + b.z * normal_[t.z];
    const float length = glm::length(n);
    return length > 1e-6F ? n / length : normal_[t.x];  // three normals that cancel out: any of them
}

float SkinSurface::value_at(const SurfacePoint& point, std::span<const float> per_vertex) const {
    const glm::uvec3 t = triangles_[point.triangle];
    const glm::vec3 b = point.barycentric;
    return b.x * per_vertex[t.x] + b.y * per_vertex[t.y] + b.z * per_vertex[t.z];
}

}  // namespace sanguine
