// A feature from its row and the class of what is grown.
#pragma once

#include <utility>

#include "random.hpp"
#include "sanguine/feature.hpp"

namespace sanguine {

/// `Grown` is made from (surface, person, a seed of the feature's own).
template <typename Grown>
class FeatureOf final : public Feature {
public:
    explicit FeatureOf(FeatureRow row) : row_(std::move(row)) {}

    const FeatureRow& row() const override { return row_; }
    std::unique_ptr<const GrownFeature> grow(const SkinSurface& surface, const Person& person,
                                             std::uint64_t seed) const override {
        return std::make_unique<Grown>(surface, person, seed_for(seed, row_.id));
    }

private:
    FeatureRow row_;
};

}  // namespace sanguine
