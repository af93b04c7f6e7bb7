// The skin rung of the solver ladder: two-layer skin out of the path-length table.
#pragma once

#include "sanguine/solver.hpp"

namespace sanguine {

/// Id "skin". Answers problems that the tables fix: one half-space, or one layer over a half-space; n 1.4 and g 0.8 in
/// both; tau = mu_s' d and mu_a / mu_s' within the ranges of path_grid.
///
/// The total needs no ratio of scattering: a half-space looks the same at every scale, so the dermis enters by
/// mu_a / mu_s' of its own. Profiles need mu_s' of the first layer to be twice that of the second, within 2 %: a dermis
/// of another scale spreads light sideways by another amount.
const Solver& skin_solver();

}  // namespace sanguine
