// Method: van de Hulst 1963 (doubling), Grant and Hunt 1969 (adding of unlike layers), Prahl 1995 (Fresnel faces),
// Wiscombe 1977 (delta-M).
//
// One set of streams serves all layers. Snell's invariant s = (n sin)^2 names a stream, and n^2 mu dmu = -ds / 2 is
// its weight in every medium, so a face couples each stream to itself alone. Between two neighbouring indices of the
// stack lie the streams that are totally reflected by the rarer medium: every such interval has its own Gauss
// quadrature, in the cosine of the rarest medium that carries it, where Fresnel's formulas are smooth. Streams are
// sorted by interval: a medium carries the first so many of them. The first one is normal incidence (Gauss-Radau).
//
// Fields are amplitudes, flux / sqrt(weight), which makes the matrices of a layer symmetric (reciprocity).
// What has not scattered is a diagonal and is kept apart from the scattered part, and 1 - diagonal is kept too: every
// sum is then one of positive terms, and a layer of 1 nm has its Rd to full relative precision.
#include "sanguine/adding_doubling.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "sanguine/unscattered.hpp"

namespace sanguine {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Indices nearer than this are one medium: what would be totally reflected between them carries 1e-9 of the light.
constexpr double same_index = 5e-10;
/// Optical thickness of the layer that doubling starts from, along its most grazing stream. The error of its
/// transmittance is start_depth^4 / 120 of its extinction, 3e-9, there, and far less in the others.
constexpr double start_depth = 0.025;
/// Scattering or absorption of less than this in a whole layer is none.
constexpr double nothing = 1e-200;

/// Points and weights on 0..1 (Golub and Welsch 1969); with `end_point` the last point is 1 (Gauss-Radau).
void gauss(int count, bool end_point, VectorXd& points, VectorXd& weights) {
    VectorXd diagonal = VectorXd::Zero(count), off(std::max(count - 1, 0));
    for (int k = 1; k < count; ++k)
        off[k - 1] = k / std::sqrt(4.0 * k * k - 1);
    if (end_point)
        diagonal[count - 1] = count / (2.0 * count - 1);
    Eigen::SelfAdjointEigenSolver<MatrixXd> solver;
    solver.computeFromTridiagonal(diagonal, off);
    points = (solver.eigenvalues().array() + 1) / 2;
    weights = solver.eigenvectors().row(0).array().square().transpose();
    if (end_point)
        points[count - 1] = 1;
}

struct Medium {
    double n;
    Index streams;   ///< it carries the first so many
    VectorXd cosine;
};

struct Streams {
    std::vector<Medium> media;  ///< ascending in n; the first is outside
    VectorXd root_weight;       ///< sqrt of the weight; the weights of the streams from outside add up to 1

    Streams(std::span<const Layer> stack, int count);

