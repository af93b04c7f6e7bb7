// Round marks on the skin, found by place, that keep their mean where texels are too large to show them.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "noise.hpp"
#include "place_grid.hpp"
#include "random.hpp"
#include "sanguine/feature.hpp"
#include "scatter.hpp"

namespace sanguine {

/// 1 where two normals look the same way, 0 from a right angle on: what stands on the upper lip is not to show on the
/// lower one that touches it, nor a spot of the helix behind the ear.
inline float same_side(glm::vec3 a, glm::vec3 b) { return smooth_step(0, 0.4F, glm::dot(a, b)); }

struct Spot {
    glm::vec3 place_mm;
    glm::vec3 normal;
    float radius_mm;
    float strength;  ///< at the middle
};

/// The profile of a spot by x = distance / radius: flat in the middle, 1/2 at x = 1, nothing from `rim_end` on.
/// `softness` in (0, 1] is half the width of the rim.
inline float spot_profile(float x, float softness) { return 1 - smooth_step(1 - softness, 1 + softness, x); }

/// Mean of the profile over the disc of radius 1 times pi: the integral of spot_profile over the plane.
/// By parts: 2 pi integral of (x^2 / 2) times the slope of a smooth step, which has mean 1 and variance softness^2 / 5.
inline float spot_area(float softness) { return 3.14159265F * (1 + softness * softness / 5); }

/// Many spots of one softness.
///
/// A texel of side s sees a spot of radius r as one of radius sqrt(r^2 + s^2), fainter by the ratio of the areas: the
/// mean stays. Spots that would grow to more than twice their radius turn into `mean_at`, their mean over the skin.
class Spots {
public:
    Spots() = default;
    /// `aside_mm`: how far places may be pushed aside, in each direction, before they are looked up.
    Spots(std::vector<Spot> spots, float softness, float aside_mm = 0);

    std::span<const Spot> spots() const { return spots_; }

    /// visit(index, strength of the spot here, distance / radius) for each spot that reaches the place.
    /// `lookup_mm` is the place, pushed aside to give spots an irregular rim.
    template <typename Visit>
    void at(const SkinPlace& place, glm::vec3 lookup_mm, const Visit& visit) const {
        for (const std::uint32_t i : grid_.at(lookup_mm)) {
            const Spot& spot = spots_[i];
            const float radius2 = spot.radius_mm * spot.radius_mm, seen2 = radius2 + place.size_mm * place.size_mm;
            const glm::vec3 away = lookup_mm - spot.place_mm;
            const float x2 = glm::dot(away, away) / seen2;
            if (x2 >= (1 + softness_) * (1 + softness_)) continue;
            const float share = (1 - faded(spot.radius_mm, place.size_mm)) * same_side(spot.normal, place.normal);
            if (share == 0) continue;
            const float x = std::sqrt(x2);
            visit(i, spot.strength * share * radius2 / seen2 * spot_profile(x, softness_), x);
        }
    }

    /// False where no spot reaches, wherever the place is pushed: then there is no need to ask.
    bool near(glm::vec3 place_mm) const { return !grid_.at(place_mm).empty(); }

    /// Sum of the strengths at the place.
    float sum(const SkinPlace& place, glm::vec3 lookup_mm) const {
        float value = 0;
        at(place, lookup_mm, [&](std::uint32_t, float strength, float) { value += strength; });
        return value;
    }

    /// What spots give that texels of `size_mm` cannot show, per spot per mm^2: times the density of spots it is the
    /// mean to be added to `sum`.
    float faded_mm2(float size_mm) const;

private:
    /// Share of a spot that is in the mean instead: all of it where it would be seen with more than twice its radius.
    static float faded(float radius_mm, float size_mm) { return smooth_step(1.2F, 1.7F, size_mm / radius_mm); }

    float softness_ = 1;
    std::vector<Spot> spots_;
    PlaceGrid grid_;
    std::vector<float> faded_mm2_;  // by 8 log2(size / smallest radius)
    float smallest_mm_ = 1;
};

/// Spots scattered over the skin at a density, and the mean of those too small to be seen.
class ScatteredSpots {
public:
    struct Mark {
        float radius_mm, strength;
    };

    ScatteredSpots() = default;
    /// mark(random, place) says what grows at each of the points; see scatter() for the rest.
    template <typename MarkOf>
    ScatteredSpots(const SkinSurface& surface, std::vector<float> density_per_mm2, float spacing, float softness,
                   std::uint64_t seed, const MarkOf& mark, float aside_mm = 0)
        : surface_(&surface), density_(std::move(density_per_mm2)) {
        std::vector<Spot> spots;
        for (const Seedling& s : scatter(surface, density_, spacing, seed)) {
            Random random(s.random);
            const Mark m = mark(random, s);
            spots.push_back({s.place_mm, s.normal, m.radius_mm, m.strength});
        }
        spots_ = Spots(std::move(spots), softness, aside_mm);
    }

    const Spots& spots() const { return spots_; }

    /// Sum of the strengths at the place.
    float operator()(const SkinPlace& place, glm::vec3 lookup_mm) const {
        const float faded = spots_.faded_mm2(place.size_mm);
        return spots_.sum(place, lookup_mm) + (faded > 0 ? faded * surface_->value_at(place.point, density_) : 0);
    }

private:
    const SkinSurface* surface_ = nullptr;
    std::vector<float> density_;
    Spots spots_;
};

}  // namespace sanguine
