// Bakes native/data/path_table_diffuse.bin and path_table_normal.bin; see sanguine/path_table.hpp for what they hold
// and why.
//
//     bake_path_table diffuse|normal OUT.bin [photons per node = 5500000] [threads = 1]
//
// The recipe goes to OUT.recipe.txt; native/data/SHA256SUMS wants the new checksum.
//
// The tracer here is a second one, made for this one problem (one index, one anisotropy, two layers) and for vector
// units: many photons take their steps side by side, in optical depth, so that the face between the layers is no event.
// Logarithm, sine and cosine are polynomials and sums are never fused, so that the file is the same on every machine
// and any number of threads. Photon p of every node uses random sequence p of one seed, and neighbouring nodes share
// much of their noise. tests/native/test_path_table.cpp holds it against photon_tracer.hpp.
//
// File, little-endian: u64 magic; u32 incidence (0 normal, 1 diffuse), nodes, rings, bins; f64 reference absorption,
// greatest thickness, first radius, ratio of radii, first path, ratio of paths; then per node u64 photons that entered;
// f32 mean, half-width of the path in each bin, epidermis then dermis; counts [ring][L1][L2] as LEB128 numbers, where a
// 0 is followed by the length of its run. Last, u32 CRC-32 of all before.

#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "sanguine/fresnel.hpp"
#include "sanguine/path_table.hpp"
#include "sanguine/stack.hpp"

namespace {

using namespace sanguine;
static_assert(std::endian::native == std::endian::little, "the file is written as it lies in memory");

constexpr std::uint64_t seed = 20061122;

struct Moments {
    double count = 0, sum = 0, sum_of_squares = 0;
};

struct NodeResult {
    std::uint64_t entered = 0;
    std::vector<std::uint32_t> counts =
        std::vector<std::uint32_t>(path_grid::rings * path_grid::bins * path_grid::bins);
    Moments path[2][path_grid::bins];
};

/// Finaliser of SplitMix64 (Steele, Lea and Flood 2014).
std::uint64_t mix(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15ULL;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
    return x ^ (x >> 31);
}

/// Uniform in the open interval (0, 1) from the upper or the lower half of `bits`.
inline double upper_uniform(std::uint64_t bits) {
    return std::bit_cast<double>(((bits >> 32) << 20) | 0x3ff0000000000000ULL) - (1 - 0x1p-33);
}
inline double lower_uniform(std::uint64_t bits) {
    return std::bit_cast<double>(((bits & 0xffffffffULL) << 20) | 0x3ff0000000000000ULL) - (1 - 0x1p-33);
}

/// ln x for 0 < x < 1 to 1e-13: x = m 2^e with m in [sqrt(1/2), sqrt(2)), then the series of artanh((m - 1) / (m + 1)).
inline double logarithm(double x) {
    const std::uint64_t bits = std::bit_cast<std::uint64_t>(x) - 0x3fe6a09e667f3bcdULL;  // bits of sqrt(1/2)
    // The exponent as a double, by way of the mantissa of 2^52 + 2^51: vector units convert no 64-bit integers.
    const double e = std::bit_cast<double>(((bits >> 52) ^ 0x800ULL) | 0x4330000000000000ULL) - (0x1p52 + 2048);
    const double m = std::bit_cast<double>((bits & 0x000fffffffffffffULL) + 0x3fe6a09e667f3bcdULL);
    const double f = (m - 1) / (m + 1), g = f * f;
    const double series =
        1 + g * (1.0 / 3 + g * (1.0 / 5 + g * (1.0 / 7 + g * (1.0 / 9 + g * (1.0 / 11 + g * (1.0 / 13 + g * (1.0 / 15
        + g * (1.0 / 17))))))));
    return e * 0.6931471805599453 + 2 * f * series;
}

/// Photons in flight. Depth is optical, x and y are lengths.
struct Lanes {
    static constexpr int count = 32;
    template <class T> using Array = std::array<T, count>;

    alignas(64) Array<double> depth, x, y, dx, dy, dz, path1, path2, life;
    alignas(64) Array<std::uint64_t> s0, s1, s2, s3;  // xoshiro256+ (Blackman and Vigna 2018)
    alignas(64) Array<std::uint64_t> ended;           // 0: in flight, 1: absorbed, 2: left

