// Exponential and logarithm that a compiler can take into the vector units, and the way to have a function compiled for
// several of them.
//
// Everything here is plain arithmetic in a fixed order without fused products, so that every instruction set, and every
// machine, computes the same bits.
#pragma once

#include <bit>
#include <cstdint>

/// Compiles the function once per level of x86-64; the loader picks the best that the processor has.
#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__)
#define SANGUINE_VECTOR_CLONES __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define SANGUINE_VECTOR_CLONES
#endif

#if defined(__GNUC__)
#define SANGUINE_INLINE inline __attribute__((always_inline))
#else
#define SANGUINE_INLINE inline
#endif

namespace sanguine::vector_math {

/// exp(-x) for x >= 0, relative error 3e-7 + 6e-8 x; beyond 80 as at 80, 2e-35, so that products stay normal numbers. x = n ln 2 - f, Taylor series of exp(f).
SANGUINE_INLINE float exp_minus(float x) {
    const float limited = x < 80.0f ? x : 80.0f;
    const float shifted = limited * -1.44269504f + 12582912.0f;  // 1.5 2^23: rounds, and leaves n in the low bits
    const float n = shifted - 12582912.0f;
    const float f = (-limited - n * 0.693359375f) + n * 2.12194440e-4f;  // ln 2 in two parts (Cody and Waite 1980)
    const float series = 1 + f * (1 + f * (1.0f / 2 + f * (1.0f / 6 + f * (1.0f / 24 + f * (1.0f / 120
                       + f * (1.0f / 720))))));
    const float power = std::bit_cast<float>((std::bit_cast<std::uint32_t>(shifted) + 127u) << 23);
    return series * power;
}

/// exp(-x) for x >= 0, relative error 1e-14; 0 beyond 700.
SANGUINE_INLINE double exp_minus(double x) {
    const double limited = x < 700.0 ? x : 700.0;
    const double shifted = limited * -1.4426950408889634 + 0x1.8p52;
    const double n = shifted - 0x1.8p52;
    const double f = (-limited - n * 0.693145751953125) - n * 1.42860682030941723212e-6;
    const double series =
        1 + f * (1 + f * (1.0 / 2 + f * (1.0 / 6 + f * (1.0 / 24 + f * (1.0 / 120 + f * (1.0 / 720 + f * (1.0 / 5040
        + f * (1.0 / 40320 + f * (1.0 / 362880 + f * (1.0 / 3628800 + f * (1.0 / 39916800)))))))))));
    const double power = std::bit_cast<double>((std::bit_cast<std::uint64_t>(shifted) + 1023u) << 52);
    return x < 700.0 ? series * power : 0.0;
}

/// ln x of a normal x > 0, absolute error 1e-7 + 1e-7 |ln x|: series of artanh((m - 1) / (m + 1)), m in [0.7, 1.42).
SANGUINE_INLINE float logarithm(float x) {
    const std::uint32_t bits = std::bit_cast<std::uint32_t>(x) - 0x3f3504f3u;  // less the bits of sqrt(1/2)
    const float e = static_cast<float>(static_cast<std::int32_t>(bits) >> 23);
    const float m = std::bit_cast<float>((bits & 0x007fffffu) + 0x3f3504f3u);
    const float f = (m - 1) / (m + 1), g = f * f;
    return e * 0.693147181f + 2 * f * (1 + g * (1.0f / 3 + g * (1.0f / 5 + g * (1.0f / 7 + g * (1.0f / 9)))));
}

/// Cube root of x >= 0, relative error 2e-7: a third of the exponent, then two steps of Halley's iteration.
SANGUINE_INLINE float cube_root(float x) {
    const float guess = std::bit_cast<float>(std::bit_cast<std::uint32_t>(x) / 3u + 0x2a5119f2u);
    const float g3 = guess * guess * guess;
    const float near = guess * (g3 + 2 * x) / (2 * g3 + x);
    const float n3 = near * near * near;
    return near * (n3 + 2 * x) / (2 * n3 + x);
}

}  // namespace sanguine::vector_math
