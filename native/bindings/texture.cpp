// Images, chromophore maps and the UV raster.
#include <array>
#include <mutex>
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
#include "sanguine/row_reader.hpp"
#include "sanguine/texture_file.hpp"

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

/// One thing at a time with a file, whichever threads ask, and none of them holds the GIL meanwhile.
class OneAtATime {
public:
    template <typename Work> auto operator()(Work work) {
        nb::gil_scoped_release release;
        std::lock_guard lock(mutex_);
        return work();
    }

private:
    std::mutex mutex_;
};

/// A RowReader that can be closed.
class PyRowReader {
public:
    explicit PyRowReader(const fs::path& path) {
        alone_([&] { reader_.emplace(path); });
    }
    template <typename Ask> auto ask(Ask ask) {
        return alone_([&] { return ask(open()); });
    }
    PixelsOut read_rows(int first, int count) {
        return to_numpy(alone_([&] {
            sanguine::RowReader& reader = open();
            if (count < 1 || count > reader.height())
                throw std::invalid_argument("read_rows: 1 to " + std::to_string(reader.height()) +
                                            " rows are allowed, not " + std::to_string(count));
            sanguine::Image rows(reader.width(), count, int(reader.channels().size()));
            reader.read_rows(first, count, {rows.pixels.get(), rows.size()});
            return rows;
        }));
    }
    void close() {
        alone_([&] { reader_.reset(); });
    }

private:
    sanguine::RowReader& open() {
        if (!reader_) throw std::invalid_argument("RowReader: the file is closed");
        return *reader_;
    }
    OneAtATime alone_;
    std::optional<sanguine::RowReader> reader_;
};

/// A MapWriter that ends with its `with` block: committed, or abandoned after an exception.
class PyMapWriter {
public:
    PyMapWriter(const fs::path& path, int width, int height, const std::vector<std::string>& channels,
                const sanguine::ExrAttributes& attributes, bool half, bool from_top)
        : shape_{std::size_t(width), channels.size()} {
        const auto order = from_top ? sanguine::RowOrder::from_top : sanguine::RowOrder::from_bottom;
        alone_([&] { writer_.emplace(path, width, height, channels, attributes, half, order); });
    }
    int rows_left() {
        return alone_([&] { return open().rows_left(); });
    }
    void write_rows(const PixelsIn& rows) {
        if (rows.shape(1) != shape_[0] || rows.shape(2) != shape_[1])
            throw std::invalid_argument("write_rows: rows of " + std::to_string(shape_[0]) + " x " +
                                        std::to_string(shape_[1]) + " values are wanted, not of " +
                                        std::to_string(rows.shape(1)) + " x " + std::to_string(rows.shape(2)));
        alone_([&] { open().write_rows({rows.data(), rows.size()}); });
    }
    void commit() {
        alone_([&] {
            open().commit();
            writer_.reset();
        });
    }
    void abandon() {
        alone_([&] { writer_.reset(); });
    }
    void leave(bool whole) {
        alone_([&] {
            std::optional<sanguine::MapWriter> last = std::move(writer_);
            writer_.reset();
            if (last && whole) last->commit();
        });
    }

private:
    sanguine::MapWriter& open() {
        if (!writer_) throw std::invalid_argument("MapWriter: the file is committed or abandoned");
        return *writer_;
    }
    OneAtATime alone_;
    std::optional<sanguine::MapWriter> writer_;
    std::array<std::size_t, 2> shape_;  // width, channels
};

