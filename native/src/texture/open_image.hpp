// How every reader of pictures opens a file: held against the limits before memory is taken, its texts made harmless.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include <OpenImageIO/imageio.h>

namespace sanguine {

/// Throws ImageError for a name without a file, of which some of OpenImageIO's readers make a picture up, and for what
/// would keep a reader waiting (a pipe, a device).
void check_is_file(const std::filesystem::path& path);

/// The first subimage, alpha as the file has it. Throws ImageError for what is no flat picture within the limits.
std::unique_ptr<OIIO::ImageInput> open_checked(const std::filesystem::path& path);

/// Throws ImageError if all of it is more than a picture in memory may have.
void check_fits_memory(const std::filesystem::path& path, const OIIO::ImageSpec& spec);

/// After a read: throws ImageError with what the format's reader says if it failed, or if it made rows up.
void check_read(bool done, OIIO::ImageInput& input, const std::filesystem::path& path);

/// A text out of a file: bytes that are no UTF-8 become '?'.
std::string valid_utf8(std::string text);

}  // namespace sanguine
