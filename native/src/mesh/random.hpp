// Random numbers that are functions of what they belong to: the same on every machine, for any order of asking.
#pragma once

#include <bit>
#include <cstdint>
#include <string_view>

namespace sanguine {

/// The finaliser of SplitMix64 (Steele, Lea and Flood 2014): every bit of the input reaches every bit of the result.
constexpr std::uint64_t mix(std::uint64_t x) {
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9U;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebU;
    return x ^ (x >> 31);
}

/// A seed of its own for each purpose: seed_for(seed, "freckles").
constexpr std::uint64_t seed_for(std::uint64_t seed, std::string_view purpose) {
    std::uint64_t hash = 0xcbf29ce484222325U;  // FNV-1a
    for (const char c : purpose) hash = (hash ^ std::uint8_t(c)) * 0x100000001b3U;
    return mix(seed + 0x9e3779b97f4a7c15U) ^ hash;
}

/// SplitMix64.
class Random {
public:
    explicit constexpr Random(std::uint64_t seed) : state_(mix(seed)) {}

    constexpr std::uint64_t bits() { return mix(state_ += 0x9e3779b97f4a7c15U); }
    /// In [0, 1).
    constexpr double uniform() { return double(bits() >> 11) * 0x1p-53; }
    constexpr float uniform(float low, float high) { return low + (high - low) * float(uniform()); }

private:
    std::uint64_t state_;
};

}  // namespace sanguine
