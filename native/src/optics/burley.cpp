#include "sanguine/burley.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include <Eigen/Dense>

#include "vector_math.hpp"

namespace sanguine {
namespace {

using vector_math::exp_minus;

/// ln(d / characteristic radius) where the widths start and are held, widest lobe first. Found by trial over 600 skins:
/// other ladders that reach from the epidermis to the dermis do as well to a few tenths of a percent.
constexpr double start[max_lobes] = {-0.5, -1.2, -2.2, -3.2};

/// Penalty per squared ln(d / start), against squared errors in shares of the energy. Ten times less gains 0.5 %
/// (absolute) of L1 error and lets undetermined widths run; ten times more loses 2 %.
constexpr double stiffness = 3e-4;

/// Weight of the mean radius among the residuals. The light inside a shadow's edge, all depths together, is the mean
/// radius over pi: this is what an eye sees of a profile. 0.3 lets it count like an error of some percent in a ring.
constexpr double moment_weight = 0.3;

/// Mean radius of a lobe over d. It is 2.5, but Cycles cuts a lobe at 16 d, where 0.36 % of its energy is left.
constexpr double lobe_mean_radius = 2.431;

constexpr int iterations = 12;
constexpr double max_step = 0.5;   // of ln d
constexpr double converged = 1e-3; // of ln d: a step below this is the last

/// Below this share of the light that a channel gains, what it keeps after its losses is rounding.
constexpr double least_share = 1e-6;

using Vector = std::array<double, max_lobes>;

/// One value per ring and one for the mean radius, padded with zeros to whole blocks.
class Residuals {
public:
    static constexpr std::size_t block = 8;
    explicit Residuals(std::size_t count = 0) : values_((count + block - 1) / block * block) {}

    double* data() { return values_.data(); }
    const double* data() const { return values_.data(); }
    std::size_t padded() const { return values_.size(); }
    double& operator[](std::size_t i) { return values_[i]; }
    double operator[](std::size_t i) const { return values_[i]; }

private:
    std::vector<double> values_;
};

typedef double Block __attribute__((vector_size(64), aligned(8), may_alias));
static_assert(sizeof(Block) == Residuals::block * sizeof(double));

SANGUINE_VECTOR_CLONES
double dot(const double* a, const double* b, std::size_t count) {
    Block sum{};
    for (std::size_t i = 0; i < count; i += Residuals::block)
        sum += *reinterpret_cast<const Block*>(a + i) * *reinterpret_cast<const Block*>(b + i);
    return ((sum[0] + sum[4]) + (sum[1] + sum[5])) + ((sum[2] + sum[6]) + (sum[3] + sum[7]));
}

double dot(const Residuals& a, const Residuals& b) {
    return dot(a.data(), b.data(), a.padded());
}

/// Energy of a lobe within each edge, and its derivative by ln d.
SANGUINE_VECTOR_CLONES
void lobe_energy(const double* edges, std::size_t count, double per_d, double* within, double* slope) {
    for (std::size_t i = 0; i < count; ++i) {
        const double y = edges[i] * per_d, narrow = exp_minus(y), cube = narrow * narrow * narrow;
        within[i] = 1 - 0.25 * cube - 0.75 * narrow;
        slope[i] = -0.75 * y * (cube + narrow);
    }
}

/// Energy between neighbouring edges, in place.
void difference(double* within, std::size_t count) {
    for (std::size_t i = count; i-- > 1;)
        within[i] -= within[i - 1];
}

/// The fit of one channel. Energies are in shares of their total, so weights add up to 1.
class Fitter {
public:
    /// `mean_radius`: of the profile, where it is to be kept; 0 where not.
    Fitter(std::span<const double> energy, double total, std::span<const double> edges, double mean_radius, int count)
        : share_(edges.size() + 1), edges_(edges), mean_radius_(mean_radius), count_(count), residual_(share_) {
        for (std::size_t i = 0; i < edges_.size(); ++i)
            share_[i] = energy[i] / total;
        // The last residual is that of the mean radius.
        share_[edges_.size()] = mean_radius_ > 0 ? moment_weight : 0;
        for (int k = 0; k < count_; ++k)
            lobes_[k] = slopes_[k] = derivatives_[k] = Residuals(edges_.size() + 1);
    }

