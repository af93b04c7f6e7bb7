// Textures as renderers like them: tiled, with mip levels.
#pragma once

#include <filesystem>
#include <vector>

namespace sanguine {

/// Write `source` as a .tx texture: tiles of 64 x 64, mip levels by averaging down to one pixel, values, type and
/// channel names as they are: no colour management, no alpha, edges repeated outward. EXR inside for a source in
/// EXR, else TIFF. The file appears whole or not at all. The bytes do not depend on the number of threads.
/// Throws ImageError.
void make_tx(const std::filesystem::path& source, const std::filesystem::path& destination);

/// How a picture is laid out for a renderer.
struct TextureInfo {
    int tile_width = 0;  ///< 0 in a file of scanlines
    int tile_height = 0;
    int levels = 1;           ///< of detail, the full one included
    std::vector<float> mean;  ///< per channel, from the level of one pixel; empty without one
};
TextureInfo texture_info(const std::filesystem::path& path);

}  // namespace sanguine
