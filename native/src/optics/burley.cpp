#include "sanguine/burley.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include <Eigen/Dense>

namespace sanguine {
namespace {

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
constexpr double difference = 1e-3;  // of ln d, for derivatives
constexpr double max_step = 0.5;     // of ln d
constexpr double converged = 1e-3;   // of ln d: a step below this is the last

using Vector = std::array<double, max_lobes>;
/// Small systems without a heap: at most one row per lobe and one for the energy.
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, max_lobes + 1, max_lobes + 1>;
using Column = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_lobes + 1, 1>;

/// The fit of one channel. Energies are in shares of their total, so weights add up to 1.
class Fitter {
public:
    /// `mean_radius`: of the profile, where it is to be kept; 0 where not.
    Fitter(std::vector<double> share, std::span<const double> edges, double mean_radius, int count)
        : share_(std::move(share)), edges_(edges), mean_radius_(mean_radius), count_(count) {
        share_.push_back(mean_radius_ > 0 ? moment_weight : 0);  // the last residual is that of the mean radius
        for (auto& lobe : lobes_)
            lobe.resize(share_.size());
        for (auto& derivative : derivatives_)
            derivative.resize(share_.size());
        residual_.resize(share_.size());
    }

    /// Best widths from `log_d`, which is also where they are held.
    Vector fit(Vector log_d) {
        const Vector held = log_d;
        for (int k = 0; k < count_; ++k)
            set_lobe(k, log_d[k]);
        double cost = evaluate(residual_) + penalty(log_d, held);
        double damping = 1e-3;
        std::vector<double> trial_residual(share_.size());
        for (int i = 0; i < iterations; ++i) {
            differentiate(log_d);
            Matrix normal(count_, count_);
            Column downhill(count_);
            for (int k = 0; k < count_; ++k) {
                for (int l = 0; l < count_; ++l)
                    normal(k, l) = dot(derivatives_[k], derivatives_[l]);
                downhill[k] = -dot(derivatives_[k], residual_) - stiffness * (log_d[k] - held[k]);
            }
            normal.diagonal().array() += stiffness;
            normal.diagonal().array() += damping * normal.trace();
            const Column step = normal.ldlt().solve(downhill);
            if (!step.allFinite())
                break;

            Vector trial = log_d;
            double largest = 0;
            for (int k = 0; k < count_; ++k) {
                largest = std::fmax(largest, std::fabs(step[k]));
                trial[k] += std::clamp(step[k], -max_step, max_step);
                set_lobe(k, trial[k]);
            }
            const double trial_cost = evaluate(trial_residual) + penalty(trial, held);
            if (trial_cost < cost) {
                log_d = trial;
                cost = trial_cost;
                residual_.swap(trial_residual);
                damping *= 0.3;
            } else {
                for (int k = 0; k < count_; ++k)
                    set_lobe(k, log_d[k]);
                damping *= 5;
            }
            if (largest < converged)
                break;
        }
        evaluate(residual_);  // leaves the weights of the widths that are returned
        return log_d;
    }

    const Vector& weights() const { return weights_; }

    double l1_error() const {
        double sum = 0;
        for (std::size_t i = 0; i < edges_.size(); ++i)
            sum += std::fabs(residual_[i]);
        return sum;
    }

private:
    static double dot(const std::vector<double>& a, const std::vector<double>& b) {
        double sum = 0;
        for (std::size_t i = 0; i < a.size(); ++i)
            sum += a[i] * b[i];
        return sum;
    }

    double penalty(const Vector& log_d, const Vector& held) const {
        double sum = 0;
        for (int k = 0; k < count_; ++k)
            sum += (log_d[k] - held[k]) * (log_d[k] - held[k]);
        return stiffness * sum;
    }

