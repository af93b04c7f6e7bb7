// How much of a vessel shows at a place of the skin.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "place_grid.hpp"
#include "sanguine/feature.hpp"

namespace sanguine {

/// A straight piece of a vessel. Pieces that follow each other join without a mark.
struct VesselStroke {
    glm::vec3 from_mm, to_mm;
    glm::vec3 normal;      ///< unit, of the surface there
    float blur_mm;         ///< standard deviation of what shows across the vessel: its width and the skin over it
    glm::vec2 amount_mm;   ///< two quantities times the width of the vessel: the integral across it
};

/// `value` up to 60 % of `limit`, and never more than `limit`, smooth between: where vessels cross.
float held_below(float limit, float value);

/// Strokes that answer for places. Each is blurred by its own width and by that of the asking texel, exactly: the
/// integral over the surface stays that of the vessel whatever the texels, which is how a vessel thinner than a texel
/// fades into its mean.
class VesselPaint {
public:
    VesselPaint() = default;
    explicit VesselPaint(std::vector<VesselStroke> strokes);

    glm::vec2 at(const SkinPlace& place) const;

private:
    struct Piece {
        glm::vec3 from_mm, along, normal;  // `along` is unit
        float length_mm, blur2_mm2;
        glm::vec2 amount_mm;
    };
    std::vector<Piece> pieces_;
    std::vector<PlaceGrid> grids_;  // for texels up to a size each
};

}  // namespace sanguine
