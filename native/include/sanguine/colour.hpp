// From reflectance spectra to colour: CIE 1931 2 degree observer, illuminant D65 or A, 380-780 nm every 5 nm.
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

enum class Illuminant { d65, a };

/// XYZ of a perfect white diffuser, Y = 100.
Colour white_xyz(Illuminant illuminant = Illuminant::d65);

/// The linear map from reflectances at `wavelengths_nm` (increasing, within 380-780 nm) to XYZ of the reflecting
/// surface under `illuminant`, Y = 100 for white: XYZ = sum of weight[i] * reflectance[i]. Between the samples the spectrum is
/// interpolated by cubics through the nearest four, beyond them it is continued as a constant (CIE 015:2018, 7.2).
/// Throws std::invalid_argument for other wavelengths.
std::vector<Colour> xyz_weights(std::span<const double> wavelengths_nm, Illuminant illuminant = Illuminant::d65);

/// CIE 1976 L*a*b* of an XYZ (Y = 100 for white) relative to white_xyz(illuminant).
Colour lab_from_xyz(const Colour& xyz, Illuminant illuminant = Illuminant::d65);

/// Colour difference CIEDE2000 of two L*a*b*, all weights 1 (ISO/CIE 11664-6; Sharma et al. 2005, Color Res. Appl.
/// 30:21, whose equation numbers the code cites).
double delta_e_2000(const Colour& lab_1, const Colour& lab_2);

/// From XYZ under D65 (Y = 1 for white) to linear RGB of "rec709", "rec2020" or "acescg", adapted by Bradford so
/// that a perfect white diffuser is (1, 1, 1). Throws std::invalid_argument for another name.
Matrix3 rgb_from_xyz(std::string_view working_space);

}  // namespace sanguine
