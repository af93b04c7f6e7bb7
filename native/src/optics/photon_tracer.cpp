#include "sanguine/photon_tracer.hpp"

#include <cmath>
#include <limits>
#include <numbers>

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

/// Cosine of the angle of scattering by Henyey and Greenstein 1941, inverted as in Witt 1977, for `s` uniform in -1..1.
double scattering_cosine(double g, double s) {
    if (std::fabs(g) < 1e-3) {
        // The same multiplied out: the difference below cancels, and for |g| < 1e-16 left nothing but right angles.
        const double q = 1 / (1 + g * s);
        return (s + g * (0.5 * (3 + s * s) + g * (s - 0.5 * g * (1 - s * s)))) * q * q;
    }
    const double t = (1 - g * g) / (1 + g * s);
    return (1 + g * g - t * t) / (2 * g);
}

/// Turns `d` to (u, v, cos_theta) of a frame whose third axis it is.
void turn_to(Vector& d, double u, double v, double cos_theta) {
    // Orthonormal basis around d without a branch at the pole (Duff et al. 2017, JCGT 6(1)).
    const double sign = std::copysign(1.0, d.z);
    const double a = -1 / (sign + d.z), b = d.x * d.y * a;
    const Vector turned = {
        u * (1 + sign * d.x * d.x * a) + v * b + cos_theta * d.x,
        u * sign * b + v * (sign + d.y * d.y * a) + cos_theta * d.y,
        -u * sign * d.x - v * d.y + cos_theta * d.z,
    };
    // One Newton step keeps the length at 1 over thousands of turns.
    const double scale = 1.5 - 0.5 * (turned.x * turned.x + turned.y * turned.y + turned.z * turned.z);
    d = {turned.x * scale, turned.y * scale, turned.z * scale};
}

/// `d` is turned in place.
void scatter(Vector& d, double g, PhotonRandom& random) {
    const double cos_theta = scattering_cosine(g, 2 * random.uniform() - 1);
    const double sin_theta = std::sqrt(std::fmax(0.0, 1 - cos_theta * cos_theta));
    double cos_phi, sin_phi;
    sample_circle(random, cos_phi, sin_phi);

    turn_to(d, sin_theta * cos_phi, sin_theta * sin_phi, cos_theta);
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
                end.radius = std::sqrt(x * x + y * y);
                return end;
            }
            layer += down ? 1 : -1;
            depth = down ? 0 : stack[layer].thickness;
        }
    }
}

namespace {

/// max(0, x), which std::fmax would call the library for.
double positive(double x) {
    return x > 0 ? x : 0;
}

/// A point on the unit circle: an angle within pi / 4 by its Taylor series, exact to 1e-10, and one of four quadrants.
/// Without the branches of a rejection, which are mispredicted every fifth time, it runs beside what else a turn needs.
void sample_azimuth(PhotonRandom& random, double& cosine, double& sine) {
    const std::uint32_t bits = random.bits();
    const double y = (static_cast<std::int32_t>(bits) + 0.5) * (0x1p-31 * std::numbers::pi / 4), y2 = y * y;
    const double s = y * (1 - y2 / 6 * (1 - y2 / 20 * (1 - y2 / 42 * (1 - y2 / 72 * (1 - y2 / 110)))));
    const double c = 1 - y2 / 2 * (1 - y2 / 12 * (1 - y2 / 30 * (1 - y2 / 56 * (1 - y2 / 90))));
    // The last bits choose the quadrant; the angle is coarser than 2^-30 by them, and nobody sees it.
    const double first = bits & 1 ? s : c, second = bits & 1 ? c : s;
    cosine = bits & 2 ? -first : first;
    sine = bits & 2 ? second : -second;
}

/// `scatter` with that azimuth.
void turn(Vector& d, double g, PhotonRandom& random) {
    const double cos_theta = scattering_cosine(g, 2 * random.uniform() - 1);
    const double sin_theta = std::sqrt(positive(1 - cos_theta * cos_theta));
    double u, v;
    sample_azimuth(random, u, v);
    u *= sin_theta;
    v *= sin_theta;
    turn_to(d, u, v, cos_theta);
}

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Optical depth from which a ray counts as endless: what would pass is below the resolution of the random numbers.
constexpr double endless = 30;

/// -ln of the weight that a photon may lose before the clock runs. Time x variance of Rd over skin, opaque, low-albedo
/// and slab stacks: within 10 % of its least between 0.5 and 1 on all but thick absorbing tops, where 2 is twice as good;
/// 0 (analog) costs up to 1.5 times as much, 4 (nearly no roulette) twice.
constexpr double free_absorption = 1.0;

/// The rate of collisions in a layer. Counting absorption as collisions keeps low-albedo light near the surface, where
/// it can get out again (half the time x variance of continuous absorption on opaque skin); a layer that hardly scatters
/// but lets light through is better crossed with the weight taken on the way (a quarter). In between both are the same.
double collision_rate(const Layer& layer) {
    const double mu_t = layer.mu_a + layer.mu_s;
    const double optical_thickness = layer.mu_a * layer.thickness;  // NaN for a clear half-space
    if (layer.mu_s == 0)
        return 0;
    return optical_thickness < 5 ? std::fmin(mu_t, 5 * layer.mu_s) : mu_t;
}

}  // namespace

