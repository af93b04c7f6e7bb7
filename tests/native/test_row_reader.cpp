// Rows of pictures against the same pictures read whole, in every order and format.
#include "sanguine/row_reader.hpp"

#include <fstream>
#include <random>

#include <gtest/gtest.h>

#include "sanguine/exr_map.hpp"
#include "sanguine/image.hpp"
#include "sanguine/texture_file.hpp"

namespace sanguine {
namespace {

namespace fs = std::filesystem;

constexpr int width = 21, height = 150;  // more than two rows of tiles

class Rows : public testing::Test {
protected:
    void SetUp() override {
        folder_ = fs::path(testing::TempDir()) / ("sanguine-rows-" + std::to_string(std::random_device{}()));
        fs::create_directories(folder_);
    }
    void TearDown() override { fs::remove_all(folder_); }

    fs::path picture(const std::string& name, int channels, PixelType type) const {
        std::vector<float> pixels(std::size_t(width * height * channels));
        for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = float((i * 7919) % 251) / 250;
        write_image(folder_ / name, {width, height, channels, pixels}, type);
        return folder_ / name;
    }
    fs::path tiled(const fs::path& source) const {
        fs::path path = source;
        path += ".tx";
        make_tx(source, path);
        return path;
    }

    /// Every band equals the rows of the whole picture.
    static void expect_same(const fs::path& path, const std::vector<std::pair<int, int>>& bands) {
        const Image whole = read_image(path);
        RowReader reader(path);
        ASSERT_EQ(reader.width(), whole.width);
        ASSERT_EQ(reader.height(), whole.height);
        ASSERT_EQ(reader.channels().size(), std::size_t(whole.channels));
        for (const auto& [first, count] : bands) {
            std::vector<float> rows(whole.row_size() * std::size_t(count), -1.0F);
            reader.read_rows(first, count, rows);
            const float* expected = whole.pixels.get() + whole.row_size() * std::size_t(first);
            for (std::size_t i = 0; i < rows.size(); ++i)
                ASSERT_EQ(rows[i], expected[i]) << path << " row " << first << " of " << count << " value " << i;
        }
    }

