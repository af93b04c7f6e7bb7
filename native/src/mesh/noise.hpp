// Smooth noise in space: the same bytes on every machine (integer hashes, no library functions but floor).
#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

namespace sanguine {

/// 0 below `low`, 1 above `high`, smooth between.
inline float smooth_step(float low, float high, float x) {
    const float t = (x - low) / (high - low);
    return t <= 0 ? 0 : t >= 1 ? 1 : t * t * (3 - 2 * t);
}

/// Gradient noise (Perlin 2002) with period-free integer hashing: mean 0, within -1 and 1, standard deviation about
/// 0.25; features of about one unit; 0 at whole coordinates.
float gradient_noise(glm::vec3 p, std::uint32_t seed);

/// Octaves of gradient noise from `wavelength_mm` downward, each half as long and `gain` times as strong; the sum of
/// the weights is 1. An octave that texels of `size_mm` cannot hold is left out, smoothly: the mean stays 0.
struct Fbm {
    float wavelength_mm;
    int octaves = 4;
    float gain = 0.5F;
    std::uint32_t seed = 0;

    float operator()(glm::vec3 place_mm, float size_mm) const;
    /// Three independent values, to push a place aside.
    glm::vec3 vector(glm::vec3 place_mm, float size_mm) const;
};

/// How much of noise of `wavelength_mm` texels of `size_mm` can hold: 1 from six texels a wave, 0 below three. Gradient
/// noise has waves of half its own length as well, and what texels cannot hold shows at seams, where they shift.
inline float held(float wavelength_mm, float size_mm) { return smooth_step(3, 6, wavelength_mm / size_mm); }

}  // namespace sanguine
