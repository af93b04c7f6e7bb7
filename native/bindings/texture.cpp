// Images, chromophore maps and the UV raster.
#include <optional>
#include <string>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "counters.hpp"
#include "sanguine/exr_map.hpp"
#include "sanguine/image.hpp"
#include "sanguine/raster.hpp"

namespace nb = nanobind;
using namespace nb::literals;
namespace fs = std::filesystem;

namespace {

using PixelsIn = nb::ndarray<const float, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using PixelsOut = nb::ndarray<nb::numpy, float, nb::ndim<3>>;
using UvIn = nb::ndarray<const float, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using TrianglesIn = nb::ndarray<const std::int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using ValuesIn = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using FillIn = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

static_assert(sizeof(glm::vec2) == 2 * sizeof(float) && sizeof(glm::uvec3) == 3 * sizeof(std::int32_t));

/// The array owns the pixels from here on.
PixelsOut to_numpy(sanguine::Image image) {
    float* pixels = image.pixels.release();
    nb::capsule owner(pixels, [](void* p) noexcept { delete[] static_cast<float*>(p); });
    return PixelsOut(pixels, {std::size_t(image.height), std::size_t(image.width), std::size_t(image.channels)},
                     owner);
}

sanguine::ImageView view(const PixelsIn& pixels) {
    constexpr std::size_t limit = sanguine::max_image_side;
    if (pixels.size() == 0 || pixels.shape(0) > limit || pixels.shape(1) > limit ||
        pixels.shape(2) > sanguine::max_image_channels)
        throw std::invalid_argument("pixels: 1 to 16384 rows and columns and 1 to 64 channels are allowed");
    return {int(pixels.shape(1)), int(pixels.shape(0)), int(pixels.shape(2)), {pixels.data(), pixels.size()}};
}

std::span<const glm::vec2> points(const UvIn& uv) {
    return {reinterpret_cast<const glm::vec2*>(uv.data()), uv.shape(0)};
}

/// Negative indices become huge ones, which the library refuses.
std::span<const glm::uvec3> corners(const TrianglesIn& triangles) {
    return {reinterpret_cast<const glm::uvec3*>(triangles.data()), triangles.shape(0)};
}

PixelsOut rasterize_uv(const UvIn& uv, const TrianglesIn& triangles, const ValuesIn& values, int width, int height,
                       int padding_px, const FillIn& fill, int threads) {
    if (width < 1 || height < 1 || width > sanguine::max_image_side || height > sanguine::max_image_side)
        throw std::invalid_argument("rasterize_uv: width and height are allowed from 1 to 16384");
    if (values.shape(1) < 1 || values.shape(1) > sanguine::max_image_channels)
        throw std::invalid_argument("rasterize_uv: 1 to 64 channels are allowed");
    nb::gil_scoped_release release;
    sanguine::Image image(width, height, int(values.shape(1)));
    sanguine::rasterize_uv({points(uv), corners(triangles), {values.data(), values.size()}, image.channels},
                           padding_px, {fill.data(), fill.size()}, {{image.pixels.get(), image.size()}, width, height},
                           threads);
    counters.texels_rasterized.count += image.size();
    nb::gil_scoped_acquire acquire;
    return to_numpy(std::move(image));
}

std::optional<sanguine::PixelType> pixel_type_named(const std::optional<std::string>& name) {
    if (!name) return {};
    if (*name == "uint8") return sanguine::PixelType::uint8;
    if (*name == "uint16") return sanguine::PixelType::uint16;
    if (*name == "half") return sanguine::PixelType::half;
    if (*name == "float") return sanguine::PixelType::float32;
    throw std::invalid_argument("pixel_type: '" + *name + "' is not one of uint8, uint16, half, float");
}

/// The wheel carries it beside the module.
fs::path caption_font() {
    const auto module = nb::cast<fs::path>(nb::module_::import_("sanguine_core._core").attr("__file__"));
    return module.parent_path() / "fonts" / "DroidSans.ttf";
}

}  // namespace

