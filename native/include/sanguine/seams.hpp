// UV seams that do not show: texels on both sides that a bilinear look-up reads alike.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <glm/vec2.hpp>

#include "sanguine/skin_surface.hpp"

namespace sanguine {

/// A texel of one of the images of a layout.
struct SeamTexel {
    std::uint32_t tile;   ///< index of the image
    std::uint32_t texel;  ///< row * width + column, row 0 is V = 0
};

/// The texels that look-ups on UV seams read, and what makes them agree. Immutable.
///
/// A seam is one line of the skin with two places in the image. Texels hold the same skin on both sides, yet detail
/// about as wide as they are is read differently where their grids lie differently. Here the texels round a seam are
/// changed, as little as that takes, until both readings agree: least squares over samples of all seams, after
/// Liu, Ferguson, Jacobson & Gingold, "Seamless: Seam Erasure and Seam-Aware Decoupling of Shape from Mesh
/// Resolution" (ACM Trans. Graph. 36(6), 2017).
class SeamTexels {
public:
    /// `tiles`: lower left corners in UV of the images that there are, {0, 0} for an ordinary layout; each has width *
    /// height texels and a look-up beyond its border reads the border. Sides of triangles that no image shows, that
    /// are at a rim of the mesh or without area in UV are no seams. Throws std::invalid_argument for no pixels.
    SeamTexels(const SkinSurface& surface, int width, int height, std::span<const glm::ivec2> tiles);
    ~SeamTexels();
    SeamTexels(SeamTexels&&) noexcept;
    SeamTexels& operator=(SeamTexels&&) noexcept;

    std::span<const SeamTexel> texels() const;  ///< ascending; empty without seams

    /// values: [texel][channel], changed in place; no channel leaves the range that it has here. Does not depend on the
    /// number of threads. Throws std::invalid_argument for another length and for values that are not finite.
    void equalize(std::span<float> values, int channels, int threads) const;

private:
    struct System;  // of least squares
    std::vector<SeamTexel> texels_;
    std::unique_ptr<const System> system_;
};

}  // namespace sanguine
