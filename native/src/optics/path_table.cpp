#include "sanguine/path_table.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "embedded_data.hpp"
#include "sanguine/fresnel.hpp"
#include "vector_math.hpp"

namespace sanguine {

namespace path_grid {

double node_thickness(int k) {
    return std::expm1(k * std::log1p(10 * max_thickness) / (nodes - 1)) / 10;
}

double ring_edge(int k) {
    return first_radius * std::pow(radius_ratio, k);
}

int ring_of(double radius) {
    if (radius < first_radius)
        return 0;
    return std::min(rings - 1, 1 + static_cast<int>(std::log(radius / first_radius) / std::log(radius_ratio)));
}

int bin_of(double path) {
    if (path <= 0)
        return 0;
    if (path < first_path)
        return 1;
    return std::min(bins - 1, 2 + static_cast<int>(std::log(path / first_path) / std::log(path_ratio)));
}

}  // namespace path_grid

using namespace path_grid;
using namespace vector_math;

std::uint32_t crc32(std::span<const std::uint8_t> bytes) {
    static constexpr auto table = [] {
        std::array<std::uint32_t, 256> out{};
        for (std::uint32_t byte = 0; byte < 256; ++byte) {
            std::uint32_t crc = byte;
            for (int bit = 0; bit < 8; ++bit)
                crc = (crc >> 1) ^ (crc & 1 ? 0xedb88320U : 0U);
            out[byte] = crc;
        }
        return out;
    }();
    std::uint32_t crc = ~0U;
    for (const std::uint8_t byte : bytes)
        crc = (crc >> 8) ^ table[(crc ^ byte) & 0xff];
    return ~crc;
}

namespace {

class Reader {
public:
    explicit Reader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

    template <class T> T raw() {
        T value;
        std::memcpy(&value, take(sizeof value), sizeof value);
        return value;
    }
    std::uint64_t number() {
        std::uint64_t value = 0;
        for (int shift = 0;; shift += 7) {
            const std::uint8_t byte = *take(1);
            value |= std::uint64_t{byte & 0x7fU} << shift;
            if (byte < 0x80)
                return value;
        }
    }

private:
    const std::uint8_t* take(std::size_t count) {
        if (bytes_.size() < count)
            throw std::runtime_error("path table: file is cut short");
        const std::uint8_t* start = bytes_.data();
        bytes_ = bytes_.subspan(count);
        return start;
    }
    std::span<const std::uint8_t> bytes_;
};

/// Results are interpolated as ln(R + floor): what lies below needs no logarithm, and nothing has to be told apart.
constexpr double log_floor = 1e-9;

/// A second difference may be this many times its neighbour, and a little more; one that is larger by a factor f beyond
/// counts as f times smaller: where one node is dark and the next is not, a cubic would overshoot by orders of
/// magnitude. Smooth data, all skin but opaque films, never meet the limit.
constexpr double bend_ratio = 3, bend_slack = 0.05;

/// From where on an epidermis is so opaque that light dies on the way from node to node: mu_a times their spacing. The
/// bends fade there, and what is left, a line between two falling values, falls with them.
constexpr double opaque_step = 1;

struct Fade {
    double factor, by_a1, by_tau;

    Fade(const PathTable::Stencil& s, double a1) {
        const double step = std::fmin(a1, 1e6) * s.spacing / opaque_step, fourth = step * step * step * step;
        factor = 1 / (1 + fourth);
        const double slope = -4 * fourth * factor * factor;  // by the logarithm of the step
        by_a1 = slope / a1;
        by_tau = slope / s.spacing * s.spacing_slope;
    }
};

/// ln(R + floor) at a stencil, and as the combination of those of its nodes that it is.
struct Blend {
    double log = 0, by_tau = 0, by_a1 = 0;  ///< by_a1 of the fading alone
    std::array<double, 4> weight{};

