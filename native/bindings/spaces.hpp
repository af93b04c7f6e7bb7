// Working spaces as Python names them: "rec709", "rec2020", "acescg", or a matrix from XYZ.
#pragma once

#include <cmath>
#include <stdexcept>
#include <string>
#include <variant>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>

#include "sanguine/colour.hpp"

using MatrixIn = nanobind::ndarray<const double, nanobind::shape<3, 3>, nanobind::c_contig, nanobind::device::cpu>;
using SpaceIn = std::variant<std::string, MatrixIn>;

/// Colours are sums: one NaN or infinity would be in all of them.
template <class Array> void require_finite(const char* name, const Array& values) {
    for (std::size_t i = 0; i < values.size(); ++i)
        if (!std::isfinite(values.data()[i]))
            throw std::invalid_argument(std::string(name) + ": " + std::to_string(values.data()[i]) + " at " + std::to_string(i)
                                        + " is not a finite number");
}

inline sanguine::Matrix3 rgb_matrix(const SpaceIn& space) {
    if (const auto* name = std::get_if<std::string>(&space))
        return sanguine::rgb_from_xyz(*name);
    require_finite("working_space", std::get<MatrixIn>(space));
    const double* m = std::get<MatrixIn>(space).data();
    return {{{m[0], m[1], m[2]}, {m[3], m[4], m[5]}, {m[6], m[7], m[8]}}};
}
