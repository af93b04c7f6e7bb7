// What the binding files share: owned arrays out, progress in.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>

#include "sanguine/parallel.hpp"

using VectorIn = nanobind::ndarray<const double, nanobind::ndim<1>, nanobind::c_contig, nanobind::device::cpu>;
using TableIn = nanobind::ndarray<const double, nanobind::ndim<2>, nanobind::c_contig, nanobind::device::cpu>;
template <int dimensions> using ArrayOut = nanobind::ndarray<nanobind::numpy, double, nanobind::ndim<dimensions>>;
using ProgressIn = std::optional<nanobind::callable>;

/// The array owns the values from here on.
template <int dimensions>
ArrayOut<dimensions> to_numpy(std::vector<double> values, const std::array<std::size_t, dimensions>& shape) {
    auto* held = new std::vector<double>(std::move(values));
    nanobind::capsule owner(held, [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
    return ArrayOut<dimensions>(held->data(), dimensions, shape.data(), owner);
}

/// Called without the GIL, by the thread that came from Python. Also lets Ctrl-C through.
inline sanguine::Progress with_gil(const ProgressIn& callable) {
    return [&callable](std::size_t done, std::size_t total) {
        nanobind::gil_scoped_acquire gil;
        if (PyErr_CheckSignals() != 0)
            throw nanobind::python_error();
        bool go_on = true;
        if (callable && !nanobind::try_cast<bool>((*callable)(done, total), go_on))
            throw nanobind::type_error("progress: has to return True or False");
        return go_on;
    };
}
