#include "sanguine/inversion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>

#include "sanguine/chromophores.hpp"
#include "sanguine/fit.hpp"
#include "sanguine/skin.hpp"
#include "sanguine/surface.hpp"
#include "vector_math.hpp"

namespace sanguine {

using vector_math::cube_root;
using vector_math::exp_minus;

// ---- Priors

const std::array<InversionAxis, 3>& inversion_axes() {
    // The pigments as in fits of spectra. Oxygenation is held tighter than there, because three colours know less of it
    // than a spectrum: the range is that of measured faces.
    static const std::array<InversionAxis, 3> axes = [] {
        const auto row = [](std::string_view id) {
            for (const FitParameter& p : fit_parameters())
                if (p.id == id)
                    return p;
            throw std::logic_error("inversion_axes: no row in fit_parameters()");
        };
        const FitParameter m = row("melanin"), h = row("hemoglobin"), o = row("oxygenation");
        return std::array<InversionAxis, 3>{{
            {m.id, std::log(m.lower), std::log(m.upper), std::log(m.prior_mean), m.prior_sd, m.source},
            {h.id, std::log(h.lower), std::log(h.upper), std::log(h.prior_mean), h.prior_sd, h.source},
            {o.id, o.lower, o.upper, 0.75, 0.07,
             "medians of measured faces from light to tan 0.75-0.82 (docs/measured_skin.md), NIRS rSO2 of forehead and "
             "mandible 0.65-0.76"},
        }};
    }();
    return axes;
}

// ---- The tables

namespace {

using Vec = std::array<double, 3>;

constexpr int fine[3] = {65, 57, 9};     ///< nodes of the forward table over SkinPoint
constexpr int solved[3] = {27, 23, 7};   ///< nodes that are solved; cubics lie between
constexpr float f_bend = 6.0f / 29;      ///< where CIE's f goes from a line to the cube root

double axis_value(int axis, int node, int count) {
    const InversionAxis& a = inversion_axes()[axis];
    return std::lerp(a.lower, a.upper, node / (count - 1.0));
}

SkinParameters skin_at(SkinParameters skin, const Vec& point) {
    // exp(log(x)) may leave the schema's range by rounding.
    const auto limited = [](double SkinParameters::*field, double value) {
        for (const ParameterRow& row : parameter_rows)
            if (row.field == field)
                return std::clamp(value, row.hard_min, row.hard_max);
        return value;
    };
    skin.melanin = limited(&SkinParameters::melanin, std::exp(point[0]));
    skin.hemoglobin = limited(&SkinParameters::hemoglobin, std::exp(point[1]));
    skin.oxygenation = point[2];
    return skin;
}

/// Values at `count` even places from values at `solved` ones: cubics through the nearest four.
std::vector<double> refine(const std::vector<double>& values, int axis, const std::array<int, 3>& shape) {
    // [outer][along][inner] with inner the faster axes and the channel.
    std::size_t inner = 3, outer = 1;
    for (int k = 0; k < axis; ++k)
        inner *= shape[k];
    for (int k = axis + 1; k < 3; ++k)
        outer *= shape[k];
    const int from = shape[axis], to = fine[axis];
    std::vector<double> out(outer * to * inner);
    for (int i = 0; i < to; ++i) {
        const double at = double(i) * (from - 1) / (to - 1);
        const int first = std::clamp(int(at) - 1, 0, from - 4);
        double weight[4];
        for (int j = 0; j < 4; ++j) {
            weight[j] = 1;
            for (int k = 0; k < 4; ++k)
                if (k != j)
                    weight[j] *= (at - first - k) / (j - k);
        }
        for (std::size_t o = 0; o < outer; ++o)
            for (std::size_t c = 0; c < inner; ++c) {
                double sum = 0;
                for (int j = 0; j < 4; ++j)
                    sum += weight[j] * values[(o * from + first + j) * inner + c];
                out[(o * to + i) * inner + c] = sum;
            }
    }
    return out;
}

double cie_f(double t) {
    return t > 216.0 / 24389 ? std::cbrt(t) : t * (841.0 / 108) + 4.0 / 29;
}

/// [o][h][m][4]: f(X), f(Y), f(Z) of every node.
std::vector<float> forward_table(const SkinParameters& skin, int threads, const Progress& progress) {
    std::vector<double> nm(rgb_wavelength_count());
    for (std::size_t w = 0; w < nm.size(); ++w)
        nm[w] = std::lerp(min_wavelength_nm, max_wavelength_nm, double(w) / double(nm.size() - 1));
    const std::vector<Colour> weights = xyz_weights(nm);
    const Colour white = white_xyz();
    const double under_film = 1 - surface_reflectance(skin).film;

    std::vector<SkinParameters> skins;
    for (int o = 0; o < solved[2]; ++o)
        for (int h = 0; h < solved[1]; ++h)
            for (int m = 0; m < solved[0]; ++m)
                skins.push_back(skin_at(skin, {axis_value(0, m, solved[0]), axis_value(1, h, solved[1]),
                                               axis_value(2, o, solved[2])}));
    const std::vector<double> spectra = reflectance(skins, nm, threads, progress);
    std::vector<double> values(skins.size() * 3);
    for (std::size_t i = 0; i < skins.size(); ++i) {
        Colour xyz{};
        for (std::size_t w = 0; w < nm.size(); ++w)
            for (int c = 0; c < 3; ++c)
                xyz[c] += weights[w][c] * spectra[i * nm.size() + w];
        for (int c = 0; c < 3; ++c)
            values[i * 3 + c] = cie_f(under_film * xyz[c] / white[c]);
    }
    std::array<int, 3> shape{solved[0], solved[1], solved[2]};
    for (int axis = 0; axis < 3; ++axis) {
        values = refine(values, axis, shape);
        shape[axis] = fine[axis];
    }
    std::vector<float> out(values.size() / 3 * 4);
    for (std::size_t i = 0; i < values.size() / 3; ++i)
        for (int c = 0; c < 3; ++c)
            out[i * 4 + c] = float(values[i * 3 + c]);
    return out;
}

/// Factors from SkinPoint to nodes of the forward table.
struct ForwardScale {
    float begin[3], scale[3], last[3];
};
const ForwardScale& forward_scale() {
    static const ForwardScale s = [] {
        ForwardScale out;
        for (int k = 0; k < 3; ++k) {
            const InversionAxis& a = inversion_axes()[k];
            out.begin[k] = float(a.lower);
            out.scale[k] = float((fine[k] - 1) / (a.upper - a.lower));
            out.last[k] = std::nextafter(float(fine[k] - 1), 0.0f);
        }
        return out;
    }();
    return s;
}

SANGUINE_INLINE float limit(float x, float low, float high) {
    const float y = x > low ? x : low;  // also catches NaN
    return y < high ? y : high;
}

/// f of X, Y, Z at a point; between nodes linear in each axis.
SANGUINE_INLINE void forward_at(const float* table, const ForwardScale& s, float m, float h, float o, float* f) {
    const float x = limit((m - s.begin[0]) * s.scale[0], 0, s.last[0]);
    const float y = limit((h - s.begin[1]) * s.scale[1], 0, s.last[1]);
    const float z = limit((o - s.begin[2]) * s.scale[2], 0, s.last[2]);
    const int i = int(x), j = int(y), k = int(z);
    const float u = x - float(i), v = y - float(j), w = z - float(k);
    constexpr int right = 4, up = 4 * fine[0], over = 4 * fine[0] * fine[1];
    const float* p = table + i * right + j * up + k * over;
    for (int c = 0; c < 4; ++c) {
        const float a = p[c] + u * (p[c + right] - p[c]);
        const float b = p[c + up] + u * (p[c + up + right] - p[c + up]);
        const float d = p[c + over] + u * (p[c + over + right] - p[c + over]);
        const float e = p[c + over + up] + u * (p[c + over + up + right] - p[c + over + up]);
        const float ab = a + v * (b - a), de = d + v * (e - d);
        f[c] = ab + w * (de - ab);
    }
}

SANGUINE_INLINE void lab_of_f(float x, float y, float z, float& l, float& a, float& b) {
    l = 116 * y - 16;
    a = 500 * (x - y);
    b = 200 * (y - z);
}

/// The search for the estimate of one colour: damped Gauss-Newton within the bounds.
class Search {
public:
    /// Without shading the unknowns are those of SkinPoint. With it the third one is the ln of a factor on the light, and
    /// oxygenation stays at its prior.
    Search(const float* table, bool with_shading) : table_(table), with_shading_(with_shading) {
        for (int k = 0; k < 3; ++k) {
            const InversionAxis& a = inversion_axes()[k];
            lower_[k] = a.lower, upper_[k] = a.upper, mean_[k] = a.mean, sd_[k] = a.sd;
        }
        if (with_shading) {
            oxygenation_ = float(mean_[2]);
            // A stop of light either way is common, three are not: a guess that only ends the search.
            lower_[2] = -2.5, upper_[2] = 2.5, mean_[2] = 0, sd_[2] = 0.7;
        }
    }

    Vec lab(const Vec& u) const {
        float f[4];
        forward_at(table_, forward_scale(), float(u[0]), float(u[1]), with_shading_ ? oxygenation_ : float(u[2]), f);
        const double shade = with_shading_ ? std::exp(u[2] / 3) : 1;
        return {116 * shade * f[1] - 16, 500 * shade * (double(f[0]) - f[1]), 200 * shade * (double(f[1]) - f[2])};
    }

