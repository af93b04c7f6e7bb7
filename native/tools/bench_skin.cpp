// Times the skin solver on one core and prints JSON: what loading a table, a colour, a profile and its lobes take.
//
//     bench_skin [repeats = 7]
//
// Each time is processor time, the shortest of the repeats, per skin, over 64 skins of which no two share anything that could be
// computed once.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

#include "sanguine/burley.hpp"
#include "sanguine/path_table.hpp"
#include "sanguine/skin.hpp"

namespace {

using namespace sanguine;

template <class Work> double shortest_us(int repeats, const Work& work) {
    double best = 1e300;
    for (int i = 0; i < repeats; ++i) {
        const std::clock_t start = std::clock();
        work();
        best = std::min(best, 1e6 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    }
    return best;
}

}  // namespace

int main(int argc, char** argv) {
    const int repeats = argc > 1 ? std::max(1, std::atoi(argv[1])) : 7;
    constexpr int count = 64;
    std::vector<SkinParameters> skins(count);
    for (int i = 0; i < count; ++i) {
        skins[i].melanin = 0.01 + 0.004 * i;
        skins[i].hemoglobin = 0.005 + 0.0004 * ((i * 37) % count);
        skins[i].epidermis_thickness_mm = 0.05 + 0.002 * ((i * 13) % count);
    }
    std::vector<double> nm;
    for (int w = 0; w < 41; ++w)
        nm.push_back(380 + 10 * w);
    const Matrix3 rgb = rgb_from_xyz("rec709");

    const double load = shortest_us(1, [] { PathTable::embedded(Incidence::diffuse); });
    double sink = 0;
    const double colour = shortest_us(repeats * 20, [&] { sink += reflectance(skins, nm, 1, {}).back(); }) / count;
    std::vector<RgbRings> rings;
    const double profile = shortest_us(repeats, [&] { rings = rgb_rings(skins, rgb, 1, {}); }) / count;
    std::vector<SkinLobes> lobes;
    const double with_lobes = shortest_us(repeats, [&] { lobes = skin_lobes(skins, rgb, 4, 1, {}); }) / count;
    std::printf("{\"load_table_ms\": %.3f, \"colour_41_wavelengths_us\": %.2f, \"rgb_profile_us\": %.1f, "
                "\"rgb_profile_and_4_lobes_us\": %.1f, \"wavelengths_of_rgb_profile\": %zu}\n",
                load / 1000, colour, profile, with_lobes, rgb_wavelength_count());
    return sink > 0 && lobes.size() == count ? 0 : 1;
}
