// The surface of a face and the features that grow on it.
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "counters.hpp"
#include "sanguine/feature.hpp"
#include "sanguine/image.hpp"
#include "sanguine/seams.hpp"
#include "sanguine/skin_surface.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using PointsIn = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using UvIn = nb::ndarray<const float, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using TrianglesIn = nb::ndarray<const std::int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using IndicesIn = nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using WeightsIn = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using LayerOut = nb::ndarray<nb::numpy, float, nb::ndim<2>>;
using OfEach = nb::ndim<1>;
using VectorOfEach = nb::shape<-1, 3>;
template <typename Scalar, typename Shape> using View = nb::ndarray<nb::numpy, const Scalar, Shape>;

static_assert(sizeof(glm::vec2) == 2 * sizeof(float) && sizeof(glm::vec3) == 3 * sizeof(float) &&
              sizeof(glm::uvec3) == 3 * sizeof(std::int32_t));

/// Negative indices become huge ones, which the library refuses.
void make_surface(sanguine::SkinSurface* self, const PointsIn& position_mm, const UvIn& uv,
                  const TrianglesIn& triangles, const IndicesIn& corner_vertex,
                  const std::vector<std::string>& region_names, const WeightsIn& region_weights) {
    if (region_weights.shape(0) != position_mm.shape(0) || region_weights.shape(1) != region_names.size())
        throw std::invalid_argument("skin surface: region_weights are not (vertices, regions)");
    nb::gil_scoped_release release;
    new (self) sanguine::SkinSurface({
        {reinterpret_cast<const glm::vec3*>(position_mm.data()), position_mm.shape(0)},
        {reinterpret_cast<const glm::vec2*>(uv.data()), uv.shape(0)},
        {reinterpret_cast<const glm::uvec3*>(triangles.data()), triangles.shape(0)},
        {reinterpret_cast<const std::uint32_t*>(corner_vertex.data()), corner_vertex.shape(0)},
        region_names,
        {region_weights.data(), region_weights.size()},
    });
}

sanguine::TexelMap texels(const sanguine::SkinSurface& surface, int width, int height, int padding_px, int threads) {
    if (width < 1 || height < 1 || width > sanguine::max_image_side || height > sanguine::max_image_side)
        throw std::invalid_argument("texels: width and height are allowed from 1 to 16384");
    return sanguine::map_texels(surface, width, height, padding_px, threads);
}

/// One member of every place, as an array that keeps the map alive.
template <typename Scalar, typename Shape>
View<Scalar, Shape> member(nb::handle self, const Scalar* first) {
    static_assert(sizeof(sanguine::SkinPlace) % sizeof(Scalar) == 0);
    constexpr std::size_t dimensions = std::is_same_v<Shape, VectorOfEach> ? 2 : 1;
    const std::size_t shape[2] = {nb::cast<const sanguine::TexelMap&>(self).place.size(), 3};
    const std::int64_t strides[2] = {sizeof(sanguine::SkinPlace) / sizeof(Scalar), 1};
    return View<Scalar, Shape>(first, dimensions, shape, self, strides);
}
LayerOut grow(const std::string& id, const sanguine::SkinSurface& surface, const sanguine::TexelMap& map,
              std::uint64_t seed, double age_years, double sun, double masculinity, int threads,
              const ProgressIn& progress) {
    auto layer = std::make_unique<std::vector<float>>();
    std::size_t channels;
    {
        nb::gil_scoped_release release;
        const sanguine::Feature& feature = sanguine::feature(id);
        channels = feature.row().changes.size();
        *layer = sanguine::grow_layer(feature, surface, map, {age_years, sun, masculinity}, seed, threads,
                                      with_gil(progress));
        counters.texels_painted.count += map.place.size();
    }
    float* values = layer->data();
    nb::capsule owner(layer.release(), [](void* p) noexcept { delete static_cast<std::vector<float>*>(p); });
    return LayerOut(values, {map.place.size(), channels}, owner);
}

