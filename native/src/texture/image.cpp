#include "sanguine/image.hpp"

#include <algorithm>
#include <cstdint>
#include <sstream>
#include <vector>

#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <OpenImageIO/imageio.h>
#include <OpenImageIO/strutil.h>

#include "atomic_file.hpp"
#include "open_image.hpp"

namespace sanguine {
namespace {

namespace fs = std::filesystem;

/// Libraries say the same once for each block of a file, in lines, with bytes of a broken header in them.
std::string one_line(const std::string& text) {
    std::vector<std::string> said;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
        std::ranges::replace_if(line, [](unsigned char c) { return c < 0x20 || c == 0x7f; }, ' ');
        while (!line.empty() && line.back() == ' ') line.pop_back();
        if (!line.empty() && std::ranges::find(said, line) == said.end()) said.push_back(line);
    }
    std::string joined;
    for (const std::string& line : said) joined += (joined.empty() ? "" : "; ") + line;
    constexpr std::size_t longest = 400;
    if (joined.size() > longest) joined = joined.substr(0, longest) + "...";
    return joined;
}

/// `top_row` is where the file's first row goes; a negative stride turns the picture over.
void read_pixels(OIIO::ImageInput& input, const fs::path& path, OIIO::TypeDesc type, void* top_row,
                 OIIO::stride_t row_stride) {
    const OIIO::ImageSpec& spec = input.spec();
    const auto pixel = OIIO::stride_t(type.size()) * spec.nchannels;
    check_read(input.read_image(0, 0, 0, spec.nchannels, type, top_row, pixel, row_stride), input, path);
}

void write_pixels(const fs::path& path, OIIO::ImageSpec spec, OIIO::TypeDesc memory_type, const void* top_row,
                  OIIO::stride_t row_stride) {
    spec.attribute("oiio:UnassociatedAlpha", 1);
    AtomicFile file(path);
    auto output = OIIO::ImageOutput::create(file.temporary().string());
    if (!output) throw ImageError(path, "cannot be written: " + OIIO::geterror());
    const auto pixel = OIIO::stride_t(memory_type.size()) * spec.nchannels;
    if (!output->open(file.temporary().string(), spec) ||
        !output->write_image(memory_type, top_row, pixel, row_stride) || !output->close())
        throw ImageError(path, "cannot be written: " + output->geterror());
    file.commit();
}

OIIO::TypeDesc file_type(PixelType type) {
    switch (type) {
        case PixelType::uint8: return OIIO::TypeUInt8;
        case PixelType::uint16: return OIIO::TypeUInt16;
        case PixelType::half: return OIIO::TypeHalf;
        case PixelType::float32: return OIIO::TypeFloat;
    }
    throw std::invalid_argument("unknown pixel type");
}

/// The formats that are written are those the project uses; each of them is tested, row order included.
PixelType usual_pixel_type(const fs::path& path) {
    const std::string extension = OIIO::Strutil::lower(path.extension().string());
    if (extension == ".exr") return PixelType::half;
    if (extension == ".tif" || extension == ".tiff") return PixelType::float32;
    if (extension == ".png" || extension == ".jpg" || extension == ".jpeg") return PixelType::uint8;
    throw ImageError(path, "cannot be written: the extensions .exr, .tif, .tiff, .png, .jpg and .jpeg are allowed");
}

/// Eight bits per channel, row 0 at the top, three channels: what a contact sheet is made of.
struct Picture {
    int width = 0;
    int height = 0;
    std::vector<std::uint8_t> pixels;
};

Picture read_picture(const fs::path& path) {
    const auto input = open_checked(path);
    const OIIO::ImageSpec& spec = input->spec();
    check_fits_memory(path, spec);
    const auto channels = std::size_t(spec.nchannels);
    std::vector<std::uint8_t> all(spec.image_pixels() * channels);
    read_pixels(*input, path, OIIO::TypeUInt8, all.data(), OIIO::AutoStride);
    Picture picture{spec.width, spec.height, std::vector<std::uint8_t>(spec.image_pixels() * 3)};
    for (std::size_t i = 0; i < spec.image_pixels(); ++i)
        for (std::size_t c = 0; c < 3; ++c)  // grey pictures repeat their one channel, alpha is left out
            picture.pixels[3 * i + c] = all[i * channels + (channels < 3 ? 0 : c)];
    return picture;
}

}  // namespace

ImageError::ImageError(const fs::path& path, const std::string& what)
    : std::runtime_error(valid_utf8(path.string() + ": " + one_line(what))) {}

