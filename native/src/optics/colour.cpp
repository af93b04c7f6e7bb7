#include "sanguine/colour.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <stdexcept>

#include "embedded_data.hpp"
#include "sanguine/chromophores.hpp"

namespace sanguine {
namespace {

struct Chromaticity {
    double x, y;
};

struct RgbSpace {
    std::string_view name;
    Chromaticity red, green, blue, white;
};

constexpr RgbSpace spaces[] = {
    {"rec709", {0.640, 0.330}, {0.300, 0.600}, {0.150, 0.060}, {0.3127, 0.3290}},     // ITU-R BT.709-6
    {"rec2020", {0.708, 0.292}, {0.170, 0.797}, {0.131, 0.046}, {0.3127, 0.3290}},    // ITU-R BT.2020-2
    {"acescg", {0.713, 0.293}, {0.165, 0.830}, {0.128, 0.044}, {0.32168, 0.33767}},   // ACES AP1, S-2014-004
};

/// Cone responses of Bradford adaptation (Lam 1985; CIE 160:2004).
constexpr Matrix3 bradford = {{{0.8951, 0.2664, -0.1614}, {-0.7502, 1.7135, 0.0367}, {0.0389, -0.0685, 1.0296}}};

Colour xyz_of(Chromaticity c) {
    return {c.x / c.y, 1, (1 - c.x - c.y) / c.y};
}

Matrix3 diagonal(const Colour& v) {
    return {{{v[0], 0, 0}, {0, v[1], 0}, {0, 0, v[2]}}};
}

Matrix3 columns(const Colour& a, const Colour& b, const Colour& c) {
    return {{{a[0], b[0], c[0]}, {a[1], b[1], c[1]}, {a[2], b[2], c[2]}}};
}

/// Weights of the illuminant and the observer at their own 5 nm, scaled to Y = 100.
std::vector<Colour> weights_at_5_nm(Illuminant illuminant) {
    const auto observer = embedded_colour_matching();
    const auto power = illuminant == Illuminant::a ? embedded_illuminant_a() : embedded_illuminant_d65();
    std::vector<Colour> weights(observer.size());
    double y = 0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
        for (int c = 0; c < 3; ++c)
            weights[i][c] = power[i][1] * observer[i][c + 1];
        y += weights[i][1];
    }
    for (Colour& weight : weights)
        for (double& w : weight)
            w *= 100 / y;
    return weights;
}

}  // namespace

Colour operator*(const Matrix3& m, const Colour& v) {
    Colour out;
    for (int i = 0; i < 3; ++i)
        out[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
    return out;
}

Matrix3 operator*(const Matrix3& a, const Matrix3& b) {
    Matrix3 out{};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            for (int k = 0; k < 3; ++k)
                out[i][j] += a[i][k] * b[k][j];
    return out;
}

Matrix3 inverse(const Matrix3& m) {
    Matrix3 cofactor;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            const int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
            cofactor[j][i] = m[a][c] * m[b][d] - m[a][d] * m[b][c];
        }
    const double determinant = m[0][0] * cofactor[0][0] + m[0][1] * cofactor[1][0] + m[0][2] * cofactor[2][0];
    for (auto& row : cofactor)
        for (double& value : row)
            value /= determinant;
    return cofactor;
}

Colour white_xyz(Illuminant illuminant) {
    Colour sum{};
    for (const Colour& weight : weights_at_5_nm(illuminant))
        for (int c = 0; c < 3; ++c)
            sum[c] += weight[c];
    return sum;
}

std::vector<Colour> xyz_weights(std::span<const double> nm, Illuminant illuminant) {
    for (std::size_t i = 0; i < nm.size(); ++i)
        if (!(nm[i] >= min_wavelength_nm && nm[i] <= max_wavelength_nm) || (i > 0 && nm[i] <= nm[i - 1])) {
            std::ostringstream message;
            message << "wavelengths_nm: " << nm[i] << " at " << i << ", must increase within "
                    << min_wavelength_nm << " to " << max_wavelength_nm << " nm";
            throw std::invalid_argument(message.str());
        }
    if (nm.empty())
        throw std::invalid_argument("wavelengths_nm: empty, needs one wavelength or more");

    const auto observer = embedded_colour_matching();
    const std::vector<Colour> fine = weights_at_5_nm(illuminant);
    const std::ptrdiff_t count = std::ssize(nm), order = std::min<std::ptrdiff_t>(4, count);
    std::vector<Colour> weights(nm.size());
    for (std::size_t i = 0; i < fine.size(); ++i) {
        const double at = std::clamp(observer[i][0], nm.front(), nm.back());
        const auto above = std::upper_bound(nm.begin(), nm.end(), at) - nm.begin();
        const std::ptrdiff_t first = std::clamp<std::ptrdiff_t>(above - 2, 0, count - order);
        for (auto j = first; j < first + order; ++j) {
            double lagrange = 1;
            for (auto k = first; k < first + order; ++k)
                if (k != j)
                    lagrange *= (at - nm[k]) / (nm[j] - nm[k]);
            for (int c = 0; c < 3; ++c)
                weights[j][c] += lagrange * fine[i][c];
        }
    }
    return weights;
}

