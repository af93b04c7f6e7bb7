// Ephelides: small flecks of pigment on the sun-lit middle of the face.
#include <algorithm>

#include "feature_of.hpp"
#include "list.hpp"
#include "spots.hpp"
#include "standard_face.hpp"

namespace sanguine {
namespace {

constexpr float strongest = 1.5F;
constexpr float aside_mm = 0.5F;

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person& person, std::uint64_t seed)
        : rim_{1.4F, 2, 0.5F, std::uint32_t(seed)} {
        const float sun = float(person.sun);
        const Fbm patches{22, 3, 0.6F, std::uint32_t(seed >> 32)};
        std::vector<float> density =
            by_region(surface, {{"nose", 1}, {"cheeks", 1}, {"forehead", 0.5F}, {"chin", 0.3F}, {"eyelids", 0.45F},
                                {"lips", 0.05F}, {"ears", 0.2F}, {"neck", 0.05F}}, 0.12F);
        for (std::size_t v = 0; v < density.size(); ++v) {
            const float cluster = smooth_step(-0.3F, 0.35F, patches(surface.position_mm()[v], 0));
            // At most 30 in a square centimetre, the faintest included.
            density[v] *= 0.3F * (0.1F + 0.9F * sun) * (0.12F + 0.88F * cluster);
        }
        spots_ = {surface, std::move(density), 0.2F, 0.6F, seed, [&](Random& random, const Seedling&) {
                      // Many are small and faint; the large ones are darker.
                      const float large = random.uniform(0, 1) * random.uniform(0, 1);
                      const float radius = 0.35F + 1.15F * large * large + random.uniform(0, 0.25F);
                      const float dark = 0.25F + 0.45F * large + random.uniform(0, 0.3F);
                      return ScatteredSpots::Mark{radius, dark * (0.45F + 0.85F * sun)};
                  }, aside_mm};
    }

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        for (std::size_t i = 0; i < places.size(); ++i) {
            const glm::vec3 aside = spots_.spots().near(places[i].place_mm)
                                        ? aside_mm * rim_.vector(places[i].place_mm, places[i].size_mm)
                                        : glm::vec3(0);
            out[i] = std::min(strongest, spots_(places[i], places[i].place_mm + aside));
        }
    }

private:
    Fbm rim_;
    ScatteredSpots spots_;
};

}  // namespace

const Feature& freckles_feature() {
    static const FeatureOf<Grown> feature{{
        "freckles",
        "Freckles",
        "Ephelides: flecks of 1 to 3 mm over nose, cheeks and forehead; more and darker with sun",
        "Bastiaens et al. 2004, Pigment Cell Res. 17:225 (1-3 mm, where); number and contrast are guesses",
        {{LayerChannel::log_melanin, 0, strongest}},
    }};
    return feature;
}

}  // namespace sanguine
