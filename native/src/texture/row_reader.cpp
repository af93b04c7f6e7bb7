#include "sanguine/row_reader.hpp"

#include <algorithm>
#include <stdexcept>

#include "open_image.hpp"
#include "sanguine/image.hpp"

namespace sanguine {
namespace {

namespace fs = std::filesystem;

/// Rows in the order of the file: 0 is the top.
struct FileRows {
    int begin = 0;
    int end = 0;
};

}  // namespace

class RowReader::Impl {
public:
    explicit Impl(const fs::path& path) : path_(path), input_(open_checked(path)), spec_(input_->spec()) {
        for (const std::string& name : spec_.channelnames) channels.push_back(valid_utf8(name));
        channels.resize(std::size_t(spec_.nchannels));  // whatever the file says, one per channel
        pixel_type = spec_.format.c_str();
        const std::string format = input_->format_name();
        seeks_ = format == "openexr" || format == "tiff";
    }

    int width() const { return spec_.width; }
    int height() const { return spec_.height; }
    int alpha_channel() const { return spec_.alpha_channel; }

    void read_rows(int first, int count, std::span<float> out) {
        if (first < 0 || count < 1 || count > height() - first)
            throw std::invalid_argument("read_rows: " + path_.string() + " has rows 0 to " +
                                        std::to_string(height() - 1) + ", not " + std::to_string(count) + " from " +
                                        std::to_string(first));
        const std::size_t row = row_size();
        if (out.size() != row * std::size_t(count))
            throw std::invalid_argument("read_rows: the rows do not fit into what is to hold them");
        const FileRows wanted{height() - first - count, height() - first};
        fetch(wanted);
        for (int y = wanted.begin; y < wanted.end; ++y)
            std::copy_n(kept_.begin() + std::ptrdiff_t(row) * (y - kept_rows_.begin), row,
                        out.begin() + std::ptrdiff_t(row) * (wanted.end - 1 - y));
    }

    std::vector<std::string> channels;
    std::string pixel_type;

private:
    std::size_t row_size() const { return std::size_t(spec_.width) * std::size_t(spec_.nchannels); }

    /// Makes `kept_` hold the wanted rows, in whole tiles.
    void fetch(FileRows wanted) {
        if (spec_.tile_height > 0) {
            wanted.begin -= wanted.begin % spec_.tile_height;
            const int past = (wanted.end - 1) / spec_.tile_height + 1;
            wanted.end = past > height() / spec_.tile_height ? height() : past * spec_.tile_height;
        }
        const FileRows overlap{std::max(wanted.begin, kept_rows_.begin), std::min(wanted.end, kept_rows_.end)};
        std::vector<float> rows(row_size() * std::size_t(wanted.end - wanted.begin));
        const auto place = [&](int y) { return rows.data() + row_size() * std::size_t(y - wanted.begin); };
        if (overlap.begin < overlap.end) {
            std::copy_n(kept_.begin() + std::ptrdiff_t(row_size()) * (overlap.begin - kept_rows_.begin),
                        row_size() * std::size_t(overlap.end - overlap.begin), place(overlap.begin));
            read({wanted.begin, overlap.begin}, place(wanted.begin));
            read({overlap.end, wanted.end}, rows.data() + row_size() * std::size_t(overlap.end - wanted.begin));
        } else {
            read(wanted, rows.data());
        }
        kept_ = std::move(rows);
        kept_rows_ = wanted;
    }

    void read(FileRows rows, float* into) {
        if (rows.begin >= rows.end) return;
        if (!seeks_ && rows.begin < next_row_) {
            // OpenImageIO would go back to the start by itself, but some formats forget how alpha was asked for.
            input_ = open_checked(path_);
            const OIIO::ImageSpec& now = input_->spec();
            if (now.width != spec_.width || now.height != spec_.height || now.nchannels != spec_.nchannels)
                throw ImageError(path_, "has changed while it was read");
        }
        next_row_ = rows.end;
        const int x = spec_.x, y = spec_.y;
        const bool done =
            spec_.tile_height > 0
                ? input_->read_tiles(0, 0, x, x + spec_.width, y + rows.begin, y + rows.end, spec_.z, spec_.z + 1, 0,
                                     spec_.nchannels, OIIO::TypeFloat, into)
                : input_->read_scanlines(0, 0, y + rows.begin, y + rows.end, spec_.z, 0, spec_.nchannels,
                                         OIIO::TypeFloat, into);
        check_read(done, *input_, path_);
    }

    fs::path path_;
    std::unique_ptr<OIIO::ImageInput> input_;
    OIIO::ImageSpec spec_;  // a copy: that of the input changes with what it reads
    bool seeks_;
    int next_row_ = 0;  // where the decoder stands
    std::vector<float> kept_;
    FileRows kept_rows_;
};

RowReader::RowReader(const fs::path& path) : impl_(std::make_unique<Impl>(path)) {}
RowReader::~RowReader() = default;
RowReader::RowReader(RowReader&&) noexcept = default;
RowReader& RowReader::operator=(RowReader&&) noexcept = default;

int RowReader::width() const { return impl_->width(); }
int RowReader::height() const { return impl_->height(); }
const std::vector<std::string>& RowReader::channels() const { return impl_->channels; }
const std::string& RowReader::pixel_type() const { return impl_->pixel_type; }
int RowReader::alpha_channel() const { return impl_->alpha_channel(); }
void RowReader::read_rows(int first, int count, std::span<float> out) { impl_->read_rows(first, count, out); }

}  // namespace sanguine
