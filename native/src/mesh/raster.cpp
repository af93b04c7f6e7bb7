#include "sanguine/raster.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <glm/geometric.hpp>

namespace sanguine {
namespace {

using Triangle = std::array<glm::dvec2, 3>;

double cross(glm::dvec2 a, glm::dvec2 b) { return a.x * b.y - a.y * b.x; }

double twice_area(const Triangle& t) { return cross(t[1] - t[0], t[2] - t[0]); }

Triangle corners_of(std::span<const glm::vec2> uv, glm::uvec3 corner) {
    return {glm::dvec2(uv[corner.x]), glm::dvec2(uv[corner.y]), glm::dvec2(uv[corner.z])};
}

/// Written so that a coordinate that is not finite answers true as well.
bool is_degenerate(const Triangle& uv_triangle) { return !(std::abs(twice_area(uv_triangle)) > 1e-14); }

/// Barycentric coordinates of the point of the triangle nearest to `p` (Ericson, Real-Time Collision Detection,
/// 5.1.5): those of `p` itself where it lies inside.
glm::dvec3 nearest_barycentric(const Triangle& t, glm::dvec2 p) {
    const glm::dvec2 ab = t[1] - t[0], ac = t[2] - t[0];
    const glm::dvec2 ap = p - t[0], bp = p - t[1], cp = p - t[2];
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
    const double sum = va + vb + vc;
    return {va / sum, vb / sum, vc / sum};
}

/// Pixels whose centre lies in [low, high], cut to [first, end).
struct PixelRange {
    int first, end;
};
PixelRange pixel_range(double low, double high, int first, int end) {
    // Clamped before the conversion: a UV may be far outside of what an int holds.
    const double a = std::clamp(std::ceil(low - 0.5), double(first), double(end));
    const double b = std::clamp(std::floor(high - 0.5) + 1, double(first), double(end));
    return {int(a), int(b)};
}

/// Draws the rows [first_row, end_row): every thread sees all triangles in the same order and owns its rows, so
/// the result is the same for any number of threads.
class BandRasterizer {
public:
    BandRasterizer(const UvMesh& mesh, const RasterTarget& target, int first_row, int end_row)
        : mesh_(mesh),
          target_(target),
          first_row_(first_row),
          end_row_(end_row),
          distance2_(std::size_t(end_row - first_row) * std::size_t(target.width),
                     std::numeric_limits<float>::infinity()) {}

    void draw(int padding_px, std::span<const float> fill) {
        clear(fill);
        for_each_triangle([this](const Triangle& t, glm::uvec3 corner) { draw_inside(t, corner); });
        if (padding_px > 0)
            for_each_triangle([&](const Triangle& t, glm::uvec3 corner) { draw_padding(t, corner, padding_px); });
    }

private:
    void clear(std::span<const float> fill) {
        const auto row = std::size_t(target_.width) * fill.size();
        for (auto i = row * std::size_t(first_row_); i < row * std::size_t(end_row_); i += fill.size())
            std::ranges::copy(fill, target_.pixels.begin() + std::ptrdiff_t(i));
    }

    /// `visit` gets the triangle in pixel coordinates.
    template <typename Visit>
    void for_each_triangle(Visit visit) {
        const glm::dvec2 size(target_.width, target_.height);
        for (const glm::uvec3 corner : mesh_.triangles) {
            Triangle t = corners_of(mesh_.uv, corner);
            if (is_degenerate(t)) continue;
            for (glm::dvec2& point : t) point *= size;
            visit(t, corner);
        }
    }

    /// `visit` gets the pixel's centre and its squared distance record, for pixels at most `margin` from the box.
    template <typename Visit>
    void for_each_pixel(const Triangle& t, double margin, Visit visit) {
        const auto [left, right] = std::minmax({t[0].x, t[1].x, t[2].x});
        const auto [low, high] = std::minmax({t[0].y, t[1].y, t[2].y});
        const PixelRange rows = pixel_range(low - margin, high + margin, first_row_, end_row_);
        const PixelRange columns = pixel_range(left - margin, right + margin, 0, target_.width);
        for (int y = rows.first; y < rows.end; ++y)
            for (int x = columns.first; x < columns.end; ++x)
                visit(x, y, distance2_[std::size_t(y - first_row_) * std::size_t(target_.width) + std::size_t(x)]);
    }

