#include "sanguine/seams.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>

#include "sanguine/parallel.hpp"
#include "uv_raster.hpp"

namespace sanguine {
namespace {

using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;

// What a difference of readings counts against a change of a texel, both squared. Ten times as much leaves hardly less
// of the differences of our heads, and changes texels a third more.
constexpr double agreement = 1000;
// The same of a value that is held at its bound: it moves by less than a thousandth of what its readings miss.
constexpr double held = 1e6;
// Rounds of holding values that would leave their range; what a guess at their number misses is cut off.
constexpr int most_rounds = 8;
// Of the range of a channel: what may be cut off without a further round, a tenth of what is seen (2 % are asked for).
constexpr double negligible = 0.002;
// Of the right-hand side, the differences that there were: what is left of them is far below what is negligible.
constexpr double solver_tolerance = 1e-5;
constexpr int most_iterations = 2000;
// A look-up has kinks where either grid has a row of texels: half a texel apart, samples left up to 2.9 % of a feature's
// range on our heads, a quarter apart 1.1 %.
constexpr double samples_per_px = 4;
// Where every triangle is an island of its own samples become fewer: a seam needs no more than the image has texels.
constexpr double most_samples = 1 << 22;
// UVs are rounded to about this; a corner on the border of a tile belongs to the triangle's own side of it.
constexpr double uv_rounding = 1e-5;

void require(bool condition, const std::string& message) {
    if (!condition) throw std::invalid_argument("seam texels: " + message);
}

/// One side of a triangle in UV and the centre of that triangle.
struct Side {
    glm::dvec2 from, to, centre;
};

struct Seam {
    Side a, b;  // the same two points of the skin in the same order
    double length_px(glm::dvec2 image) const {
        return std::max(glm::length((a.to - a.from) * image), glm::length((b.to - b.from) * image));
    }
};

std::vector<Seam> seams_of(const SkinSurface& surface) {
    const auto side_of = [&](std::uint32_t triangle, std::uint32_t first, std::uint32_t second) -> std::optional<Side> {
        const UvTriangle t = corners_of(surface.uv(), surface.corners()[triangle]);
        if (is_degenerate(t)) return {};
        const glm::uvec3 vertex = surface.triangles()[triangle];
        Side side{{}, {}, (t[0] + t[1] + t[2]) / 3.0};
        for (int k = 0; k < 3; ++k) {
            if (vertex[k] == first) side.from = t[std::size_t(k)];
            if (vertex[k] == second) side.to = t[std::size_t(k)];
        }
        return side;
    };
    std::vector<Seam> seams;
    for (std::uint32_t i = 0; i < surface.triangles().size(); ++i) {
        for (int k = 0; k < 3; ++k) {
            const std::uint32_t other = surface.neighbours()[i][std::size_t(k)];
            if (other == SkinSurface::none || other < i) continue;
            const std::uint32_t first = surface.triangles()[i][k], second = surface.triangles()[i][(k + 1) % 3];
            const std::optional<Side> a = side_of(i, first, second), b = side_of(other, first, second);
            if (!a || !b || (a->from == b->from && a->to == b->to)) continue;
            seams.push_back({*a, *b});
        }
    }
    return seams;
}

/// The four texels of a bilinear look-up, by image and place, with their weights.
struct LookUp {
    std::array<std::uint64_t, 4> texel;
    std::array<double, 4> weight;
};

class Images {
public:
    Images(int width, int height, std::span<const glm::ivec2> tiles) : width_(width), height_(height), tiles_(tiles) {}

    std::optional<LookUp> look_up(glm::dvec2 uv, glm::dvec2 centre) const {
        const glm::dvec2 inside = uv + glm::clamp(centre - uv, -uv_rounding, uv_rounding);
        const glm::dvec2 corner = glm::floor(inside);
        const auto tile = std::ranges::find(tiles_, corner, [](glm::ivec2 t) { return glm::dvec2(t); });
        if (tile == tiles_.end()) return {};
        const glm::dvec2 at = (uv - corner) * glm::dvec2(width_, height_) - 0.5;
        const glm::dvec2 low = glm::floor(at), part = at - low;
        const std::array<double, 2> wx{1 - part.x, part.x}, wy{1 - part.y, part.y};
        LookUp found;
        for (int j = 0; j < 2; ++j)
            for (int i = 0; i < 2; ++i) {
                const auto x = std::uint64_t(std::clamp(int(low.x) + i, 0, width_ - 1));
                const auto y = std::uint64_t(std::clamp(int(low.y) + j, 0, height_ - 1));
                const auto n = std::size_t(2 * j + i);
                found.texel[n] = std::uint64_t(tile - tiles_.begin()) << 32U | (y * std::uint64_t(width_) + x);
                found.weight[n] = wx[std::size_t(i)] * wy[std::size_t(j)];
            }
        return found;
    }

private:
    int width_, height_;
    std::span<const glm::ivec2> tiles_;
};

}  // namespace

struct SeamTexels::System {
    Matrix gram;  // of the differences of readings, weighted