void bind_texture(nb::module_& m) {
    nb::exception<sanguine::ImageError>(m, "ImageError", PyExc_OSError);

    m.def("rasterize_uv", &rasterize_uv, "uv"_a, "triangles"_a, "values"_a, "width"_a, "height"_a, "padding_px"_a,
          "fill"_a, "threads"_a = 0,
          R"(Draw per-corner values into the UV layout of a mesh.

Parameters
----------
uv : (L, 2) float32, one per corner (loop); (0, 0) to (1, 1) is the image
triangles : (T, 3) int32, indices of corners
values : (L, C) float32
width, height : pixels, 1 to 16384
padding_px : how far values reach beyond the mesh, over seams and borders
fill : (C,) float32, for all other pixels
threads : 0 uses every core; the result does not depend on it

Returns
-------
(height, width, C) float32; row 0 is the bottom row (V = 0), as in Blender's images.

Notes
-----
Triangles without area are skipped (`count_degenerate_uv` counts them), those outside the unit square clipped.)");

    m.def(
        "count_degenerate_uv",
        [](const UvIn& uv, const TrianglesIn& triangles) {
            return sanguine::count_degenerate_uv(points(uv), corners(triangles));
        },
        "uv"_a, "triangles"_a, nb::call_guard<nb::gil_scoped_release>(),
        "How many triangles have no area in UV space, or a coordinate that is not finite.");

    m.def(
        "read_image",
        [](const fs::path& path) {
            sanguine::Image image;
            {
                nb::gil_scoped_release release;
                image = sanguine::read_image(path);
            }
            return to_numpy(std::move(image));
        },
        "path"_a,
        R"(Read a picture as (H, W, C) float32, row 0 at the bottom, values as stored (8 bits divided by 255).

Raises ImageError (an OSError) that names the file.)");

    m.def(
        "write_image",
        [](const fs::path& path, const PixelsIn& pixels, const std::optional<std::string>& pixel_type) {
            const auto type = pixel_type_named(pixel_type);
            const sanguine::ImageView image = view(pixels);
            nb::gil_scoped_release release;
            sanguine::write_image(path, image, type);
        },
        "path"_a, "pixels"_a, "pixel_type"_a = nb::none(),
        R"(Write (H, W, C) float32, row 0 at the bottom, as EXR, TIFF, PNG or JPEG (by the file name's extension).

`pixel_type` is "uint8", "uint16", "half" or "float"; None takes half for EXR, float for TIFF and uint8 for others.
Values are not colour managed. The file appears whole or not at all. Raises ImageError (an OSError).)");

    m.def(
        "write_exr_map",
        [](const fs::path& path, const PixelsIn& pixels, const std::vector<std::string>& channels,
           const sanguine::ExrAttributes& attributes, bool half) {
            const sanguine::ImageView image = view(pixels);
            nb::gil_scoped_release release;
            sanguine::write_exr_map(path, image, channels, attributes, half);
        },
        "path"_a, "pixels"_a, "channels"_a, "attributes"_a, "half"_a = true,
        R"(Write a chromophore map: scanline EXR with one named channel per column of `pixels`.

Parameters
----------
path : the file appears whole or not at all
pixels : (H, W, C) float32, row 0 at the bottom, finite
channels : C different names
attributes : strings for the header (units, schema version)
half : 16-bit floats; False keeps 32 bits

Raises ImageError (an OSError), or ValueError for names or values that do not fit.)");

    m.def(
        "read_exr_map",
        [](const fs::path& path) {
            sanguine::ExrMap map;
            {
                nb::gil_scoped_release release;
                map = sanguine::read_exr_map(path);
            }
            return std::tuple(to_numpy(std::move(map.image)), std::move(map.channels), std::move(map.attributes));
        },
        "path"_a,
        R"(Read a chromophore map: (pixels, channel names, string attributes).

Channels come in the file's order, which is alphabetical in every EXR. Raises ImageError (an OSError).)");

    m.def(
        "contact_sheet",
        [](const std::vector<fs::path>& paths, const std::vector<std::string>& captions, const fs::path& out_path,
           int columns, int gap_px, float background) {
            const sanguine::ContactSheetLayout layout{columns, gap_px, background, caption_font()};
            nb::gil_scoped_release release;
            sanguine::contact_sheet(paths, captions, out_path, layout);
        },
        "paths"_a, "captions"_a, "out_path"_a, "columns"_a = 5, "gap_px"_a = 8, "background"_a = 0.1F,
        R"(Set pictures side by side with a caption below each (none if `captions` is empty).

8-bit values are copied unchanged. `background` is 0 to 1 in the pictures' encoding. Raises ImageError.)");
}
