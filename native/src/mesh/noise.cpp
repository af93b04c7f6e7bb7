#include "noise.hpp"

#include <algorithm>
#include <cmath>

namespace sanguine {
namespace {

/// The finaliser of MurmurHash3 over the coordinates of a lattice point.
std::uint32_t hash(std::int32_t x, std::int32_t y, std::int32_t z, std::uint32_t seed) {
    std::uint32_t h = seed ^ (std::uint32_t(x) * 0x8da6b343U) ^ (std::uint32_t(y) * 0xd8163841U) ^
                      (std::uint32_t(z) * 0xcb1ab31fU);
    h = (h ^ (h >> 16)) * 0x85ebca6bU;
    h = (h ^ (h >> 13)) * 0xc2b2ae35U;
    return h ^ (h >> 16);
}

/// Dot product with one of the twelve edge directions of a cube (four of them twice).
float gradient(std::uint32_t h, float x, float y, float z) {
    const std::uint32_t k = h & 15;
    const float u = k < 8 ? x : y;
    const float v = k < 4 ? y : k == 12 || k == 14 ? x : z;
    return (h & 1 ? -u : u) + (h & 2 ? -v : v);
}

float fade(float t) { return t * t * t * (t * (t * 6 - 15) + 10); }

float mix(float a, float b, float t) { return a + t * (b - a); }

}  // namespace

float gradient_noise(glm::vec3 p, std::uint32_t seed) {
    const float fx = std::floor(p.x), fy = std::floor(p.y), fz = std::floor(p.z);
    const auto ix = std::int32_t(fx), iy = std::int32_t(fy), iz = std::int32_t(fz);
    const float x = p.x - fx, y = p.y - fy, z = p.z - fz;
    const auto corner = [&](int i, int j, int k) {
        return gradient(hash(ix + i, iy + j, iz + k, seed), x - float(i), y - float(j), z - float(k));
    };
    const float u = fade(x), v = fade(y), w = fade(z);
    const float low = mix(mix(corner(0, 0, 0), corner(1, 0, 0), u), mix(corner(0, 1, 0), corner(1, 1, 0), u), v);
    const float high = mix(mix(corner(0, 0, 1), corner(1, 0, 1), u), mix(corner(0, 1, 1), corner(1, 1, 1), u), v);
    return std::clamp(mix(low, high, w), -1.0F, 1.0F);  // the polynomial's own bound is 1.04
}

float Fbm::operator()(glm::vec3 place_mm, float size_mm) const {
    float sum = 0, total = 0, weight = 1, wave = wavelength_mm;
    for (int octave = 0; octave < octaves; ++octave) {
        total += weight;
        if (const float share = held(wave, size_mm); share > 0)
            // The shift keeps the zeros of the octaves apart.
            sum += weight * share *
                   gradient_noise(place_mm / wave + float(octave) * glm::vec3(0.37F, 0.61F, 0.83F),
                                  seed + std::uint32_t(octave));
        weight *= gain;
        wave /= 2;
    }
    return sum / total;
}

glm::vec3 Fbm::vector(glm::vec3 place_mm, float size_mm) const {
    Fbm y = *this, z = *this;
    y.seed += 0x68bc21ebU;
    z.seed += 0x02e5be93U;
    return {(*this)(place_mm, size_mm), y(place_mm, size_mm), z(place_mm, size_mm)};
}

}  // namespace sanguine