    double cost(const Vec& u, const Vec& seen, const Vec& target) const {
        double sum = 0;
        for (int k = 0; k < 3; ++k) {
            const double off = (seen[k] - target[k]) / inversion_model_sd, pull = (u[k] - mean_[k]) / sd_[k];
            sum += off * off + pull * pull;
        }
        return sum;
    }

    /// Moves `u` to the least cost near it, which is returned.
    double descend(Vec& u, const Vec& target) const {
        constexpr int max_steps = 30;
        Vec seen = lab(u);
        double now = cost(u, seen, target), damping = 1e-3;
        for (int step = 0; step < max_steps; ++step) {
            double by[3][3];  // [unknown][Lab]
            for (int k = 0; k < 3; ++k) {
                const double h = (upper_[k] - lower_[k]) / 160;
                Vec low = u, high = u;
                low[k] = std::max(u[k] - h, lower_[k]);
                high[k] = std::min(u[k] + h, upper_[k]);
                const Vec a = lab(low), b = lab(high);
                for (int c = 0; c < 3; ++c)
                    by[k][c] = (b[c] - a[c]) / (high[k] - low[k]);
            }
            constexpr double weight = 1 / (inversion_model_sd * inversion_model_sd);
            Matrix3 normal{};
            Colour down{};
            for (int k = 0; k < 3; ++k) {
                const double precision = 1 / (sd_[k] * sd_[k]);
                down[k] = (mean_[k] - u[k]) * precision;
                for (int c = 0; c < 3; ++c)
                    down[k] += by[k][c] * (target[c] - seen[c]) * weight;
                for (int j = 0; j < 3; ++j)
                    for (int c = 0; c < 3; ++c)
                        normal[k][j] += by[k][c] * by[j][c] * weight;
                normal[k][k] += precision;
            }
            // What stands at a bound and would leave does not move.
            for (int k = 0; k < 3; ++k)
                if ((u[k] <= lower_[k] && down[k] < 0) || (u[k] >= upper_[k] && down[k] > 0)) {
                    for (int j = 0; j < 3; ++j)
                        normal[k][j] = normal[j][k] = 0;
                    normal[k][k] = 1, down[k] = 0;
                }
            bool better = false;
            double moved = 0;
            for (; damping < 1e6; damping *= 8) {
                Matrix3 damped = normal;
                for (int k = 0; k < 3; ++k)
                    damped[k][k] *= 1 + damping;
                const Colour move = inverse(damped) * down;
                Vec next;
                moved = 0;
                for (int k = 0; k < 3; ++k) {
                    next[k] = std::clamp(u[k] + move[k], lower_[k], upper_[k]);
                    moved = std::max(moved, std::abs(next[k] - u[k]) / (upper_[k] - lower_[k]));
                }
                const Vec there = lab(next);
                const double then = cost(next, there, target);
                if (then < now) {
                    better = now - then > 1e-5 * now + 1e-6;  // a cost of 1 is a step of inversion_model_sd
                    u = next, seen = there, now = then;
                    damping = std::max(damping / 8, 1e-9);
                    break;
                }
            }
            if (!better || moved < 1e-6)
                break;
        }
        return now;
    }

    Vec mean() const { return mean_; }

private:
    const float* table_;
    bool with_shading_;
    float oxygenation_ = 0;
    Vec lower_, upper_, mean_, sd_;
};

/// Where searches begin: a coarse grid over the range of SkinPoint, and what it looks like.
struct Starts {
    static constexpr int count[3] = {9, 8, 3};
    std::vector<Vec> point, lab;

    explicit Starts(const Search& search) {
        for (int o = 0; o < count[2]; ++o)
            for (int h = 0; h < count[1]; ++h)
                for (int m = 0; m < count[0]; ++m) {
                    point.push_back({axis_value(0, m, count[0]), axis_value(1, h, count[1]), axis_value(2, o + 1, count[2] + 2)});
                    lab.push_back(search.lab(point.back()));
                }
    }

    /// The best two that are not neighbours along melanin.
    std::array<std::size_t, 2> best(const Search& search, const Vec& target) const {
        std::array<std::size_t, 2> out{};
        std::array<double, 2> cost{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
        for (std::size_t i = 0; i < point.size(); ++i) {
            const double c = search.cost(point[i], lab[i], target);
            if (c < cost[0])
                cost[0] = c, out[0] = i;
        }
        const auto melanin = [](std::size_t i) { return int(i % count[0]); };
        out[1] = out[0];
        for (std::size_t i = 0; i < point.size(); ++i)
            if (std::abs(melanin(i) - melanin(out[0])) > 1)
                if (const double c = search.cost(point[i], lab[i], target); c < cost[1])
                    cost[1] = c, out[1] = i;
        return out;
    }
};

std::array<std::array<float, 3>, 3> rounded(const Matrix3& m) {
    std::array<std::array<float, 3>, 3> out;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            out[i][j] = float(m[i][j]);
    return out;
}

}  // namespace

SkinInverse::SkinInverse(const SkinParameters& skin, const Matrix3& rgb_from_xyz, int nodes, int threads,
                         const Progress& progress)
    : skin_(skin), nodes_(nodes) {
    if (nodes < 5 || nodes > 129)
        throw std::invalid_argument("nodes: " + std::to_string(nodes) + " is outside 5 to 129");
    const Colour white = white_xyz();
    Matrix3 from = rgb_from_xyz, to = inverse(rgb_from_xyz);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            from[i][j] *= white[j] / 100;
            to[i][j] /= white[i] / 100;
        }
    rgb_from_xyz_ = rounded(from);
    xyz_from_rgb_ = rounded(to);

    forward_ = forward_table(skin, threads, progress);
    std::array<float, 3> low, high;
    low.fill(std::numeric_limits<float>::infinity());
    high.fill(-std::numeric_limits<float>::infinity());
    for (std::size_t i = 0; i < forward_.size(); i += 4) {
        std::array<float, 3> c;
        lab_of_f(forward_[i], forward_[i + 1], forward_[i + 2], c[0], c[1], c[2]);
        for (int k = 0; k < 3; ++k)
            low[k] = std::min(low[k], c[k]), high[k] = std::max(high[k], c[k]);
    }
    // Beyond the gamut an estimate is that of the nearest skin; a margin keeps its edge away from the table's.
    constexpr float margin = 4;
    for (int k = 0; k < 3; ++k) {
        lab_begin_[k] = low[k] - margin;
        lab_scale_[k] = float(nodes - 1) / (high[k] - low[k] + 2 * margin);
    }

