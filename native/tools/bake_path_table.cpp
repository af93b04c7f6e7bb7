// Bakes native/data/path_table.bin; see sanguine/path_table.hpp for what it holds and why.
//
//     bake_path_table OUT.bin [photons per node = 5500000] [threads = 1]
//
// The recipe goes to OUT.recipe.txt; native/data/SHA256SUMS wants the new checksum. Takes 13 minutes on one core.
// Photon p of every node uses random sequence p of one seed, so that the file does not depend on the number of threads,
// and neighbouring nodes share much of their noise.
//
// File, little-endian: u64 magic; u32 nodes, rings, bins; f64 reference absorption; then per node u64 photons that
// entered; f32 mean, half-width of the path in each bin, epidermis then dermis; counts [ring][L1][L2] as LEB128
// numbers, where a 0 is followed by the length of its run. Last, u32 CRC-32 of all before.

#include <atomic>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "sanguine/path_table.hpp"
#include "sanguine/photon_tracer.hpp"

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

NodeResult trace_node(double thickness, std::uint64_t photons) {
    using namespace path_grid;
    const double mu_s = 1 / (1 - anisotropy), infinity = std::numeric_limits<double>::infinity();
    const Layer epidermis{reference_absorption, mu_s, anisotropy, refractive_index, thickness};
    const Layer dermis{reference_absorption, mu_s * dermis_scattering, anisotropy, refractive_index, infinity};
    const std::vector<Layer> stack =
        thickness > 0 ? std::vector{epidermis, dermis} : std::vector{dermis};

    NodeResult result;
    for (std::uint64_t p = 0; p < photons; ++p) {
        PhotonRandom random(seed, p);
        const PhotonEnd end = trace_photon(stack, Incidence::diffuse, random);
        if (end.fate == Fate::reflected_at_surface)
            continue;
        ++result.entered;
        if (end.fate != Fate::left_top)
            continue;
        const double path[2] = {thickness > 0 ? end.path[0] : 0, thickness > 0 ? end.path[1] : end.path[0]};
        const int bin[2] = {bin_of(path[0]), bin_of(path[1])};
        ++result.counts[(ring_of(end.radius) * bins + bin[0]) * bins + bin[1]];
        for (int l = 0; l < 2; ++l) {
            Moments& m = result.path[l][bin[l]];
            m.count += 1;
            m.sum += path[l];
            m.sum_of_squares += path[l] * path[l];
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
    if (argc < 2 || argc > 4) {
        std::fprintf(stderr, "usage: bake_path_table OUT.bin [photons per node] [threads]\n");
        return 2;
    }
    const std::string path = argv[1];
    const std::uint64_t photons = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 5500000;
    const unsigned threads = argc > 3 ? static_cast<unsigned>(std::atoi(argv[3])) : 1;
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
                results[k] = trace_node(path_grid::node_thickness(k), photons);
                std::fprintf(stderr, "tau %.4f done\n", path_grid::node_thickness(k));
            }
        });
    for (std::thread& thread : pool)
        thread.join();

    Writer out;
    out.raw(path_grid::magic);
    out.raw(std::uint32_t{path_grid::nodes});
    out.raw(std::uint32_t{path_grid::rings});
    out.raw(std::uint32_t{path_grid::bins});
    out.raw(path_grid::reference_absorption);
    for (const NodeResult& node : results)
        write_node(out, node);
    const std::uint32_t check = crc32(out.bytes());
    out.raw(check);

    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(out.bytes().data()), static_cast<std::streamsize>(out.bytes().size()));
    std::ofstream recipe(path.substr(0, path.rfind('.')) + ".recipe.txt");
    recipe << "Baked by native/tools/bake_path_table.cpp from the layout in sanguine/path_table.hpp.\n"
           << "photons per node: " << photons << "\nseed: " << seed << "\nnodes: " << path_grid::nodes
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
