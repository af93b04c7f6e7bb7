#include "list.hpp"

#include <array>

namespace sanguine {

std::span<const Feature* const> features() {
    static const std::array all{
        &freckles_feature(),
    };
    return all;
}

}  // namespace sanguine
