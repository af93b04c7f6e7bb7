#include "sanguine/skin_solver.hpp"

#include <array>
#include <cmath>
#include <sstream>

#include "sanguine/fresnel.hpp"
#include "sanguine/path_table.hpp"
#include "sanguine/radial_profile.hpp"

namespace sanguine {
namespace {

using namespace path_grid;

/// Deviations from what the tables fix that rounded input may have, and the relative change of Rd per deviation: the
/// largest that adding-doubling finds over light, dark and opaque skin (tests/native/test_skin_solver.cpp).
constexpr double index_tolerance = 5e-4, index_effect = 2.5;
constexpr double anisotropy_tolerance = 1e-3, anisotropy_effect = 1;

/// Relative deviation of the ratio of scattering that a profile may have. The L1 norm of the profile moves by less than
/// as much, see there.
constexpr double ratio_tolerance = 0.02;

/// Error of the total beyond what the table can tell: within a bin, paths of one layer go with those of the other, and
/// the more so the shorter the paths that survive. Measured against adding-doubling over all of skin: below
/// bin_error / sqrt(Rd) beyond the noise (tests/native/test_skin_solver.cpp).
constexpr double bin_error = 0.0013;

/// Above this absorption of the epidermis (over mu_s'; the most of any skin is 6) R falls too steeply from the bare
/// dermis to the first nodes of tau to be interpolated: in films thinner than this errors reach 10 % (found on 4,400
/// stacks against adding-doubling), which no difference between nodes foretells.
constexpr double film_absorption = 12, film_thickness = 0.1;

/// L1 error of a profile beyond the noise of its rings and the error of its total: the same ring by ring, and the smooth
/// curve through the rings. Measured on the reference cases, 0.8 % at most.
constexpr double shape_error = 0.01;

/// Arguments of the table.
struct Point {
    double tau, a1, a2;
    double unit_mm;          ///< of radii
    double ratio_deviation;  ///< of the dermis' scattering from half of the epidermis', relative
};

double reduced(const Layer& layer) {
    return layer.mu_s * (1 - layer.g);
}

Point table_point(const Problem& problem) {
    const Layer& dermis = problem.layers.back();
    // A length of 1/mu_s' of the epidermis is half of one of the dermis.
    const double dermis_unit = dermis_scattering / reduced(dermis), a2 = dermis.mu_a * dermis_unit;
    if (problem.layers.size() == 1)
        return {0, a2, a2, dermis_unit, 0};
    const Layer& epidermis = problem.layers.front();
    const double unit = 1 / reduced(epidermis);
    return {epidermis.thickness / unit, epidermis.mu_a * unit, a2, unit, unit / dermis_unit - 1};
}

class SkinSolver final : public Solver {
public:
    std::string_view id() const override { return "skin"; }

    std::string_view summary() const override {
        return "path lengths traced once for the two-layer skin (n 1.4, g 0.8, semi-infinite dermis): total within "
               "0.3 % (1 % where less than 2 % of the light returns), profile within 2 %, in microseconds";
    }

    std::string unsuited(const Problem& problem) const override {
        std::ostringstream why;
        const auto object = [&]() -> std::ostream& { return why << (why.tellp() > 0 ? "; " : ""); };
        const std::size_t count = problem.layers.size();
        if (count < 1 || count > 2) {
            object() << "layers: " << count << " of them, the table holds 1 or 2";
            return why.str();
        }
        for (std::size_t i = 0; i < count; ++i) {
            const Layer& layer = problem.layers[i];
            if (!(std::fabs(layer.n - refractive_index) <= index_tolerance))
                object() << "layers." << i << ".n: " << layer.n << " is not " << refractive_index;
            if (!(std::fabs(layer.g - anisotropy) <= anisotropy_tolerance))
                object() << "layers." << i << ".g: " << layer.g << " is not " << anisotropy;
            if (!(layer.mu_s > 0))
                object() << "layers." << i << ".mu_s: " << layer.mu_s << ", the table needs scattering";
        }
        if (!std::isinf(problem.layers.back().thickness))
            object() << "layers." << count - 1 << ".thickness: " << problem.layers.back().thickness
                     << " mm, the table needs a half-space";
        if (why.tellp() > 0)
            return why.str();

        const Point p = table_point(problem);
        if (!(p.tau <= max_thickness))
            object() << "layers.0.thickness: mu_s' d is " << p.tau << ", the table ends at " << max_thickness;
        const auto absorption = [&](std::size_t layer, double a, double unit_over_own) {
            if (!(a >= reference_absorption && a <= max_absorption))
                object() << "layers." << layer << ".mu_a: mu_a / mu_s' is " << a * unit_over_own
                         << ", the table holds " << reference_absorption * unit_over_own << " to "
                         << max_absorption * unit_over_own;
        };
        if (count == 2)
            absorption(0, p.a1, 1);
        if (count == 2 && p.a1 > film_absorption && p.tau < film_thickness)
            object() << "layers.0.mu_a: mu_a / mu_s' is " << p.a1 << ", a film of mu_s' d below " << film_thickness
                     << " may have " << film_absorption;
        absorption(count - 1, p.a2, 1 / dermis_scattering);
        if (!problem.radii_mm.empty() && !(std::fabs(p.ratio_deviation) <= ratio_tolerance))
            object() << "layers.1.mu_s: mu_s' of the layers is " << reduced(problem.layers[0]) << " to "
                     << reduced(problem.layers[1]) << ", the table's profiles need 2 to 1";
        return why.str();
    }

    Solution solve(const Problem& problem, const Effort&) const override {
        const PathTable& table = PathTable::embedded(problem.incidence);
        const Point p = table_point(problem);
        Solution out;
        out.solver = id();
        out.specular = surface_reflectance(problem.layers[0].n, problem.incidence);
        const PathTable::Uncertainty uncertainty = table.uncertainty(p.tau, p.a1, p.a2);
        out.Rd = table.total(p.tau, p.a1, p.a2);
        out.error_estimate = std::fmin(1, uncertainty.total + (out.Rd > 0 ? bin_error / std::sqrt(out.Rd) : 1));
        for (const Layer& layer : problem.layers)
            out.error_estimate += (index_effect * std::fabs(layer.n - refractive_index)
                                   + anisotropy_effect * std::fabs(layer.g - anisotropy))
                                / static_cast<double>(problem.layers.size());
        if (problem.radii_mm.empty())
            return out;
        PathTable::DermisSums dermis;
        std::array<double, rings> energy;
        table.sum_dermis(p.tau, p.a2, dermis);
        out.Rd = table.ring_energies(dermis, p.a1, energy);
        const RadialProfile profile(energy, p.unit_mm);
        for (const double radius : problem.radii_mm)
            out.R_per_mm2.push_back(profile.density(radius));
        const double profile_error =
            out.error_estimate + uncertainty.profile + shape_error + std::fabs(p.ratio_deviation);
        out.error_estimate = std::fmax(out.error_estimate, profile_error / 2);
        return out;
    }
};

}  // namespace

const Solver& skin_solver() {
    static const SkinSolver solver;
    return solver;
}

}  // namespace sanguine
