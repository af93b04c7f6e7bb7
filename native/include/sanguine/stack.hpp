// A stack of plane layers in air, and the light that falls on it.
#pragma once

#include <limits>
#include <span>

namespace sanguine {

/// One plane, homogeneous layer, Henyey-Greenstein scattering. Any unit of length does as long as all fields use the
/// same one; solvers take mm.
struct Layer {
    double mu_a;       ///< absorption coefficient [1/length]
    double mu_s;       ///< scattering coefficient [1/length]
    double g;          ///< Henyey-Greenstein asymmetry, -1 < g < 1
    double n;          ///< refractive index
    double thickness;  ///< [length]; infinity for a half-space, which only the last layer can be
};

inline constexpr double half_space = std::numeric_limits<double>::infinity();
inline constexpr int max_layers = 8;
inline constexpr double outside_index = 1.0;

enum class Incidence {
    normal,   ///< a pencil beam along the axis
    diffuse,  ///< Lambertian light that falls on one point
};

/// Throws std::invalid_argument naming the layer, the key, the value and what is allowed: 1 to max_layers layers;
/// mu_a and mu_s 0 to 1e7, g -1 < g < 1, n 1 to 4, thickness above 0 and up to 1e100
/// (infinite in the last layer alone).
void check_stack(std::span<const Layer> stack);

}  // namespace sanguine
