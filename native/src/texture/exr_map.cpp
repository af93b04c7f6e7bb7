#include "sanguine/exr_map.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <set>

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStdIO.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/openexr.h>
#include <half.h>

#include "atomic_file.hpp"
#include "open_image.hpp"

namespace sanguine {
namespace {

namespace fs = std::filesystem;

/// OpenEXR's C reader, which parses the header alone and holds every size in it against the size of the file.
/// The C++ reader used for the pixels takes memory for what the header promises before it looks.
class HeaderReader {
public:
    explicit HeaderReader(const fs::path& path) : path_(path) {
        check_is_file(path);
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

[[noreturn]] void refuse(const std::string& what) { throw std::invalid_argument("write_exr_map: " + what); }

void check_layout(int width, int height, std::span<const std::string> channels) {
    if (width < 1 || height < 1 || width > max_image_side || height > max_image_side)
        refuse("the image is " + std::to_string(width) + " x " + std::to_string(height) + "; 1 to " +
               std::to_string(max_image_side) + " are allowed");
    if (channels.empty() || channels.size() > max_image_channels)
        refuse("there are " + std::to_string(channels.size()) + " channels; 1 to " +
               std::to_string(max_image_channels) + " are allowed");
    if (std::set<std::string>(channels.begin(), channels.end()).size() != channels.size())
        refuse("a channel name is used twice");
    if (std::ranges::any_of(channels, [](const std::string& name) { return name.empty() || name.size() > 255; }))
        refuse("a channel name is empty or longer than 255 bytes");
}

void check_values(std::span<const float> values, std::span<const std::string> channels, bool half) {
    const float limit = half ? float(HALF_MAX) : std::numeric_limits<float>::max();
    const auto unfit = std::ranges::find_if(values, [limit](float value) {
        return !(std::abs(value) <= limit);  // so written, NaN fails as well
    });
    if (unfit == values.end()) return;
    const auto i = std::size_t(unfit - values.begin());
    refuse("channel '" + channels[i % channels.size()] + "' holds " + std::to_string(*unfit) +
           (half ? ", which half floats cannot" : ", which is not finite"));
}

Imf::Header make_header(int width, int height, std::span<const std::string> channels, const ExrAttributes& attributes,
                        bool half, RowOrder order) {
    Imf::Header header(width, height);
    header.compression() = Imf::ZIP_COMPRESSION;
    header.lineOrder() = order == RowOrder::from_top ? Imf::INCREASING_Y : Imf::DECREASING_Y;
    for (const std::string& name : channels) header.channels().insert(name, Imf::Channel(half ? Imf::HALF : Imf::FLOAT));
    for (const auto& [name, value] : attributes) header.insert(name, Imf::StringAttribute(value));
    return header;
}

ExrMapInfo info_of(const Imf::Header& header) {
    ExrMapInfo info;
    for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel)
        info.channels.push_back(valid_utf8(channel.name()));
    for (auto attribute = header.begin(); attribute != header.end(); ++attribute)
        if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&attribute.attribute()))
            info.attributes.emplace(valid_utf8(attribute.name()), valid_utf8(text->value()));
    const Imath::Box2i window = header.dataWindow();
    info.width = window.max.x - window.min.x + 1;
    info.height = window.max.y - window.min.y + 1;
    return info;
}

}  // namespace

class MapWriter::Impl {
public:
    Impl(const fs::path& path, int width, int height, std::span<const std::string> channels,
         const ExrAttributes& attributes, bool as_half, RowOrder order)
        : path_(path),
          width_(width),
          height_(height),
          channels_(channels.begin(), channels.end()),
          half_(as_half),
          order_(order),
          file_(path) {
        check_layout(width, height, channels);
        // A stream of our own: OpenEXR's says nothing of what fails when it is closed.
        bytes_.open(file_.temporary(), std::ios::binary);
        if (!bytes_) throw ImageError(path, std::string("cannot be written: ") + std::strerror(errno));
        guarded([&] {
            stream_ = std::make_unique<Imf::StdOFStream>(bytes_, file_.temporary().c_str());
            output_ = std::make_unique<Imf::OutputFile>(
                *stream_, make_header(width, height, channels, attributes, as_half, order), 0);
        });
    }
    ~Impl() {
        // OpenEXR completes the file in its destructors; by then nobody wants it.
        output_.reset();
        stream_.reset();
    }

    int rows_left() const { return height_ - written_; }

    void write_rows(std::span<const float> rows) {
        if (!output_) refuse("nothing can be written after a commit or an error");
        const std::size_t row = std::size_t(width_) * channels_.size();
        const int count = int(std::min(rows.size() / row, std::size_t(max_image_side) + 1));
        if (rows.size() % row != 0 || count > rows_left())
            abandon([&] {
                refuse(path_.string() + ": " + std::to_string(rows.size()) + " values are not 1 to " +
                       std::to_string(rows_left()) + " rows of " + std::to_string(row));
            });
        abandon([&] { check_values(rows, channels_, half_); });
        // Few at a time, so that the copy in the file's type stays small: whole blocks of OpenEXR's ZIP compression.
        constexpr int chunk = 64;
        for (int done = 0; done < count; done += chunk) {
            const int some = std::min(chunk, count - done);
            const int lowest = order_ == RowOrder::from_bottom ? done : count - done - some;
            const auto part = rows.subspan(row * std::size_t(lowest), row * std::size_t(some));
            abandon([&] {
                guarded([&] {
                    if (half_)
                        write<::half>(part, some, Imf::HALF);
                    else
                        write<float>(part, some, Imf::FLOAT);
                });
            });
        }
    }

