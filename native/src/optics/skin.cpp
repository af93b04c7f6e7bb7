#include "sanguine/skin.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <utility>

namespace sanguine {
namespace {

/// Dimensionless arguments of the path table.
struct TablePoint {
    double tau, a1, a2, unit_mm;
};

TablePoint table_point(const SkinParameters& skin, const Chromophores& pure) {
    const OpticalCoefficients c = optical_coefficients(skin, pure);
    const double unit = 1 / c.mu_s_prime_epidermis;
    return {skin.epidermis_thickness_mm / unit, c.mu_a_epidermis * unit, c.mu_a_dermis * unit, unit};
}

/// Spacing of the wavelengths that an RGB profile is integrated from.
constexpr double spectral_step_nm = 5;

std::vector<Chromophores> chromophores(std::span<const double> wavelengths_nm) {
    std::vector<Chromophores> pure;
    for (const double nm : wavelengths_nm)
        pure.push_back(chromophores_at(nm));
    return pure;
}

/// What one thread takes at a time: long enough to share a dermis, short enough to spread and to be cancelled.
constexpr std::size_t max_group = 32;

/// The dermal arguments of a skin at all wavelengths, in one number. Two dermises may share it by accident: it only
/// says which skins are worth doing side by side.
std::uint64_t dermis_hash(const SkinParameters& skin, std::span<const Chromophores> pure) {
    std::uint64_t hash = 0;
    for (const Chromophores& c : pure) {
        const TablePoint p = table_point(skin, c);
        for (const double value : {p.tau, p.a2}) {
            hash = (hash ^ std::bit_cast<std::uint64_t>(value)) * 0x9e3779b97f4a7c15ULL;
            hash ^= hash >> 32;
        }
    }
    return hash;
}

/// Skins of a group most likely differ in their epidermal absorption alone.
std::vector<std::vector<std::size_t>> group_by_dermis(std::span<const SkinParameters> skins,
                                                      std::span<const Chromophores> pure) {
    std::vector<std::pair<std::uint64_t, std::size_t>> order(skins.size());
    for (std::size_t i = 0; i < skins.size(); ++i)
        order[i] = {dermis_hash(skins[i], pure), i};
    std::sort(order.begin(), order.end());

    std::vector<std::vector<std::size_t>> groups;
    std::uint64_t last = 0;
    for (const auto& [hash, i] : order) {
        if (groups.empty() || groups.back().size() == max_group || hash != last)
            groups.emplace_back();
        groups.back().push_back(i);
        last = hash;
    }
    return groups;
}

}  // namespace

std::vector<double> reflectance(std::span<const SkinParameters> skins, std::span<const double> wavelengths_nm,
                                int threads, const Progress& progress) {
    const PathTable& table = PathTable::embedded(Incidence::diffuse);
    const std::vector<Chromophores> pure = chromophores(wavelengths_nm);
    std::vector<double> out(skins.size() * pure.size());
    parallel_for(skins.size(), threads, progress, [&](std::size_t i) {
        for (std::size_t w = 0; w < pure.size(); ++w) {
            const TablePoint p = table_point(skins[i], pure[w]);
            out[i * pure.size() + w] = table.total(p.tau, p.a1, p.a2);
        }
    });
    return out;
}

void solve_profiles(std::span<const SkinParameters> skins, std::span<const double> wavelengths_nm, int threads,
                    const Progress& progress, const ProfileVisitor& visit) {
    const PathTable& table = PathTable::embedded(Incidence::diffuse);
    const std::vector<Chromophores> pure = chromophores(wavelengths_nm);
    const auto groups = group_by_dermis(skins, pure);
    parallel_for(groups.size(), threads, progress, [&](std::size_t g) {
        PathTable::DermisSums dermis;
        std::array<double, path_grid::rings> energy;
        for (std::size_t w = 0; w < pure.size(); ++w) {
            TablePoint summed{-1, -1, -1, -1};
            for (const std::size_t i : groups[g]) {
                const TablePoint p = table_point(skins[i], pure[w]);
                if (p.tau != summed.tau || p.a2 != summed.a2)
                    table.sum_dermis(p.tau, p.a2, dermis);
                summed = p;
                table.ring_energies(dermis, p.a1, energy);
                visit(i, w, RadialProfile(energy, p.unit_mm));
            }
        }
    });
}

std::vector<double> default_radii_mm() {
    constexpr int count = 119;  // a tenth apart
    constexpr double first = 0.0003, last = 40;
    std::vector<double> radii;
    for (int k = 0; k < count; ++k)
        radii.push_back(first * std::pow(last / first, k / (count - 1.0)));
    return radii;
}

constexpr std::size_t max_rgb_rings = 80;

std::span<const double> rgb_ring_edges_mm() {
    // 0.0003 mm, inside the first ring of every wavelength (0.00034 mm at 380 nm and scatter_scale 2), to 60 mm,
    // outside the last of the reddest but for scatter_scale below 1.
    static const std::vector<double> edges = [] {
        std::vector<double> out;
        for (double r = 0.0003; r < 60; r *= path_grid::radius_ratio)
            out.push_back(r);
        if (out.size() > max_rgb_rings)
            throw std::logic_error("rgb_ring_edges_mm: more than max_rgb_rings");
        return out;
    }();
    return edges;
}

std::size_t rgb_wavelength_count() {
    return static_cast<std::size_t>((max_wavelength_nm - min_wavelength_nm) / spectral_step_nm) + 1;
}

std::vector<RgbRings> rgb_rings(std::span<const SkinParameters> skins, const Matrix3& rgb, int threads,
                                const Progress& progress) {
    std::vector<double> wavelengths(rgb_wavelength_count());
    for (std::size_t w = 0; w < wavelengths.size(); ++w)
        wavelengths[w] = min_wavelength_nm + static_cast<double>(w) * spectral_step_nm;
    std::vector<Colour> weights = xyz_weights(wavelengths);
    for (Colour& weight : weights) {
        for (double& w : weight)
            w /= 100;
        weight = rgb * weight;
    }

    const std::span<const double> edges = rgb_ring_edges_mm();
    std::vector<RgbRings> out(skins.size(), RgbRings(edges.size()));
    solve_profiles(skins, wavelengths, threads, progress,
                   [&](std::size_t i, std::size_t w, const RadialProfile& profile) {
                       std::array<double, max_rgb_rings> within;
                       profile.energy_within_ladder(edges[0], std::span(within).first(edges.size()));
                       double inside = 0;
                       Colour* ring = out[i].data();
                       for (std::size_t k = 0; k < edges.size(); ++k) {
                           const double energy = within[k] - inside;
                           inside = within[k];
                           for (int c = 0; c < 3; ++c)
                               ring[k][c] += weights[w][c] * energy;
                       }
                   });
    return out;
}

}  // namespace sanguine
