// The uneven ground of all skin: soft patches of more and less blood, oxygen and pigment.
#include <algorithm>

#include "feature_of.hpp"
#include "list.hpp"
#include "noise.hpp"
#include "standard_face.hpp"

namespace sanguine {
namespace {

constexpr float blood = 0.5F, pigment = 0.3F, oxygen = 0.08F;

/// Noise has a standard deviation of about a fifth: spread to most of -1 to 1, the extremes cut softly.
float spread(float noise) {
    const float x = std::clamp(2.4F * noise, -1.0F, 1.0F);
    return x * (1.5F - 0.5F * x * x);
}

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person& person, std::uint64_t seed)
        : surface_(surface),
          blood_{30, 4, 0.55F, std::uint32_t(seed)},
          pigment_{36, 4, 0.5F, std::uint32_t(seed >> 32)},
          oxygen_{40, 2, 0.5F, std::uint32_t(mix(seed))},
          uneven_(0.5F + 0.5F * smooth_step(15, 70, float(person.age_years)) * (0.4F + 0.6F * float(person.sun))) {
        // Blood varies most where vessels are most; the scalp's and the neck's colour is more even.
        reach_ = by_region(surface, {{"cheeks", 1}, {"nose", 1}, {"ears", 0.9F}, {"chin", 0.9F}, {"forehead", 0.8F},
                                     {"lips", 0.3F}, {"eyelids", 0.5F}, {"neck", 0.75F}}, 0.6F);
    }

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        for (std::size_t i = 0; i < places.size(); ++i) {
            const SkinPlace& place = places[i];
            const float reach = std::min(1.0F, surface_.value_at(place.point, reach_));
            out[3 * i] = blood * reach * spread(blood_(place.place_mm, place.size_mm));
            out[3 * i + 1] = pigment * uneven_ * spread(pigment_(place.place_mm, place.size_mm));
            out[3 * i + 2] = oxygen * reach * spread(oxygen_(place.place_mm, place.size_mm));
        }
    }

private:
    const SkinSurface& surface_;
    Fbm blood_, pigment_, oxygen_;
    float uneven_;
    std::vector<float> reach_;
};

}  // namespace

const Feature& splotches_feature() {
    static const FeatureOf<Grown> feature{{
        "splotches",
        "Splotches",
        "Soft patches of 10 to 40 mm with more or less blood, oxygen and pigment, as all skin has them",
        "guesses, made by eye on portraits; pigment grows uneven with age and sun",
        {{LayerChannel::log_hemoglobin, -blood, blood},
         {LayerChannel::log_melanin, -pigment, pigment},
         {LayerChannel::oxygenation, -oxygen, oxygen}},
    }};
    return feature;
}

}  // namespace sanguine
