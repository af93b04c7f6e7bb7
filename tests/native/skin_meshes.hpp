// Small skins that tests grow things on.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <glm/geometric.hpp>

#include "sanguine/skin_surface.hpp"

struct OwnedSkin {
    std::vector<glm::vec3> position_mm;
    std::vector<glm::vec2> uv;
    std::vector<glm::uvec3> triangles;
    std::vector<std::uint32_t> corner_vertex;
    std::vector<std::string> region_names;
    std::vector<float> region_weights;

    sanguine::SkinMesh mesh() const {
        return {position_mm, uv, triangles, corner_vertex, region_names, region_weights};
    }
    sanguine::SkinSurface surface() const { return sanguine::SkinSurface(mesh()); }
};

/// A square of `cells` by `cells` quads in the plane y = 0, seen from -Y, over the whole unit square of UV.
inline OwnedSkin flat_skin(float side_mm, int cells, const std::vector<std::string>& regions = {}) {
    OwnedSkin skin;
    skin.region_names = regions;
    for (int j = 0; j <= cells; ++j)
        for (int i = 0; i <= cells; ++i) {
            const glm::vec2 at(float(i) / float(cells), float(j) / float(cells));
            skin.corner_vertex.push_back(std::uint32_t(skin.position_mm.size()));
            skin.position_mm.push_back({(at.x - 0.5F) * side_mm, 0, (at.y - 0.5F) * side_mm});
            skin.uv.push_back(at);
            skin.region_weights.insert(skin.region_weights.end(), regions.size(), 1);
        }
    const auto at = [&](int i, int j) { return std::uint32_t(j * (cells + 1) + i); };
    for (int j = 0; j < cells; ++j)
        for (int i = 0; i < cells; ++i) {
            skin.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            skin.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    return skin;
}

/// A head that is a ball: the neck below, the face toward -Y, each region where it is on a face, and a seam down the
/// back where vertices are split.
inline OwnedSkin ball_skin(float radius_mm = 85, int cells = 48) {
    OwnedSkin skin;
    skin.region_names = {"lips", "ears", "eyelids", "nose", "cheeks", "forehead", "chin", "neck"};
    const auto bump = [](glm::vec3 p, glm::vec3 middle, float reach) {
        const float d = std::sqrt(glm::dot(p - middle, p - middle)) / reach;
        return std::max(0.0F, 1 - d * d);
    };
    for (int j = 0; j <= cells; ++j)
        for (int i = 0; i <= cells; ++i) {
            const float u = float(i) / float(cells), v = float(j) / float(cells);
            // The same numbers on both sides of the seam.
            const float around = 2 * std::numbers::pi_v<float> * (i == cells ? 0 : u);
            const float up = std::numbers::pi_v<float> * (v - 0.5F);
            const glm::vec3 p(-std::sin(around) * std::cos(up), std::cos(around) * std::cos(up), std::sin(up));
            skin.corner_vertex.push_back(std::uint32_t(skin.position_mm.size()));
            skin.position_mm.push_back(p * radius_mm);
            skin.uv.push_back({u, v});
            const glm::vec3 side(std::abs(p.x), p.y, p.z);
            std::vector<float> weights{
                bump(p, {0, -0.88F, -0.47F}, 0.22F),    bump(side, {1, 0, 0}, 0.3F),
                bump(side, {0.35F, -0.93F, 0.1F}, 0.2F), bump(p, {0, -0.99F, -0.1F}, 0.25F),
                bump(side, {0.5F, -0.8F, -0.25F}, 0.4F), bump(p, {0, -0.85F, 0.5F}, 0.5F),
                bump(p, {0, -0.7F, -0.7F}, 0.2F),        bump(p, {0, 0, -1}, 0.5F)};
            float sum = 0;
            for (const float w : weights) sum += w;
            for (const float w : weights) skin.region_weights.push_back(w / std::max(1.0F, sum));
        }
    const auto at = [&](int i, int j) { return std::uint32_t(j * (cells + 1) + i); };
    for (int j = 0; j < cells; ++j)
        for (int i = 0; i < cells; ++i) {
            skin.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            skin.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    return skin;
}
