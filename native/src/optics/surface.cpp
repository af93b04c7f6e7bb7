#include "sanguine/surface.hpp"

#include "sanguine/fresnel.hpp"
#include "sanguine/path_table.hpp"

namespace sanguine {

SurfaceReflectance surface_reflectance(const SkinParameters& skin) {
    const double film = skin.oil * diffuse_fresnel(oil_film_index);
    return {film, film + (1 - film) * diffuse_fresnel(path_grid::refractive_index)};
}

}  // namespace sanguine
