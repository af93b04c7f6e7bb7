#include "sanguine/hankel.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

namespace sanguine {
namespace {

using Pair = std::array<double, 2>;

constexpr double rounding = std::numeric_limits<double>::epsilon();

/// Gauss-Legendre points in a panel. The nearest singularity of F lies left of the imaginary axis, so on an octave
/// [a, 2a] the error falls as (3 + sqrt(8))^-2n: 4e-19 for 12. Half a wave of J0 needs fewer.
constexpr int nodes = 12;

/// Octaves below the first zero of J0. What lies below them is one more panel; it holds 1e-12 of F(0) / r^2 or less.
constexpr int octaves = 20;

/// Panels between zeros of J0, and how well the sum is wanted.
constexpr int max_half_waves = 80;
constexpr double wanted = 1e-9;

struct GaussLegendre {
    std::array<double, nodes> x, weight, highest;  // on [-1, 1]; `highest` gives the last Legendre coefficient

    GaussLegendre() {
        for (int i = 0; i < nodes; ++i) {
            double root = std::cos(std::numbers::pi * (i + 0.75) / (nodes + 0.5)), below = 0, slope = 1;
            for (int pass = 0; pass < 8; ++pass) {  // Newton; four passes suffice
                double p = 1, previous = 0;
                for (int k = 1; k <= nodes; ++k)
                    previous = std::exchange(p, ((2 * k - 1) * root * p - (k - 1) * previous) / k);
                below = previous;
                slope = nodes * (root * p - previous) / (root * root - 1);
                root -= p / slope;
            }
            x[i] = root;
            weight[i] = 2 / ((1 - root * root) * slope * slope);
            highest[i] = weight[i] * below * (nodes - 0.5);
        }
    }
};

const GaussLegendre& rule() {
    static const GaussLegendre once;
    return once;
}

/// F on one panel.
struct Panel {
    double from, to;
    std::array<double, nodes> s;
    std::array<Pair, nodes> value;
    Pair unresolved;  ///< estimated relative error of the rule: the square of the last Legendre coefficient's share
};

Panel sample(const HankelPair& transform, double from, double to) {
    Panel panel{.from = from, .to = to, .s = {}, .value = {}, .unresolved = {}};
    Pair last{}, largest{};
    for (int i = 0; i < nodes; ++i) {
        panel.s[i] = 0.5 * (from + to) + 0.5 * (to - from) * rule().x[i];
        panel.value[i] = transform(panel.s[i]);
        for (int c = 0; c < 2; ++c) {
            last[c] += rule().highest[i] * panel.value[i][c];
            largest[c] = std::fmax(largest[c], std::fabs(panel.value[i][c]));
        }
    }
    for (int c = 0; c < 2; ++c) {
        const double share = largest[c] > 0 ? std::fabs(last[c] / largest[c]) : 0;
        panel.unresolved[c] = share * share;
    }
    return panel;
}

/// Integrals of F J0 s over panels, with what they cost in accuracy.
struct Sum {
    Pair value{}, magnitude{}, error{};

