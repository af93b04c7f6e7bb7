// The inverse Hankel transform against pairs known in closed form.
#include "sanguine/hankel.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

using namespace sanguine;

namespace {

constexpr double two_pi = 2 * std::numbers::pi;

std::vector<double> radii() {
    std::vector<double> all;
    for (double r = 1e-4; r < 50; r *= 1.3)
        all.push_back(r);
    all.push_back(50);
    return all;
}

/// 1e-6 relative where double precision can have it; elsewhere the error that the transform states. That one in turn
/// is held to 1e-8 of the value or 1e-13 of F(0) / r^2: eight roundings (1.8e-15) of the integral of |x J0(x)| / (2 pi)
/// over 30 half waves (0.34 x^1.5 / (2 pi) = 50 at x = 30 pi), the most that a transform without decay needs.
template <class F, class G>
void expect_pair(const F& transform, const G& exact) {
    int calls = 0;
    const auto r = radii();
    const auto results = inverse_hankel(
        [&](double s) {
            ++calls;
            return std::array{transform(s), 0.5 * transform(s)};
        },
        r);
    double worst = 0;
    for (std::size_t i = 0; i < r.size(); ++i) {
        const double scale = std::abs(transform(1e-9)) / (r[i] * r[i]);
        const double error = std::abs(results[i].value[0] - exact(r[i]));
        EXPECT_LE(error, std::max(1e-6 * std::abs(exact(r[i])), results[i].error[0])) << "r " << r[i];
        EXPECT_LE(results[i].error[0], std::max(1e-8 * std::abs(exact(r[i])), 1e-13 * scale)) << "r " << r[i];
        EXPECT_DOUBLE_EQ(results[i].value[1], 0.5 * results[i].value[0]);
        if (results[i].error[0] < 1e-6 * std::abs(exact(r[i])))
            worst = std::max(worst, error / std::abs(exact(r[i])));
    }
    std::printf("worst relative error %.1e, %d calls of F for %zu radii\n", worst, calls, r.size());
    // One octave panel each for the range of radii, then at most 80 half waves and two edges for each radius.
    EXPECT_LE(calls, 12 * (60 + 82 * static_cast<int>(r.size())));
}

}  // namespace

TEST(Hankel, DepthWithoutAbsorption) {
    for (const double a : {1e-4, 1e-2, 0.1, 1.0, 30.0})
        expect_pair([a](double s) { return std::exp(-a * s); },
                    [a](double r) { return a / (two_pi * std::pow(a * a + r * r, 1.5)); });
}

TEST(Hankel, DipoleTerm) {
    // exp(-a sqrt(s^2 + b^2)) <-> a (1 + b d) exp(-b d) / (2 pi d^3), d = sqrt(r^2 + a^2)
    for (const double a : {1e-4, 1e-2, 0.1, 1.0})
        for (const double b : {1e-4, 0.01, 0.3, 2.0, 30.0})
            expect_pair([a, b](double s) { return std::exp(-a * std::hypot(s, b)); },
                        [a, b](double r) {
                            const double d = std::hypot(r, a);
                            return a * (1 + b * d) * std::exp(-b * d) / (two_pi * d * d * d);
                        });
}

TEST(Hankel, FluenceOfAPointSource) {
    // exp(-a sqrt(s^2 + b^2)) / sqrt(s^2 + b^2) <-> exp(-b d) / (2 pi d)
    for (const double a : {1e-3, 0.1, 1.0})
        for (const double b : {0.01, 0.3, 2.0})
            expect_pair([a, b](double s) { return std::exp(-a * std::hypot(s, b)) / std::hypot(s, b); },
                        [a, b](double r) {
                            const double d = std::hypot(r, a);
                            return std::exp(-b * d) / (two_pi * d);
                        });
}

TEST(Hankel, Gaussian) {
    for (const double v : {1e-6, 1e-2, 1.0, 100.0})
        expect_pair([v](double s) { return std::exp(-0.5 * s * s * v); },
                    [v](double r) { return std::exp(-0.5 * r * r / v) / (two_pi * v); });
}

TEST(Hankel, TwoScalesAtOnce) {
    // A narrow peak over a wide halo, ten thousand times apart.
    const auto f = [](double a, double b, double r) {
        const double d = std::hypot(r, a);
        return a * (1 + b * d) * std::exp(-b * d) / (two_pi * d * d * d);
    };
    expect_pair([](double s) { return 0.5 * std::exp(-1e-3 * s) + 0.5 * std::exp(-10 * std::hypot(s, 0.05)); },
                [&](double r) { return 0.5 * f(1e-3, 0, r) + 0.5 * f(10, 0.05, r); });
}

TEST(Hankel, ExtremeRadiiStayFinite) {
    const std::vector<double> r = {1e-300, 1e-30, 1e-9, 1e6, 1e30, 1e300};
    for (const HankelResult& result : inverse_hankel([](double s) { return std::array{std::exp(-s), 1.0}; }, r))
        for (int c = 0; c < 2; ++c) {
            EXPECT_TRUE(std::isfinite(result.value[c]));
            EXPECT_FALSE(std::isnan(result.error[c]));
        }
}
