#include "sanguine/raster.hpp"

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "uv_raster.hpp"

namespace sanguine {

namespace {

/// Draws the rows [first_row, end_row).
void draw_band(const UvMesh& mesh, int padding_px, std::span<const float> fill, const RasterTarget& target,
               int first_row, int end_row) {
    const auto channels = std::size_t(mesh.channels);
    const auto row = std::size_t(target.width) * channels;
    for (auto i = row * std::size_t(first_row); i < row * std::size_t(end_row); i += channels)
        std::ranges::copy(fill, target.pixels.begin() + std::ptrdiff_t(i));
    UvBand band(mesh.uv, mesh.triangles, target.width, target.height, first_row, end_row);
    band.draw(padding_px, [&](int x, int y, std::uint32_t triangle, glm::dvec3 b) {
        const glm::uvec3 corner = mesh.triangles[triangle];
        const float* a0 = &mesh.values[corner.x * channels];
        const float* a1 = &mesh.values[corner.y * channels];
        const float* a2 = &mesh.values[corner.z * channels];
        float* out = &target.pixels[row * std::size_t(y) + std::size_t(x) * channels];
        for (std::size_t c = 0; c < channels; ++c) out[c] = float(b.x * a0[c] + b.y * a1[c] + b.z * a2[c]);
    });
}

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
        const auto draw = [&mesh, padding_px, fill, &target, first, end] {
            draw_band(mesh, padding_px, fill, target, first, end);
        };
        if (band > 0)
            workers.emplace_back(draw);
        else
            draw();  // this thread does the remaining one instead of waiting
    }
}

std::size_t count_degenerate_uv(std::span<const glm::vec2> uv, std::span<const glm::uvec3> triangles) {
    return std::size_t(std::ranges::count_if(triangles, [&](glm::uvec3 corner) {
        if (std::max({corner.x, corner.y, corner.z}) >= uv.size())
            throw std::invalid_argument("count_degenerate_uv: a triangle names a corner that does not exist");
        return is_degenerate(corners_of(uv, corner));
    }));
}

UvCoverage uv_coverage(std::span<const glm::vec2> uv, std::span<const glm::uvec3> triangles, int width, int height) {
    if (width < 1 || height < 1) throw std::invalid_argument("uv_coverage: the image has no pixels");
    const glm::dvec2 size(width, height);
    const auto in_pixels = [&](glm::uvec3 corner) {
        UvTriangle t = corners_of(uv, corner);
        for (glm::dvec2& point : t) point *= size;
        return t;
    };
    UvCoverage coverage;
    for (const glm::uvec3 corner : triangles) {
        if (std::max({corner.x, corner.y, corner.z}) >= uv.size())
            throw std::invalid_argument("uv_coverage: a triangle names a corner that does not exist");
        if (is_degenerate(corners_of(uv, corner))) continue;
        const UvTriangle t = in_pixels(corner);
        const auto [left, right] = std::minmax({t[0].x, t[1].x, t[2].x});
        const auto [low, high] = std::minmax({t[0].y, t[1].y, t[2].y});
        if (right <= 0 || high <= 0 || left >= size.x || low >= size.y) ++coverage.outside;
    }

    // In pixels. Corners on a common edge may differ by the rounding of a float, 2^-24 of 16384 pixels at most.
    constexpr double inside_edge = 0.01;
    enum : std::uint8_t { untouched, on_edge, inside, twice };
    std::vector<std::uint8_t> state(std::size_t(width) * std::size_t(height), untouched);
    std::size_t current = triangles.size();
    glm::dvec3 altitude(0);  // of each corner over the edge opposite to it
    UvBand(uv, triangles, width, height, 0, height).draw(0, [&](int x, int y, std::uint32_t triangle, glm::dvec3 b) {
        if (triangle != current) {
            current = triangle;
            const UvTriangle t = in_pixels(triangles[triangle]);
            altitude = std::abs(twice_area(t)) /
                       glm::dvec3(glm::length(t[2] - t[1]), glm::length(t[0] - t[2]), glm::length(t[1] - t[0]));
        }
        const double depth = std::min({b.x * altitude.x, b.y * altitude.y, b.z * altitude.z});
        std::uint8_t& texel = state[std::size_t(y) * std::size_t(width) + std::size_t(x)];
        if (depth <= inside_edge)
            texel = std::max<std::uint8_t>(texel, on_edge);
        else
            texel = texel < inside ? inside : twice;
    });
    coverage.covered = std::size_t(std::ranges::count_if(state, [](std::uint8_t s) { return s != untouched; }));
    coverage.overlapping = std::size_t(std::ranges::count(state, twice));
    return coverage;
}

}  // namespace sanguine