    /// Returns the panel's share.
    Pair add(const Panel& panel, double r) {
        Pair part{}, size{};
        for (int i = 0; i < nodes; ++i) {
            const double weight = 0.5 * (panel.to - panel.from) * rule().weight[i] * panel.s[i] * ::j0(panel.s[i] * r);
            for (int c = 0; c < 2; ++c) {
                part[c] += weight * panel.value[i][c];
                size[c] += std::fabs(weight * panel.value[i][c]);
            }
        }
        for (int c = 0; c < 2; ++c) {
            value[c] += part[c];
            magnitude[c] += size[c];
            error[c] += size[c] * panel.unresolved[c];
        }
        return part;
    }
};

/// The k-th zero of J0 (k from 1) by McMahon's expansion; 1e-3 off at most, and nothing here needs it exact.
double zero_of_j0(int k) {
    const double beta = (k - 0.25) * std::numbers::pi, x = 1 / (8 * beta);
    return beta + x - 124.0 / 3 * x * x * x;
}

/// Sidi's mW transformation by his W algorithm, for one integral.
class Extrapolation {
public:
    /// `partial` is the integral up to `x`, `next` that from x to the following zero.
    void add(double x, double partial, double next) {
        const std::size_t n = inverse_x_.size();
        inverse_x_.push_back(1 / x);
        above_.push_back(partial / next);
        below_.push_back(1 / next);
        for (std::size_t i = n; i-- > 0;) {
            const double step = inverse_x_[i] - inverse_x_[n];
            above_[i] = (above_[i] - above_[i + 1]) / step;
            below_[i] = (below_[i] - below_[i + 1]) / step;
        }
        const double limit = above_[0] / below_[0];
        // Two steps in a row have to agree: one alone can do so by chance.
        const double change = std::fabs(limit - limit_);
        const double both = std::fmax(change, change_);
        limit_ = limit;
        change_ = change;
        if (std::isfinite(limit) && n >= 2 && both < error) {
            best = limit;
            error = both;
        }
    }

    double best = 0, error = std::numeric_limits<double>::infinity();

private:
    std::vector<double> inverse_x_, above_, below_;
    double limit_ = 0, change_ = std::numeric_limits<double>::infinity();
};

}  // namespace

std::vector<HankelResult> inverse_hankel(const HankelPair& transform, std::span<const double> radii) {
    std::map<int, Panel> shared;  // by the binary exponent of the octave's lower end
    std::vector<HankelResult> results;
    results.reserve(radii.size());
    for (const double asked : radii) {
        const double r = std::clamp(asked, 1e-100, 1e100);
        Sum sum;
        const double first_zero = zero_of_j0(1) / r;
        // 2^top is the last power of two at or below the first zero.
        const int top = std::ilogb(first_zero), bottom = top - octaves;
        sum.add(sample(transform, 0, std::ldexp(1.0, bottom)), r);
        int faded = 0;  // octaves in a row that no longer count: F has decayed
        for (int k = bottom; k < top && faded < 3; ++k) {
            auto place = shared.find(k);
            if (place == shared.end())
                place = shared.emplace(k, sample(transform, std::ldexp(1.0, k), std::ldexp(1.0, k + 1))).first;
            const Pair part = sum.add(place->second, r);
            bool counts = false;
            for (int c = 0; c < 2; ++c)
                counts = counts || std::fabs(part[c]) > 0.01 * rounding * sum.magnitude[c];
            faded = counts ? 0 : faded + 1;
        }

        std::array<Extrapolation, 2> tail;
        Pair best = sum.value, left{};
        if (faded < 3) {
            sum.add(sample(transform, std::ldexp(1.0, top), first_zero), r);
            std::array<bool, 2> done{};
            for (int k = 1; k <= max_half_waves && !(done[0] && done[1]); ++k) {
                const double from = zero_of_j0(k), to = zero_of_j0(k + 1);
                const Pair before = sum.value;
                const Pair part = sum.add(sample(transform, from / r, to / r), r);
                for (int c = 0; c < 2; ++c) {
                    if (done[c])
                        continue;
                    if (std::fabs(part[c]) <= 0.01 * rounding * sum.magnitude[c]) {
                        // Nothing left to sum: F has decayed by itself.
                        best[c] = sum.value[c];
                        left[c] = std::fabs(part[c]);
                        done[c] = true;
                        continue;
                    }
                    tail[c].add(from, before[c], part[c]);
                    best[c] = tail[c].best;
                    left[c] = tail[c].error;
                    done[c] = left[c] <= std::fmax(wanted * std::fabs(best[c]), rounding * sum.magnitude[c]);
                }
            }
        }
        HankelResult result{};
        for (int c = 0; c < 2; ++c) {
            result.value[c] = best[c] / (2 * std::numbers::pi);
            result.error[c] = (left[c] + sum.error[c] + 8 * rounding * sum.magnitude[c]) / (2 * std::numbers::pi);
        }
        results.push_back(result);
    }
    return results;
}

}  // namespace sanguine
