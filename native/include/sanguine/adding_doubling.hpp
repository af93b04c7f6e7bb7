// Adding-doubling: plane-parallel radiative transfer, for the total reflectance and transmittance of any stack.
#pragma once

#include <span>

#include "sanguine/solver.hpp"
#include "sanguine/stack.hpp"

namespace sanguine {

/// Shares of the incident light.
struct Totals {
    double Rd = 0;             ///< left the top after at least one scattering
    double R_unscattered = 0;  ///< came back from a deeper face without scattering
    double Tt = 0;             ///< all that left the bottom
    double specular = 0;       ///< reflected by the first surface
};

inline constexpr int min_streams = 4;
inline constexpr int max_streams = 96;

/// Totals of a checked stack with `streams` directions per hemisphere in the densest medium (a few more where the
/// stack has many different indices). The cost grows with the cube of `streams`.
/// Throws SolverError where the equations cannot be solved.
Totals adding_doubling(std::span<const Layer> stack, Incidence incidence, int streams);

/// Raises the streams until three successive counts agree, to 1e-4 or, where asked for, better.
class AddingDoubling final : public Solver {
public:
    std::string_view id() const override;
    std::string_view summary() const override;
    std::string unsuited(const Problem& problem) const override;
    Solution solve(const Problem& problem, const Effort& effort) const override;
};

const Solver& adding_doubling_solver();

}  // namespace sanguine
