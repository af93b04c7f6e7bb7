// Places of anatomy on any face.
#pragma once

#include <initializer_list>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include <glm/vec3.hpp>

#include "sanguine/skin_surface.hpp"

namespace sanguine {

/// A value for each region, blended by its weights; skin of no region takes `elsewhere`. Per welded vertex.
std::vector<float> by_region(const SkinSurface& surface,
                             std::initializer_list<std::pair<std::string_view, float>> values, float elsewhere);

/// Middle of the skin of a region, nothing where the face has no mask for it.
std::optional<glm::vec3> middle_mm(const SkinSurface& surface, std::string_view region);

/// The point of the surface nearest to a place in space. Looks at every triangle: for a handful of landmarks.
SurfacePoint nearest_point(const SkinSurface& surface, glm::vec3 place_mm);

/// A face in the measures of a standard one: millimetres from the middle between the eyes, the eyes 62 mm apart, x to
/// the left of the face, y backward, z up. Landmarks of anatomy written so fit any face.
class StandardFace {
public:
    /// Mean distance of the pupils of adults: 62 to 64 mm (Dodgson 2004, Proc. SPIE 5291:36).
    static constexpr float eyes_mm = 62;

    /// Needs both lids; a mesh without them has no frame.
    static std::optional<StandardFace> of(const SkinSurface& surface);

    glm::vec3 place_mm(glm::vec3 standard) const { return origin_ + scale_ * standard; }
    glm::vec3 standard(glm::vec3 place_mm) const { return (place_mm - origin_) / scale_; }
    float scale() const { return scale_; }

private:
    glm::vec3 origin_{0};
    float scale_ = 1;
};

}  // namespace sanguine
