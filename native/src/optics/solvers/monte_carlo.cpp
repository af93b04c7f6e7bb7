#include "sanguine/monte_carlo.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <chrono>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "message.hpp"
#include "sanguine/fresnel.hpp"
#include "sanguine/photon_tracer.hpp"
#include "sanguine/unscattered.hpp"

namespace sanguine {
namespace {

constexpr std::uint64_t batch_photons = 1024;

/// Rings are kept within these, 2,550 of them [mm].
constexpr double nearest = 1e-12, farthest = 1e12;

/// Sums of a tally over photons: the weight and its square.
struct Sum {
    double weight = 0, square = 0;

    void add(double w) {
        weight += w;
        square += w * w;
    }
    Sum& operator+=(const Sum& other) {
        weight += other.weight;
        square += other.square;
        return *this;
    }
    Estimate estimate(std::uint64_t photons) const {
        if (photons == 0)
            return {};
        const double n = static_cast<double>(photons), mean = weight / n;
        return {mean, std::sqrt(std::fmax(0.0, square / n - mean * mean) / std::fmax(1.0, n - 1))};
    }
};

/// What some photons left; added up in the order of the photons, the same on any number of threads.
struct Ledger {
    std::uint64_t photons = 0, collisions = 0, faces = 0;
    Sum Rd, R_unscattered, Tt, Tt_scattered, cut;
    std::vector<Sum> R_rings, T_rings;

    Ledger() = default;
    explicit Ledger(std::size_t rings) : R_rings(rings), T_rings(rings) {}

    void add(const WeightedEnd& end, const RadialRings* rings) {
        const bool top = end.exit == WeightedEnd::Exit::top, bottom = end.exit == WeightedEnd::Exit::bottom;
        ++photons;
        collisions += end.collisions;
        faces += end.faces;
        R_unscattered.add(end.unscattered_top);
        Tt.add(end.unscattered_bottom + (bottom ? end.weight : 0));
        if (top)
            Rd.add(end.weight);
        if (bottom)
            Tt_scattered.add(end.weight);
        if (end.exit == WeightedEnd::Exit::cut)
            cut.add(end.weight);
        if (rings && (top || bottom))
            (top ? R_rings : T_rings)[rings->index(end.radius_squared)].add(end.weight);
    }

    Ledger& operator+=(const Ledger& other) {
        photons += other.photons;
        collisions += other.collisions;
        faces += other.faces;
        Rd += other.Rd;
        R_unscattered += other.R_unscattered;
        Tt += other.Tt;
        Tt_scattered += other.Tt_scattered;
        cut += other.cut;
        for (std::size_t i = 0; i < R_rings.size(); ++i) {
            R_rings[i] += other.R_rings[i];
            T_rings[i] += other.T_rings[i];
        }
        return *this;
    }

    Tallies tallies(double specular) const {
        Tallies t{photons, collisions, faces, specular, Rd.estimate(photons), R_unscattered.estimate(photons),
                  Tt.estimate(photons), Tt_scattered.estimate(photons), cut.estimate(photons), {}, {}};
        for (const Sum& sum : R_rings)
            t.R_rings.push_back(sum.estimate(photons));
        for (const Sum& sum : T_rings)
            t.T_rings.push_back(sum.estimate(photons));
        return t;
    }
};

/// A run of photons that can be continued.
class Run {
public:
    Run(std::span<const Layer> stack, Incidence incidence, std::uint64_t seed, int threads, const RadialRings* rings,
        std::uint32_t max_steps)
        : walk_(stack, incidence, max_steps), specular_(surface_reflectance(stack[0].n, incidence)), seed_(seed),
          threads_(threads), rings_(rings), sum_(rings ? rings->size() : 0) {}

    using Clock = std::chrono::steady_clock;

