#include "sanguine/inversion.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "message_of.hpp"
#include "sanguine/chromophores.hpp"
#include "sanguine/skin.hpp"
#include "sanguine/surface.hpp"

namespace sanguine {
namespace {

const SkinInverse& tables() {
    static const SkinInverse inverse(SkinParameters{}, rgb_from_xyz("rec709"), 17, 2, {});
    return inverse;
}

/// What `sanguine skin` says of the default skin with these chromophores.
Colour true_lab(const SkinPoint& p) {
    SkinParameters skin;
    skin.melanin = std::exp(p[0]), skin.hemoglobin = std::exp(p[1]), skin.oxygenation = p[2];
    std::vector<double> nm;
    for (double w = min_wavelength_nm; w <= max_wavelength_nm; w += 5)
        nm.push_back(w);
    const std::vector<double> r = reflectance({&skin, 1}, nm, 1, {});
    const std::vector<Colour> weights = xyz_weights(nm);
    Colour xyz{};
    for (std::size_t w = 0; w < nm.size(); ++w)
        for (int c = 0; c < 3; ++c)
            xyz[c] += (1 - surface_reflectance(skin).film) * weights[w][c] * r[w];
    return lab_from_xyz(xyz);
}

Colour in_double(const std::array<float, 3>& v) {
    return {v[0], v[1], v[2]};
}

SkinPoint within(std::mt19937& random, const std::array<std::array<double, 2>, 3>& range) {
    SkinPoint p;
    for (int k = 0; k < 3; ++k)
        p[k] = float(std::uniform_real_distribution<double>(range[k][0], range[k][1])(random));
    return p;
}

std::array<std::array<double, 2>, 3> everything() {
    const auto& a = inversion_axes();
    return {{{a[0].lower + 1e-5, a[0].upper - 1e-5}, {a[1].lower + 1e-5, a[1].upper - 1e-5}, {a[2].lower, a[2].upper}}};
}

TEST(Inversion, TheForwardTableIsTheSkin) {
    // The table is linear between nodes 0.1 apart in ln and 0.12 in oxygenation: 0.14 at the most, in deep blood without
    // oxygen; a tenth of what an eye sees in most of it.
    std::mt19937 random(1);
    std::vector<double> errors;
    for (int i = 0; i < 200; ++i) {
        const SkinPoint p = within(random, everything());
        errors.push_back(delta_e_2000(true_lab(p), in_double(tables().lab(p))));
    }
    std::sort(errors.begin(), errors.end());
    EXPECT_LT(errors[100], 0.02);
    EXPECT_LT(errors.back(), 0.2);
}

TEST(Inversion, FindsWhatIsThere) {
    // Faces from very light to dark, without noise. What remains is the pull of the priors, most of it on oxygenation.
    std::mt19937 random(2);
    for (int i = 0; i < 300; ++i) {
        const SkinPoint p = within(random, {{{std::log(0.01), std::log(0.15)}, {std::log(0.008), std::log(0.06)}, {0.68, 0.82}}});
        const SkinPoint found = tables().point(tables().lab(p));
        EXPECT_LT(delta_e_2000(in_double(tables().lab(p)), in_double(tables().lab(found))), 0.6);
        EXPECT_NEAR(found[0], p[0], 0.06);
        // Half of the light's change with blood is left under 6 % melanin (docs/inversion.md).
        EXPECT_NEAR(found[1], p[1], p[0] < std::log(0.06) ? 0.2 : 0.35);
        // Oxygenation moves the colour least: the prior takes most of it back, and never turns it round.
        EXPECT_LE(std::abs(found[2] - 0.75), std::abs(p[2] - 0.75) + 0.02);
    }
}

TEST(Inversion, AnyColourHasAnAnswerInsideTheRange) {
    std::mt19937 random(3);
    std::uniform_real_distribution<float> uniform(-1, 1);
    for (int i = 0; i < 2000; ++i) {
        const SkinPoint p = tables().point({50 + 80 * uniform(random), 120 * uniform(random), 120 * uniform(random)});
        for (int k = 0; k < 3; ++k) {
            EXPECT_GE(p[k], inversion_axes()[k].lower - 1e-5);
            EXPECT_LE(p[k], inversion_axes()[k].upper + 1e-5);
        }
    }
    EXPECT_NE(message_of([] { SkinInverse(SkinParameters{}, rgb_from_xyz("rec709"), 4, 1, {}); }).find("5 to 129"), std::string::npos);
}

TEST(Inversion, FastDifferencesAreThoseOfTheStandard) {
    std::mt19937 random(4);
    std::uniform_real_distribution<float> light(0, 100), chroma(-60, 60), near(-2, 2);
    constexpr std::size_t count = 5000;
    std::vector<float> one(3 * count), two(3 * count), fast(count);
    for (std::size_t i = 0; i < count; ++i)
        for (int k = 0; k < 3; ++k) {
            one[k * count + i] = k ? chroma(random) : light(random);
            two[k * count + i] = i % 2 ? (k ? chroma(random) : light(random)) : one[k * count + i] + near(random);
        }
    for (int k = 0; k < 3; ++k)
        two[k * count] = one[k * count], one[k * count + 2] = two[k * count + 2] = k ? 0 : 50;
    delta_e_2000_fast(count, one.data(), two.data(), fast.data());
    EXPECT_EQ(fast[0], 0);
    for (std::size_t i = 0; i < count; ++i) {
        const Colour p{one[i], one[count + i], one[2 * count + i]}, q{two[i], two[count + i], two[2 * count + i]};
        // Opposite hues are left out: there the formula jumps, and rounding decides to which side.
        const double turn = std::abs(std::remainder(std::atan2(p[2], p[1]) - std::atan2(q[2], q[1]), 2 * M_PI));
        if (turn < 3.0) {
            EXPECT_NEAR(fast[i], delta_e_2000(p, q), 2e-3) << i;
        }
    }
}

struct Picture {
    int width, height;
    std::vector<float> rgba;
    PictureRows rows(int first, int count) const {
        return {rgba.data() + std::size_t(first) * width * 4, width, first, count, 4, false};
    }
};

/// Skin with spots, a patch that is none, and holes.
Picture picture(int width, int height) {
    Picture out{width, height, {}};
    std::mt19937 random(5);
    std::normal_distribution<float> noise(0, 0.004f);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const float wave = std::sin(x * 0.05f) * std::cos(y * 0.07f);
            const SkinPoint p{std::log(0.03f) + 0.3f * wave, std::log(0.015f) + 0.5f * std::sin(y * 0.03f), 0.75f};
            std::array<float, 3> rgb = tables().rgb_of_lab(tables().lab(p));
            if (x > width * 3 / 4 && y > height / 2)
                rgb = {0.1f, 0.3f, 0.7f};
            for (float& v : rgb)
                v += noise(random);
            out.rgba.insert(out.rgba.end(), {rgb[0], rgb[1], rgb[2], x < 4 ? 0.0f : 1.0f});
        }
    out.rgba[4 * (width * 3 + 30)] = std::numeric_limits<float>::quiet_NaN();
    out.rgba[4 * (width * 9 + 40) + 1] = std::numeric_limits<float>::infinity();
    return out;
}

struct Maps {
    std::vector<float> skin, residual, shading, mask, error;
    InversionCounts counts;
};

Maps invert(const Picture& p, int band, int threads, bool upward = true) {
    PictureOverview overview(p.width, p.height);
    for (int first = 0; first < p.height; first += band) {
        const int count = std::min(band, p.height - first);
        overview.add(p.rows(upward ? first : p.height - first - count, count), threads);
    }
    const PictureOverview* const one = &overview;
    const PictureModel model = picture_models(tables(), {&one, 1}, {Shading::on, -1, 0}, threads).front();
    const std::size_t n = std::size_t(p.width) * p.height;
    Maps m{std::vector<float>(4 * n), std::vector<float>(3 * n), std::vector<float>(n), std::vector<float>(n), std::vector<float>(n), {}};
    for (int first = 0; first < p.height; first += band) {
        const int count = std::min(band, p.height - first);
        const int low = std::max(0, first - inversion_halo), high = std::min(p.height, first + count + inversion_halo);
        const std::size_t at = std::size_t(first) * p.width;
        m.counts += invert_rows(tables(), model, p.rows(low, high - low), first, count,
                                {&m.skin[4 * at], &m.residual[3 * at], &m.shading[at], &m.mask[at], &m.error[at], false}, threads, {});
    }
    return m;
}

TEST(Inversion, HowRowsAreCutAndThreadsChangeNothing) {
    const Picture p = picture(601, 203);
    const Maps whole = invert(p, 203, 1);
    for (const Maps& other : {invert(p, 203, 3), invert(p, 50, 2), invert(p, 7, 1, false)}) {
        const auto same = [](const std::vector<float>& a, const std::vector<float>& b) {
            return std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
        };
        EXPECT_TRUE(same(whole.skin, other.skin));
        EXPECT_TRUE(same(whole.residual, other.residual));
        EXPECT_TRUE(same(whole.shading, other.shading));
        EXPECT_TRUE(same(whole.mask, other.mask));
        EXPECT_TRUE(same(whole.error, other.error));
        EXPECT_EQ(whole.counts.error, other.counts.error);
        EXPECT_EQ(whole.counts.point, other.counts.point);
    }
}

TEST(Inversion, LookTimesResidualTimesShadingIsThePicture) {
    const Picture p = picture(200, 120);
    const Maps m = invert(p, 120, 2);
    for (std::size_t i = 0; i < m.mask.size(); ++i) {
        const float* rgba = &p.rgba[4 * i];
        const bool there = std::isfinite(rgba[0] + rgba[1] + rgba[2]) && rgba[3] > 0;
        ASSERT_TRUE(std::isfinite(m.error[i]) && m.error[i] >= 0);
        ASSERT_TRUE(m.mask[i] >= 0 && m.mask[i] <= 1);
        const SkinPoint point{std::log(m.skin[4 * i + 1]), std::log(m.skin[4 * i]), m.skin[4 * i + 3]};
        const auto lab = tables().lab(point);
        const auto look = tables().rgb_of_lab(lab);
        EXPECT_EQ(m.skin[4 * i + 2], float(SkinParameters{}.oil));
        if (!there) {
            EXPECT_EQ(m.mask[i], 0);
            EXPECT_EQ(m.error[i], 0);
            for (int c = 0; c < 3; ++c)
                EXPECT_EQ(m.residual[3 * i + c], 1);
            continue;
        }
        std::array<float, 3> unlit;
        for (int c = 0; c < 3; ++c) {
            // Single precision through logarithms and cubes.
            EXPECT_NEAR(look[c] * m.residual[3 * i + c] * m.shading[i], std::max(rgba[c], 0.0f), 2e-5);
            unlit[c] = rgba[c] / m.shading[i];
        }
        EXPECT_NEAR(m.error[i], delta_e_2000(in_double(tables().lab_of_rgb(unlit)), in_double(lab)), 0.01);
    }
    EXPECT_EQ(m.counts.texels, m.mask.size());
    EXPECT_EQ(m.counts.texels - m.counts.there, 4u * 120 + 2);
}

TEST(Inversion, WrongRowsAreRefused) {
    const Picture p = picture(64, 40);
    PictureOverview overview(64, 40);
    overview.add(p.rows(0, 20), 1);
    EXPECT_NE(message_of([&] { overview.add(p.rows(10, 20), 1); }).find("not all are new"), std::string::npos);
    const PictureOverview* const one = &overview;
    EXPECT_NE(message_of([&] { picture_models(tables(), {&one, 1}, {}, 1); }).find("row 20 of 40"), std::string::npos);
    overview.add(p.rows(20, 20), 1);
    const PictureModel model = picture_models(tables(), {&one, 1}, {}, 1).front();
    EXPECT_NE(message_of([&] { invert_rows(tables(), model, p.rows(10, 20), 10, 20, {}, 1, {}); }).find("look at 3 more"), std::string::npos);
    EXPECT_THROW(PictureOverview(0, 5), std::invalid_argument);
}

TEST(Inversion, SmallAndEmptyPictures) {
    for (const auto& [w, h] : {std::pair{1, 1}, {2, 3}, {1, 9}, {5, 1}}) {
        Picture p{w, h, std::vector<float>(std::size_t(w) * h * 4, 0.3f)};
        const Maps m = invert(p, h, 1);
        EXPECT_TRUE(std::all_of(m.skin.begin(), m.skin.end(), [](float v) { return std::isfinite(v) && v >= 0; }));
    }
    Picture nothing{8, 8, std::vector<float>(8 * 8 * 4, 0.0f)};
    const Maps m = invert(nothing, 8, 1);
    EXPECT_EQ(m.counts.there, 0u);
    EXPECT_NEAR(m.skin[1], std::exp(inversion_axes()[0].mean), 1e-4);
}

}  // namespace
}  // namespace sanguine
