// The two-layer skin problem, traced once.
//
// In this model scattering depends on wavelength only through mu_s'(lambda), and the dermis scatters half as much
// as the epidermis. In units of 1/mu_s' of the epidermis every wavelength and thickness is therefore one problem
// with one number, tau = mu_s' d. Photons are traced for a row of tau, and what leaves is sorted by exit radius
// and by the ways L1, L2 it went in epidermis and dermis. Any absorption then enters as exponentials,
//
//     R(ring) = (1 - F) / N * sum over L1, L2 of count(ring, L1, L2) exp(-a1 L1 - a2 L2),
//
// non-negative, monotone in each absorption, below 1 - F and with rings that add up to the total, by construction
// ("white" Monte Carlo: Kienle and Patterson 1996, Phys. Med. Biol. 41:2221; Alerstam et al. 2008, J. Biomed. Opt.
// 13:041304). Photons are baked with a small absorption a0 in both layers, below that of any skin, which ends the
// endless paths without a cut-off; the sum above uses a - a0, so the result is unbiased for every a >= a0.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace sanguine {

/// Layout of the table, shared by the program that bakes it and the code that reads it. Lengths are in units of
/// 1/mu_s' of the epidermis.
namespace path_grid {

inline constexpr double anisotropy = 0.8;            ///< Henyey-Greenstein g of both layers
inline constexpr double refractive_index = 1.4;      ///< of both layers, in air
inline constexpr double dermis_scattering = 0.5;     ///< mu_s' of the dermis
inline constexpr double reference_absorption = 0.005;///< a0; skin's own minimum is 0.0060 (baseline at 700 nm)

inline constexpr int nodes = 22;                     ///< of tau, see node_thickness
inline constexpr double max_thickness = 7.5;         ///< 0.5 mm at 380 nm is 7.27

inline constexpr int rings = 57;                     ///< an inner disk, 55 logarithmic rings, everything beyond
inline constexpr double first_radius = 0.01;
inline constexpr double radius_ratio = 1.2;

inline constexpr int bins = 45;                      ///< of path length: none at all, up to first_path, logarithmic
inline constexpr double first_path = 0.02;
inline constexpr double path_ratio = 1.3;

/// Thickness of the epidermis at node `k`: evenly spaced in ln(1 + 10 tau), linear near 0 and logarithmic above.
double node_thickness(int k);
/// Outer radius of ring `k`, 0 <= k < rings - 1.
double ring_edge(int k);
int ring_of(double radius);
int bin_of(double path);

inline constexpr std::uint64_t magic = 0x31485441504e4153ULL;  // "SANPATH1", little-endian

}  // namespace path_grid

/// CRC-32 (ISO 3309), which closes the file of the table.
std::uint32_t crc32(std::span<const std::uint8_t> bytes);

/// The decoded table. Immutable, hence safe to share between threads.
///
/// Arguments are dimensionless: tau = mu_s' d, a1 = mu_a/mu_s' of the epidermis and a2 = mu_a/mu_s' of the dermis,
/// both over mu_s' of the *epidermis*, 0 <= tau <= max_thickness and a1, a2 >= reference_absorption. Results are
/// fractions of Lambertian light that falls on one point of the skin, its loss at the surface included.
class PathTable {
public:
    /// Decodes the format that bake_path_table writes. Throws std::runtime_error if it is damaged.
    explicit PathTable(std::span<const std::uint8_t> file);

    /// The table that is built into the library.
    static const PathTable& embedded();

    /// Four nodes around a tau, and how to interpolate between them.
    struct Stencil {
        int first;                     ///< node
        std::array<double, 4> cubic;   ///< Lagrange weights
        int lower;                     ///< tau lies between first + lower and the next node,
        double fraction;               ///< this far
    };

    /// The part of the sum that is the same for all skins with one dermis and one tau: over L2, per node around
    /// tau, ring and L1. It is nearly all of the work.
    struct DermisSums {
        Stencil stencil;
        std::vector<float> sums;  ///< [4][rings][bins]
    };
    void sum_dermis(double tau, double a2, DermisSums& out) const;

    /// Energy that leaves in each ring; returns the total. Equals total(tau, a1, a2).
    double ring_energies(const DermisSums& dermis, double a1, std::span<double, path_grid::rings> out) const;

    /// Total reflectance, without the rings.
    double total(double tau, double a1, double a2) const;

    /// Photons that entered the skin at node `k`.
    std::uint64_t photons(int k) const { return nodes_[k].photons; }

private:
    /// Mean and half-width of a bin: its paths are taken as uniform in mean +- half, exact to the second moment.
    struct Bin {
        double mean, half;
    };
    /// Counts of one ring (or of all rings together) and one L1, without the empty ends in L2.
    struct Row {
        std::uint32_t data;
        std::uint8_t begin, end;
    };
    struct Node {
        std::uint64_t photons;
        std::array<std::array<Bin, path_grid::bins>, 2> layer;
        std::array<std::array<Row, path_grid::bins>, path_grid::rings + 1> rows;
    };

    using Weights = std::array<float, path_grid::bins>;
    static Weights attenuation(const std::array<Bin, path_grid::bins>& bins, double a);

    std::vector<Node> nodes_;
    std::vector<float> counts_;
};

}  // namespace sanguine
