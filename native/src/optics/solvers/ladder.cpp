// The rungs in one list, the choice between them, and the check that every answer passes.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>

#include "message.hpp"
#include "sanguine/adding_doubling.hpp"
#include "sanguine/monte_carlo.hpp"
#include "sanguine/multipole.hpp"
#include "sanguine/skin_solver.hpp"
#include "sanguine/solver.hpp"
#include "sanguine/unscattered.hpp"

namespace sanguine {
namespace {

std::string percent(double share) {
    return message(100 * share, " %");
}

/// Takes the cheapest rung whose known error is within the tolerance. By rising cost: the skin table (microseconds),
/// adding-doubling (milliseconds; totals alone), Monte Carlo (seconds). The multipole is on no tolerance's list: its
/// profile is 13 to 200 % wrong on all but half-spaces of high albedo, and it cannot tell beforehand by how much.
class Auto final : public Solver {
public:
    std::string_view id() const override { return "auto"; }
    std::string_view summary() const override {
        return "the cheapest of the others whose known error is within the tolerance";
    }
    std::string unsuited(const Problem&) const override { return {}; }

    Solution solve(const Problem& problem, const Effort& effort) const override {
        std::string because;
        const Solver& table = skin_solver();
        if (const std::string reason = table.unsuited(problem); !reason.empty()) {
            because = "not the skin table: " + reason;
        } else {
            Solution s = table.solve(problem, effort);
            if (s.error_estimate <= effort.tolerance) {
                s.because = "a skin that the table holds, known to " + percent(s.error_estimate);
                return s;
            }
            because = "not the skin table: known to " + percent(s.error_estimate);
        }

        // Plane-parallel totals are cheap and next to exact for any stack; they also scale the profile.
        const Problem totals_alone{problem.layers, problem.incidence, {}};
        Solution totals;
        bool have_totals = false;
        try {
            totals = adding_doubling_solver().solve(totals_alone, effort);
            have_totals = totals.error_estimate <= effort.tolerance;
            because += "; adding-doubling gives the totals to " + percent(totals.error_estimate);
        } catch (const SolverError& error) {
            because += std::string("; no adding-doubling: ") + error.what();
        }
        if (have_totals && problem.radii_mm.empty()) {
            totals.because = because;
            return totals;
        }

        const Solver& photons = monte_carlo_solver();
        if (const std::string reason = photons.unsuited(problem); !reason.empty())
            throw SolverError(because + "; not Monte Carlo: " + reason);
        Effort remaining = effort;
        remaining.profile_alone = have_totals;
        Solution s = photons.solve(problem, remaining);
        if (have_totals) {
            because += ", Monte Carlo the profile to " + percent(s.error_estimate);
            scale(s.R_per_mm2, totals.Rd, s.Rd);
            // The profile at the bottom is of scattered light alone.
            const double direct = unscattered(problem.layers, problem.incidence).transmitted;
            scale(s.T_per_mm2, totals.Tt - direct, s.Tt - direct);
            s.error_estimate = std::fmax(s.error_estimate, totals.error_estimate);
            s.solver = "adding-doubling+monte-carlo";
            s.Rd = totals.Rd;
            s.R_unscattered = totals.R_unscattered;
            s.Tt = totals.Tt;
            s.specular = totals.specular;
            s.warnings.insert(s.warnings.end(), totals.warnings.begin(), totals.warnings.end());
        } else {
            because += "; Monte Carlo has it to " + percent(s.error_estimate);
        }
        s.because = because;
        if (s.error_estimate > effort.tolerance)
            s.warnings.push_back("no solver reached the tolerance");
        return s;
    }

private:
    static void scale(std::vector<double>& profile, double exact, double estimated) {
        if (exact > 0 && estimated > 0)
            for (double& value : profile)
                value *= exact / estimated;
    }
};

const Auto automatic;

void check_problem(const Problem& problem, const Effort& effort) {
    check_stack(problem.layers);
    check_radii(problem.radii_mm);
    if (!(effort.tolerance > 0 && effort.tolerance <= 1))
        throw std::invalid_argument(message("tolerance: ", effort.tolerance, " is not above 0 and at most 1"));
    if (!(effort.max_seconds > 0))
        throw std::invalid_argument(message("max_seconds: ", effort.max_seconds, " is not above 0"));
    if (effort.max_photons == 0)
        throw std::invalid_argument("max_photons: 0 is not above 0");
    // Not every rung starts threads, but what is nonsense to one is nonsense to all.
    if (effort.threads < 0)
        throw std::invalid_argument("threads: " + std::to_string(effort.threads) + " is below 0 (0: all cores)");
}

/// What every answer has to be, whoever gave it. Energy may exceed 1 by rounding alone.
void check_solution(const Solution& s) {
    const auto share = [](double value) { return value >= 0 && value <= 1 + 1e-9; };
    const auto density = [](double value) { return value >= 0 && std::isfinite(value); };
    if (!share(s.Rd) || !share(s.R_unscattered) || !share(s.Tt) || !share(s.specular)
        || !share(s.Rd + s.R_unscattered + s.Tt + s.specular)) {
        throw SolverError(message(s.solver, ": no physical answer: Rd ", s.Rd, ", R_unscattered ", s.R_unscattered, ", Tt ",
                                  s.Tt, ", specular ", s.specular));
    }
    if (!std::ranges::all_of(s.R_per_mm2, density) || !std::ranges::all_of(s.T_per_mm2, density))
        throw SolverError(s.solver + ": no physical answer: a profile is negative or not finite");
    if (!(s.error_estimate >= 0 && std::isfinite(s.error_estimate)))
        throw SolverError(s.solver + ": no physical answer: its error is unknown");
}

}  // namespace

std::span<const Solver* const> solvers() {
    static const std::array<const Solver*, 5> all = {&skin_solver(), &multipole_solver(), &adding_doubling_solver(),
                                                     &monte_carlo_solver(), &automatic};
    return all;
}

void check_radii(std::span<const double> radii_mm) {
    if (radii_mm.size() > max_radii)
        throw std::invalid_argument(message("radii_mm: ", radii_mm.size(), " of them, allowed are ", max_radii));
    double last = 0;
    for (const double r : radii_mm) {
        if (!(r > last && std::isfinite(r)))
            throw std::invalid_argument(
                message("radii_mm: ", r, " is not above 0, finite and above the one before"));
        last = r;
    }
}

const Solver& find_solver(std::string_view id) {
    std::string known;
    for (const Solver* solver : solvers()) {
        if (solver->id() == id)
            return *solver;
        known += (known.empty() ? "" : ", ") + std::string(solver->id());
    }
    throw std::invalid_argument("solver: no '" + std::string(id) + "', known: " + known);
}

Solution solve(const Problem& problem, const Solver& solver, const Effort& effort) {
    check_problem(problem, effort);
    if (const std::string reason = solver.unsuited(problem); !reason.empty())
        throw SolverError(std::string(solver.id()) + ": " + reason);
    const auto start = std::chrono::steady_clock::now();
    Solution s = solver.solve(problem, effort);
    s.elapsed_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    if (s.solver.empty())
        s.solver = solver.id();
    check_solution(s);
    return s;
}

}  // namespace sanguine
