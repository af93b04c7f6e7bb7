// The module sanguine_core._core: one bind_* function per room of the library.
#include <nanobind/nanobind.h>

#include "counters.hpp"

namespace nb = nanobind;

void bind_bench(nb::module_& m);
void bind_fit(nb::module_& m);
void bind_inversion(nb::module_& m);
void bind_mesh(nb::module_& m);
void bind_optics(nb::module_& m);
void bind_solve(nb::module_& m);
void bind_strain(nb::module_& m);
void bind_texture(nb::module_& m);

NB_MODULE(_core, m) {
    m.doc() = "Sanguine's native core. Units stand in the names: mm, per_mm, nm; fractions are 0 to 1.";
    m.attr("__version__") = SANGUINE_VERSION;
    bind_fit(m);
    bind_inversion(m);
    bind_optics(m);
    bind_solve(m);
    bind_bench(m);
    bind_strain(m);
    bind_texture(m);
    bind_mesh(m);
    m.def(
        "counters",
        [] {
            nb::dict counts;
            for (const Counter* counter : counters.all()) counts[counter->name] = counter->count.load();
            return counts;
        },
        "Work done since the last reset_counters().");
    m.def("reset_counters", [] {
        for (Counter* counter : counters.all()) counter->count = 0;
    });
}
