// Chromophore maps: scanline OpenEXR with named channels, and attributes for the units and the schema version.
// OpenEXR is used directly because the names, types and attributes of channels are the contract of these files.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "sanguine/image.hpp"

namespace sanguine {

using ExrAttributes = std::map<std::string, std::string>;

struct ExrMap {
    Image image;
    std::vector<std::string> channels;  ///< in the file's order, which is alphabetical in every EXR
    ExrAttributes attributes;           ///< the string attributes alone
};

/// In which order the rows of a map come.
enum class RowOrder { from_bottom, from_top };

/// Write one map some rows at a time. The file appears with commit(); without it nothing is left behind.
class MapWriter {
public:
    /// Throws ImageError when the file cannot be written, std::invalid_argument for sizes and names that do not fit.
    MapWriter(const std::filesystem::path& path, int width, int height, std::span<const std::string> channels,
              const ExrAttributes& attributes, bool half, RowOrder order);
    ~MapWriter();
    MapWriter(MapWriter&&) noexcept;
    MapWriter& operator=(MapWriter&&) noexcept;

    int rows_left() const;

    /// The next rows, interleaved as in `Image`: the lowest of them first, whatever the order in which bands come.
    /// Throws ImageError, and std::invalid_argument for rows beyond the last, for a value that is not finite and for
    /// one beyond the range of half. After a throw the writer takes nothing more.
    void write_rows(std::span<const float> rows);

    /// Throws ImageError, and std::invalid_argument while rows are missing.
    void commit();

private:
    class Impl;
    std::unique_ptr<Impl> impl_;
};

/// Write one map; `channels` names the interleaved channels of `image`. The file appears whole or not at all.
/// Throws ImageError when it cannot be written, std::invalid_argument for names that do not fit the image, for a
/// value that is not finite and for one beyond the range of half.
void write_exr_map(const std::filesystem::path& path, const ImageView& image, std::span<const std::string> channels,
                   const ExrAttributes& attributes, bool half);

/// What the header of a map says, without its pixels. Throws ImageError.
struct ExrMapInfo {
    int width = 0;
    int height = 0;
    std::vector<std::string> channels;
    ExrAttributes attributes;
};
ExrMapInfo read_exr_map_info(const std::filesystem::path& path);

/// Read one map. The header is checked, against the limits and against the size of the file, before any pixel
/// memory is taken. Throws ImageError.
ExrMap read_exr_map(const std::filesystem::path& path);

}  // namespace sanguine
