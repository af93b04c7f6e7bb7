#include "sanguine/photon_tracer.hpp"

#include <cmath>
#include <limits>

#include "sanguine/fresnel.hpp"

namespace sanguine {
namespace {

struct Vector {
    double x, y, z;
};

/// A point on the unit circle (Marsaglia: rejection is cheaper than a sine and a cosine).
void sample_circle(PhotonRandom& random, double& cosine, double& sine) {
    double a, b, norm;
    do {
        a = 2 * random.uniform() - 1;
        b = 2 * random.uniform() - 1;
        norm = a * a + b * b;
    } while (norm > 1);
    norm = 1 / std::sqrt(norm);
    cosine = a * norm;
    sine = b * norm;
}

/// Henyey and Greenstein 1941, inverted as in Witt 1977; `d` is turned in place.
void scatter(Vector& d, double g, PhotonRandom& random) {
    double cos_theta = 2 * random.uniform() - 1;
    if (g != 0) {
        const double t = (1 - g * g) / (1 + g * cos_theta);
        cos_theta = (1 + g * g - t * t) / (2 * g);
    }
    const double sin_theta = std::sqrt(std::fmax(0.0, 1 - cos_theta * cos_theta));
    double cos_phi, sin_phi;
    sample_circle(random, cos_phi, sin_phi);

    // Orthonormal basis around d without a branch at the pole (Duff et al. 2017, JCGT 6(1)).
    const double sign = std::copysign(1.0, d.z);
    const double a = -1 / (sign + d.z), b = d.x * d.y * a;
    const double u = sin_theta * cos_phi, v = sin_theta * sin_phi;
    const Vector turned = {
        u * (1 + sign * d.x * d.x * a) + v * b + cos_theta * d.x,
        u * sign * b + v * (sign + d.y * d.y * a) + cos_theta * d.y,
        -u * sign * d.x - v * d.y + cos_theta * d.z,
    };
    // One Newton step keeps the length at 1 over thousands of turns.
    const double scale = 1.5 - 0.5 * (turned.x * turned.x + turned.y * turned.y + turned.z * turned.z);
    d = {turned.x * scale, turned.y * scale, turned.z * scale};
}

/// Direction after refraction from index n_i into n_t with the cosine that Fresnel's law gave.
void refract(Vector& d, double n_i, double n_t, double cos_t) {
    const double ratio = n_i / n_t;
    d = {d.x * ratio, d.y * ratio, std::copysign(cos_t, d.z)};
}

}  // namespace

PhotonEnd trace_photon(std::span<const Layer> stack, Incidence incidence, PhotonRandom& random) {
    PhotonEnd end{Fate::absorbed, false, 0.0, {}};

    Vector d{0, 0, 1};
    if (incidence == Incidence::diffuse) {
        d.z = std::sqrt(random.uniform());
        d.x = std::sqrt(1 - d.z * d.z);
    }
    double cos_t;
    if (random.uniform() < fresnel_dielectric(d.z, outside_index, stack[0].n, cos_t)) {
        end.fate = Fate::reflected_at_surface;
        return end;
    }
    refract(d, outside_index, stack[0].n, cos_t);

    // Absorption as an exponential clock: the photon dies when the absorption it has passed exceeds `life`.
    double life = -std::log(random.uniform());
    double x = 0, y = 0;
    std::size_t layer = 0;
    double depth = 0;  // below the top of the present layer
    for (;;) {
        double free_path = -std::log(random.uniform());  // optical, to the next scattering
        for (;;) {
            const Layer& here = stack[layer];
            const double to_face = d.z > 0 ? (here.thickness - depth) / d.z
                                 : d.z < 0 ? -depth / d.z : std::numeric_limits<double>::infinity();
            const double to_scatter =
                here.mu_s > 0 ? free_path / here.mu_s : std::numeric_limits<double>::infinity();
            const double step = std::fmin(to_face, to_scatter);
            if (std::isinf(step))
                return end;  // downwards for ever in a half-space that does not scatter
            x += d.x * step;
            y += d.y * step;
            depth += d.z * step;
            end.path[layer] += step;
            life -= here.mu_a * step;
            if (life < 0)
                return end;
            if (to_scatter <= to_face) {
                scatter(d, here.g, random);
                end.scattered = true;
                break;
            }
            free_path -= here.mu_s * step;

            const bool down = d.z > 0;
            const bool outermost = down ? layer + 1 == stack.size() : layer == 0;
            const double n_next = outermost ? outside_index : stack[down ? layer + 1 : layer - 1].n;
            depth = down ? here.thickness : 0;
            if (n_next != here.n) {
                if (random.uniform() < fresnel_dielectric(std::fabs(d.z), here.n, n_next, cos_t)) {
                    d.z = -d.z;
                    continue;
                }
                refract(d, here.n, n_next, cos_t);
            }
            if (outermost) {
                end.fate = down ? Fate::left_bottom : Fate::left_top;
                end.radius = std::hypot(x, y);
                return end;
            }
            layer += down ? 1 : -1;
            depth = down ? 0 : stack[layer].thickness;
        }
    }
}

}  // namespace sanguine
