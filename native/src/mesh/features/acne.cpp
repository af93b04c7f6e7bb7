// Acne: inflamed papules with their halo, and comedones.
#include <algorithm>

#include "feature_of.hpp"
#include "list.hpp"
#include "spots.hpp"
#include "standard_face.hpp"

namespace sanguine {
namespace {

constexpr float reddest = 1.5F;
constexpr float darkest = 1.2F;
constexpr float most_oxygen = 0.18F;
constexpr float highest_mm = 0.8F;
constexpr float aside_mm = 0.8F;

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person& person, std::uint64_t seed)
        : rim_{3, 2, 0.5F, std::uint32_t(seed)} {
        // Most at 14 to 22; fewer, but there, in grown-ups.
        const float age = float(person.age_years);
        const float many = smooth_step(9, 15, age) * (0.25F + 0.75F * (1 - smooth_step(20, 40, age)));
        const Fbm patches{30, 2, 0.5F, std::uint32_t(seed >> 32)};
        std::vector<float> where =
            by_region(surface, {{"forehead", 0.9F}, {"chin", 1}, {"cheeks", 0.8F}, {"nose", 0.35F}, {"lips", 0},
                                {"eyelids", 0.03F}, {"ears", 0.05F}, {"neck", 0.2F}}, 0.12F);
        for (std::size_t v = 0; v < where.size(); ++v)
            where[v] *= many * (0.25F + 0.75F * smooth_step(-0.35F, 0.2F, patches(surface.position_mm()[v], 0)));

        std::vector<float> papules = where, open = where, closed = where;
        for (float& d : papules) d *= 5e-3F;  // some 50 in a face of 300 cm^2, a marked acne
        for (float& d : open) d *= 6e-3F;
        for (float& d : closed) d *= 6e-3F;
        struct Papule {
            float radius_mm, fresh;
        };
        const auto papule = [](Random& random) {
            const float radius = random.uniform(0.7F, 2.2F);
            return Papule{radius, random.uniform(0.25F, 1)};
        };
        // The same seed: the same papules.
        const std::uint64_t one = seed_for(seed, "papules");
        red_ = {surface, papules, 0.3F, 0.5F, one, [&](Random& random, const Seedling&) {
                    const Papule p = papule(random);
                    return ScatteredSpots::Mark{p.radius_mm, 0.95F * p.fresh};
                }, aside_mm};
        halo_ = {surface, papules, 0.3F, 0.9F, one, [&](Random& random, const Seedling&) {
                     const Papule p = papule(random);
                     return ScatteredSpots::Mark{p.radius_mm * random.uniform(1.8F, 2.8F), 0.25F + 0.35F * p.fresh};
                 }, aside_mm};
        bump_ = {surface, papules, 0.3F, 0.8F, one, [&](Random& random, const Seedling&) {
                     const Papule p = papule(random);
                     return ScatteredSpots::Mark{0.9F * p.radius_mm, 0.3F * p.radius_mm * p.fresh};
                 }, aside_mm};
        open_ = {surface, std::move(open), 0.3F, 0.4F, seed_for(seed, "open"), [](Random& random, const Seedling&) {
                     return ScatteredSpots::Mark{random.uniform(0.2F, 0.5F), random.uniform(0.5F, 1)};
                 }};
        closed_ = {surface, std::move(closed), 0.3F, 0.8F, seed_for(seed, "closed"),
                   [](Random& random, const Seedling&) {
                       return ScatteredSpots::Mark{random.uniform(0.4F, 0.8F), random.uniform(0.08F, 0.2F)};
                   }};
    }

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        for (std::size_t i = 0; i < places.size(); ++i) {
            const SkinPlace& place = places[i];
            const bool near = red_.spots().near(place.place_mm) || halo_.spots().near(place.place_mm) ||
                              bump_.spots().near(place.place_mm);
            const glm::vec3 aside = near ? aside_mm * rim_.vector(place.place_mm, place.size_mm) : glm::vec3(0);
            const glm::vec3 lookup = place.place_mm + aside;
            float* layer = &out[4 * i];
            const float red = std::min(reddest, red_(place, lookup) + halo_(place, lookup));
            layer[0] = red;
            layer[1] = std::min(darkest, open_(place, place.place_mm));
            // Inflamed skin has more blood because more flows through: it keeps more of its oxygen.
            layer[2] = most_oxygen / reddest * red;
            layer[3] = std::min(highest_mm, bump_(place, lookup) + closed_(place, place.place_mm));
        }
    }

private:
    Fbm rim_;
    ScatteredSpots red_, halo_, bump_, open_, closed_;
};

}  // namespace

const Feature& acne_feature() {
    static const FeatureOf<Grown> feature{{
        "acne",
        "Acne",
        "Red papules of 2 to 4 mm with a halo, black and white heads, on forehead, chin and cheeks; most in youth",
        "a papule is below 5 mm by definition; the places are those of high sebum: Youn et al. 2005, Skin Res. "
        "Technol. 11:189; numbers and contrast are guesses",
        {{LayerChannel::log_hemoglobin, 0, reddest},
         {LayerChannel::log_melanin, 0, darkest},
         {LayerChannel::oxygenation, 0, most_oxygen},
         {LayerChannel::height_mm, 0, highest_mm}},
    }};
    return feature;
}

}  // namespace sanguine
