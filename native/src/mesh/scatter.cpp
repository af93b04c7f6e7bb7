#include "scatter.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <unordered_map>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "random.hpp"

namespace sanguine {
namespace {

/// How many darts have to be thrown for each that sticks, when points keep `spacing` / sqrt(density) apart.
///
/// A dart sticks with the probability of the free area, 1 - 4 t + (6 sqrt(3) / pi) t^2 + 1.4069 t^3 at coverage t
/// (Schaaf and Talbot 1989, Phys. Rev. Lett. 62:175); hence darts = integral of 1 / free over the coverage.
double darts_per_point(double spacing) {
    const double coverage = std::numbers::pi * spacing * spacing / 4;
    if (coverage == 0) return 1;
    constexpr int steps = 200;
    double sum = 0;
    for (int i = 0; i < steps; ++i) {
        const double t = coverage * (i + 0.5) / steps;
        sum += 1 / (1 - 4 * t + 6 * std::numbers::sqrt3 / std::numbers::pi * t * t + 1.4069 * t * t * t);
    }
    return sum / steps;
}

int poisson(double mean, Random& random) {
    int count = 0;
    for (; mean > 30; mean -= 30) count += poisson(30, random);  // exp(-mean) has to stay above zero
    const double limit = std::exp(-mean);
    for (double product = random.uniform(); product > limit; product *= random.uniform()) ++count;
    return count;
}

/// A number of the triangle's place, whatever its index and the order of its corners.
std::uint64_t key_of(const SkinSurface& surface, glm::uvec3 triangle) {
    std::uint64_t key = 0;
    for (int k = 0; k < 3; ++k) {
        const glm::dvec3 um = glm::round(glm::dvec3(surface.position_mm()[triangle[k]]) * 1000.0);
        std::uint64_t corner = 0;
        for (int axis = 0; axis < 3; ++axis) corner = mix(corner + std::uint64_t(std::int64_t(um[axis])));
        key += corner;
    }
    return mix(key);
}

struct Dart {
    Seedling seedling;
    float apart_mm;
};

/// Accepted points by cells; the cells are as large as points ever have to be apart.
class Accepted {
public:
    explicit Accepted(float cell_mm) : cell_mm_(cell_mm) {}

    bool has_room_for(const Dart& dart) const {
        const glm::ivec3 cell = cell_of(dart.seedling.place_mm);
        for (int k = 0; k < 27; ++k) {
            const auto found = cells_.find(key(cell + glm::ivec3(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1)));
            if (found == cells_.end()) continue;
            for (const Seedling& other : found->second)
                if (glm::distance(other.place_mm, dart.seedling.place_mm) < dart.apart_mm &&
                    glm::dot(other.normal, dart.seedling.normal) > 0)
                    return false;
        }
        return true;
    }

    void add(const Seedling& s) { cells_[key(cell_of(s.place_mm))].push_back(s); }

private:
    glm::ivec3 cell_of(glm::vec3 place) const { return glm::ivec3(glm::floor(place / cell_mm_)); }
    /// Cells that share a key share a list, which only costs time.
    static std::uint64_t key(glm::ivec3 c) {
        return mix(std::uint32_t(c.x) ^ mix(std::uint64_t(std::uint32_t(c.y)) << 32 | std::uint32_t(c.z)));
    }

    float cell_mm_;
    std::unordered_map<std::uint64_t, std::vector<Seedling>> cells_;
};

}  // namespace

std::vector<Seedling> scatter(const SkinSurface& surface, std::span<const float> density_per_mm2, float spacing,
                              std::uint64_t seed) {
    if (density_per_mm2.size() != surface.position_mm().size())
        throw std::invalid_argument("scatter: one density per welded vertex is needed");
    if (!(spacing >= 0 && spacing <= 0.6F)) throw std::invalid_argument("scatter: spacing is not within 0 to 0.6");

    float highest = 0;
    for (const float d : density_per_mm2) {
        if (!(d >= 0 && d < 1e6F)) throw std::invalid_argument("scatter: a density is not within 0 to 1e6");
        highest = std::max(highest, d);
    }
    std::vector<Seedling> points;
    if (highest == 0) return points;

    const double darts_per = darts_per_point(spacing);
    const float least_apart = spacing / std::sqrt(highest);
    std::vector<Dart> darts;
    for (std::uint32_t t = 0; t < surface.triangles().size(); ++t) {
        const glm::uvec3 corner = surface.triangles()[t];
        const float most =
            std::max({density_per_mm2[corner.x], density_per_mm2[corner.y], density_per_mm2[corner.z]});
        const double mean = darts_per * most * surface.triangle_area_mm2()[t];
        if (mean == 0) continue;
        Random random(seed ^ key_of(surface, corner));
        for (int left = poisson(mean, random); left > 0; --left) {
            // Uniform on a triangle (Osada et al. 2002).
            const double root = std::sqrt(random.uniform()), along = random.uniform();
            SurfacePoint point{t, {float(1 - root), float(root * (1 - along)), float(root * along)}};
            const double lot = random.uniform();
            const std::uint64_t own = random.bits();
            const float density = surface.value_at(point, density_per_mm2);
            if (lot * most >= density) continue;
            // Where points are rare they may come nearer: three times the least is enough to look even.
            const float apart = std::min(spacing / std::sqrt(density), 3 * least_apart);
            darts.push_back({{point, surface.place_mm(point), surface.normal_at(point), own}, apart});
        }
    }

    if (spacing > 0) {
        std::ranges::sort(darts, {}, [](const Dart& dart) { return dart.seedling.random; });
        Accepted accepted(3 * least_apart);
        std::erase_if(darts, [&](const Dart& dart) {
            if (!accepted.has_room_for(dart)) return true;
            accepted.add(dart.seedling);
            return false;
        });
    }
    points.reserve(darts.size());
    for (const Dart& dart : darts) points.push_back(dart.seedling);
    return points;
}

}  // namespace sanguine
