#include "sanguine/feature.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <tuple>

#include "surface_walk.hpp"
#include "uv_raster.hpp"

namespace sanguine {
namespace {

constexpr std::array<std::string_view, layer_channel_count> channel_ids{
    "log_hemoglobin", "log_melanin", "log_oil", "oxygenation", "ink_per_mm", "height_mm",
};

void require(bool condition, const std::string& message) {
    if (!condition) throw std::invalid_argument(message);
}

/// Side of a texel at each welded vertex: the skin round it by the area of that skin in the image, on a seam in the
/// island with the largest texels: what those cannot hold has to be filtered on the other side as well. Being a value
/// of the vertex it is the same on both sides, and changes smoothly from triangle to triangle.
std::vector<float> texel_size_mm(const SkinSurface& surface, double texels) {
    struct Corner {
        std::uint32_t vertex;
        float u, v;  // corners of a vertex at one place in UV are of one island
        double skin_mm2, image;
    };
    std::vector<Corner> corners;
    corners.reserve(3 * surface.triangles().size());
    for (std::size_t i = 0; i < surface.triangles().size(); ++i) {
        const UvTriangle t = corners_of(surface.uv(), surface.corners()[i]);
        if (is_degenerate(t) || surface.triangle_area_mm2()[i] == 0) continue;
        for (int k = 0; k < 3; ++k) {
            const glm::vec2 uv = surface.uv()[surface.corners()[i][k]];
            corners.push_back({surface.triangles()[i][k], uv.x, uv.y, surface.triangle_area_mm2()[i],
                               std::abs(twice_area(t)) / 2});
        }
    }
    const auto place = [](const Corner& c) { return std::tuple(c.vertex, c.u, c.v); };
    std::ranges::stable_sort(corners, {}, place);
    std::vector<float> size(surface.position_mm().size(), 0);
    for (std::size_t i = 0; i < corners.size();) {
        const std::size_t first = i;
        double skin_mm2 = 0, image = 0;
        for (; i < corners.size() && place(corners[i]) == place(corners[first]); ++i) {
            skin_mm2 += corners[i].skin_mm2;
            image += corners[i].image;
        }
        float& largest = size[corners[first].vertex];
        largest = std::max(largest, float(std::sqrt(skin_mm2 / (image * texels))));
    }
    return size;
}

/// Texels beyond an edge show a place on it; few others do.
bool is_inside(glm::vec3 barycentric) { return std::min({barycentric.x, barycentric.y, barycentric.z}) > 0; }

/// What a texel shows whose centre lies beyond the edge of its island: the place beyond that edge on the skin, which is
/// on another island, so that a look-up at the edge finds on this side what it finds on the other one. At a rim of the
/// mesh it is the nearest place.
SurfacePoint beyond_edge(const SkinSurface& surface, const SurfacePoint& nearest, glm::dvec2 uv, double most_mm) {
    const UvTriangle t = corners_of(surface.uv(), surface.corners()[nearest.triangle]);
    const glm::uvec3 corner = surface.triangles()[nearest.triangle];
    const glm::dvec3 b(nearest.barycentric);
    const glm::dvec2 left = uv - (b.x * t[0] + b.y * t[1] + b.z * t[2]);
    const glm::dvec3 p0(surface.position_mm()[corner.x]), p1(surface.position_mm()[corner.y]),
        p2(surface.position_mm()[corner.z]);
    const glm::dvec3 way = (cross(left, t[2] - t[0]) * (p1 - p0) + cross(t[1] - t[0], left) * (p2 - p0)) / twice_area(t);
    const double length_mm = glm::length(way);
    if (!(length_mm > 1e-6)) return nearest;
    SurfaceWalk walk(surface, nearest, way);
    walk.advance(std::min(length_mm, most_mm));
    return walk.point();
}

}  // namespace

std::string_view layer_channel_id(LayerChannel channel) { return channel_ids[std::size_t(channel)]; }

const Feature& feature(std::string_view id) {
    const auto found = std::ranges::find(features(), id, [](const Feature* f) { return f->row().id; });
    if (found != features().end()) return **found;
    std::string known;
    for (const Feature* f : features()) known += (known.empty() ? "" : ", ") + std::string(f->row().id);
    throw std::invalid_argument("feature '" + std::string(id) + "' is not one of " + known);
}

TexelMap map_texels(const SkinSurface& surface, int width, int height, int padding_px, int threads) {
    require(width > 0 && height > 0, "map_texels: the image has no pixels");
    require(padding_px >= 0, "map_texels: padding_px is negative");
    const std::vector<float> size_mm = texel_size_mm(surface, double(width) * height);

    struct Band {
        std::vector<std::uint32_t> texel;
        std::vector<SkinPlace> place;
    };
    constexpr int rows = 128;
    std::vector<Band> bands(std::size_t((height + rows - 1) / rows));
    parallel_for(bands.size(), threads, {}, [&](std::size_t b) {
        const int first = int(b) * rows, end = std::min(height, first + rows);
        const std::size_t start = std::size_t(first) * std::size_t(width);
        std::vector<SurfacePoint> shown(std::size_t(end - first) * std::size_t(width), {SkinSurface::none, {}});
        UvBand(surface.uv(), surface.corners(), width, height, first, end)
            .draw(padding_px, [&](int x, int y, std::uint32_t triangle, glm::dvec3 barycentric) {
                shown[std::size_t(y) * std::size_t(width) + std::size_t(x) - start] = {triangle, barycentric};
            });
        Band& band = bands[b];
        const auto count = std::ranges::count_if(
            shown, [](const SurfacePoint& p) { return p.triangle != SkinSurface::none; });
        band.texel.reserve(std::size_t(count));
        band.place.reserve(std::size_t(count));
        for (std::size_t i = 0; i < shown.size(); ++i) {
            if (shown[i].triangle == SkinSurface::none) continue;
            const std::size_t texel = start + i;
            const glm::dvec2 uv((double(texel % std::size_t(width)) + 0.5) / width,
                                (double(texel / std::size_t(width)) + 0.5) / height);
            // Texels of a seam may differ in size, and an island with hardly any has no say in how far to go.
            const double most_mm = 2.0 * padding_px * double(surface.value_at(shown[i], size_mm));
            const SurfacePoint point =
                is_inside(shown[i].barycentric) ? shown[i] : beyond_edge(surface, shown[i], uv, most_mm);
            band.texel.push_back(std::uint32_t(texel));
            band.place.push_back(
                {surface.place_mm(point), surface.normal_at(point), surface.value_at(point, size_mm), point});
        }
    });

    TexelMap map{width, height, {}, {}, surface.triangles().size()};
    std::size_t count = 0;
    for (const Band& band : bands) count += band.texel.size();
    map.texel.reserve(count);
    map.place.reserve(count);
    for (Band& band : bands) {
        map.texel.insert(map.texel.end(), band.texel.begin(), band.texel.end());
        map.place.insert(map.place.end(), band.place.begin(), band.place.end());
        band = {};
    }
    return map;
}

std::vector<float> paint_layer(const GrownFeature& grown, const FeatureRow& row, const TexelMap& texels, int threads,
                               const Progress& progress) {
    constexpr std::size_t chunk = 4096;
    const std::size_t channels = row.changes.size(), count = texels.place.size();
    std::vector<float> layer(count * channels);
    parallel_for((count + chunk - 1) / chunk, threads, progress, [&](std::size_t i) {
        const std::size_t first = i * chunk, length = std::min(chunk, count - first);
        grown.paint(std::span(texels.place).subspan(first, length),
                    std::span(layer).subspan(first * channels, length * channels));
    });
    return layer;
}

std::vector<float> grow_layer(const Feature& feature, const SkinSurface& surface, const TexelMap& texels,
                              const Person& person, std::uint64_t seed, int threads, const Progress& progress) {
    const auto within = [](double value, double high) { return value >= 0 && value <= high; };
    require(within(person.age_years, 120), "age_years is not within 0 to 120");
    require(within(person.sun, 1), "sun is not within 0 to 1");
    require(within(person.masculinity, 1), "masculinity is not within 0 to 1");
    require(texels.triangles == surface.triangles().size(), "the texels are of another surface");
    return paint_layer(*feature.grow(surface, person, seed), feature.row(), texels, threads, progress);
}

}  // namespace sanguine