void make_seams(sanguine::SeamTexels* self, const sanguine::SkinSurface& surface, int width, int height,
                const std::vector<std::pair<int, int>>& tiles) {
    if (width < 1 || height < 1 || width > sanguine::max_image_side || height > sanguine::max_image_side)
        throw std::invalid_argument("seam texels: width and height are allowed from 1 to 16384");
    nb::gil_scoped_release release;
    std::vector<glm::ivec2> corners;
    for (const auto& [u, v] : tiles) corners.emplace_back(u, v);
    new (self) sanguine::SeamTexels(surface, width, height, corners);
}

template <typename Member> View<std::uint32_t, OfEach> of_texels(nb::handle self, Member member_of) {
    const auto texels = nb::cast<const sanguine::SeamTexels&>(self).texels();
    const std::size_t count = texels.size();
    const std::int64_t stride = sizeof(sanguine::SeamTexel) / sizeof(std::uint32_t);
    return View<std::uint32_t, OfEach>(count ? &(texels[0].*member_of) : nullptr, 1, &count, self, &stride);
}

LayerOut equalize(const sanguine::SeamTexels& seams, const WeightsIn& values, int threads) {
    auto alike = std::make_unique<std::vector<float>>(values.data(), values.data() + values.size());
    const std::size_t count = values.shape(0), channels = values.shape(1);
    {
        nb::gil_scoped_release release;
        seams.equalize(*alike, int(channels), threads);
    }
    float* data = alike->data();
    nb::capsule owner(alike.release(), [](void* p) noexcept { delete static_cast<std::vector<float>*>(p); });
    return LayerOut(data, {count, channels}, owner);
}

nb::list feature_rows() {
    nb::list rows;
    for (const sanguine::Feature* feature : sanguine::features()) {
        const sanguine::FeatureRow& row = feature->row();
        nb::list changes;
        for (const sanguine::LayerChange& change : row.changes) {
            nb::dict d;
            d["channel"] = sanguine::layer_channel_id(change.channel);
            d["low"] = change.low;
            d["high"] = change.high;
            changes.append(d);
        }
        nb::dict d;
        d["id"] = row.id;
        d["label"] = row.label;
        d["help"] = row.help;
        d["source"] = row.source;
        d["changes"] = changes;
        rows.append(d);
    }
    return rows;
}

}  // namespace

