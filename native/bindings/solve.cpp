// Solvers of layered stacks.
#include <string>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "counters.hpp"
#include "stacks.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace sanguine;

namespace {

nb::dict py_solve(const LayersIn& layers, const std::string& incidence, const std::optional<VectorIn>& radii_mm,
                  const std::string& solver, double tolerance, double max_seconds, std::uint64_t max_photons,
                  std::uint64_t seed, int threads, const ProgressIn& progress) {
    const Problem problem = problem_of(layers, incidence, radii_mm);
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
    answer["R_per_mm2"] = profile_of(std::move(s.R_per_mm2));
    answer["T_per_mm2"] = profile_of(std::move(s.T_per_mm2));
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
          "error_estimate (relative; of profiles half of the L1 norm), solver, because, warnings, elapsed_ms.\n"
          "Raises ValueError for what cannot be, SolverError where the solver has no answer. progress(done, total) is\n"
          "called on this thread a few times a second; False raises Cancelled.");
}
