// Ephelides: small flecks of pigment on the sun-lit middle of the face.
#include <cmath>

#include "list.hpp"
#include "random.hpp"
#include "scatter.hpp"
#include "spots.hpp"

namespace sanguine {
namespace {

constexpr float softness = 0.6F;
constexpr float strongest = 1.4F;

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person& person, std::uint64_t seed)
        : surface_(surface), rim_{1.6F, 2, 0.5F, std::uint32_t(seed)} {
        const float sun = float(person.sun);
        const auto nose = surface.region("nose"), cheeks = surface.region("cheeks");
        const auto forehead = surface.region("forehead"), chin = surface.region("chin");
        const Fbm patches{25, 2, 0.5F, std::uint32_t(seed >> 32)};
        // At most 9 in a square centimetre: counted on portraits, a guess as a population figure.
        const float most_per_mm2 = 0.09F * (0.15F + 0.85F * sun);
        density_.resize(surface.position_mm().size());
        for (std::size_t v = 0; v < density_.size(); ++v) {
            const float here = std::min(1.0F, nose[v] + cheeks[v] + 0.45F * forehead[v] + 0.2F * chin[v]);
            const float cluster = smooth_step(-0.35F, 0.4F, patches(surface.position_mm()[v], 0));
            density_[v] = most_per_mm2 * here * here * (0.1F + 0.9F * cluster);
        }
        std::vector<Spot> spots;
        for (const Seedling& s : scatter(surface, density_, 0.3F, seed)) {
            Random random(s.random);
            // Most are small: diameters of 1 to 3 mm, few of 4.
            const float lot = random.uniform(0, 1);
            const float radius = 0.4F + 1.4F * lot * lot * lot + random.uniform(0, 0.3F);
            spots.push_back({s.place_mm, s.normal, radius, random.uniform(0.35F, 1) * (0.5F + 0.5F * sun)});
        }
        spots_ = Spots(std::move(spots), softness);
    }

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        for (std::size_t i = 0; i < places.size(); ++i) {
            const SkinPlace& place = places[i];
            const glm::vec3 aside = 0.45F * rim_.vector(place.place_mm, place.size_mm);
            const float mean = spots_.faded_mm2(place.size_mm) * surface_.value_at(place.point, density_);
            out[i] = std::min(strongest, spots_.sum(place, place.place_mm + aside) + mean);
        }
    }

private:
    const SkinSurface& surface_;
    Fbm rim_;
    std::vector<float> density_;
    Spots spots_;
};

class Freckles final : public Feature {
public:
    const FeatureRow& row() const override {
        static const FeatureRow row{
            "freckles",
            "Freckles",
            "Ephelides: flecks of 1 to 3 mm over nose, cheeks and forehead; more and darker with sun",
            "size 1-3 mm and places: Bastiaens et al. 2004, Pigment Cell Res. 17:225; density and contrast are guesses",
            {{LayerChannel::log_melanin, 0, strongest}},
        };
        return row;
    }
    std::unique_ptr<const GrownFeature> grow(const SkinSurface& surface, const Person& person,
                                             std::uint64_t seed) const override {
        return std::make_unique<Grown>(surface, person, seed_for(seed, row().id));
    }
};

}  // namespace

const Feature& freckles_feature() {
    static const Freckles feature;
    return feature;
}

}  // namespace sanguine
