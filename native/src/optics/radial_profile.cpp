#include "sanguine/radial_profile.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sanguine {

using namespace path_grid;

namespace {

const double log_ratio = std::log(radius_ratio);

/// A slope between two neighbouring ones that keeps cubics monotone (Fritsch and Carlson 1980, sufficient condition);
/// their geometric mean, because skin's profiles fall off like powers and exponentials.
double monotone_slope(double below, double above) {
    const double least = below < above ? 3 * below : 3 * above, mean = std::sqrt(below * above);
    return mean < least ? mean : least;
}

/// Position of a radius among the edges of the rings: 0 at the first, 1 at the second, ...
double position_of(double radius) {
    return std::log(radius / first_radius) / log_ratio;
}

}  // namespace

RadialProfile::RadialProfile(std::span<const double, rings> energy, double unit_mm) : unit_mm_(unit_mm) {
    // Secants: what a ring holds. Light beyond the last edge, 226 units, where no
    // photon of the present table went, joins the last ring.
    std::array<double, edges - 1> secant;
    std::copy(energy.begin() + 1, energy.begin() + edges, secant.begin());
    secant.back() += energy.back();

    cumulative_[0] = energy[0];
    for (int k = 1; k < edges; ++k)
        cumulative_[k] = cumulative_[k - 1] + secant[k - 1];
    slope_[0] = std::min(energy[0] * log_ratio, 3 * secant[0]);  // continues energy ~ r
    for (int k = 1; k < edges - 1; ++k)
        slope_[k] = monotone_slope(secant[k - 1], secant[k]);
    slope_[edges - 1] = 0;
}

double RadialProfile::energy_within(double radius_mm) const {
    const double radius = radius_mm / unit_mm_;
    if (radius <= first_radius)
        return cumulative_[0] * radius / first_radius;
    const double x = position_of(radius);
    if (x >= edges - 1)
        return cumulative_[edges - 1];
    const int k = static_cast<int>(x);
    const double t = x - k, u = 1 - t;
    return cumulative_[k] * u * u * (1 + 2 * t) + cumulative_[k + 1] * t * t * (3 - 2 * t)
         + t * u * (u * slope_[k] - t * slope_[k + 1]);
}

void RadialProfile::energy_within_ladder(double first_mm, std::span<double> out) const {
    const double first = first_mm / unit_mm_, x = position_of(first);
    const int count = static_cast<int>(out.size());
    // Below the first edge, then the cubics, then everything.
    const int inside = std::clamp(static_cast<int>(std::ceil(-x)), 0, count);
    double share = cumulative_[0] * first / first_radius;
    for (int i = 0; i < inside; ++i, share *= radius_ratio)
        out[i] = std::min(share, cumulative_[0]);
    if (inside == count)
        return;
    const double start = x + inside;
    int k = std::clamp(static_cast<int>(start), 0, edges - 1);
    const int cubics = std::min(count, inside + std::max(0, edges - 1 - k));
    const double t = std::clamp(start - k, 0.0, 1.0), u = 1 - t;
    const double below = u * u * (1 + 2 * t), above = t * t * (3 - 2 * t), slope_below = t * u * u, slope_above = t * t * u;
    const double* cumulative = &cumulative_[k];
    const double* slope = &slope_[k];
    double* to = out.data() + inside;
    for (int i = 0; i < cubics - inside; ++i)
        to[i] = cumulative[i] * below + cumulative[i + 1] * above + slope_below * slope[i] - slope_above * slope[i + 1];
    for (int i = cubics; i < count; ++i)
        out[i] = cumulative_[edges - 1];
}

double RadialProfile::density(double radius_mm) const {
    const double radius = radius_mm / unit_mm_;
    // The density falls as 1/r; a radius whose square underflows has one too, and below 1e-300 mm it has that of 1e-300.
    if (radius <= first_radius)
        return cumulative_[0] / (2 * std::numbers::pi * first_radius * unit_mm_ * std::max(radius_mm, 1e-300));
    const double per_ring_to_mm2 = 1 / (2 * std::numbers::pi * radius_mm * radius_mm * log_ratio);
    const double x = position_of(radius);
    if (x >= edges - 1)
        return 0;
    const int k = static_cast<int>(x);
    const double t = x - k, u = 1 - t;
    const double derivative = 6 * t * u * (cumulative_[k + 1] - cumulative_[k]) + u * (1 - 3 * t) * slope_[k]
                            + t * (3 * t - 2) * slope_[k + 1];
    return std::max(0.0, derivative) * per_ring_to_mm2;
}

}  // namespace sanguine
