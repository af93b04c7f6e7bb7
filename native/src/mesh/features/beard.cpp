// The shadow of a shaven beard: the dots of cut hairs, and the roots that shine through.
//
// Dots are pigment at the surface. Roots stand in the dermis, where a dark absorber looks blue-grey and not brown: that
// is what tattoo ink is to light, so they are written as ink.
#include <algorithm>
#include <cmath>

#include "feature_of.hpp"
#include "list.hpp"
#include "spots.hpp"
#include "standard_face.hpp"

namespace sanguine {
namespace {

constexpr float darkest = 1.6F;
constexpr float most_ink_per_mm = 0.07F;

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person& person, std::uint64_t seed) : surface_(surface) {
        roots_.assign(surface.position_mm().size(), 0);
        const auto face = StandardFace::of(surface);
        const auto lips = middle_mm(surface, "lips");
        const float man = float(person.masculinity) * smooth_step(13, 22, float(person.age_years));
        if (!face || !lips || man == 0) return;

        const auto bare =
            by_region(surface, {{"lips", 0}, {"nose", 0}, {"eyelids", 0}, {"forehead", 0}, {"ears", 0}}, 1);
        const Fbm edge{14, 3, 0.55F, std::uint32_t(seed)};
        const glm::vec3 mouth = face->standard(*lips);
        const float height = std::max(1.0F, -mouth.z), unit = StandardFace::eyes_mm;
        for (std::size_t v = 0; v < roots_.size(); ++v) {
            const glm::vec3 p = surface.position_mm()[v], q = face->standard(p);
            // Up: 0 at the mouth, 1 at the eyes. Out: 0 in the middle, 1 an eye distance aside. Back: the same, from
            // the mouth backward.
            const float soft = 0.16F * edge(p, 0);
            const float up = (q.z - mouth.z) / height + soft;
            const float out = std::abs(q.x) / unit, back = (q.y - mouth.y) / unit;
            // Upper limit of the hair: the moustache reaches the nose, the cheek is free above a line from the mouth's
            // corner to the sideburn.
            const float moustache = 0.42F - 1.6F * std::max(0.0F, out - 0.28F);
            const float cheek = -0.1F + 0.75F * smooth_step(0.3F, 1.25F, back + 0.35F * out);
            const float top = std::max(moustache, cheek);
            float density = 1 - smooth_step(-0.35F, 0.2F, up - top);
            density *= smooth_step(-1.15F, -0.75F, up);             // down to the larynx
            density *= 1 - smooth_step(1.25F, 1.5F, back - 0.1F * up);  // not behind the ears
            // Thickest on chin and lip, thinner on cheek and throat.
            const float middle = 1 - smooth_step(0.25F, 0.7F, out);
            density *= 0.55F + 0.45F * middle * smooth_step(-0.95F, -0.7F, up);
            roots_[v] = density * bare[v] * man;
        }
        std::vector<float> density = roots_;
        for (float& d : density) d *= 0.65F;  // hairs in a square millimetre of a full beard, 50 to 70 in a cm^2
        dots_ = {surface, std::move(density), 0.5F, 0.5F, seed, [&](Random& random, const Seedling&) {
                     // The hair of 0.12 to 0.17 mm in its follicle.
                     return ScatteredSpots::Mark{random.uniform(0.1F, 0.19F), random.uniform(1, darkest)};
                 }};
    }

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        for (std::size_t i = 0; i < places.size(); ++i) {
            const float root = surface_.value_at(places[i].point, roots_);
            out[2 * i] = root == 0 ? 0 : std::min(darkest, 0.25F * root + dots_(places[i], places[i].place_mm));
            out[2 * i + 1] = most_ink_per_mm * std::min(1.0F, root);
        }
    }

private:
    const SkinSurface& surface_;
    std::vector<float> roots_;  // 0 to 1 of a full beard, per vertex
    ScatteredSpots dots_;
};

}  // namespace

const Feature& beard_feature() {
    static const FeatureOf<Grown> feature{{
        "beard",
        "Beard shadow",
        "The shadow of a shaven beard on chin, jaw, upper lip and throat; needs masculinity",
        "hairs of 50 to 70 per cm^2 and 0.12 to 0.17 mm are common figures without a study behind them; the outline "
        "and the darkness are guesses",
        {{LayerChannel::log_melanin, 0, darkest}, {LayerChannel::ink_per_mm, 0, most_ink_per_mm}},
    }};
    return feature;
}

}  // namespace sanguine