    void draw_inside(const Triangle& t, glm::uvec3 corner) {
        const double area = twice_area(t);
        for_each_pixel(t, 0, [&](int x, int y, float& distance2) {
            const glm::dvec2 p(x + 0.5, y + 0.5);
            const glm::dvec3 b(cross(t[2] - t[1], p - t[1]) / area, cross(t[0] - t[2], p - t[2]) / area,
                               cross(t[1] - t[0], p - t[0]) / area);
            if (b.x < 0 || b.y < 0 || b.z < 0) return;
            distance2 = 0;
            write(x, y, corner, b);
        });
    }

    void draw_padding(const Triangle& t, glm::uvec3 corner, int padding_px) {
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
            write(x, y, corner, b);
        });
    }

    void write(int x, int y, glm::uvec3 corner, glm::dvec3 b) {
        const auto channels = std::size_t(mesh_.channels);
        const float* a0 = &mesh_.values[corner.x * channels];
        const float* a1 = &mesh_.values[corner.y * channels];
        const float* a2 = &mesh_.values[corner.z * channels];
        float* out = &target_.pixels[(std::size_t(y) * std::size_t(target_.width) + std::size_t(x)) * channels];
        for (std::size_t c = 0; c < channels; ++c) out[c] = float(b.x * a0[c] + b.y * a1[c] + b.z * a2[c]);
    }

    const UvMesh& mesh_;
    const RasterTarget& target_;
    int first_row_, end_row_;
    std::vector<float> distance2_;  // to the mesh, in pixels; 0 where the centre is covered
};

void require(bool condition, const char* message) {
    if (!condition) throw std::invalid_argument(std::string("rasterize_uv: ") + message);
}

void validate(const UvMesh& mesh, int padding_px, std::span<const float> fill, const RasterTarget& target) {
    require(target.width > 0 && target.height > 0, "the image has no pixels");
    require(mesh.channels > 0, "values have no channel");
    const auto channels = std::size_t(mesh.channels);
    require(target.pixels.size() == std::size_t(target.width) * std::size_t(target.height) * channels,
            "pixels are not height * width * channels");
    require(mesh.values.size() == mesh.uv.size() * channels, "uv and values differ in length");
    require(fill.size() == channels, "fill and values differ in their number of channels");
    require(padding_px >= 0, "padding_px is negative");
    for (const glm::uvec3 t : mesh.triangles)
        require(std::max({t.x, t.y, t.z}) < mesh.uv.size(), "a triangle names a corner that does not exist");
}

}  // namespace

void rasterize_uv(const UvMesh& mesh, int padding_px, std::span<const float> fill, const RasterTarget& target,
                  int threads) {
    validate(mesh, padding_px, fill, target);
    constexpr int min_rows = 64;  // fewer do not pay for a thread
    const int cores = threads > 0 ? threads : int(std::max(1U, std::thread::hardware_concurrency()));
    const int bands = std::clamp(target.height / min_rows, 1, cores);
    std::vector<std::jthread> workers;
    for (int band = bands - 1; band >= 0; --band) {
        const int first = int(std::int64_t(target.height) * band / bands);
        const int end = int(std::int64_t(target.height) * (band + 1) / bands);
        BandRasterizer rasterizer(mesh, target, first, end);
        if (band > 0)
            workers.emplace_back([rasterizer = std::move(rasterizer), padding_px, fill]() mutable {
                rasterizer.draw(padding_px, fill);
            });
        else
            rasterizer.draw(padding_px, fill);  // this thread does the remaining one instead of waiting
    }
}

std::size_t count_degenerate_uv(std::span<const glm::vec2> uv, std::span<const glm::uvec3> triangles) {
    return std::size_t(std::ranges::count_if(triangles, [&](glm::uvec3 corner) {
        if (std::max({corner.x, corner.y, corner.z}) >= uv.size())
            throw std::invalid_argument("count_degenerate_uv: a triangle names a corner that does not exist");
        return is_degenerate(corners_of(uv, corner));
    }));
}

}  // namespace sanguine
