// Monte Carlo of light in a stack of layers: the reference that every other solver is measured against.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sanguine/solver.hpp"

namespace sanguine {

/// Logarithmic rings on a face of the stack. Sixteen per octave of r^2 and equally wide inside an octave, so that a
/// radius finds its ring in the bits of its square: neighbouring edges are a factor 1.016 to 1.031 apart in r.
class RadialRings {
public:
    /// From `first_mm` or a little less to `last_mm` or a little more, kept within 1e-12 and 1e12.
    RadialRings(double first_mm, double last_mm);

    /// Rings, with what lies inside of the first edge (index 0) and beyond the last (the last index).
    std::size_t size() const { return count_; }
    std::size_t index(double radius_squared) const;

    /// Inner edge of ring `i` >= 1 and outer edge of ring i - 1 [mm].
    double edge_mm(std::size_t i) const;

private:
    std::uint64_t base_;
    std::size_t count_;
};

struct Estimate {
    double mean = 0, standard_error = 0;
};

/// All that a run of photons says; shares of the incident light.
struct Tallies {
    std::uint64_t photons = 0;
    std::uint64_t collisions = 0, faces = 0;  ///< of all photons together: the work done
    double specular = 0;                      ///< Fresnel's, not sampled
    Estimate Rd, R_unscattered, Tt;           ///< all sampled
    Estimate Tt_scattered;
    Estimate cut;           ///< still inside when a photon reached its cap of steps; in none of the others
    std::vector<Estimate> R_rings, T_rings;   ///< energy per ring of scattered light; their sums are Rd and Tt_scattered
};

/// Traces photons 0 to `photons` - 1 of `seed`. The same bytes on any number of threads. `rings` may be null. `max_steps`
/// caps the collisions and crossings of faces of one photon. Throws Cancelled; expects a checked stack.
Tallies monte_carlo(std::span<const Layer> stack, Incidence incidence, std::uint64_t photons, std::uint64_t seed = 1,
                    int threads = 0, const RadialRings* rings = nullptr, const Progress& progress = {},
                    std::uint32_t max_steps = 1u << 20);

/// Light that leaves around a radius, from a window of rings.
struct RadialDensity {
    double per_mm2 = 0;
    double window_energy = 0, window_variance = 0;  ///< of the rings it was taken from
};

/// R(r) at each of `radii_mm`, ascending, from energy per ring: the mean over a window as wide in ln r as the radii lie
/// apart (but a ratio of 1.1 to 1.25), times the ratio of middle to mean of the power law through the neighbouring
/// windows: exact wherever the profile is locally a power of r. Never negative; where the windows tile the plane, what
/// they hold is what left through them.
std::vector<RadialDensity> radial_density(const RadialRings& rings, std::span<const Estimate> energy,
                                          std::span<const double> radii_mm);

/// The rung of the ladder. What never scatters is exact (unscattered.hpp), and no more scattered light leaves than that
/// leaves over. Runs rounds of photons until three standard errors of Rd and of Tt are within the relative
/// tolerance and the expected L1 noise of each asked profile (mean absolute deviation of the windows above, over their
/// energy) is within twice the tolerance; shares below 0.001 of the incident light count as 0.001. `error_estimate` is
/// the largest of the three relative errors, the L1 noise halved, plus the share that a cap of steps cut off.
const Solver& monte_carlo_solver();

}  // namespace sanguine
