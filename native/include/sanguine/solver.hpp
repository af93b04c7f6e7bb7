// One interface for every way to find what becomes of light in a stack of layers.
#pragma once

#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "sanguine/parallel.hpp"
#include "sanguine/stack.hpp"

namespace sanguine {

/// What is asked. `layers` in mm and 1/mm.
struct Problem {
    std::vector<Layer> layers;
    Incidence incidence = Incidence::normal;
    std::vector<double> radii_mm;  ///< ascending, above 0: where the profiles are wanted; empty for totals alone
};

/// How much may be spent on it.
struct Effort {
    double tolerance = 0.01;          ///< error_estimate that is good enough
    double max_seconds = 60;          ///< a solver that can stop early does, and says so in a warning
    std::uint64_t max_photons = 1u << 30;
    std::uint64_t seed = 1;
    int threads = 0;                  ///< 0: one per core
    Progress progress;                ///< may be empty
    bool profile_alone = false;       ///< the totals are known already: their noise asks for no photons
};

/// The answer; shares of the incident light.
struct Solution {
    std::string solver;
    double Rd = 0;             ///< left the top after at least one scattering
    double R_unscattered = 0;  ///< came back from a deeper face without scattering
    double Tt = 0;             ///< all that left the bottom
    double specular = 0;       ///< reflected by the first surface
    std::vector<double> R_per_mm2;  ///< scattered light that leaves the top at each radius; empty if there is no profile
    std::vector<double> T_per_mm2;  ///< the same at the bottom; empty for a half-space
    /// Expected relative error of Rd and Tt, or half of that of the profiles in the L1 norm, whichever is largest: a
    /// profile is an error spread over rings, of which a picture shows a blur.
    double error_estimate = 0;
    double elapsed_ms = 0;
    std::string because;  ///< of `auto`: why this solver
    std::vector<std::string> warnings;
};

inline constexpr std::size_t max_radii = 100000;

/// Throws std::invalid_argument unless there are at most max_radii, above 0, finite and ascending.
void check_radii(std::span<const double> radii_mm);

/// A solver cannot answer this problem, or knows that its answer would be wrong.
struct SolverError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

class Solver {
public:
    virtual ~Solver() = default;

    virtual std::string_view id() const = 0;

    /// One line for users: what it does and how far it can be trusted.
    virtual std::string_view summary() const = 0;

    /// Why this solver has no answer to the problem, or "" if it has one. Cheap.
    virtual std::string unsuited(const Problem& problem) const = 0;

    /// Expects a checked problem that it is suited to. Throws SolverError, or Cancelled.
    virtual Solution solve(const Problem& problem, const Effort& effort) const = 0;
};

/// Every rung of the ladder, cheapest first; `auto` is last.
std::span<const Solver* const> solvers();

/// Throws std::invalid_argument naming those that there are.
const Solver& find_solver(std::string_view id);

/// Checks the problem, solves it, and checks that the answer is one: finite, not negative, no energy from nothing.
/// Throws std::invalid_argument for a bad problem and SolverError for one that the solver has no answer to.
Solution solve(const Problem& problem, const Solver& solver, const Effort& effort);

}  // namespace sanguine