    const Search search(forward_.data(), false);
    const Starts starts(search);
    inverse_.resize(std::size_t(nodes) * nodes * nodes * 4);
    parallel_for(std::size_t(nodes) * nodes, threads, progress, [&](std::size_t row) {
        Vec target{0, lab_begin_[1] + double(row % nodes) / lab_scale_[1], lab_begin_[2] + double(row / nodes) / lab_scale_[2]};
        Vec last = search.mean();
        for (int l = 0; l < nodes; ++l) {
            target[0] = lab_begin_[0] + double(l) / lab_scale_[0];
            Vec best = last;
            double least = search.descend(best, target);
            for (const std::size_t start : starts.best(search, target)) {
                Vec u = starts.point[start];
                if (const double cost = search.descend(u, target); cost < least)
                    least = cost, best = u;
            }
            last = best;
            for (int k = 0; k < 3; ++k)
                inverse_[(row * nodes + l) * 4 + k] = float(best[k]);
        }
    });
}

namespace {

/// What inverse_at() needs of a SkinInverse.
struct InverseTable {
    const float* table;
    float begin[3], scale[3], last;
    int right, up, over;
};

/// The estimate for a colour, [4].
SANGUINE_INLINE void inverse_at(const InverseTable& t, float l, float a, float b, float* out) {
    const float x = limit((l - t.begin[0]) * t.scale[0], 0, t.last);
    const float y = limit((a - t.begin[1]) * t.scale[1], 0, t.last);
    const float z = limit((b - t.begin[2]) * t.scale[2], 0, t.last);
    const int i = int(x), j = int(y), k = int(z);
    const float u = x - float(i), v = y - float(j), w = z - float(k);
    const float* p = t.table + i * t.right + j * t.up + k * t.over;
    for (int c = 0; c < 4; ++c) {
        const float e = p[c] + u * (p[c + t.right] - p[c]);
        const float f = p[c + t.up] + u * (p[c + t.up + t.right] - p[c + t.up]);
        const float g = p[c + t.over] + u * (p[c + t.over + t.right] - p[c + t.over]);
        const float h = p[c + t.over + t.up] + u * (p[c + t.over + t.up + t.right] - p[c + t.over + t.up]);
        const float ef = e + v * (f - e), gh = g + v * (h - g);
        out[c] = ef + w * (gh - ef);
    }
}

/// The same with its variance under noise of the colour, whose covariance has the Cholesky factor `noise`.
SANGUINE_INLINE void inverse_with_variance(const InverseTable& t, const std::array<std::array<float, 3>, 3>& noise,
                                           float l, float a, float b, float* out, float* variance) {
    const float x = limit((l - t.begin[0]) * t.scale[0], 0, t.last);
    const float y = limit((a - t.begin[1]) * t.scale[1], 0, t.last);
    const float z = limit((b - t.begin[2]) * t.scale[2], 0, t.last);
    const int i = int(x), j = int(y), k = int(z);
    const float u = x - float(i), v = y - float(j), w = z - float(k);
    const float* p = t.table + i * t.right + j * t.up + k * t.over;
    for (int c = 0; c < 4; ++c) {
        const float e0 = p[c], f0 = p[c + t.up], g0 = p[c + t.over], h0 = p[c + t.over + t.up];
        const float de = p[c + t.right] - e0, df = p[c + t.up + t.right] - f0;
        const float dg = p[c + t.over + t.right] - g0, dh = p[c + t.over + t.up + t.right] - h0;
        const float e = e0 + u * de, f = f0 + u * df, g = g0 + u * dg, h = h0 + u * dh;
        const float dy0 = f - e, dy1 = h - g;
        const float ef = e + v * dy0, gh = g + v * dy1;
        out[c] = ef + w * (gh - ef);
        // Slopes by L, a, b.
        const float dx0 = de + v * (df - de), dx1 = dg + v * (dh - dg);
        const float by_l = (dx0 + w * (dx1 - dx0)) * t.scale[0];
        const float by_a = (dy0 + w * (dy1 - dy0)) * t.scale[1];
        const float by_b = (gh - ef) * t.scale[2];
        const float n0 = noise[0][0] * by_l + noise[1][0] * by_a + noise[2][0] * by_b;
        const float n1 = noise[1][1] * by_a + noise[2][1] * by_b;
        const float n2 = noise[2][2] * by_b;
        variance[c] = n0 * n0 + n1 * n1 + n2 * n2;
    }
}

// ---- What is skin

/// The soft ends of what counts as this picture's skin.
struct MaskRule {
    float centre[2], above[2], below[2], above_near, above_patch, hair, error_free;
};

MaskRule mask_rule(const SkinPoint& centre, const SkinPoint& spread, double noise_sd) {
    // Freckles have up to four times the melanin of the skin around (features/freckles.cpp), lips 4.5 times its blood
    // (rigs/anatomy.toml): both have to pass. Hair has more melanin and no blood: together these tell it even where either
    // alone could be skin. Melanin is judged by what is near, because light and sun change slowly over a face; and by the mean
    // over a patch, because freckles are small and brows are not.
    MaskRule r;
    r.centre[0] = centre[0], r.centre[1] = centre[1];
    r.above[0] = std::clamp(3.5f * spread[0], 1.7f, 2.0f);
    r.below[0] = std::clamp(3 * spread[0], 1.0f, 1.6f);
    r.above[1] = std::clamp(3.5f * spread[1], 2.3f, 2.6f);
    r.below[1] = std::clamp(3.5f * spread[1], 1.4f, 1.8f);
    r.above_near = 1.5f;
    r.above_patch = 0.36f;
    r.hair = std::clamp(3.5f * std::sqrt(spread[0] * spread[0] + spread[1] * spread[1]), 1.5f, 1.7f);
    r.error_free = float(3 + 2 * noise_sd);
    return r;
}

/// Squared distance from skin, 0 for all that counts as skin.
SANGUINE_INLINE float distance_from_skin(const MaskRule& r, float m, float h, float m_near, float m_patch,
                                         float lab_error_squared) {
    const float dm = m - r.centre[0], dh = h - r.centre[1], dn = m - m_near;
    const auto beyond = [](float d, float end) { return d > end ? (d - end) * (1 / 0.35f) : 0.0f; };
    const float pm = beyond(dm, r.above[0]) + beyond(-dm, r.below[0]);
    const float ph = beyond(dh, r.above[1]) + beyond(-dh, r.below[1]);
    const float near = beyond(dn, r.above_near);
    const float patch = dn > 0.4f ? 1.5f * beyond(m_patch - m_near, r.above_patch) : 0.0f;
    const float hair = dn > 0.4f ? beyond(dn - dh, r.hair) : 0.0f;
    const float e = std::sqrt(lab_error_squared) - r.error_free;
    const float pe = e > 0 ? e * (1.0f / 3) : 0.0f;
    return pm * pm + ph * ph + near * near + patch * patch + hair * hair + pe * pe;
}

// ---- Colour difference

/// CIEDE2000, equation numbers of Sharma et al. 2005. The hue enters by its cosine and sine; only the turn of blues needs
/// the angle.
SANGUINE_INLINE float difference(float l1, float a1, float b1, float l2, float a2, float b2) {
    const auto power7 = [](float x) { const float x2 = x * x; return x2 * x2 * x2 * x; };
    constexpr float pale = 6103515625.0f;  // 25^7
    const float mean_chroma = 0.5f * (std::sqrt(a1 * a1 + b1 * b1) + std::sqrt(a2 * a2 + b2 * b2));
    const float seventh = power7(mean_chroma);
    const float stretch = 1.5f - 0.5f * std::sqrt(seventh / (seventh + pale));  // Eq. 4, 5
    const float p1 = a1 * stretch, p2 = a2 * stretch;
    const float c1 = std::sqrt(p1 * p1 + b1 * b1), c2 = std::sqrt(p2 * p2 + b2 * b2);
    const float r1 = 1 / (c1 > 1e-6f ? c1 : 1e-6f), r2 = 1 / (c2 > 1e-6f ? c2 : 1e-6f);
    const float u1 = p1 * r1, v1 = b1 * r1, u2 = p2 * r2, v2 = b2 * r2;

    // 2 sin(turn / 2) is the chord between the two directions; its sign that of the cross product. Eq. 10, 11.
    const float du = u2 - u1, dv = v2 - v1;
    const float chord = std::sqrt(du * du + dv * dv);
    const float side = u1 * v2 - v1 * u2 < 0 ? -chord : chord;
    const float dh = std::sqrt(c1 * c2) * side;

    const float su = u1 + u2, sv = v1 + v2, norm = std::sqrt(su * su + sv * sv);
    const float inverse_norm = 1 / (norm > 1e-6f ? norm : 1e-6f);
    const float c = su * inverse_norm, s = sv * inverse_norm;  // of the mean hue, Eq. 14
    const float cc = c * c - s * s, ss = 2 * s * c;
    const float c3 = cc * c - ss * s, s3 = ss * c + cc * s;
    const float c4 = cc * cc - ss * ss, s4 = 2 * ss * cc;
    const float t = 1 - 0.17f * (c * 0.866025404f + s * 0.5f) + 0.24f * cc
                    + 0.32f * (c3 * 0.994521895f - s3 * 0.104528463f)
                    - 0.20f * (c4 * 0.453990500f + s4 * 0.891006524f);  // Eq. 15

    // The angle by a polynomial of Hastings 1955 (sheet 11), 1e-5 rad.
    const float ax = std::abs(c), ay = std::abs(s);
    const float big = ax > ay ? ax : ay, small = ax > ay ? ay : ax;
    const float q = small / (big > 1e-6f ? big : 1e-6f), q2 = q * q;
    float angle = q * (0.99986601f + q2 * (-0.3302995f + q2 * (0.180141f + q2 * (-0.085133f + q2 * 0.0208351f))));
    angle = ay > ax ? 1.57079633f - angle : angle;
    angle = c < 0 ? 3.14159265f - angle : angle;
    angle = s < 0 ? 6.28318531f - angle : angle;
    const float turn = (angle * 57.2957795f - 275) * 0.04f;
    const float blue = 1.04719755f * exp_minus(turn * turn);  // Eq. 16, twice, in rad
    const float y2 = blue * blue;
    const float sine = blue * (1 + y2 * (-1.0f / 6 + y2 * (1.0f / 120 + y2 * (-1.0f / 5040 + y2 * (1.0f / 362880)))));

    const float l = 0.5f * (l1 + l2) - 50, chroma = 0.5f * (c1 + c2);
    const float chroma7 = power7(chroma);
    const float s_l = 1 + 0.015f * l * l / std::sqrt(20 + l * l);                      // Eq. 18
    const float s_c = 1 + 0.045f * chroma, s_h = 1 + 0.015f * chroma * t;              // Eq. 19, 20
    const float r_t = -2 * std::sqrt(chroma7 / (chroma7 + pale)) * sine;               // Eq. 17, 21
    const float x = (l2 - l1) / s_l, y = (c2 - c1) / s_c, z = dh / s_h;
    const float squared = x * x + y * y + z * z + r_t * y * z;                         // Eq. 22
    return std::sqrt(squared > 0 ? squared : 0.0f);
}

SANGUINE_VECTOR_CLONES
void differences(std::size_t count, const float* __restrict l1, const float* __restrict a1, const float* __restrict b1,
                 const float* __restrict l2, const float* __restrict a2, const float* __restrict b2, float* __restrict out) {
    for (std::size_t i = 0; i < count; ++i)
        out[i] = difference(l1[i], a1[i], b1[i], l2[i], a2[i], b2[i]);
}

// ---- Colours of rows

/// IEC 61966-2-1, for values up to 16.
SANGUINE_INLINE float decoded(float v) {
    const float y = (v + 0.055f) * (1 / 1.055f / 16);
    const float power = exp_minus(-2.4f * vector_math::logarithm(limit(y, 1e-4f, 1))) * 776.046882f;  // 16^2.4
    return v <= 0.04045f ? v * (1 / 12.92f) : power;
}

SANGUINE_VECTOR_CLONES
void decode_rows(int n, float* __restrict r, float* __restrict g, float* __restrict b) {
    for (int i = 0; i < n; ++i)
        r[i] = decoded(r[i]);
    for (int i = 0; i < n; ++i)
        g[i] = decoded(g[i]);
    for (int i = 0; i < n; ++i)
        b[i] = decoded(b[i]);
}

SANGUINE_INLINE float lab_f(float t) {
    return t > 216.0f / 24389 ? cube_root(t > 0 ? t : 0) : t * (841.0f / 108) + 4.0f / 29;
}

SANGUINE_INLINE float lab_f_inverse(float f) {
    return f > f_bend ? f * f * f : (f - 4.0f / 29) * (108.0f / 841);
}

using Matrix3f = std::array<std::array<float, 3>, 3>;

SANGUINE_VECTOR_CLONES
void to_lab(int n, const Matrix3f& m, const float* __restrict r, const float* __restrict g, const float* __restrict b,
            float* __restrict l, float* __restrict a, float* __restrict bb) {
    const float m00 = m[0][0], m01 = m[0][1], m02 = m[0][2], m10 = m[1][0], m11 = m[1][1], m12 = m[1][2];
    const float m20 = m[2][0], m21 = m[2][1], m22 = m[2][2];
    for (int i = 0; i < n; ++i) {
        const float x = lab_f(m00 * r[i] + m01 * g[i] + m02 * b[i]);
        const float y = lab_f(m10 * r[i] + m11 * g[i] + m12 * b[i]);
        const float z = lab_f(m20 * r[i] + m21 * g[i] + m22 * b[i]);
        lab_of_f(x, y, z, l[i], a[i], bb[i]);
    }
}

/// A small picture read at texels of a large one: bilinear between the centres of cells.
struct Upsampler {
    std::vector<int> left;
    std::vector<float> fraction;
    int columns, rows, cell;