    /// Energy of lobe `k` in each ring, and its products with everything else.
    void set_lobe(int k, double log_d) {
        const double d = std::exp(log_d);
        double inside = 0;
        for (std::size_t i = 0; i < edges_.size(); ++i) {
            const double within = burley_energy_within(edges_[i], d);
            lobes_[k][i] = within - inside;
            inside = within;
        }
        lobes_[k].back() = mean_radius_ > 0 ? moment_weight * lobe_mean_radius * d / mean_radius_ : 0;
        for (int l = 0; l < count_; ++l)
            gram_[k][l] = gram_[l][k] = dot(lobes_[k], lobes_[l]);
        gram_[k][k] *= 1 + 1e-9;  // two equal lobes share their weight instead of dividing by zero
        target_[k] = dot(lobes_[k], share_);
    }

    /// Weights >= 0 that add up to 1 and are nearest to the profile: the best of the stationary points of all sets of
    /// lobes that may be above 0, at most 15. Returns the squared error, with `residual` = lobes - profile.
    double evaluate(std::vector<double>& residual) {
        double best = INFINITY;
        for (int set = 1; set < 1 << count_; ++set) {
            int member[max_lobes], size = 0;
            for (int k = 0; k < count_; ++k)
                if (set >> k & 1)
                    member[size++] = k;
            Matrix kkt = Matrix::Zero(size + 1, size + 1);
            Column right(size + 1);
            for (int i = 0; i < size; ++i) {
                for (int j = 0; j < size; ++j)
                    kkt(i, j) = gram_[member[i]][member[j]];
                kkt(i, size) = kkt(size, i) = 1;
                right[i] = target_[member[i]];
            }
            right[size] = 1;
            const Column w = kkt.partialPivLu().solve(right);
            if (!w.allFinite() || w.head(size).minCoeff() < 0)
                continue;
            double cost = 0;  // less the constant |profile|^2
            for (int i = 0; i < size; ++i) {
                for (int j = 0; j < size; ++j)
                    cost += w[i] * w[j] * gram_[member[i]][member[j]];
                cost -= 2 * w[i] * target_[member[i]];
            }
            if (cost < best) {
                best = cost;
                weights_ = {};
                for (int i = 0; i < size; ++i)
                    weights_[member[i]] = w[i];
            }
        }
        for (std::size_t i = 0; i < share_.size(); ++i) {
            residual[i] = -share_[i];
            for (int k = 0; k < count_; ++k)
                residual[i] += weights_[k] * lobes_[k][i];
        }
        return dot(residual, residual);
    }

    /// Derivatives of the residual by ln d with the weights following (variable projection, Golub and Pereyra 1973).
    void differentiate(const Vector& log_d) {
        for (int k = 0; k < count_; ++k) {
            set_lobe(k, log_d[k] + difference);
            evaluate(derivatives_[k]);
            for (std::size_t i = 0; i < share_.size(); ++i)
                derivatives_[k][i] = (derivatives_[k][i] - residual_[i]) / difference;
            set_lobe(k, log_d[k]);
        }
    }

    std::vector<double> share_;
    std::span<const double> edges_;
    double mean_radius_;
    int count_;
    std::array<std::vector<double>, max_lobes> lobes_, derivatives_;
    std::vector<double> residual_;
    std::array<std::array<double, max_lobes>, max_lobes> gram_{};
    Vector target_{}, weights_{};
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
    const double centre = positive > 0 ? log_radius / positive : 0;
    Vector log_d{};
    for (int k = 0; k < count; ++k)
        log_d[k] = centre + start[k];

    BurleyFit fit;
    if (total > 0) {
        std::vector<double> share(energy.begin(), energy.end());
        for (double& e : share)
            e /= total;
        // Where negative light far out takes most of the moment away, non-negative lobes cannot have it.
        const bool reachable = moment > 0.9 * positive_moment;
        Fitter fitter(std::move(share), edges_mm, reachable ? moment / total : 0, count);
        log_d = fitter.fit(log_d);
        for (int k = 0; k < count; ++k)
            fit.weight[k] = total * fitter.weights()[k];
        fit.clamped = (positive - total) / total;
        fit.fit_error = fitter.l1_error();
    } else {
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
