// The arterial trees of a face, for what hangs on them.
#pragma once

#include <cstdint>

#include "vessel_tree.hpp"

namespace sanguine {

/// Arteries from where they come to the skin, and perforators where those have left skin without. The surface outlives
/// the tree.
VesselTree facial_arteries(const SkinSurface& surface, std::uint64_t seed);

}  // namespace sanguine
