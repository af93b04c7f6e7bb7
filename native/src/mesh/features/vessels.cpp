// The arterial trees of the face under its skin: where they are dense the skin is redder, between them it is paler.
#include <algorithm>
#include <cmath>
#include <memory>

#include <glm/geometric.hpp>

#include "feature_of.hpp"
#include "features/vessels.hpp"
#include "list.hpp"
#include "noise.hpp"
#include "random.hpp"
#include "scatter.hpp"
#include "standard_face.hpp"
#include "vessel_paint.hpp"
#include "vessel_tree.hpp"

namespace sanguine {
namespace {

constexpr float strongest = 0.6F;       // of log_hemoglobin
constexpr float palest = -0.12F;        // skin between the vessels
constexpr float most_oxygen = 0.05F;
constexpr float step_mm = 0.8F;
constexpr float degree = 3.14159265F / 180;

// What a vessel of a width adds to the logarithm of the blood over it, and the same for oxygenation: guesses by eye.
constexpr float contrast = 2.0F, oxygen_contrast = 0.12F;

// What the arteries feed is redder as well: the finest vessels, which are not grown one by one, as one vessel of this
// width that is blurred this far around. Guesses.
constexpr float fed_width_mm = 0.13F, fed_mm = 4;
constexpr std::size_t fed_every = 6;  // segments: nearer to each other than the blur

// The upper plexus lies 1 to 1.5 mm deep (Braverman 1997, Microcirculation 4:329); what is under skin of that depth
// shows with about half of it as blur, thicker vessels lie deeper. The factors are guesses.
float blur_mm(float radius_mm) { return 0.6F + 3 * radius_mm; }
/// What the skin over it leaves of a vessel: a guess.
float covered(float radius_mm) { return std::exp(-radius_mm / 0.5F); }

/// What a place wants of the vessels there.
struct Bed {
    float frond, candelabra;  ///< 0 to 1; intermediates between
    float richness;           ///< factor on what shows
    float spacing_mm;
    glm::vec3 course;         ///< where the vessels go, unit or 0

