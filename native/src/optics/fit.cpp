#include "sanguine/fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "sanguine/chromophores.hpp"
#include "sanguine/fresnel.hpp"
#include "sanguine/path_table.hpp"

namespace sanguine {
namespace {

using S = SkinParameters;

constexpr double fitted = std::numeric_limits<double>::quiet_NaN();

// Bounds are those of the schema or tighter; bench/measured_skin.py shows how measured skin lies in them.
constexpr FitParameter rows[] = {
    {"melanin", &S::melanin, FitScale::logarithm, 5e-4, 0.5, 0.03, 1.2, 3, fitted,
     "Vyas et al. 2013, table 1 (0.013-0.45), wide"},
    {"melanin_blend", &S::melanin_blend, FitScale::linear, 0, 1, 0.74, 0.02, 0.3, fitted,
     "Del Bino et al. 2015 (0.718-0.789 in every skin tone)"},
    {"hemoglobin", &S::hemoglobin, FitScale::logarithm, 5e-4, 0.25, 0.014, 0.8, 2, fitted,
     "Vyas et al. 2013, table 1 (0.002-0.07)"},
    {"oxygenation", &S::oxygenation, FitScale::logit, 0.01, 0.99, 0.72, 0.5, 2, fitted,
     "NIRS rSO2 of forehead and mandible: 0.65-0.76 typical, 0.50-0.86 range"},
    {"epidermis_thickness_mm", &S::epidermis_thickness_mm, FitScale::logarithm, 0.015, 0.5, 0.08, 0.3, 1, fitted,
     "Sandby-Moller et al. 2003, Acta Derm. Venereol. 83:410 (0.075-0.096 mm with stratum corneum)"},
    {"scatter_scale", &S::scatter_scale, FitScale::logarithm, 0.5, 2, 1.25, 0.15, 0.5, fitted,
     "spread of published skin, 4.2-6.7 per mm at 500 nm, Jacques 2013, Phys. Med. Biol. 58:R37"},
    {"scatter_power", &S::scatter_power, FitScale::linear, 0, 1.5, 0.55, 0.2, 0.6, fitted,
     "measured faces; published fits of mu_s' fall over 400-700 nm with a power of 1.0-3.0, Donner and Jensen's "
     "with 1.9"},
    {"vessel_radius_mm", &S::vessel_radius_mm, FitScale::root, 0, 0.05, 0.008, 0.02, 0.05, fitted,
     "capillaries 0.003-0.005 mm, venules of the upper plexus to 0.02"},
    {"bilirubin_umol_per_l", &S::bilirubin_umol_per_l, FitScale::root, 0, 200, 8, 0.9, 0.9, 0,
     "plasma 3-17 umol/L, Duan and Zeng 2020; held, because measured faces are fitted no better with it"},
    {"ink_per_mm", &S::ink_per_mm, FitScale::root, 0, 20, 1, 1.5, 1.5, 0,
     "a guess, any tattoo; held, because skin without one has none"},
    {"surface_reflectance", nullptr, FitScale::linear, 0.01, 0.15, 0.035, 0.006, 0.03, fitted,
     "Fresnel at normal incidence, 0.028 (n = 1.4) to 0.040 (n = 1.5): the usual 8 degrees in a sphere"},
};
constexpr std::size_t count = std::size(rows);
constexpr std::size_t surface_row = count - 1;
static_assert(rows[surface_row].field == nullptr);

double to_scale(FitScale scale, double x) {
    switch (scale) {
    case FitScale::logarithm: return std::log(x);
    case FitScale::logit: return std::log(x / (1 - x));
    case FitScale::root: return std::sqrt(x);
    case FitScale::linear: break;
    }
    return x;
}

double from_scale(FitScale scale, double u) {
    switch (scale) {
    case FitScale::logarithm: return std::exp(u);
    case FitScale::logit: return 1 / (1 + std::exp(-u));
    case FitScale::root: return u * u;
    case FitScale::linear: break;
    }
    return u;
}

/// dx/du at x.
double slope(FitScale scale, double x) {
    switch (scale) {
    case FitScale::logarithm: return x;
    case FitScale::logit: return x * (1 - x);
    case FitScale::root: return 2 * std::sqrt(x);
    case FitScale::linear: break;
    }
    return 1;
}

/// Standard deviation of x when u has that of `sd`. To second order for a root, whose slope vanishes at 0.
double spread(FitScale scale, double x, double sd) {
    const double first = slope(scale, x) * sd;
    return scale == FitScale::root ? std::sqrt(first * first + 2 * sd * sd * sd * sd) : first;
}

using Values = std::array<double, count>;
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, count, 1>;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, count, count>;

/// What all spectra of one call share.
struct Problem {
    std::vector<double> wavelengths_nm;
    std::vector<Chromophores> pure;
    Values mean, sd;                  ///< prior on u
    Values value;                     ///< its mean as the parameter's own value
    Values low, high;                 ///< bounds on u
    std::vector<std::size_t> free;    ///< rows that move
    bool specular_included;
    const PathTable& table = PathTable::embedded(Incidence::diffuse);
};

/// The skin that `x` describes.
SkinParameters skin_of(const Values& x) {
    SkinParameters skin;
    for (std::size_t i = 0; i < count; ++i)
        if (rows[i].field)
            skin.*rows[i].field = x[i];
    return skin;
}

/// What the instrument sees of skin `x` at one wavelength, and its slope by every parameter's x.
double model(const Problem& p, const Values& x, const SkinParameters& skin, const Chromophores& pure, Values* by) {
    static const double entry = 1 - diffuse_fresnel(path_grid::refractive_index);
    const OpticalCoefficients c = optical_coefficients(skin, pure);
    const double mu_s = c.mu_s_prime_epidermis, d = skin.epidermis_thickness_mm;
    const double tau = d * mu_s, a1 = c.mu_a_epidermis / mu_s, a2 = c.mu_a_dermis / mu_s;
    const double surface = x[surface_row], added = p.specular_included ? surface : 0;
    const double passes = (1 - surface) / entry;
    if (!by)
        return added + passes * p.table.total(tau, a1, a2);

    const PathTable::Gradient r = p.table.total_with_gradient(tau, a1, a2);
    const double even = std::lerp(pure.deoxyhemoglobin, pure.oxyhemoglobin, skin.oxygenation);
    const double radius = skin.vessel_radius_mm;
    // f = blood per volume, with its slopes by the absorption of whole blood and by the radius; below 1e-5 mm (no
    // vessel is so thin) the radius' slope is its limit.
    const bool packed = radius > 0;
    const double transmitted = packed ? std::exp(-2 * even * radius) : 1;
    const double f = packed ? packaged_absorption(even, radius, [](double v) { return std::expm1(v); }) : even;
    const double f_by_radius = radius > 1e-5 ? (even * transmitted - f) / radius : -even * even;

    Values& g = *by;
    const auto set = [&](double SkinParameters::*field, double value) {
        for (std::size_t i = 0; i < count; ++i)
            if (rows[i].field == field)
                g[i] = passes * value;
    };
    const double melanin = std::lerp(pure.pheomelanin, pure.eumelanin, skin.melanin_blend);
    set(&S::melanin, r.by_a1 * (melanin - pure.baseline) / mu_s);
    set(&S::melanin_blend, r.by_a1 * skin.melanin * (pure.eumelanin - pure.pheomelanin) / mu_s);
    set(&S::hemoglobin, r.by_a2 * (f - pure.baseline) / mu_s);
    set(&S::oxygenation, r.by_a2 * skin.hemoglobin * transmitted * (pure.oxyhemoglobin - pure.deoxyhemoglobin) / mu_s);
    set(&S::epidermis_thickness_mm, r.by_tau * mu_s);
    set(&S::scatter_scale, (r.by_tau * tau - r.by_a1 * a1 - r.by_a2 * a2) / skin.scatter_scale);
    set(&S::scatter_power, (r.by_tau * tau - r.by_a1 * a1 - r.by_a2 * a2) * pure.log_wavelength);
    set(&S::vessel_radius_mm, r.by_a2 * skin.hemoglobin * f_by_radius / mu_s);
    set(&S::bilirubin_umol_per_l, r.by_a2 * pure.bilirubin / mu_s);
    set(&S::ink_per_mm, r.by_a2 * pure.ink / mu_s);
    g[surface_row] = (p.specular_included ? 1 : 0) - r.total / entry;
    return added + passes * r.total;
}

/// The search for one spectrum. `u` and its gradients are those of the free parameters alone.
class Search {
public:
    Search(const Problem& problem, const double* measured)
        : p_(problem), measured_(measured), waves_(problem.pure.size()), weight_(waves_), residual_(waves_),
          trial_(waves_), fitted_(waves_) {
        for (std::size_t w = 0; w < waves_; ++w)
            weight_[w] = 1 / expected_noise(measured[w], p_.wavelengths_nm[w]);
        for (std::size_t i = 0; i < count; ++i)
            u_[i] = std::clamp(p_.mean[i], p_.low[i], p_.high[i]);
    }

