// Diffuse reflectance as a continuous function of the distance between entry and exit.
#pragma once

#include <array>
#include <span>

#include "sanguine/path_table.hpp"

namespace sanguine {

/// The rings of the path table made smooth: energy within r is a monotone cubic in ln r through the edges of the
/// rings, so that the profile is continuous, never negative, and integrates over the plane to exactly the total.
/// Below the first edge R(r) falls as 1/r, as single scattering near a point of entry does.
class RadialProfile {
public:
    /// `energy` per ring of path_grid; `unit_mm` is the length of 1/mu_s' of the epidermis.
    RadialProfile(std::span<const double, path_grid::rings> energy, double unit_mm);

    /// Share of the incident light that leaves within `radius_mm` of its entry.
    double energy_within(double radius_mm) const;

    /// The same for a ladder of radii first_mm * radius_ratio^k: all of them lie at one fraction between two edges of
    /// rings, which is what makes this cheap.
    void energy_within_ladder(double first_mm, std::span<double> out) const;

    /// R(r) [1/mm^2], per unit of light that falls on one point; `radius_mm` > 0.
    double density(double radius_mm) const;

private:
    static constexpr int edges = path_grid::rings - 1;

    std::array<double, edges> cumulative_, slope_;  // of the energy, per ring
    double unit_mm_;
};

}  // namespace sanguine
