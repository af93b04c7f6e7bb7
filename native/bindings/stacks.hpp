// Layered stacks as arrays: what the solvers' bindings share.
#pragma once

#include <string>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "arrays.hpp"
#include "sanguine/solver.hpp"

using LayersIn = nanobind::ndarray<const double, nanobind::shape<-1, 5>, nanobind::c_contig, nanobind::device::cpu>;

inline sanguine::Incidence incidence_of(const std::string& name) {
    if (name == "normal")
        return sanguine::Incidence::normal;
    if (name == "diffuse")
        return sanguine::Incidence::diffuse;
    throw std::invalid_argument("incidence: '" + name + "' is neither 'normal' nor 'diffuse'");
}

/// Not yet checked.
inline sanguine::Problem problem_of(const LayersIn& layers, const std::string& incidence,
                                    const std::optional<VectorIn>& radii_mm) {
    sanguine::Problem problem;
    problem.incidence = incidence_of(incidence);
    for (std::size_t i = 0; i < layers.shape(0); ++i)
        problem.layers.push_back({layers(i, 0), layers(i, 1), layers(i, 2), layers(i, 3), layers(i, 4)});
    if (radii_mm)
        problem.radii_mm.assign(radii_mm->data(), radii_mm->data() + radii_mm->size());
    return problem;
}

/// None where there is no profile.
inline nanobind::object profile_of(std::vector<double> values) {
    if (values.empty())
        return nanobind::none();
    const std::size_t count = values.size();
    return nanobind::cast(to_numpy<1>(std::move(values), {count}));
}
