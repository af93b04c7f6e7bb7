// What becomes of light before it scatters: faces that reflect and refract, layers that weaken it.
#pragma once

#include <span>

#include "sanguine/stack.hpp"

namespace sanguine {

/// Shares of the incident light; what is missing to 1 was absorbed before it scattered.
struct UnscatteredLight {
    double specular = 0;     ///< reflected by the first surface
    double reflected = 0;    ///< left the top after reflection at deeper faces
    double transmitted = 0;  ///< left the bottom
    double scattered = 0;    ///< scattered at least once, whatever became of it then
};

/// Fresnel reflectance of unpolarised light at the face between two media, and its complement, both to full relative
/// precision however small. The cosines belong to one ray by Snell's law; 0 in the rarer medium is total reflection.
struct Face {
    double reflected, transmitted;
};
Face fresnel_face(double n_above, double cos_above, double n_below, double cos_below);

/// Light that falls on a checked stack from outside under `cosine` (0 < cosine <= 1). Closed form: the faces are
/// added incoherently from the bottom up, layers weaken by Beer-Lambert with mu_a + mu_s.
UnscatteredLight unscattered_at(std::span<const Layer> stack, double cosine);

/// The same for an incidence. Diffuse light is integrated over the angle to about 1e-13.
UnscatteredLight unscattered(std::span<const Layer> stack, Incidence incidence);

}  // namespace sanguine