void bind_rows(nb::module_& m) {
    nb::class_<PyRowReader>(m, "RowReader", R"(A picture of any format, some rows at a time; a context manager.

read_rows(first, count) gives (count, W, C) float32, row 0 of the picture at the bottom, values as stored. Any rows in
any order; from the top down is cheapest, since files are decoded from there, and rows of the answer before are not
read again (a halo costs nothing). Memory is that of the rows, rounded up to tiles, and what the format's decoder
needs: interlaced PNG, progressive JPEG, GIF and WebP are whole pictures there. Raises ImageError.)")
        .def(nb::init<const fs::path&>(), "path"_a)
        .def_prop_ro("width", [](PyRowReader& r) { return r.ask([](auto& file) { return file.width(); }); })
        .def_prop_ro("height", [](PyRowReader& r) { return r.ask([](auto& file) { return file.height(); }); })
        .def_prop_ro(
            "channels", [](PyRowReader& r) { return r.ask([](auto& file) { return file.channels(); }); },
            "Names, in the file's order.")
        .def_prop_ro(
            "pixel_type", [](PyRowReader& r) { return r.ask([](auto& file) { return file.pixel_type(); }); },
            "uint8, uint16, half, float or another of OpenImageIO's names.")
        .def_prop_ro(
            "alpha_channel",
            [](PyRowReader& r) {
                const int channel = r.ask([](auto& file) { return file.alpha_channel(); });
                return channel < 0 ? std::optional<int>() : channel;
            },
            "Index of the channel that is alpha, or None.")
        .def("read_rows", &PyRowReader::read_rows, "first"_a, "count"_a)
        .def("close", &PyRowReader::close)
        .def("__enter__", [](nb::handle self) { return nb::borrow(self); })
        .def("__exit__", [](PyRowReader& r, nb::args) { r.close(); });

    nb::class_<PyMapWriter>(m, "MapWriter", R"(A chromophore map written some rows at a time; a context manager.

The end of the `with` block commits, an exception in it abandons: the file appears whole or not at all.
channels, attributes, half: as in write_exr_map. from_top: bands come from the top of the picture down, else from the
bottom up; either way row 0 of each band is its lowest. Raises ImageError; ValueError for what does not fit.)")
        .def(nb::init<const fs::path&, int, int, const std::vector<std::string>&, const sanguine::ExrAttributes&, bool,
                      bool>(),
             "path"_a, "width"_a, "height"_a, "channels"_a, "attributes"_a, "half"_a = true, "from_top"_a = false)
        .def_prop_ro("rows_left", &PyMapWriter::rows_left)
        .def("write_rows", &PyMapWriter::write_rows, "rows"_a, "The next rows: (N, W, C) float32, finite.")
        .def("commit", &PyMapWriter::commit, "Makes the file appear; rows must not be missing.")
        .def("abandon", &PyMapWriter::abandon, "Leaves nothing behind.")
        .def("__enter__", [](nb::handle self) { return nb::borrow(self); })
        .def(
            "__exit__",
            [](PyMapWriter& w, nb::handle type, nb::handle, nb::handle) { w.leave(type.is_none()); },
            "type"_a.none(), "value"_a.none(), "traceback"_a.none());
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
        "uv_coverage",
        [](const UvIn& uv, const TrianglesIn& triangles, int width, int height) {
            if (width > sanguine::max_image_side || height > sanguine::max_image_side)
                throw std::invalid_argument("uv_coverage: width and height are allowed from 1 to 16384");
            sanguine::UvCoverage found;
            {
                nb::gil_scoped_release release;
                found = sanguine::uv_coverage(points(uv), corners(triangles), width, height);
            }
            nb::dict answer;
            answer["covered"] = found.covered;
            answer["overlapping"] = found.overlapping;
            answer["outside"] = found.outside;
            return answer;
        },
        "uv"_a, "triangles"_a, "width"_a, "height"_a,
        R"(How a UV layout fills the unit square, counted on the texels of a map of width x height.

Returns a dict: covered (texels whose centre lies in a triangle), overlapping (in more than one; common edges do not
count), outside (triangles with area and no point in the unit square).)");

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
        "read_exr_map_info",
        [](const fs::path& path) {
            sanguine::ExrMapInfo info;
            {
                nb::gil_scoped_release release;
                info = sanguine::read_exr_map_info(path);
            }
            return std::tuple(info.width, info.height, std::move(info.channels), std::move(info.attributes));
        },
        "path"_a, "The header of a chromophore map: (width, height, channel names, string attributes).");

    bind_rows(m);

    m.def("make_tx", &sanguine::make_tx, "source"_a, "destination"_a, nb::call_guard<nb::gil_scoped_release>(),
          R"(Write `source` as a tiled, mip-mapped .tx texture; values are data, not colour managed.

EXR inside for a source in EXR, else TIFF. The file appears whole or not at all. Raises ImageError (an OSError).)");

    m.def(
        "texture_info",
        [](const fs::path& path) {
            sanguine::TextureInfo info;
            {
                nb::gil_scoped_release release;
                info = sanguine::texture_info(path);
            }
            nb::dict answer;
            answer["tile_width"] = info.tile_width;
            answer["tile_height"] = info.tile_height;
            answer["levels"] = info.levels;
            answer["mean"] = info.mean;
            return answer;
        },
        "path"_a, "Of a picture, a dict: tile_width, tile_height (0 without tiles), levels, mean (from the level of one pixel).");

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
