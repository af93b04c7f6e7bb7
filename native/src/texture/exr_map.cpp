#include "sanguine/exr_map.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/openexr.h>
#include <half.h>

#include "atomic_file.hpp"

namespace sanguine {
namespace {

namespace fs = std::filesystem;

/// OpenEXR's C reader, which parses the header alone and holds every size in it against the size of the file.
/// The C++ reader used for the pixels takes memory for what the header promises before it looks.
class HeaderReader {
public:
    explicit HeaderReader(const fs::path& path) : path_(path) {
        exr_context_initializer_t settings = EXR_DEFAULT_CONTEXT_INITIALIZER;
        settings.max_image_width = max_image_side;
        settings.max_image_height = max_image_side;
        settings.user_data = &message_;
        settings.error_handler_fn = [](exr_const_context_t context, exr_result_t, const char* message) {
            void* user = nullptr;
            // During the opening itself there is no context to ask yet.
            if (context && exr_get_user_data(context, &user) == EXR_ERR_SUCCESS && user)
                *static_cast<std::string*>(user) = message;
        };
        check(exr_start_read(&context_, path.c_str(), &settings));
    }
    ~HeaderReader() { exr_finish(&context_); }
    HeaderReader(const HeaderReader&) = delete;
    HeaderReader& operator=(const HeaderReader&) = delete;

    /// Throws unless the file is what write_exr_map makes, within the limits.
    void validate() {
        int parts = 0;
        check(exr_get_count(context_, &parts));
        exr_storage_t storage = EXR_STORAGE_LAST_TYPE;
        check(exr_get_storage(context_, 0, &storage));
        if (parts != 1 || storage != EXR_STORAGE_SCANLINE)
            throw ImageError(path_, "is not a single-part scanline EXR");

        const exr_attr_chlist_t* channels = nullptr;
        check(exr_get_channels(context_, 0, &channels));
        if (channels->num_channels < 1 || channels->num_channels > max_image_channels)
            throw ImageError(path_, "has " + std::to_string(channels->num_channels) + " channels; 1 to " +
                                        std::to_string(max_image_channels) + " are allowed");
        for (int i = 0; i < channels->num_channels; ++i)
            if (channels->entries[i].x_sampling != 1 || channels->entries[i].y_sampling != 1)
                throw ImageError(path_, "has subsampled channels");
    }

private:
    void check(exr_result_t result) const {
        if (result == EXR_ERR_SUCCESS) return;
        throw ImageError(path_, message_.empty() ? exr_get_default_error_message(result) : message_);
    }

