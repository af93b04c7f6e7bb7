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
//
// There is one table for each way light falls in.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <new>
#include <span>
#include <vector>

#include "sanguine/stack.hpp"

namespace sanguine {

/// Layout of the table, shared by the program that bakes it and the code that reads it. Lengths are in units of
/// 1/mu_s' of the epidermis.
namespace path_grid {

inline constexpr double anisotropy = 0.8;            ///< Henyey-Greenstein g of both layers
inline constexpr double refractive_index = 1.4;      ///< of both layers, in air
inline constexpr double dermis_scattering = 0.5;     ///< mu_s' of the dermis
inline constexpr double reference_absorption = 0.002;///< a0; skin's own minimum is 0.0060 (baseline at 700 nm), half
                                                     ///< of it where tissue scatters twice as much

inline constexpr int nodes = 26;                     ///< of tau, see node_thickness
inline constexpr double max_thickness = 15;          ///< 0.5 mm at 380 nm is 7.27, twice that with twice the scattering

/// Absorption that the table still resolves, over mu_s' of the epidermis: paths of 1/max_absorption and their noise.
inline constexpr double max_absorption = 600;

inline constexpr int rings = 57;                     ///< an inner disk, 55 logarithmic rings, everything beyond
inline constexpr double first_radius = 0.01;
inline constexpr double radius_ratio = 1.2;

inline constexpr int bins = 48;                      ///< of path length: none at all, up to first_path, logarithmic
inline constexpr double first_path = 0.01;
inline constexpr double path_ratio = 1.3;

/// Thickness of the epidermis at node `k`: evenly spaced in ln(1 + 10 tau), linear near 0 and logarithmic above.
double node_thickness(int k);
/// Outer radius of ring `k`, 0 <= k < rings - 1.
double ring_edge(int k);
int ring_of(double radius);
int bin_of(double path);

inline constexpr std::uint64_t magic = 0x32485441504e4153ULL;  // "SANPATH2", little-endian

}  // namespace path_grid

/// Floats that begin where a vector register's worth does: loads of 16 would else touch two cache lines each.
template <class T> struct CacheAligned {
    using value_type = T;
    static constexpr std::align_val_t alignment{64};

    CacheAligned() = default;
    template <class U> CacheAligned(const CacheAligned<U>&) {}
    T* allocate(std::size_t count) { return static_cast<T*>(::operator new(count * sizeof(T), alignment)); }
    void deallocate(T* data, std::size_t) { ::operator delete(data, alignment); }
    template <class U> bool operator==(const CacheAligned<U>&) const { return true; }
};
using AlignedFloats = std::vector<float, CacheAligned<float>>;

/// CRC-32 (ISO 3309), which closes the file of the table.
std::uint32_t crc32(std::span<const std::uint8_t> bytes);

/// The decoded table. Immutable, hence safe to share between threads.
///
/// Arguments are dimensionless: tau = mu_s' d, a1 = mu_a/mu_s' of the epidermis and a2 = mu_a/mu_s' of the dermis,
/// both over mu_s' of the *epidermis*, 0 <= tau <= max_thickness and a1, a2 >= reference_absorption. Results are
/// fractions of the light that falls on one point of the skin, its loss at the surface included.
///
/// Sums are taken in float, in vector units where there are any, and in the same order everywhere: results do not
/// depend on the machine. Totals lie within 1e-6 of double precision, rings within 5e-6 in the L1 norm; no absorption
/// makes the total rise by more than 2e-6 as long as both are below 12, which is all skin, and by more than 0.2 % up to
/// max_absorption (test_path_table).
class PathTable {
public:
    /// Decodes the format that bake_path_table writes. Throws std::runtime_error if it is damaged.
    explicit PathTable(std::span<const std::uint8_t> file);

    /// The table that is built into the library, decoded when first asked for.
    static const PathTable& embedded(Incidence incidence);

    Incidence incidence() const { return incidence_; }

