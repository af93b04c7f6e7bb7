// What drawing a map and asking for its texels share: which place of the mesh a pixel of the UV layout shows.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "triangle.hpp"

namespace sanguine {

using UvTriangle = std::array<glm::dvec2, 3>;

inline double cross(glm::dvec2 a, glm::dvec2 b) { return a.x * b.y - a.y * b.x; }

inline double twice_area(const UvTriangle& t) { return cross(t[1] - t[0], t[2] - t[0]); }

inline UvTriangle corners_of(std::span<const glm::vec2> uv, glm::uvec3 corner) {
    return {glm::dvec2(uv[corner.x]), glm::dvec2(uv[corner.y]), glm::dvec2(uv[corner.z])};
}

/// Written so that a coordinate that is not finite answers true as well.
inline bool is_degenerate(const UvTriangle& triangle) { return !(std::abs(twice_area(triangle)) > 1e-14); }

/// Rows [first_row, end_row) of an image over the unit square of UV; row 0 is V = 0. Every band sees all triangles in
/// the same order and owns its rows, so the result does not depend on how an image is cut into bands.
class UvBand {
public:
    UvBand(std::span<const glm::vec2> uv, std::span<const glm::uvec3> triangles, int width, int height, int first_row,
           int end_row)
        : uv_(uv), triangles_(triangles), width_(width), height_(height), first_row_(first_row), end_row_(end_row) {}

    /// Calls write(x, y, triangle, barycentric) for each pixel whose centre lies in a triangle or within `padding_px`
    /// of one (there: with the nearest point). Called several times for a pixel, the last call holds.
    template <typename Write>
    void draw(int padding_px, const Write& write) {
        distance2_.assign(std::size_t(end_row_ - first_row_) * std::size_t(width_),
                          std::numeric_limits<float>::infinity());
        for_each_triangle([&](const UvTriangle& t, std::uint32_t index) { draw_inside(t, index, write); });
        if (padding_px > 0)
            for_each_triangle(
                [&](const UvTriangle& t, std::uint32_t index) { draw_padding(t, index, padding_px, write); });
    }

private:
    /// Pixels whose centre lies in [low, high], cut to [first, end).
    struct PixelRange {
        int first, end;
    };
    static PixelRange pixel_range(double low, double high, int first, int end) {
        // Clamped before the conversion: a UV may be far outside of what an int holds.
        const double a = std::clamp(std::ceil(low - 0.5), double(first), double(end));
        const double b = std::clamp(std::floor(high - 0.5) + 1, double(first), double(end));
        return {int(a), int(b)};
    }

    /// `visit` gets the triangle in pixel coordinates.
    template <typename Visit>
    void for_each_triangle(const Visit& visit) {
        const glm::dvec2 size(width_, height_);
        for (std::size_t i = 0; i < triangles_.size(); ++i) {
            UvTriangle t = corners_of(uv_, triangles_[i]);
            if (is_degenerate(t)) continue;
            for (glm::dvec2& point : t) point *= size;
            visit(t, std::uint32_t(i));
        }
    }

    /// `visit` gets the pixel and its squared distance record, for pixels at most `margin` from the box.
    template <typename Visit>
    void for_each_pixel(const UvTriangle& t, double margin, const Visit& visit) {
        const auto [left, right] = std::minmax({t[0].x, t[1].x, t[2].x});
        const auto [low, high] = std::minmax({t[0].y, t[1].y, t[2].y});
        const PixelRange rows = pixel_range(low - margin, high + margin, first_row_, end_row_);
        const PixelRange columns = pixel_range(left - margin, right + margin, 0, width_);
        for (int y = rows.first; y < rows.end; ++y)
            for (int x = columns.first; x < columns.end; ++x)
                visit(x, y, distance2_[std::size_t(y - first_row_) * std::size_t(width_) + std::size_t(x)]);
    }

    template <typename Write>
    void draw_inside(const UvTriangle& t, std::uint32_t index, const Write& write) {
        const double area = twice_area(t);
        for_each_pixel(t, 0, [&](int x, int y, float& distance2) {
            const glm::dvec2 p(x + 0.5, y + 0.5);
            const glm::dvec3 b(cross(t[2] - t[1], p - t[1]) / area, cross(t[0] - t[2], p - t[2]) / area,
                               cross(t[1] - t[0], p - t[0]) / area);
            if (b.x < 0 || b.y < 0 || b.z < 0) return;
            distance2 = 0;
            write(x, y, index, b);
        });
    }

    template <typename Write>
    void draw_padding(const UvTriangle& t, std::uint32_t index, int padding_px, const Write& write) {
        for_each_pixel(t, padding_px, [&](int x, int y, float& distance2) {
            if (distance2 == 0) return;  // covered: by far the most frequent case
            const glm::dvec2 p(x + 0.5, y + 0.5);
            const glm::dvec3 b = nearest_barycentric(t, p);
            const glm::dvec2 away = b.x * t[0] + b.y * t[1] + b.z * t[2] - p;
            const double found2 = glm::dot(away, away);
            // The smallest positive value keeps "on the edge" apart from "covered".
            const float record = std::max(float(found2), std::numeric_limits<float>::min());
            if (found2 > double(padding_px) * padding_px || record >= distance2) return;
            distance2 = record;
            write(x, y, index, b);
        });
    }

    std::span<const glm::vec2> uv_;
    std::span<const glm::uvec3> triangles_;
    int width_, height_, first_row_, end_row_;
    std::vector<float> distance2_;  // to the mesh, in pixels; 0 where the centre is covered
};

}  // namespace sanguine