    Upsampler(const PictureModel& m, int first, int count) : left(count), fraction(count), columns(m.columns), rows(m.rows), cell(m.cell) {
        for (int i = 0; i < count; ++i)
            place(std::clamp(first + i, 0, m.width - 1), columns, left[i], fraction[i]);
    }
    void place(int texel, int cells, int& at, float& part) const {
        const float x = limit((float(texel) + 0.5f) / float(cell) - 0.5f, 0, float(cells - 1));
        at = std::min(int(x), std::max(cells - 2, 0));
        part = x - float(at);
    }
    /// Row `y` of `values` [row][column][stride], channel `c`.
    void read(const std::vector<float>& values, int stride, int c, int y, float* out) const {
        int row;
        float v;
        place(y, rows, row, v);
        const float* low = values.data() + (std::size_t(row) * columns) * stride + c;
        const float* high = low + (rows > 1 ? columns * stride : 0);
        const int right = columns > 1 ? stride : 0;
        for (std::size_t i = 0; i < left.size(); ++i) {
            const int x = left[i] * stride;
            const float a = low[x] + fraction[i] * (low[x + right] - low[x]);
            const float b = high[x] + fraction[i] * (high[x + right] - high[x]);
            out[i] = a + v * (b - a);
        }
    }
};

}  // namespace

void delta_e_2000_fast(std::size_t count, const float* lab_1, const float* lab_2, float* out) {
    differences(count, lab_1, lab_1 + count, lab_1 + 2 * count, lab_2, lab_2 + count, lab_2 + 2 * count, out);
}

struct InversionKernel {
    static InverseTable table(const SkinInverse& s) {
        const int n = s.nodes_;
        InverseTable t{s.inverse_.data(), {}, {}, std::nextafter(float(n - 1), 0.0f), 4, 4 * n, 4 * n * n};
        for (int k = 0; k < 3; ++k)
            t.begin[k] = s.lab_begin_[k], t.scale[k] = s.lab_scale_[k];
        return t;
    }
    static const float* forward(const SkinInverse& s) { return s.forward_.data(); }
    static const Matrix3f& xyz_from_rgb(const SkinInverse& s) { return s.xyz_from_rgb_; }
    static const Matrix3f& rgb_from_xyz(const SkinInverse& s) { return s.rgb_from_xyz_; }

