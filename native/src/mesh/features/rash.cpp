// A maculopapular rash: red spots that run together in patches of cheeks and neck.
#include <algorithm>

#include "feature_of.hpp"
#include "list.hpp"
#include "spots.hpp"
#include "standard_face.hpp"

namespace sanguine {
namespace {

constexpr float reddest = 1.3F;
constexpr float most_oxygen = 0.15F;
constexpr float highest_mm = 0.25F;
constexpr float aside_mm = 0.9F;

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person&, std::uint64_t seed)
        : surface_(surface), edge_{9, 3, 0.6F, std::uint32_t(seed)}, rim_{3, 2, 0.5F, std::uint32_t(seed >> 16)} {
        patch_ = by_region(surface, {{"cheeks", 1}, {"neck", 0.85F}, {"chin", 0.45F}, {"forehead", 0.4F},
                                     {"nose", 0.5F}, {"lips", 0}, {"eyelids", 0.1F}, {"ears", 0.3F}}, 0.3F);
        const Fbm patches{55, 2, 0.5F, std::uint32_t(seed >> 32)};
        std::vector<float> density(patch_.size());
        for (std::size_t v = 0; v < patch_.size(); ++v) {
            patch_[v] *= smooth_step(-0.3F, 0.12F, patches(surface.position_mm()[v], 0));
            density[v] = 0.04F * patch_[v] * patch_[v];  // close enough to touch where the patch is full
        }
        spots_ = {surface, std::move(density), 0.45F, 0.7F, seed, [](Random& random, const Seedling&) {
                      return ScatteredSpots::Mark{random.uniform(0.9F, 2.8F), random.uniform(0.3F, 0.7F)};
                  }, aside_mm};
    }

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        for (std::size_t i = 0; i < places.size(); ++i) {
            const SkinPlace& place = places[i];
            const float patch = surface_.value_at(place.point, patch_);
            if (patch == 0) {
                std::fill_n(&out[3 * i], 3, 0.0F);
                continue;
            }
            const glm::vec3 lookup = place.place_mm + aside_mm * rim_.vector(place.place_mm, place.size_mm);
            const float spots = spots_(place, lookup);
            // Where they stand dense the skin between them is red as well.
            const float between =
                smooth_step(0.3F, 0.95F, patch + 0.5F * edge_(place.place_mm, place.size_mm)) * 0.55F;
            out[3 * i] = std::min(reddest, between + spots);
            out[3 * i + 1] = most_oxygen / reddest * out[3 * i];  // more blood because more flows through
            out[3 * i + 2] = std::min(highest_mm, 0.18F * spots);
        }
    }

private:
    const SkinSurface& surface_;
    Fbm edge_, rim_;
    std::vector<float> patch_;
    ScatteredSpots spots_;
};

}  // namespace

const Feature& rash_feature() {
    static const FeatureOf<Grown> feature{{
        "rash",
        "Rash",
        "A maculopapular rash: red spots of 2 to 6 mm, slightly raised, running together on cheeks and neck",
        "the word's definition (macules and papules below 10 mm, confluent); sizes, numbers and redness are guesses",
        {{LayerChannel::log_hemoglobin, 0, reddest},
         {LayerChannel::oxygenation, 0, most_oxygen},
         {LayerChannel::height_mm, 0, highest_mm}},
    }};
    return feature;
}

}  // namespace sanguine
