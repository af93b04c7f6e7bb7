#include "list.hpp"

#include <array>

namespace sanguine {

std::span<const Feature* const> features() {
    static const std::array all{
        // What all skin has.
        &splotches_feature(),
        &mottle_feature(),
        &vessels_feature(),
        &pores_feature(),
        &sebum_feature(),
        &vermilion_feature(),
        &periorbital_feature(),
        // What some have.
        &freckles_feature(),
        &lentigines_feature(),
        &moles_feature(),
        &veins_feature(),
        &telangiectasia_feature(),
        &beard_feature(),
        &acne_feature(),
        &rash_feature(),
        &tattoo_feature(),
    };
    return all;
}

}  // namespace sanguine