    SpectrumFit run() {
        // The noise is at first unknown. Given the parameters its scale follows from the residuals, given the scale
        // the parameters from the priors and the data; a few turns settle both.
        constexpr int max_rounds = 8;
        for (int round = 0; round < max_rounds; ++round) {
            descend();
            const double before = noise_;
            estimate_noise();
            if (std::abs(std::log(noise_ / before)) < 0.05)
                break;
        }
        descend();
        return result();
    }

private:
    std::size_t free() const { return p_.free.size(); }

    double prior_cost(const Values& u) const {
        double sum = 0;
        for (const std::size_t i : p_.free)
            sum += std::pow((u[i] - p_.mean[i]) / p_.sd[i], 2);
        return sum;
    }

    Values natural(const Values& u) const {
        Values x;
        for (std::size_t i = 0; i < count; ++i)
            x[i] = p_.sd[i] > 0 ? std::clamp(from_scale(rows[i].scale, u[i]), rows[i].lower, rows[i].upper)
                                : p_.value[i];
        return x;
    }

    double misfit(const Values& u, std::vector<double>& residual) const {
        const Values x = natural(u);
        const SkinParameters skin = skin_of(x);
        double sum = 0;
        for (std::size_t w = 0; w < waves_; ++w) {
            residual[w] = (model(p_, x, skin, p_.pure[w], nullptr) - measured_[w]) * weight_[w];
            sum += residual[w] * residual[w];
        }
        return sum;
    }

