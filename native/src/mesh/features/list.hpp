// The features, one function each; a feature is a file of this folder.
#pragma once

#include "sanguine/feature.hpp"

namespace sanguine {

const Feature& freckles_feature();
const Feature& vessels_feature();
const Feature& veins_feature();
const Feature& telangiectasia_feature();

}  // namespace sanguine