    std::uint64_t draw(int l) {
        const std::uint64_t result = s0[l] + s3[l], t = s1[l] << 17;
        s2[l] ^= s0[l];
        s3[l] ^= s1[l];
        s1[l] ^= s2[l];
        s0[l] ^= s3[l];
        s2[l] ^= t;
        s3[l] = std::rotl(s3[l], 45);
        return result;
    }
};

/// One flight of every photon, to its next scattering or to the surface, and what happens there. The epidermis reaches
/// down to the optical depth `epidermis`; mu1 and mu2 scatter.
__attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
void step(Lanes& lanes, double epidermis, double mu1, double mu2) {
    using namespace path_grid;
    constexpr double g = anisotropy, n = refractive_index;
    for (int l = 0; l < Lanes::count; ++l) {
        const std::uint64_t first = lanes.draw(l), second = lanes.draw(l);
        const double dx = lanes.dx[l], dy = lanes.dy[l], dz = lanes.dz[l], depth = lanes.depth[l];

        const double flight = -logarithm(upper_uniform(first));
        const double aim = depth + dz * flight;
        const bool hit = aim < 0;
        const double travelled = hit ? flight * (depth / (hit ? depth - aim : 1)) : flight;
        const double arrived = hit ? 0 : aim;
        // The share of the flight that was in the epidermis.
        const double vertical = std::fabs(depth - arrived);
        const double within = std::fabs((depth < epidermis ? depth : epidermis)
                                        - (arrived < epidermis ? arrived : epidermis));
        const double share =
            vertical > 1e-14 ? within / (vertical > 1e-14 ? vertical : 1) : (depth < epidermis ? 1 : 0);
        const double optical1 = travelled * share;
        const double way1 = optical1 / mu1, way2 = (travelled - optical1) / mu2, way = way1 + way2;
        const double path1 = lanes.path1[l] + way1, path2 = lanes.path2[l] + way2;
        lanes.path1[l] = path1;
        lanes.path2[l] = path2;
        lanes.depth[l] = arrived;
        lanes.x[l] += dx * way;
        lanes.y[l] += dy * way;

        // Fresnel's law at the surface; beyond the critical angle cos_t is 0 and both terms are 1.
        const double cos_i = std::fabs(dz), k = 1 - n * n * (1 - cos_i * cos_i);
        const double cos_t = std::sqrt(k > 0 ? k : 0);
        const double perpendicular = (n * cos_i - cos_t) / (n * cos_i + cos_t);
        const double parallel = (cos_i - n * cos_t) / (cos_i + n * cos_t);
        const double reflected = 0.5 * (perpendicular * perpendicular + parallel * parallel);
        const bool left = hit && lower_uniform(second) >= reflected;
        lanes.ended[l] = path1 + path2 > lanes.life[l] ? 1 : left ? 2 : 0;

        // Henyey and Greenstein 1941; the azimuth by halving the angle twice.
        const double t = (1 - g * g) / (1 + g * (2 * lower_uniform(first) - 1));
        const double cos_theta = (1 + g * g - t * t) / (2 * g);
        const double sin2 = 1 - cos_theta * cos_theta, sin_theta = std::sqrt(sin2 > 0 ? sin2 : 0);
        const double a = (upper_uniform(second) - 0.5) * 1.5707963267948966, a2 = a * a;
        const double s = a * (1 - a2 / 6 * (1 - a2 / 20 * (1 - a2 / 42 * (1 - a2 / 72 * (1 - a2 / 110
                              * (1 - a2 / 156))))));
        const double c = 1 - a2 / 2 * (1 - a2 / 12 * (1 - a2 / 30 * (1 - a2 / 56 * (1 - a2 / 90 * (1 - a2 / 132
                              * (1 - a2 / 182))))));
        const double c_twice = c * c - s * s, s_twice = 2 * s * c;
        const double cos_phi = c_twice * c_twice - s_twice * s_twice, sin_phi = 2 * s_twice * c_twice;
        // Orthonormal basis around d without a branch at the pole (Duff et al. 2017, JCGT 6(1)).
        const double sign = std::copysign(1.0, dz);
        const double h = -1 / (sign + dz), b = dx * dy * h;
        const double u = sin_theta * cos_phi, v = sin_theta * sin_phi;
        const double tx = u * (1 + sign * dx * dx * h) + v * b + cos_theta * dx;
        const double ty = u * sign * b + v * (sign + dy * dy * h) + cos_theta * dy;
        const double tz = -u * sign * dx - v * dy + cos_theta * dz;
        // One Newton step keeps the length at 1 over thousands of turns.
        const double scale = 1.5 - 0.5 * (tx * tx + ty * ty + tz * tz);
        lanes.dx[l] = hit ? dx : tx * scale;
        lanes.dy[l] = hit ? dy : ty * scale;
        lanes.dz[l] = hit ? -dz : tz * scale;
    }
}

/// Puts photon `photon` just below the surface.
void launch(Lanes& lanes, int l, std::uint64_t photon, Incidence incidence) {
    using namespace path_grid;
    std::uint64_t state = mix(seed ^ mix(photon));
    for (auto* s : {&lanes.s0, &lanes.s1, &lanes.s2, &lanes.s3})
        (*s)[l] = state = mix(state);
    lanes.depth[l] = lanes.x[l] = lanes.y[l] = lanes.path1[l] = lanes.path2[l] = 0;
    lanes.dx[l] = lanes.dy[l] = 0;
    lanes.dz[l] = 1;
    if (incidence == Incidence::diffuse) {  // Lambertian light, less what the surface reflects
        for (;;) {
            const std::uint64_t bits = lanes.draw(l);
            const double cos_i = std::sqrt(upper_uniform(bits));
            double cos_t;
            if (lower_uniform(bits) < fresnel_dielectric(cos_i, outside_index, refractive_index, cos_t))
                continue;
            lanes.dx[l] = std::sqrt(1 - cos_i * cos_i) / refractive_index;
            lanes.dz[l] = cos_t;
            break;
        }
    }
    // Absorption as an exponential clock.
    lanes.life[l] = -logarithm(upper_uniform(lanes.draw(l))) / reference_absorption;
    lanes.ended[l] = 0;
}

NodeResult trace_node(double thickness, Incidence incidence, std::uint64_t photons) {
    using namespace path_grid;
    const double mu1 = 1 / (1 - anisotropy), mu2 = mu1 * dermis_scattering;
    NodeResult result;
    result.entered = photons;
    Lanes lanes;
    std::uint64_t next = 0;
    int flying = 0;
    const auto refill = [&](int l) {
        if (next < photons) {
            launch(lanes, l, next++, incidence);
            ++flying;
        } else {
            lanes.life[l] = std::numeric_limits<double>::infinity();  // an idle photon, which counts for nothing
            lanes.depth[l] = 1e30;
        }
    };
    for (int l = 0; l < Lanes::count; ++l) {
        launch(lanes, l, 0, incidence);
        refill(l);
    }
    while (flying > 0) {
        step(lanes, thickness * mu1, mu1, mu2);
        for (int l = 0; l < Lanes::count; ++l) {
            if (lanes.ended[l] == 0)
                continue;
            if (lanes.ended[l] == 2) {
                const double path[2] = {lanes.path1[l], lanes.path2[l]};
                const int bin[2] = {bin_of(path[0]), bin_of(path[1])};
                const double radius = std::sqrt(lanes.x[l] * lanes.x[l] + lanes.y[l] * lanes.y[l]);
                ++result.counts[(ring_of(radius) * bins + bin[0]) * bins + bin[1]];
                for (int layer = 0; layer < 2; ++layer) {
                    Moments& m = result.path[layer][bin[layer]];
                    m.count += 1;
                    m.sum += path[layer];
                    m.sum_of_squares += path[layer] * path[layer];
                }
            }
            --flying;
            refill(l);
        }
    }
    return result;
}

class Writer {
public:
    template <class T> void raw(T value) {
        const auto* bytes = reinterpret_cast<const std::uint8_t*>(&value);
        bytes_.insert(bytes_.end(), bytes, bytes + sizeof value);
    }
    void number(std::uint64_t value) {
        for (; value >= 0x80; value >>= 7)
            bytes_.push_back(static_cast<std::uint8_t>(value | 0x80));
        bytes_.push_back(static_cast<std::uint8_t>(value));
    }
    const std::vector<std::uint8_t>& bytes() const { return bytes_; }

private:
    std::vector<std::uint8_t> bytes_;
};

void write_node(Writer& out, const NodeResult& node) {
    out.raw(node.entered);
    for (const auto& layer : node.path)
        for (const Moments& m : layer) {
            const double mean = m.count > 0 ? m.sum / m.count : 0;
            const double variance = m.count > 0 ? std::fmax(0, m.sum_of_squares / m.count - mean * mean) : 0;
            out.raw(static_cast<float>(mean));
            out.raw(static_cast<float>(std::fmin(mean, std::sqrt(3 * variance))));
        }
    for (std::size_t i = 0; i < node.counts.size();) {
        out.number(node.counts[i]);
        if (node.counts[i] != 0) {
            ++i;
            continue;
        }
        const std::size_t start = i;
        while (i < node.counts.size() && node.counts[i] == 0)
            ++i;
        out.number(i - start);
    }
}

}  // namespace

