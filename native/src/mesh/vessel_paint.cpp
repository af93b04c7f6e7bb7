#include "vessel_paint.hpp"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "noise.hpp"

namespace sanguine {
namespace {

// Standard deviation of the filter over the side of a texel: a box has 0.29; with 0.5 what a bilinear look-up makes of
// the texels follows a thin line within some percent.
constexpr float texel_blur = 0.5F;

constexpr float fine_texel_mm = 0.6F;    // 2048 texels over a head have 0.1 to 0.4 mm
constexpr float coarse_texel_mm = 6.0F;  // coarser texels are filtered as these: 128 texels over a head

// The kernel (1 - x^2)^3 on -1 to 1 has the standard deviation 1/3 and the integral 32/35: a bell without a tail.
constexpr float radius_per_blur = 3;
constexpr float kernel_integral = 32.0F / 35;

float kernel(float x2) {
    const float t = 1 - x2;
    return t * t * t;
}

/// Its integral from -1 to x over all of it.
float kernel_share(float x) {
    x = std::clamp(x, -1.0F, 1.0F);
    const float x2 = x * x;
    return 0.5F + x * (1 - x2 * (1 - x2 * (0.6F - x2 / 7))) / (2 * 16.0F / 35);
}

float radius_of(float blur_mm, float texel_mm) {
    return radius_per_blur * std::sqrt(blur_mm * blur_mm + texel_blur * texel_blur * texel_mm * texel_mm);
}

PlaceGrid grid_for(std::span<const VesselStroke> strokes, float texel_mm) {
    std::vector<PlaceGrid::Box> boxes;
    boxes.reserve(strokes.size());
    for (const VesselStroke& s : strokes) {
        const float reach = radius_of(s.blur_mm, texel_mm);
        boxes.push_back({glm::min(s.from_mm, s.to_mm) - reach, glm::max(s.from_mm, s.to_mm) + reach});
    }
    return PlaceGrid(boxes);
}

}  // namespace

float held_below(float limit, float value) {
    const float knee = 0.6F * limit, rest = limit - knee;
    return value <= knee ? value : limit - rest * rest / (rest + value - knee);
}

VesselPaint::VesselPaint(std::vector<VesselStroke> strokes)
    : strokes_(std::move(strokes)),
      fine_(grid_for(strokes_, fine_texel_mm)),
      coarse_(grid_for(strokes_, coarse_texel_mm)) {}

glm::vec2 VesselPaint::at(const SkinPlace& place) const {
    const float size = std::min(place.size_mm, coarse_texel_mm);
    glm::vec2 sum(0);
    for (const std::uint32_t i : (size <= fine_texel_mm ? fine_ : coarse_).at(place.place_mm)) {
        const VesselStroke& s = strokes_[i];
        const float radius = radius_of(s.blur_mm, size);
        const glm::vec3 along = s.to_mm - s.from_mm, to = place.place_mm - s.from_mm;
        const float length = glm::length(along);
        if (!(length > 0)) continue;
        const float t = glm::dot(to, along) / length;
        const float away2 = std::max(0.0F, glm::dot(to, to) - t * t) / (radius * radius);
        if (away2 >= 1 || t <= -radius || t >= length + radius) continue;
        const float facing = smooth_step(0, 0.5F, glm::dot(place.normal, s.normal));
        if (facing == 0) continue;
        const float share = std::max(0.0F, kernel_share(t / radius) - kernel_share((t - length) / radius));
        sum += s.amount_mm * (facing * kernel(away2) * share / (radius * kernel_integral));
    }
    return sum;
}

}  // namespace sanguine