    /// Best widths from `log_d`, which is also where they are held.
    Vector fit(Vector log_d) {
        const Vector held = log_d;
        set_lobes(log_d);
        double cost = evaluate() + penalty(log_d, held);
        double damping = 1e-3;
        for (int i = 0; i < iterations; ++i) {
            differentiate();
            Eigen::Matrix<double, max_lobes, max_lobes> normal = decltype(normal)::Identity();
            Eigen::Matrix<double, max_lobes, 1> downhill = decltype(downhill)::Zero();
            double trace = 0;
            for (int k = 0; k < count_; ++k) {
                for (int l = 0; l <= k; ++l)
                    normal(k, l) = normal(l, k) = dot(derivatives_[k], derivatives_[l]);
                normal(k, k) += stiffness;
                trace += normal(k, k);
                downhill[k] = -dot(derivatives_[k], residual_) - stiffness * (log_d[k] - held[k]);
            }
            normal.diagonal().array() += damping * trace;
            const Eigen::Matrix<double, max_lobes, 1> step = normal.ldlt().solve(downhill);
            if (!step.allFinite())
                break;

            Vector trial = log_d;
            double largest = 0;
            for (int k = 0; k < count_; ++k) {
                largest = std::fmax(largest, std::fabs(step[k]));
                trial[k] += std::clamp(step[k], -max_step, max_step);
            }
            const Best before = best_;
            set_lobes(trial);
            const double trial_cost = evaluate() + penalty(trial, held);
            if (trial_cost < cost) {
                log_d = trial;
                cost = trial_cost;
                damping *= 0.3;
                if (largest < converged)
                    break;
            } else {
                set_lobes(log_d);
                best_ = before;
                set_residual();
                damping *= 5;
                if (largest < converged)
                    break;
            }
        }
        return log_d;
    }

    const Vector& weights() const { return best_.weight; }

    double l1_error() const {
        double sum = 0;
        for (std::size_t i = 0; i < edges_.size(); ++i)
            sum += std::fabs(residual_[i]);
        return sum;
    }

private:
    /// Optimality conditions of the weights in a set of lobes that may be above 0, and of their sum: one row per lobe
    /// (identity outside of the set) and the last for the sum.
    using Conditions = Eigen::Matrix<double, max_lobes + 1, max_lobes + 1>;
    using Column = Eigen::Matrix<double, max_lobes + 1, 1>;

    struct Best {
        Vector weight{};
        int set = 0;
    };

    double penalty(const Vector& log_d, const Vector& held) const {
        double sum = 0;
        for (int k = 0; k < count_; ++k)
            sum += (log_d[k] - held[k]) * (log_d[k] - held[k]);
        return stiffness * sum;
    }

    /// Energies of the lobes in each ring, their derivatives by ln d, and their products.
    void set_lobes(const Vector& log_d) {
        const std::size_t n = edges_.size();
        for (int k = 0; k < count_; ++k) {
            const double d = std::exp(log_d[k]);
            lobe_energy(edges_.data(), n, 1 / (3 * d), lobes_[k].data(), slopes_[k].data());
            difference(lobes_[k].data(), n);
            difference(slopes_[k].data(), n);
            lobes_[k][n] = slopes_[k][n] = mean_radius_ > 0 ? moment_weight * lobe_mean_radius * d / mean_radius_ : 0;
        }
        for (int k = 0; k < count_; ++k) {
            for (int l = 0; l <= k; ++l)
                gram_[k][l] = gram_[l][k] = dot(lobes_[k], lobes_[l]);
            gram_[k][k] *= 1 + 1e-9;  // two equal lobes share their weight instead of dividing by zero
            target_[k] = dot(lobes_[k], share_);
        }
    }

    Conditions conditions(int set) const {
        Conditions out = Conditions::Identity();
        out(max_lobes, max_lobes) = 0;
        for (int k = 0; k < count_; ++k) {
            if (!(set >> k & 1))
                continue;
            for (int l = 0; l < count_; ++l)
                if (set >> l & 1)
                    out(k, l) = gram_[k][l];
            out(k, max_lobes) = out(max_lobes, k) = 1;
        }
        return out;
    }

    /// Weights >= 0 that add up to 1 and are nearest to the profile: the best of the stationary points of all sets of
    /// lobes that may be above 0, at most 15; that of all lobes together, where it is one, cannot be beaten. Returns
    /// the squared error and leaves `residual_` = lobes - profile.
    double evaluate() {
        double least = INFINITY;
        const int all = (1 << count_) - 1;
        for (int set = all; set > 0; --set) {
            Column right = Column::Zero();
            for (int k = 0; k < count_; ++k)
                if (set >> k & 1)
                    right[k] = target_[k];
            right[max_lobes] = 1;
            const Column w = conditions(set).partialPivLu().solve(right);
            if (!w.allFinite() || w.head<max_lobes>().minCoeff() < 0)
                continue;
            double cost = 0;  // less the constant |profile|^2
            for (int k = 0; k < count_; ++k) {
                for (int l = 0; l < count_; ++l)
                    cost += w[k] * w[l] * gram_[k][l];
                cost -= 2 * w[k] * target_[k];
            }
            if (cost < least) {
                least = cost;
                best_.set = set;
                for (int k = 0; k < count_; ++k)
                    best_.weight[k] = w[k];
            }
            if (set == all)
                break;
        }
        set_residual();
        return dot(residual_, residual_);
    }

    void set_residual() {
        for (std::size_t i = 0; i < share_.padded(); ++i)
            residual_[i] = -share_[i];
        for (int k = 0; k < count_; ++k)
            add(residual_, best_.weight[k], lobes_[k]);
    }

