#include "list.hpp"

#include <array>

namespace sanguine {

std::span<const Feature* const> features() {
    static const std::array all{
        &vessels_feature(),
        &veins_feature(),
        &telangiectasia_feature(),
        &freckles_feature(),
    };
    return all;
}

}  // namespace sanguine
