// What skin is at the scale of its pores: pits, plugs, and blood and pigment that are never even.
#include <algorithm>

#include "feature_of.hpp"
#include "list.hpp"
#include "spots.hpp"
#include "standard_face.hpp"

namespace sanguine {
namespace {

constexpr float blood = 0.35F, least_pigment = -0.2F, most_pigment = 0.6F;
constexpr float deepest_mm = -0.09F, highest_mm = 0.03F;

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person& person, std::uint64_t seed)
        : surface_(surface),
          blood_{3, 5, 0.8F, std::uint32_t(seed)},
          pigment_{2.2F, 5, 0.8F, std::uint32_t(seed >> 32)},
          relief_{0.6F, 2, 0.6F, std::uint32_t(mix(seed))} {
        // Openings in a square millimetre and their radius. Forehead: 2.9 follicles, small ones (Otberg). Nose and
        // cheeks show fewer and wider ones (of 0.25 mm and more on cheeks: Flament); the numbers there are guesses.
        std::vector<float> density =
            by_region(surface, {{"nose", 1.8F}, {"cheeks", 1.3F}, {"forehead", 2.9F}, {"chin", 1.8F}, {"lips", 0},
                                {"eyelids", 0.5F}, {"ears", 0.6F}, {"neck", 0.5F}}, 0.5F);
        const std::vector<float> radius_mm =
            by_region(surface, {{"nose", 0.2F}, {"cheeks", 0.15F}, {"forehead", 0.09F}, {"chin", 0.14F},
                                {"eyelids", 0.05F}}, 0.08F);
        // They widen with the years, and are wider in men.
        const float wide =
            0.85F + 0.25F * smooth_step(20, 50, float(person.age_years)) + 0.12F * float(person.masculinity);
        pits_ = {surface, std::move(density), 0.5F, 0.6F, seed, [&](Random& random, const Seedling& s) {
                     const float radius = wide * surface.value_at(s.point, radius_mm) * random.uniform(0.65F, 1.35F);
                     return ScatteredSpots::Mark{radius, std::min(1.0F, 4.5F * radius)};
                 }};
        lips_ = by_region(surface, {{"lips", 0}}, 1);
    }

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        for (std::size_t i = 0; i < places.size(); ++i) {
            const SkinPlace& place = places[i];
            const float pit = pits_(place, place.place_mm);
            const float skin = surface_.value_at(place.point, lips_);
            const auto noise = [&](const Fbm& fbm) { return fbm(place.place_mm, place.size_mm); };
            out[3 * i] = std::clamp(skin * 1.1F * noise(blood_), -blood, blood);
            out[3 * i + 1] = std::clamp(0.35F * pit + skin * 0.65F * noise(pigment_), least_pigment, most_pigment);
            out[3 * i + 2] =
                std::clamp(-0.08F * pit + skin * 0.04F * noise(relief_), deepest_mm, highest_mm);
        }
    }

private:
    const SkinSurface& surface_;
    Fbm blood_, pigment_, relief_;
    ScatteredSpots pits_;
    std::vector<float> lips_;
};

}  // namespace

const Feature& pores_feature() {
    static const FeatureOf<Grown> feature{{
        "pores",
        "Pores",
        "Pits of 0.1 to 0.5 mm, wider on nose and cheeks, and blood and pigment that vary at that scale; fades into "
        "its mean where texels are too large",
        "Otberg et al. 2004, J. Invest. Dermatol. 122:14 (292 follicles per cm^2 of forehead); Flament et al. 2015, "
        "Clin. Cosmet. Investig. Dermatol. 8:85 (visible pores from 0.25 mm); depth and contrast are guesses",
        {{LayerChannel::log_hemoglobin, -blood, blood},
         {LayerChannel::log_melanin, least_pigment, most_pigment},
         {LayerChannel::height_mm, deepest_mm, highest_mm}},
    }};
    return feature;
}

}  // namespace sanguine
