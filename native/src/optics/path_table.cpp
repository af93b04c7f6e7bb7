#include "sanguine/path_table.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "embedded_data.hpp"
#include "sanguine/fresnel.hpp"

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

std::uint32_t crc32(std::span<const std::uint8_t> bytes) {
    std::uint32_t crc = ~0U;
    for (const std::uint8_t byte : bytes) {
        crc ^= byte;
        for (int bit = 0; bit < 8; ++bit)
            crc = (crc >> 1) ^ (crc & 1 ? 0xedb88320U : 0U);
    }
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

/// Interpolates four values of R that belong to the nodes of `stencil`, cubic in ln R. Where one of them saw no
/// photon there is no smooth logarithm to follow, and R is taken linearly; such rings hold about a millionth
/// of the light.
double interpolate(const PathTable::Stencil& stencil, const std::array<double, 4>& value) {
    if (*std::min_element(value.begin(), value.end()) <= 0)
        return std::lerp(value[stencil.lower], value[stencil.lower + 1], stencil.fraction);
    double log = 0;
    for (int k = 0; k < 4; ++k)
        log += stencil.cubic[k] * std::log(value[k]);
    return std::exp(log);
}

PathTable::Stencil stencil_at(double tau) {
    const double position = std::log1p(10 * tau) / std::log1p(10 * max_thickness) * (nodes - 1);
    PathTable::Stencil s;
    s.first = std::clamp(static_cast<int>(position) - 1, 0, nodes - 4);
    const double x = position - s.first;
    s.lower = std::clamp(static_cast<int>(x), 0, 2);
    s.fraction = x - s.lower;
    s.cubic = {-(x - 1) * (x - 2) * (x - 3) / 6, x * (x - 2) * (x - 3) / 2, -x * (x - 1) * (x - 3) / 2,
               x * (x - 1) * (x - 2) / 6};
    return s;
}

float dot(const float* a, const float* b, int count) {
    // Four partial sums: the compiler may not reorder a float sum by itself, and a fixed order keeps results equal
    // on every machine.
    float s[4] = {};
    int i = 0;
    for (; i + 4 <= count; i += 4)
        for (int j = 0; j < 4; ++j)
            s[j] += a[i + j] * b[i + j];
    for (; i < count; ++i)
        s[0] += a[i] * b[i];
    return (s[0] + s[1]) + (s[2] + s[3]);
}

/// What a skin under Lambertian light lets in.
const double entry = 1 - diffuse_fresnel(refractive_index);

}  // namespace

PathTable::PathTable(std::span<const std::uint8_t> file) {
    if (file.size() < 4 || crc32(file.first(file.size() - 4)) != Reader(file.last(4)).raw<std::uint32_t>())
        throw std::runtime_error("path table: wrong checksum");
    Reader in(file.first(file.size() - 4));
    if (in.raw<std::uint64_t>() != magic || in.raw<std::uint32_t>() != nodes || in.raw<std::uint32_t>() != rings
        || in.raw<std::uint32_t>() != bins || in.raw<double>() != reference_absorption)
        throw std::runtime_error("path table: baked for another layout");

    nodes_.resize(nodes);
    std::vector<float> plane(bins * bins), row(bins);
    for (Node& node : nodes_) {
        node.photons = in.raw<std::uint64_t>();
        for (auto& layer : node.layer)
            for (Bin& bin : layer) {
                bin.mean = in.raw<float>();
                bin.half = in.raw<float>();
            }

        const auto store = [&](Row& out, const float* values) {
            int begin = 0, end = bins;
            while (begin < end && values[begin] == 0)
                ++begin;
            while (end > begin && values[end - 1] == 0)
                --end;
            out = {static_cast<std::uint32_t>(counts_.size()), static_cast<std::uint8_t>(begin),
                   static_cast<std::uint8_t>(end)};
            counts_.insert(counts_.end(), values + begin, values + end);
        };
        std::fill(plane.begin(), plane.end(), 0.0f);
        std::uint64_t zeros = 0;
        for (int ring = 0; ring < rings; ++ring)
            for (int a = 0; a < bins; ++a) {
                for (int b = 0; b < bins; ++b) {
                    std::uint64_t count = 0;
                    if (zeros > 0) {
                        --zeros;
                    } else if ((count = in.number()) == 0) {
                        zeros = in.number() - 1;
                    }
                    row[b] = static_cast<float>(count);
                    plane[a * bins + b] += row[b];
                }
                store(node.rows[ring][a], row.data());
            }
        for (int a = 0; a < bins; ++a)
            store(node.rows[rings][a], &plane[a * bins]);
    }
}

