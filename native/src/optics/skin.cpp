#include "sanguine/skin.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

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

/// Skins of a group differ in their epidermal absorption alone.
std::vector<std::vector<std::size_t>> group_by_dermis(std::span<const SkinParameters> skins) {
    const auto key = [&](std::size_t i) {
        const SkinParameters& s = skins[i];
        return std::tuple(s.epidermis_thickness_mm, s.scatter_scale, s.hemoglobin, s.oxygenation, s.vessel_radius_mm,
                          s.bilirubin_umol_per_l);
    };
    std::vector<std::size_t> order(skins.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return key(a) < key(b); });

    std::vector<std::vector<std::size_t>> groups;
    for (const std::size_t i : order) {
        if (groups.empty() || groups.back().size() == max_group || key(groups.back().front()) != key(i))
            groups.emplace_back();
        groups.back().push_back(i);
    }
    return groups;
}

}  // namespace

std::vector<double> reflectance(std::span<const SkinParameters> skins, std::span<const double> wavelengths_nm,
                                int threads, const Progress& progress) {
    const PathTable& table = PathTable::embedded();
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
    const PathTable& table = PathTable::embedded();
    const std::vector<Chromophores> pure = chromophores(wavelengths_nm);
    const auto groups = group_by_dermis(skins);
    parallel_for(groups.size(), threads, progress, [&](std::size_t g) {
        PathTable::DermisSums dermis;
        std::array<double, path_grid::rings> energy;
        for (std::size_t w = 0; w < pure.size(); ++w) {
            const TablePoint shared = table_point(skins[groups[g].front()], pure[w]);
            table.sum_dermis(shared.tau, shared.a2, dermis);
            for (const std::size_t i : groups[g]) {
                table.ring_energies(dermis, table_point(skins[i], pure[w]).a1, energy);
                visit(i, w, RadialProfile(energy, shared.unit_mm));
            }
        }
    });
}

std::vector<double> default_radii_mm() {
    constexpr int count = 114;  // a tenth apart
    constexpr double first = 0.0005, last = 40;
    std::vector<double> radii;
    for (int k = 0; k < count; ++k)
        radii.push_back(first * std::pow(last / first, k / (count - 1.0)));
    return radii;
}

std::span<const double> rgb_ring_edges_mm() {
    // 0.0005 mm, well inside the first ring of every wavelength, to 60 mm, outside the last of the reddest.
    static const std::vector<double> edges = [] {
        std::vector<double> out;
        for (double r = 0.0005; r < 60; r *= path_grid::radius_ratio)
            out.push_back(r);
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
                       double inside = 0;
                       for (std::size_t k = 0; k < edges.size(); ++k) {
                           const double within = profile.energy_within(edges[k]), ring = within - inside;
                           inside = within;
                           for (int c = 0; c < 3; ++c)
                               out[i][k][c] += weights[w][c] * ring;
                       }
                   });
    return out;
}

}  // namespace sanguine
