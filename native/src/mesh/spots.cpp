#include "spots.hpp"

#include <algorithm>
#include <limits>

namespace sanguine {
namespace {

constexpr int steps_per_octave = 8;

}

Spots::Spots(std::vector<Spot> spots, float softness, float aside_mm)
    : softness_(softness), spots_(std::move(spots)) {
    if (spots_.empty()) return;
    std::vector<PlaceGrid::Box> boxes;
    smallest_mm_ = std::numeric_limits<float>::infinity();
    float largest = 0;
    for (const Spot& spot : spots_) {
        const glm::vec3 reach(2 * spot.radius_mm * (1 + softness_) + aside_mm);  // faded() ends before
        boxes.push_back({spot.place_mm - reach, spot.place_mm + reach});
        smallest_mm_ = std::min(smallest_mm_, spot.radius_mm);
        largest = std::max(largest, spot.radius_mm);
    }
    grid_ = PlaceGrid(boxes);

    const int octaves = int(std::ceil(std::log2(1.7F * largest / smallest_mm_)));
    for (int i = 0; i <= octaves * steps_per_octave; ++i) {
        const float size = smallest_mm_ * std::exp2(float(i) / steps_per_octave);
        double sum = 0;
        for (const Spot& spot : spots_)
            sum += double(spot.strength) * spot.radius_mm * spot.radius_mm * faded(spot.radius_mm, size);
        faded_mm2_.push_back(float(sum / double(spots_.size()) * spot_area(softness_)));
    }
}

float Spots::faded_mm2(float size_mm) const {
    if (faded_mm2_.empty() || size_mm <= smallest_mm_) return 0;
    const float at = std::log2(size_mm / smallest_mm_) * steps_per_octave;
    const float last = float(faded_mm2_.size() - 1);
    if (at >= last) return faded_mm2_.back();
    const auto i = std::size_t(at);
    return faded_mm2_[i] + (at - float(i)) * (faded_mm2_[i + 1] - faded_mm2_[i]);
}

}  // namespace sanguine