    static Bed mix(const Bed& a, const Bed& b, const Bed& c, glm::vec3 share) {
        return {a.frond * share.x + b.frond * share.y + c.frond * share.z,
                a.candelabra * share.x + b.candelabra * share.y + c.candelabra * share.z,
                a.richness * share.x + b.richness * share.y + c.richness * share.z,
                a.spacing_mm * share.x + b.spacing_mm * share.y + c.spacing_mm * share.z,
                a.course * share.x + b.course * share.y + c.course * share.z};
    }
};

// Spacing by region: small perforators stand dense in the middle of the face and sparse at its sides (Whetzel and
// Mathes 1992, Plast. Reconstr. Surg. 89:591); cheeks, nose, lips and ears are the richest (Moretti 1959). The numbers
// are guesses. `other` is what belongs to no region: scalp, jaw, shoulders.
struct RegionBed {
    std::string_view region;
    float frond, candelabra, richness, spacing_mm;
};
constexpr RegionBed region_beds[] = {
    {"forehead", 1, 0, 1, 2.8F},      {"nose", 1, 0, 1.5F, 1.8F},  {"cheeks", 0, 1, 1.6F, 2.1F},
    {"chin", 0, 1, 1.1F, 2.6F},       {"eyelids", 0.5F, 0, 1, 2.6F}, {"lips", 0, 0, 0.8F, 2.0F},
    {"ears", 0.3F, 0, 1.4F, 2.2F},    {"neck", 0, 0.5F, 0.7F, 5.0F},
};
constexpr float other_richness = 0.9F, other_spacing_mm = 3.4F, far_richness = 0.6F, far_spacing_mm = 7;

/// Where arteries come to the skin, on the left of a standard face (see StandardFace); places from anatomical atlases.
struct Root {
    glm::vec3 place, direction;
    float radius_mm;
};
constexpr Root roots[] = {
    {{9, -16, 12}, {0.05F, 0, 1}, 0.42F},         // supratrochlear
    {{25, -11, 13}, {0.25F, 0.1F, 1}, 0.42F},     // supraorbital
    {{66, 42, 6}, {-0.5F, -0.6F, 0.8F}, 0.42F},   // superficial temporal, frontal branch
    {{70, 66, 14}, {0, 0.2F, 1}, 0.42F},          // superficial temporal, parietal branch
    {{66, 50, -32}, {-0.5F, -1, -0.05F}, 0.40F},  // transverse facial
    {{62, 48, -20}, {-0.5F, -1, 0.1F}, 0.35F},    // zygomatico-orbital
    {{46, 20, -92}, {-0.5F, -0.5F, 0.8F}, 0.45F}, // facial, over the jaw
    {{27, -6, -28}, {0.1F, 0, -1}, 0.35F},        // infraorbital
    {{17, -16, -46}, {-0.3F, -0.3F, 1}, 0.35F},   // lateral nasal
    {{13, -12, -12}, {-0.1F, -0.1F, 1}, 0.3F},    // angular, to the root of the nose
    {{22, -6, -86}, {-0.2F, 0, -1}, 0.3F},        // mental
    {{74, 92, -40}, {0, 0.2F, 1}, 0.3F},          // posterior auricular
};

class Beds {
public:
    explicit Beds(const SkinSurface& surface) : surface_(surface), bed_(surface.position_mm().size()) {
        const auto frame = StandardFace::of(surface);
        std::vector<float> rest(bed_.size(), 1);
        for (Bed& bed : bed_) bed = {0, 0, 0, 0, glm::vec3(0)};
        for (const RegionBed& region : region_beds) {
            const auto weight = surface.region(region.region);
            for (std::size_t v = 0; v < bed_.size(); ++v) {
                bed_[v].frond += weight[v] * region.frond;
                bed_[v].candelabra += weight[v] * region.candelabra;
                bed_[v].richness += weight[v] * region.richness;
                bed_[v].spacing_mm += weight[v] * region.spacing_mm;
                rest[v] -= weight[v];
            }
        }
        const auto forehead = surface.region("forehead"), nose = surface.region("nose");
        const auto cheeks = surface.region("cheeks");
        for (std::size_t v = 0; v < bed_.size(); ++v) {
            Bed& bed = bed_[v];
            const float other = std::max(0.0F, rest[v]);
            bed.richness += other * far_richness;
            bed.spacing_mm += other * far_spacing_mm;
            if (!frame) continue;
            const glm::vec3 p = frame->standard(surface.position_mm()[v]);
            // The face is what lies in front of the ears, between the hairline and the jaw.
            const float face = (1 - smooth_step(70, 110, p.y)) * smooth_step(-135, -105, p.z);
            bed.richness += other * face * (other_richness - far_richness);
            bed.spacing_mm -= other * face * (far_spacing_mm - other_spacing_mm);
            bed.candelabra += other * face * smooth_step(-40, -62, p.z);  // the jaw
            // Upward and, on the forehead, apart like a fan; on the cheek forward and up to the nose.
            const float side = p.x < 0 ? -1 : 1;
            const glm::vec3 fan(0.012F * p.x, 0, 1), forward(-0.6F * side, -0.8F, 0.35F), up(0, 0, 1);
            glm::vec3 course = forehead[v] * fan + cheeks[v] * forward + nose[v] * glm::vec3(-0.4F * side, -0.2F, 1);
            course += (1 - std::min(1.0F, forehead[v] + cheeks[v] + nose[v])) * up;
            bed.course = glm::length(course) > 0 ? glm::normalize(course) : up;
        }
        for (Bed& bed : bed_) {
            bed.frond = std::clamp(bed.frond, 0.0F, 1.0F);
            bed.candelabra = std::clamp(bed.candelabra, 0.0F, 1 - bed.frond);
        }
    }

