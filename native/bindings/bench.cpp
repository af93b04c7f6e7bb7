// Rungs of the ladder with their settings in the caller's hand, for measurements: no tolerance decides. (For Monte
// Carlo solve() has `max_photons`.)
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include "sanguine/adding_doubling.hpp"
#include "sanguine/hankel.hpp"
#include "sanguine/multipole.hpp"
#include "stacks.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace sanguine;

namespace {

Problem checked(const LayersIn& layers, const std::string& incidence, const std::optional<VectorIn>& radii_mm) {
    Problem problem = problem_of(layers, incidence, radii_mm);
    check_stack(problem.layers);
    check_radii(problem.radii_mm);
    return problem;
}

void check_range(const char* name, long long value, long long low, long long high) {
    if (value < low || value > high)
        throw std::invalid_argument(std::string(name) + ": " + std::to_string(value) + " is outside "
                                    + std::to_string(low) + " to " + std::to_string(high));
}

nb::dict py_adding_doubling(const LayersIn& layers, const std::string& incidence, int streams) {
    const Problem problem = checked(layers, incidence, {});
    check_range("streams", streams, min_streams, max_streams);
    Totals totals;
    {
        nb::gil_scoped_release release;
        totals = adding_doubling(problem.layers, problem.incidence, streams);
    }
    nb::dict answer;
    answer["Rd"] = totals.Rd;
    answer["R_unscattered"] = totals.R_unscattered;
    answer["Tt"] = totals.Tt;
    answer["specular"] = totals.specular;
    return answer;
}

nb::dict py_multipole(const LayersIn& layers, const std::optional<VectorIn>& radii_mm, int terms) {
    const Problem problem = checked(layers, "normal", radii_mm);
    check_range("terms", terms, all_terms, 1000);
    MultipoleResponse total;
    std::vector<double> profile;
    {
        nb::gil_scoped_release release;
        const MultipoleStack stack(problem.layers, terms);
        total = stack(0);
        const auto transform = [&](double s) {
            const MultipoleResponse at = stack(s);
            return std::array{at.R, at.T};
        };
        if (!problem.radii_mm.empty())
            for (const HankelResult& result : inverse_hankel(transform, problem.radii_mm))
                profile.push_back(result.value[0]);
    }
    nb::dict answer;
    answer["R"] = total.R;
    answer["T"] = total.T;
    answer["R_per_mm2"] = profile_of(std::move(profile));
    return answer;
}

}  // namespace

void bind_bench(nb::module_& m) {
    m.def("adding_doubling", &py_adding_doubling, "layers"_a, "incidence"_a, "streams"_a,
          "Totals of a stack (as in solve()) with a given number of directions per hemisphere, as a dict.");
    m.def("multipole", &py_multipole, "layers"_a, "radii_mm"_a = nb::none(), "terms"_a = all_terms,
          "The classical multipole as it comes, without checks: a dict of R, T and R_per_mm2 per unit of light that\n"
          "enters the stack. May be negative. terms: N for the dipoles -N to N of a layer, -1 for their closed sum.");
}
