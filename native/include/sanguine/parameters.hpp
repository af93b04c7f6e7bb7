// The parameters of one skin, as native/schema/parameters.toml declares them.
#pragma once

#include <span>
#include <string_view>

namespace sanguine {

struct SkinParameters;

/// One row of the schema.
struct ParameterRow {
    std::string_view id, label, unit, group, channel, help, source;
    double default_value, hard_min, hard_max, soft_min, soft_max;
    double SkinParameters::*field;
};

/// A view of stored parameters, read and set in their place.
struct DerivedRow {
    std::string_view id, label, unit, expression, help;
};

}  // namespace sanguine

#include "sanguine/skin_parameters.hpp"  // generated: SkinParameters, parameter_rows, derived_rows

namespace sanguine {

/// A skin from one value per row of the schema. Throws std::invalid_argument naming skin `index`, the key, the value
/// and what is allowed, if a value is not finite or outside its hard range.
SkinParameters skin_from_row(std::span<const double> values, std::size_t index);

}  // namespace sanguine
