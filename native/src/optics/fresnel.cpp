#include "sanguine/fresnel.hpp"

#include <cmath>
#include <initializer_list>

namespace sanguine {

double fresnel_dielectric(double cos_i, double n_i, double n_t, double& cos_t) {
    const double sin_t = n_i / n_t * std::sqrt(std::fmax(0.0, 1.0 - cos_i * cos_i));
    if (sin_t >= 1.0) {
        cos_t = 0.0;
        return 1.0;
    }
    cos_t = std::sqrt(1.0 - sin_t * sin_t);
    const double parallel = (n_t * cos_i - n_i * cos_t) / (n_t * cos_i + n_i * cos_t);
    const double perpendicular = (n_i * cos_i - n_t * cos_t) / (n_i * cos_i + n_t * cos_t);
    return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

double diffuse_fresnel(double n) {
    if (n == 1)
        return 0;
    // Walsh's terms with t = (n - 1) / (n + 1), for which ln n = 2 atanh t. Those that grow without bound as n nears 1
    // cancel in the polynomials, so that every digit is left: the result falls as t itself.
    const double t = (n - 1) / (n + 1), t2 = t * t;
    const auto polynomial = [t](std::initializer_list<double> falling) {
        double sum = 0;
        for (const double coefficient : falling)
            sum = sum * t + coefficient;
        return sum;
    };
    // (atanh(t) / t - 1) / t^2
    double rest = 0;
    if (t < 0.25)
        for (int k = 27; k >= 3; k -= 2)
            rest = rest * t2 + 1.0 / k;
    else
        rest = (std::atanh(t) / t - 1) / t2;
    const double even = polynomial({1, 2, 4, 10, -2, -10, -4, 14, 1})
                      + polynomial({1, 2, 5, 8, -6, -20, -6, 8, 5, 2, 1}) * rest;
    const double denominator = (1 + t2) * (1 + t2) * (1 + t2);
    return t * (even / (4 * denominator) + (2 + t) / 6 + 2 * t * (1 + t) * (1 + t) / denominator * std::log(t));
}

double surface_reflectance(double n, Incidence incidence) {
    if (incidence == Incidence::diffuse)
        return diffuse_fresnel(n / outside_index);
    double cos_t;
    return fresnel_dielectric(1, outside_index, n, cos_t);
}

}  // namespace sanguine
