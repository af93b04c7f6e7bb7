#include "sanguine/fresnel.hpp"

#include <cmath>

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
    const double n2 = n * n, n4 = n2 * n2;
    return 0.5 + (n - 1) * (3 * n + 1) / (6 * (n + 1) * (n + 1))
         + n2 * (n2 - 1) * (n2 - 1) / ((n2 + 1) * (n2 + 1) * (n2 + 1)) * std::log((n - 1) / (n + 1))
         - 2 * n2 * n * (n2 + 2 * n - 1) / ((n2 + 1) * (n4 - 1))
         + 8 * n4 * (n4 + 1) / ((n2 + 1) * (n4 - 1) * (n4 - 1)) * std::log(n);
}

}  // namespace sanguine