    const Medium& medium(double n) const {
        const Medium* best = &media.front();
        for (const Medium& m : media)
            if (std::fabs(m.n - n) < std::fabs(best->n - n))
                best = &m;
        return *best;
    }
};

Streams::Streams(std::span<const Layer> stack, int count) {
    std::vector<double> indices{outside_index};
    for (const Layer& layer : stack)
        indices.push_back(layer.n);
    std::sort(indices.begin(), indices.end());
    for (const double n : indices)
        if (media.empty() || n - media.back().n > same_index * n)
            media.push_back({n, 0, {}});

    // Streams are shared out by the angle that an interval spans in the densest medium, but none is left with so few
    // that its error would not fall with their number.
    constexpr double smallest_outside = 0.4, smallest_share = 0.25;
    const double densest = media.back().n;
    std::vector<VectorXd> points(media.size()), weights(media.size());
    Index total = 0;
    double angle_below = 0;
    for (std::size_t k = 0; k < media.size(); ++k) {
        const double angle = std::asin(std::min(1.0, media[k].n / densest));
        const double share = (angle - angle_below) / std::asin(1.0);
        angle_below = angle;
        const int own = std::max({2, static_cast<int>(std::lround(count * share)),
                                  static_cast<int>(std::ceil(count * (k == 0 ? smallest_outside : smallest_share)))});
        gauss(own, k == 0, points[k], weights[k]);
        if (k > 0) {
            // From this medium's critical cosine up to grazing.
            const double below = media[k - 1].n, n = media[k].n;
            const double width = std::sqrt((n - below) * (n + below)) / n;
            points[k] *= width;
            weights[k] *= width;
        } else {
            points[k].reverseInPlace();
            weights[k].reverseInPlace();
        }
        total += own;
        media[k].streams = total;
    }

    root_weight.resize(total);
    for (std::size_t m = 0; m < media.size(); ++m) {
        Medium& medium = media[m];
        medium.cosine.resize(medium.streams);
        Index at = 0;
        for (std::size_t k = 0; k <= m; ++k) {
            const double n = media[k].n;
            for (Index i = 0; i < points[k].size(); ++i, ++at) {
                const double mu = points[k][i];
                medium.cosine[at] =
                    k == m ? mu : std::sqrt((medium.n - n) * (medium.n + n) + n * n * mu * mu) / medium.n;
                if (k == m)
                    root_weight[at] = n * std::sqrt(2 * mu * weights[k][i]);
            }
        }
    }
    // Normal incidence stays that in every medium.
    for (Medium& medium : media)
        medium.cosine[0] = 1;
}

/// A homogeneous layer without its faces; both sides are alike.
struct Slab {
    MatrixXd R, T;       ///< scattered light alone, symmetric
    ArrayXd passed;      ///< share that goes through without scattering
    ArrayXd passed_not;  ///< 1 - passed
};

/// All that lies below a level, seen from the medium at that level.
struct Below {
    ArrayXd back, back_not;  ///< returned without scattering, and 1 - that
    MatrixXd S;              ///< returned scattered, symmetric
    VectorXd through;        ///< what leaves the bottom without scattering, per amplitude of each stream
    VectorXd through_scattered;
};

/// Gram-Schmidt, twice, of columns weighted by `weight`; returns how many the rows can tell apart. The even Legendre
/// polynomials are orthogonal on 0..1, and so are the odd ones; made so on the streams too (they are not Gauss points
/// of one interval), the moments of the phase function, norm and g before all, hold for any number of streams.
Index orthonormalise(MatrixXd& columns, const ArrayXd& weight) {
    // Of a column that is nearly a sum of the earlier ones (streams crowd between two like indices) only noise is left.
    constexpr double told_apart = 0.01;
    for (Index k = 0; k < columns.cols(); ++k) {
        auto column = columns.col(k);
        column.array() *= weight;
        const double whole = column.norm();
        for (int pass = 0; pass < 2 && k > 0; ++pass) {
            const auto before = columns.leftCols(k);
            const VectorXd along = before.transpose() * column;
            column.noalias() -= before * along;
        }
        const double left = column.norm();
        if (!(left > told_apart * whole))
            return k;
        column /= left;
    }
    return columns.cols();
}

class Solve {
public:
    Solve(std::span<const Layer> stack, int count) : streams_(stack, count) {
        const Medium* medium = &streams_.media.front();
        below_.back = ArrayXd::Zero(medium->streams);
        below_.back_not = ArrayXd::Ones(medium->streams);
        below_.S = MatrixXd::Zero(medium->streams, medium->streams);
        below_.through = streams_.root_weight.head(medium->streams);
        below_.through_scattered = VectorXd::Zero(medium->streams);
        for (std::size_t i = stack.size(); i-- > 0;) {
            const Layer& layer = stack[i];
            const Medium& own = streams_.medium(layer.n);
            if (std::isinf(layer.thickness)) {
                half_space_below(layer, own);
            } else {
                if (&own != medium)
                    add_face(own, *medium);
                add_layer(layer, own);
            }
            medium = &own;
        }
        if (medium != &streams_.media.front())
            add_face(streams_.media.front(), *medium);
    }

    /// Scattered light back from `incident` amplitudes of the streams outside, and through.
    double reflected(Incidence incidence) const {
        const VectorXd s = outside_weights();
        return incidence == Incidence::normal ? s.dot(below_.S.col(0)) / s[0] : s.dot(below_.S * s);
    }

    double transmitted(Incidence incidence) const {
        const VectorXd s = outside_weights();
        return incidence == Incidence::normal ? below_.through_scattered[0] / s[0]
                                              : below_.through_scattered.dot(s);
    }

    /// Share of diffuse light that scatters at all, by this quadrature.
    double first_scattered(std::span<const Layer> stack) const {
        const VectorXd s = outside_weights();
        double sum = 0;
        for (Index i = 0; i < s.size(); ++i)
            sum += s[i] * s[i] * unscattered_at(stack, streams_.media.front().cosine[i]).scattered;
        return sum;
    }

private:
    VectorXd outside_weights() const { return streams_.root_weight.head(streams_.media.front().streams); }

