// Where things are on a face, as far as its regions tell.
#pragma once

#include <initializer_list>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <glm/vec3.hpp>

#include "sanguine/skin_surface.hpp"

namespace sanguine {

/// A value for each region, blended by its weights; skin of no region takes `elsewhere`. Per welded vertex.
std::vector<float> by_region(const SkinSurface& surface,
                             std::initializer_list<std::pair<std::string_view, float>> values, float elsewhere);

enum class Side { both, left, right };  ///< of the face itself: its left is at +X

/// Middle of the skin of a region, nothing where the face has no mask for it.
std::optional<glm::vec3> middle_mm(const SkinSurface& surface, std::string_view region, Side side = Side::both);

/// Landmarks that most features of a face can be placed by. Only there for a face with masks for all of them.
struct FaceFrame {
    glm::vec3 left_eye_mm, right_eye_mm, nose_mm, lips_mm, chin_mm;
    float middle_x_mm;
    float eye_distance_mm;  ///< about 62 in adults
};
std::optional<FaceFrame> face_frame(const SkinSurface& surface);

}  // namespace sanguine
