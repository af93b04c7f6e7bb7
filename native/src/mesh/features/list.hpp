// The features, one function each; a feature is a file of this folder.
#pragma once

#include "sanguine/feature.hpp"

namespace sanguine {

const Feature& freckles_feature();

}  // namespace sanguine