    fs::path path_;
    exr_context_t context_ = nullptr;
    std::string message_;
};

void validate_for_writing(const ImageView& image, std::span<const std::string> channels, bool half) {
    const auto fail = [](const std::string& what) { throw std::invalid_argument("write_exr_map: " + what); };
    if (image.width < 1 || image.height < 1 || image.width > max_image_side || image.height > max_image_side)
        fail("the image is " + std::to_string(image.width) + " x " + std::to_string(image.height) +
             "; 1 to " + std::to_string(max_image_side) + " are allowed");
    if (image.channels < 1 || image.channels > max_image_channels || channels.size() != std::size_t(image.channels))
        fail(std::to_string(channels.size()) + " names for " + std::to_string(image.channels) + " channels (1 to " +
             std::to_string(max_image_channels) + ")");
    if (std::set<std::string>(channels.begin(), channels.end()).size() != channels.size())
        fail("a channel name is used twice");
    if (std::ranges::any_of(channels, [](const std::string& name) { return name.empty() || name.size() > 255; }))
        fail("a channel name is empty or longer than 255 bytes");

    const float limit = half ? float(HALF_MAX) : std::numeric_limits<float>::max();
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
        if (!(std::abs(image.pixels[i]) <= limit))  // so written, NaN fails as well
            fail("channel '" + channels[i % channels.size()] + "' holds " + std::to_string(image.pixels[i]) +
                 (half ? ", which half floats cannot" : ", which is not finite"));
}

Imf::Header make_header(const ImageView& image, std::span<const std::string> channels,
                        const ExrAttributes& attributes, Imf::PixelType type) {
    Imf::Header header(image.width, image.height);
    header.compression() = Imf::ZIP_COMPRESSION;
    for (const std::string& name : channels) header.channels().insert(name, Imf::Channel(type));
    for (const auto& [name, value] : attributes) header.insert(name, Imf::StringAttribute(value));
    return header;
}

/// Interleaved rows of `Value`, the first in memory being the top of the picture as OpenEXR wants it.
template <typename Value>
Imf::FrameBuffer frame_buffer(Value* top_row, int width, std::span<const std::string> channels, Imf::PixelType type) {
    Imf::FrameBuffer buffer;
    const std::size_t x_stride = sizeof(Value) * channels.size();
    for (std::size_t i = 0; i < channels.size(); ++i)
        buffer.insert(channels[i], Imf::Slice(type, reinterpret_cast<char*>(top_row + i), x_stride,
                                              x_stride * std::size_t(width)));
    return buffer;
}

template <typename Value>
void write_pixels(const fs::path& path, const ImageView& image, std::span<const std::string> channels,
                  const ExrAttributes& attributes, Imf::PixelType type) {
    const std::size_t row = std::size_t(image.width) * channels.size();
    std::vector<Value> flipped(row * std::size_t(image.height));
    for (int y = 0; y < image.height; ++y)
        std::transform(image.pixels.begin() + std::ptrdiff_t(row) * y,
                       image.pixels.begin() + std::ptrdiff_t(row) * (y + 1),
                       flipped.begin() + std::ptrdiff_t(row) * (image.height - 1 - y),
                       [](float value) { return Value(value); });
    Imf::OutputFile file(path.c_str(), make_header(image, channels, attributes, type));
    file.setFrameBuffer(frame_buffer(flipped.data(), image.width, channels, type));
    file.writePixels(image.height);
}

}  // namespace

void write_exr_map(const fs::path& path, const ImageView& image, std::span<const std::string> channels,
                   const ExrAttributes& attributes, bool half) {
    validate_for_writing(image, channels, half);
    AtomicFile file(path);
    try {
        if (half)
            write_pixels<::half>(file.temporary(), image, channels, attributes, Imf::HALF);
        else
            write_pixels<float>(file.temporary(), image, channels, attributes, Imf::FLOAT);
    } catch (const std::exception& error) {
        throw ImageError(path, std::string("cannot be written: ") + error.what());
    }
    file.commit();
}

ExrMap read_exr_map(const fs::path& path) {
    HeaderReader(path).validate();
    try {
        Imf::InputFile file(path.c_str());
        const Imf::Header& header = file.header();
        ExrMap map;
        for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel)
            map.channels.emplace_back(channel.name());
        for (auto attribute = header.begin(); attribute != header.end(); ++attribute)
            if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&attribute.attribute()))
                map.attributes.emplace(attribute.name(), text->value());

        const Imath::Box2i window = header.dataWindow();
        map.image = Image(window.max.x - window.min.x + 1, window.max.y - window.min.y + 1, int(map.channels.size()));
        Image& image = map.image;
        const std::size_t row = image.row_size();
        std::vector<float> line(row);
        for (int y = 0; y < image.height; ++y) {
            // The slices point at where column 0 and line 0 would be: moved back by the data window's origin.
            float* origin = line.data() - std::ptrdiff_t(map.channels.size()) * window.min.x;
            Imf::FrameBuffer buffer;
            for (std::size_t c = 0; c < map.channels.size(); ++c)
                buffer.insert(map.channels[c], Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(origin + c),
                                                          sizeof(float) * map.channels.size(), 0));
            file.setFrameBuffer(buffer);
            file.readPixels(window.min.y + y);
            std::ranges::copy(line, &image.pixels[row * std::size_t(image.height - 1 - y)]);
        }
        return map;
    } catch (const std::exception& error) {
        throw ImageError(path, std::string("cannot be read: ") + error.what());
    }
}

}  // namespace sanguine
