// Oil by zones: forehead, nose and chin shine, cheeks and lids do not, and it comes out of pores.
#include <algorithm>

#include "feature_of.hpp"
#include "list.hpp"
#include "spots.hpp"
#include "standard_face.hpp"

namespace sanguine {
namespace {

constexpr float least = -1, most = 1.2F;

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person& person, std::uint64_t seed)
        : surface_(surface), uneven_{9, 4, 0.6F, std::uint32_t(seed)} {
        // Sebum falls from the sixth decade on, in women first; children have little.
        const float age = float(person.age_years), man = float(person.masculinity);
        const float years = smooth_step(8, 16, age) * (1 - (0.6F - 0.35F * man) * smooth_step(45, 70, age));
        zone_ = by_region(surface, {{"forehead", 0.5F}, {"nose", 0.75F}, {"chin", 0.4F}, {"cheeks", -0.2F},
                                    {"eyelids", -0.5F}, {"ears", -0.15F}, {"lips", -0.8F}, {"neck", -0.45F}}, -0.15F);
        for (float& z : zone_) z = z > 0 ? z * years * (1 + 0.15F * man) : z - 0.3F * (1 - years);
        std::vector<float> density = zone_;
        for (float& d : density) d = std::clamp(d, 0.0F, 0.75F) * 1.6F;
        drops_ = {surface, std::move(density), 0.5F, 0.7F, seed, [](Random& random, const Seedling&) {
                      const float lot = random.uniform(0, 1);
                      return ScatteredSpots::Mark{0.12F + 0.25F * lot * lot, random.uniform(0.2F, 0.9F)};
                  }};
    }

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        for (std::size_t i = 0; i < places.size(); ++i) {
            const SkinPlace& place = places[i];
            const float zone = surface_.value_at(place.point, zone_);
            const float film = zone + 0.6F * uneven_(place.place_mm, place.size_mm);
            out[i] = std::clamp(film + drops_(place, place.place_mm), least, most);
        }
    }

private:
    const SkinSurface& surface_;
    Fbm uneven_;
    std::vector<float> zone_;
    ScatteredSpots drops_;
};

}  // namespace

const Feature& sebum_feature() {
    static const FeatureOf<Grown> feature{{
        "sebum",
        "Oil zones",
        "Oil on forehead, nose and chin, less on cheeks, lids and neck, and fine drops at the pores",
        "the zones: Youn et al. 2005, Skin Res. Technol. 11:189; fall from the sixth decade on: Kikuchi 2016; "
        "the amounts are guesses",
        {{LayerChannel::log_oil, least, most}},
    }};
    return feature;
}

}  // namespace sanguine