    void generator(double absorption, double scattering, double g, const Medium& medium);
    void start(double step);
    void double_once();
    void conserve();
    void half_space_below(const Layer& layer, const Medium& medium);
    void add_layer(const Layer& layer, const Medium& medium);
    void add_face(const Medium& above, const Medium& below);

    Streams streams_;
    Below below_;
    Slab slab_;
    // Of the layer at hand: extinction and absorption along each stream, scattering into forward and backward streams.
    ArrayXd extinction_, absorption_;
    MatrixXd forward_, backward_;
    VectorXd absorbed_;     ///< of the slab, per amplitude
    bool nearly_conservative_ = false;
    VectorXd s_;            ///< root weights of the medium's streams
    MatrixXd a_, b_, c_, d_, e_, f_;
};

/// Rates for the whole thickness of a layer of the given absorption and scattering (both times thickness).
void Solve::generator(double absorption, double scattering, double g, const Medium& medium) {
    const Index n = medium.streams;
    const ArrayXd mu = medium.cosine.array();
    s_ = streams_.root_weight.head(n);
    extinction_ = (absorption + scattering) / mu;
    absorption_ = absorption / mu;
    nearly_conservative_ = absorption <= 0.01 * scattering;

    // Wiscombe 1977: what lies beyond the moments that the streams can carry is a peak, forward for g > 0, backward
    // (odd moments negative) for g < 0.
    Index moments = n + n / 2;
    VectorXd p0 = VectorXd::Ones(n), p1 = medium.cosine, p2;
    MatrixXd& even = c_;
    MatrixXd& odd = d_;
    even.resize(n, (moments + 1) / 2);
    odd.resize(n, moments / 2);
    for (Index l = 0; l < moments; ++l) {
        (l % 2 == 0 ? even : odd).col(l / 2) = p0;
        p2 = ((2.0 * l + 3) * medium.cosine.array() * p1.array() - (l + 1.0) * p0.array()) / (l + 2.0);
        p0.swap(p1);
        p1.swap(p2);
    }
    const ArrayXd root_mu = mu.sqrt();
    const ArrayXd root_weight = s_.array() / root_mu;
    moments = std::min(2 * orthonormalise(even, root_weight), 2 * orthonormalise(odd, root_weight) + 1);
    const double peak = std::pow(std::fabs(g), static_cast<double>(moments));
    VectorXd even_weight = VectorXd::Zero(even.cols()), odd_weight = VectorXd::Zero(odd.cols());
    double power = 1;
    for (Index l = 0; l < std::min(moments, even.cols() + odd.cols()); ++l) {
        const double sign = g < 0 && l % 2 == 1 ? -1 : 1;
        (l % 2 == 0 ? even_weight : odd_weight)[l / 2] = 0.5 * scattering * (power - sign * peak);
        power *= g;
    }
    even = (1 / root_mu).matrix().asDiagonal() * even;
    odd = (1 / root_mu).matrix().asDiagonal() * odd;
    a_.noalias() = even * even_weight.asDiagonal() * even.transpose();
    b_.noalias() = odd * odd_weight.asDiagonal() * odd.transpose();
    forward_ = a_ + b_;
    backward_ = a_ - b_;
    (g < 0 ? backward_ : forward_).diagonal().array() += scattering * peak / mu;
    // Rounding errors of the norm go straight on: no light is lost or made.
    a_ = forward_ + backward_;
    forward_.diagonal().array() += scattering / mu - (a_ * s_).array() / s_.array();
}

/// Taylor series of the invariant imbedding equations to the fourth order,
/// dR/dz = b + aR + Ra + RbR, dT/dz = T (a + bR), for `step` of the layer's thickness.
void Solve::start(double step) {
    const ArrayXd e = extinction_ * step;
    const MatrixXd as = forward_ * step, b = backward_ * step;
    MatrixXd a = as;
    a.diagonal().array() -= e;
    const VectorXd k = (absorption_ * step * s_.array()).matrix();

    const MatrixXd bb = b * b, ab = a * b;
    const MatrixXd R2 = (ab + ab.transpose()) / 2;
    a_.noalias() = a * R2;
    const MatrixXd R3 = (a_ + a_.transpose() + b * bb) / 3;
    a_.noalias() = a * R3;
    b_.noalias() = bb * R2;
    const MatrixXd R4 = (a_ + a_.transpose() + b_ + b_.transpose()) / 4;
    slab_.R = b + R2 + R3 + R4;

    const ArrayXd p1 = -e, p2 = e * e / 2, p3 = -e * e * e / 6;
    MatrixXd T2 = as * a + bb;
    T2 += p1.matrix().asDiagonal() * as;
    T2 /= 2;
    const MatrixXd bR2 = b * R2;
    MatrixXd T3 = T2 * a + bR2 + a * bb;
    T3 += p2.matrix().asDiagonal() * as;
    T3 /= 3;
    a_ = T2;
    a_.diagonal().array() += p2;
    MatrixXd T4 = T3 * a + b * R3 + a * bR2 + a_ * bb;
    T4 += p3.matrix().asDiagonal() * as;
    T4 /= 4;
    a_ = as + T2 + T3 + T4;
    slab_.T = (a_ + a_.transpose()) / 2;
    extinction_ = e;
    slab_.passed = (-e).exp();
    slab_.passed_not = -(-e).unaryExpr([](double x) { return std::expm1(x); });

    // Absorbed: d(alpha)/dz = (a + Rb) alpha + (1 + R) k.
    const VectorXd x2 = (a * k + b * k) / 2;
    const VectorXd x3 = (a * x2 + b * (b * k) + R2 * k) / 3;
    const VectorXd x4 = (a * x3 + b * (b * x2) + R2 * (b * k) + R3 * k) / 4;
    absorbed_ = k + x2 + x3 + x4;
    conserve();
}

/// Returned + passed + absorbed = 1 for every stream: the rounding error goes to the diagonal. In a layer that hardly
/// absorbs, 1e-16 lost per step would darken an opaque stack by its square root.
void Solve::conserve() {
    if (!nearly_conservative_)
        return;
    const ArrayXd missing = slab_.passed_not
                          - (absorbed_ + slab_.R * s_ + slab_.T * s_).array() / s_.array();
    for (Index i = 0; i < missing.size(); ++i)
        (slab_.passed[i] + slab_.T(i, i) > 0.5 ? slab_.T : slab_.R)(i, i) += missing[i];
}

/// Two slabs on top of each other. With E = 1 / (1 - R^2): T' = T E T, R' = R + T E R T.
void Solve::double_once() {
    const Index n = extinction_.size();
    MatrixXd& whole = a_;
    whole = slab_.T;
    whole.diagonal().array() += slab_.passed;
    b_.noalias() = slab_.R * slab_.R;
    b_ = MatrixXd::Identity(n, n) - b_;
    const Eigen::LLT<Eigen::Ref<MatrixXd>> root(b_);
    if (root.info() != Eigen::Success)
        throw SolverError("adding-doubling: a layer reflects all light within rounding error");
    if (nearly_conservative_) {
        // alpha' = alpha + T / (1 - R) alpha = alpha + T E (1 + R) alpha
        VectorXd x = absorbed_ + slab_.R * absorbed_;
        root.solveInPlace(x);
        absorbed_ += whole * x;
    }
    c_.noalias() = slab_.R * whole;
    root.matrixL().solveInPlace(c_);  // H = L^-1 R T, with E = L^-T L^-1
    d_.noalias() = slab_.T * slab_.T;
    d_.noalias() += c_.transpose() * c_;
    d_ += slab_.passed.matrix().asDiagonal() * slab_.T;
    d_ += slab_.T * slab_.passed.matrix().asDiagonal();
    root.matrixU().solveInPlace(c_);
    e_.noalias() = whole * c_;
    slab_.R += (e_ + e_.transpose()) / 2;
    slab_.T = (d_ + d_.transpose()) / 2;
    extinction_ *= 2;
    slab_.passed = slab_.passed.square();
    slab_.passed_not = -(-extinction_).unaryExpr([](double x) { return std::expm1(x); });
    conserve();
}

int doublings(double deepest) {
    return std::max(0, static_cast<int>(std::ceil(std::log2(deepest / start_depth))));
}

void Solve::half_space_below(const Layer& layer, const Medium& medium) {
    const Index n = medium.streams;
    below_.back = ArrayXd::Zero(n);
    below_.back_not = ArrayXd::Ones(n);
    below_.through = below_.through_scattered = VectorXd::Zero(n);
    const double total = layer.mu_a + layer.mu_s;
    if (!(layer.mu_s > 0)) {
        below_.S = MatrixXd::Zero(n, n);
        return;
    }
    generator(layer.mu_a / total, layer.mu_s / total, layer.g, medium);
    start(std::exp2(-doublings(extinction_.maxCoeff())));
    // The light that gets through halves with every doubling in the worst case (no absorption).
    const double all = s_.squaredNorm();
    for (int i = 0;; ++i) {
        const VectorXd passed = slab_.T * s_ + (slab_.passed * s_.array()).matrix();
        if (s_.dot(passed) < 1e-11 * all || i == 100) {
            // Without absorption all of it comes back.
            if (layer.mu_a == 0)
                slab_.R += passed * passed.transpose() / s_.dot(passed);
            break;
        }
        double_once();
    }
    below_.S = slab_.R;
}

void Solve::add_layer(const Layer& layer, const Medium& medium) {
    double absorption = layer.mu_a * layer.thickness, scattering = layer.mu_s * layer.thickness;
    if (absorption < nothing)
        absorption = 0;
    if (scattering < nothing)
        scattering = 0;
    ArrayXd passed, passed_twice_not;
    if (scattering > 0) {
        generator(absorption, scattering, layer.g, medium);
        const int count = doublings(extinction_.maxCoeff());
        start(std::exp2(-count));
        for (int i = 0; i < count; ++i)
            double_once();
    }
    const ArrayXd depth = (absorption + scattering) / medium.cosine.array();
    passed = (-depth).exp();
    passed_twice_not = -(-2 * depth).unaryExpr([](double x) { return std::expm1(x); });
    if (scattering > 0) {
        // X = B / (1 - R B), B all that the stack below returns: R' = R + T X T. Scattered part of X: S + B R X.
        a_ = below_.S;
        a_.diagonal().array() += below_.back;
        b_.noalias() = a_ * slab_.R;
        c_ = MatrixXd::Identity(b_.rows(), b_.cols()) - b_;
        const Eigen::PartialPivLU<Eigen::Ref<MatrixXd>> solver(c_);
        const MatrixXd X = solver.solve(a_);
        a_.noalias() = b_ * X;
        a_ += below_.S;
        a_ = ((a_ + a_.transpose()) / 2).eval();  // scattered part of X
        MatrixXd whole = slab_.T;
        whole.diagonal().array() += passed;
        c_.noalias() = a_ * whole;
        d_.noalias() = whole * c_;
        // T u T without what never scattered
        c_ = below_.back.matrix().asDiagonal() * whole;
        d_.noalias() += slab_.T * c_;
        d_ += (passed * below_.back).matrix().asDiagonal() * slab_.T;
        below_.S = slab_.R + (d_ + d_.transpose()) / 2;

        const VectorXd all = below_.through + below_.through_scattered;
        const VectorXd reflected = slab_.R * all;
        const VectorXd more = below_.through_scattered + X.transpose() * reflected;
        below_.through_scattered = (passed * more.array()).matrix() + slab_.T * (more + below_.through);
    } else {
        below_.S = (passed.matrix().asDiagonal() * below_.S * passed.matrix().asDiagonal()).eval();
        below_.through_scattered.array() *= passed;
    }
    below_.through.array() *= passed;
    below_.back_not += below_.back * passed_twice_not;
    below_.back *= passed.square();
}

/// A face on top. With D = 1 / (1 - rho back): S' = t D K D t, K = S / (1 - D rho S).
void Solve::add_face(const Medium& above, const Medium& below) {
    const Index inside = below.streams, common = std::min(above.streams, below.streams);
    ArrayXd rho = ArrayXd::Ones(inside), t = ArrayXd::Zero(inside);
    for (Index i = 0; i < common; ++i) {
        const Face face = fresnel_face(above.n, above.cosine[i], below.n, below.cosine[i]);
        rho[i] = face.reflected;
        t[i] = face.transmitted;
    }
    const ArrayXd escape = t + rho * below_.back_not;
    // A stream that neither face nor layers ever weaken is never entered either.
    const ArrayXd gain = (escape > 0).select(1 / escape, 0);
    const ArrayXd q = (gain * rho).sqrt();
    a_ = q.matrix().asDiagonal() * below_.S;
    b_ = MatrixXd::Identity(inside, inside) - a_ * q.matrix().asDiagonal();
    const Eigen::LLT<Eigen::Ref<MatrixXd>> root(b_);
    if (root.info() != Eigen::Success)
        throw SolverError("adding-doubling: a face holds back all light within rounding error");
    root.matrixL().solveInPlace(a_);
    below_.S.noalias() += a_.transpose() * a_;  // K

    const VectorXd trapped = (gain * rho * (below_.through + below_.through_scattered).array()).matrix();
    const VectorXd more = below_.through_scattered + below_.S * trapped;
    const ArrayXd enter = t.head(common) * gain.head(common);

    Below next;
    const Index n = above.streams;
    next.back = ArrayXd::Ones(n);
    next.back_not = ArrayXd::Zero(n);
    next.S = MatrixXd::Zero(n, n);
    next.through = next.through_scattered = VectorXd::Zero(n);
    next.back.head(common) = rho.head(common) + t.head(common) * enter * below_.back.head(common);
    next.back_not.head(common) = enter * below_.back_not.head(common);
    next.S.topLeftCorner(common, common) =
        enter.matrix().asDiagonal() * below_.S.topLeftCorner(common, common) * enter.matrix().asDiagonal();
    next.through.head(common) = (enter * below_.through.head(common).array()).matrix();
    next.through_scattered.head(common) = (enter * more.head(common).array()).matrix();
    below_ = std::move(next);
}

/// Media of the stack, the outside among them.
int different_indices(std::span<const Layer> stack) {
    std::vector<double> indices{outside_index};
    for (const Layer& layer : stack)
        indices.push_back(layer.n);
    std::sort(indices.begin(), indices.end());
    return static_cast<int>(1 + std::count_if(indices.begin() + 1, indices.end(), [&](const double& n) {
                                return n - *(&n - 1) > same_index * n;
                            }));
}

double relative(double change, double value) {
    return change == 0 ? 0 : std::fabs(change) / std::max(std::fabs(value), 1e-300);
}

}  // namespace