    Blend(const PathTable::Stencil& s, double a1, const std::array<double, 4>& value) {
        const Fade fade(s, a1);
        double bent = 0;
        const auto add = [&](int difference, double factor) {
            weight[difference] += factor;
            weight[difference + 1] -= 2 * factor;
            weight[difference + 2] += factor;
        };
        const auto bend = [&](double d, int of, double other, int of_other, double factor, double factor_slope) {
            const double limit = bend_ratio * std::fabs(other) + bend_slack;
            double used = d;
            if (std::fabs(d) > limit) {
                used = limit * (limit / d);
                add(of, -fade.factor * factor * (limit / d) * (limit / d));
                add(of_other, fade.factor * factor * 2 * (limit / d) * std::copysign(bend_ratio, other));
            } else {
                add(of, fade.factor * factor);
            }
            bent += factor * used;
            by_tau += fade.factor * factor_slope * used;
        };
        const double d0 = value[0] - 2 * value[1] + value[2], d1 = value[1] - 2 * value[2] + value[3];
        bend(d0, 0, d1, 1, s.bend0, s.bend0_slope);
        bend(d1, 1, d0, 0, s.bend1, s.bend1_slope);
        weight[s.lower] += 1 - s.fraction;
        weight[s.lower + 1] += s.fraction;
        log = std::lerp(value[s.lower], value[s.lower + 1], s.fraction) + fade.factor * bent;
        by_tau += (value[s.lower + 1] - value[s.lower]) * s.fraction_slope + fade.by_tau * bent;
        by_a1 = fade.by_a1 * bent;
    }

