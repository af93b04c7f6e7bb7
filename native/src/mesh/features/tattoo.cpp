// A small tattoo in lines, in true millimetres. For a picture of one's own, an artist paints the ink map instead.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <tuple>

#include <glm/geometric.hpp>

#include "feature_of.hpp"
#include "list.hpp"
#include "noise.hpp"
#include "standard_face.hpp"

namespace sanguine {
namespace {

constexpr float most_ink_per_mm = 6;

struct Stroke {
    glm::vec2 from, to;
};

/// Strokes in the plane of the motif, mm, its middle at 0 and up along +y.
class Pen {
public:
    void line(glm::vec2 a, glm::vec2 b) { strokes.push_back({a, b}); }
    void polygon(std::initializer_list<glm::vec2> points) {
        glm::vec2 last = *(points.end() - 1);
        for (const glm::vec2 p : points) {
            line(last, p);
            last = p;
        }
    }
    void circle(glm::vec2 middle, float radius, int parts = 24) {
        glm::vec2 last = middle + glm::vec2(radius, 0);
        for (int i = 1; i <= parts; ++i) {
            const float angle = 2 * std::numbers::pi_v<float> * float(i) / float(parts);
            const glm::vec2 p = middle + radius * glm::vec2(std::cos(angle), std::sin(angle));
            line(last, p);
            last = p;
        }
    }
    /// From a over b to c (a parabola that is tangent to ab and bc).
    void curve(glm::vec2 a, glm::vec2 b, glm::vec2 c, int parts = 8) {
        glm::vec2 last = a;
        for (int i = 1; i <= parts; ++i) {
            const float t = float(i) / float(parts);
            const glm::vec2 p = (1 - t) * (1 - t) * a + 2 * t * (1 - t) * b + t * t * c;
            line(last, p);
            last = p;
        }
    }