    static void add(Residuals& to, double factor, const Residuals& what) {
        double* out = to.data();
        const double* in = what.data();
        for (std::size_t i = 0; i < to.padded(); ++i)
            out[i] += factor * in[i];
    }

    /// Derivatives of the residual by ln d with the weights following (variable projection, Golub and Pereyra 1973):
    /// those of the weights solve the differentiated conditions of optimality.
    void differentiate() {
        const auto solver = conditions(best_.set).partialPivLu();
        for (int k = 0; k < count_; ++k) {
            for (std::size_t i = 0; i < share_.padded(); ++i)
                derivatives_[k][i] = 0;
            if (!(best_.set >> k & 1))
                continue;
            Column right = Column::Zero();
            for (int l = 0; l < count_; ++l)
                if (best_.set >> l & 1)
                    right[l] = -best_.weight[k] * dot(lobes_[l], slopes_[k]);
            right[k] -= dot(slopes_[k], residual_);
            const Column change = solver.solve(right);
            add(derivatives_[k], best_.weight[k], slopes_[k]);
            for (int l = 0; l < count_; ++l)
                if (best_.set >> l & 1)
                    add(derivatives_[k], change[l], lobes_[l]);
        }
    }

    Residuals share_;
    std::span<const double> edges_;
    double mean_radius_;
    int count_;
    std::array<Residuals, max_lobes> lobes_, slopes_, derivatives_;
    Residuals residual_;
    std::array<std::array<double, max_lobes>, max_lobes> gram_{};
    Vector target_{};
    Best best_;
};

}  // namespace

double burley_energy_within(double r, double d) {
    const double narrow = std::exp(-r / (3 * d));
    return 1 - 0.25 * narrow * narrow * narrow - 0.75 * narrow;
}

BurleyFit fit_burley(std::span<const double> energy, std::span<const double> edges_mm, int count) {
    double total = 0, positive = 0, log_radius = 0, moment = 0, positive_moment = 0;
    for (std::size_t i = 0; i < energy.size(); ++i) {
        const double middle = i == 0 ? edges_mm[0] / 2 : std::sqrt(edges_mm[i - 1] * edges_mm[i]);
        total += energy[i];
        moment += energy[i] * middle;
        if (energy[i] <= 0)
            continue;
        positive += energy[i];
        positive_moment += energy[i] * middle;
        log_radius += energy[i] * std::log(middle);
    }
    if (!std::isfinite(total) || !std::isfinite(positive))
        throw std::invalid_argument("energy: the rings do not add up to a finite number");
    const double centre = positive > 0 ? log_radius / positive : 0;
    Vector log_d{};
    for (int k = 0; k < count; ++k)
        log_d[k] = centre + start[k];

    BurleyFit fit;
    if (total > least_share * positive && std::isnormal(total)) {
        // Where negative light far out takes most of the moment away, non-negative lobes cannot have it.
        const bool reachable = moment > 0.9 * positive_moment;
        Fitter fitter(energy, total, edges_mm, reachable ? moment / total : 0, count);
        log_d = fitter.fit(log_d);
        double sum = 0;
        for (int k = 0; k < count; ++k)
            sum += fitter.weights()[k];
        for (int k = 0; k < count; ++k)
            fit.weight[k] = total * fitter.weights()[k] / sum;
        fit.clamped = (positive - total) / total;
        fit.fit_error = fitter.l1_error();
    } else {
        // Hardly any light is left: there is no shape to follow, but what there is must not be lost.
        fit.weight[0] = std::isfinite(total) ? std::fmax(0.0, total) : 0;
        fit.clamped = fit.fit_error = 1;
    }
    for (int k = 0; k < count; ++k)
        fit.d_mm[k] = std::exp(log_d[k]);
    return fit;
}

std::vector<SkinLobes> skin_lobes(std::span<const SkinParameters> skins, const Matrix3& rgb, int lobe_count,
                                  int threads, const Progress& progress) {
    if (lobe_count < 1 || lobe_count > max_lobes)
        throw std::invalid_argument("lobe_count: " + std::to_string(lobe_count) + " is outside 1 to "
                                    + std::to_string(max_lobes));
    // One bar for both passes, which take about as long.
    const auto half = [&](std::size_t pass) {
        return progress ? Progress([&progress, pass](std::size_t done, std::size_t total) {
            return progress(pass * total + done, 2 * total);
        }) : Progress();
    };
    const std::vector<RgbRings> rings = rgb_rings(skins, rgb, threads, half(0));
    const std::span<const double> edges = rgb_ring_edges_mm();
    std::vector<SkinLobes> out(skins.size());
    parallel_for(skins.size(), threads, half(1), [&](std::size_t i) {
        std::vector<double> energy(edges.size());
        for (int c = 0; c < 3; ++c) {
            out[i].rgb[c] = 0;
            for (std::size_t k = 0; k < energy.size(); ++k)
                out[i].rgb[c] += energy[k] = rings[i][k][c];
            out[i].channel[c] = fit_burley(energy, edges, lobe_count);
        }
    });
    return out;
}

}  // namespace sanguine
