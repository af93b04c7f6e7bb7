// Light that the outer surface turns back before it reaches the tissue.
#pragma once

#include "sanguine/parameters.hpp"

namespace sanguine {

/// Refractive index of the oil film: the outermost surface of cheeks has 1.51-1.53 at 550 nm in vivo (Yoshida et al.
/// 2013, J. Biomed. Opt. 18(3):037003); the customary 1.5 is within its error.
inline constexpr double oil_film_index = 1.5;

/// Averages over Lambertian light that falls on the skin.
struct SurfaceReflectance {
    double film;   ///< share E that the oil film reflects; (1 - E) of the light falls on the skin below
    double total;  ///< film and skin interface together: E + (1 - E) * 0.0768
};

/// The film reflects E(view) = oil * (Torrance-Sparrow with Fresnel at oil_film_index) of the light (Donner and Jensen
/// 2006, Section 3.3). Its average here is oil * diffuse_fresnel: facets redirect light, they do not absorb it.
/// The skin's own interface is inside every reflectance of the skin, so under a film that is (1 - film) * reflectance.
SurfaceReflectance surface_reflectance(const SkinParameters& skin);

}  // namespace sanguine
