#include "sanguine/unscattered.hpp"

#include <cmath>
#include <numbers>

namespace sanguine {
namespace {

UnscatteredLight operator*(double factor, const UnscatteredLight& light) {
    return {factor * light.specular, factor * light.reflected, factor * light.transmitted, factor * light.scattered};
}

UnscatteredLight operator+(const UnscatteredLight& a, const UnscatteredLight& b) {
    return {a.specular + b.specular, a.reflected + b.reflected, a.transmitted + b.transmitted,
            a.scattered + b.scattered};
}

double distance(const UnscatteredLight& a, const UnscatteredLight& b) {
    return std::fmax(std::fmax(std::fabs(a.specular - b.specular), std::fabs(a.reflected - b.reflected)),
                     std::fmax(std::fabs(a.transmitted - b.transmitted), std::fabs(a.scattered - b.scattered)));
}

/// Cosine in a medium of index n >= 1 of light that has `cosine` outside. No difference of near numbers in it.
double refracted(double cosine, double n) {
    return std::sqrt((n - outside_index) * (n + outside_index) + cosine * cosine) / n;
}

}  // namespace

Face fresnel_face(double n_above, double cos_above, double n_below, double cos_below) {
    if (n_above == n_below)
        return {0, 1};
    const double perpendicular_a = n_above * cos_above, perpendicular_b = n_below * cos_below;
    const double parallel_a = n_below * cos_above, parallel_b = n_above * cos_below;
    if (!(perpendicular_a > 0 && perpendicular_b > 0))
        return {1, 0};
    const double perpendicular = perpendicular_a + perpendicular_b, parallel = parallel_a + parallel_b;
    const double r_perpendicular = (perpendicular_a - perpendicular_b) / perpendicular;
    const double r_parallel = (parallel_a - parallel_b) / parallel;
    return {0.5 * (r_perpendicular * r_perpendicular + r_parallel * r_parallel),
            2 * (perpendicular_a / perpendicular * (perpendicular_b / perpendicular)
                 + parallel_a / parallel * (parallel_b / parallel))};
}

UnscatteredLight unscattered_at(std::span<const Layer> stack, double cosine) {
    // What lies below the level reached so far, seen from the medium at that level: `back` is reflected, `lost` = 1 -
    // back is carried for itself so that light trapped in a nearly clear layer keeps its precision.
    double back = 0, lost = 1, through = 1, scattered = 0;
    double n = outside_index, cos_n = cosine;
    double first_surface = 0;

    const auto cross_into = [&](double n_above, double cos_above) {
        const auto [rho, t] = fresnel_face(n_above, cos_above, n, cos_n);
        const double inside = t + rho * lost;  // 1 - rho back
        const double gain = inside > 0 ? t / inside : 0;
        first_surface = rho;
        back = t * gain * back;
        lost = gain * lost;
        through *= gain;
        scattered *= gain;
        n = n_above;
        cos_n = cos_above;
    };

    for (std::size_t i = stack.size(); i-- > 0;) {
        const Layer& layer = stack[i];
        const double cos_layer = refracted(cosine, layer.n);
        const double extinction = layer.mu_a + layer.mu_s;
        const double albedo = extinction > 0 ? layer.mu_s / extinction : 0;
        if (std::isinf(layer.thickness)) {
            back = 0;
            lost = 1;
            through = 0;
            scattered = albedo;
            n = layer.n;
            cos_n = cos_layer;
            continue;
        }
        cross_into(layer.n, cos_layer);
        back += first_surface;
        const double depth = extinction * layer.thickness / cos_layer;
        const double passes = std::exp(-depth), stops = -std::expm1(-depth);
        scattered = albedo * stops * (1 + passes * back) + passes * scattered;
        lost += back * -std::expm1(-2 * depth);
        back *= passes * passes;
        through *= passes;
    }
    cross_into(outside_index, cosine);
    return {first_surface, back, through, scattered};
}

UnscatteredLight unscattered(std::span<const Layer> stack, Incidence incidence) {
    if (incidence == Incidence::normal)
        return unscattered_at(stack, 1);

    // Light from outside (n = 1) is refracted into every layer (n >= 1), so there is no critical angle between 0 and
    // 90 degrees; what is steep lies near grazing incidence, for layers of n near 1. Takahasi and Mori's tanh-sinh rule
    // (1974) crowds its points there.
    const auto at = [&](double t) {
        const double e = std::exp(-std::numbers::pi * std::sinh(t));
        const double cosine = 1 / (1 + e);
        const double slope = std::numbers::pi * std::cosh(t) * cosine * (e / (1 + e));
        return 2 * cosine * slope * unscattered_at(stack, cosine);
    };
    // Beyond these, 2 cosine dcosine is below 1e-17.
    constexpr double first = -2.75, last = 3.25;
    constexpr int max_halvings = 7;
    double step = 0.25;
    UnscatteredLight sum{};
    for (double t = first; t <= last; t += step)
        sum = sum + at(t);
    UnscatteredLight result = step * sum;
    for (int halving = 0; halving < max_halvings; ++halving) {
        for (double t = first + step / 2; t < last; t += step)
            sum = sum + at(t);
        step /= 2;
        const UnscatteredLight finer = step * sum;
        const double change = distance(finer, result);
        result = finer;
        // The rule doubles its digits with every halving.
        if (change < 1e-9)
            break;
    }
    return result;
}

}  // namespace sanguine
