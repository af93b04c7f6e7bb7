// Small patches of more and less blood and pigment, without which skin looks like wax.
#include <algorithm>

#include "feature_of.hpp"
#include "list.hpp"
#include "noise.hpp"

namespace sanguine {
namespace {

constexpr float blood = 0.35F, pigment = 0.22F;
// Waves of 7, 3.5 and 1.8 mm (blood) and 6, 3 and 1.5 mm, the small ones weaker; spread to a standard deviation of about
// a fifth of the largest change.
constexpr float gain = 0.65F, spread = 1.2F;

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface&, const Person&, std::uint64_t seed)
        : blood_{7, 3, gain, std::uint32_t(seed)}, pigment_{6, 3, gain, std::uint32_t(seed >> 32)} {}

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        for (std::size_t i = 0; i < places.size(); ++i) {
            const auto patches = [&](const Fbm& fbm) {
                return std::clamp(spread * fbm(places[i].place_mm, places[i].size_mm), -1.0F, 1.0F);
            };
            out[2 * i] = blood * patches(blood_);
            out[2 * i + 1] = pigment * patches(pigment_);
        }
    }

private:
    Fbm blood_, pigment_;
};

}  // namespace

const Feature& mottle_feature() {
    static const FeatureOf<Grown> feature{{
        "mottle",
        "Mottle",
        "Unevenness of blood and pigment over 2 to 7 mm; fades into its mean where texels are too large",
        "guesses, made by eye for a few Delta E on light skin: no source gives the variance by scale",
        {{LayerChannel::log_hemoglobin, -blood, blood}, {LayerChannel::log_melanin, -pigment, pigment}},
    }};
    return feature;
}

}  // namespace sanguine