struct WeightedWalk::Ray {
    Vector d;
    double x = 0, y = 0, depth = 0;  // depth: below the top of the present layer
    double lost = 0;                 // absorption passed, -ln of the weight
    double limit = infinity;         // of `lost`: the clock's end
    double tau = 0;                  // optical depth of the last flight, up to its last face
    int layer = 0;
    std::uint32_t faces = 0;
};

WeightedWalk::WeightedWalk(std::span<const Layer> stack, Incidence incidence, std::uint32_t max_steps)
    : layers_(static_cast<int>(stack.size())), incidence_(incidence), max_steps_(max_steps),
      entering_(1 - surface_reflectance(stack[0].n, incidence)) {
    for (int i = 0; i < layers_; ++i) {
        const Layer& layer = stack[i];
        const double above = i > 0 ? stack[i - 1].n : outside_index;
        const double below = i + 1 < layers_ ? stack[i + 1].n : outside_index;
        const double mu_c = collision_rate(layer);
        media_[i] = {layer.thickness, mu_c, 1 / mu_c, std::fmax(0.0, layer.mu_a + layer.mu_s - mu_c),
                     mu_c > 0 ? std::log(mu_c) - std::log(layer.mu_s) : 0.0, layer.g, {layer.n / above, layer.n / below}};
    }
}

/// To the next collision, `optical_depth` away, or to the end of the ray.
WeightedWalk::Stop WeightedWalk::fly(Ray& ray, double optical_depth, PhotonRandom& random) const {
    ray.tau = 0;
    for (std::uint32_t crossed = 0; crossed < max_steps_; ++crossed) {
        const Medium& here = media_[ray.layer];
        Vector& d = ray.d;
        const double way = here.mu_c > 0 ? positive(optical_depth - ray.tau) * here.inverse_mu_c : infinity;
        const double there = ray.depth + d.z * way;
        if (there >= 0 && there < here.thickness) {
            ray.x += d.x * way;
            ray.y += d.y * way;
            ray.depth = there;
            ray.lost += here.absorption * way + here.loss;
            return ray.lost > ray.limit ? Stop::killed : Stop::collision;
        }

        const bool down = d.z > 0;
        const double to_face = down ? (here.thickness - ray.depth) / d.z : -ray.depth / d.z;
        if (!(to_face < infinity))
            return Stop::lost;  // along the layer, or down a half-space, for ever
        ray.x += d.x * to_face;
        ray.y += d.y * to_face;
        ray.tau += here.mu_c * to_face;
        ray.lost += here.absorption * to_face;
        ray.depth = down ? here.thickness : 0;
        ++ray.faces;
        if (ray.lost > ray.limit)
            return Stop::killed;

        const double ratio = here.ratio[down];
        if (ratio != 1) {
            const double cosine = std::fabs(d.z), sine2 = positive(1 - cosine * cosine);
            const double refracted2 = ratio * ratio * sine2;
            if (refracted2 >= 1) {
                d.z = -d.z;
                const double other = here.ratio[!down];
                if (other * other * sine2 >= 1 && here.thickness < infinity) {
                    // Held at both faces: unfold the reflections. The way to the collision ends at this depth below
                    // or above the face, modulo two thicknesses.
                    const double rest =
                        here.mu_c > 0 ? positive(optical_depth - ray.tau) * here.inverse_mu_c : infinity;
                    if (!(rest < infinity))
                        return here.absorption > 0 ? Stop::killed : Stop::capped;
                    ray.x += d.x * rest;
                    ray.y += d.y * rest;
                    ray.lost += here.absorption * rest + here.loss;
                    const double period = 2 * here.thickness, vertical = cosine * rest;
                    double from_face = vertical - period * std::floor(vertical / period);
                    if (!(from_face <= period))
                        from_face = 0;
                    if (from_face > here.thickness) {
                        from_face = period - from_face;
                        d.z = -d.z;
                    }
                    ray.depth = down ? here.thickness - from_face : from_face;
                    return ray.lost > ray.limit ? Stop::killed : Stop::collision;
                }
                continue;
            }
            // Fresnel's equations divided by the index beyond.
            const double cos_t = std::sqrt(1 - refracted2);
            const double parallel = (cosine - ratio * cos_t) / (cosine + ratio * cos_t);
            const double perpendicular = (ratio * cosine - cos_t) / (ratio * cosine + cos_t);
            if (2 * random.uniform() < parallel * parallel + perpendicular * perpendicular) {
                d.z = -d.z;
                continue;
            }
            d = {d.x * ratio, d.y * ratio, std::copysign(cos_t, d.z)};
        }
        ray.layer += down ? 1 : -1;
        if (ray.layer < 0)
            return Stop::top;
        if (ray.layer == layers_)
            return Stop::bottom;
        ray.depth = down ? 0 : media_[ray.layer].thickness;
    }
    return Stop::capped;
}

