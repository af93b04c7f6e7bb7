// Melanocytic nevi of face and neck: flat ones and domes.
#include <algorithm>

#include "feature_of.hpp"
#include "list.hpp"
#include "spots.hpp"
#include "standard_face.hpp"

namespace sanguine {
namespace {

constexpr float strongest = 2.2F;
constexpr float highest_mm = 1.2F;
constexpr float aside_mm = 0.7F;

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person& person, std::uint64_t seed)
        : rim_{2.5F, 3, 0.5F, std::uint32_t(seed)}, mottle_{1.2F, 2, 0.5F, std::uint32_t(seed >> 32)} {
        // They come in youth, are most at 20 to 30 and fade after 60. A face and neck of 700 cm^2 then has about 15.
        const float age = float(person.age_years);
        const float many = smooth_step(2, 22, age) * (1 - 0.6F * smooth_step(45, 85, age));
        std::vector<float> density = by_region(surface, {{"lips", 0.1F}, {"eyelids", 0.3F}, {"ears", 0.5F}}, 1);
        for (float& d : density) d *= 2.1e-4F * many * (0.7F + 0.6F * float(person.sun));
        const float domes = 0.3F + 0.3F * smooth_step(20, 60, age);  // share of raised ones, growing with age
        struct Mole {
            float radius_mm, dark, high_mm;
        };
        const auto mole = [domes](Random& random) {
            // Half are smaller than 2 mm, one in twenty larger than 5 mm.
            const float lot = random.uniform(0, 1);
            const float radius = 0.5F + 0.9F * lot + 1.9F * lot * lot * lot * lot * lot * lot;
            const bool dome = random.uniform(0, 1) < domes;
            // Domes lose their pigment with the years.
            return Mole{radius, dome ? random.uniform(0.5F, 1.5F) : random.uniform(1.2F, strongest),
                        dome ? radius * random.uniform(0.25F, 0.5F) : 0};
        };
        // The same seed: the same moles.
        pigment_ = {surface, density, 0.2F, 0.35F, seed, [&](Random& random, const Seedling&) {
                        const Mole m = mole(random);
                        return ScatteredSpots::Mark{m.radius_mm, m.dark};
                    }, aside_mm};
        relief_ = {surface, density, 0.2F, 0.7F, seed, [&](Random& random, const Seedling&) {
                       const Mole m = mole(random);
                       return ScatteredSpots::Mark{m.radius_mm, m.high_mm};
                   }, aside_mm};
    }

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        for (std::size_t i = 0; i < places.size(); ++i) {
            const SkinPlace& place = places[i];
            const bool near = pigment_.spots().near(place.place_mm) || relief_.spots().near(place.place_mm);
            const glm::vec3 aside = near ? aside_mm * rim_.vector(place.place_mm, place.size_mm) : glm::vec3(0);
            const glm::vec3 lookup = place.place_mm + aside;
            const float dark = pigment_(place, lookup);
            out[2 * i] = dark == 0 ? 0
                                   : std::clamp(dark * (1 + 0.35F * mottle_(place.place_mm, place.size_mm)), 0.0F,
                                                strongest);
            out[2 * i + 1] = std::min(highest_mm, relief_(place, lookup));
        }
    }

private:
    Fbm rim_, mottle_;
    ScatteredSpots pigment_, relief_;
};

}  // namespace

const Feature& moles_feature() {
    static const FeatureOf<Grown> feature{{
        "moles",
        "Moles",
        "Melanocytic nevi on face and neck, 1 to 6 mm, flat and dark or raised and paler",
        "sizes and share of raised ones: Evolution of melanocytic nevi on the faces and necks of adolescents (4-year "
        "study); domes by age: Witt and Krengel 2010, Dermatol. Online J. 16(1):1; number and contrast are guesses",
        {{LayerChannel::log_melanin, 0, strongest}, {LayerChannel::height_mm, 0, highest_mm}},
    }};
    return feature;
}

}  // namespace sanguine