Image read_image(const fs::path& path) {
    const auto input = open_checked(path);
    const OIIO::ImageSpec& spec = input->spec();
    check_fits_memory(path, spec);
    Image image(spec.width, spec.height, spec.nchannels);
    const auto row = OIIO::stride_t(image.row_size() * sizeof(float));
    read_pixels(*input, path, OIIO::TypeFloat, image.pixels.get() + image.row_size() * std::size_t(spec.height - 1),
                -row);
    return image;
}

void write_image(const fs::path& path, const ImageView& image, std::optional<PixelType> type) {
    const PixelType usual = usual_pixel_type(path);
    const OIIO::ImageSpec spec(image.width, image.height, image.channels, file_type(type.value_or(usual)));
    const std::size_t row = std::size_t(image.width) * std::size_t(image.channels);
    write_pixels(path, spec, OIIO::TypeFloat, image.pixels.data() + row * std::size_t(image.height - 1),
                 -OIIO::stride_t(row * sizeof(float)));
}

void contact_sheet(std::span<const fs::path> paths, std::span<const std::string> captions, const fs::path& out_path,
                   const ContactSheetLayout& layout) {
    if (paths.empty()) throw std::invalid_argument("contact_sheet: no pictures");
    if (!captions.empty() && captions.size() != paths.size())
        throw std::invalid_argument("contact_sheet: " + std::to_string(captions.size()) + " captions for " +
                                    std::to_string(paths.size()) + " pictures");
    if (layout.columns < 1 || layout.gap_px < 0 || !(layout.background >= 0 && layout.background <= 1))
        throw std::invalid_argument("contact_sheet: columns from 1, gap_px from 0, background 0 to 1");

    std::vector<Picture> pictures;
    int cell_width = 0, cell_height = 0;
    for (const fs::path& path : paths) {
        pictures.push_back(read_picture(path));
        cell_width = std::max(cell_width, pictures.back().width);
        cell_height = std::max(cell_height, pictures.back().height);
    }

    const int font_px = std::clamp(cell_width / 16, 10, 64);
    const int caption_height = captions.empty() ? 0 : 2 * font_px;
    const int columns = std::min(layout.columns, int(paths.size()));
    const int rows = (int(paths.size()) + columns - 1) / columns;
    const int width = columns * cell_width + (columns + 1) * layout.gap_px;
    const int height = rows * (cell_height + caption_height) + (rows + 1) * layout.gap_px;
    if (width > max_image_side || height > max_image_side)
        throw ImageError(out_path, "would be " + std::to_string(width) + " x " + std::to_string(height) + "; " +
                                       std::to_string(max_image_side) + " is allowed: use fewer pictures per sheet");

    OIIO::ImageBuf sheet(OIIO::ImageSpec(width, height, 3, OIIO::TypeUInt8));
    OIIO::ImageBufAlgo::fill(sheet, {layout.background, layout.background, layout.background});
    const float ink = layout.background < 0.5F ? 0.9F : 0.1F;
    for (int i = 0; i < int(paths.size()); ++i) {
        const Picture& picture = pictures[std::size_t(i)];
        const int cell_x = layout.gap_px + (i % columns) * (cell_width + layout.gap_px);
        const int cell_y = layout.gap_px + (i / columns) * (cell_height + caption_height + layout.gap_px);
        const int x = cell_x + (cell_width - picture.width) / 2;
        const int y = cell_y + (cell_height - picture.height) / 2;
        sheet.set_pixels(OIIO::ROI(x, x + picture.width, y, y + picture.height), OIIO::TypeUInt8,
                         picture.pixels.data());
        if (!captions.empty() && !captions[std::size_t(i)].empty() &&
            !OIIO::ImageBufAlgo::render_text(sheet, cell_x + cell_width / 2, cell_y + cell_height + font_px,
                                             captions[std::size_t(i)], font_px, layout.font.string(), {ink, ink, ink},
                                             OIIO::ImageBufAlgo::TextAlignX::Center,
                                             OIIO::ImageBufAlgo::TextAlignY::Center))
            throw ImageError(out_path, "caption cannot be drawn: " + sheet.geterror());
    }
    write_pixels(out_path, OIIO::ImageSpec(width, height, 3, OIIO::TypeUInt8), OIIO::TypeUInt8, sheet.localpixels(),
                 OIIO::AutoStride);
}

}  // namespace sanguine