    void commit() {
        if (!output_) refuse("nothing can be committed after a commit or an error");
        if (rows_left() > 0)
            abandon([&] {
                refuse(path_.string() + ": " + std::to_string(rows_left()) + " of " + std::to_string(height_) +
                       " rows are missing");
            });
        output_.reset();
        stream_.reset();
        bytes_.close();
        if (!bytes_) throw ImageError(path_, "cannot be written: the disk may be full");
        file_.commit();
    }

private:
    /// What goes wrong in `work` ends the writing.
    template <typename Work> void abandon(Work work) {
        try {
            work();
        } catch (...) {
            output_.reset();
            throw;
        }
    }

    /// OpenEXR's errors name the temporary file: they are told of the one that was asked for.
    template <typename Work> void guarded(Work work) {
        try {
            work();
        } catch (const std::exception& error) {
            throw ImageError(path_, std::string("cannot be written: ") + error.what());
        }
    }

    template <typename Value> void write(std::span<const float> rows, int count, Imf::PixelType type) {
        const std::size_t row = std::size_t(width_) * channels_.size();
        // In the file's order, the top row first; it stays alive until they are written.
        std::vector<Value> flipped(rows.size());
        for (int y = 0; y < count; ++y)
            std::transform(rows.begin() + std::ptrdiff_t(row) * y, rows.begin() + std::ptrdiff_t(row) * (y + 1),
                           flipped.begin() + std::ptrdiff_t(row) * (count - 1 - y),
                           [](float value) { return Value(value); });
        const int top = order_ == RowOrder::from_top ? written_ : height_ - written_ - count;
        // The slices point at where line 0 would be.
        Value* line0 = flipped.data() - std::ptrdiff_t(row) * top;
        const std::size_t x_stride = sizeof(Value) * channels_.size();
        Imf::FrameBuffer buffer;
        for (std::size_t i = 0; i < channels_.size(); ++i)
            buffer.insert(channels_[i], Imf::Slice(type, reinterpret_cast<char*>(line0 + i), x_stride,
                                                   x_stride * std::size_t(width_)));
        output_->setFrameBuffer(buffer);
        output_->writePixels(count);
        written_ += count;
    }

    fs::path path_;
    int width_, height_;
    std::vector<std::string> channels_;
    bool half_;
    RowOrder order_;
    AtomicFile file_;
    std::ofstream bytes_;
    std::unique_ptr<Imf::StdOFStream> stream_;
    std::unique_ptr<Imf::OutputFile> output_;
    int written_ = 0;
};

MapWriter::MapWriter(const fs::path& path, int width, int height, std::span<const std::string> channels,
                     const ExrAttributes& attributes, bool as_half, RowOrder order)
    : impl_(std::make_unique<Impl>(path, width, height, channels, attributes, as_half, order)) {}
MapWriter::~MapWriter() = default;
MapWriter::MapWriter(MapWriter&&) noexcept = default;
MapWriter& MapWriter::operator=(MapWriter&&) noexcept = default;

int MapWriter::rows_left() const { return impl_->rows_left(); }
void MapWriter::write_rows(std::span<const float> rows) { impl_->write_rows(rows); }
void MapWriter::commit() { impl_->commit(); }

void write_exr_map(const fs::path& path, const ImageView& image, std::span<const std::string> channels,
                   const ExrAttributes& attributes, bool half) {
    if (channels.size() != std::size_t(image.channels))
        refuse(std::to_string(channels.size()) + " names for " + std::to_string(image.channels) + " channels (1 to " +
               std::to_string(max_image_channels) + ")");
    check_layout(image.width, image.height, channels);
    check_values(image.pixels, channels, half);
    MapWriter writer(path, image.width, image.height, channels, attributes, half, RowOrder::from_top);
    writer.write_rows(image.pixels);
    writer.commit();
}

ExrMapInfo read_exr_map_info(const fs::path& path) {
    HeaderReader(path).validate();
    try {
        return info_of(Imf::InputFile(path.c_str()).header());
    } catch (const std::exception& error) {
        throw ImageError(path, std::string("cannot be read: ") + error.what());
    }
}

ExrMap read_exr_map(const fs::path& path) {
    HeaderReader(path).validate();
    try {
        Imf::InputFile file(path.c_str());
        ExrMapInfo info = info_of(file.header());
        const Imath::Box2i window = file.header().dataWindow();
        ExrMap map{{}, std::move(info.channels), std::move(info.attributes)};
        if (std::size_t(info.width) * std::size_t(info.height) * map.channels.size() > max_image_values)
            throw std::runtime_error("more than " + std::to_string(max_image_values) +
                                     " values are not read at once");
        map.image = Image(info.width, info.height, int(map.channels.size()));
        Image& image = map.image;
        const std::size_t row = image.row_size();
        std::vector<float> line(row);
        for (int y = 0; y < image.height; ++y) {
            // The slices point at where column 0 and line 0 would be: moved back by the data window's origin.
            float* origin = line.data() - std::ptrdiff_t(map.channels.size()) * window.min.x;
            Imf::FrameBuffer buffer;
            std::size_t c = 0;
            for (auto channel = file.header().channels().begin(); channel != file.header().channels().end(); ++channel)
                buffer.insert(channel.name(), Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(origin + c++),
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
