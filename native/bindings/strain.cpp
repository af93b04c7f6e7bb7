// Strain of a surface that moves, and stripes across it.
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include "sanguine/strain.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using PointsIn = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using MovesIn = nb::ndarray<const float, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;
using TrianglesIn = nb::ndarray<const std::int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using WeightsIn = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
template <int dimensions> using FloatsOut = nb::ndarray<nb::numpy, float, nb::ndim<dimensions>>;

static_assert(sizeof(glm::vec3) == 3 * sizeof(float) && sizeof(sanguine::SurfaceTensor) == 6 * sizeof(float));

std::span<const glm::vec3> points(const PointsIn& array) {
    return {reinterpret_cast<const glm::vec3*>(array.data()), array.shape(0)};
}

/// Negative indices become huge ones, which the library refuses.
std::span<const glm::uvec3> corners(const TrianglesIn& array) {
    return {reinterpret_cast<const glm::uvec3*>(array.data()), array.shape(0)};
}

template <int dimensions>
FloatsOut<dimensions> to_numpy(std::vector<float> values, const std::array<std::size_t, dimensions>& shape) {
    auto* held = new std::vector<float>(std::move(values));
    nb::capsule owner(held, [](void* p) noexcept { delete static_cast<std::vector<float>*>(p); });
    return FloatsOut<dimensions>(held->data(), dimensions, shape.data(), owner);
}

sanguine::StrainMeasure measure_named(const std::string& name) {
    if (name == "linear") return sanguine::StrainMeasure::linear;
    if (name == "log") return sanguine::StrainMeasure::logarithmic;
    throw std::invalid_argument("measure: '" + name + "' is not one of linear, log");
}

FloatsOut<3> surface_strain(const PointsIn& position, const TrianglesIn& triangles, const MovesIn& displacements,
                            const std::string& measure) {
    const auto kind = measure_named(measure);
    const std::size_t keys = displacements.shape(0), count = displacements.shape(1);
    std::vector<float> out(keys * count * 6);
    {
        nb::gil_scoped_release release;
        const sanguine::RestShape rest(points(position), corners(triangles));
        const auto* moves = reinterpret_cast<const glm::vec3*>(displacements.data());
        for (std::size_t k = 0; k < keys; ++k) {
            const auto strain = rest.strain({moves + k * count, count}, kind);
            std::memcpy(out.data() + k * count * 6, strain.data(), count * 6 * sizeof(float));
        }
    }
    return to_numpy<3>(std::move(out), {keys, count, 6});
}

FloatsOut<1> vertex_areas(const PointsIn& position, const TrianglesIn& triangles) {
    std::vector<float> area;
    {
        nb::gil_scoped_release release;
        const sanguine::RestShape rest(points(position), corners(triangles));
        area.assign(rest.area().begin(), rest.area().end());
    }
    const std::size_t count = area.size();
    return to_numpy<1>(std::move(area), {count});
}

FloatsOut<1> stripe_phase(const PointsIn& position, const TrianglesIn& triangles, const PointsIn& across,
                          const WeightsIn& weight) {
    std::vector<float> phase;
    {
        nb::gil_scoped_release release;
        phase = sanguine::stripe_phase(points(position), corners(triangles), points(across),
                                       {weight.data(), weight.shape(0)});
    }
    const std::size_t count = phase.size();
    return to_numpy<1>(std::move(phase), {count});
}

}  // namespace

void bind_strain(nb::module_& m) {
    m.def("surface_strain", &surface_strain, "position"_a, "triangles"_a, "displacements"_a, "measure"_a = "log",
          R"(Strain of a surface whose vertices move, one result per row of displacements.

Parameters
----------
position : (V, 3) float32, at rest
triangles : (T, 3) int32, indices of vertices
displacements : (K, V, 3) float32, in the same unit
measure : "log" (Hencky, exact; trace = logarithm of the ratio of areas) or "linear" (infinitesimal; sums of
    displacements give sums of strains)

Returns
-------
(K, V, 6) float32: xx, yy, zz, xy, xz, yz of a symmetric tensor in the tangent plane at rest. Always finite: stretches
count as 0.05 at least and 20 at most, and triangles without area take no part.)");

    m.def("vertex_areas", &vertex_areas, "position"_a, "triangles"_a,
          "Area that each vertex stands for, (V,) float32: a third of its triangles'.");

    m.def("stripe_phase", &stripe_phase, "position"_a, "triangles"_a, "across"_a, "weight"_a,
          R"(Phase in cycles, (V,) float32, whose gradient follows `across` as nearly as one function can.

Parameters
----------
position : (V, 3) float32
triangles : (T, 3) int32, indices of vertices
across : (V, 3) float32, direction across the stripes times cycles per unit length; its sign carries no meaning
weight : (V,) float32, 0 or more: how much each direction counts)");
}
