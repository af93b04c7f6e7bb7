// The module sanguine_core._core: one bind_* function per room of the library.
#include <nanobind/nanobind.h>

namespace nb = nanobind;

void bind_optics(nb::module_& m);
void bind_texture(nb::module_& m);

NB_MODULE(_core, m) {
    m.doc() = "Sanguine's native core. Units stand in the names: mm, per_mm, nm; fractions are 0 to 1.";
    m.attr("__version__") = SANGUINE_VERSION;
    bind_optics(m);
    bind_texture(m);
}
