// Pictures: reading, writing and the contact sheet. No colour management: the numbers in the file are the
// numbers in memory, 8-bit values divided by 255.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>

namespace sanguine {

inline constexpr int max_image_side = 16384;
inline constexpr int max_image_channels = 64;
/// Of a picture that is held as a whole: 16384 squared with 4 channels, 4 GiB of floats. Larger ones go by in rows.
inline constexpr std::size_t max_image_values = std::size_t(1) << 30;

/// A file that cannot be read or written. The message is one line and names the file.
class ImageError : public std::runtime_error {
public:
    ImageError(const std::filesystem::path& path, const std::string& what);
};

/// Interleaved pixels. Row 0 is the **bottom** row, as in Blender's images and as the V axis runs; files keep
/// their own order on disk, the flip is made when reading and writing.
struct Image {
    Image() = default;
    /// The pixels are not initialised: memory is touched only as data arrives, so a file whose header promises
    /// more than it holds costs nothing.
    Image(int columns, int rows, int values)
        : width(columns), height(rows), channels(values), pixels(std::make_unique_for_overwrite<float[]>(size())) {}

    std::size_t row_size() const { return std::size_t(width) * std::size_t(channels); }
    std::size_t size() const { return row_size() * std::size_t(height); }

    int width = 0;
    int height = 0;
    int channels = 0;
    std::unique_ptr<float[]> pixels;
};

/// The same layout, owned by somebody else.
struct ImageView {
    int width;
    int height;
    int channels;
    std::span<const float> pixels;
};

/// How a channel is stored in the file.
enum class PixelType { uint8, uint16, half, float32 };

/// Read any format that OpenImageIO knows, first subimage. Alpha is left as stored. Throws ImageError.
Image read_image(const std::filesystem::path& path);

/// Write EXR, TIFF, PNG or JPEG, as the file name's extension says; without a type, half for EXR, float for TIFF and
/// 8 bits for the others. The file appears whole or not at all. Throws ImageError.
void write_image(const std::filesystem::path& path, const ImageView& image, std::optional<PixelType> type = {});

struct ContactSheetLayout {
    int columns = 5;
    int gap_px = 8;
    /// 0 to 1, in the pictures' own encoding.
    float background = 0.1F;
    /// A TrueType font for the captions.
    std::filesystem::path font;
};

/// Set pictures side by side, first one top left, each with its caption below; an empty list of captions leaves
/// them out. 8-bit values are copied unchanged. Throws ImageError, or std::invalid_argument for a bad layout.
void contact_sheet(std::span<const std::filesystem::path> paths, std::span<const std::string> captions,
                   const std::filesystem::path& out_path, const ContactSheetLayout& layout);

}  // namespace sanguine