Totals adding_doubling(std::span<const Layer> stack, Incidence incidence, int streams) {
    const UnscatteredLight direct = unscattered(stack, incidence);
    Totals totals{0, direct.reflected, direct.transmitted, direct.specular};
    if (!(direct.scattered > 0))
        return totals;
    const Solve solve(stack, std::clamp(streams, min_streams, max_streams));
    // The share that scatters at all is known exactly; the quadrature's own is a little off for diffuse light.
    double scale = 1;
    if (incidence == Incidence::diffuse) {
        const double own = solve.first_scattered(stack);
        if (own > 0)
            scale = direct.scattered / own;
    }
    const double reflected = scale * solve.reflected(incidence), transmitted = scale * solve.transmitted(incidence);
    // std::max below would make 0 of what is no number.
    if (!std::isfinite(reflected) || !std::isfinite(transmitted))
        throw SolverError("adding-doubling: the sum over the layers is not finite");
    totals.Rd = std::max(0.0, reflected);
    totals.Tt += std::max(0.0, transmitted);
    return totals;
}

std::string_view AddingDoubling::id() const {
    return "adding-doubling";
}

std::string_view AddingDoubling::summary() const {
    return "radiative transfer of plane layers, exact but for the number of directions; totals only";
}

std::string AddingDoubling::unsuited(const Problem&) const {
    return "";
}

