// The features, one function each; a feature is a file of this folder.
#pragma once

#include "sanguine/feature.hpp"

namespace sanguine {

const Feature& acne_feature();
const Feature& beard_feature();
const Feature& freckles_feature();
const Feature& lentigines_feature();
const Feature& moles_feature();
const Feature& mottle_feature();
const Feature& periorbital_feature();
const Feature& pores_feature();
const Feature& rash_feature();
const Feature& sebum_feature();
const Feature& splotches_feature();
const Feature& tattoo_feature();
const Feature& telangiectasia_feature();
const Feature& veins_feature();
const Feature& vermilion_feature();
const Feature& vessels_feature();

}  // namespace sanguine
