// Chromophore maps: what is written is read, and what is broken is refused in one line that names the file.
#include "sanguine/exr_map.hpp"

#include <fstream>
#include <iterator>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace sanguine {
namespace {

namespace fs = std::filesystem;

class ExrMaps : public testing::Test {
protected:
    void SetUp() override {
        folder_ = fs::path(testing::TempDir()) / ("sanguine-exr-" + std::to_string(std::random_device{}()));
        fs::create_directories(folder_);
        for (std::size_t i = 0; i < pixels_.size(); ++i) pixels_[i] = float(i % 97) / 97;
    }
    void TearDown() override { fs::remove_all(folder_); }

    void write(const fs::path& path, bool half = false) const {
        write_exr_map(path, {19, 11, 3, pixels_}, names_, {{"sanguine:units", "fraction"}}, half);
    }
    std::string read_error(const fs::path& path) const {
        try {
            read_exr_map(path);
        } catch (const ImageError& error) {
            return error.what();
        }
        return {};
    }
    void expect_one_line_naming(const fs::path& path) const {
        const std::string message = read_error(path);
        EXPECT_NE(message.find(path.string()), std::string::npos) << message;
        EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    }

    fs::path folder_;
    std::vector<float> pixels_ = std::vector<float>(19 * 11 * 3);
    const std::vector<std::string> names_ = {"hemoglobin", "melanin", "oil"};  // already alphabetical
};

TEST_F(ExrMaps, FloatIsKeptToTheBit) {
    write(folder_ / "a.exr");
    const ExrMap map = read_exr_map(folder_ / "a.exr");
    EXPECT_EQ(map.channels, names_);
    EXPECT_EQ(map.attributes.at("sanguine:units"), "fraction");
    ASSERT_EQ(map.image.size(), pixels_.size());
    for (std::size_t i = 0; i < pixels_.size(); ++i) EXPECT_EQ(map.image.pixels[i], pixels_[i]);
}

TEST_F(ExrMaps, HalfIsKeptToItsPrecision) {
    write(folder_ / "a.exr", true);
    const ExrMap map = read_exr_map(folder_ / "a.exr");
    for (std::size_t i = 0; i < pixels_.size(); ++i) EXPECT_NEAR(map.image.pixels[i], pixels_[i], 0x1p-11);
}

TEST_F(ExrMaps, ChannelsAreSortedTogetherWithTheirPixels) {
    const std::vector<float> pixels = {1, 2};
    const std::vector<std::string> names = {"oil", "melanin"};
    write_exr_map(folder_ / "a.exr", {1, 1, 2, pixels}, names, {}, true);
    const ExrMap map = read_exr_map(folder_ / "a.exr");
    EXPECT_EQ(map.channels, (std::vector<std::string>{"melanin", "oil"}));
    EXPECT_EQ(map.image.pixels[0], 2);
    EXPECT_EQ(map.image.pixels[1], 1);
}

TEST_F(ExrMaps, RefusesToWriteWhatTheFileCannotHold) {
    const auto write_one = [&](float value, bool half) {
        const std::vector<float> pixels = {value};
        write_exr_map(folder_ / "a.exr", {1, 1, 1, pixels}, std::vector<std::string>{"melanin"}, {}, half);
    };
    EXPECT_THROW(write_one(std::numeric_limits<float>::quiet_NaN(), false), std::invalid_argument);
    EXPECT_THROW(write_one(std::numeric_limits<float>::infinity(), false), std::invalid_argument);
    EXPECT_THROW(write_one(1e6F, true), std::invalid_argument);
    EXPECT_NO_THROW(write_one(1e6F, false));
    const std::vector<std::string> twice = {"a", "a", "b"};
    EXPECT_THROW(write_exr_map(folder_ / "a.exr", {19, 11, 3, pixels_}, twice, {}, true), std::invalid_argument);
}

TEST_F(ExrMaps, BandsFromEitherEndMakeTheSamePicture) {
    for (const RowOrder order : {RowOrder::from_bottom, RowOrder::from_top})
        for (const int rows : {1, 4, 11}) {
            MapWriter writer(folder_ / "a.exr", 19, 11, names_, {{"sanguine:units", "fraction"}}, false, order);
            const std::size_t row = 19 * 3;
            for (int done = 0; done < 11; done += rows) {
                const int some = std::min(rows, 11 - done);
                const int first = order == RowOrder::from_bottom ? done : 11 - done - some;
                EXPECT_EQ(writer.rows_left(), 11 - done);
                writer.write_rows({&pixels_[row * std::size_t(first)], row * std::size_t(some)});
            }
            EXPECT_FALSE(fs::exists(folder_ / "a.exr"));
            writer.commit();
            const ExrMap map = read_exr_map(folder_ / "a.exr");
            EXPECT_EQ(map.channels, names_);
            EXPECT_EQ(map.attributes.at("sanguine:units"), "fraction");
            for (std::size_t i = 0; i < pixels_.size(); ++i) ASSERT_EQ(map.image.pixels[i], pixels_[i]) << rows;
            fs::remove(folder_ / "a.exr");
        }
}

TEST_F(ExrMaps, MoreRowsThanOneBlockAreKept) {
    // 200 rows are written 64 at a time, in blocks of 16.
    std::vector<float> pixels(3 * 200);
    for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = float(i);
    const std::vector<std::string> name = {"melanin"};
    for (const RowOrder order : {RowOrder::from_bottom, RowOrder::from_top}) {
        MapWriter writer(folder_ / "a.exr", 3, 200, name, {}, true, order);
        writer.write_rows(pixels);
        writer.commit();
        const ExrMap map = read_exr_map(folder_ / "a.exr");
        for (std::size_t i = 0; i < pixels.size(); ++i) ASSERT_EQ(map.image.pixels[i], pixels[i]) << i;
    }
}

TEST_F(ExrMaps, AnUnfinishedMapLeavesNothing) {
    const std::vector<float> row(19 * 3, 0.5F), bad(19 * 3, std::numeric_limits<float>::quiet_NaN());
    const auto start = [&] {
        return MapWriter(folder_ / "a.exr", 19, 11, names_, {}, true, RowOrder::from_bottom);
    };
    {
        MapWriter writer = start();
        writer.write_rows(row);
        EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 1);  // the temporary one
    }
    {
        MapWriter writer = start();
        EXPECT_THROW(writer.commit(), std::invalid_argument);
        EXPECT_THROW(writer.write_rows(row), std::invalid_argument);
    }
    {
        MapWriter writer = start();
        EXPECT_THROW(writer.write_rows(bad), std::invalid_argument);
        EXPECT_THROW(writer.commit(), std::invalid_argument);
    }
    {
        MapWriter writer = start();
        EXPECT_THROW(writer.write_rows({row.data(), row.size() - 1}), std::invalid_argument);
    }
    {
        MapWriter writer = start();
        EXPECT_THROW(writer.write_rows(std::vector<float>(19 * 3 * 12)), std::invalid_argument);
    }
    EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(ExrMaps, TheHeaderCanBeReadAlone) {
    write(folder_ / "a.exr");
    const ExrMapInfo info = read_exr_map_info(folder_ / "a.exr");
    EXPECT_EQ(info.width, 19);
    EXPECT_EQ(info.height, 11);
    EXPECT_EQ(info.channels, names_);
    EXPECT_EQ(info.attributes.at("sanguine:units"), "fraction");
    EXPECT_THROW(read_exr_map_info(folder_ / "absent.exr"), ImageError);
}

TEST_F(ExrMaps, LeavesNothingBehindWhenItFails) {
    EXPECT_THROW(write(folder_ / "no such folder" / "a.exr"), ImageError);
    fs::create_directory(folder_ / "taken.exr");
    std::ofstream(folder_ / "taken.exr" / "file") << "x";
    EXPECT_THROW(write(folder_ / "taken.exr"), ImageError);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 1);
}

