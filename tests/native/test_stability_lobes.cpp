// The lobe fit on profiles that no skin has: flat, spiky, zero, negative, of any scale.
#include "sanguine/burley.hpp"

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "sanguine/path_table.hpp"

namespace sanguine {
namespace {

using Profile = std::pair<std::string, std::vector<double>>;

std::size_t ring_count() {
    return rgb_ring_edges_mm().size();
}

/// Energy per ring, each profile with a total of about 1.
std::vector<Profile> profiles() {
    const std::span<const double> edges = rgb_ring_edges_mm();
    const std::size_t n = edges.size();
    std::vector<Profile> all;
    all.emplace_back("flat in ln r", std::vector<double>(n, 1.0 / static_cast<double>(n)));

    std::vector<double> disk(n);  // the same light on every square millimetre
    const double area = edges.back() * edges.back();
    for (std::size_t i = 0; i < n; ++i)
        disk[i] = (edges[i] * edges[i] - (i > 0 ? edges[i - 1] * edges[i - 1] : 0)) / area;
    all.emplace_back("flat per area", disk);

    for (std::size_t i = 0; i < n; ++i) {
        std::vector<double> spike(n);
        spike[i] = 1;
        all.emplace_back("spike in ring " + std::to_string(i), spike);
    }
    for (const std::size_t apart : {std::size_t{1}, n / 2, n - 1}) {
        std::vector<double> two(n);
        two[0] = two[apart] = 0.5;
        all.emplace_back("spikes " + std::to_string(apart) + " apart", two);
    }
    std::vector<double> comb(n), signs(n), step(n), dip(n, 2.0 / static_cast<double>(n));
    for (std::size_t i = 0; i < n; ++i) {
        comb[i] = i % 2 == 0 ? 2.0 / static_cast<double>(n) : 0;
        signs[i] = i % 2 == 0 ? 2 : -1.99;
        step[i] = i < n / 2 ? 0 : 2.0 / static_cast<double>(n);
    }
    dip[n / 2] = -1;
    all.emplace_back("comb", comb);
    all.emplace_back("alternating signs", signs);
    all.emplace_back("step", step);
    all.emplace_back("flat with a negative spike", dip);
    return all;
}

void expect_lobes(const std::string& name, std::span<const double> energy, int count, double scale) {
    double total = 0, absolute = 0;
    for (const double e : energy) {
        total += e;
        absolute += std::fabs(e);
    }
    const BurleyFit fit = fit_burley(energy, rgb_ring_edges_mm(), count);
    double sum = 0;
    for (int k = 0; k < count; ++k) {
        EXPECT_GE(fit.weight[k], 0) << name;
        EXPECT_TRUE(fit.d_mm[k] > 0 && std::isfinite(fit.d_mm[k])) << name << ' ' << fit.d_mm[k];
        sum += fit.weight[k];
    }
    // 1e-9 of the light: what the solution of the small linear systems loses.
    EXPECT_NEAR(sum, std::fmax(total, 0), 1e-9 * absolute + std::numeric_limits<double>::denorm_min() * count) << name << ' ' << scale;
    EXPECT_TRUE(fit.clamped >= 0 && std::isfinite(fit.clamped)) << name << ' ' << fit.clamped;
    EXPECT_TRUE(fit.fit_error >= 0 && std::isfinite(fit.fit_error)) << name << ' ' << fit.fit_error;
    // Nothing can be wronger than all light in the wrong place, plus the negative light counted twice.
    if (total > 0)
        EXPECT_LE(fit.fit_error, 1 + absolute / total + 1e-9) << name << ' ' << scale;
}

TEST(LobeStability, FlatSpikyAndSignedProfiles) {
    for (const auto& [name, energy] : profiles())
        for (int count = 1; count <= max_lobes; ++count)
            expect_lobes(name, energy, count, 1);
}

TEST(LobeStability, AnyScale) {
    // From denormal light to as much as can be added up: the shape is what is fitted.
    for (const double scale : {1e-320, 1e-300, 1e-100, 1e-10, 1e10, 1e100, 1e300})
        for (const auto& [name, energy] : profiles()) {
            std::vector<double> scaled = energy;
            for (double& e : scaled)
                e *= scale;
            expect_lobes(name, scaled, max_lobes, scale);
        }
}

TEST(LobeStability, ScaleDoesNotChangeTheShape) {
    for (const auto& [name, energy] : profiles()) {
        std::vector<double> scaled = energy;
        for (double& e : scaled)
            e = std::ldexp(e, -40);
        const BurleyFit one = fit_burley(energy, rgb_ring_edges_mm(), max_lobes);
        const BurleyFit other = fit_burley(scaled, rgb_ring_edges_mm(), max_lobes);
        for (int k = 0; k < max_lobes; ++k) {
            EXPECT_EQ(one.d_mm[k], other.d_mm[k]) << name;
            EXPECT_EQ(std::ldexp(one.weight[k], -40), other.weight[k]) << name;
        }
    }
}

TEST(LobeStability, NoLightNoWeight) {
    for (const double value : {0.0, -0.0, -1e-320, -1.0}) {
        const std::vector<double> energy(ring_count(), value);
        const BurleyFit fit = fit_burley(energy, rgb_ring_edges_mm(), max_lobes);
        for (int k = 0; k < max_lobes; ++k) {
            EXPECT_EQ(fit.weight[k], 0);
            EXPECT_TRUE(fit.d_mm[k] > 0 && std::isfinite(fit.d_mm[k]));
        }
        EXPECT_EQ(fit.clamped, 1);
        EXPECT_EQ(fit.fit_error, 1);
    }
}

TEST(LobeStability, NeighbouringSpikesHaveNeighbouringLobes) {
    // Moving all light outwards by one ring, a factor 1.2, widens every lobe and by no more than a factor of 2: inside
    // a table nothing jumps from one end to the other.
    std::vector<double> mean;
    for (std::size_t i = 5; i + 5 < ring_count(); ++i) {
        std::vector<double> energy(ring_count());
        energy[i] = 1;
        const BurleyFit fit = fit_burley(energy, rgb_ring_edges_mm(), max_lobes);
        double sum = 0;
        for (int k = 0; k < max_lobes; ++k)
            sum += fit.weight[k] * fit.d_mm[k];
        mean.push_back(sum);
    }
    for (std::size_t i = 1; i < mean.size(); ++i) {
        EXPECT_GT(mean[i], mean[i - 1]) << i;
        EXPECT_LT(mean[i], 2 * mean[i - 1]) << i;
    }
}

TEST(LobeStability, LightNearlyCancelledBySignsIsStillFinite) {
    // A channel outside the gamut: as much negative as positive light, all but the last digits.
    for (const double left : {1e-3, 1e-9, 1e-15, 0.0}) {
        std::vector<double> energy(ring_count());
        energy[10] = 1;
        energy[40] = -1 + left;
        expect_lobes("cancelled to " + std::to_string(left), energy, max_lobes, left);
    }
}

TEST(LobeStability, NotANumberIsNotFitted) {
    for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
        std::vector<double> energy(ring_count(), 0.01);
        energy[3] = bad;
        EXPECT_THROW(fit_burley(energy, rgb_ring_edges_mm(), max_lobes), std::invalid_argument);
    }
}

}  // namespace
}  // namespace sanguine
