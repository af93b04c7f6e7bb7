#include "open_image.hpp"

#include <string>

#include "sanguine/image.hpp"

namespace sanguine {

std::unique_ptr<OIIO::ImageInput> open_checked(const std::filesystem::path& path) {
    OIIO::ImageSpec config;
    config.attribute("oiio:UnassociatedAlpha", 1);
    auto input = OIIO::ImageInput::open(path.string(), &config);
    if (!input) throw ImageError(path, "cannot be read: " + OIIO::geterror());
    const OIIO::ImageSpec& spec = input->spec();
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

}  // namespace sanguine