    /// Residuals, their normal matrix and gradient at u_, all per expected noise.
    void linearize() {
        const Values x = natural(u_);
        const SkinParameters skin = skin_of(x);
        normal_.setZero(free(), free());
        gradient_.setZero(free());
        Vector row(free());
        Values by, dx;
        for (std::size_t i = 0; i < count; ++i)
            dx[i] = slope(rows[i].scale, x[i]);
        misfit_ = 0;
        for (std::size_t w = 0; w < waves_; ++w) {
            fitted_[w] = model(p_, x, skin, p_.pure[w], &by);
            residual_[w] = (fitted_[w] - measured_[w]) * weight_[w];
            misfit_ += residual_[w] * residual_[w];
            for (std::size_t k = 0; k < free(); ++k)
                row[k] = weight_[w] * by[p_.free[k]] * dx[p_.free[k]];
            normal_.noalias() += row * row.transpose();
            gradient_.noalias() += row * residual_[w];
        }
    }

    /// Posterior precision: the data's, at the present noise, and the prior's.
    Matrix precision(double redundancy = 1) const {
        Matrix m = normal_ / (noise_ * noise_ * redundancy);
        for (std::size_t k = 0; k < free(); ++k)
            m(k, k) += std::pow(p_.sd[p_.free[k]], -2);
        return m;
    }

    /// Levenberg-Marquardt at the present noise.
    void descend() {
        constexpr int max_iterations = 40;
        constexpr double enough = 2e-3;  // of the cost, which is twice the log posterior: 0.04 standard errors
        double damping = 1e-3;
        converged_ = false;
        linearize();
        double cost = misfit_ / (noise_ * noise_) + prior_cost(u_);
        for (int k = 0; k < max_iterations && !converged_; ++k) {
            ++iterations_;
            const Matrix curvature = precision();
            Vector g = gradient_ / (noise_ * noise_);
            for (std::size_t j = 0; j < free(); ++j)
                g[j] += (u_[p_.free[j]] - p_.mean[p_.free[j]]) / std::pow(p_.sd[p_.free[j]], 2);

            bool better = false;
            while (!better && damping < 1e6) {
                const Values next = step(curvature, g, damping);
                const double next_cost = misfit(next, trial_) / (noise_ * noise_) + prior_cost(next);
                if (next_cost <= cost) {
                    better = true;
                    converged_ = cost - next_cost < enough;
                    u_ = next;
                    cost = next_cost;
                    damping = std::max(damping / 5, 1e-9);
                } else {
                    if (next_cost - cost < enough) {  // nothing left to gain but rounding
                        converged_ = true;
                        break;
                    }
                    damping *= 8;
                }
            }
            if (!better)
                break;
            linearize();
        }
    }

