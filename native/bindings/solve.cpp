// Solvers of layered stacks.
#include <string>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "counters.hpp"
#include "sanguine/solver.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace sanguine;

namespace {

using LayersIn = nb::ndarray<const double, nb::shape<-1, 5>, nb::c_contig, nb::device::cpu>;
using RadiiIn = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

Incidence incidence_of(const std::string& name) {
    if (name == "normal")
        return Incidence::normal;
    if (name == "diffuse")
        return Incidence::diffuse;
    throw std::invalid_argument("incidence: '" + name + "' is neither 'normal' nor 'diffuse'");
}

nb::object profile(std::vector<double> values) {
    if (values.empty())
        return nb::none();
    const std::size_t count = values.size();
    return nb::cast(to_numpy<1>(std::move(values), {count}));
}

nb::dict py_solve(const LayersIn& layers, const std::string& incidence, const std::optional<RadiiIn>& radii_mm,
                  const std::string& solver, double tolerance, double max_seconds, std::uint64_t max_photons,
                  std::uint64_t seed, int threads, const ProgressIn& progress) {
    Problem problem;
    problem.incidence = incidence_of(incidence);
    for (std::size_t i = 0; i < layers.shape(0); ++i)
        problem.layers.push_back({layers(i, 0), layers(i, 1), layers(i, 2), layers(i, 3), layers(i, 4)});
    if (radii_mm)
        problem.radii_mm.assign(radii_mm->data(), radii_mm->data() + radii_mm->size());
    const Solver& chosen = find_solver(solver);
    Solution s;
    {
        nb::gil_scoped_release release;
        s = solve(problem, chosen, {tolerance, max_seconds, max_photons, seed, threads, with_gil(progress)});
    }
    ++counters.stack_solves.count;

    nb::dict answer;
    answer["solver"] = s.solver;
    answer["Rd"] = s.Rd;
    answer["R_unscattered"] = s.R_unscattered;
    answer["Tt"] = s.Tt;
    answer["specular"] = s.specular;
    answer["R_per_mm2"] = profile(std::move(s.R_per_mm2));
    answer["T_per_mm2"] = profile(std::move(s.T_per_mm2));
    answer["error_estimate"] = s.error_estimate;
    answer["elapsed_ms"] = s.elapsed_ms;
    answer["because"] = s.because;
    answer["warnings"] = s.warnings;
    return answer;
}

}  // namespace

void bind_solve(nb::module_& m) {
    nb::exception<SolverError>(m, "SolverError");

    m.def("solvers", [] {
        nb::list rows;
        for (const Solver* solver : solvers()) {
            nb::dict row;
            row["id"] = std::string(solver->id());
            row["summary"] = std::string(solver->summary());
            rows.append(row);
        }
        return rows;
    }, "The solvers of solve(), cheapest first, as dicts of id and summary; 'auto' chooses among them.");

    const Effort standard;
    m.def("solve", &py_solve, "layers"_a, "incidence"_a = "normal", "radii_mm"_a = nb::none(), "solver"_a = "auto",
          "tolerance"_a = standard.tolerance, "max_seconds"_a = standard.max_seconds,
          "max_photons"_a = standard.max_photons, "seed"_a = standard.seed, "threads"_a = standard.threads,
          "progress"_a = nb::none(),
          "What becomes of light that falls from air on a stack of layers; shares of the incident light.\n\n"
          "layers: (L, 5) from the surface down, mu_a and mu_s [1/mm], Henyey-Greenstein g, index n, thickness [mm],\n"
          "infinite in the last layer for a half-space. incidence: 'normal' (pencil beam) or 'diffuse' (Lambertian\n"
          "light on one point). radii_mm: (R,) ascending, where the profiles are wanted; without them totals alone.\n"
          "Returns a dict: Rd (left the top after scattering), R_unscattered (back from a deeper face without), Tt (all\n"
          "that left the bottom), specular (first surface), R_per_mm2 and T_per_mm2 (scattered light, (R,) or None),\n"
          "error_estimate (relative; of profiles in the L1 norm), solver, because, warnings, elapsed_ms.\n"
          "Raises ValueError for what cannot be, SolverError where the solver has no answer. progress(done, total) is\n"
          "called on this thread a few times a second; False raises Cancelled.");
}
