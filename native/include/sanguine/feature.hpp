// Features of skin that are grown on the surface of a face: freckles, vessels, moles and the like.
//
// A feature is one file in src/mesh/features/ that declares itself in a FeatureRow and is listed once in
// src/mesh/features/list.cpp. From the row come the effect, its slider, the range of the table, the CLI and the docs.
//
// All features are functions of the place on the surface in mm, never of UV: what two UV islands share, they show alike.
// They answer in quantities that add up (logarithms of factors), so features combine in any order, and a strength is
// a factor on a layer.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include <glm/vec3.hpp>

#include "sanguine/parallel.hpp"
#include "sanguine/skin_surface.hpp"

namespace sanguine {

/// What a layer may change. The order is that of `layer_channel_ids`.
enum class LayerChannel {
    log_hemoglobin,  ///< natural logarithm of the factor on hemoglobin
    log_melanin,     ///< of the factor on melanin
    log_oil,         ///< of the factor on oil
    oxygenation,     ///< added
    ink_per_mm,      ///< absorption of tattoo ink in the dermis, added
    height_mm,       ///< of the surface, added
};
inline constexpr int layer_channel_count = 6;
std::string_view layer_channel_id(LayerChannel channel);

/// One quantity that a feature changes, and the range of the change at strength 1: no layer leaves it.
struct LayerChange {
    LayerChannel channel;
    float low, high;
};

/// The declaration of a feature.
struct FeatureRow {
    std::string_view id, label, help, source;
    std::vector<LayerChange> changes;  ///< the channels of the layer, in this order
};

/// Who grows: what presets and sliders say of the person, the same for all features.
struct Person {
    double age_years = 30;   ///< 0 to 120
    double sun = 0.5;        ///< exposure to sun, 0 none to 1 a life outdoors
    double masculinity = 0;  ///< 0 female, 1 male: hair of the beard, thickness of vessels
};

/// A texel (or any other place) that asks what is there.
struct SkinPlace {
    glm::vec3 place_mm;
    glm::vec3 normal;  ///< unit; tells a place from one that touches it from the other side (lips, nostrils)
    float size_mm;     ///< side of the texel, the same across a seam: what is finer is to fade into its mean
    SurfacePoint point;
};

/// A feature placed on one face: spots, vessels and all. Immutable, asked by many threads at once.
class GrownFeature {
public:
    virtual ~GrownFeature() = default;
    /// out: [place][channel of the row], set, not added; each within the row's range.
    virtual void paint(std::span<const SkinPlace> places, std::span<float> out) const = 0;
};

class Feature {
public:
    virtual ~Feature() = default;
    virtual const FeatureRow& row() const = 0;
    /// Deterministic in its arguments, whatever the number of threads. `surface` outlives what is grown on it.
    virtual std::unique_ptr<const GrownFeature> grow(const SkinSurface& surface, const Person& person,
                                                     std::uint64_t seed) const = 0;
};

/// Every feature, in the order in which they are shown.
std::span<const Feature* const> features();

/// Throws std::invalid_argument that names the id and the known ones.
const Feature& feature(std::string_view id);

/// The texels of a UV layout. Those within `padding_px` of an island show the skin beyond its edge, which is on another
/// island, so that filtering across a seam finds the same on both sides; at a rim of the mesh the nearest place.
struct TexelMap {
    int width, height;
    std::vector<std::uint32_t> texel;  ///< row * width + column, row 0 is V = 0; ascending
    std::vector<SkinPlace> place;      ///< of each of them
    std::size_t triangles;             ///< of the surface, to tell that of another one
};
TexelMap map_texels(const SkinSurface& surface, int width, int height, int padding_px, int threads);

/// One feature over all texels of a map: [texel of the map][channel of the feature's row].
std::vector<float> paint_layer(const GrownFeature& grown, const FeatureRow& row, const TexelMap& texels, int threads,
                               const Progress& progress);

/// Grows a feature and paints it. Throws std::invalid_argument for a person outside of the ranges and for the texels
/// of another surface.
std::vector<float> grow_layer(const Feature& feature, const SkinSurface& surface, const TexelMap& texels,
                              const Person& person, std::uint64_t seed, int threads, const Progress& progress);

}  // namespace sanguine
