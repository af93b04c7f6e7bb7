// Reflection at smooth dielectric interfaces.
#pragma once

#include "sanguine/stack.hpp"

namespace sanguine {

/// Unpolarised Fresnel reflectance for light in index `n_i` meeting index `n_t` under `cos_i` (0..1).
/// On return `cos_t` is the cosine of the refracted direction, 0 under total internal reflection.
double fresnel_dielectric(double cos_i, double n_i, double n_t, double& cos_t);

/// Fresnel reflectance of a medium of relative index `n` >= 1 averaged over Lambertian light from outside, to full
/// relative precision. Closed form, Walsh 1926 (also Duntley 1942, "The optical properties of diffusing materials",
/// Eq. 29). 0.076812 for n = 1.4.
double diffuse_fresnel(double n);

/// Share of light from outside that the first surface reflects, `n` the index of the first layer.
double surface_reflectance(double n, Incidence incidence);

}  // namespace sanguine