    static std::vector<PictureModel> models(const SkinInverse&, std::span<const PictureOverview* const>,
                                            const InversionOptions&, int threads);
};

std::array<std::array<float, 3>, 2> SkinInverse::lab_range() const {
    std::array<std::array<float, 3>, 2> out{lab_begin_, lab_begin_};
    for (int k = 0; k < 3; ++k)
        out[1][k] += float(nodes_ - 1) / lab_scale_[k];
    return out;
}

std::array<float, 3> SkinInverse::lab(const SkinPoint& p) const {
    float f[4];
    forward_at(forward_.data(), forward_scale(), p[0], p[1], p[2], f);
    std::array<float, 3> out;
    lab_of_f(f[0], f[1], f[2], out[0], out[1], out[2]);
    return out;
}

SkinPoint SkinInverse::point(const std::array<float, 3>& lab) const {
    float out[4];
    inverse_at(InversionKernel::table(*this), lab[0], lab[1], lab[2], out);
    return {out[0], out[1], out[2]};
}

std::array<float, 3> SkinInverse::lab_of_rgb(const std::array<float, 3>& rgb) const {
    std::array<float, 3> c, out;
    for (int k = 0; k < 3; ++k)
        c[k] = std::max(rgb[k], 0.0f);
    to_lab(1, xyz_from_rgb_, &c[0], &c[1], &c[2], &out[0], &out[1], &out[2]);
    return out;
}

std::array<float, 3> SkinInverse::rgb_of_lab(const std::array<float, 3>& lab) const {
    const float y = (lab[0] + 16) / 116;
    const float xyz[3] = {lab_f_inverse(y + lab[1] / 500), lab_f_inverse(y), lab_f_inverse(y - lab[2] / 200)};
    std::array<float, 3> out;
    for (int k = 0; k < 3; ++k)
        out[k] = rgb_from_xyz_[k][0] * xyz[0] + rgb_from_xyz_[k][1] * xyz[1] + rgb_from_xyz_[k][2] * xyz[2];
    return out;
}

// ---- The overview

namespace {
constexpr int overview_side = 256;
constexpr int sample_side = 128;
constexpr int noise_window = 7;
constexpr double sum_unit = 1 << 24;  ///< of the sums over a cell
constexpr double sum_limit = 1e7;     ///< of one row of a cell: 65536 rows of it fit into the integers
}  // namespace

PictureOverview::PictureOverview(int width, int height) : width_(width), height_(height) {
    if (width < 1 || height < 1)
        throw std::invalid_argument("picture: " + std::to_string(width) + " x " + std::to_string(height) + " texels: empty");
    const int side = std::max(width, height);
    cell_ = (side + overview_side - 1) / overview_side;
    columns_ = (width + cell_ - 1) / cell_;
    rows_ = (height + cell_ - 1) / cell_;
    added_.assign(height, 0);
    sums_.resize(std::size_t(columns_) * rows_ * 4);
    step_x_ = std::max(noise_window, width / sample_side);
    step_y_ = std::max(noise_window, height / sample_side);
    sample_columns_ = width / step_x_;
    sample_rows_ = height / step_y_;
    samples_.assign(std::size_t(sample_rows_) * sample_columns_ * noise_window * noise_window * 3, std::numeric_limits<float>::quiet_NaN());
}

void PictureOverview::add(const PictureRows& in, int threads) {
    const int last = in.first + in.count, channels = in.channels;
    const auto rows = [&] { return "rows " + std::to_string(in.first) + " to " + std::to_string(last); };
    if (in.width != width_ || in.first < 0 || in.count < 0 || last > height_)
        throw std::invalid_argument(rows() + " of " + std::to_string(in.width) + " texels: not of a picture of "
                                    + std::to_string(width_) + " x " + std::to_string(height_));
    if (std::find(added_.begin() + in.first, added_.begin() + last, 1) != added_.begin() + last)
        throw std::invalid_argument(rows() + ": not all are new");
    std::fill(added_.begin() + in.first, added_.begin() + last, 1);
    srgb_ = in.srgb;
    const int first_cell = in.first / cell_, cells = in.count == 0 ? 0 : (last - 1) / cell_ - first_cell + 1;
    parallel_for(std::size_t(cells), threads, {}, [&](std::size_t k) {
        const int row = first_cell + int(k);
        std::vector<float> planes(std::size_t(width_) * 4);
        float *r = planes.data(), *g = r + width_, *b = g + width_, *alpha = b + width_;
        for (int y = std::max(in.first, row * cell_); y < std::min(last, (row + 1) * cell_); ++y) {
            const float* texel = in.pixels + std::size_t(y - in.first) * width_ * channels;
            for (int x = 0; x < width_; ++x, texel += channels) {
                const float there = (texel[0] + texel[1] + texel[2]) * 0;  // NaN if one of them is not finite
                const float a = channels == 4 ? limit(texel[3], 0, 1) : 1.0f;
                r[x] = texel[0] > 0 ? texel[0] : 0;
                g[x] = texel[1] > 0 ? texel[1] : 0;
                b[x] = texel[2] > 0 ? texel[2] : 0;
                alpha[x] = there == 0 ? a : 0;
                if (alpha[x] == 0)
                    r[x] = g[x] = b[x] = 0;
            }
            if (in.srgb)
                decode_rows(width_, r, g, b);
            for (int column = 0; column < columns_; ++column) {
                double sum[4] = {};  // of one row; rows are added up as integers, in whatever order they come
                for (int x = column * cell_; x < std::min(width_, (column + 1) * cell_); ++x) {
                    sum[0] += double(alpha[x]) * r[x];
                    sum[1] += double(alpha[x]) * g[x];
                    sum[2] += double(alpha[x]) * b[x];
                    sum[3] += alpha[x];
                }
                for (int c = 0; c < 4; ++c)
                    sums_[(std::size_t(row) * columns_ + column) * 4 + c] += std::llround(std::min(sum[c], sum_limit) * sum_unit);
            }
            const int sample = y / step_y_, within = y % step_y_;
            if (within < noise_window && sample < sample_rows_)
                for (int s = 0; s < sample_columns_; ++s)
                    for (int x = 0; x < noise_window; ++x) {
                        const std::size_t line = std::size_t(sample) * noise_window + within;
                        float* out = &samples_[((line * sample_columns_ + s) * noise_window + x) * 3];
                        const int at = s * step_x_ + x;
                        if (at < width_ && alpha[at] > 0.5f) {
                            out[0] = cube_root(r[at]);
                            out[1] = cube_root(g[at]);
                            out[2] = cube_root(b[at]);
                        }
                    }
        }
    });
}

// ---- The model of a picture

namespace {

float median_of(std::vector<float>& values) {
    const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

/// Cells of one overview while it is looked at.
struct Cells {
    std::vector<std::array<float, 3>> rgb;  ///< mean of the texels that are there
    std::vector<float> there;               ///< share of the cell
    std::vector<SkinPoint> point;
    std::vector<float> error, mask;         ///< squared distance in Lab; probability of skin
    std::vector<float> near;                ///< [2]: ln melanin of the skin around, and of the patch around
    std::vector<float> shade, sure;         ///< ln of the light, and how sure
};

/// Sums over 2 reach + 1 neighbours of `count` values that lie `stride` apart.
void box_sums(double* values, int count, std::size_t stride, int reach, std::vector<double>& line) {
    line.resize(count + 1);
    line[0] = 0;
    for (int i = 0; i < count; ++i)
        line[i + 1] = line[i] + values[i * stride];
    for (int i = 0; i < count; ++i)
        values[i * stride] = line[std::min(i + reach + 1, count)] - line[std::max(i - reach, 0)];
}

/// Nearly Gaussian means (three boxes), each texel with its weight; `base` pulls to 0 where little weight is near.
std::vector<float> low_pass(const std::vector<float>& values, const std::vector<float>& weights, int columns, int rows,
                            double sigma, double base) {
    const int reach = std::max(1, int(std::lround((std::sqrt(4 * sigma * sigma + 1) - 1) / 2)));
    const std::size_t count = values.size();
    std::vector<double> top(count), bottom(weights.begin(), weights.end()), line;
    for (std::size_t i = 0; i < count; ++i)
        top[i] = double(weights[i]) * values[i];
    for (std::vector<double>* plane : {&top, &bottom})
        for (int pass = 0; pass < 3; ++pass) {
            for (int y = 0; y < rows; ++y)
                box_sums(plane->data() + std::size_t(y) * columns, columns, 1, reach, line);
            for (int x = 0; x < columns; ++x)
                box_sums(plane->data() + x, rows, columns, reach, line);
        }
    const double largest = std::max(*std::max_element(bottom.begin(), bottom.end()), 1e-30);
    std::vector<float> out(count);
    for (std::size_t i = 0; i < count; ++i)
        out[i] = float(top[i] / (std::max(bottom[i], 0.0) + base * largest));
    return out;
}

/// Points of cells without weight from those around: push and pull over halved pictures (Gortler et al. 1996, The
/// Lumigraph, Section 3.4). `otherwise` if no cell has weight.
std::vector<float> filled(const std::vector<SkinPoint>& point, const std::vector<float>& weight, int columns, int rows,
                          const SkinPoint& otherwise) {
    struct Level {
        int columns, rows;
        std::vector<double> sum;  ///< [cell][4]: weight times the point, weight up to 1
    };
    std::vector<Level> levels{{columns, rows, std::vector<double>(point.size() * 4)}};
    for (std::size_t i = 0; i < point.size(); ++i) {
        for (int c = 0; c < 3; ++c)
            levels[0].sum[i * 4 + c] = double(weight[i]) * point[i][c];
        levels[0].sum[i * 4 + 3] = weight[i];
    }
    while (levels.back().columns > 1 || levels.back().rows > 1) {
        const Level& from = levels.back();
        Level to{(from.columns + 1) / 2, (from.rows + 1) / 2, {}};
        to.sum.resize(std::size_t(to.columns) * to.rows * 4);
        for (int y = 0; y < from.rows; ++y)
            for (int x = 0; x < from.columns; ++x)
                for (int c = 0; c < 4; ++c)
                    to.sum[(std::size_t(y / 2) * to.columns + x / 2) * 4 + c] += from.sum[(std::size_t(y) * from.columns + x) * 4 + c];
        for (std::size_t i = 0; i < to.sum.size(); i += 4)
            if (to.sum[i + 3] > 1) {
                for (int c = 0; c < 3; ++c)
                    to.sum[i + c] /= to.sum[i + 3];
                to.sum[i + 3] = 1;
            }
        levels.push_back(std::move(to));
    }
    Level& top = levels.back();
    if (top.sum[3] < 1) {
        for (int c = 0; c < 3; ++c)
            top.sum[c] += (1 - top.sum[3]) * otherwise[c];
        top.sum[3] = 1;
    }
    for (std::size_t l = levels.size() - 1; l-- > 0;) {
        const Level& from = levels[l + 1];
        Level& to = levels[l];
        for (int y = 0; y < to.rows; ++y)
            for (int x = 0; x < to.columns; ++x) {
                double* cell = &to.sum[(std::size_t(y) * to.columns + x) * 4];
                // Bilinear: three quarters of the own parent, a quarter of the nearer neighbour.
                const int px = x / 2, py = y / 2;
                const int nx = std::clamp(x % 2 ? px + 1 : px - 1, 0, from.columns - 1);
                const int ny = std::clamp(y % 2 ? py + 1 : py - 1, 0, from.rows - 1);
                for (int c = 0; c < 3; ++c) {
                    const auto at = [&](int i, int j) { return from.sum[(std::size_t(j) * from.columns + i) * 4 + c]; };
                    const double coarse = 0.75 * (0.75 * at(px, py) + 0.25 * at(nx, py)) + 0.25 * (0.75 * at(px, ny) + 0.25 * at(nx, ny));
                    cell[c] += (1 - cell[3]) * coarse;
                }
                cell[3] = 1;
            }
    }
    std::vector<float> out(point.size() * 3);
    for (std::size_t i = 0; i < point.size(); ++i)
        for (int c = 0; c < 3; ++c)
            out[i * 3 + c] = float(levels[0].sum[i * 4 + c]);
    return out;
}

}  // namespace

std::vector<PictureModel> InversionKernel::models(const SkinInverse& inverse, std::span<const PictureOverview* const> overviews,
                                                  const InversionOptions& options, int threads) {
    const auto& axes = inversion_axes();
    const SkinPoint usual{float(axes[0].mean), float(axes[1].mean), float(axes[2].mean)};
    std::vector<Cells> cells(overviews.size());
    for (std::size_t t = 0; t < overviews.size(); ++t) {
        const PictureOverview& o = *overviews[t];
        if (const auto missing = std::find(o.added_.begin(), o.added_.end(), 0); missing != o.added_.end())
            throw std::invalid_argument("overview: row " + std::to_string(missing - o.added_.begin()) + " of "
                                        + std::to_string(o.height_) + " was not added");
        const std::size_t count = std::size_t(o.columns_) * o.rows_;
        cells[t].rgb.assign(count, {});
        cells[t].there.resize(count);
        cells[t].shade.assign(count, 0);
        cells[t].near.assign(2 * count, usual[0]);
        for (std::size_t i = 0; i < count; ++i) {
            const int x = int(i % o.columns_) * o.cell_, y = int(i / o.columns_) * o.cell_;
            const double area = double(std::min(o.cell_, o.width_ - x)) * std::min(o.cell_, o.height_ - y);
            const double alpha = double(o.sums_[i * 4 + 3]) / sum_unit;
            cells[t].there[i] = float(alpha / area);
            if (alpha > 0)
                for (int c = 0; c < 3; ++c)
                    cells[t].rgb[i][c] = float(std::min(double(o.sums_[i * 4 + c]) / sum_unit / alpha, 1e4));
        }
    }

    // Estimates of all cells, what is skin among them, and how the skin is distributed; each helps the others. With
    // `lit` the light on each cell is free and oxygenation stays at its prior: what lies outside the skin gamut by its
    // brightness alone is skin all the same.
    SkinPoint centre = usual, spread{0.5f, 0.5f, 0.1f};
    double skin_share = 0;
    bool first_look = true;
    // A share of the longer side: broader than a brow or a lip is high. A guess.
    const auto low_pass_sigma = [](const PictureOverview& o) { return std::max(1.0, 0.07 * std::max(o.columns_, o.rows_)); };
    constexpr double patch_share = 0.012;  // broader than freckles, narrower than a brow is long: a guess
    const Search lit_search(inverse.forward_.data(), true);
    const auto look = [&](double noise_sd, bool lit) {
        for (std::size_t t = 0; t < cells.size(); ++t) {
            Cells& c = cells[t];
            c.point.assign(c.rgb.size(), usual);
            c.error.assign(c.rgb.size(), 0);
            c.mask.assign(c.rgb.size(), 0);
            const std::size_t columns = overviews[t]->columns_;
            parallel_for(std::size_t(overviews[t]->rows_), threads, {}, [&](std::size_t y) {
                for (std::size_t i = y * columns; i < (y + 1) * columns; ++i) {
                    if (c.there[i] == 0)
                        continue;
                    std::array<float, 3> rgb = c.rgb[i];
                    std::array<double, 3> back;
                    if (!lit)
                        for (float& v : rgb)
                            v /= std::exp(c.shade[i]);
                    const std::array<float, 3> seen = inverse.lab_of_rgb(rgb);
                    const SkinPoint p = inverse.point(seen);
                    if (lit) {
                        Vec u{p[0], p[1], 0};
                        const Vec target{seen[0], seen[1], seen[2]};
                        // From elsewhere too where the colour is hard to explain.
                        if (const double cost = lit_search.descend(u, target); cost > 10) {
                            Vec other = lit_search.mean();
                            if (lit_search.descend(other, target) < cost)
                                u = other;
                        }
                        c.point[i] = {float(u[0]), float(u[1]), usual[2]};
                        c.shade[i] = float(u[2]);
                        back = lit_search.lab(u);
                    } else {
                        c.point[i] = p;
                        const std::array<float, 3> look_of = inverse.lab(p);
                        back = {look_of[0], look_of[1], look_of[2]};
                    }
                    for (int k = 0; k < 3; ++k)
                        c.error[i] += float((seen[k] - back[k]) * (seen[k] - back[k]));
                }
            });
        }
        for (int round = 0; round < 4; ++round) {
            MaskRule rule = mask_rule(centre, spread, noise_sd);
            if (first_look) {
                // At first every colour that skin can have by the priors; hair and wood have no blood.
                for (int k = 0; k < 2; ++k) {
                    rule.centre[k] = usual[k];
                    rule.above[k] = rule.below[k] = 2 * float(axes[k].sd);
                }
                rule.above_near = rule.above_patch = rule.hair = 4;
                first_look = false;
            }
            std::vector<float> values[3];
            double there = 0;
            for (Cells& c : cells)
                for (std::size_t i = 0; i < c.rgb.size(); ++i) {
                    there += c.there[i];
                    const float far = distance_from_skin(rule, c.point[i][0], c.point[i][1], c.near[2 * i], c.near[2 * i + 1], c.error[i]);
                    c.mask[i] = exp_minus(0.5f * far) * c.there[i];
                    if (c.mask[i] > 0.5f)
                        for (int k = 0; k < 3; ++k)
                            values[k].push_back(c.point[i][k]);
                }
            skin_share = there > 0 ? double(values[0].size()) / there : 0;
            if (values[0].empty()) {
                centre = usual;
                break;
            }
            for (int k = 0; k < 3; ++k) {
                centre[k] = median_of(values[k]);
                for (float& v : values[k])
                    v = std::abs(v - centre[k]);
                spread[k] = std::clamp(1.4826f * median_of(values[k]), 0.01f, k == 2 ? 0.1f : 0.5f);
            }
            for (std::size_t t = 0; t < cells.size(); ++t) {
                Cells& c = cells[t];
                const PictureOverview& o = *overviews[t];
                std::vector<float> melanin(c.rgb.size()), weight(c.rgb.size());
                for (std::size_t i = 0; i < c.rgb.size(); ++i) {
                    melanin[i] = c.point[i][0] - centre[0];
                    weight[i] = c.mask[i] * c.mask[i];
                }
                const std::vector<float> near = low_pass(melanin, weight, o.columns_, o.rows_, low_pass_sigma(o), 0.003);
                const double patch_sigma = std::max(0.5, patch_share * std::max(o.columns_, o.rows_));
                const std::vector<float> patch = low_pass(melanin, c.there, o.columns_, o.rows_, patch_sigma, 0.003);
                for (std::size_t i = 0; i < near.size(); ++i) {
                    c.near[2 * i] = near[i] + centre[0];
                    c.near[2 * i + 1] = patch[i] + centre[0];
                }
            }
        }
    };
    const bool wants_shading = options.shading != Shading::off;
    look(0, wants_shading);

    // Noise: what changes from texel to texel in the one direction of colour that neither melanin nor blood moves, taken
    // as equal in all directions of the cube roots of RGB. Pores and freckles are not in it.
    std::array<std::array<double, 3>, 3> by_point{}, lab_by_root{};
    const auto root_of = [&](const SkinPoint& p) {
        std::array<float, 3> rgb = inverse.rgb_of_lab(inverse.lab(p));
        for (float& v : rgb)
            v = std::cbrt(std::max(v, 1e-5f));
        return rgb;
    };
    const std::array<float, 3> root = root_of(centre);
    for (int k = 0; k < 2; ++k) {
        SkinPoint low = centre, high = centre;
        low[k] -= 0.1f, high[k] += 0.1f;
        const auto a = root_of(low), b = root_of(high);
        for (int c = 0; c < 3; ++c)
            by_point[k][c] = double(b[c]) - a[c];
    }
    for (int c = 0; c < 3; ++c) {
        std::array<float, 3> low = root, high = root;
        low[c] -= 0.005f, high[c] += 0.005f;
        for (auto* v : {&low, &high})
            for (float& x : *v)
                x = x * x * x;
        const auto a = inverse.lab_of_rgb(low), b = inverse.lab_of_rgb(high);
        for (int k = 0; k < 3; ++k)
            lab_by_root[k][c] = (double(b[k]) - a[k]) / 0.01;
    }
    Vec normal;
    double length = 0;
    for (int c = 0; c < 3; ++c) {
        const int d = (c + 1) % 3, e = (c + 2) % 3;
        normal[c] = by_point[0][d] * by_point[1][e] - by_point[0][e] * by_point[1][d];
        length += normal[c] * normal[c];
    }
    for (double& v : normal)
        v /= std::sqrt(std::max(length, 1e-30));

    double sd = 0;  // in cube roots
    const MaskRule rule = mask_rule(centre, spread, 0);
    if (options.noise < 0) {
        // Next to each other and further apart: what JPEG leaves of colour has steps of two texels.
        constexpr int spacings = 3, middle = noise_window / 2;
        std::vector<float> responses[spacings];
        for (const PictureOverview* o : overviews) {
            const std::size_t across = std::size_t(o->sample_columns_) * noise_window;
            for (int s = 0; s < o->sample_rows_; ++s)
                for (int q = 0; q < o->sample_columns_; ++q) {
                    const auto at = [&](int y, int x) {
                        return &o->samples_[((std::size_t(s) * noise_window + y) * across + q * noise_window + x) * 3];
                    };
                    std::array<float, 3> rgb;
                    for (int c = 0; c < 3; ++c)
                        rgb[c] = std::pow(at(middle, middle)[c], 3.0f);
                    if (!std::isfinite(rgb[0] + rgb[1] + rgb[2]))
                        continue;
                    const auto seen = inverse.lab_of_rgb(rgb);
                    const SkinPoint p = inverse.point(seen);
                    const auto back = inverse.lab(p);
                    float error = 0;
                    for (int k = 0; k < 3; ++k)
                        error += (seen[k] - back[k]) * (seen[k] - back[k]);
                    if (!(distance_from_skin(rule, p[0], p[1], p[0], p[0], error) < 1.4f))
                        continue;
                    for (int d = 1; d <= spacings; ++d) {
                        // Immerkaer 1996, Comput. Vis. Image Underst. 64:300: blind to planes and edges along the axes.
                        constexpr double mask[3] = {1, -2, 1};
                        double response = 0;
                        for (int y = 0; y < 3; ++y)
                            for (int x = 0; x < 3; ++x)
                                for (int c = 0; c < 3; ++c)
                                    response += normal[c] * mask[y] * mask[x] * at(middle + (y - 1) * d, middle + (x - 1) * d)[c];
                        if (std::isfinite(response))
                            responses[d - 1].push_back(float(std::abs(response) / 6));
                    }
                }
        }
        for (std::vector<float>& r : responses)
            if (r.size() >= 64)
                sd = std::max(sd, 1.4826 * median_of(r));
        // Rounding to the steps of the file is uniform over a step; flat areas hide it.
        if (options.quantum > 0) {
            const double value = std::pow(root[1], 3);
            const bool encoded = overviews.empty() || overviews[0]->srgb_;
            const auto root_at = [&](double v) { return std::cbrt(v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4)); };
            const double v = encoded ? 1.055 * std::pow(value, 1 / 2.4) - 0.055 : value;
            const double slope = encoded ? (root_at(v + 1e-3) - root_at(v - 1e-3)) / 2e-3 : 1 / (3 * root[1] * root[1]);
            sd = std::max(sd, options.quantum / std::sqrt(12.0) * slope);
        }
    }
    Matrix3 covariance{};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            if (options.noise >= 0)
                covariance[i][j] = i == j ? options.noise * options.noise : 0;
            else
                for (int c = 0; c < 3; ++c)
                    covariance[i][j] += sd * sd * lab_by_root[i][c] * lab_by_root[j][c];
    // What is below the tables' own error is not worth a filter.
    constexpr double least_noise = 0.02;
    double noise_sd = std::sqrt((covariance[0][0] + covariance[1][1] + covariance[2][2]) / 3);
    if (noise_sd < least_noise)
        noise_sd = 0, covariance = {};
    Matrix3f factor{};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j <= i; ++j) {
            double sum = covariance[i][j];
            for (int k = 0; k < j; ++k)
                sum -= double(factor[i][k]) * factor[j][k];
            factor[i][j] = float(i == j ? std::sqrt(std::max(sum, 0.0)) : (factor[j][j] > 0 ? sum / factor[j][j] : 0.0));
        }

