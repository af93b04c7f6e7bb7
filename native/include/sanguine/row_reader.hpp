// A picture of any format, some rows at a time: what is too large for memory is worked on in bands.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace sanguine {

/// Rows of the first subimage as floats, values as stored (8 bits divided by 255), alpha as stored.
///
/// Row 0 is the bottom row, as in `Image`. Any rows may be asked for in any order; from the top down is cheapest,
/// because compressed files are decoded from their first row, which is the top: going up may decode them again and
/// again. The rows of the last answer are kept, so bands that overlap (a halo for a filter) read nothing twice.
///
/// Memory is that of the rows asked for, rounded up to tiles in a tiled file, and what the format's decoder itself
/// needs: interlaced PNG, progressive JPEG, GIF and WebP are whole pictures there, of 8 or 16 bits per value.
class RowReader {
public:
    /// Throws ImageError, as read_image does.
    explicit RowReader(const std::filesystem::path& path);
    ~RowReader();
    RowReader(RowReader&&) noexcept;
    RowReader& operator=(RowReader&&) noexcept;

    int width() const;
    int height() const;
    const std::vector<std::string>& channels() const;
    /// How values are stored: uint8, uint16, half, float, or another of OpenImageIO's names.
    const std::string& pixel_type() const;
    /// Index of the channel that is alpha, -1 without one.
    int alpha_channel() const;

    /// Rows first to first + count - 1 into `out`, which has count * width * channels values; the lowest row first.
    /// Throws ImageError, and std::invalid_argument for rows that the picture does not have.
    void read_rows(int first, int count, std::span<float> out);

private:
    class Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace sanguine