Solution AddingDoubling::solve(const Problem& problem, const Effort& effort) const {
    // Cheap enough that nobody gains from less than this.
    constexpr double finest = 1e-9, coarsest = 1e-4;
    const double wanted = std::clamp(effort.tolerance, finest, coarsest);
    constexpr int counts[] = {6, 10, 16, 24, 32, 48, 64};
    // Each index of refraction has directions of its own: fewer than two for each tell nothing.
    const int fewest = 2 * different_indices(problem.layers);

    Solution solution;
    solution.solver = id();
    Totals last;
    double change = 1, error = 1;
    int used = 0;
    for (const int count : counts) {
        if (effort.progress && !effort.progress(used, std::size(counts)))
            throw Cancelled();
        if (count < fewest)
            continue;
        const Totals now = adding_doubling(problem.layers, problem.incidence, count);
        if (used++ > 0) {
            // Two counts may agree by chance (the error changes sign); three do not.
            const double before = change;
            change = std::max(relative(now.Rd - last.Rd, now.Rd), relative(now.Tt - last.Tt, now.Tt));
            error = std::max(change, before / 8);
        }
        last = now;
        if (error < wanted)
            break;
    }
    solution.Rd = last.Rd;
    solution.R_unscattered = last.R_unscattered;
    solution.Tt = last.Tt;
    solution.specular = last.specular;
    solution.error_estimate = error;
    if (error > effort.tolerance)
        solution.warnings.push_back("adding-doubling: the last two counts of directions differ by "
                                    + std::to_string(100 * error) + " % of the result");
    if (!problem.radii_mm.empty())
        solution.warnings.push_back("adding-doubling gives totals only: no profile");
    return solution;
}

const Solver& adding_doubling_solver() {
    static const AddingDoubling solver;
    return solver;
}

}  // namespace sanguine
