// Analog Monte Carlo of light in a stack of plane layers: the reference that the path table is baked with and
// that everything faster is measured against (MCML: Wang, Jacques and Zheng 1995).
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "sanguine/stack.hpp"

namespace sanguine {

/// PCG-XSH-RR 64/32 (O'Neill 2014). Every photon has its own sequence, a pure function of (seed, photon): the
/// result does not depend on which thread traces it.
class PhotonRandom {
public:
    PhotonRandom(std::uint64_t seed, std::uint64_t photon)
        : state_(mix(seed ^ mix(photon))), increment_(mix(state_ + photon) | 1) {}

    /// Uniform in the open interval (0, 1): its logarithm is finite.
    double uniform() {
        const std::uint64_t old = state_;
        state_ = old * 6364136223846793005ULL + increment_;
        const auto shifted = static_cast<std::uint32_t>(((old >> 18) ^ old) >> 27);
        const auto turn = static_cast<std::uint32_t>(old >> 59);
        const std::uint32_t bits = (shifted >> turn) | (shifted << ((32 - turn) & 31));
        return (bits + 0.5) * 0x1p-32;
    }

private:
    /// Finaliser of SplitMix64 (Steele, Lea and Flood 2014).
    static std::uint64_t mix(std::uint64_t x) {
        x += 0x9e3779b97f4a7c15ULL;
        x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
        x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
        return x ^ (x >> 31);
    }

    std::uint64_t state_, increment_;
};

enum class Fate { absorbed, reflected_at_surface, left_top, left_bottom };

/// What became of one photon.
struct PhotonEnd {
    Fate fate;
    bool scattered;                      ///< at least once
    double radius;                       ///< where it left, from the point of incidence [length]
    std::array<double, max_layers> path; ///< way travelled in each layer [length]
};

/// Traces one photon that falls on `stack` from outside (n = 1) and dies of the stack's absorption.
/// A half-space has to absorb or scatter, else a photon may never end; at most `max_layers` layers.
PhotonEnd trace_photon(std::span<const Layer> stack, Incidence incidence, PhotonRandom& random);

}  // namespace sanguine