    /// The values nearest to `wanted` (each as its `weight` says) that are read alike on both sides.
    Eigen::VectorXd nearest(const Eigen::VectorXd& wanted, const Eigen::VectorXd& weight) const {
        Matrix all = gram;
        all.diagonal() += weight;
        Eigen::ConjugateGradient<Matrix, Eigen::Lower | Eigen::Upper> solver;
        solver.setTolerance(solver_tolerance);
        solver.setMaxIterations(most_iterations);
        solver.compute(all);
        return wanted + solver.solve(-(gram * wanted));
    }

    void equalize(Eigen::VectorXd& values) const {
        const double low = values.minCoeff(), high = values.maxCoeff(), slack = negligible * (high - low);
        if (!(high > low)) return;
        Eigen::VectorXd wanted = values, weight = Eigen::VectorXd::Ones(values.size());
        for (int round = 0; round < most_rounds; ++round) {
            values = nearest(wanted, weight);
            bool within = true;
            for (Eigen::Index i = 0; i < values.size(); ++i) {
                if (values[i] >= low - slack && values[i] <= high + slack) continue;
                wanted[i] = std::clamp(values[i], low, high);
                weight[i] = held;
                within = false;
            }
            if (within) break;
        }
        values = values.cwiseMax(low).cwiseMin(high);
    }
};

SeamTexels::SeamTexels(const SkinSurface& surface, int width, int height, std::span<const glm::ivec2> tiles) {
    require(width > 0 && height > 0, "the image has no pixels");
    const glm::dvec2 size(width, height);
    const std::vector<Seam> seams = seams_of(surface);
    // A side beyond all images would ask for any number of samples that nothing shows.
    const double longest = 2 * glm::length(size);
    const auto length_px = [&](const Seam& seam) { return std::min(seam.length_px(size), longest); };
    double total = 0;
    for (const Seam& seam : seams) total += length_px(seam);
    const double per_px = std::min(samples_per_px, most_samples / std::max(total, 1.0));

    const Images images(width, height, tiles);
    using Sample = std::array<LookUp, 2>;
    std::vector<Sample> samples;
    for (const Seam& seam : seams) {
        const int steps = std::max(1, int(std::ceil(per_px * length_px(seam))));
        for (int i = 0; i <= steps; ++i) {
            const double t = double(i) / steps;
            const auto a = images.look_up(glm::mix(seam.a.from, seam.a.to, t), seam.a.centre);
            const auto b = images.look_up(glm::mix(seam.b.from, seam.b.to, t), seam.b.centre);
            if (a && b) samples.push_back({*a, *b});
        }
    }

    if (samples.empty()) return;

    std::vector<std::uint64_t> touched;
    touched.reserve(8 * samples.size());
    for (const Sample& sample : samples)
        for (const LookUp& side : sample) touched.insert(touched.end(), side.texel.begin(), side.texel.end());
    std::ranges::sort(touched);
    touched.erase(std::ranges::unique(touched).begin(), touched.end());
    texels_.reserve(touched.size());
    for (const std::uint64_t texel : touched) texels_.push_back({std::uint32_t(texel >> 32U), std::uint32_t(texel)});

    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(8 * samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i)
        for (std::size_t side = 0; side < 2; ++side)
            for (std::size_t k = 0; k < 4; ++k) {
                const LookUp& read = samples[i][side];
                const auto column = std::ranges::lower_bound(touched, read.texel[k]) - touched.begin();
                entries.emplace_back(int(i), int(column), (side == 0 ? 1 : -1) * std::sqrt(agreement) * read.weight[k]);
            }
    Matrix difference(Eigen::Index(samples.size()), Eigen::Index(touched.size()));
    difference.setFromTriplets(entries.begin(), entries.end());
    // Products that cancel out stay in the pattern, so that a weight can be added to every element of the diagonal.
    system_ = std::make_unique<System>(Matrix(difference.transpose() * difference));
}

SeamTexels::~SeamTexels() = default;
SeamTexels::SeamTexels(SeamTexels&&) noexcept = default;
SeamTexels& SeamTexels::operator=(SeamTexels&&) noexcept = default;

std::span<const SeamTexel> SeamTexels::texels() const { return texels_; }

void SeamTexels::equalize(std::span<float> values, int channels, int threads) const {
    require(channels > 0, "values have no channel");
    require(values.size() == texels_.size() * std::size_t(channels), "values are not texels * channels");
    require(std::ranges::all_of(values, [](float v) { return std::isfinite(v); }), "a value is not finite");
    if (texels_.empty()) return;
    parallel_for(std::size_t(channels), threads, {}, [&](std::size_t c) {
        Eigen::VectorXd one(Eigen::Index(texels_.size()));
        for (std::size_t i = 0; i < texels_.size(); ++i)
            one[Eigen::Index(i)] = double(values[i * std::size_t(channels) + c]);
        system_->equalize(one);
        for (std::size_t i = 0; i < texels_.size(); ++i)
            values[i * std::size_t(channels) + c] = float(one[Eigen::Index(i)]);
    });
}

}  // namespace sanguine