    /// From u_ by one damped Gauss-Newton step inside the bounds: what stands at a bound and pushes outward stays.
    Values step(const Matrix& curvature, const Vector& g, double damping) const {
        Matrix a = curvature;
        Vector b = -g;
        for (std::size_t k = 0; k < free(); ++k) {
            const std::size_t i = p_.free[k];
            if ((u_[i] <= p_.low[i] && b[k] < 0) || (u_[i] >= p_.high[i] && b[k] > 0)) {
                a.row(k).setZero();
                a.col(k).setZero();
                a(k, k) = 1;
                b[k] = 0;
            }
            a(k, k) *= 1 + damping;
        }
        const Vector move = a.llt().solve(b);
        Values next = u_;
        for (std::size_t k = 0; k < free(); ++k) {
            const std::size_t i = p_.free[k];
            // No step beyond three standard deviations of the prior: far from the solution the model is not linear.
            const double reach = 3 * p_.sd[i];
            next[i] = std::clamp(u_[i] + std::clamp(move[k], -reach, reach), p_.low[i], p_.high[i]);
        }
        return next;
    }

    void estimate_noise() {
        // Degrees of freedom that the data spent on parameters: the trace of (posterior covariance x data precision).
        const Matrix data = normal_ / (noise_ * noise_);
        const double spent = precision().llt().solve(data).trace();
        // One weak degree of freedom at a tenth of the expected noise keeps a perfect spectrum from a noise of 0.
        constexpr double weak_variance = 0.01;
        noise_ = std::sqrt((weak_variance + misfit_) / (1 + std::max(0.0, static_cast<double>(waves_) - spent)));
    }

    /// How many samples tell as much as one independent one. What the model cannot follow is smooth, so neighbours err
    /// together: (1 + rho) / (1 - rho) for correlation rho at lag 1 (Bayley and Hammersley 1946). A rho within its own
    /// standard error counts as none.
    double redundancy() const {
        double lagged = 0;
        for (std::size_t w = 1; w < waves_; ++w)
            lagged += residual_[w] * residual_[w - 1];
        const double rho = misfit_ > 0 ? lagged / misfit_ - 1 / std::sqrt(static_cast<double>(waves_)) : 0;
        const double together = std::clamp(rho, 0.0, 0.8);
        return (1 + together) / (1 - together);
    }

    SpectrumFit result() const {
        SpectrumFit out;
        const Values x = natural(u_);
        out.skin = skin_of(x);
        out.value.assign(x.begin(), x.end());
        out.standard_error.assign(count, 0);
        out.informed.assign(count, 0);
        out.at_bound.assign(count, false);
        out.correlation.assign(count * count, 0);
        const Matrix covariance = precision(redundancy()).llt().solve(Matrix::Identity(free(), free()));
        for (std::size_t a = 0; a < free(); ++a) {
            const std::size_t i = p_.free[a];
            const double sd = std::sqrt(covariance(a, a)), width = p_.high[i] - p_.low[i];
            out.standard_error[i] = spread(rows[i].scale, x[i], sd);
            out.informed[i] = std::clamp(1 - std::pow(sd / p_.sd[i], 2), 0.0, 1.0);
            // A thousandth of the way: a root approaches 0 ever more slowly.
            out.at_bound[i] = std::min(u_[i] - p_.low[i], p_.high[i] - u_[i]) < 1e-3 * width;
            for (std::size_t b = 0; b < free(); ++b)
                out.correlation[i * count + p_.free[b]] =
                    covariance(a, b) / std::sqrt(covariance(a, a) * covariance(b, b));
        }
        out.reflectance = fitted_;
        double sum = 0;
        for (std::size_t w = 0; w < waves_; ++w)
            sum += std::pow(fitted_[w] - measured_[w], 2);
        out.rmse = std::sqrt(sum / static_cast<double>(waves_));
        out.noise = noise_;
        out.iterations = iterations_;
        out.converged = converged_;
        return out;
    }