PathTable::Weights PathTable::attenuation(const std::array<Bin, bins>& bins_of_layer, double a) {
    // Mean of exp(-a L) over L uniform in mean +- half.
    const double absorption = a - reference_absorption;
    Weights out;
    for (int i = 0; i < bins; ++i) {
        const auto [mean, half] = bins_of_layer[i];
        const double x = absorption * half;
        out[i] = static_cast<float>(x < 1e-3 ? std::exp(-absorption * mean) * (1 + x * x / 6)
                                             : (std::exp(x - absorption * mean) - std::exp(-x - absorption * mean))
                                                   / (2 * x));
    }
    return out;
}

void PathTable::sum_dermis(double tau, double a2, DermisSums& out) const {
    out.stencil = stencil_at(tau);
    out.sums.resize(4 * rings * bins);
    float* sum = out.sums.data();
    for (int k = 0; k < 4; ++k) {
        const Node& node = nodes_[out.stencil.first + k];
        const Weights weights = attenuation(node.layer[1], a2);
        for (int ring = 0; ring < rings; ++ring)
            for (const Row& row : node.rows[ring])
                *sum++ = dot(&counts_[row.data], &weights[row.begin], row.end - row.begin);
    }
}

double PathTable::ring_energies(const DermisSums& dermis, double a1, std::span<double, rings> out) const {
    std::array<std::array<double, 4>, rings> at_node;
    std::array<double, 4> total_at_node{};
    const float* sum = dermis.sums.data();
    for (int k = 0; k < 4; ++k) {
        const Node& node = nodes_[dermis.stencil.first + k];
        const Weights weights = attenuation(node.layer[0], a1);
        const double scale = entry / static_cast<double>(node.photons);
        for (int ring = 0; ring < rings; ++ring, sum += bins) {
            at_node[ring][k] = scale * dot(sum, weights.data(), bins);
            total_at_node[k] += at_node[ring][k];
        }
    }
    // Rings and total are interpolated each by themselves; the rings then give way, by some 1e-4, to the total.
    double ring_sum = 0;
    for (int ring = 0; ring < rings; ++ring)
        ring_sum += out[ring] = interpolate(dermis.stencil, at_node[ring]);
    const double total = interpolate(dermis.stencil, total_at_node);
    for (double& energy : out)
        energy *= total / ring_sum;
    return total;
}

double PathTable::total(double tau, double a1, double a2) const {
    const Stencil stencil = stencil_at(tau);
    std::array<double, 4> at_node;
    for (int k = 0; k < 4; ++k) {
        const Node& node = nodes_[stencil.first + k];
        const Weights epidermis = attenuation(node.layer[0], a1), dermis = attenuation(node.layer[1], a2);
        double sum = 0;
        for (int a = 0; a < bins; ++a) {
            const Row& row = node.rows[rings][a];
            sum += epidermis[a] * dot(&counts_[row.data], &dermis[row.begin], row.end - row.begin);
        }
        at_node[k] = entry / static_cast<double>(node.photons) * sum;
    }
    return interpolate(stencil, at_node);
}

const PathTable& PathTable::embedded() {
    static const PathTable table(embedded_path_table());
    return table;
}

}  // namespace sanguine