    std::vector<Stroke> strokes;
};

/// A stem with pairs of leaves.
std::vector<Stroke> sprig() {
    Pen pen;
    const auto stem = [](float t) { return glm::vec2(2.2F * (t * t - t) * 4 + 1.5F, -15 + 30 * t); };
    for (int i = 0; i < 16; ++i) pen.line(stem(float(i) / 16), stem(float(i + 1) / 16));
    for (int i = 1; i <= 5; ++i) {
        const glm::vec2 root = stem(float(i) / 6);
        const float length = 9 - float(i);
        for (const float side : {-1.0F, 1.0F}) {
            const glm::vec2 along = glm::normalize(glm::vec2(side, 0.75F)), across(-along.y, along.x);
            const glm::vec2 tip = root + length * along, middle = root + 0.45F * length * along;
            pen.curve(root, middle + 0.38F * length * across, tip);
            pen.curve(root, middle - 0.38F * length * across, tip);
        }
    }
    const glm::vec2 top = stem(1);
    pen.curve(top, top + glm::vec2(-1.6F, 2), top + glm::vec2(0, 4.5F));
    pen.curve(top, top + glm::vec2(1.6F, 2), top + glm::vec2(0, 4.5F));
    return pen.strokes;
}

/// A compass rose in two rings.
std::vector<Stroke> rose() {
    Pen pen;
    pen.circle({0, 0}, 10, 40);
    pen.circle({0, 0}, 8.8F, 36);
    pen.circle({0, 0}, 1.6F, 14);
    for (int i = 0; i < 8; ++i) {
        const float angle = std::numbers::pi_v<float> / 4 * float(i), reach = i % 2 == 0 ? 14.0F : 7.4F;
        const glm::vec2 out(std::sin(angle), std::cos(angle)), side(out.y, -out.x);
        const float waist = i % 2 == 0 ? 2.1F : 1.7F;
        pen.polygon({1.6F * out, 3.6F * out + waist * side, reach * out, 3.6F * out - waist * side});
        pen.line(1.6F * out, reach * out);
    }
    return pen.strokes;
}

/// Part of a band: two lines with diamonds and dots between.
std::vector<Stroke> band() {
    Pen pen;
    for (const float y : {-4.5F, 4.5F}) pen.line({-17, y}, {17, y});
    for (int i = -2; i <= 2; ++i) {
        const float x = 6.8F * float(i);
        pen.polygon({{x - 2.9F, 0}, {x, 3.2F}, {x + 2.9F, 0}, {x, -3.2F}});
        pen.circle({x, 0}, 0.5F, 8);
        if (i < 2)
            for (const float y : {-2.4F, 2.4F}) pen.circle({x + 3.4F, y}, 0.2F, 6);
    }
    return pen.strokes;
}

float distance_to(const Stroke& s, glm::vec2 p) {
    const glm::vec2 along = s.to - s.from, away = p - s.from;
    const float t = std::clamp(glm::dot(away, along) / std::max(1e-12F, glm::dot(along, along)), 0.0F, 1.0F);
    return glm::length(away - t * along);
}

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person& person, std::uint64_t seed)
        : uneven_{1.5F, 3, 0.6F, std::uint32_t(seed)} {
        const auto face = StandardFace::of(surface);
        if (!face) return;
        Random random(seed);
        const float side = random.uniform() < 0.5 ? 1 : -1;
        // Temple, cheekbone, side of the neck.
        constexpr std::array places{glm::vec3(71, 22, 14), glm::vec3(55, 8, -38), glm::vec3(55, 75, -138)};
        const auto where = std::size_t(random.uniform() * 3);
        const SurfacePoint middle =
            nearest_point(surface, face->place_mm(places[where] * glm::vec3(side, 1, 1)));
        middle_mm_ = surface.place_mm(middle);
        normal_ = surface.normal_at(middle);
        const glm::vec3 straight = glm::vec3(0, 0, 1) - normal_.z * normal_;
        up_ = glm::length(straight) > 1e-3F ? glm::normalize(straight) : glm::vec3(1, 0, 0);
        right_ = glm::cross(up_, normal_);
        const float turn = random.uniform(-0.3F, 0.3F), c = std::cos(turn), s = std::sin(turn);
        std::tie(right_, up_) = std::pair(c * right_ + s * up_, c * up_ - s * right_);

        const auto motif = std::size_t(random.uniform() * 3);
        strokes_ = motif == 0 ? sprig() : motif == 1 ? rose() : band();
        const float scale = face->scale() * (where == 2 ? random.uniform(1.4F, 1.8F) : random.uniform(0.85F, 1.1F));
        for (Stroke& stroke : strokes_) {
            stroke.from *= scale;
            stroke.to *= scale;
            reach_mm_ = std::max({reach_mm_, glm::length(stroke.from), glm::length(stroke.to)});
        }
        // A fine needle's line, and what time makes of it: ink spreads and pales.
        const float old = smooth_step(25, 80, float(person.age_years));
        width_mm_ = 0.45F + 0.35F * old;
        ink_per_mm_ = most_ink_per_mm * (1 - 0.4F * old);
        reach_mm_ += width_mm_;
    }

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        std::ranges::fill(out, 0.0F);
        for (std::size_t i = 0; i < places.size(); ++i) {
            const SkinPlace& place = places[i];
            const glm::vec3 away = place.place_mm - middle_mm_;
            const float distance = glm::length(away);
            if (strokes_.empty() || distance > reach_mm_ + place.size_mm) continue;
            const float share = smooth_step(-0.1F, 0.25F, glm::dot(normal_, place.normal));
            if (share == 0) continue;
            // The place in the plane of the motif at its distance over the skin, nearly: what lies flat is not bent.
            const glm::vec2 flat(glm::dot(away, right_), glm::dot(away, up_));
            const float length = glm::length(flat);
            const glm::vec2 at = length > 1e-6F ? flat * (distance / length) : flat;
            const float pale = 1 + 0.25F * uneven_(place.place_mm, place.size_mm);
            out[i] = std::min(most_ink_per_mm, share * ink_per_mm_ * pale * covered(at, place.size_mm));
        }
    }

private:
    /// Share of a texel that lines cover.
    float covered(glm::vec2 at, float size_mm) const {
        const int samples = std::clamp(int(std::ceil(2 * size_mm / width_mm_)), 1, 8);
        float sum = 0;
        for (int j = 0; j < samples; ++j)
            for (int i = 0; i < samples; ++i) {
                const glm::vec2 offset((float(i) + 0.5F) / float(samples) - 0.5F,
                                       (float(j) + 0.5F) / float(samples) - 0.5F);
                sum += line_at(at + size_mm * offset);
            }
        return sum / float(samples * samples);
    }

    float line_at(glm::vec2 p) const {
        if (glm::length(p) > reach_mm_) return 0;
        const float half = width_mm_ / 2;
        float nearest = 2 * half;
        for (const Stroke& stroke : strokes_) nearest = std::min(nearest, distance_to(stroke, p));
        return 1 - smooth_step(0.35F * half, 1.65F * half, nearest);
    }

    std::vector<Stroke> strokes_;
    glm::vec3 middle_mm_{0}, normal_{0}, right_{0}, up_{0};
    float reach_mm_ = 0, width_mm_ = 1, ink_per_mm_ = 0;
    Fbm uneven_;
};

}  // namespace

const Feature& tattoo_feature() {
    static const FeatureOf<Grown> feature{{
        "tattoo",
        "Tattoo",
        "A small motif in fine lines on temple, cheek or neck: the seed chooses; paint the ink map for one of your own",
        "line widths of a fine needle; how much ink a line holds is a guess",
        {{LayerChannel::ink_per_mm, 0, most_ink_per_mm}},
    }};
    return feature;
}

}  // namespace sanguine