    // Shading: a factor on all colours, which neither pigment nor blood can feign, if oxygenation is at its prior.
    double found = 0, feigned = 0, kept = 0, exposure = 0;
    if (wants_shading && skin_share > 0) {
        const auto light_of = [&](const SkinPoint& p) {
            const auto lab = inverse.lab(p);
            Vec u{centre[0], centre[1], 0};
            lit_search.descend(u, {lab[0], lab[1], lab[2]});
            return u[2];
        };
        std::vector<float> all;
        for (Cells& c : cells) {
            c.sure.assign(c.rgb.size(), 0);
            for (std::size_t i = 0; i < c.rgb.size(); ++i)
                if (c.mask[i] > 0.25f) {
                    c.sure[i] = c.mask[i] * c.mask[i];
                    if (c.mask[i] > 0.5f)
                        all.push_back(c.shade[i]);
                }
        }
        const float middle = all.empty() ? 0 : median_of(all);
        // Light on the whole picture is told from light skin only as far as it is more than people differ: a scattering 30 %
        // off, as 5 to 95 % of measured faces are (docs/measured_skin.md), feigns less than this.
        constexpr double personal = 0.15;
        exposure = std::abs(middle) > personal ? middle * (1 - personal * personal / (double(middle) * middle)) : 0;
        double sum = 0, square = 0, weight = 0;
        for (std::size_t t = 0; t < cells.size(); ++t) {
            Cells& c = cells[t];
            for (float& v : c.shade)
                v = limit(v - middle, -1.5f, 1.5f);
            const PictureOverview& o = *overviews[t];
            c.shade = low_pass(c.shade, c.sure, o.columns_, o.rows_, low_pass_sigma(o), 0.003);
            for (std::size_t i = 0; i < c.rgb.size(); ++i) {
                sum += double(c.sure[i]) * c.shade[i];
                square += double(c.sure[i]) * c.shade[i] * c.shade[i];
                weight += c.sure[i];
            }
        }
        found = weight > 0 ? std::sqrt(std::max(0.0, square / weight - sum / weight * (sum / weight))) : 0;
        SkinPoint low = centre, high = centre;
        low[2] = float(axes[2].mean - axes[2].sd), high[2] = float(axes[2].mean + axes[2].sd);
        feigned = std::abs(light_of(high) - light_of(low)) / 2;
        kept = options.shading == Shading::on ? 1.0 : found > feigned ? 1 - feigned * feigned / (found * found) : 0;
        for (Cells& c : cells)
            for (float& v : c.shade)
                v = float(v * kept + exposure);
    }
    const bool shaded = kept > 0 || exposure != 0;
    if (wants_shading && !shaded)
        for (Cells& c : cells)
            c.shade.assign(c.rgb.size(), 0);
    if (wants_shading || noise_sd > 0)
        look(noise_sd, false);

