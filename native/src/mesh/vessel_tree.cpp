#include "vessel_tree.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <glm/geometric.hpp>

namespace sanguine {
namespace {

constexpr float cell_mm = 3;

// A branch and what it left part slowly: so long (in spacings) neither is in the other's way.
constexpr float grace_spacings = 2.2F;

/// 21 bits for each coordinate: two metres and more in each direction. Cells that share a key only cost time.
std::uint64_t key_of(glm::ivec3 cell) {
    const auto bits = [](int x) { return std::uint64_t(std::uint32_t(x)) & 0x1fffffU; };
    return bits(cell.x) | bits(cell.y) << 21 | bits(cell.z) << 42;
}

glm::ivec3 cell_of(glm::vec3 place) { return glm::ivec3(glm::floor(place / cell_mm)); }

/// Mean 0, standard deviation 1 (the sum of three uniform numbers: bounded, and the same on every machine).
float bell(Random& random) {
    const double sum = random.uniform() + random.uniform() + random.uniform();
    return float(2 * sum - 3);
}

}  // namespace

VesselTree::VesselTree(const SkinSurface& surface, Habit habit, float step_mm, std::uint64_t seed,
                       std::size_t most_segments)
    : surface_(surface),
      habit_(std::move(habit)),
      step_mm_(step_mm),
      seed_(seed),
      most_segments_(most_segments) {}

std::uint32_t VesselTree::plant(const SurfacePoint& point, glm::vec3 direction, float radius_mm) {
    const auto branch = std::uint32_t(branches_.size());
    branches_.push_back({none, 0});
    Tip tip{SurfaceWalk(surface_, point, glm::dvec3(direction)),
            glm::dvec3(0),
            Random(mix(seed_ + branch)),
            radius_mm,
            0,
            0,
            0,
            none,
            branch,
            trees_,
            0,
            1};
    tip.side = tip.random.uniform() < 0.5 ? -1 : 1;
    tip.next_fork_mm = habit_(seen(tip)).fork_every_mm * tip.random.uniform(0.3F, 1.0F);
    waiting_.push({radius_mm, std::uint32_t(tips_.size())});
    tips_.push_back(std::move(tip));
    return trees_++;
}

void VesselTree::grow() {
    while (!waiting_.empty()) {
        const std::uint32_t next = waiting_.top().tip;
        waiting_.pop();
        grow_branch(tips_[next]);
    }
    tips_.clear();
}

VesselTip VesselTree::seen(const Tip& tip) const {
    const SurfacePoint point = tip.walk.point();
    return {point,         glm::vec3(tip.walk.place_mm()), surface_.normal_at(point), glm::vec3(tip.walk.direction()),
            tip.radius_mm, tip.travelled_mm,               tip.tree,                  tip.order};
}

bool VesselTree::step(Tip& tip, const VesselHabit& habit, VesselSegment& made) {
    const glm::vec3 from(tip.walk.place_mm());
    if (!tip.walk.advance(step_mm_)) return false;
    const SurfacePoint end = tip.walk.point();
    const glm::vec3 to(tip.walk.place_mm()), normal = surface_.normal_at(end);
    const float travelled = tip.travelled_mm + step_mm_;
    if (habit.spacing_mm > 0) {
        const float reach = 1.6F * habit.spacing_mm;
        const Near near =
            nearest(to, normal, tip.branch, travelled, reach, grace_spacings * habit.spacing_mm);
        if (near.distance_mm < habit.spacing_mm) return false;
        if (near.distance_mm < reach) {  // gives way before it has to end
            const double away = tip.walk.angle_to(glm::dvec3(near.place_mm - to)) > 0 ? -1 : 1;
            tip.walk.turn(away * 0.25 * double(step_mm_) * (1 - (near.distance_mm - habit.spacing_mm) /
                                                                    (reach - habit.spacing_mm)));
        }
    }
    made = {from, to, normal, end, tip.radius_mm, travelled, tip.last_segment, tip.branch, tip.tree, tip.order};
    tip.travelled_mm = travelled;
    return true;
}

void VesselTree::grow_branch(Tip tip) {
    while (segments_.size() < most_segments_) {
        const VesselHabit habit = habit_(seen(tip));
        if (tip.radius_mm < habit.least_radius_mm || tip.travelled_mm >= habit.longest_mm) return;

        if (const float strength = glm::length(habit.pull); strength > 0) {
            const double angle = tip.walk.angle_to(glm::dvec3(habit.pull));
            tip.walk.turn(std::clamp(double(step_mm_ * strength) * std::sin(angle / 2) * 1.4, -std::abs(angle),
                                     std::abs(angle)));
        }
        if (habit.recurve > 0 && tip.order > 0)
            tip.walk.turn_toward(tip.parent_course, double(habit.recurve * step_mm_));
        if (habit.wander_per_mm > 0) {  // a curvature that forgets itself over a length (Ornstein-Uhlenbeck)
            const float keep = std::exp(-step_mm_ / habit.wander_length_mm);
            tip.sway = keep * tip.sway + std::sqrt(1 - keep * keep) * bell(tip.random);
            tip.walk.turn(double(habit.wander_per_mm * step_mm_ * tip.sway));
        }

        const bool forks = tip.travelled_mm >= tip.next_fork_mm;
        const SurfaceWalk here = tip.walk;
        const float travelled = tip.travelled_mm, radius = tip.radius_mm;
        const std::uint32_t last = tip.last_segment;
        float angle = 0;
        if (forks) {
            angle = std::max(0.05F, habit.fork_angle + habit.fork_angle_spread * bell(tip.random));
            if (!habit.paired) tip.walk.turn(double(-tip.side) * double(habit.yield * angle));
        }
        VesselSegment ahead;
        if (!step(tip, habit, ahead)) return;

        if (forks) {
            tip.next_fork_mm = tip.travelled_mm + habit.fork_every_mm * tip.random.uniform(0.6F, 1.4F);
            // Side branches exist only if they can take their first step, so that no radius is lost at a fork.
            struct Side {
                Tip tip;
                VesselSegment first;
            };
            std::vector<Side> sides;
            for (int i = 0; i < (habit.paired ? 2 : 1); ++i) {
                const int side = i == 0 ? tip.side : -tip.side;
                const auto branch = std::uint32_t(branches_.size());
                Tip child{here, here.direction(), Random(mix(seed_ + branch)), radius, 0, 0, 0, last, branch, tip.tree,
                          tip.order + 1, -side};
                const float turn = habit.paired ? angle : angle * (1 - habit.yield);
                child.walk.turn(side * double(turn));
                branches_.push_back({tip.branch, travelled});
                VesselSegment first;
                if (!step(child, habit, first)) continue;
                child.next_fork_mm = habit.fork_every_mm * child.random.uniform(0.6F, 1.4F);
                sides.push_back({std::move(child), first});
            }
            const float ratio = habit.side_ratio;
            const float main = radius / std::cbrt(1 + float(sides.size()) * ratio * ratio * ratio);
            if (!sides.empty() && std::min(main, main * ratio) >= habit.least_radius_mm) {
                tip.radius_mm = ahead.radius_mm = main;
                tip.side = -tip.side;
                for (Side& side : sides) {
                    side.tip.radius_mm = side.first.radius_mm = main * ratio;
                    side.tip.last_segment = std::uint32_t(segments_.size());
                    add(side.first);
                    waiting_.push({side.tip.radius_mm, std::uint32_t(tips_.size())});
                    tips_.push_back(std::move(side.tip));
                }
            }
        }
        tip.last_segment = std::uint32_t(segments_.size());
        add(ahead);
    }
}

void VesselTree::add(const VesselSegment& segment) {
    cells_[key_of(cell_of(segment.to_mm))].push_back(std::uint32_t(segments_.size()));
    segments_.push_back(segment);
}

bool VesselTree::are_kin(std::uint32_t branch, float travelled_mm, const VesselSegment& other, float grace_mm) const {
    if (other.branch == branch) return std::abs(other.travelled_mm - travelled_mm) < 2 * grace_mm;
    const Branch& mine = branches_[branch];
    const Branch& its = branches_[other.branch];
    if (mine.parent == other.branch) return travelled_mm < grace_mm;
    if (its.parent == branch) return travelled_mm - its.leaves_at_mm < grace_mm;
    if (mine.parent != none && mine.parent == its.parent && std::abs(mine.leaves_at_mm - its.leaves_at_mm) < grace_mm)
        return travelled_mm < grace_mm;
    return false;
}

VesselTree::Near VesselTree::nearest(glm::vec3 place_mm, glm::vec3 normal, std::uint32_t branch, float travelled_mm,
                                     float reach_mm, float grace_mm) const {
    Near found{reach_mm, {}};
    const glm::ivec3 low = cell_of(place_mm - reach_mm), high = cell_of(place_mm + reach_mm);
    for (int z = low.z; z <= high.z; ++z)
        for (int y = low.y; y <= high.y; ++y)
            for (int x = low.x; x <= high.x; ++x) {
                const auto cell = cells_.find(key_of({x, y, z}));
                if (cell == cells_.end()) continue;
                for (const std::uint32_t i : cell->second) {
                    const VesselSegment& other = segments_[i];
                    const float distance = glm::distance(other.to_mm, place_mm);
                    if (distance >= found.distance_mm || glm::dot(other.normal, normal) <= 0) continue;
                    if (branch != none && are_kin(branch, travelled_mm, other, grace_mm)) continue;
                    found = {distance, other.to_mm};
                }
            }
    return found;
}

bool VesselTree::is_free(glm::vec3 place_mm, glm::vec3 normal, float distance_mm) const {
    return nearest(place_mm, normal, none, 0, distance_mm, 0).distance_mm >= distance_mm;
}

std::vector<float> VesselTree::to_end_mm() const {
    std::vector<float> length(branches_.size(), 0);
    for (const VesselSegment& s : segments_) length[s.branch] = std::max(length[s.branch], s.travelled_mm);
    std::vector<float> left;
    left.reserve(segments_.size());
    for (const VesselSegment& s : segments_) left.push_back(length[s.branch] - s.travelled_mm);
    return left;
}

}  // namespace sanguine
