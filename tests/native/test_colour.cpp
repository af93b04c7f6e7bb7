#include "sanguine/colour.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace sanguine {
namespace {

std::vector<double> grid(double from, double to, double step) {
    std::vector<double> nm;
    for (double w = from; w <= to + 1e-9; w += step)
        nm.push_back(w);
    return nm;
}

template <class Spectrum> Colour xyz_of(const std::vector<double>& nm, Spectrum&& reflectance) {
    Colour xyz{};
    const std::vector<Colour> weights = xyz_weights(nm);
    for (std::size_t i = 0; i < nm.size(); ++i)
        for (int c = 0; c < 3; ++c)
            xyz[c] += weights[i][c] * reflectance(nm[i]);
    return xyz;
}

double distance(const Colour& a, const Colour& b) {
    return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

TEST(Colour, WhiteIsD65) {
    // CIE 015:2018 gives 95.04, 100, 108.88 for the 5 nm sum.
    EXPECT_LT(distance(white_xyz(), {95.04, 100, 108.88}), 0.005);
    for (const auto& nm : {grid(380, 780, 5), grid(380, 780, 10), grid(400, 700, 20), std::vector<double>{550}})
        EXPECT_LT(distance(xyz_of(nm, [](double) { return 1.0; }), white_xyz()), 1e-9) << nm.size();
    EXPECT_LT(distance(lab_from_xyz(white_xyz()), {100, 0, 0}), 1e-9);
}

TEST(Colour, WhiteIsOneInEveryWorkingSpace) {
    const Colour white = white_xyz(), relative = {white[0] / 100, white[1] / 100, white[2] / 100};
    for (const char* space : {"rec709", "rec2020", "acescg"})
        EXPECT_LT(distance(rgb_from_xyz(space) * relative, {1, 1, 1}), 1e-12) << space;
    EXPECT_THROW(rgb_from_xyz("sRGB"), std::invalid_argument);
}

TEST(Colour, Rec709MatrixIsTheStandardOne) {
    // IEC 61966-2-1, four digits; its white differs from the 5 nm sum by 5e-5.
    const Matrix3 expected = {{{3.2406, -1.5372, -0.4986}, {-0.9689, 1.8758, 0.0415}, {0.0557, -0.2040, 1.0570}}};
    const Matrix3 m = rgb_from_xyz("rec709");
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            EXPECT_NEAR(m[i][j], expected[i][j], 5e-4);
}

TEST(Colour, CoarseSpectraAreInterpolated) {
    // A spectrum as curved as skin's hemoglobin bands. Every 10 nm costs less than 0.05 in Lab; a sum that only weighs
    // its samples would be off by more than 0.5.
    const auto skin = [](double nm) {
        return 0.2 + 0.3 / (1 + std::exp((600 - nm) / 15)) - 0.05 * std::exp(-std::pow((nm - 542) / 12, 2));
    };
    const Colour fine = lab_from_xyz(xyz_of(grid(380, 780, 5), skin));
    EXPECT_LT(distance(lab_from_xyz(xyz_of(grid(380, 780, 10), skin)), fine), 0.05);
    EXPECT_LT(distance(lab_from_xyz(xyz_of(grid(400, 700, 10), skin)), fine), 0.1);  // ends continued
}

TEST(Colour, BadWavelengths) {
    EXPECT_THROW(xyz_weights(std::vector<double>{}), std::invalid_argument);
    EXPECT_THROW(xyz_weights(std::vector<double>{500, 500}), std::invalid_argument);
    EXPECT_THROW(xyz_weights(std::vector<double>{500, 490}), std::invalid_argument);
    EXPECT_THROW(xyz_weights(std::vector<double>{300, 500}), std::invalid_argument);
    EXPECT_THROW(xyz_weights(std::vector<double>{500, std::nan("")}), std::invalid_argument);
}

TEST(Colour, LabKnownValue) {
    // Blue-ish dark colour on the linear branch for Z: by hand from CIE 015:2018, 8.2.1.
    const Colour w = white_xyz();
    const Colour lab = lab_from_xyz({0.2 * w[0], 0.2 * w[1], 0.005 * w[2]});
    EXPECT_NEAR(lab[0], 116 * std::cbrt(0.2) - 16, 1e-12);
    EXPECT_NEAR(lab[1], 0, 1e-12);
    EXPECT_NEAR(lab[2], 200 * (std::cbrt(0.2) - (24389.0 / 27 * 0.005 + 16) / 116), 1e-12);
}

}  // namespace
}  // namespace sanguine
