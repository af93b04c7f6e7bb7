// How every reader of pictures opens a file: held against the limits before memory is taken.
#pragma once

#include <filesystem>
#include <memory>

#include <OpenImageIO/imageio.h>

namespace sanguine {

/// The first subimage, alpha as the file has it. Throws ImageError for what is no flat picture within the limits.
std::unique_ptr<OIIO::ImageInput> open_checked(const std::filesystem::path& path);

/// Throws ImageError if all of it is more than a picture in memory may have.
void check_fits_memory(const std::filesystem::path& path, const OIIO::ImageSpec& spec);

}  // namespace sanguine