void bind_mesh(nb::module_& m) {
    nb::class_<sanguine::TexelMap>(m, "TexelMap", R"(The texels of a UV layout that show skin, N of them.

Arrays are views of the map, read-only.)")
        .def_ro("width", &sanguine::TexelMap::width)
        .def_ro("height", &sanguine::TexelMap::height)
        .def_prop_ro(
            "texel",
            [](nb::handle self) {
                const auto& map = nb::cast<const sanguine::TexelMap&>(self);
                return View<std::uint32_t, OfEach>(map.texel.data(), {map.texel.size()}, self);
            },
            "(N,) uint32: row * width + column, row 0 being the bottom row (V = 0); ascending.")
        .def_prop_ro(
            "place_mm",
            [](nb::handle self) {
                const auto& map = nb::cast<const sanguine::TexelMap&>(self);
                return member<float, VectorOfEach>(self, &map.place.data()->place_mm.x);
            },
            "(N, 3) float32.")
        .def_prop_ro(
            "size_mm",
            [](nb::handle self) {
                const auto& map = nb::cast<const sanguine::TexelMap&>(self);
                return member<float, OfEach>(self, &map.place.data()->size_mm);
            },
            "(N,) float32: side of the square of skin that a texel shows.")
        .def_prop_ro(
            "triangle",
            [](nb::handle self) {
                const auto& map = nb::cast<const sanguine::TexelMap&>(self);
                return member<std::uint32_t, OfEach>(self, &map.place.data()->point.triangle);
            },
            "(N,) uint32: the triangle that a texel shows.")
        .def_prop_ro(
            "barycentric",
            [](nb::handle self) {
                const auto& map = nb::cast<const sanguine::TexelMap&>(self);
                return member<float, VectorOfEach>(self, &map.place.data()->point.barycentric.x);
            },
            "(N, 3) float32: where in the triangle, by its corners.");

    nb::class_<sanguine::SkinSurface>(m, "SkinSurface", R"(The skin of a face as features grow on it; immutable.

Parameters
----------
position_mm : (V, 3) float32, the neutral face; Z up, it looks along -Y
uv : (L, 2) float32, one per corner (loop)
triangles : (T, 3) int32, indices of corners
corner_vertex : (L,) int32, the vertex of each corner
region_names : R ids of rigs/regions.toml
region_weights : (V, R) float32, 0 to 1

Notes
-----
Vertices at the same place count as one. Raises ValueError for indices that do not exist, values that are not finite,
weights outside 0 to 1 and a mesh without area.)")
        .def("__init__", &make_surface, "position_mm"_a, "uv"_a, "triangles"_a, "corner_vertex"_a, "region_names"_a,
             "region_weights"_a)
        .def_prop_ro("area_mm2", &sanguine::SkinSurface::area_mm2)
        .def("texels", &texels, "width"_a, "height"_a, "padding_px"_a, "threads"_a = 0,
             nb::call_guard<nb::gil_scoped_release>(),
             R"(The texels that show skin or lie within `padding_px` of it (with the nearest place of the skin).

`width` and `height` are allowed from 1 to 16384; `threads` = 0 uses every core and changes nothing in the result.)");

    nb::class_<sanguine::SeamTexels>(m, "SeamTexels", R"(The texels that look-ups on UV seams read, N of them.

Parameters
----------
surface : SkinSurface
width, height : texels of an image, 1 to 16384
tiles : lower left corners in UV of the images that there are

Notes
-----
A bilinear look-up at a side that two triangles share reads other texels on each of its two places in UV. `equalize`
changes these texels, as little as that takes, until both read alike. Beyond the border of an image a look-up reads the
border. Liu et al. 2017, "Seamless: Seam Erasure and Seam-Aware Decoupling of Shape from Mesh Resolution".)")
        .def("__init__", &make_seams, "surface"_a, "width"_a, "height"_a, "tiles"_a = nb::make_tuple(nb::make_tuple(0, 0)))
        .def_prop_ro(
            "tile", [](nb::handle self) { return of_texels(self, &sanguine::SeamTexel::tile); },
            "(N,) uint32: index of the image in `tiles`; ascending.")
        .def_prop_ro(
            "texel", [](nb::handle self) { return of_texels(self, &sanguine::SeamTexel::texel); },
            "(N,) uint32: row * width + column, row 0 being the bottom row (V = 0); ascending in each image.")
        .def("equalize", &equalize, "values"_a, "threads"_a = 0,
             R"(Values (N, C) float32 that read alike on both sides of every seam, from those of the maps as they are.

Returns (N, C) float32. Each channel stays in the range that it has in `values`; `threads` = 0 uses every core and
changes nothing in the result. Raises ValueError for another shape and for values that are not finite.)");

    m.def("features", &feature_rows,
          R"(Every feature that grows on a face: dicts with id, label, help, source and changes.

`changes` are the columns of its layer, dicts with channel (log_hemoglobin, log_melanin, log_oil: natural logarithms
of a factor; oxygenation, ink_per_mm, height_mm: sums), low and high: the range that the layer stays in.)");

    m.def("grow", &grow, "feature_id"_a, "surface"_a, "texels"_a, "seed"_a, "age_years"_a, "sun"_a, "masculinity"_a,
          "threads"_a = 0, "progress"_a = nb::none(),
          R"(Grow one feature and paint it on the texels.

Parameters
----------
feature_id : an id of features()
surface : SkinSurface, the one that `texels` is of
texels : TexelMap
seed : 0 to 2^64 - 1; with equal arguments the result has the same bytes
age_years : 0 to 120
sun : exposure, 0 none to 1 a life outdoors
masculinity : 0 female to 1 male
threads : 0 uses every core; the result does not depend on it
progress : called with (done, total) on this thread a few times a second; False raises Cancelled

Returns
-------
(N, C) float32: a row for each texel of `texels.texel`, a column for each of the feature's changes.)");
}