    /// Traces the photons up to `target`; `expected` is what the progress is measured against. False if the deadline
    /// came first: then only some of them are in.
    bool continue_to(std::uint64_t target, std::uint64_t expected, Clock::time_point deadline,
                     const Progress& progress) {
        constexpr std::size_t most_batches = 512;  // that wait to be added up
        std::atomic<bool> stopped = false, late = false;
        while (begun_ < target && !late) {
            const std::uint64_t from = begun_;
            const std::size_t batches = std::min<std::uint64_t>(
                most_batches, (target - from + batch_photons - 1) / batch_photons);
            std::vector<Ledger> parts(batches);
            std::atomic<std::uint64_t> done = 0;
            Progress watch;
            if (progress)
                watch = [&](std::size_t, std::size_t) {
                    const std::uint64_t all = std::max(expected, target);
                    try {
                        if (!progress(std::min(from + done, all), all))
                            stopped = true;
                    } catch (...) {
                        stopped = true;  // nor are the photons under way waited for
                        throw;
                    }
                    return !stopped;
                };
            parallel_for(batches, threads_, watch, [&](std::size_t i) {
                Ledger& part = parts[i] = Ledger(sum_.R_rings.size());
                const std::uint64_t begin = from + i * batch_photons;
                const std::uint64_t end = std::min(target, begin + batch_photons);
                for (std::uint64_t p = begin; p < end; ++p) {
                    if (p % 8 == 0 && (stopped || late || (deadline != Clock::time_point::max()
                                                           && Clock::now() > deadline))) {
                        late = late || !stopped;
                        break;
                    }
                    part.add(walk_.trace(seed_, p), rings_);
                }
                done += end - begin;
            });
            if (stopped)
                throw Cancelled();
            for (const Ledger& part : parts)
                if (part.photons > 0)
                    sum_ += part;
            begun_ = std::min(target, from + batches * batch_photons);
        }
        return !late;
    }

    Tallies tallies() const { return sum_.tallies(specular_); }

private:
    WeightedWalk walk_;
    double specular_;
    std::uint64_t seed_;
    int threads_;
    const RadialRings* rings_;
    std::uint64_t begun_ = 0;
    Ledger sum_;
};

/// Steps of one photon, by default and where nothing absorbs above a scattering half-space: there a walk has no expected
/// end, but all of the light comes back, and what is cut off only lacks its place in the profile, hundreds of mean free
/// paths away.
constexpr std::uint32_t max_steps = WeightedWalk::default_max_steps, max_steps_conservative = 1u << 16;

bool returns_all(std::span<const Layer> stack) {
    const Layer& last = stack.back();
    return std::isinf(last.thickness) && last.mu_s > 0
        && std::all_of(stack.begin(), stack.end(), [](const Layer& layer) { return layer.mu_a == 0; });
}

/// The free path of less is beyond the range of a double.
constexpr double least_rate_per_mm = 1e-300;

/// Shares below this one are held to its absolute error: a relative one would need 1 / share photons for light that no
/// picture shows.
constexpr double small_share = 1e-3;

/// Three standard errors: of a hundred stacks solved to a tolerance, all are expected within it.
double relative_error(const Estimate& share) {
    return 3 * share.standard_error / std::fmax(share.mean, small_share);
}

/// Light that few photons or none have found may still be there: one photon more or less is the least error.
Estimate at_least_one_photon(Estimate share, std::uint64_t photons) {
    share.standard_error = std::fmax(share.standard_error, 1.0 / photons);
    return share;
}

/// Expected L1 error of a profile: mean absolute deviation sqrt(2 / pi) sigma of each window, over what they hold; that
/// of one photon at least, where there may be any.
double relative_noise(std::span<const RadialDensity> profile, bool any, std::uint64_t photons) {
    double energy = 0, deviation = 0;
    for (const RadialDensity& d : profile) {
        energy += d.window_energy;
        deviation += std::sqrt(2 / std::numbers::pi * d.window_variance);
    }
    if (any)
        deviation = std::fmax(deviation, 1.0 / photons);
    return deviation / std::fmax(energy, small_share);
}

std::vector<double> densities(std::span<const RadialDensity> profile, double scale) {
    std::vector<double> result;
    for (const RadialDensity& d : profile)
        result.push_back(scale * d.per_mm2);
    return result;
}

class MonteCarlo final : public Solver {
public:
    std::string_view id() const override { return "monte-carlo"; }

    std::string_view summary() const override {
        return "photons traced until the tolerance is reached: any stack, no approximation, errors known; slow";
    }

    std::string unsuited(const Problem& problem) const override {
        const Layer& last = problem.layers.back();
        const double rate = last.mu_a + last.mu_s;
        if (std::isinf(last.thickness) && rate > 0 && rate < least_rate_per_mm)
            return message("layers.", problem.layers.size() - 1, ": mu_a + mu_s is ", rate, ", whose free path is beyond ",
                           "the range of a number; at least ", least_rate_per_mm, " or 0");
        return "";
    }

