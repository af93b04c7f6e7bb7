// From reflectance spectra to colour: CIE 1931 2 degree observer, illuminant D65, 380-780 nm every 5 nm.
#pragma once

#include <array>
#include <span>
#include <string_view>
#include <vector>

namespace sanguine {

using Colour = std::array<double, 3>;
using Matrix3 = std::array<std::array<double, 3>, 3>;

Colour operator*(const Matrix3& m, const Colour& v);
Matrix3 operator*(const Matrix3& a, const Matrix3& b);
Matrix3 inverse(const Matrix3& m);

/// XYZ of a perfect white diffuser, Y = 100.
Colour white_xyz();

/// The linear map from reflectances at `wavelengths_nm` (increasing, within 380-780 nm) to XYZ of the reflecting
/// surface under D65, Y = 100 for white: XYZ = sum of weight[i] * reflectance[i]. Between the samples the spectrum is
/// interpolated by cubics through the nearest four, beyond them it is continued as a constant (CIE 015:2018, 7.2).
/// Throws std::invalid_argument for other wavelengths.
std::vector<Colour> xyz_weights(std::span<const double> wavelengths_nm);

/// CIE 1976 L*a*b* of an XYZ (Y = 100 for white) relative to white_xyz().
Colour lab_from_xyz(const Colour& xyz);

/// From XYZ under D65 (Y = 1 for white) to linear RGB of "rec709", "rec2020" or "acescg", adapted by Bradford so
/// that a perfect white diffuser is (1, 1, 1). Throws std::invalid_argument for another name.
Matrix3 rgb_from_xyz(std::string_view working_space);

}  // namespace sanguine
