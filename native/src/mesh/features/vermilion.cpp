// The red of the lips: blood near the surface under little pigment, with fine lines across.
#include <algorithm>
#include <cmath>

#include "feature_of.hpp"
#include "list.hpp"
#include "noise.hpp"
#include "standard_face.hpp"

namespace sanguine {
namespace {

constexpr float most_blood = 1.6F, least_pigment = -0.4F, most_oxygen = 0.12F, deepest_mm = -0.08F;

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person&, std::uint64_t seed)
        : surface_(surface),
          lips_(surface.region("lips")),
          middle_(middle_mm(surface, "lips")),
          edge_{2.2F, 3, 0.6F, std::uint32_t(seed)},
          uneven_{9, 3, 0.5F, std::uint32_t(seed >> 32)},
          lines_seed_(std::uint32_t(mix(seed))) {}

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        std::ranges::fill(out, 0.0F);
        for (std::size_t i = 0; i < places.size(); ++i) {
            const SkinPlace& place = places[i];
            const float weight = surface_.value_at(place.point, lips_);
            if (weight < 0.1F) continue;
            const float edge = weight + 0.15F * edge_(place.place_mm, place.size_mm);
            const float lip = smooth_step(0.38F, 0.62F, edge);
            // The line: the outermost part is paler and even, the red stands a millimetre inside.
            const float inner = smooth_step(0.45F, 0.95F, edge);
            const float groove = lip * groove_at(place);
            out[4 * i] = std::clamp(lip * (0.75F + 0.45F * inner + 0.35F * uneven_(place.place_mm, place.size_mm)) +
                                        0.25F * groove,
                                    0.0F, most_blood);
            out[4 * i + 1] = std::max(least_pigment, -lip * (0.15F + 0.2F * inner));
            out[4 * i + 2] = most_oxygen * lip;  // well supplied
            out[4 * i + 3] = std::max(deepest_mm, -0.08F * groove);
        }
    }

private:
    /// Noise that runs across the lip: fine along the mouth, long from its rim to the other. The mouth bends round the
    /// teeth: an arc of 35 mm (a guess) unrolls it.
    float groove_at(const SkinPlace& place) const {
        constexpr float arc_mm = 35;
        const glm::vec3 p = place.place_mm - *middle_;
        const float along_mm = arc_mm * std::atan2(p.x, arc_mm - std::min(p.y, 0.8F * arc_mm));
        float sum = 0;
        for (const float wave_mm : {2.4F, 1.1F}) {
            const float share = held(wave_mm, place.size_mm);
            sum += 0.5F * (1 - share) * line_mean;
            if (share == 0) continue;
            // Sharp and narrow where the noise crosses zero.
            const glm::vec3 q(along_mm / wave_mm, p.y / 12, p.z / 9);
            sum += 0.5F * share * (1 - std::min(1.0F, 4 * std::abs(gradient_noise(q, lines_seed_))));
        }
        return sum;
    }
    static constexpr float line_mean = 0.327F;  // of the lines over much skin, counted

    const SkinSurface& surface_;
    std::span<const float> lips_;
    std::optional<glm::vec3> middle_;
    Fbm edge_, uneven_;
    std::uint32_t lines_seed_;
};

}  // namespace

const Feature& vermilion_feature() {
    static const FeatureOf<Grown> feature{{
        "vermilion",
        "Lip colour",
        "The red of the lips, with a soft border and fine lines across",
        "more hemoglobin than in any other skin of the face: Measurement of lip and skin pigmentation using "
        "reflectance spectrophotometry; how much, and how much less melanin, are guesses",
        {{LayerChannel::log_hemoglobin, 0, most_blood},
         {LayerChannel::log_melanin, least_pigment, 0},
         {LayerChannel::oxygenation, 0, most_oxygen},
         {LayerChannel::height_mm, deepest_mm, 0}},
    }};
    return feature;
}

}  // namespace sanguine