Colour lab_from_xyz(const Colour& xyz, Illuminant illuminant) {
    const Colour white = white_xyz(illuminant);
    const auto f = [](double t) { return t > 216.0 / 24389 ? std::cbrt(t) : (24389.0 / 27 * t + 16) / 116; };
    const double x = f(xyz[0] / white[0]), y = f(xyz[1] / white[1]), z = f(xyz[2] / white[2]);
    return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

double delta_e_2000(const Colour& lab_1, const Colour& lab_2) {
    constexpr double degree = std::numbers::pi / 180;
    const auto power7 = [](double x) { return std::pow(x, 7); };
    const auto length = [](double a, double b) { return std::sqrt(a * a + b * b); };
    const double pale = power7(25);
    const double mean_chroma = (length(lab_1[1], lab_1[2]) + length(lab_2[1], lab_2[2])) / 2;  // Eq. 3
    const double stretch = 1.5 - 0.5 * std::sqrt(power7(mean_chroma) / (power7(mean_chroma) + pale));  // 1 + G, Eq. 4
    const double a1 = stretch * lab_1[1], a2 = stretch * lab_2[1], b1 = lab_1[2], b2 = lab_2[2];
    const double c1 = length(a1, b1), c2 = length(a2, b2);
    const auto hue = [](double a, double b) {  // 0 to 360 degrees, 0 for grey, Eq. 7
        const double h = std::atan2(b, a) / degree;
        return h < 0 ? h + 360 : h;
    };
    const double h1 = hue(a1, b1), h2 = hue(a2, b2);
    const bool grey = c1 * c2 == 0;

    double turn = grey ? 0 : h2 - h1;  // Eq. 10
    if (turn > 180)
        turn -= 360;
    else if (turn < -180)
        turn += 360;
    const double lightness = lab_2[0] - lab_1[0], chroma = c2 - c1;
    const double dh = 2 * std::sqrt(c1 * c2) * std::sin(turn / 2 * degree);

    const double l = (lab_1[0] + lab_2[0]) / 2, c = (c1 + c2) / 2;
    double h = h1 + h2;  // mean hue, Eq. 14
    if (!grey) {
        if (std::abs(h1 - h2) > 180)
            h += h < 360 ? 360 : -360;
        h /= 2;
    }
    const double t = 1 - 0.17 * std::cos((h - 30) * degree) + 0.24 * std::cos(2 * h * degree)
                     + 0.32 * std::cos((3 * h + 6) * degree) - 0.20 * std::cos((4 * h - 63) * degree);  // Eq. 15
    const double s_l = 1 + 0.015 * (l - 50) * (l - 50) / std::sqrt(20 + (l - 50) * (l - 50));           // Eq. 18
    const double s_c = 1 + 0.045 * c, s_h = 1 + 0.015 * c * t;                                           // Eq. 19, 20
    const double blue = 30 * std::exp(-std::pow((h - 275) / 25, 2));                                     // Eq. 16
    const double r_t = -2 * std::sqrt(power7(c) / (power7(c) + pale)) * std::sin(2 * blue * degree);     // Eq. 17, 21
    const double x = lightness / s_l, y = chroma / s_c, z = dh / s_h;
    return std::sqrt(std::max(0.0, x * x + y * y + z * z + r_t * y * z));  // Eq. 22
}

Matrix3 rgb_from_xyz(std::string_view working_space) {
    for (const RgbSpace& space : spaces) {
        if (space.name != working_space)
            continue;
        const Colour white = xyz_of(space.white);
        const Matrix3 primaries = columns(xyz_of(space.red), xyz_of(space.green), xyz_of(space.blue));
        const Matrix3 xyz_from_rgb = primaries * diagonal(inverse(primaries) * white);

        Colour source = bradford * white_xyz(), target = bradford * white, gain;
        for (int c = 0; c < 3; ++c)
            gain[c] = target[c] / (source[c] / 100);
        return inverse(xyz_from_rgb) * inverse(bradford) * diagonal(gain) * bradford;
    }
    throw std::invalid_argument("working_space: '" + std::string(working_space)
                                + "' is not known, allowed are rec709, rec2020, acescg or a 3x3 matrix");
}

}  // namespace sanguine
