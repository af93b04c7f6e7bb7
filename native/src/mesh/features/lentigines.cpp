// Solar lentigines: the larger, uneven patches of pigment of skin that has seen much sun for long.
#include <algorithm>

#include "feature_of.hpp"
#include "list.hpp"
#include "spots.hpp"
#include "standard_face.hpp"

namespace sanguine {
namespace {

constexpr float strongest = 1.4F;
constexpr float aside_mm = 3.2F;

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person& person, std::uint64_t seed)
        : rim_{7, 4, 0.6F, std::uint32_t(seed)}, mottle_{2.5F, 3, 0.6F, std::uint32_t(seed >> 32)} {
        // Seen from the age of 30 to 40 in sun, in most people at 60.
        const float years = smooth_step(25, 75, float(person.age_years));
        const float exposed = years * (0.15F + 0.85F * float(person.sun));
        std::vector<float> density =
            by_region(surface, {{"forehead", 1}, {"cheeks", 1}, {"nose", 0.5F}, {"ears", 0.4F}, {"chin", 0.25F},
                                {"eyelids", 0.2F}, {"lips", 0}, {"neck", 0.2F}}, 0.45F);
        for (float& d : density) d *= 1.8e-3F * exposed;  // 1 to 2 in 10 cm^2 in an old face: a guess
        spots_ = {surface, std::move(density), 0.3F, 0.25F, seed, [&](Random& random, const Seedling&) {
                      const float large = random.uniform(0, 1);
                      return ScatteredSpots::Mark{1.5F + 3.5F * large * large + random.uniform(0, 0.8F),
                                                  random.uniform(0.35F, 0.85F) * (0.6F + 0.5F * exposed)};
                  }, aside_mm};
    }

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        for (std::size_t i = 0; i < places.size(); ++i) {
            const SkinPlace& place = places[i];
            const glm::vec3 aside = spots_.spots().near(place.place_mm)
                                        ? aside_mm * rim_.vector(place.place_mm, place.size_mm)
                                        : glm::vec3(0);
            const float value = spots_(place, place.place_mm + aside);
            out[i] = value == 0 ? 0
                                : std::min(strongest, value * (1 + 0.9F * mottle_(place.place_mm, place.size_mm)));
        }
    }

private:
    Fbm rim_, mottle_;
    ScatteredSpots spots_;
};

}  // namespace

const Feature& lentigines_feature() {
    static const FeatureOf<Grown> feature{{
        "lentigines",
        "Age spots",
        "Solar lentigines: uneven brown patches of 3 to 12 mm on forehead, temples and cheeks; with age and sun",
        "Bastiaens et al. 2004, Pigment Cell Res. 17:225 (size, age, sun); number and contrast are guesses",
        {{LayerChannel::log_melanin, 0, strongest}},
    }};
    return feature;
}

}  // namespace sanguine
