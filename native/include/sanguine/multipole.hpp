// The classical multipole: Donner and Jensen 2005, "Light Diffusion in Multi-Layered Translucent Materials", with the
// layers combined in the frequency domain. The reference method of the field, as published, failures included.
#pragma once

#include <span>
#include <vector>

#include "sanguine/solver.hpp"
#include "sanguine/stack.hpp"

namespace sanguine {

/// Egan and Hilgeman's fit of the diffuse Fresnel reflectance inside a medium of relative index `eta`, as D&J print it.
/// It reaches 1, where the method ends, near eta = 3.9 and 1/3.9.
double internal_reflectance(double eta);

/// What a layer or a stack does to light of one spatial frequency: Hankel transforms of its profiles, per unit of
/// light that enters. At frequency 0 they are the totals.
struct MultipoleResponse {
    double R, T;                        ///< light from above
    double R_from_below, T_from_below;  ///< light from below
};

/// Any number of image sources.
inline constexpr int all_terms = -1;

/// One layer between two faces.
///
/// An image source at height z answers with exp(-|z| gamma) / 2, gamma = sqrt(s^2 + sigma_tr^2), the transform of
/// D&J's dipole term. The images form geometric series. With H = d + zb_top + zb_bottom and l <= d they add up to
///     R = a' cosh(gamma zb_top) sinh(gamma (d + zb_bottom - l)) / sinh(gamma H)
///     T = a' cosh(gamma zb_bottom) sinh(gamma (l + zb_top)) / sinh(gamma H)
/// and without absorption to R + T = 1 at s = 0, where the plain sum converges only conditionally. If the source lies
/// below the bottom (l > d) one image changes sign:
///     T = a' cosh(gamma (d + zb_top)) sinh(gamma (l - d - zb_bottom)) / sinh(gamma H)
/// which is negative unless l > d + zb_bottom, when R is. So signs are the same at all frequencies, and a look at
/// s = 0 tells.
class MultipoleLayer {
public:
    /// `above` and `below` are the indices of the neighbours. `terms` N takes the 2 N + 1 dipoles i = -N..N of the
    /// paper instead of the closed form.
    MultipoleLayer(const Layer& layer, double above, double below, int terms = all_terms);

    MultipoleResponse operator()(double s) const;

    double reduced_albedo, source_depth, sigma_tr, zb_top, zb_bottom, thickness;  ///< [length], [1/length]

private:
    MultipoleResponse closed_form(double gamma) const;
    double reflected(double gamma, double zb_near, double zb_far) const;
    double transmitted(double gamma, double zb_near, double zb_far) const;

    int terms_;
};

/// Layers by the adding formulas of D&J 2005 for T12 and R12, with what goes upwards kept apart from what goes downwards.
class MultipoleStack {
public:
    explicit MultipoleStack(std::span<const Layer> layers, int terms = all_terms);

    MultipoleResponse operator()(double s) const;

    const std::vector<MultipoleLayer>& layers() const { return layers_; }

private:
    std::vector<MultipoleLayer> layers_;
};

/// Share of negative light in a profile that is cut off with a warning; above it the profile is senseless.
inline constexpr double max_negative_share = 0.01;

/// L1 error of R(r) where the totals are right: 22 % for the half-space and 24 % for the conservative slab of the
/// reference cases.
inline constexpr double profile_error = 0.25;

/// The same where a source lies below its layer or a layer absorbs more than it scatters. No bound: there the profile is
/// another one altogether (66 to 600 % in the reference cases, whatever the total).
inline constexpr double profile_error_off_ground = 1;

/// The rung of the ladder. Light enters less the first surface's Fresnel loss and starts from a source at 1/mu_t' in
/// each layer; `Tt` holds all that the images send down, the unscattered part with it, and `R_unscattered` is 0: the
/// method knows neither. It knows no angle: diffuse light differs by its Fresnel loss alone.
///
/// `error_estimate` is measured, not guessed: the relative difference of Rd or Tt, whichever is larger, from our own
/// adding-doubling with few streams, a fraction of a millisecond; `profile_error` or `profile_error_off_ground` more
/// where profiles are asked for, whose difference nothing cheap can measure. It is 1 if adding-doubling has no answer.
/// What is senseless (negative totals, more light out than in, a profile with 1 % of its light negative) is a
/// SolverError; what is merely wrong is a warning with its size.
class Multipole final : public Solver {
public:
    std::string_view id() const override { return "multipole"; }
    std::string_view summary() const override;
    std::string unsuited(const Problem& problem) const override;
    Solution solve(const Problem& problem, const Effort& effort) const override;
};

const Solver& multipole_solver();

}  // namespace sanguine