    const Problem& p_;
    const double* measured_;
    std::size_t waves_;
    std::vector<double> weight_, residual_, trial_, fitted_;
    Values u_;
    Matrix normal_;
    Vector gradient_;
    double misfit_ = 0, noise_ = 1;
    int iterations_ = 0;
    bool converged_ = false;
};

template <class... Parts> std::invalid_argument refusal(const Parts&... parts) {
    std::ostringstream message;
    (message << ... << parts);
    return std::invalid_argument(message.str());
}

Problem problem_from(std::span<const double> wavelengths_nm, const FitOptions& options) {
    Problem p;
    p.specular_included = options.specular_included;
    p.wavelengths_nm.assign(wavelengths_nm.begin(), wavelengths_nm.end());
    for (std::size_t w = 0; w < wavelengths_nm.size(); ++w) {
        p.pure.push_back(chromophores_at(wavelengths_nm[w]));
        if (w > 0 && !(wavelengths_nm[w] > wavelengths_nm[w - 1]))
            throw refusal("wavelengths_nm: ", wavelengths_nm[w], " after ", wavelengths_nm[w - 1],
                          " does not increase");
    }
    if (wavelengths_nm.size() < min_fit_wavelengths)
        throw refusal("wavelengths_nm: ", wavelengths_nm.size(), " are too few, a fit needs ", min_fit_wavelengths);

    if (options.prior_mean.size() != count || options.prior_sd.size() != count)
        throw refusal("prior: ", options.prior_mean.size(), " means and ", options.prior_sd.size(),
                      " standard deviations, needs ", count, " each");
    for (std::size_t i = 0; i < count; ++i) {
        const FitParameter& row = rows[i];
        const double mean = options.prior_mean[i], sd = options.prior_sd[i];
        // Where the surface is not seen, bare skin is assumed.
        const bool unseen = i == surface_row && !options.specular_included;
        if (!(mean >= row.lower && mean <= row.upper))
            throw refusal("prior: ", row.id, ": ", mean, " is outside ", row.lower, " to ", row.upper);
        if (!(sd >= 0 && sd <= 1e6))
            throw refusal("prior: ", row.id, ": a standard deviation of ", sd, " is not 0 or above");
        p.low[i] = to_scale(row.scale, row.lower);
        p.high[i] = to_scale(row.scale, row.upper);
        p.value[i] = unseen ? diffuse_fresnel(path_grid::refractive_index) : mean;
        p.mean[i] = to_scale(row.scale, p.value[i]);
        p.sd[i] = unseen ? 0 : sd;
        if (p.sd[i] > 0)
            p.free.push_back(i);
    }
    return p;
}

}  // namespace

std::span<const FitParameter> fit_parameters() {
    return rows;
}

FitOptions default_fit_options() {
    FitOptions options;
    for (const FitParameter& row : rows) {
        const bool held = !std::isnan(row.held_at);
        options.prior_mean.push_back(held ? row.held_at : row.prior_mean);
        options.prior_sd.push_back(held ? 0 : row.prior_sd);
    }
    return options;
}

double expected_noise(double reflectance, double wavelength_nm) {
    const bool doubtful = wavelength_nm >= 438 && wavelength_nm <= 453;
    return (doubtful ? 1.5 : 1) * (0.003 + 0.01 * reflectance);
}

std::vector<SpectrumFit> fit_spectra(std::span<const double> reflectance, std::span<const double> wavelengths_nm,
                                     const FitOptions& options, int threads, const Progress& progress) {
    const Problem problem = problem_from(wavelengths_nm, options);
    const std::size_t waves = wavelengths_nm.size();
    if (reflectance.size() % waves != 0)
        throw refusal("reflectance: ", reflectance.size(), " values are not a multiple of ", waves, " wavelengths");
    for (std::size_t k = 0; k < reflectance.size(); ++k)
        if (!(reflectance[k] >= 0 && reflectance[k] <= 1))
            throw refusal("spectrum ", k / waves, ": ", wavelengths_nm[k % waves], " nm: ", reflectance[k],
                          " is outside 0 to 1");
    std::vector<SpectrumFit> out(reflectance.size() / waves);
    parallel_for(out.size(), threads, progress,
                 [&](std::size_t i) { out[i] = Search(problem, &reflectance[i * waves]).run(); });
    return out;
}

}  // namespace sanguine
