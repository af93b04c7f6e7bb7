// Veins that show through the skin: temple, forehead, lids, neck. Blue, because deep and poor in oxygen.
#include <algorithm>
#include <cmath>

#include "feature_of.hpp"
#include "list.hpp"
#include "noise.hpp"
#include "random.hpp"
#include "standard_face.hpp"
#include "vessel_paint.hpp"
#include "vessel_tree.hpp"

namespace sanguine {
namespace {

constexpr float most_blood = 0.5F, most_oxygen = 0.5F, most_height_mm = 0.3F;
constexpr float step_mm = 1;
constexpr float degree = 3.14159265F / 180;

// In the middle of a vein without any skin over it: guesses by eye. Venous blood of the face has two thirds of the
// oxygen of arterial blood, but what makes a vein blue is the depth of 0.5 mm and more (Kienle et al. 1996, Appl. Opt.
// 35:1151), which one layer of dermis can only say as less oxygen.
constexpr float blood_contrast = 0.85F, oxygen_contrast = 1.1F;

/// A vein of the left half of a standard face (see StandardFace), and how it runs from there.
struct Root {
    glm::vec3 place, course;
    float radius_mm, longest_mm;
    float fork_every_mm;
    float depth_mm;   ///< what lies over it blurs it by as much
    float height_mm;  ///< of the skin over it
};

// Diameters: sentinel vein 1.9 +- 0.8 mm, 27 mm from the outer corner of the eye (Yang et al. 2015, Surg. Radiol. Anat.
// 37:175); the middle temporal vein has 3 mm (CT angiographies of 150 patients) but lies under fascia. Courses:
// anatomical atlases. The rest are guesses.
constexpr Root roots[] = {
    {{6, -17, 13}, {0.05F, 0, 1}, 0.65F, 70, 20, 0.9F, 0.10F},           // supratrochlear (frontal)
    {{27, -10, 14}, {0.35F, 0.3F, 1}, 0.5F, 55, 18, 0.9F, 0.08F},        // supraorbital
    {{69, 56, 2}, {-0.35F, -0.7F, 0.75F}, 0.85F, 95, 22, 0.8F, 0.28F},   // superficial temporal, frontal branch
    {{63, 28, 20}, {-0.6F, -0.8F, -0.5F}, 0.8F, 24, 11, 0.8F, 0.15F},    // sentinel
    {{15, -9, -7}, {1, 0.35F, -0.08F}, 0.36F, 26, 7, 0.7F, 0},           // lower lid, from the inner corner
    {{44, 4, -9}, {-1, -0.3F, -0.15F}, 0.36F, 22, 7, 0.7F, 0},          // lower lid, from the outer corner
    {{18, -9, 7}, {1, 0.1F, 0.2F}, 0.3F, 24, 8, 0.6F, 0},               // upper lid
    {{14, -14, -5}, {0.3F, -0.1F, -1}, 0.45F, 42, 18, 1.1F, 0},          // angular, beside the nose
    {{57, 66, -84}, {-0.05F, -0.1F, -1}, 1.15F, 110, 45, 2.8F, 0.12F},   // external jugular
    {{13, 14, -112}, {0, 0.1F, -1}, 0.85F, 80, 35, 2.8F, 0.05F},          // anterior jugular
};

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person& person, std::uint64_t seed) {
        const auto frame = StandardFace::of(surface);
        if (!frame) return;  // a face whose eyes are not known: no place is a temple
        std::vector<const Root*> root_of;
        VesselTree tree(
            surface, [&](const VesselTip& tip) { return habit(*root_of[tip.tree], tip); }, step_mm, seed);
        Random random(seed);
        // Thicker in men, nearer to the eye under the thin skin of age: guesses.
        const float thick = 0.9F + 0.2F * float(person.masculinity);
        const float thin_skin = 0.85F + 0.3F * smooth_step(20, 80, float(person.age_years));
        for (const Root& root : roots)
            for (const float side : {1.0F, -1.0F}) {
                const glm::vec3 mirror(side, 1, 1);
                const glm::vec3 aside(random.uniform(-2.5F, 2.5F), 0, random.uniform(-2.5F, 2.5F));
                const float lot = random.uniform(0.55F, 1.2F);  // one side is often the stronger one
                root_of.push_back(&root);
                course_side_.push_back(side);
                tree.plant(nearest_point(surface, frame->place_mm(mirror * root.place + aside)), mirror * root.course,
                           root.radius_mm * thick * lot * frame->scale());
            }
        tree.grow();

        const Fbm depth{22, 2, 0.5F, std::uint32_t(seed)};
        const std::vector<float> to_end = tree.to_end_mm();
        std::vector<VesselStroke> strokes;
        for (std::size_t i = 0; i < to_end.size(); ++i) {
            const VesselSegment& s = tree.segments()[i];
            const Root& root = *root_of[s.tree];
            const float begun = s.order == 0 ? smooth_step(0, 8, s.travelled_mm) : smooth_step(0, 3, s.travelled_mm);
            const float shown = thin_skin * begun * smooth_step(0, 8, to_end[i]) *
                                (0.3F + 0.7F * smooth_step(-0.25F, 0.25F, depth(s.to_mm, 0)));
            const float width = 2 * s.radius_mm;
            const float blur = std::sqrt(width * width / 12 + 0.7F * 0.7F * root.depth_mm * root.depth_mm);
            strokes.push_back(
                {s.from_mm, s.to_mm, s.normal, blur, width * shown * glm::vec2(1, 2.2F * root.height_mm)});
        }
        paint_ = VesselPaint(std::move(strokes));
    }

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        for (std::size_t i = 0; i < places.size(); ++i) {
            const glm::vec2 sum = paint_.at(places[i]);
            out[3 * i] = held_below(most_blood, blood_contrast * sum.x);
            out[3 * i + 1] = -held_below(most_oxygen, oxygen_contrast * sum.x);
            out[3 * i + 2] = held_below(most_height_mm, sum.y);
        }
    }

private:
    VesselHabit habit(const Root& root, const VesselTip& tip) const {
        VesselHabit habit;
        habit.spacing_mm = 3;
        habit.fork_every_mm = root.fork_every_mm;
        habit.fork_angle = degree * 42;
        habit.fork_angle_spread = degree * 8;
        habit.side_ratio = 0.75F;
        habit.yield = 0.4F;
        habit.wander_per_mm = 0.09F;
        habit.wander_length_mm = 4;
        habit.pull = (tip.order == 0 ? 0.12F : 0.03F) * glm::vec3(course_side_[tip.tree], 1, 1) * root.course;
        habit.least_radius_mm = 0.2F;
        habit.longest_mm = root.longest_mm * (tip.order == 0 ? 1.0F : 0.4F);
        return habit;
    }

    std::vector<float> course_side_;  // of each tree
    VesselPaint paint_;
};

}  // namespace

const Feature& veins_feature() {
    static const FeatureOf<Grown> feature{{
        "veins",
        "Veins",
        "Bluish veins of 0.5 to 2 mm under thin skin: temple, forehead, lids, neck; needs the region 'eyelids'",
        "diameters: Yang et al. 2015, Surg. Radiol. Anat. 37:175; why blue: Kienle et al. 1996, Appl. Opt. "
        "35:1151; courses after anatomical atlases, contrast a guess",
        {{LayerChannel::log_hemoglobin, 0, most_blood},
         {LayerChannel::oxygenation, -most_oxygen, 0},
         {LayerChannel::height_mm, 0, most_height_mm}},
    }};
    return feature;
}

}  // namespace sanguine
