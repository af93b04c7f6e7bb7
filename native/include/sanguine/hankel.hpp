// Inverse Hankel transform of order 0: from spatial frequency back to radius, with an error for every radius.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

namespace sanguine {

/// Two transforms at once (what leaves the top, what leaves the bottom), since they mostly share their work.
/// `s` is the angular spatial frequency [1/length], above 0.
using HankelPair = std::function<std::array<double, 2>(double s)>;

struct HankelResult {
    std::array<double, 2> value;
    std::array<double, 2> error;  ///< absolute: what the series had left to converge, quadrature and rounding
};

/// f(r) = 1/(2 pi) integral from 0 to infinity of F(s) J0(s r) s ds, for every radius (any order; held
/// to 1e-100 to 1e100, where no square overflows).
///
/// F is expected to be bounded and smooth: analytic in the right half of the complex plane, as everything is that
/// comes from exp(-z sqrt(s^2 + b^2)). It need not decay. Below the first zero of J0 panels of one octave each, shared
/// by all radii; above, panels between the zeros, whose alternating sum is extrapolated by the mW transformation
/// (Sidi 1988, "A user-friendly extrapolation method for oscillatory infinite integrals", Math. Comp. 51, 249), so
/// that nothing is cut off and nothing rings. Bounded work: at most max_half_waves panels for each radius.
///
/// The integral is one of numbers that cancel: where f(r) r^2 is smaller than about 1e-14 of F, the error exceeds the
/// value. Light that weak is below every use, and `error` says where it begins.
std::vector<HankelResult> inverse_hankel(const HankelPair& transform, std::span<const double> radii);

}  // namespace sanguine