    /// Four nodes around a tau, and how to interpolate between them: linearly between the two neighbours, bent by the
    /// second differences D0 (around the second node) and D1 (around the third) so that a cubic comes out.
    struct Stencil {
        int first;             ///< node
        int lower;             ///< tau lies between first + lower and the next node,
        double fraction;       ///< this far
        double bend0, bend1;   ///< factors of D0 and D1
        double fraction_slope, bend0_slope, bend1_slope;  ///< derivatives by tau
        double spacing, spacing_slope;  ///< of the nodes in tau, and its derivative
    };
    static Stencil stencil_at(double tau);

    static constexpr int padded_rings = 64;
    static_assert(path_grid::rings <= padded_rings);

    /// The part of the sum that is the same for all skins with one dermis and one tau: over L2, per node around
    /// tau, L1 and ring. It is nearly all of the work.
    struct DermisSums {
        Stencil stencil;
        AlignedFloats sums;  ///< per node, per row of that node: [padded_rings]
    };
    void sum_dermis(double tau, double a2, DermisSums& out) const;

    /// Energy that leaves in each ring; returns the total. Equals total(tau, a1, a2).
    double ring_energies(const DermisSums& dermis, double a1, std::span<double, path_grid::rings> out) const;

    /// Total reflectance, without the rings.
    double total(double tau, double a1, double a2) const;

    /// Total reflectance and its partial derivatives, exact for the interpolated table.
    struct Gradient {
        double total, by_tau, by_a1, by_a2;
    };
    Gradient total_with_gradient(double tau, double a1, double a2) const;

    /// The rings in double precision without any shortcut: what the fast sums are held against. Returns the total.
    double ring_energies_in_double(double tau, double a1, double a2, std::span<double, path_grid::rings> out) const;

    /// What the table does not know, as relative errors. Each part is found from the table itself: the noise of its
    /// photons (two standard errors), the interpolation between its nodes (what a parabola makes of it instead of the
    /// cubic), and the spread of paths within a bin (two points instead of a uniform one of the same variance).
    struct Uncertainty {
        double total;    ///< of the total
        double profile;  ///< L1 norm over the rings, without what a single total explains
    };
    Uncertainty uncertainty(double tau, double a1, double a2) const;

    /// Photons that entered the skin at node `k`.
    std::uint64_t photons(int k) const { return nodes_[k].photons; }

private:
    static constexpr int block = 16;  ///< rings that are added up together

    /// The paths of a bin are taken as uniform from `begin` over `width`, exact to the second moment.
    struct Bins {
        alignas(64) std::array<float, path_grid::bins> begin, width;
    };
    /// Counts of one L1 in `block` rings, for L2 from `begin` to `end`: [L2][block].
    struct Strip {
        std::uint32_t data;
        std::uint8_t begin, end;
    };
    /// Counts of one L1; rows without any are left out.
    struct Row {
        int bin;
        std::uint32_t totals;  ///< of all rings: [L2]
        std::array<Strip, padded_rings / block> strips;
    };
    struct Node {
        std::uint64_t photons;
        std::array<Bins, 2> layer;
        std::vector<Row> rows;
    };

    void add_node(Node& node, const std::vector<float>& counts);

    using Weights = std::array<float, path_grid::bins>;
    static void attenuate(const Bins& bins, double a, Weights& out);
    static void attenuate_with_slope(const Bins& bins, double a, Weights& out, Weights& slope);
    static void add_totals(const float* counts, const Row* rows, std::size_t row_count, const Weights& epidermis,
                           Weights& out);
    static void add_strips(const float* counts, const Row* rows, std::size_t row_count, const Weights& dermis, float* out);
    static void add_rows(const float* sums, const Row* rows, std::size_t row_count, const Weights& epidermis, float* out);

    Incidence incidence_;
    double entry_;  ///< share of the light that the surface lets in
    std::vector<Node> nodes_;
    AlignedFloats counts_;
};

}  // namespace sanguine