    std::vector<PictureModel> out;
    for (std::size_t t = 0; t < cells.size(); ++t) {
        const PictureOverview& o = *overviews[t];
        PictureModel m{o.width_, o.height_, factor, noise_sd, centre, spread, skin_share, found, feigned, kept,
                       exposure, o.columns_, o.rows_, o.cell_, {}, {}, {}};
        if (shaded)
            for (const float v : cells[t].shade)
                m.shading.push_back(std::exp(v));
        std::vector<float> weight = cells[t].mask;
        for (float& w : weight)
            w = w > 0.5f ? w * w : 0;
        m.near = cells[t].near;
        m.fill = filled(cells[t].point, weight, o.columns_, o.rows_, centre);
        out.push_back(std::move(m));
    }
    return out;
}

std::vector<PictureModel> picture_models(const SkinInverse& inverse, std::span<const PictureOverview* const> overviews,
                                         const InversionOptions& options, int threads) {
    return InversionKernel::models(inverse, overviews, options, threads);
}

void InversionCounts::operator+=(const InversionCounts& other) {
    for (int b = 0; b < bins; ++b) {
        error[b] += other.error[b];
        for (int k = 0; k < 3; ++k)
            point[k][b] += other.point[k][b];
    }
    texels += other.texels, there += other.there, skin += other.skin;
}

namespace {
double quantile(const std::array<std::uint64_t, InversionCounts::bins>& counts, double share) {
    std::uint64_t total = 0;
    for (const std::uint64_t c : counts)
        total += c;
    if (total == 0)
        return 0;
    const double wanted = share * double(total);
    double below = 0;
    for (int b = 0; b < InversionCounts::bins; ++b) {
        if (counts[b] > 0 && below + double(counts[b]) >= wanted)
            return b + (wanted - below) / double(counts[b]);
        below += double(counts[b]);
    }
    return InversionCounts::bins;
}
}  // namespace

double InversionCounts::error_at(double share) const {
    return quantile(error, share) * error_step;
}

double InversionCounts::point_at(int axis, double share) const {
    const InversionAxis& a = inversion_axes()[axis];
    return std::lerp(a.lower, a.upper, quantile(point[axis], share) / bins);
}

// ---- Estimates of rows

namespace {

constexpr int halo = inversion_halo;
constexpr int tile_columns = 512, tile_rows = 64;
constexpr int wide = tile_columns + 2 * halo;
constexpr int window = 2 * halo + 1;

/// One row of a tile, halo included.
struct TileRow {
    float rgb[3][wide];       ///< linear, without shading
    float shade[wide], there[wide];
    float lab[3][wide];
    float point[3][wide];     ///< less the centre
    float variance[3][wide];  ///< of it, by noise
    float sum[3][wide], square[3][wide];  ///< over the window's columns
};

struct Tile {
    TileRow ring[window];
    float near[tile_columns], patch[tile_columns];  ///< of the PictureModel
    float point[3][tile_columns], f[3][tile_columns], lab[3][tile_columns], mask[tile_columns], error[tile_columns];
    float fill[3][tile_columns], out[4][tile_columns];
};

SANGUINE_VECTOR_CLONES
void estimate_row(int n, const InverseTable& t, const Matrix3f& noise, bool noisy, const SkinPoint& centre, TileRow& row) {
    for (int i = 0; i < n; ++i) {
        float out[4], variance[4];
        if (noisy)
            inverse_with_variance(t, noise, row.lab[0][i], row.lab[1][i], row.lab[2][i], out, variance);
        else
            inverse_at(t, row.lab[0][i], row.lab[1][i], row.lab[2][i], out);
        for (int k = 0; k < 3; ++k)
            row.point[k][i] = out[k] - centre[k];
        if (noisy)
            for (int k = 0; k < 3; ++k)
                row.variance[k][i] = variance[k];
    }
}

SANGUINE_VECTOR_CLONES
void sum_columns(int n, TileRow& row) {
    for (int k = 0; k < 3; ++k) {
        const float* __restrict p = row.point[k];
        float* __restrict sum = row.sum[k];
        float* __restrict square = row.square[k];
        for (int i = halo; i < n - halo; ++i) {
            float s = 0, q = 0;
            for (int d = -halo; d <= halo; ++d) {
                s += p[i + d];
                q += p[i + d] * p[i + d];
            }
            sum[i] = s, square[i] = q;
        }
    }
}

/// Lee 1980, IEEE Trans. PAMI 2:165: the local mean, and as much of the difference to it as is not noise.
SANGUINE_VECTOR_CLONES
void shrink_row(int n, const TileRow* ring, const TileRow& row, Tile& tile, const SkinPoint& centre) {
    for (int k = 0; k < 3; ++k) {
        const float middle = centre[k];
        for (int i = 0; i < n; ++i) {
            float s = 0, q = 0;
            for (int r = 0; r < window; ++r) {
                s += ring[r].sum[k][i + halo];
                q += ring[r].square[k][i + halo];
            }
            const float mean = s * (1.0f / (window * window));
            const float spread = q * (1.0f / (window * window)) - mean * mean;
            const float signal = spread - row.variance[k][i + halo];
            const float share = signal > 0 ? signal / spread : 0.0f;
            tile.point[k][i] = middle + mean + share * (row.point[k][i + halo] - mean);
        }
    }
}

SANGUINE_VECTOR_CLONES
void look_row(int begin, int end, const float* table, const ForwardScale& scale, Tile& tile) {
    for (int i = begin; i < end; ++i) {
        float f[4];
        forward_at(table, scale, tile.point[0][i], tile.point[1][i], tile.point[2][i], f);
        for (int c = 0; c < 3; ++c)
            tile.f[c][i] = f[c];
    }
    for (int i = begin; i < end; ++i)
        lab_of_f(tile.f[0][i], tile.f[1][i], tile.f[2][i], tile.lab[0][i], tile.lab[1][i], tile.lab[2][i]);
}

SANGUINE_VECTOR_CLONES
void mask_row(int n, const MaskRule& rule, const TileRow& row, Tile& tile) {
    for (int i = 0; i < n; ++i) {
        const float l = row.lab[0][i + halo] - tile.lab[0][i], a = row.lab[1][i + halo] - tile.lab[1][i];
        const float b = row.lab[2][i + halo] - tile.lab[2][i];
        const float far = distance_from_skin(rule, tile.point[0][i], tile.point[1][i], tile.near[i], tile.patch[i], l * l + a * a + b * b);
        tile.mask[i] = exp_minus(0.5f * far) * row.there[i + halo];
    }
}

/// What is more likely skin than not keeps its own estimate, what is surely none takes that of the skin around.
constexpr float surely_none = 0.25f, likely_skin = 0.65f;

SANGUINE_VECTOR_CLONES
void blend_row(int n, Tile& tile) {
    for (int k = 0; k < 3; ++k)
        for (int i = 0; i < n; ++i) {
            const float own = limit((tile.mask[i] - surely_none) * (1 / (likely_skin - surely_none)), 0, 1);
            tile.point[k][i] = tile.fill[k][i] + own * (tile.point[k][i] - tile.fill[k][i]);
        }
}

SANGUINE_VECTOR_CLONES
void skin_row(int n, Tile& tile) {
    for (int i = 0; i < n; ++i)
        tile.out[0][i] = exp_minus(-tile.point[1][i]);
    for (int i = 0; i < n; ++i)
        tile.out[1][i] = exp_minus(-tile.point[0][i]);
}

/// Largest residual: what is brighter than any skin by more is not a material.
constexpr float max_residual = 1000;

SANGUINE_VECTOR_CLONES
void residual_row(int n, const Matrix3f& m, bool shaded, const TileRow& row, Tile& tile) {
    for (int c = 0; c < 3; ++c) {
        const float mx = m[c][0], my = m[c][1], mz = m[c][2];
        for (int i = 0; i < n; ++i) {
            const float x = lab_f_inverse(tile.f[0][i]), y = lab_f_inverse(tile.f[1][i]), z = lab_f_inverse(tile.f[2][i]);
            const float look = mx * x + my * y + mz * z;
            const float seen = row.rgb[c][i + halo] * (shaded ? row.shade[i + halo] : 1.0f);
            const float ratio = seen / (look > 1e-4f ? look : 1e-4f);
            tile.out[c][i] = row.there[i + halo] > 0 ? (ratio < max_residual ? ratio : max_residual) : 1.0f;
        }
    }
}

}  // namespace

