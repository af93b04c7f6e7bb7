#include "vessel_paint.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "noise.hpp"

namespace sanguine {
namespace {

// Standard deviation of the filter over the side of a texel: a box has 0.29; with 0.6 what a bilinear look-up makes of
// the texels follows a thin line within some percent.
constexpr float texel_blur = 0.6F;

// Texels up to these sizes share a grid: 2048 texels over a head have 0.1 to 0.4 mm on the face and more below it.
// Texels larger than the last are filtered as that: 128 texels over a head.
constexpr std::array texel_levels_mm{0.4F, 0.8F, 1.6F, 3.2F, 6.4F};

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

float radius2_of(float blur2_mm2, float texel_mm) {
    return radius_per_blur * radius_per_blur * (blur2_mm2 + texel_blur * texel_blur * texel_mm * texel_mm);
}

}  // namespace

float held_below(float limit, float value) {
    const float knee = 0.6F * limit, rest = limit - knee;
    return value <= knee ? value : limit - rest * rest / (rest + value - knee);
}

VesselPaint::VesselPaint(std::vector<VesselStroke> strokes) {
    pieces_.reserve(strokes.size());
    for (const VesselStroke& s : strokes) {
        const glm::vec3 along = s.to_mm - s.from_mm;
        const float length = glm::length(along);
        if (length > 0)
            pieces_.push_back({s.from_mm, along / length, s.normal, length, s.blur_mm * s.blur_mm, s.amount_mm});
    }
    std::vector<PlaceGrid::Box> boxes(pieces_.size());
    for (const float texel_mm : texel_levels_mm) {
        for (std::size_t i = 0; i < pieces_.size(); ++i) {
            const Piece& p = pieces_[i];
            const float reach = std::sqrt(radius2_of(p.blur2_mm2, texel_mm));
            const glm::vec3 to = p.from_mm + p.length_mm * p.along;
            boxes[i] = {glm::min(p.from_mm, to) - reach, glm::max(p.from_mm, to) + reach};
        }
        grids_.emplace_back(boxes);
    }
}

glm::vec2 VesselPaint::at(const SkinPlace& place) const {
    glm::vec2 sum(0);
    if (pieces_.empty()) return sum;
    const float size = std::min(place.size_mm, texel_levels_mm.back());
    const auto level = std::ranges::lower_bound(texel_levels_mm, size) - texel_levels_mm.begin();
    for (const std::uint32_t i : grids_[std::size_t(level)].at(place.place_mm)) {
        const Piece& p = pieces_[i];
        const glm::vec3 to = place.place_mm - p.from_mm;
        const float t = glm::dot(to, p.along), radius2 = radius2_of(p.blur2_mm2, size);
        const float away2 = std::max(0.0F, glm::dot(to, to) - t * t);
        if (away2 >= radius2) continue;
        const float radius = std::sqrt(radius2);
        if (t <= -radius || t >= p.length_mm + radius) continue;
        const float facing = smooth_step(0, 0.5F, glm::dot(place.normal, p.normal));
        if (facing == 0) continue;
        const float share = std::max(0.0F, kernel_share(t / radius) - kernel_share((t - p.length_mm) / radius));
        sum += p.amount_mm * (facing * kernel(away2 / radius2) * share / (radius * kernel_integral));
    }
    return sum;
}

}  // namespace sanguine