TEST_F(ExrMaps, EveryTruncationIsRefused) {
    const fs::path whole = folder_ / "whole.exr", cut = folder_ / "cut.exr";
    write(whole);
    const auto size = fs::file_size(whole);
    for (std::uintmax_t keep = 0; keep < size; keep += 1 + size / 60) {
        fs::copy_file(whole, cut, fs::copy_options::overwrite_existing);
        fs::resize_file(cut, keep);
        expect_one_line_naming(cut);
    }
}

TEST_F(ExrMaps, DamageIsRefusedOrHarmless) {
    // Any single byte of the header changed: an answer or an ImageError, never a crash or a huge allocation.
    const fs::path whole = folder_ / "whole.exr", damaged = folder_ / "damaged.exr";
    write(whole);
    std::ifstream stream(whole, std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(stream)), {});
    for (std::size_t i = 0; i < std::min<std::size_t>(bytes.size(), 600); ++i) {
        std::string changed = bytes;
        changed[i] = char(~changed[i]);
        std::ofstream(damaged, std::ios::binary) << changed;
        const std::string message = read_error(damaged);
        EXPECT_TRUE(message.empty() || message.find(damaged.string()) != std::string::npos) << message;
    }
}

TEST_F(ExrMaps, TextsOfAFileAreMadeUtf8) {
    // Who reads them in Python would fail on other bytes; the pixels of such a channel arrive all the same.
    const std::vector<std::pair<std::string, std::string>> cases = {
        {"caf\xc3\xa9 \xf0\x9f\x99\x82", "caf\xc3\xa9 \xf0\x9f\x99\x82"},
        {"a\xff" "b", "a?b"},
        {"cut \xe2\x82", "cut ??"},
        {"long \xc0\xaf", "long ??"},
        {"half \xed\xa0\x80", "half ???"},
        {"far \xf4\x90\x80\x80", "far ????"},
    };
    const std::vector<float> pixel = {0.5F};
    for (const auto& [in_file, expected] : cases) {
        write_exr_map(folder_ / "a.exr", {1, 1, 1, pixel}, std::vector{in_file}, {{"note", in_file}}, true);
        const ExrMap map = read_exr_map(folder_ / "a.exr");
        EXPECT_EQ(map.channels.at(0), expected);
        EXPECT_EQ(map.attributes.at("note"), expected);
        EXPECT_EQ(map.image.pixels[0], 0.5F);
        EXPECT_EQ(std::string(ImageError("a.exr", in_file).what()), "a.exr: " + expected);
    }
}

TEST_F(ExrMaps, OtherFilesAreRefused) {
    expect_one_line_naming(folder_ / "absent.exr");
    expect_one_line_naming(folder_);
    std::ofstream(folder_ / "text.exr") << "This is no picture.";
    expect_one_line_naming(folder_ / "text.exr");
}

}  // namespace
}  // namespace sanguine
