// Chromophore maps: scanline OpenEXR with named channels, and attributes for the units and the schema version.
// OpenEXR is used directly because the names, types and attributes of channels are the contract of these files.
#pragma once

#include <filesystem>
#include <map>
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

/// Write one map; `channels` names the interleaved channels of `image`. The file appears whole or not at all.
/// Throws ImageError when it cannot be written, std::invalid_argument for names that do not fit the image, for a
/// value that is not finite and for one beyond the range of half.
void write_exr_map(const std::filesystem::path& path, const ImageView& image, std::span<const std::string> channels,
                   const ExrAttributes& attributes, bool half);

/// Read one map. The header is checked, against the limits and against the size of the file, before any pixel
/// memory is taken. Throws ImageError.
ExrMap read_exr_map(const std::filesystem::path& path);

}  // namespace sanguine