WeightedEnd WeightedWalk::trace(std::uint64_t seed, std::uint64_t photon) const {
    WeightedEnd end;
    PhotonRandom random(seed, photon);

    Ray ray;
    // Rejection draws the directions of what enters, so that all photons enter with one weight and their shares can never
    // add up to more than it.
    const double ratio = media_[0].ratio[0];
    double cosine = 1, cos_t = 1;
    double surface;
    do {
        if (incidence_ == Incidence::diffuse)
            cosine = std::sqrt(random.uniform());
        surface = fresnel_dielectric(cosine, outside_index, ratio, cos_t);
    } while (incidence_ == Incidence::diffuse && random.uniform() < surface);
    ray.d = {std::sqrt(1 - cosine * cosine), 0, cosine};
    refract(ray.d, outside_index, ratio, cos_t);
    double weight = entering_;

    // The ray without scattering. The choices at its faces have random numbers of their own, so that the ray can be
    // flown again up to the first collision while what follows knows nothing of how it would have ended.
    const PhotonRandom faces_random(~seed, photon);
    PhotonRandom first_random = faces_random;
    Ray first = ray;
    const Stop unscattered = fly(first, endless, first_random);
    end.faces = first.faces;
    double collides = 1;
    if (unscattered != Stop::collision) {
        const double through = weight * std::exp(-first.tau - first.lost);
        if (unscattered == Stop::top)
            end.unscattered_top = through;
        if (unscattered == Stop::bottom)
            end.unscattered_bottom = through;
        collides = -std::expm1(-first.tau);
        weight *= collides;
        if (weight == 0)
            return end;
    }
    first_random = faces_random;
    Stop stop = fly(ray, -std::log1p(-collides * random.uniform()), first_random);

    // The clock starts here: what the first flight lost is the same for all photons that get to a depth.
    const double spared = ray.lost + free_absorption;
    ray.limit = spared - std::log(random.uniform());
    while (stop == Stop::collision) {
        if (++end.collisions + ray.faces > max_steps_) {
            stop = Stop::capped;
            break;
        }
        turn(ray.d, media_[ray.layer].g, random);
        stop = fly(ray, -std::log(random.uniform()), random);
    }
    end.faces += ray.faces;
    if (end.collisions == 0)
        return end;  // the same ray again, which rounding kept from its collision
    switch (stop) {
    case Stop::top: end.exit = WeightedEnd::Exit::top; break;
    case Stop::bottom: end.exit = WeightedEnd::Exit::bottom; break;
    case Stop::capped: end.exit = WeightedEnd::Exit::cut; break;
    default: return end;
    }
    end.weight = weight * std::exp(-std::fmin(ray.lost, spared));
    end.radius_squared = ray.x * ray.x + ray.y * ray.y;
    return end;
}

}  // namespace sanguine
