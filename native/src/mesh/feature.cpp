#include "sanguine/feature.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "uv_raster.hpp"

namespace sanguine {
namespace {

constexpr std::array<std::string_view, layer_channel_count> channel_ids{
    "log_hemoglobin", "log_melanin", "log_oil", "oxygenation", "ink_per_mm", "height_mm",
};

void require(bool condition, const std::string& message) {
    if (!condition) throw std::invalid_argument(message);
}

/// Side of a texel at each welded vertex: the skin round it by the area of that skin in the image. Being a value of the
/// vertex it is the same on both sides of a seam, and changes smoothly from triangle to triangle.
std::vector<float> texel_size_mm(const SkinSurface& surface, double texels) {
    std::vector<double> skin_mm2(surface.position_mm().size(), 0), image(skin_mm2.size(), 0);
    for (std::size_t i = 0; i < surface.triangles().size(); ++i) {
        const UvTriangle t = corners_of(surface.uv(), surface.corners()[i]);
        if (is_degenerate(t) || surface.triangle_area_mm2()[i] == 0) continue;
        for (int k = 0; k < 3; ++k) {
            const std::uint32_t vertex = surface.triangles()[i][k];
            skin_mm2[vertex] += surface.triangle_area_mm2()[i];
            image[vertex] += std::abs(twice_area(t)) / 2;
        }
    }
    std::vector<float> size(skin_mm2.size(), 0);
    for (std::size_t v = 0; v < size.size(); ++v)
        if (image[v] > 0) size[v] = float(std::sqrt(skin_mm2[v] / (image[v] * texels)));
    return size;
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
        const auto count = std::ranges::count_if(shown, [](const SurfacePoint& p) { return p.triangle != SkinSurface::none; });
        band.texel.reserve(std::size_t(count));
        band.place.reserve(std::size_t(count));
        for (std::size_t i = 0; i < shown.size(); ++i) {
            if (shown[i].triangle == SkinSurface::none) continue;
            band.texel.push_back(std::uint32_t(start + i));
            band.place.push_back({surface.place_mm(shown[i]), surface.normal_at(shown[i]),
                                  surface.value_at(shown[i], size_mm), shown[i]});
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
