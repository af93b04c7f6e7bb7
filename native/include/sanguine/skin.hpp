// Spectral reflectance and profiles of skins: chromophores looked up in the path table.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "sanguine/chromophores.hpp"
#include "sanguine/colour.hpp"
#include "sanguine/parallel.hpp"
#include "sanguine/radial_profile.hpp"

namespace sanguine {

/// Diffuse reflectance of bare skin under Lambertian light, per unit of light that falls on it, without the
/// reflection of its surface. Row-major [skin][wavelength].
std::vector<double> reflectance(std::span<const SkinParameters> skins, std::span<const double> wavelengths_nm,
                                int threads, const Progress& progress);

/// Called for each skin and wavelength (indices), the wavelengths of one skin by one thread and in order.
using ProfileVisitor = std::function<void(std::size_t skin, std::size_t wavelength, const RadialProfile& profile)>;

/// Solves the profile of every skin at every wavelength. Skins that share thickness and dermis share most of the work.
void solve_profiles(std::span<const SkinParameters> skins, std::span<const double> wavelengths_nm, int threads,
                    const Progress& progress, const ProfileVisitor& visit);

/// Radii to sample a profile at: logarithmic, 0.0003 to 40 mm. The first lies where every profile falls as 1/r: the
/// disk inside it holds 2 pi r^2 R(r).
std::vector<double> default_radii_mm();

/// Energy of one skin in rings [ring][channel]: linear RGB, signed, because narrow spectra leave the gamut.
using RgbRings = std::vector<Colour>;

/// Edges of those rings [mm]: the first ring is the disk below edge 0, ring k lies between edges k - 1 and k.
std::span<const double> rgb_ring_edges_mm();

/// Wavelengths that an RGB profile is integrated from.
std::size_t rgb_wavelength_count();

/// Profiles integrated over the spectrum to linear RGB. `rgb` maps XYZ (D65, Y = 1 for white) to RGB.
std::vector<RgbRings> rgb_rings(std::span<const SkinParameters> skins, const Matrix3& rgb, int threads,
                                const Progress& progress);

}  // namespace sanguine
