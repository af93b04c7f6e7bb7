#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <glm/geometric.hpp>

#include "sanguine/strain.hpp"
#include "triangles.hpp"

namespace sanguine {
namespace {

struct Edge {
    float merit;
    std::uint32_t a, b;
    bool operator<(const Edge& other) const {
        if (merit != other.merit) return merit > other.merit;  // the best first
        return a != other.a ? a < other.a : b < other.b;
    }
};

/// Sets of vertices that have one sign among them; `flipped` is relative to the set's root.
class SignedSets {
public:
    explicit SignedSets(std::size_t count) : parent_(count), flipped_(count, 0), size_(count, 1) {
        std::iota(parent_.begin(), parent_.end(), 0U);
    }
    /// Root of the set, and whether `v` is flipped against it.
    std::pair<std::uint32_t, bool> find(std::uint32_t v) const {
        bool flip = false;
        for (; parent_[v] != v; v = parent_[v]) flip ^= bool(flipped_[v]);
        return {v, flip};
    }
    /// Joins two sets such that a and b are flipped against each other or not.
    void join(std::uint32_t a, std::uint32_t b, bool against) {
        auto [ra, fa] = find(a);
        auto [rb, fb] = find(b);
        if (ra == rb) return;
        if (size_[ra] < size_[rb]) std::swap(ra, rb);
        parent_[rb] = ra;
        flipped_[rb] = char(fa ^ fb ^ against);
        size_[ra] += size_[rb];
    }

private:
    std::vector<std::uint32_t> parent_;
    std::vector<char> flipped_;
    std::vector<std::uint32_t> size_;
};

/// The directions with one sign where neighbours agree: a maximal spanning forest decides.
std::vector<glm::dvec3> one_sign(std::span<const glm::uvec3> triangles, std::span<const glm::vec3> across,
                                 std::span<const float> weight) {
    std::vector<Edge> edges;
    for (const glm::uvec3 t : triangles)
        for (int k = 0; k < 3; ++k) {
            const std::uint32_t a = std::min(t[k], t[(k + 1) % 3]), b = std::max(t[k], t[(k + 1) % 3]);
            const float merit = std::min(weight[a], weight[b]) * std::abs(glm::dot(across[a], across[b]));
            if (merit > 0) edges.push_back({merit, a, b});
        }
    std::ranges::sort(edges, std::less<>());
    SignedSets sets(across.size());
    for (const Edge& edge : edges) sets.join(edge.a, edge.b, glm::dot(across[edge.a], across[edge.b]) < 0);
    std::vector<glm::dvec3> signed_across;
    for (std::uint32_t v = 0; v < across.size(); ++v)
        signed_across.push_back(glm::dvec3(across[v]) * (sets.find(v).second ? -1.0 : 1.0));
    return signed_across;
}

}  // namespace

std::vector<float> stripe_phase(std::span<const glm::vec3> position, std::span<const glm::uvec3> triangles,
                                std::span<const glm::vec3> across, std::span<const float> weight) {
    const std::size_t count = position.size();
    check_points(position, "position");
    check_triangles(triangles, count);
    if (across.size() != count || weight.size() != count)
        throw std::invalid_argument("across, weight: one of each per vertex is needed, " + std::to_string(count));
    check_points(across, "across");
    for (std::size_t v = 0; v < count; ++v)
        if (!(weight[v] >= 0) || !std::isfinite(weight[v]))
            throw std::invalid_argument("weight: vertex " + std::to_string(v) + " is negative or not finite");
    const float heaviest = count ? *std::ranges::max_element(weight) : 0.0F;
    if (heaviest == 0) return std::vector<float>(count, 0.0F);

    const std::vector<glm::dvec3> along = one_sign(triangles, across, weight);
    // Where no direction counts the phase runs on smoothly.
    const double least = 1e-4 * heaviest;
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::VectorXd right = Eigen::VectorXd::Zero(Eigen::Index(count));
    double total = 0;
    for (const glm::uvec3 t : triangles) {
        const FlatTriangle flat(position, t);
        if (!flat.sound) continue;
        glm::dvec3 wanted(0);
        double counts = 0;
        for (int k = 0; k < 3; ++k) {
            wanted += double(weight[t[k]]) * along[t[k]];
            counts += weight[t[k]];
        }
        const double mass = flat.area * (counts / 3 + least);
        if (counts > 0) wanted /= counts;
        for (int i = 0; i < 3; ++i) {
            right[t[i]] += mass * glm::dot(flat.gradient[i], wanted);
            for (int j = 0; j < 3; ++j)
                entries.emplace_back(t[i], t[j], mass * glm::dot(flat.gradient[i], flat.gradient[j]));
            total += mass * glm::dot(flat.gradient[i], flat.gradient[i]);
        }
    }
    // A phase is free up to a constant per connected piece; this small pull to 0 picks one.
    const double pull = std::max(1e-9 * total / double(count), 1e-300);
    for (std::size_t v = 0; v < count; ++v) entries.emplace_back(int(v), int(v), pull);
    Eigen::SparseMatrix<double> matrix{Eigen::Index(count), Eigen::Index(count)};
    matrix.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
    const Eigen::VectorXd phase = solver.solve(right);
    std::vector<float> out;
    out.reserve(count);
    for (Eigen::Index v = 0; v < phase.size(); ++v) out.push_back(float(phase[v]));
    return out;
}

}  // namespace sanguine