    double result() const { return std::fmax(0, std::exp(log) - log_floor); }
};

std::array<double, 4> logs(const std::array<double, 4>& value) {
    std::array<double, 4> out;
    for (int k = 0; k < 4; ++k)
        out[k] = std::log(value[k] + log_floor);
    return out;
}

double interpolate(const PathTable::Stencil& stencil, double a1, const std::array<double, 4>& value) {
    return Blend(stencil, a1, logs(value)).result();
}

/// The same for every ring: [node][ring] to [ring].
SANGUINE_VECTOR_CLONES
void interpolate_rings(const float* value, const PathTable::Stencil& stencil, float fade, float* out) {
    constexpr int n = PathTable::padded_rings;
    constexpr float floor = static_cast<float>(log_floor), ratio = bend_ratio, slack = bend_slack;
    alignas(64) float log[4 * n];
    for (int i = 0; i < 4 * n; ++i)
        log[i] = logarithm(value[i] + floor);
    const float* lower = log + stencil.lower * n;
    const float* upper = lower + n;
    const float t = static_cast<float>(stencil.fraction), bend0 = fade * static_cast<float>(stencil.bend0),
                bend1 = fade * static_cast<float>(stencil.bend1);
    for (int i = 0; i < n; ++i) {
        const float d0 = log[i] - 2 * log[n + i] + log[2 * n + i], d1 = log[n + i] - 2 * log[2 * n + i] + log[3 * n + i];
        const float limit0 = ratio * std::fabs(d1) + slack, limit1 = ratio * std::fabs(d0) + slack;
        const bool beyond0 = std::fabs(d0) > limit0, beyond1 = std::fabs(d1) > limit1;
        const float used0 = beyond0 ? limit0 * (limit0 / (beyond0 ? d0 : 1)) : d0;
        const float used1 = beyond1 ? limit1 * (limit1 / (beyond1 ? d1 : 1)) : d1;
        const float minus = -(lower[i] + t * (upper[i] - lower[i]) + bend0 * used0 + bend1 * used1);
        const float result = exp_minus(minus > 0 ? minus : 0) - floor;
        out[i] = result > 0 ? result : 0;
    }
}

}  // namespace

PathTable::Stencil PathTable::stencil_at(double tau) {
    static const double scale = (nodes - 1) / std::log1p(10 * max_thickness);
    const double position = std::log1p(10 * tau) * scale;
    Stencil s;
    s.first = std::clamp(static_cast<int>(position) - 1, 0, nodes - 4);
    const double x = position - s.first, x1 = x - 1, x2 = x - 2, x3 = x - 3;
    s.lower = std::clamp(static_cast<int>(x), 0, 2);
    s.fraction = x - s.lower;
    s.fraction_slope = 10 / (1 + 10 * tau) * scale;
    s.spacing = 1 / s.fraction_slope;
    s.spacing_slope = 1 / scale;
    // Lagrange's weights and their derivatives by x. Those of the nodes that the line does not touch tell the factors.
    const std::array<double, 4> w = {-x1 * x2 * x3 / 6, x * x2 * x3 / 2, -x * x1 * x3 / 2, x * x1 * x2 / 6};
    const std::array<double, 4> slope = {-(x2 * x3 + x1 * x3 + x1 * x2) / 6, (x2 * x3 + x * x3 + x * x2) / 2,
                                         -(x1 * x3 + x * x3 + x * x1) / 2, (x1 * x2 + x * x2 + x * x1) / 6};
    s.bend0 = s.lower == 0 ? w[2] + 2 * w[3] : w[0];
    s.bend1 = s.lower == 2 ? w[1] + 2 * w[0] : w[3];
    s.bend0_slope = (s.lower == 0 ? slope[2] + 2 * slope[3] : slope[0]) * s.fraction_slope;
    s.bend1_slope = (s.lower == 2 ? slope[1] + 2 * slope[0] : slope[3]) * s.fraction_slope;
    return s;
}

PathTable::PathTable(std::span<const std::uint8_t> file) {
    if (file.size() < 4 || crc32(file.first(file.size() - 4)) != Reader(file.last(4)).raw<std::uint32_t>())
        throw std::runtime_error("path table: wrong checksum");
    Reader in(file.first(file.size() - 4));
    const auto expect = [&](auto value) {
        if (in.raw<decltype(value)>() != value)
            throw std::runtime_error("path table: baked for another layout");
    };
    expect(magic);
    const auto incidence = in.raw<std::uint32_t>();
    if (incidence > 1)
        throw std::runtime_error("path table: unknown incidence");
    incidence_ = static_cast<Incidence>(incidence);
    for (const int number : {nodes, rings, bins})
        expect(static_cast<std::uint32_t>(number));
    for (const double number :
         {reference_absorption, max_thickness, first_radius, radius_ratio, first_path, path_ratio})
        expect(number);

    entry_ = 1 - surface_reflectance(refractive_index, incidence_);
    nodes_.resize(nodes);
    std::vector<float> counts(rings * bins * bins);  // [ring][L1][L2]
    for (Node& node : nodes_) {
        node.photons = in.raw<std::uint64_t>();
        for (Bins& layer : node.layer)
            for (int i = 0; i < bins; ++i) {
                const float mean = in.raw<float>(), half = in.raw<float>();
                layer.begin[i] = mean - half;
                layer.width[i] = 2 * half;
            }
        std::fill(counts.begin(), counts.end(), 0.0f);
        for (std::size_t i = 0; i < counts.size();) {
            const std::uint64_t count = in.number();
            if (count != 0) {
                counts[i++] = static_cast<float>(count);
                continue;
            }
            const std::uint64_t zeros = in.number();
            if (zeros == 0 || zeros > counts.size() - i)
                throw std::runtime_error("path table: damaged counts");
            i += zeros;
        }
        add_node(node, counts);
    }
}

void PathTable::add_node(Node& node, const std::vector<float>& counts) {
    const auto count = [&](int ring, int l1, int l2) {
        return ring < rings ? counts[(ring * bins + l1) * bins + l2] : 0.0f;
    };
    for (int l1 = 0; l1 < bins; ++l1) {
        std::array<float, bins> totals{};
        for (int ring = 0; ring < rings; ++ring)
            for (int l2 = 0; l2 < bins; ++l2)
                totals[l2] += count(ring, l1, l2);
        if (std::all_of(totals.begin(), totals.end(), [](float n) { return n == 0; }))
            continue;
        Row& row = node.rows.emplace_back();
        row.bin = l1;
        row.totals = static_cast<std::uint32_t>(counts_.size());
        counts_.insert(counts_.end(), totals.begin(), totals.end());
        for (int b = 0; b < padded_rings / block; ++b) {
            const auto empty = [&](int l2) {
                for (int ring = b * block; ring < (b + 1) * block; ++ring)
                    if (count(ring, l1, l2) != 0)
                        return false;
                return true;
            };
            int begin = 0, end = bins;
            while (begin < end && empty(begin))
                ++begin;
            while (end > begin && empty(end - 1))
                --end;
            row.strips[b] = {static_cast<std::uint32_t>(counts_.size()), static_cast<std::uint8_t>(begin),
                             static_cast<std::uint8_t>(end)};
            for (int l2 = begin; l2 < end; ++l2)
                for (int ring = b * block; ring < (b + 1) * block; ++ring)
                    counts_.push_back(count(ring, l1, l2));
        }
    }
}

namespace {

/// Floats that are added up together. Left to itself the compiler turns these loops inside out.
typedef float Block __attribute__((vector_size(64), aligned(4), may_alias));

/// (1 - exp(-y)) / y, the mean of exp(-x) over 0 <= x <= y, given exp(-y); by its series where the quotient cancels.
SANGUINE_INLINE float mean_attenuation(float y, float exp_y) {
    const float series = 1 - y * (1.0f / 2 - y * (1.0f / 6 - y * (1.0f / 24 - y * (1.0f / 120 - y * (1.0f / 720
                       - y * (1.0f / 5040))))));
    const float quotient = (1 - exp_y) / (y > 0.5f ? y : 1);
    return y > 0.5f ? quotient : series;
}

/// The derivative of that by y.
SANGUINE_INLINE float mean_attenuation_slope(float y, float exp_y, float mean) {
    const float series = -(1.0f / 2 - y * (1.0f / 3 - y * (1.0f / 8 - y * (1.0f / 30 - y * (1.0f / 144
                       - y * (1.0f / 840 - y * (1.0f / 5760)))))));
    const float quotient = (exp_y - mean) / (y > 0.5f ? y : 1);
    return y > 0.5f ? quotient : series;
}

/// Beyond any absorption that leaves light; keeps the products below finite.
constexpr double opaque = 1e9;

float beyond_reference(double a) {
    return static_cast<float>(std::fmin(a, opaque) - reference_absorption);
}

}  // namespace

SANGUINE_VECTOR_CLONES
void PathTable::attenuate(const Bins& layer, double a, Weights& out) {
    const float absorption = beyond_reference(a);
    for (int i = 0; i < bins; ++i) {
        const float y = absorption * layer.width[i];
        out[i] = exp_minus(absorption * layer.begin[i]) * mean_attenuation(y, exp_minus(y));
    }
}

SANGUINE_VECTOR_CLONES
void PathTable::attenuate_with_slope(const Bins& layer, double a, Weights& out, Weights& slope) {
    const float absorption = beyond_reference(a);
    for (int i = 0; i < bins; ++i) {
        const float width = layer.width[i], y = absorption * width, exp_y = exp_minus(y);
        const float front = exp_minus(absorption * layer.begin[i]), mean = mean_attenuation(y, exp_y);
        out[i] = front * mean;
        slope[i] = front * (width * mean_attenuation_slope(y, exp_y, mean) - layer.begin[i] * mean);
    }
}

/// out[L2] = sum over L1
SANGUINE_VECTOR_CLONES
void PathTable::add_totals(const float* counts, const Row* rows, std::size_t row_count, const Weights& epidermis,
                           Weights& out) {
    Block sum0{}, sum1{}, sum2{};
    static_assert(bins == 3 * block);
    for (std::size_t r = 0; r < row_count; ++r) {
        const float weight = epidermis[rows[r].bin];
        const Block* count = reinterpret_cast<const Block*>(counts + rows[r].totals);
        sum0 += weight * count[0];
        sum1 += weight * count[1];
        sum2 += weight * count[2];
    }
    Block* to = reinterpret_cast<Block*>(out.data());
    to[0] = sum0;
    to[1] = sum1;
    to[2] = sum2;
}

/// out[row][ring] = sum over L2
SANGUINE_VECTOR_CLONES
void PathTable::add_strips(const float* counts, const Row* rows, std::size_t row_count, const Weights& dermis,
                           float* out) {
    Block* to = reinterpret_cast<Block*>(out);
    for (std::size_t r = 0; r < row_count; ++r)
        for (const Strip& strip : rows[r].strips) {
            Block even{}, odd{};  // two chains of additions, which do not wait for each other
            const Block* count = reinterpret_cast<const Block*>(counts + strip.data);
            int l2 = strip.begin;
            for (; l2 + 1 < strip.end; l2 += 2, count += 2) {
                even += dermis[l2] * count[0];
                odd += dermis[l2 + 1] * count[1];
            }
            if (l2 < strip.end)
                even += dermis[l2] * count[0];
            *to++ = even + odd;
        }
}

/// out[ring] = sum over rows
SANGUINE_VECTOR_CLONES
void PathTable::add_rows(const float* sums, const Row* rows, std::size_t row_count, const Weights& epidermis,
                         float* out) {
    static_assert(padded_rings == 4 * block);
    Block sum0{}, sum1{}, sum2{}, sum3{};
    const Block* from = reinterpret_cast<const Block*>(sums);
    for (std::size_t r = 0; r < row_count; ++r, from += 4) {
        const float weight = epidermis[rows[r].bin];
        sum0 += weight * from[0];
        sum1 += weight * from[1];
        sum2 += weight * from[2];
        sum3 += weight * from[3];
    }
    Block* to = reinterpret_cast<Block*>(out);
    to[0] = sum0;
    to[1] = sum1;
    to[2] = sum2;
    to[3] = sum3;
}

void PathTable::sum_dermis(double tau, double a2, DermisSums& out) const {
    out.stencil = stencil_at(tau);
    std::size_t rows = 0;
    for (int k = 0; k < 4; ++k)
        rows += nodes_[out.stencil.first + k].rows.size();
    out.sums.resize(rows * padded_rings);
    float* sums = out.sums.data();
    alignas(64) Weights dermis;
    for (int k = 0; k < 4; ++k) {
        const Node& node = nodes_[out.stencil.first + k];
        attenuate(node.layer[1], a2, dermis);
        add_strips(counts_.data(), node.rows.data(), node.rows.size(), dermis, sums);
        sums += node.rows.size() * padded_rings;
    }
}

namespace {

/// The rings as parts of the total. Where all of them vanish, what is left of it left next to its entry.
void give_way(const auto& energy, double sum, double total, std::span<double, rings> out) {
    const double scale = sum > 0 ? total / sum : 0;
    for (int i = 0; i < rings; ++i)
        out[i] = scale * energy[i];
    if (!(sum > 0))
        out[0] = total;
}

}  // namespace

double PathTable::ring_energies(const DermisSums& dermis, double a1, std::span<double, rings> out) const {
    alignas(64) std::array<float, 4 * padded_rings> at_node;
    alignas(64) std::array<float, padded_rings> energy;
    alignas(64) Weights epidermis;
    std::array<double, 4> total_at_node{};
    const float* sums = dermis.sums.data();
    for (int k = 0; k < 4; ++k) {
        const Node& node = nodes_[dermis.stencil.first + k];
        attenuate(node.layer[0], a1, epidermis);
        const float scale = static_cast<float>(entry_ / static_cast<double>(node.photons));
        for (float& weight : epidermis)
            weight *= scale;
        float* ring = &at_node[k * padded_rings];
        add_rows(sums, node.rows.data(), node.rows.size(), epidermis, ring);
        for (int i = 0; i < rings; ++i)
            total_at_node[k] += ring[i];
        sums += node.rows.size() * padded_rings;
    }
    // Rings and total are interpolated each by themselves; the rings then give way, by some 1e-4, to the total.
    interpolate_rings(at_node.data(), dermis.stencil, static_cast<float>(Fade(dermis.stencil, a1).factor),
                      energy.data());
    double ring_sum = 0;
    for (int i = 0; i < rings; ++i)
        ring_sum += energy[i];
    const double total = interpolate(dermis.stencil, a1, total_at_node);
    give_way(energy, ring_sum, total, out);
    return total;
}

namespace {

float dot(const std::array<float, bins>& a, const std::array<float, bins>& b) {
    static_assert(bins % 16 == 0);
    float s[16] = {};
    for (int i = 0; i < bins; i += 16)
        for (int j = 0; j < 16; ++j)
            s[j] += a[i + j] * b[i + j];
    for (int half = 8; half > 0; half /= 2)
        for (int j = 0; j < half; ++j)
            s[j] += s[j + half];
    return s[0];
}

}  // namespace

double PathTable::total(double tau, double a1, double a2) const {
    const Stencil stencil = stencil_at(tau);
    std::array<double, 4> at_node;
    alignas(64) Weights epidermis, dermis, sums;
    for (int k = 0; k < 4; ++k) {
        const Node& node = nodes_[stencil.first + k];
        attenuate(node.layer[0], a1, epidermis);
        attenuate(node.layer[1], a2, dermis);
        add_totals(counts_.data(), node.rows.data(), node.rows.size(), epidermis, sums);
        at_node[k] = entry_ / static_cast<double>(node.photons) * dot(sums, dermis);
    }
    return interpolate(stencil, a1, at_node);
}

PathTable::Gradient PathTable::total_with_gradient(double tau, double a1, double a2) const {
    const Stencil stencil = stencil_at(tau);
    std::array<double, 4> at_node, by_a1, by_a2;
    alignas(64) Weights epidermis, epidermis_slope, dermis, dermis_slope, sums, slope_sums;
    for (int k = 0; k < 4; ++k) {
        const Node& node = nodes_[stencil.first + k];
        attenuate_with_slope(node.layer[0], a1, epidermis, epidermis_slope);
        attenuate_with_slope(node.layer[1], a2, dermis, dermis_slope);
        add_totals(counts_.data(), node.rows.data(), node.rows.size(), epidermis, sums);
        add_totals(counts_.data(), node.rows.data(), node.rows.size(), epidermis_slope, slope_sums);
        const double scale = entry_ / static_cast<double>(node.photons);
        at_node[k] = scale * dot(sums, dermis);
        by_a1[k] = scale * dot(slope_sums, dermis);
        by_a2[k] = scale * dot(sums, dermis_slope);
    }
    const Blend blend(stencil, a1, logs(at_node));
    const double lifted = std::exp(blend.log);
    Gradient out{blend.result(), lifted * blend.by_tau, lifted * blend.by_a1, 0};
    for (int k = 0; k < 4; ++k) {
        out.by_a1 += lifted * blend.weight[k] * by_a1[k] / (at_node[k] + log_floor);
        out.by_a2 += lifted * blend.weight[k] * by_a2[k] / (at_node[k] + log_floor);
    }
    return out;
}

PathTable::Uncertainty PathTable::uncertainty(double tau, double a1, double a2) const {
    const Stencil stencil = stencil_at(tau);
    std::array<double, 4> log_total{};
    double noise = 0, spread = 0, ring_noise = 0;
    alignas(64) std::array<Weights, 2> plain, squared, two_points;
    alignas(64) Weights sums;
    AlignedFloats rows;
    alignas(64) std::array<float, padded_rings> variance;
    for (int k = 0; k < 4; ++k) {
        const Node& node = nodes_[stencil.first + k];
        for (int layer = 0; layer < 2; ++layer) {
            const Bins& of_layer = node.layer[layer];
            const float absorption = beyond_reference(layer == 0 ? a1 : a2);
            attenuate(of_layer, layer == 0 ? a1 : a2, plain[layer]);
            for (int i = 0; i < bins; ++i) {
                squared[layer][i] = plain[layer][i] * plain[layer][i];
                const float mean = of_layer.begin[i] + of_layer.width[i] / 2;
                const float deviation = of_layer.width[i] / std::sqrt(12.0f);
                two_points[layer][i] = 0.5f * (exp_minus(absorption * (mean - deviation))
                                               + exp_minus(absorption * (mean + deviation)));
            }
        }
        const auto sum = [&](const std::array<Weights, 2>& weights) {
            add_totals(counts_.data(), node.rows.data(), node.rows.size(), weights[0], sums);
            return static_cast<double>(dot(sums, weights[1]));
        };
        const double total = sum(plain);
        log_total[k] = std::log(entry_ * total / static_cast<double>(node.photons) + log_floor);
        if (!(total > 0))
            return {1, 1};
        if (k != stencil.lower && k != stencil.lower + 1)
            continue;
        noise = std::fmax(noise, std::sqrt(sum(squared)) / total);
        spread = std::fmax(spread, std::fabs(sum(two_points) / total - 1));
        rows.resize(node.rows.size() * padded_rings);
        add_strips(counts_.data(), node.rows.data(), node.rows.size(), squared[1], rows.data());
        add_rows(rows.data(), node.rows.data(), node.rows.size(), squared[0], variance.data());
        double deviations = 0;
        for (int ring = 0; ring < rings; ++ring)
            deviations += std::sqrt(std::fmax(0.0f, variance[ring]));
        // The mean of |x| of a normal x is sqrt(2 / pi) of its standard deviation.
        ring_noise = std::fmax(ring_noise, deviations / total * std::sqrt(2 / std::numbers::pi));
    }
    const double x = stencil.lower + stencil.fraction;
    const auto parabola = [&](int k) {
        const double y = x - k;
        return log_total[k] * (y - 1) * (y - 2) / 2 - log_total[k + 1] * y * (y - 2) + log_total[k + 2] * y * (y - 1) / 2;
    };
    const double used = Blend(stencil, a1, log_total).log;
    const double between = std::fmax(std::fabs(std::expm1(parabola(0) - used)), std::fabs(std::expm1(parabola(1) - used)));
    return {std::fmin(1, 2 * noise + between + spread), std::fmin(1, ring_noise)};
}

double PathTable::ring_energies_in_double(double tau, double a1, double a2, std::span<double, rings> out) const {
    const auto weight = [](const Bins& layer, int i, double a) {
        const double absorption = a - reference_absorption, y = absorption * layer.width[i];
        return std::exp(-absorption * layer.begin[i]) * (y > 0 ? -std::expm1(-y) / y : 1);
    };
    const Stencil stencil = stencil_at(tau);
    std::array<std::array<double, 4>, rings> at_node{};
    std::array<double, 4> total_at_node{};
    for (int k = 0; k < 4; ++k) {
        const Node& node = nodes_[stencil.first + k];
        for (const Row& row : node.rows)
            for (int ring = 0; ring < rings; ++ring) {
                const Strip& strip = row.strips[ring / block];
                for (int l2 = strip.begin; l2 < strip.end; ++l2)
                    at_node[ring][k] += entry_ / static_cast<double>(node.photons) * weight(node.layer[0], row.bin, a1)
                                      * weight(node.layer[1], l2, a2)
                                      * counts_[strip.data + (l2 - strip.begin) * block + ring % block];
            }
        for (const auto& ring : at_node)
            total_at_node[k] += ring[k];
    }
    const double total = interpolate(stencil, a1, total_at_node);
    std::array<double, rings> energy;
    double sum = 0;
    for (int ring = 0; ring < rings; ++ring)
        sum += energy[ring] = interpolate(stencil, a1, at_node[ring]);
    give_way(energy, sum, total, out);
    return total;
}

const PathTable& PathTable::embedded(Incidence incidence) {
    if (incidence == Incidence::normal) {
        static const PathTable normal(embedded_path_table_normal());
        return normal;
    }
    static const PathTable diffuse(embedded_path_table_diffuse());
    return diffuse;
}

}  // namespace sanguine