int main(int argc, char** argv) {
    const std::string_view kind = argc > 1 ? argv[1] : "";
    if (argc < 3 || argc > 5 || (kind != "diffuse" && kind != "normal")) {
        std::fprintf(stderr, "usage: bake_path_table diffuse|normal OUT.bin [photons per node] [threads]\n");
        return 2;
    }
    const Incidence incidence = kind == "diffuse" ? Incidence::diffuse : Incidence::normal;
    const std::string path = argv[2];
    const std::uint64_t photons = argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 5500000;
    const unsigned threads = argc > 4 ? static_cast<unsigned>(std::atoi(argv[4])) : 1;
    if (photons == 0 || threads == 0) {
        std::fprintf(stderr, "bake_path_table: photons and threads must be whole numbers above 0\n");
        return 2;
    }

    const auto start = std::chrono::steady_clock::now();
    std::vector<NodeResult> results(path_grid::nodes);
    std::atomic<int> next = 0;
    std::vector<std::thread> pool;
    for (unsigned t = 0; t < threads; ++t)
        pool.emplace_back([&] {
            for (int k; (k = next++) < path_grid::nodes;) {
                results[k] = trace_node(path_grid::node_thickness(k), incidence, photons);
                std::fprintf(stderr, "tau %.4f done\n", path_grid::node_thickness(k));
            }
        });
    for (std::thread& thread : pool)
        thread.join();

    Writer out;
    out.raw(path_grid::magic);
    out.raw(static_cast<std::uint32_t>(incidence));
    out.raw(std::uint32_t{path_grid::nodes});
    out.raw(std::uint32_t{path_grid::rings});
    out.raw(std::uint32_t{path_grid::bins});
    for (const double constant : {path_grid::reference_absorption, path_grid::max_thickness, path_grid::first_radius,
                                  path_grid::radius_ratio, path_grid::first_path, path_grid::path_ratio})
        out.raw(constant);
    for (const NodeResult& node : results)
        write_node(out, node);
    const std::uint32_t check = crc32(out.bytes());
    out.raw(check);

    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(out.bytes().data()), static_cast<std::streamsize>(out.bytes().size()));
    std::ofstream recipe(path.substr(0, path.rfind('.')) + ".recipe.txt");
    recipe << "Baked by native/tools/bake_path_table.cpp from the layout in sanguine/path_table.hpp.\n"
           << "incidence: " << kind << "\nphotons per node: " << photons << "\nseed: " << seed
           << "\nnodes: " << path_grid::nodes << "\nthickness up to: " << path_grid::max_thickness
           << "\ng: " << path_grid::anisotropy << "\nn: " << path_grid::refractive_index
           << "\nmu_s' of the dermis / epidermis: " << path_grid::dermis_scattering
           << "\nreference absorption: " << path_grid::reference_absorption << "\nbytes: " << out.bytes().size()
           << "\nCRC-32: " << std::hex << check << "\n";
    if (!recipe) {
        std::fprintf(stderr, "bake_path_table: cannot write %s\n", path.c_str());
        return 1;
    }
    std::fprintf(stderr, "%zu bytes, %.0f s\n", out.bytes().size(),
                 std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    return 0;
}