    Solution solve(const Problem& problem, const Effort& effort) const override;
};

Solution MonteCarlo::solve(const Problem& problem, const Effort& effort) const {
    if (!(effort.tolerance > 0))
        throw SolverError("monte-carlo: no number of photons reaches a tolerance of 0");
    if (effort.max_photons == 0)
        throw SolverError("monte-carlo: max_photons is 0");
    const std::span<const Layer> stack = problem.layers;
    const std::span<const double> radii = problem.radii_mm;
    const bool has_bottom = !std::isinf(stack.back().thickness);
    const bool all_returns = returns_all(stack);
    const bool scatters = std::any_of(stack.begin(), stack.end(), [](const Layer& layer) { return layer.mu_s > 0; });

    const bool keeps_all =
        (all_returns || has_bottom)
        && std::all_of(stack.begin(), stack.end(), [](const Layer& layer) { return layer.mu_a == 0; });
    const UnscatteredLight light = unscattered(stack, problem.incidence);

    // A window may reach 1.25^1.5 beyond a radius.
    RadialRings rings(1, 1);
    if (!radii.empty())
        rings = RadialRings(std::fmin(radii.front() / 1.5, farthest), std::fmin(radii.back() * 1.5, farthest));
    Run run(stack, problem.incidence, effort.seed, effort.threads, radii.empty() ? nullptr : &rings,
            all_returns ? max_steps_conservative : max_steps);
    const double seconds = std::clamp(effort.max_seconds, 0.0, 1e9);
    const Run::Clock::time_point deadline =
        Run::Clock::now() + std::chrono::duration_cast<Run::Clock::duration>(std::chrono::duration<double>(seconds));

    // Rounds: each aims at the photons that the errors so far ask for, and at most four times as many as there are.
    constexpr std::uint64_t first_round = 16 * batch_photons;
    std::uint64_t target = std::min(first_round, effort.max_photons);
    Tallies t;
    std::vector<RadialDensity> top, bottom;
    double kept, totals_error, profile_error, expected = 4.0 * first_round;
    bool in_time;
    for (;;) {
        in_time = run.continue_to(target, static_cast<std::uint64_t>(std::fmin(expected, effort.max_photons)), deadline,
                                  effort.progress);
        t = run.tallies();
        // What never scattered is known exactly, and with it what there is to share: all of it leaves where nothing
        // absorbs, at most all of it elsewhere. The sampled shares are off by their noise alone.
        const double out = t.Rd.mean + t.Tt_scattered.mean;
        kept = out > light.scattered ? light.scattered / out : 1;
        if (keeps_all && out > 0)
            kept = light.scattered / (out + t.cut.mean);
        t.Rd.mean = kept * (t.Rd.mean + (all_returns ? t.cut.mean : 0));
        t.Tt = {light.transmitted + kept * t.Tt_scattered.mean, t.Tt_scattered.standard_error};
        if (all_returns) {
            t.Rd.standard_error = 0;
        } else if (scatters) {
            t.Rd = at_least_one_photon(t.Rd, t.photons);
            t.Tt = at_least_one_photon(t.Tt, t.photons);
        }
        top = radial_density(rings, t.R_rings, radii);
        if (has_bottom)
            bottom = radial_density(rings, t.T_rings, radii);
        totals_error = profile_error = 0;
        if (!effort.profile_alone)
            totals_error = std::fmax(relative_error(t.Rd), has_bottom ? relative_error(t.Tt) : 0);
        if (!radii.empty())
            profile_error = std::fmax(relative_noise(top, scatters, t.photons),
                                      has_bottom ? relative_noise(bottom, scatters, t.photons) : 0);
        const double excess = std::fmax(totals_error, profile_error / 2) / effort.tolerance;
        if (!in_time || excess <= 1 || target >= effort.max_photons)
            break;
        expected = std::fmin(1.1 * excess * excess * target, 1e19);
        const std::uint64_t next = std::min(static_cast<std::uint64_t>(expected), 4 * target);
        target = std::min(effort.max_photons, (next + batch_photons - 1) / batch_photons * batch_photons);
    }
    if (t.photons == 0)
        throw SolverError("monte-carlo: max_seconds ended before the first photon");

    Solution s;
    s.solver = id();
    s.Rd = t.Rd.mean;
    s.R_unscattered = light.reflected;
    s.Tt = has_bottom ? t.Tt.mean : 0;
    s.specular = light.specular;
    s.R_per_mm2 = densities(top, kept);
    if (has_bottom)
        s.T_per_mm2 = densities(bottom, kept);
    // Cut light would have been absorbed, or left somewhere: all of it may be missing.
    const double cut = t.cut.mean / std::fmax(t.Rd.mean, small_share);
    s.error_estimate = std::fmax(totals_error + (all_returns ? 0 : cut), profile_error / 2 + (radii.empty() ? 0 : cut));

    const auto warn = [&](const auto&... parts) { s.warnings.push_back(message(parts...)); };
    if (std::fmax(totals_error, profile_error / 2) > effort.tolerance)
        warn("tolerance ", effort.tolerance, " not reached: ", in_time ? "max_photons" : "max_seconds", " ended the run at ",
             t.photons, " photons; three standard errors of the totals are ", totals_error, ", the profile's noise is ",
             profile_error);
    if (!in_time)
        warn("stopped by the clock: the seed alone does not repeat this result");
    if (t.cut.mean > 0)
        warn("a share of ", t.cut.mean, " was still inside when its photons reached the cap of ",
             all_returns ? max_steps_conservative : max_steps, " steps; ",
             all_returns ? "nothing absorbs it, so it is counted in Rd, without a place in the profile"
                         : "it is in error_estimate");
    return s;
}

}  // namespace

const Solver& monte_carlo_solver() {
    static const MonteCarlo solver;
    return solver;
}

RadialRings::RadialRings(double first_mm, double last_mm) {
    if (!(first_mm >= 0 && last_mm >= first_mm && std::isfinite(last_mm)))
        throw std::invalid_argument("radii: rings run from 0 or more to a finite radius");
    const double first = std::clamp(first_mm, nearest, farthest), last = std::clamp(last_mm, nearest, farthest);
    base_ = std::bit_cast<std::uint64_t>(first * first) >> 48;
    count_ = (std::bit_cast<std::uint64_t>(last * last) >> 48) - base_ + 3;
}

std::size_t RadialRings::index(double radius_squared) const {
    const std::uint64_t ring = std::bit_cast<std::uint64_t>(radius_squared) >> 48;  // sign 0, exponent, 4 bits
    return ring < base_ ? 0 : std::min<std::size_t>(ring - base_ + 1, count_ - 1);
}

double RadialRings::edge_mm(std::size_t i) const {
    return std::sqrt(std::bit_cast<double>((base_ + i - 1) << 48));
}

Tallies monte_carlo(std::span<const Layer> stack, Incidence incidence, std::uint64_t photons, std::uint64_t seed,
                    int threads, const RadialRings* rings, const Progress& progress, std::uint32_t max_steps) {
    Run run(stack, incidence, seed, threads, rings, max_steps);
    run.continue_to(photons, photons, Run::Clock::time_point::max(), progress);
    return run.tallies();
}

std::vector<RadialDensity> radial_density(const RadialRings& rings, std::span<const Estimate> energy,
                                          std::span<const double> radii_mm) {
    if (radii_mm.empty())
        return {};
    // Energy and variance within ln r, linear inside a ring.
    const std::size_t edges = energy.size() - 1;
    std::vector<double> log_edge(edges), within(edges), variance(edges);
    for (std::size_t i = 0; i < edges; ++i) {
        log_edge[i] = std::log(rings.edge_mm(i + 1));
        const double se = energy[i].standard_error;
        within[i] = energy[i].mean + (i > 0 ? within[i - 1] : 0);
        variance[i] = se * se + (i > 0 ? variance[i - 1] : 0);
    }
    const auto at = [&](const std::vector<double>& cumulative, double log_r) {
        const auto above = std::upper_bound(log_edge.begin(), log_edge.end(), log_r);
        if (above == log_edge.begin())
            return cumulative.front() * std::exp(log_r - log_edge.front());  // energy ~ r, as of single scattering
        if (above == log_edge.end())
            return cumulative.back();
        const std::size_t i = above - log_edge.begin();
        const double t = (log_r - log_edge[i - 1]) / (log_edge[i] - log_edge[i - 1]);
        return cumulative[i - 1] + t * (cumulative[i] - cumulative[i - 1]);
    };

    std::vector<RadialDensity> result;
    const double narrowest = std::log(1.1), widest = std::log(1.25);
    for (std::size_t k = 0; k < radii_mm.size(); ++k) {
        const double r = std::fmax(radii_mm[k], 1e-100), middle = std::log(r);
        double width = widest;
        if (k > 0)
            width = std::min(width, std::log(r / radii_mm[k - 1]));
        if (k + 1 < radii_mm.size())
            width = std::min(width, std::log(radii_mm[k + 1] / r));
        width = std::max(width, narrowest);
        const auto window = [&](const std::vector<double>& cumulative, double centre) {
            return std::fmax(0.0, at(cumulative, centre + width / 2) - at(cumulative, centre - width / 2));
        };
        RadialDensity d;
        d.window_energy = window(within, middle);
        d.window_variance = window(variance, middle);
        // Energy per ln r ~ r^b: its mean over the window is sinh(x) / x of the middle, x = b width / 2.
        double middle_to_mean = 1;
        const double below = window(within, middle - width), above = window(within, middle + width);
        if (below > 0 && above > 0) {
            const double x = std::clamp(std::log(above / below) / 4, -1.0, 1.0);
            if (x != 0)
                middle_to_mean = x / std::sinh(x);
        }
        d.per_mm2 = d.window_energy / width * middle_to_mean / (2 * std::numbers::pi * r * r);
        result.push_back(d);
    }
    return result;
}

}  // namespace sanguine
