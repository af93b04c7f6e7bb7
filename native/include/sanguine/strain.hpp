// How the skin of a face strains when its vertices move, and how folds lie across the strain.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

namespace sanguine {

/// A symmetric tensor in the plane of the surface at rest: xx, yy, zz, xy, xz, yz in the coordinates of the mesh.
/// Its normal direction has the eigenvalue 0; the other two are the principal strains.
using SurfaceTensor = std::array<float, 6>;

enum class StrainMeasure {
    /// The infinitesimal (Cauchy) strain: sums of displacements give sums of strains. Trace: relative change of area.
    linear,
    /// The logarithmic (Hencky) strain, half the logarithm of the right Cauchy-Green tensor: exact for any
    /// displacement, zero for any rotation. Trace: logarithm of the ratio of areas.
    logarithmic,
};

/// No stretch counts as less or more: a triangle that a shape key collapses has a finite strain.
inline constexpr double min_stretch = 0.05, max_stretch = 20.0;

/// A triangle mesh at rest, ready to be strained. Triangles without area, or thinner than a millionth of their
/// length, take no part; a vertex that has no other shows no strain.
class RestShape {
public:
    /// triangles: of vertices. Throws std::invalid_argument for indices that do not exist and values not finite.
    RestShape(std::span<const glm::vec3> position, std::span<const glm::uvec3> triangles);

    std::span<const glm::vec3> normal() const { return normal_; }  ///< per vertex, unit, by area; 0 where none is
    std::span<const float> area() const { return area_; }          ///< per vertex: a third of its triangles'

    /// Strain per vertex: of the triangles around it, each turned into the vertex's tangent plane, by area.
    /// Throws std::invalid_argument for a wrong count and values not finite.
    std::vector<SurfaceTensor> strain(std::span<const glm::vec3> displacement, StrainMeasure measure) const;

private:
    struct Plate {
        glm::uvec3 vertex;
        glm::dvec3 axis[2];      ///< the triangle's own frame, unit
        glm::dvec3 gradient[3];  ///< of the function that is 1 at a corner and 0 at the others
        double area;
    };
    std::vector<Plate> plates_;
    std::vector<glm::vec3> normal_;
    std::vector<float> area_;
};

/// A phase in cycles per vertex whose gradient follows `across` (per vertex, cycles per unit length) as nearly as one
/// function can: the least-squares solution, by finite elements. Furrows are its level sets.
///
/// The sign of `across` carries no meaning (a fold has no front): neighbours are brought to one sign first, the most
/// weighty and parallel ones before the rest. weight: per vertex, 0 or more, how much its direction counts.
/// Deterministic. Throws std::invalid_argument for counts or values that do not fit.
std::vector<float> stripe_phase(std::span<const glm::vec3> position, std::span<const glm::uvec3> triangles,
                                std::span<const glm::vec3> across, std::span<const float> weight);

}  // namespace sanguine
