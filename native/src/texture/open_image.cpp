#include "open_image.hpp"

#include <string>
#include <string_view>
#include <system_error>

#include "sanguine/image.hpp"

namespace sanguine {

void check_is_file(const std::filesystem::path& path) {
    std::error_code error;
    const auto kind = std::filesystem::status(path, error).type();
    if (kind == std::filesystem::file_type::not_found) throw ImageError(path, "no such file");
    if (kind != std::filesystem::file_type::regular) throw ImageError(path, "cannot be read: it is no ordinary file");
}

std::unique_ptr<OIIO::ImageInput> open_checked(const std::filesystem::path& path) {
    check_is_file(path);
    OIIO::ImageSpec config;
    config.attribute("oiio:UnassociatedAlpha", 1);
    auto input = OIIO::ImageInput::open(path.string(), &config);
    if (!input) throw ImageError(path, "cannot be read: " + OIIO::geterror());
    const OIIO::ImageSpec& spec = input->spec();
    if (std::string_view(input->format_name()) == "null") throw ImageError(path, "is no picture");
    if (spec.deep) throw ImageError(path, "is a deep image; flat ones are allowed");
    if (spec.width < 1 || spec.height < 1 || spec.depth != 1 || spec.width > max_image_side ||
        spec.height > max_image_side || spec.nchannels < 1 || spec.nchannels > max_image_channels)
        throw ImageError(path, "is " + std::to_string(spec.width) + " x " + std::to_string(spec.height) + " x " +
                                   std::to_string(spec.depth) + " with " + std::to_string(spec.nchannels) +
                                   " channels; at most " + std::to_string(max_image_side) + " squared with " +
                                   std::to_string(max_image_channels) + " channels are allowed");
    return input;
}

void check_fits_memory(const std::filesystem::path& path, const OIIO::ImageSpec& spec) {
    const std::size_t values = spec.image_pixels() * std::size_t(spec.nchannels);
    if (values > max_image_values)
        throw ImageError(path, "has " + std::to_string(values) + " values; " + std::to_string(max_image_values) +
                                   " are allowed in memory at once");
}

void check_read(bool done, OIIO::ImageInput& input, const std::filesystem::path& path) {
    const std::string said = input.geterror();
    // A JPEG that is cut short is filled up with grey, and nothing but this remark tells of it.
    if (!done || said.find("Premature end of JPEG") != std::string::npos)
        throw ImageError(path, "cannot be read: " + said);
}

std::string valid_utf8(std::string text) {
    const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
    for (std::size_t i = 0; i < text.size();) {
        const unsigned first = byte(i);
        const std::size_t length = first < 0x80                     ? 1
                                   : first < 0xc2 || first >= 0xf5 ? 0
                                   : first < 0xe0                  ? 2
                                   : first < 0xf0                  ? 3
                                                                   : 4;
        bool valid = length > 0;
        for (std::size_t k = 1; k < length; ++k) valid = valid && (byte(i + k) & 0xc0U) == 0x80;
        // Longer than needed, surrogates, and beyond the last code point (Unicode, table 3-7).
        if (first == 0xe0) valid = valid && byte(i + 1) >= 0xa0;
        if (first == 0xed) valid = valid && byte(i + 1) < 0xa0;
        if (first == 0xf0) valid = valid && byte(i + 1) >= 0x90;
        if (first == 0xf4) valid = valid && byte(i + 1) < 0x90;
        if (!valid) text[i] = '?';
        i += valid ? length : 1;
    }
    return text;
}

}  // namespace sanguine