    Bed at(const SurfacePoint& point) const {
        const glm::uvec3 t = surface_.triangles()[point.triangle];
        return Bed::mix(bed_[t.x], bed_[t.y], bed_[t.z], point.barycentric);
    }
    std::vector<float> perforators_per_mm2() const {
        std::vector<float> density;
        for (const Bed& bed : bed_) density.push_back(1.2F / (bed.spacing_mm * bed.spacing_mm));
        return density;
    }

private:
    const SkinSurface& surface_;
    std::vector<Bed> bed_;
};

/// Fronds branch at acute angles on both sides, candelabra near right angles with arms that turn up again (Moretti
/// 1959; Kalra and Magnenat-Thalmann 1994). Small branches leave at wide angles, large ones at narrow ones (Murray
/// 1926, J. Gen. Physiol. 9:835). The angles of the patterns in degrees are guesses.
VesselHabit habit_in(const Bed& bed, int order) {
    const float between = 1 - bed.frond - bed.candelabra;
    VesselHabit habit;
    habit.spacing_mm = bed.spacing_mm;
    habit.fork_every_mm = bed.spacing_mm * (1.5F * bed.frond + 2.2F * bed.candelabra + 1.9F * between);
    habit.fork_angle = degree * (36 * bed.frond + 82 * bed.candelabra + 58 * between);
    habit.fork_angle_spread = degree * 6;
    habit.paired = bed.frond > 0.5F;
    habit.side_ratio = 0.7F * bed.frond + 0.55F * bed.candelabra + 0.8F * between;
    habit.yield = 0.35F * between;
    habit.wander_per_mm = 0.1F;
    habit.pull = (order == 0 ? 0.09F : 0.03F) * bed.course;
    habit.recurve = 0.11F * bed.candelabra;
    habit.least_radius_mm = 0.05F;
    return habit;
}

VesselTree arteries_in(const SkinSurface& surface, const std::shared_ptr<const Beds>& beds, std::uint64_t seed) {
    VesselTree tree(
        surface, [beds](const VesselTip& tip) { return habit_in(beds->at(tip.point), tip.order); }, step_mm, seed);
    if (const auto frame = StandardFace::of(surface)) {
        Random random(seed);
        for (const Root& root : roots)
            for (const float side : {1.0F, -1.0F}) {
                const glm::vec3 mirror(side, 1, 1);
                const glm::vec3 aside(random.uniform(-2, 2), 0, random.uniform(-2, 2));
                tree.plant(nearest_point(surface, frame->place_mm(mirror * root.place + aside)),
                           mirror * root.direction, root.radius_mm * random.uniform(0.8F, 1.2F));
            }
        tree.grow();
    }
    std::vector<Seedling> perforators = scatter(surface, beds->perforators_per_mm2(), 0.5F, seed);
    std::ranges::stable_sort(perforators, {}, &Seedling::random);
    for (const Seedling& s : perforators) {
        const Bed bed = beds->at(s.point);
        if (!tree.is_free(s.place_mm, s.normal, 1.3F * bed.spacing_mm)) continue;
        Random random(s.random);
        const glm::vec3 any(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
        tree.plant(s.point, bed.course + any, random.uniform(0.13F, 0.24F));
        tree.grow();
    }
    return tree;
}

class Grown final : public GrownFeature {
public:
    Grown(const SkinSurface& surface, const Person&, std::uint64_t seed) {
        const auto beds = std::make_shared<const Beds>(surface);
        const VesselTree tree = arteries_in(surface, beds, seed);
        const Fbm depth{9, 2, 0.5F, std::uint32_t(seed)};
        const std::vector<float> to_end = tree.to_end_mm();
        std::vector<VesselStroke> strokes, around;
        strokes.reserve(tree.segments().size());
        for (std::size_t i = 0; i < to_end.size(); ++i) {
            const VesselSegment& s = tree.segments()[i];
            // A side branch begins inside the vessel that it leaves, and vessels come nearer to the skin and sink.
            const float begun = s.order == 0 ? 1 : smooth_step(0, 3, s.travelled_mm);
            const float shown = begun * smooth_step(-2, 5, to_end[i]) *
                                (0.25F + 1.5F * smooth_step(-0.4F, 0.4F, depth(s.to_mm, 0)));
            const float richness = beds->at(s.end).richness;
            strokes.push_back({s.from_mm, s.to_mm, s.normal, blur_mm(s.radius_mm),
                               2 * s.radius_mm * covered(s.radius_mm) * shown * richness *
                                   glm::vec2(contrast, oxygen_contrast)});
            if (i % fed_every == 0)
                around.push_back({s.from_mm, s.to_mm, s.normal, fed_mm,
                                  float(fed_every) * fed_width_mm * richness * glm::vec2(contrast, oxygen_contrast)});
        }
        vessels_ = VesselPaint(std::move(strokes));
        fed_ = VesselPaint(std::move(around));
    }

    void paint(std::span<const SkinPlace> places, std::span<float> out) const override {
        for (std::size_t i = 0; i < places.size(); ++i) {
            const glm::vec2 sum = vessels_.at(places[i]) + fed_.at(places[i]);
            out[2 * i] = std::min(strongest, palest + held_below(strongest - palest, sum.x));
            out[2 * i + 1] = held_below(most_oxygen, sum.y);
        }
    }

private:
    VesselPaint vessels_, fed_;
};

}  // namespace

VesselTree facial_arteries(const SkinSurface& surface, std::uint64_t seed) {
    return arteries_in(surface, std::make_shared<const Beds>(surface), seed);
}

const Feature& vessels_feature() {
    static const FeatureOf<Grown> feature{{
        "vessels",
        "Vessels",
        "Trees of small arteries under the skin: fronds on forehead and nose, candelabra on cheek and jaw",
        "patterns: Moretti 1959; Kalra and Magnenat-Thalmann 1994, Computer Animation '94:50; depth: Braverman "
        "1997, Microcirculation 4:329; density, angles in degrees and contrast are guesses",
        {{LayerChannel::log_hemoglobin, palest, strongest}, {LayerChannel::oxygenation, 0, most_oxygen}},
    }};
    return feature;
}

}  // namespace sanguine
