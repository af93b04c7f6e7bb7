// Files from anywhere: every reader gives an answer or one line that names the file, and takes no memory for what a
// header merely promises. `make test` runs this under the address sanitizer as well.
#include <sys/resource.h>
#include <sys/stat.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <limits>
#include <random>

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDeepFrameBuffer.h>
#include <OpenEXR/ImfDeepScanLineOutputFile.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfPartType.h>
#include <gtest/gtest.h>

#include "effort.hpp"
#include "sanguine/exr_map.hpp"
#include "sanguine/image.hpp"
#include "sanguine/row_reader.hpp"
#include "sanguine/texture_file.hpp"

namespace sanguine {
namespace {

namespace fs = std::filesystem;

std::string bytes_of(const fs::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

/// Integers of a header, low byte first.
template <typename Integer> std::string little(Integer value) {
    std::string bytes(sizeof value, '\0');
    std::memcpy(bytes.data(), &value, sizeof value);
    return bytes;
}
std::string big(std::uint32_t value) {
    std::string bytes = little(value);
    std::ranges::reverse(bytes);
    return bytes;
}

void read_whole(const fs::path& path) { read_image(path); }
void read_map(const fs::path& path) { read_exr_map(path); }
void read_map_info(const fs::path& path) { read_exr_map_info(path); }
void read_texture(const fs::path& path) { texture_info(path); }
void read_bands(const fs::path& path) {
    RowReader reader(path);
    const int rows = std::min(8, reader.height());
    std::vector<float> band(std::size_t(reader.width()) * std::size_t(rows) * reader.channels().size());
    reader.read_rows(reader.height() - rows, rows, band);
    reader.read_rows(0, rows, band);
}
constexpr std::array readers = {read_whole, read_map, read_map_info, read_texture, read_bands};

class BrokenImages : public testing::Test {
protected:
    void SetUp() override {
        folder_ = fs::path(testing::TempDir()) / ("sanguine-broken-" + std::to_string(std::random_device{}()));
        fs::create_directories(folder_);
    }
    void TearDown() override { fs::remove_all(folder_); }

    fs::path file(const std::string& name, const std::string& bytes) const {
        std::ofstream(folder_ / name, std::ios::binary) << bytes;
        return folder_ / name;
    }

    /// True if it was read; an error has to be an ImageError of one line that names the file.
    static bool reads(const std::function<void(const fs::path&)>& reader, const fs::path& path) {
        try {
            reader(path);
            return true;
        } catch (const ImageError& error) {
            const std::string message = error.what();
            EXPECT_TRUE(message.starts_with(path.string() + ": ")) << message;
            EXPECT_GT(message.size(), path.string().size() + 4) << "nothing is said: " << message;
            EXPECT_LT(message.size(), path.string().size() + 600) << message;
            EXPECT_TRUE(std::ranges::none_of(message, [](char c) { return c == '\n' || c == '\r' || c == '\0'; }));
        } catch (const std::exception& error) {
            ADD_FAILURE() << path << ": not an ImageError: " << error.what();
        }
        return false;
    }
    static void expect_refused_by_all(const fs::path& path) {
        for (const auto& reader : readers) EXPECT_FALSE(reads(reader, path)) << path;
    }

    /// One picture of each kind that the readers meet.
    std::vector<fs::path> corpus() const {
        std::mt19937 random(5);
        const auto noise = [&](int channels) {
            std::vector<float> pixels(std::size_t(33 * 70 * channels));
            for (float& value : pixels) value = float(random() % 65536) / 65535;
            return pixels;
        };
        std::vector<fs::path> paths;
        const auto add = [&](const char* name, int channels, PixelType type) {
            const std::vector<float> pixels = noise(channels);
            write_image(folder_ / name, {33, 70, channels, pixels}, type);
            paths.push_back(folder_ / name);
        };
        add("rgb.png", 3, PixelType::uint8);
        add("rgba16.png", 4, PixelType::uint16);
        add("grey_alpha.png", 2, PixelType::uint8);
        add("rgb.jpg", 3, PixelType::uint8);
        add("grey.exr", 1, PixelType::half);
        add("many.exr", 64, PixelType::float32);
        add("rgb16.tif", 3, PixelType::uint16);
        add("float.tif", 4, PixelType::float32);
        make_tx(folder_ / "grey.exr", folder_ / "tiled_exr.tx");
        make_tx(folder_ / "rgb16.tif", folder_ / "tiled_tif.tx");
        paths.push_back(folder_ / "tiled_exr.tx");
        paths.push_back(folder_ / "tiled_tif.tx");
        paths.push_back(file("animated.gif", animated_gif()));
        paths.push_back(file("grey.pgm", "P5\n3 2\n255\nabcdef"));
        return paths;
    }

    /// Two frames of 2 x 2 with a palette of two colours.
    static std::string animated_gif() {
        const std::string palette("\xff\x00\x00\x00\x00\xff", 6);
        std::string gif = "GIF89a" + little<std::uint16_t>(2) + little<std::uint16_t>(2) + std::string("\x80\x00\x00", 3) +
                          palette + std::string("\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00", 19);
        for (int frame = 0; frame < 2; ++frame)
            gif += std::string("\x21\xf9\x04\x00\x0a\x00\x00\x00", 8) + std::string("\x2c\x00\x00\x00\x00", 5) +
                   little<std::uint16_t>(2) + little<std::uint16_t>(2) + std::string("\x00\x02\x03\x44\x02\x05\x00", 7);
        return gif + ";";
    }

    fs::path folder_;
};

/// The start of an EXR: magic, version and flags, then attributes as they come.
struct ExrHeader {
    std::string bytes = little<std::uint32_t>(20000630) + little<std::uint32_t>(2);
    ExrHeader& attribute(const std::string& name, const std::string& type, const std::string& value) {
        bytes += name + '\0' + type + '\0' + little(std::int32_t(value.size())) + value;
        return *this;
    }
    ExrHeader& standard(int last_x, int last_y, const std::string& channels) {
        const std::string box = little(std::int32_t(0)) + little(std::int32_t(0)) + little(last_x) + little(last_y);
        const std::string one = little(std::bit_cast<std::uint32_t>(1.0F));
        attribute("channels", "chlist", channels + '\0');
        attribute("compression", "compression", std::string(1, '\3'));
        attribute("dataWindow", "box2i", box).attribute("displayWindow", "box2i", box);
        attribute("lineOrder", "lineOrder", std::string(1, '\0')).attribute("pixelAspectRatio", "float", one);
        attribute("screenWindowCenter", "v2f", std::string(8, '\0')).attribute("screenWindowWidth", "float", one);
        bytes += '\0';
        return *this;
    }
    static std::string channel(const std::string& name) {
        return name + '\0' + little(std::int32_t(1)) + std::string(4, '\0') + little(std::int32_t(1)) +
               little(std::int32_t(1));
    }
};

TEST_F(BrokenImages, WholeOnesAreRead) {
    for (const fs::path& path : corpus()) {
        EXPECT_TRUE(reads(read_whole, path)) << path;
        EXPECT_TRUE(reads(read_bands, path)) << path;
        EXPECT_TRUE(reads(read_texture, path)) << path;
        EXPECT_EQ(reads(read_map, path), path.extension() == ".exr") << path;
    }
}

TEST_F(BrokenImages, EveryTruncationIsAnswered) {
    std::size_t refused = 0;
    for (const fs::path& path : corpus()) {
        const std::string whole = bytes_of(path);
        std::size_t last = whole.size();
        for (std::size_t step = 0; step < 40; ++step) {
            // Half of the cuts in the first bytes, where the header is.
            const std::size_t keep = step % 2 ? whole.size() * step / 40 : std::min(whole.size(), step * 12);
            if (keep == last) continue;
            last = keep;
            const fs::path cut = file("cut" + path.extension().string(), whole.substr(0, keep));
            for (const auto& reader : readers) refused += !reads(reader, cut);
        }
    }
    EXPECT_GT(refused, 1000U);
}

TEST_F(BrokenImages, RowsThatAreNotThereAreNotMadeUp) {
    // Whichever part is cut off: libjpeg, for one, fills up with grey and says so in a remark only.
    for (const fs::path& path : corpus()) {
        if (path.extension() == ".tx" || path.extension() == ".gif") continue;  // levels and frames that nobody asked for
        const std::string whole = bytes_of(path);
        for (const std::size_t percent : {10, 50, 80, 95}) {
            const fs::path cut = file("cut" + path.extension().string(), whole.substr(0, whole.size() * percent / 100));
            EXPECT_FALSE(reads(read_whole, cut)) << path << percent;
            EXPECT_FALSE(reads(read_bands, cut)) << path << percent;
            EXPECT_FALSE(reads([&](const fs::path& from) { contact_sheet(std::vector{from}, {}, folder_ / "sheet.png", {}); }, cut));
            try {
                make_tx(cut, folder_ / "cut.tx");
                ADD_FAILURE() << path << percent;
            } catch (const ImageError&) {
            }
        }
    }
}

TEST_F(BrokenImages, EveryDamageIsAnswered) {
    std::mt19937 random(11);
    for (const fs::path& path : corpus()) {
        const std::string whole = bytes_of(path);
        for (std::size_t step = 0; step < 220; step += sweep_stride) {
            std::string changed = whole;
            const std::size_t range = step % 3 ? std::min<std::size_t>(whole.size(), 500) : whole.size();
            for (std::size_t k = 0; k <= random() % 3; ++k)
                changed[random() % range] = step % 2 ? char(random() % 256) : char(changed[0] ^ (1 << (random() % 8)));
            const fs::path damaged = file("damaged" + path.extension().string(), changed);
            for (const auto& reader : readers) reads(reader, damaged);
        }
    }
}

TEST_F(BrokenImages, NothingAndSomethingElseAreRefused) {
    for (const char* name : {"a.exr", "a.png", "a.jpg", "a.tif", "a.gif", "a.tx", "a.bmp", "a.hdr", "a.psd", "a.webp"}) {
        expect_refused_by_all(file(name, ""));
        expect_refused_by_all(file(name, "This is no picture, whatever its name may say."));
        expect_refused_by_all(file(name, std::string(4096, '\0')));
        expect_refused_by_all(file(name, std::string(4096, '\xff')));
    }
    expect_refused_by_all(folder_);
    expect_refused_by_all(folder_ / "absent.exr");
    expect_refused_by_all(folder_ / "absent.null");  // OpenImageIO makes a picture up for these
    expect_refused_by_all(file("a.null", "x"));
    expect_refused_by_all("/dev/zero");
    ASSERT_EQ(mkfifo((folder_ / "pipe.exr").c_str(), 0600), 0);
    expect_refused_by_all(folder_ / "pipe.exr");  // and nobody waits for a writer
}

TEST_F(BrokenImages, AWrongMagicIsNoCrash) {
    // The content of one format under the name of another: an answer, since OpenImageIO looks inside, or a line.
    const std::vector<fs::path> paths = corpus();
    for (const fs::path& path : paths)
        for (const fs::path& other : paths)
            for (const auto& reader : readers)
                reads(reader, file("disguised" + other.extension().string(), bytes_of(path)));
}

TEST_F(BrokenImages, WhatAHeaderPromisesTakesNoMemory) {
    std::vector<fs::path> paths;
    const auto add = [&](const std::string& name, const std::string& bytes) {
        paths.push_back(file(std::to_string(paths.size()) + name, bytes));
    };
    const std::string filler(20000, '\0');
    const std::string one = ExrHeader::channel("Y");
    std::string many;
    for (int i = 0; i < 5000; ++i) many += ExrHeader::channel("c" + std::to_string(i));
    for (const int side : {16383, 16384, 1 << 24, std::numeric_limits<int>::max(), -5}) {
        add(".exr", ExrHeader().standard(side, side, one).bytes + filler);
        add(".exr", ExrHeader().standard(side, 1, one).bytes + filler);
    }
    add(".exr", ExrHeader().standard(9, 9, many).bytes + filler);
    add(".exr", ExrHeader().standard(9, 9, ExrHeader::channel(std::string(200000, 'n'))).bytes + filler);
    add(".exr", ExrHeader().standard(9, 9, "").bytes + filler);
    add(".exr", ExrHeader().attribute(std::string(100000, 'n'), "string", "x").standard(9, 9, one).bytes + filler);
    {
        ExrHeader long_text;  // a text of 2 GiB that is not there
        long_text.bytes += std::string("note\0string\0", 12) + little(std::numeric_limits<std::int32_t>::max());
        add(".exr", long_text.bytes + filler);
        ExrHeader negative;
        negative.bytes += std::string("note\0string\0", 12) + little(std::int32_t(-1));
        add(".exr", negative.bytes + filler);
    }
    for (const std::uint32_t side : {16384U, 65535U, 0x7fffffffU})
        for (const char interlaced : {'\0', '\1'}) {
            const std::string ihdr = "IHDR" + big(side) + big(side) + std::string("\x10\x06\x00\x00", 4) + interlaced;
            // The checksum is right, so that it is the size that is judged.
            std::uint32_t crc = 0xffffffffU;
            for (const char byte : ihdr) {
                crc ^= static_cast<unsigned char>(byte);
                for (int k = 0; k < 8; ++k) crc = crc & 1 ? crc >> 1 ^ 0xedb88320U : crc >> 1;
            }
            add(".png", "\x89PNG\r\n\x1a\n" + big(13) + ihdr + big(~crc) + filler);
        }
    for (const std::uint16_t side : {std::uint16_t(16384), std::uint16_t(65535)})
        add(".gif", "GIF89a" + little(side) + little(side) + std::string("\x80\x00\x00\xff\x00\x00\x00\x00\xff", 9) +
                        std::string("\x2c\x00\x00\x00\x00", 5) + little(side) + little(side) +
                        std::string("\x00\x02\x03\x44\x02\x05\x00;", 8));
    for (const std::uint32_t side : {16384U, 0x7fffffffU}) {
        const auto entry = [](std::uint16_t tag, std::uint32_t value) {
            return little(tag) + little(std::uint16_t(4)) + little(std::uint32_t(1)) + little(value);
        };
        std::string tiff = "II*" + std::string(1, '\0') + little(std::uint32_t(8)) + little(std::uint16_t(8)) +
                           entry(256, side) + entry(257, side) + entry(258, 16) + entry(259, 1) + entry(262, 1) +
                           entry(273, 200) + entry(278, side) + entry(279, 0xfffffff0U) + std::string(4, '\0');
        add(".tif", tiff + filler);
        add(".pfm", "PF\n" + std::to_string(side) + " " + std::to_string(side) + "\n-1.0\n" + filler);
        add(".ppm", "P6\n" + std::to_string(side) + " " + std::to_string(side) + "\n65535\n" + filler);
        add(".bmp", "BM" + little(std::uint32_t(30000)) + std::string(4, '\0') + little(std::uint32_t(54)) +
                        little(std::uint32_t(40)) + little(side) + little(side) + little(std::uint16_t(1)) +
                        little(std::uint16_t(32)) + std::string(24, '\0') + filler);
        add(".hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " + std::to_string(side) + " +X " + std::to_string(side) +
                        "\n" + filler);
    }
    const auto peak_mb = [] {
        rusage usage{};
        getrusage(RUSAGE_SELF, &usage);
        return usage.ru_maxrss / 1024;
    };
    reads(read_whole, paths[0]);  // whatever the libraries set up once
    for (const fs::path& path : paths)
        for (const auto& reader : readers) {
            const long before = peak_mb();
            reads(reader, path);
#ifndef __SANITIZE_ADDRESS__  // whose own books are larger than this
            // A decoder may take room for some rows before it finds that there are none.
            EXPECT_LT(peak_mb() - before, 300) << path;
#else
            (void)before;
#endif
        }
}

TEST_F(BrokenImages, OtherKindsOfExrAreAnswered) {
    const int w = 8, h = 8;
    const std::vector<float> pixels(std::size_t(w * h), 0.25F);
    Imf::FrameBuffer buffer;
    buffer.insert("Y", Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(pixels.data())), 4, 4 * w));
    {
        std::vector<Imf::Header> headers;
        for (const char* name : {"left", "right"}) {
            Imf::Header header(w, h);
            header.channels().insert("Y", Imf::Channel(Imf::FLOAT));
            header.setName(name);
            header.setType(Imf::SCANLINEIMAGE);
            headers.push_back(header);
        }
        Imf::MultiPartOutputFile file((folder_ / "parts.exr").c_str(), headers.data(), 2);
        for (int part = 0; part < 2; ++part) {
            Imf::OutputPart out(file, part);
            out.setFrameBuffer(buffer);
            out.writePixels(h);
        }
    }
    EXPECT_TRUE(reads(read_whole, folder_ / "parts.exr"));  // its first part
    EXPECT_TRUE(reads(read_bands, folder_ / "parts.exr"));
    EXPECT_FALSE(reads(read_map, folder_ / "parts.exr"));
    {
        Imf::Header header(w, h);
        header.channels().insert("Z", Imf::Channel(Imf::FLOAT));
        header.setType(Imf::DEEPSCANLINE);
        header.compression() = Imf::ZIPS_COMPRESSION;
        Imf::DeepScanLineOutputFile file((folder_ / "deep.exr").c_str(), header);
        std::vector<unsigned> counts(std::size_t(w * h), 1);
        std::vector<const float*> samples(std::size_t(w * h), pixels.data());
        Imf::DeepFrameBuffer deep;
        deep.insertSampleCountSlice(Imf::Slice(Imf::UINT, reinterpret_cast<char*>(counts.data()), 4, 4 * w));
        deep.insert("Z", Imf::DeepSlice(Imf::FLOAT, reinterpret_cast<char*>(samples.data()), sizeof(float*),
                                        sizeof(float*) * w, sizeof(float)));
        file.setFrameBuffer(deep);
        file.writePixels(h);
    }
    expect_refused_by_all(folder_ / "deep.exr");
    {
        Imf::Header header(w, h);
        header.channels().insert("Y", Imf::Channel(Imf::FLOAT));
        header.channels().insert("BY", Imf::Channel(Imf::FLOAT, 2, 2));
        Imf::FrameBuffer two = buffer;
        two.insert("BY", Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(pixels.data())), 4, 4 * w, 2, 2));
        Imf::OutputFile file((folder_ / "subsampled.exr").c_str(), header);
        file.setFrameBuffer(two);
        file.writePixels(h);
    }
    for (const auto& reader : readers) reads(reader, folder_ / "subsampled.exr");
    EXPECT_FALSE(reads(read_map, folder_ / "subsampled.exr"));
}

TEST_F(BrokenImages, ValuesThatAreNoNumbersArriveAsTheyAre) {
    // The readers hand them on; who works with them has to look (read_maps does).
    const std::vector<float> pixels = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                                       -std::numeric_limits<float>::infinity(), 1};
    for (const char* name : {"a.exr", "a.tif"}) {
        write_image(folder_ / name, {2, 2, 1, pixels}, PixelType::float32);
        const Image image = read_image(folder_ / name);
        EXPECT_TRUE(std::isnan(image.pixels[0])) << name;
        EXPECT_TRUE(std::isinf(image.pixels[1]) && std::isinf(image.pixels[2])) << name;
        EXPECT_TRUE(reads(read_bands, folder_ / name));
    }
}

}  // namespace
}  // namespace sanguine
