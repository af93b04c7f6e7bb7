// Telangiectases: fine red vessels that have widened for good, at the wings of the nose and on the cheeks.
#include <algorithm>
#include <cmath>

#include "feature_of.hpp"
#include "list.hpp"
#include "noise.hpp"
#include "random.hpp"
#include "scatter.hpp"
#include "standard_face.hpp"
#include "vessel_paint.hpp"
#include "vessel_tree.hpp"

namespace sanguine {
namespace {

constexpr float strongest = 2.0F;
constexpr float contrast = 2.1F;        // of log_hemoglobin inside of a vessel: a guess by eye
constexpr float halo = 0.2F;           // share of it in the flush around: a guess
constexpr float step_mm = 0.25F;
constexpr float degree = 3.14159265F / 180;

/// Share of the face that they cover. Median 0.95 % in women and 0.76 % in men at a median age of 66.9, measured on
/// photographs (Hamer et al., Rotterdam Study); 1.7 % more per year (Mekic et al. 2020, J. Eur. Acad. Dermatol.
/// Venereol. 34:821). The sun's factor (0.5 to 1.5) and the absence in children are guesses; that sun and age act
/// together: Kennedy et al. 2003, J. Invest. Dermatol. 120:548.
float covered_share(const Person& person) {
    const float age = float(person.age_years);
    const float sex = 0.0095F + (0.0076F - 0.0095F) * float(person.masculinity);
    return sex * std::exp(0.017F * (age - 66.9F)) * (0.5F + float(person.sun)) * smooth_step(5, 25, age);
}

VesselHabit habit_of(const VesselTip&) {
    VesselHabit habit;
    habit.spacing_mm = 0.6F;
    habit.fork_every_mm = 1.5F;
    habit.fork_angle = degree * 42;
    habit.fork_angle_spread = degree * 14;
    habit.side_ratio = 0.75F;
    habit.yield = 0.4F;
    habit.wander_per_mm = 0.33F;
    habit.wander_length_mm = 0.9F;
    habit.least_radius_mm = 0.045F;  // 0.1 mm is about the thinnest vessel that an eye tells from redness
    habit.longest_mm = 6;
    return habit;
}

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person& person, std::uint64_t seed) {
        const std::vector<float> density = density_per_mm2(surface);
        const float target_mm2 = covered_share(person) * float(face_mm2(surface));
        std::vector<Seedling> seedlings = scatter(surface, density, 0.3F, seed);
        std::ranges::stable_sort(seedlings, {}, &Seedling::random);
        VesselTree tree(surface, habit_of, step_mm, seed);
        float covered_mm2 = 0;
        std::size_t counted = 0;
        for (const Seedling& s : seedlings) {
            if (covered_mm2 >= target_mm2) break;
            if (!tree.is_free(s.place_mm, s.normal, 1)) continue;
            Random random(s.random);
            const glm::vec3 any(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
            const float lot = random.uniform(0, 1);
            tree.plant(s.point, any, 0.085F + 0.1F * lot * lot * lot);
            tree.grow();
            for (; counted < tree.segments().size(); ++counted)
                covered_mm2 += 2 * tree.segments()[counted].radius_mm * step_mm;
        }

        const std::vector<float> to_end = tree.to_end_mm();
        std::vector<VesselStroke> strokes;
        for (std::size_t i = 0; i < to_end.size(); ++i) {
            const VesselSegment& s = tree.segments()[i];
            const float width = 2 * s.radius_mm, amount = contrast * width * smooth_step(-0.5F, 2, to_end[i]);
            // They lie in the upper dermis: the skin over them hardly blurs them.
            strokes.push_back({s.from_mm, s.to_mm, s.normal, std::sqrt(width * width / 12 + 0.05F * 0.05F),
                               {amount, 0}});
        }
        vessels_ = VesselPaint(std::move(strokes));
        std::vector<VesselStroke> flush;
        for (std::size_t i = 0; i < to_end.size(); i += 4) {
            const VesselSegment& s = tree.segments()[i];
            flush.push_back({s.from_mm, s.to_mm, s.normal, 1.2F, {4 * halo * contrast * 2 * s.radius_mm, 0}});
        }
        flush_ = VesselPaint(std::move(flush));
    }

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        for (std::size_t i = 0; i < places.size(); ++i)
            out[i] = held_below(strongest, vessels_.at(places[i]).x + flush_.at(places[i]).x);
    }

private:
    static double face_mm2(const SkinSurface& surface) {
        double sum = 0;
        for (const char* id : {"lips", "eyelids", "nose", "cheeks", "forehead", "chin"}) {
            const auto weight = surface.region(id);
            for (std::size_t i = 0; i < surface.triangles().size(); ++i)
                for (int k = 0; k < 3; ++k)
                    sum += surface.triangle_area_mm2()[i] / 3 * weight[surface.triangles()[i][k]];
        }
        return sum;
    }

    /// More seeds than are used; where they are dense, vessels are.
    static std::vector<float> density_per_mm2(const SkinSurface& surface) {
        const auto nose = surface.region("nose"), cheeks = surface.region("cheeks"), chin = surface.region("chin");
        const auto frame = StandardFace::of(surface);
        std::vector<float> density(nose.size());
        for (std::size_t v = 0; v < density.size(); ++v) {
            float wing = 0;
            if (frame) {
                const glm::vec3 p = frame->standard(surface.position_mm()[v]);
                wing = smooth_step(6, 13, std::abs(p.x)) * (1 - smooth_step(-30, -20, p.z));
            }
            density[v] = 0.2F * (cheeks[v] * cheeks[v] + nose[v] * (0.25F + 10 * wing) + 0.12F * chin[v]);
        }
        return density;
    }

    VesselPaint vessels_, flush_;
};

}  // namespace

const Feature& telangiectasia_feature() {
    static const FeatureOf<Grown> feature{{
        "telangiectasia",
        "Telangiectasia",
        "Fine red vessels of 0.1 to 0.4 mm at the wings of the nose and on the cheeks; more with age and sun",
        "area covered: Hamer et al. (Rotterdam Study); age, sex: Mekic et al. 2020, J. Eur. Acad. Dermatol. "
        "Venereol. 34:821; sun: Kennedy et al. 2003, J. Invest. Dermatol. 120:548; form and contrast are guesses",
        {{LayerChannel::log_hemoglobin, 0, strongest}},
    }};
    return feature;
}

}  // namespace sanguine
