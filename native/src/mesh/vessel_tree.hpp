// Vessels that branch over a surface: tips that walk, fork and keep their distance.
#pragma once

#include <cstdint>
#include <functional>
#include <queue>
#include <span>
#include <unordered_map>
#include <vector>

#include <glm/vec3.hpp>

#include "random.hpp"
#include "surface_walk.hpp"

namespace sanguine {

/// How a vessel grows at a place. Angles in radians, lengths in mm.
struct VesselHabit {
    float spacing_mm = 3;          ///< kept from vessels that are not its own forks; 0: none
    float fork_every_mm = 6;       ///< mean distance between forks; infinity: it never forks
    float fork_angle = 0.9F;       ///< between the side branch and the vessel it leaves
    float fork_angle_spread = 0;   ///< standard deviation of it
    bool paired = false;           ///< forks to both sides at once, as a feather does; else side by side in turn
    float side_ratio = 0.7F;       ///< radius of a side branch over that of the main one behind the fork
    float yield = 0;               ///< share of the angle by which the main branch gives way at a single fork
    float wander_per_mm = 0;       ///< standard deviation of its curvature, which comes and goes
    float wander_length_mm = 3;    ///< over which it keeps a bend
    glm::vec3 pull{0};             ///< where it turns to; the length is the turn per mm at right angles to it
    float recurve = 0;             ///< turn per mm by which a side branch bends back to the course of its parent
    float least_radius_mm = 0;     ///< a vessel thinner than this is not grown
    float longest_mm = 1e9F;       ///< of a branch
};

/// The growing end of a vessel.
struct VesselTip {
    SurfacePoint point;
    glm::vec3 place_mm, normal, direction;
    float radius_mm;
    float travelled_mm;  ///< since the fork
    std::uint32_t tree;  ///< the number of its root
    int order;           ///< 0 for what grows from the root, 1 for its side branches, ...
};

struct VesselSegment {
    glm::vec3 from_mm, to_mm;
    glm::vec3 normal;       ///< unit, of the surface at its end
    SurfacePoint end;
    float radius_mm;
    float travelled_mm;     ///< of its end, since the fork
    std::uint32_t parent;   ///< the segment it continues or leaves; VesselTree::none at a root
    std::uint32_t branch;   ///< a side branch has a number of its own
    std::uint32_t tree;
    int order;
};

/// Vessels on one surface. The same calls give the same vessels on every machine.
///
/// Thick tips grow first. A tip ends at a rim, near another vessel, or below the least radius of its habit. Radii obey
/// Murray's law at every fork: r0^3 = r1^3 + r2^3 (+ r3^3) (Murray 1926, PNAS 12:207).
class VesselTree {
public:
    static constexpr std::uint32_t none = 0xffffffffU;
    using Habit = std::function<VesselHabit(const VesselTip&)>;

    /// `most_segments` bounds the work whatever the mesh.
    VesselTree(const SkinSurface& surface, Habit habit, float step_mm, std::uint64_t seed,
               std::size_t most_segments = 400'000);

    /// Lets a vessel start; it grows with the next `grow`. Answers the number of its tree.
    std::uint32_t plant(const SurfacePoint& point, glm::vec3 direction, float radius_mm);
    void grow();

    /// Whether no vessel is nearer than `distance_mm` on this side of the skin.
    bool is_free(glm::vec3 place_mm, glm::vec3 normal, float distance_mm) const;

    std::span<const VesselSegment> segments() const { return segments_; }
    /// From the end of each segment to that of its branch.
    std::vector<float> to_end_mm() const;

private:
    struct Branch {
        std::uint32_t parent;   // branch, or none
        float leaves_at_mm;     // of the parent's path
    };
    struct Tip {
        SurfaceWalk walk;
        glm::dvec3 parent_course;
        Random random;
        float radius_mm, travelled_mm, next_fork_mm, sway;
        std::uint32_t last_segment, branch, tree;
        int order, side;
    };
    struct Later {
        float radius_mm;
        std::uint32_t tip;
        bool operator<(const Later& other) const {
            return radius_mm != other.radius_mm ? radius_mm < other.radius_mm : tip > other.tip;
        }
    };
    struct Near {
        float distance_mm;
        glm::vec3 place_mm;
    };

    VesselTip seen(const Tip& tip) const;
    void grow_branch(Tip tip);
    bool step(Tip& tip, const VesselHabit& habit, VesselSegment& made);
    void add(const VesselSegment& segment);
    bool are_kin(std::uint32_t branch, float travelled_mm, const VesselSegment& other, float grace_mm) const;
    Near nearest(glm::vec3 place_mm, glm::vec3 normal, std::uint32_t branch, float travelled_mm, float reach_mm,
                 float grace_mm) const;

    const SkinSurface& surface_;
    Habit habit_;
    float step_mm_;
    std::uint64_t seed_;
    std::size_t most_segments_;
    std::vector<VesselSegment> segments_;
    std::vector<Branch> branches_;
    std::vector<Tip> tips_;
    std::priority_queue<Later> waiting_;
    std::uint32_t trees_ = 0;
    std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cells_;
};

}  // namespace sanguine
