#include "sanguine/multipole.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "message.hpp"
#include "sanguine/adding_doubling.hpp"
#include "sanguine/fresnel.hpp"
#include "sanguine/hankel.hpp"

namespace sanguine {
namespace {

/// A free path of a thousand kilometres and more is no scattering, and its square no number to count with.
constexpr double clear_below_per_mm = 1e-9;

/// Streams of the adding-doubling that the totals are held against, and its own relative error with so many: 0.16 %
/// over 38 stacks, skin and slabs (measured against Monte Carlo).
constexpr int check_streams = 16;
constexpr double check_error = 0.002;

double reduced_scattering(const Layer& layer) { return layer.mu_s * (1 - layer.g); }

/// A = (1 + Fdr) / (1 - Fdr).
double face_factor(double inside, double outside) {
    const double f = internal_reflectance(inside / outside);
    return (1 + f) / (1 - f);
}

/// cosh(gamma a) sinh(gamma b) / sinh(gamma h) without overflow; `exponent` is a + |b| - h, which the caller knows
/// without cancellation.
double image_sum(double gamma, double a, double b, double h, double exponent) {
    const double ratio = gamma * h > 1e-12 ? std::expm1(-2 * gamma * std::fabs(b)) / std::expm1(-2 * gamma * h)
                                           : std::fabs(b) / h;
    return std::copysign(0.5, b) * std::exp(gamma * exponent) * (1 + std::exp(-2 * gamma * a)) * ratio;
}

/// exp(-|z| gamma) with the sign of z; 0 for a source in the plane itself, which lights no point at r > 0.
double image(double z, double gamma) {
    return z == 0 ? 0 : std::copysign(std::exp(-std::fabs(z) * gamma), z);
}

double index_of_neighbour(std::span<const Layer> layers, std::size_t i, int step) {
    const std::size_t j = i + static_cast<std::size_t>(step);  // wraps below 0 to a number beyond the end
    return j < layers.size() ? layers[j].n : outside_index;
}

/// Values below what the transform can tell from 0 become 0. Returns the share of negative light among all of it;
/// where that is small it is cut off, too.
double cut_negative(std::span<const double> radii, std::span<const HankelResult> results, int which, double scale,
                    std::vector<double>& profile) {
    double negative = 0, all = 0;
    profile.reserve(radii.size());
    for (std::size_t i = 0; i < radii.size(); ++i) {
        double value = results[i].value[which];
        if (std::fabs(value) <= results[i].error[which])
            value = std::fmax(value, 0.0);
        const double inner = i > 0 ? radii[i - 1] : 0, outer = i + 1 < radii.size() ? radii[i + 1] : radii[i];
        const double area = outer * outer - inner * inner;
        all += area * std::fabs(value);
        negative += area * std::fmax(-value, 0.0);
        profile.push_back(scale * std::fmax(value, 0.0));
    }
    return all > 0 ? negative / all : 0;
}

/// Sets `error_estimate`, and warns of differences above `tolerance`.
void hold_against_adding_doubling(const Problem& problem, double tolerance, Solution& solution) {
    Totals exact;
    try {
        exact = adding_doubling(problem.layers, problem.incidence, check_streams);
    } catch (const SolverError& error) {
        solution.error_estimate = 1;
        solution.warnings.push_back(message("the error could not be measured: ", error.what()));
        return;
    }
    const auto compare = [&](const char* name, double value, double right) {
        // Where there is no light but that of the method (right = 0), it is all error.
        // Next to a vanishing number a ratio need not be finite.
        const double off = right > 0 ? std::fmin(value / right - 1, 1e6) : value > 0 ? 1 : 0;
        if (std::fabs(off) > tolerance + check_error)
            solution.warnings.push_back(message(name, " is ", 100 * std::fabs(off), " % ", off > 0 ? "above" : "below",
                                                " that of adding-doubling, ", right));
        solution.error_estimate = std::fmax(solution.error_estimate, std::fabs(off));
    };
    compare("Rd", solution.Rd, exact.Rd);
    if (problem.layers.back().thickness != half_space)
        compare("Tt", solution.Tt, exact.Tt);
    solution.error_estimate += check_error;
}

}  // namespace

double internal_reflectance(double eta) {
    const double x = 1 / eta;
    return eta >= 1 ? ((-1.4399 * x) + 0.7099) * x + 0.6681 + 0.0636 * eta
                    : -0.4399 + x * (0.7099 + x * (-0.3319 + x * 0.0636));
}

MultipoleLayer::MultipoleLayer(const Layer& layer, double above, double below, int terms)
    : thickness(layer.thickness), terms_(terms) {
    const double scattering = reduced_scattering(layer), extinction = layer.mu_a + scattering;
    reduced_albedo = scattering / extinction;
    source_depth = 1 / extinction;
    sigma_tr = std::sqrt(3 * layer.mu_a * extinction);
    const double diffusion = source_depth / 3;
    zb_top = 2 * face_factor(layer.n, above) * diffusion;
    zb_bottom = 2 * face_factor(layer.n, below) * diffusion;
}

double MultipoleLayer::reflected(double gamma, double zb_near, double zb_far) const {
    const double l = source_depth, b = thickness + zb_far - l;
    const double exponent = b >= 0 ? -l : l - 2 * (thickness + zb_far);
    return reduced_albedo * image_sum(gamma, zb_near, b, thickness + zb_near + zb_far, exponent);
}

double MultipoleLayer::transmitted(double gamma, double zb_near, double zb_far) const {
    const double l = source_depth, d = thickness, h = d + zb_near + zb_far;
    if (l <= d)
        return reduced_albedo * image_sum(gamma, zb_far, l + zb_near, h, l - d);
    const double b = l - d - zb_far;
    return reduced_albedo * image_sum(gamma, d + zb_near, b, h, b < 0 ? d - l : b - zb_far);
}

MultipoleResponse MultipoleLayer::closed_form(double gamma) const {
    return {reflected(gamma, zb_top, zb_bottom), transmitted(gamma, zb_top, zb_bottom),
            reflected(gamma, zb_bottom, zb_top), transmitted(gamma, zb_bottom, zb_top)};
}

MultipoleResponse MultipoleLayer::operator()(double s) const {
    const double gamma = std::sqrt(s * s + sigma_tr * sigma_tr);
    if (thickness == half_space)
        return {0.5 * reduced_albedo * std::exp(-gamma * source_depth) * (1 + std::exp(-2 * gamma * zb_top)), 0, 0, 0};
    if (terms_ == all_terms)
        return closed_form(gamma);
    MultipoleResponse sum{};
    const double period = 2 * (thickness + zb_top + zb_bottom);
    for (int i = -terms_; i <= terms_; ++i) {
        const double real = i * period + source_depth;
        const double from_above = i * period - source_depth - 2 * zb_top;
        const double from_below = i * period - source_depth - 2 * zb_bottom;
        sum.R += image(real, gamma) - image(from_above, gamma);
        sum.T += image(thickness - real, gamma) - image(thickness - from_above, gamma);
        sum.R_from_below += image(real, gamma) - image(from_below, gamma);
        sum.T_from_below += image(thickness - real, gamma) - image(thickness - from_below, gamma);
    }
    const double half = 0.5 * reduced_albedo;
    return {half * sum.R, half * sum.T, half * sum.R_from_below, half * sum.T_from_below};
}

MultipoleStack::MultipoleStack(std::span<const Layer> layers, int terms) {
    layers_.reserve(layers.size());
    for (std::size_t i = 0; i < layers.size(); ++i)
        layers_.emplace_back(layers[i], index_of_neighbour(layers, i, -1), index_of_neighbour(layers, i, 1), terms);
}

MultipoleResponse MultipoleStack::operator()(double s) const {
    MultipoleResponse stack = layers_.back()(s);
    for (std::size_t i = layers_.size() - 1; i-- > 0;) {
        const MultipoleResponse top = layers_[i](s);
        const double between = 1 / (1 - stack.R * top.R_from_below);
        stack = {top.R + top.T * stack.R * top.T_from_below * between, top.T * stack.T * between,
                 stack.R_from_below + stack.T_from_below * top.R_from_below * stack.T * between,
                 stack.T_from_below * top.T_from_below * between};
    }
    return stack;
}

std::string_view Multipole::summary() const {
    return "classical diffusion (Donner and Jensen 2005): quick, for comparison; wrong by tens of percent in skin";
}

std::string Multipole::unsuited(const Problem& problem) const {
    for (std::size_t i = 0; i < problem.layers.size(); ++i) {
        const Layer& layer = problem.layers[i];
        if (reduced_scattering(layer) < clear_below_per_mm)
            return message("layer ", i, " does not scatter, so nothing diffuses in it");
        for (const int step : {-1, 1})
            if (!(internal_reflectance(layer.n / index_of_neighbour(problem.layers, i, step)) < 1))
                return message("layer ", i, ": the method's fit of the internal reflection ends before a ratio of indices of ",
                               layer.n / index_of_neighbour(problem.layers, i, step));
    }
    return {};
}

Solution Multipole::solve(const Problem& problem, const Effort& effort) const {
    const MultipoleStack stack(problem.layers);
    const bool finite = problem.layers.back().thickness != half_space;
    Solution solution;
    solution.solver = id();
    solution.specular = surface_reflectance(problem.layers.front().n, problem.incidence);
    const double entering = 1 - solution.specular;

    // What each layer does by itself says where the method has left its ground.
    bool off_ground = false;
    for (std::size_t i = 0; i < stack.layers().size(); ++i) {
        const MultipoleLayer& layer = stack.layers()[i];
        const double paths = layer.thickness / layer.source_depth;
        const MultipoleResponse alone = layer(0);
        off_ground = off_ground || paths < 1 || layer.reduced_albedo < 0.5;
        if (paths < 1)
            solution.warnings.push_back(
                message("layer ", i, " is ", paths, " mean free paths thick: its source lies below its bottom, and by itself "
                        "it would reflect ", alone.R, " and transmit ", alone.T, " of the light"));
        if (layer.reduced_albedo < 0.5)
            solution.warnings.push_back(
                message("layer ", i, " has a reduced albedo of ", layer.reduced_albedo,
                        ": it absorbs more than it scatters, which is not diffusion"));
    }
    if (problem.incidence == Incidence::diffuse)
        solution.warnings.push_back("diffuse light enters with its own Fresnel loss and is then treated as normal light");

    const MultipoleResponse total = stack(0);
    const auto fail = [&](const std::string& what) {
        std::string message = what;
        for (const std::string& warning : solution.warnings)
            message += "; " + warning;
        throw SolverError(message);
    };
    if (!std::isfinite(total.R) || !std::isfinite(total.T))
        fail("the sum over the layers is not finite");
    if (total.R < 0 || total.T < 0)
        fail(message("negative light: ", total.R, " of it reflected, ", total.T, " transmitted"));
    if (total.R + total.T > 1 + 1e-9)
        fail(message("more light out than in, by ", total.R + total.T - 1));
    solution.Rd = entering * total.R;
    solution.Tt = finite ? entering * total.T : 0;
    hold_against_adding_doubling(problem, effort.tolerance, solution);

    if (!problem.radii_mm.empty()) {
        const auto results = inverse_hankel(
            [&](double s) {
                const MultipoleResponse at = stack(s);
                return std::array{at.R, at.T};
            },
            problem.radii_mm);
        const auto keep = [&](int which, const char* name, std::vector<double>& profile) {
            const double negative = cut_negative(problem.radii_mm, results, which, entering, profile);
            if (negative > max_negative_share)
                fail(message("negative light: ", negative, " of ", name, "(r) over the radii asked for"));
            if (negative > 0)
                solution.warnings.push_back(message(negative, " of ", name, "(r) was negative and is cut off"));
        };
        keep(0, "R", solution.R_per_mm2);
        if (finite)
            keep(1, "T", solution.T_per_mm2);
        solution.error_estimate += off_ground ? profile_error_off_ground : profile_error;
        const double l = stack.layers().front().source_depth;
        if (problem.radii_mm.front() < l)
            solution.warnings.push_back(message("R(r) inside of r = ", l, " mm, one mean free path, is not diffusion"));
    }
    return solution;
}

const Solver& multipole_solver() {
    static const Multipole solver;
    return solver;
}

}  // namespace sanguine
