// Photons in a stack of plane layers (MCML: Wang, Jacques and Zheng 1995). `trace_photon` is analog, for what needs the
// paths themselves, such as the path table; `WeightedWalk` is for profiles and totals, and many times cheaper there.
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
    double uniform() { return (bits() + 0.5) * 0x1p-32; }

    std::uint32_t bits() {
        const std::uint64_t old = state_;
        state_ = old * 6364136223846793005ULL + increment_;
        const auto shifted = static_cast<std::uint32_t>(((old >> 18) ^ old) >> 27);
        const auto turn = static_cast<std::uint32_t>(old >> 59);
        return (shifted >> turn) | (shifted << ((32 - turn) & 31));
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

/// What one weighted photon adds to each tally; shares of one incident photon.
struct WeightedEnd {
    enum class Exit { none, top, bottom, cut };

    Exit exit = Exit::none;          ///< of its scattered light; `cut`: stopped inside by the cap of steps
    double weight = 0;               ///< of that light
    double radius_squared = 0;       ///< where it left
    double unscattered_top = 0;      ///< came back from a deeper face without scattering
    double unscattered_bottom = 0;   ///< went through without scattering
    std::uint32_t collisions = 0, faces = 0;
};

/// A walk in which absorption is a weight. All expectations are those of the analog walk:
///
/// - all photons enter, with the weight that the surface lets in;
/// - the ray without scattering is followed to its end; where its optical depth tau is finite, the first scattering is
///   forced to happen on it, with weight 1 - exp(-tau);
/// - a layer collides at a rate mu_c, mu_s <= mu_c <= mu_a + mu_s: each collision multiplies the weight by mu_s / mu_c,
///   each way by exp(-(mu_a + mu_s - mu_c) way). The first extreme is continuous absorption, the last albedo weighting;
/// - the absorption passed since the first scattering, -ln of that weight, is free up to `free_absorption` and an
///   exponential clock that kills the photon, its weight kept, beyond (a Russian roulette without steps);
/// - a photon held by total reflection at both faces of a layer goes to its next collision in one step.
class WeightedWalk {
public:
    /// Collisions and crossings of faces in the life of a photon, by default: about 50 ms of work.
    static constexpr std::uint32_t default_max_steps = 1u << 20;

    /// `stack` in any unit of length, checked by check_stack.
    WeightedWalk(std::span<const Layer> stack, Incidence incidence, std::uint32_t max_steps = default_max_steps);

    /// A pure function of (seed, photon).
    WeightedEnd trace(std::uint64_t seed, std::uint64_t photon) const;

private:
    /// A layer prepared for the walk. Face 0 is the top, face 1 the bottom.
    struct Medium {
        double thickness, mu_c, inverse_mu_c;
        double absorption;           // mu_a + mu_s - mu_c
        double loss;                 // -ln(mu_s / mu_c)
        double g;
        std::array<double, 2> ratio; // n / n beyond the face; 1: no face at all
    };
    struct Ray;
    enum class Stop { collision, top, bottom, killed, lost, capped };

    Stop fly(Ray& ray, double optical_depth, PhotonRandom& random) const;

    std::array<Medium, max_layers> media_;
    int layers_;
    Incidence incidence_;
    std::uint32_t max_steps_;
    double entering_;  // weight of a photon below the surface
};

}  // namespace sanguine