InversionCounts invert_rows(const SkinInverse& inverse, const PictureModel& model, const PictureRows& in, int first,
                            int count, const InversionOutput& out, int threads, const Progress& progress) {
    const int last = first + count;
    if (in.width != model.width || first < 0 || count < 0 || last > model.height
        || in.first > std::max(0, first - halo) || in.first + in.count < std::min(model.height, last + halo))
        throw std::invalid_argument("rows " + std::to_string(in.first) + " to " + std::to_string(in.first + in.count)
                                    + ": not enough for the estimates of rows " + std::to_string(first) + " to "
                                    + std::to_string(last) + ", which look at " + std::to_string(halo) + " more");
    InversionCounts counts;
    if (count == 0)
        return counts;
    const InverseTable table = InversionKernel::table(inverse);
    const float* forward = InversionKernel::forward(inverse);
    const ForwardScale& scale = forward_scale();
    const Matrix3f& to_xyz = InversionKernel::xyz_from_rgb(inverse);
    const Matrix3f& to_rgb = InversionKernel::rgb_from_xyz(inverse);
    const MaskRule rule = mask_rule(model.centre, model.spread, model.noise_sd);
    const bool noisy = model.noise_sd > 0, shaded = !model.shading.empty();
    const float oil = float(inverse.skin().oil);
    const int channels = in.channels;
    std::array<float, 3> point_begin, point_scale;
    for (int k = 0; k < 3; ++k) {
        const InversionAxis& a = inversion_axes()[k];
        point_begin[k] = float(a.lower);
        point_scale[k] = float(InversionCounts::bins / (a.upper - a.lower));
    }

    const int across = (in.width + tile_columns - 1) / tile_columns, down = (count + tile_rows - 1) / tile_rows;
    std::mutex mutex;
    parallel_for(std::size_t(across) * down, threads, progress, [&](std::size_t task) {
        const int x0 = int(task % across) * tile_columns, x1 = std::min(in.width, x0 + tile_columns);
        const int y0 = first + int(task / across) * tile_rows, y1 = std::min(last, y0 + tile_rows);
        const int n = x1 - x0, padded = n + 2 * halo;
        const Upsampler upsample(model, x0 - halo, padded), upsample_inner(model, x0, n);
        const auto memory = std::make_unique<Tile>();
        Tile& tile = *memory;
        InversionCounts own;

        const auto slot = [](int y) { return (y + window) % window; };
        const auto read = [&](int wanted) {
            TileRow& row = tile.ring[slot(wanted)];
            const int y = std::clamp(wanted, 0, model.height - 1);
            const float* line = in.pixels + std::size_t(y - in.first) * in.width * channels;
            for (int i = 0; i < padded; ++i) {
                const float* texel = line + std::size_t(std::clamp(x0 - halo + i, 0, in.width - 1)) * channels;
                const float finite = (texel[0] + texel[1] + texel[2]) * 0;
                const float alpha = channels == 4 ? limit(texel[3], 0, 1) : 1.0f;
                const bool there = finite == 0 && alpha > 0;
                row.there[i] = there ? alpha : 0;
                for (int c = 0; c < 3; ++c)
                    row.rgb[c][i] = there ? limit(texel[c], 0, 1e4f) : 0.2f;
            }
            if (in.srgb)
                decode_rows(padded, row.rgb[0], row.rgb[1], row.rgb[2]);
            if (shaded) {
                upsample.read(model.shading, 1, 0, y, row.shade);
                for (int c = 0; c < 3; ++c)
                    for (int i = 0; i < padded; ++i)
                        row.rgb[c][i] /= row.shade[i];
            }
            to_lab(padded, to_xyz, row.rgb[0], row.rgb[1], row.rgb[2], row.lab[0], row.lab[1], row.lab[2]);
            estimate_row(padded, table, model.noise, noisy, model.centre, row);
            if (noisy)
                sum_columns(padded, row);
        };

        const int ahead = noisy ? halo : 0;
        for (int y = y0 - ahead; y < y0 + ahead; ++y)
            read(y);
        for (int y = y0; y < y1; ++y) {
            read(y + ahead);
            const TileRow& row = tile.ring[slot(y)];
            if (noisy)
                shrink_row(n, tile.ring, row, tile, model.centre);
            else
                for (int k = 0; k < 3; ++k)
                    for (int i = 0; i < n; ++i)
                        tile.point[k][i] = row.point[k][i + halo] + model.centre[k];
            look_row(0, n, forward, scale, tile);
            upsample_inner.read(model.near, 2, 0, y, tile.near);
            upsample_inner.read(model.near, 2, 1, y, tile.patch);
            mask_row(n, rule, row, tile);
            if (std::any_of(tile.mask, tile.mask + n, [](float m) { return m < likely_skin; })) {
                for (int k = 0; k < 3; ++k)
                    upsample_inner.read(model.fill, 3, k, y, tile.fill[k]);
                blend_row(n, tile);
                look_row(0, n, forward, scale, tile);
            }
            differences(n, row.lab[0] + halo, row.lab[1] + halo, row.lab[2] + halo, tile.lab[0], tile.lab[1], tile.lab[2], tile.error);
            for (int i = 0; i < n; ++i)
                tile.error[i] = row.there[i + halo] > 0 ? tile.error[i] : 0;

            const std::size_t at = std::size_t(y - first) * in.width + x0;
            if (out.skin) {
                skin_row(n, tile);
                float* to = out.skin + at * 4;
                for (int i = 0; i < n; ++i, to += 4) {
                    to[0] = tile.out[0][i], to[1] = tile.out[1][i], to[2] = oil, to[3] = tile.point[2][i];
                }
            }
            if (out.residual) {
                residual_row(n, to_rgb, out.shaded_residual && shaded, row, tile);
                float* to = out.residual + at * 3;
                for (int i = 0; i < n; ++i, to += 3)
                    to[0] = tile.out[0][i], to[1] = tile.out[1][i], to[2] = tile.out[2][i];
            }
            if (out.mask)
                std::copy_n(tile.mask, n, out.mask + at);
            if (out.error)
                std::copy_n(tile.error, n, out.error + at);
            if (out.shading)
                for (int i = 0; i < n; ++i)
                    out.shading[at + i] = shaded ? row.shade[i + halo] : 1.0f;

            own.texels += n;
            for (int i = 0; i < n; ++i)
                if (row.there[i + halo] > 0) {
                    ++own.there;
                    if (tile.mask[i] > 0.5f) {
                        ++own.skin;
                        ++own.error[int(limit(tile.error[i] * float(1 / InversionCounts::error_step), 0, InversionCounts::bins - 1))];
                        for (int k = 0; k < 3; ++k)
                            ++own.point[k][int(limit((tile.point[k][i] - point_begin[k]) * point_scale[k], 0, InversionCounts::bins - 1))];
                    }
                }
        }
        const std::lock_guard lock(mutex);
        counts += own;
    });
    return counts;
}

}  // namespace sanguine
