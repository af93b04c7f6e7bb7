// Pictures and the contact sheet, without a font: captions are tested through the wheel, which carries one.
#include "sanguine/image.hpp"

#include <cmath>
#include <fstream>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "sanguine/exr_map.hpp"

namespace sanguine {
namespace {

namespace fs = std::filesystem;

class Images : public testing::Test {
protected:
    void SetUp() override {
        folder_ = fs::path(testing::TempDir()) / ("sanguine-image-" + std::to_string(std::random_device{}()));
        fs::create_directories(folder_);
    }
    void TearDown() override { fs::remove_all(folder_); }

    /// A picture of one 8-bit value per channel.
    fs::path flat(const std::string& name, int width, int height, int channels, int value) const {
        const std::vector<float> pixels(std::size_t(width * height * channels), float(value) / 255);
        write_image(folder_ / name, {width, height, channels, pixels}, PixelType::uint8);
        return folder_ / name;
    }

    fs::path folder_;
};

TEST_F(Images, EightBitValuesSurviveUnchangedWithAlpha) {
    std::vector<float> pixels;
    for (int i = 0; i < 256 * 4; ++i) pixels.push_back(float((i * 7) % 256) / 255);
    write_image(folder_ / "a.png", {16, 16, 4, pixels}, PixelType::uint8);
    const Image image = read_image(folder_ / "a.png");
    ASSERT_EQ(image.size(), pixels.size());
    for (std::size_t i = 0; i < pixels.size(); ++i) EXPECT_FLOAT_EQ(image.pixels[i], pixels[i]) << i;
}

TEST_F(Images, RowZeroIsTheBottom) {
    // Against a file made by hand, whose rows run from the top, and against OpenEXR's own reader.
    std::ofstream(folder_ / "a.pgm", std::ios::binary) << std::string("P5\n1 2\n255\n\xff\x00", 13);
    EXPECT_EQ(read_image(folder_ / "a.pgm").pixels[0], 0);
    const std::vector<float> bottom_black = {0, 1};
    for (const char* name : {"a.exr", "a.tif", "a.png", "a.jpg"}) {
        write_image(folder_ / name, {1, 2, 1, bottom_black});
        EXPECT_LT(read_image(folder_ / name).pixels[0], 0.1F) << name;
    }
    EXPECT_EQ(read_exr_map(folder_ / "a.exr").image.pixels[0], 0);
}

TEST_F(Images, ErrorsNameTheFileInOneLine) {
    std::ofstream(folder_ / "text.png") << "This is no picture.";
    for (const fs::path& path : {folder_ / "absent.png", folder_ / "text.png", folder_ / "absent.unknown"})
        try {
            read_image(path);
            ADD_FAILURE() << path;
        } catch (const ImageError& error) {
            const std::string message = error.what();
            EXPECT_NE(message.find(path.string()), std::string::npos) << message;
            EXPECT_EQ(message.find('\n'), std::string::npos) << message;
        }
}

TEST_F(Images, AFailedWriteLeavesNothing) {
    const std::vector<float> pixel = {0};
    EXPECT_THROW(write_image(folder_ / "a.unknown", {1, 1, 1, pixel}, PixelType::uint8), ImageError);
    EXPECT_THROW(write_image(folder_ / "absent" / "a.png", {1, 1, 1, pixel}, PixelType::uint8), ImageError);
    EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(Images, ContactSheetPlacesPicturesInReadingOrder) {
    const std::vector<fs::path> paths = {flat("a.png", 4, 6, 3, 10), flat("b.png", 4, 6, 4, 20),
                                         flat("c.png", 2, 6, 1, 30)};
    contact_sheet(paths, {}, folder_ / "sheet.png", {.columns = 2, .gap_px = 1, .background = 0, .font = {}});
    const Image sheet = read_image(folder_ / "sheet.png");
    ASSERT_EQ(sheet.width, 2 * 4 + 3);
    ASSERT_EQ(sheet.height, 2 * 6 + 3);
    const auto at = [&](int x, int row_from_top) {
        return std::lround(255 * sheet.pixels[std::size_t((sheet.height - 1 - row_from_top) * sheet.width + x) * 3]);
    };
    EXPECT_EQ(at(0, 0), 0);
    EXPECT_EQ(at(1, 1), 10);
    EXPECT_EQ(at(4, 6), 10);
    EXPECT_EQ(at(6, 1), 20);
    EXPECT_EQ(at(1, 8), 0);  // the third is narrower than its cell, and centred in it
    EXPECT_EQ(at(2, 8), 30);
    EXPECT_EQ(at(3, 13), 30);
    EXPECT_EQ(at(4, 13), 0);
}

TEST_F(Images, ContactSheetRefusesABadLayout) {
    const std::vector<fs::path> one = {flat("a.png", 4, 4, 3, 10)};
    const std::vector<std::string> two = {"a", "b"};
    EXPECT_THROW(contact_sheet({}, {}, folder_ / "s.png", {}), std::invalid_argument);
    EXPECT_THROW(contact_sheet(one, two, folder_ / "s.png", {}), std::invalid_argument);
    EXPECT_THROW(contact_sheet(one, {}, folder_ / "s.png", {.columns = 0, .font = {}}), std::invalid_argument);
}

}  // namespace
}  // namespace sanguine
