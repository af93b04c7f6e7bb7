// Holds both path-length tables against adding-doubling (totals) and direct Monte Carlo (profiles), and prints the tables
// of docs/optics.md.
//
//     check_path_table [photons per case = 1500000]
//
// The direct runs use photon_tracer.hpp, which shares nothing with the program that bakes, and another seed. Their
// photons die of the weaker absorption and carry the rest as a weight, so that dark skin is measured well. Takes some
// 5 minutes on one core.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <vector>

#include "sanguine/adding_doubling.hpp"
#include "sanguine/chromophores.hpp"
#include "sanguine/path_table.hpp"
#include "sanguine/photon_tracer.hpp"

namespace {

using namespace sanguine;
using namespace path_grid;

constexpr std::uint64_t seed = 4242;

struct Skin {
    double melanin, hemoglobin, oxygenation, thickness_mm, nm;
};

/// Ordinary skin and, from the tenth on, what a table finds hard: thick films, much pigment, much blood.
constexpr Skin skins[] = {
    {.015, .014, .72, .1, 450}, {.015, .014, .72, .1, 650}, {.03, .02, .72, .06, 550}, {.03, .02, .72, .06, 700},
    {.08, .014, .6, .1, 500},   {.5, .014, .7, .001, 450},  {.025, .014, .72, .5, 600}, {0, 0, .72, .1, 780},
    {.2, .02, .7, .1, 450},     {.43, .03, .7, .15, 600},   {.05, .25, 1, .02, 415},   {.03, .1, .3, .03, 415},
    {.03, .1, .3, .03, 560},    {.5, .05, .7, .03, 400},
};

struct Point {
    double tau, a1, a2;
};

Point table_point(const Skin& s, double scatter_scale) {
    SkinParameters skin;
    skin.melanin = s.melanin;
    skin.hemoglobin = s.hemoglobin;
    skin.oxygenation = s.oxygenation;
    const OpticalCoefficients c = optical_coefficients(skin, chromophores_at(s.nm));
    const double unit = 1 / (c.mu_s_prime_epidermis * scatter_scale);
    return {s.thickness_mm / unit, c.mu_a_epidermis * unit, c.mu_a_dermis * unit};
}

struct Direct {
    double total = 0, standard_error = 0;
    std::array<double, rings> energy{}, squares{};
};

Direct trace(const Point& at, Incidence incidence, int photons) {
    const double mu_s = 1 / (1 - anisotropy), dying = std::fmin(at.a1, at.a2);
    const std::array<Layer, 2> stack = {{{dying, mu_s, anisotropy, refractive_index, at.tau},
                                         {dying, mu_s * dermis_scattering, anisotropy, refractive_index, half_space}}};
    Direct d;
    double squares = 0;
    for (int p = 0; p < photons; ++p) {
        PhotonRandom random(seed, p);
        const PhotonEnd end = trace_photon(stack, incidence, random);
        if (end.fate != Fate::left_top)
            continue;
        const double weight = std::exp(-(at.a1 - dying) * end.path[0] - (at.a2 - dying) * end.path[1]) / photons;
        d.total += weight;
        squares += weight * weight;
        d.energy[ring_of(end.radius)] += weight;
        d.squares[ring_of(end.radius)] += weight * weight;
    }
    d.standard_error = std::sqrt(squares - d.total * d.total / photons);
    return d;
}

void compare(Incidence incidence, double scatter_scale, int photons) {
    const PathTable& table = PathTable::embedded(incidence);
    for (const Skin& s : skins) {
        const Point at = table_point(s, scatter_scale);
        if (at.tau > max_thickness)
            continue;
        const Direct direct = trace(at, incidence, photons);
        PathTable::DermisSums dermis;
        std::array<double, rings> energy;
        table.sum_dermis(at.tau, at.a2, dermis);
        const double total = table.ring_energies(dermis, at.a1, energy);
        const Problem problem{{{at.a1, 1 / (1 - anisotropy), anisotropy, refractive_index, at.tau},
                               {at.a2, dermis_scattering / (1 - anisotropy), anisotropy, refractive_index, half_space}},
                              incidence,
                              {}};
        Effort effort;
        effort.tolerance = 1e-4;
        const double exact = adding_doubling_solver().solve(problem, effort).Rd;
        const PathTable::Uncertainty stated = table.uncertainty(at.tau, at.a1, at.a2);
        double l1 = 0, noise = 0;
        for (int k = 0; k < rings; ++k) {
            l1 += std::fabs(energy[k] - direct.energy[k]);
            noise += std::sqrt(2 / std::numbers::pi * direct.squares[k]);
        }
        std::printf("| %g %g %g %g | %g | %.5f ± %.2f %% | %.5f | %.5f | %+.2f %% | %.2f %% | %.2f %% | %.2f %% |\n", s.melanin,
                    s.hemoglobin, s.oxygenation, s.thickness_mm, s.nm, direct.total,
                    100 * direct.standard_error / direct.total, exact, total, 100 * (total / exact - 1),
                    100 * stated.total, 100 * l1 / direct.total, 100 * noise / direct.total);
        std::fflush(stdout);
    }
}

/// Largest error of the total, over all nodes that have the neighbours, when every second node is left out.
double without_every_second(const PathTable& table, const Skin& skin) {
    const Point at = table_point(skin, 1);
    double worst = 0;
    for (int k = 3; k + 3 < nodes; ++k) {
        const auto log_total = [&](int node) { return std::log(table.total(node_thickness(node), at.a1, at.a2)); };
        const double predicted =
            (9 * (log_total(k - 1) + log_total(k + 1)) - log_total(k - 3) - log_total(k + 3)) / 16;
        worst = std::fmax(worst, std::fabs(std::expm1(predicted - log_total(k))));
    }
    return worst;
}

}  // namespace

int main(int argc, char** argv) {
    const int photons = argc > 1 ? std::atoi(argv[1]) : 1500000;
    if (photons < 1000) {
        std::fprintf(stderr, "usage: check_path_table [photons per case, at least 1000]\n");
        return 2;
    }
    const char* head = "| skin | nm | direct | adding-doubling | table | total | stated | profile, L1 | of that noise of the direct run |\n"
                       "|---|---|---|---|---|---|---|---|---|\n";
    std::printf("Diffuse light:\n\n%s", head);
    compare(Incidence::diffuse, 1, photons);
    std::printf("\nPencil beam:\n\n%s", head);
    compare(Incidence::normal, 1, photons);
    std::printf("\nDiffuse light, scattering doubled:\n\n%s", head);
    compare(Incidence::diffuse, 2, photons);
    std::printf("\nEvery second node left out, worst node (the interpolation in use is 16 times finer):\n\n"
                "| skin | nm | diffuse | normal |\n|---|---|---|---|\n");
    for (const Skin& s : skins)
        std::printf("| %g %g %g %g | %g | %.2f %% | %.2f %% |\n", s.melanin, s.hemoglobin, s.oxygenation, s.thickness_mm,
                    s.nm, 100 * without_every_second(PathTable::embedded(Incidence::diffuse), s),
                    100 * without_every_second(PathTable::embedded(Incidence::normal), s));
    return 0;
}