    fs::path folder_;
};

TEST_F(Rows, OfEveryFormatInEveryOrder) {
    const std::vector<fs::path> paths = {
        picture("a.png", 3, PixelType::uint8),   picture("b.png", 4, PixelType::uint16),
        picture("c.png", 2, PixelType::uint8),   picture("d.jpg", 3, PixelType::uint8),
        picture("e.exr", 1, PixelType::half),    picture("f.exr", 64, PixelType::float32),
        picture("g.tif", 4, PixelType::uint16),  picture("h.tif", 3, PixelType::float32),
        tiled(folder_ / "e.exr"),                tiled(folder_ / "g.tif"),
    };
    const std::vector<std::pair<int, int>> down = {{140, 10}, {120, 24}, {96, 30}, {0, 100}};
    const std::vector<std::pair<int, int>> up = {{0, 1}, {0, 40}, {30, 60}, {89, 61}};
    const std::vector<std::pair<int, int>> leaps = {{64, 1}, {149, 1}, {0, 1}, {63, 2}, {0, 150}, {10, 100}, {149, 1}};
    for (const fs::path& path : paths)
        for (const auto& bands : {down, up, leaps}) expect_same(path, bands);
}

TEST_F(Rows, AlphaStaysUnassociatedWhicheverWayOneReads) {
    // Going up makes the decoder start again; it must not begin to multiply by alpha then.
    std::vector<float> pixels;
    for (int i = 0; i < 40; ++i) pixels.insert(pixels.end(), {1.0F, 0.5F, 0.25F, float(i) / 255});
    for (const char* name : {"a.png", "a.tif"}) {
        write_image(folder_ / name, {1, 40, 4, pixels}, PixelType::uint16);
        RowReader reader(folder_ / name);
        EXPECT_EQ(reader.alpha_channel(), 3);
        EXPECT_EQ(reader.pixel_type(), "uint16");
        std::vector<float> row(4);
        for (const int y : {0, 39, 3, 38, 2}) {
            reader.read_rows(y, 1, row);
            EXPECT_NEAR(row[0], 1.0, 1e-4) << name << y;
            EXPECT_NEAR(row[1], 0.5, 1e-4) << name << y;
            EXPECT_NEAR(row[3], double(y) / 255, 1e-4) << name << y;
        }
    }
}

TEST_F(Rows, NamesAndTypesAreThoseOfTheFile) {
    const std::vector<float> pixels(6, 0.5F);
    const std::vector<std::string> names = {"hemoglobin", "melanin"};
    write_exr_map(folder_ / "a.exr", {1, 3, 2, pixels}, names, {}, true);
    const RowReader map(folder_ / "a.exr");
    EXPECT_EQ(map.channels(), names);
    EXPECT_EQ(map.pixel_type(), "half");
    EXPECT_EQ(map.alpha_channel(), -1);
    EXPECT_EQ(RowReader(picture("b.jpg", 3, PixelType::uint8)).pixel_type(), "uint8");
}

TEST_F(Rows, RefusesRowsThatAreNotThere) {
    RowReader reader(picture("a.png", 3, PixelType::uint8));
    std::vector<float> row(width * 3);
    EXPECT_THROW(reader.read_rows(-1, 1, row), std::invalid_argument);
    EXPECT_THROW(reader.read_rows(height, 1, row), std::invalid_argument);
    EXPECT_THROW(reader.read_rows(0, 0, row), std::invalid_argument);
    EXPECT_THROW(reader.read_rows(1, std::numeric_limits<int>::max(), row), std::invalid_argument);
    EXPECT_THROW(reader.read_rows(0, 2, row), std::invalid_argument);
    EXPECT_THROW(RowReader(folder_ / "absent.png"), ImageError);
    EXPECT_NO_THROW(reader.read_rows(0, 1, row));
}

TEST_F(Rows, AnErrorInTheMiddleDoesNotLeaveOldRows) {
    const fs::path path = picture("a.exr", 3, PixelType::half);
    fs::resize_file(path, fs::file_size(path) / 2);
    RowReader reader(path);
    std::vector<float> row(width * 3), rows(width * 3 * std::size_t(height));
    EXPECT_NO_THROW(reader.read_rows(height - 1, 1, row));
    EXPECT_THROW(reader.read_rows(0, height, rows), ImageError);
    EXPECT_THROW(reader.read_rows(0, 1, row), ImageError);
}

TEST_F(Rows, ATextureHasTilesLevelsAndTheSameValues) {
    // Values at the first level are kept to the bit; the mean of all, which is the last level's, to half precision.
    std::vector<float> pixels(128 * 128 * 5);
    double sum = 0;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
        pixels[i] = float(int((i * 31) % 64)) / 64 - 0.25F;  // negative ones too: nothing clamps or encodes
        if (i % 5 == 2) sum += double(pixels[i]);
    }
    const std::vector<std::string> names = {"blood", "hemoglobin", "melanin", "oil", "oxygenation"};
    write_exr_map(folder_ / "a.exr", {128, 128, 5, pixels}, names, {}, true);
    make_tx(folder_ / "a.exr", folder_ / "a.tx");
    const TextureInfo info = texture_info(folder_ / "a.tx");
    EXPECT_EQ(info.tile_width, 64);
    EXPECT_EQ(info.tile_height, 64);
    ASSERT_EQ(info.levels, 8);  // 128 to 1
    EXPECT_NEAR(info.mean.at(2), sum / (128 * 128), 1e-3);
    EXPECT_EQ(RowReader(folder_ / "a.tx").channels(), names);
    const Image image = read_image(folder_ / "a.tx");
    for (std::size_t i = 0; i < pixels.size(); ++i) ASSERT_EQ(image.pixels[i], pixels[i]) << i;

    make_tx(folder_ / "a.exr", folder_ / "b.tx");
    std::ifstream a(folder_ / "a.tx", std::ios::binary), b(folder_ / "b.tx", std::ios::binary);
    EXPECT_EQ(std::string(std::istreambuf_iterator<char>(a), {}), std::string(std::istreambuf_iterator<char>(b), {}));
}

TEST_F(Rows, ATextureAppearsWholeOrNotAtAll) {
    EXPECT_THROW(make_tx(folder_ / "absent.exr", folder_ / "a.tx"), ImageError);
    const fs::path source = picture("a.png", 3, PixelType::uint8);
    EXPECT_THROW(make_tx(source, folder_ / "a.exr"), ImageError);
    EXPECT_THROW(make_tx(source, folder_ / "absent" / "a.tx"), ImageError);
    fs::resize_file(source, fs::file_size(source) / 2);
    EXPECT_THROW(make_tx(source, folder_ / "a.tx"), ImageError);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 1);
}

}  // namespace
}  // namespace sanguine
