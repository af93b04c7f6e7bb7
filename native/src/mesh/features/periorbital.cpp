// Dark circles: pigment and slow blood in the thin skin round the eyes, most below the inner corner.
#include <algorithm>
#include <cmath>

#include "feature_of.hpp"
#include "list.hpp"
#include "noise.hpp"
#include "standard_face.hpp"

namespace sanguine {
namespace {

constexpr float pigment = 0.75F, blood = 0.5F, oxygen = -0.25F;

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person&, std::uint64_t seed)
        : surface_(surface), uneven_{12, 3, 0.5F, std::uint32_t(seed)} {
        const auto lids = surface.region("eyelids");
        dark_.assign(surface.position_mm().size(), 0);
        const auto face = StandardFace::of(surface);
        if (!face) return;
        for (std::size_t v = 0; v < dark_.size(); ++v) {
            const glm::vec3 p = face->standard(surface.position_mm()[v]);
            const float out = std::abs(p.x) - StandardFace::eyes_mm / 2, up = p.z;
            // The hollow follows the rim of the orbit: lowest under the pupil, rising to both corners.
            const float rim = -10.5F + 0.02F * (out + 4) * (out + 4);
            const float below = 1 - smooth_step(1, up > rim ? 7 : 11, std::abs(up - rim));
            const float width = 1 - smooth_step(9, 22, std::abs(out + 4));
            const float before = 1 - smooth_step(18, 40, std::abs(p.y));
            const float facing = smooth_step(-0.2F, 0.3F, -surface.normal()[v].y);
            const float hollow = below * width * before * facing * std::clamp(0.9F - 0.02F * out, 0.4F, 1.2F);
            dark_[v] = std::min(1.0F, 0.95F * hollow + lids[v] * (up > -2 ? 0.4F : 0.3F) * facing);
        }
    }

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        for (std::size_t i = 0; i < places.size(); ++i) {
            const float dark = surface_.value_at(places[i].point, dark_);
            const float here =
                dark == 0 ? 0
                          : std::min(1.0F, dark * (0.85F + 0.5F * uneven_(places[i].place_mm, places[i].size_mm)));
            out[3 * i] = blood * here;
            out[3 * i + 1] = pigment * here;
            out[3 * i + 2] = oxygen * here;
        }
    }

private:
    const SkinSurface& surface_;
    Fbm uneven_;
    std::vector<float> dark_;
};

}  // namespace

const Feature& periorbital_feature() {
    static const FeatureOf<Grown> feature{{
        "periorbital",
        "Dark circles",
        "Darkness round the eyes, most below the inner corners: pigment and blood that has given its oxygen",
        "more melanin first, less oxygen second: Peri-orbital dark circles in the Brazilian population 2015, An. Bras. "
        "Dermatol. 90(4), doi 10.1590/abd1806-4841.20153520; Ohshima and Takiwaki 2008, Skin Res. Technol. 14:135; "
        "the amounts are guesses",
        {{LayerChannel::log_hemoglobin, 0, blood},
         {LayerChannel::log_melanin, 0, pigment},
         {LayerChannel::oxygenation, oxygen, 0}},
    }};
    return feature;
}

}  // namespace sanguine
