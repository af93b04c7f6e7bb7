"""Writes the C++ header of the reference cases: `generate_reference_cases.py CASES.json OUT.hpp`."""

import json
import sys

HEAD = """\
// Generated from tests/reference/monte_carlo_cases.json; tests/reference/README.md says what the numbers are.
#pragma once

#include <stdexcept>
#include <string_view>
#include <vector>

#include "sanguine/stack.hpp"

namespace reference {

/// Light that leaves between `inner` and `outer` [mm]; all values per incident photon.
struct Ring {
    double inner, outer;
    double radius;            ///< where a locally linear profile equals the ring's mean [mm]
    double density, density_se;  ///< the mean [1/mm^2]
    double fraction;          ///< the energy
};

struct Case {
    const char *id, *kind;
    sanguine::Incidence incidence;
    std::vector<sanguine::Layer> layers;
    double specular;
    double scattered_reflectance, scattered_reflectance_se;      ///< left the top after at least one scattering
    double unscattered_reflectance, unscattered_reflectance_se;  ///< back from a deeper face without scattering
    double transmittance, transmittance_se;                      ///< all that left the bottom
    std::vector<Ring> rings;           ///< of what left the top scattered, 0.01 to 20 mm
    double below_first_ring;           ///< energy inside of them
    std::vector<Ring> bottom_rings;    ///< of what left the bottom scattered; empty without a bottom
};

inline const std::vector<Case>& cases() {
    static const std::vector<Case> all = {
"""
TAIL = """\
    };
    return all;
}

inline const Case& find(std::string_view id) {
    for (const Case& c : cases())
        if (id == c.id)
            return c;
    throw std::invalid_argument("no such reference case");
}

}  // namespace reference
"""


def layer(values: dict) -> str:
    thickness = "sanguine::half_space" if values["thickness"] is None else repr(float(values["thickness"]))
    return "{" + ", ".join(repr(float(values[k])) for k in ("mu_a", "mu_s", "g", "n")) + f", {thickness}}}"


def rings(table: dict | None) -> str:
    if table is None:
        return "{}"
    rows = zip(*(table[k] for k in ("r_lo", "r_hi", "r", "value", "se", "fraction")))
    return "{" + ", ".join("{" + ", ".join(repr(float(x)) for x in row) + "}" for row in rows) + "}"


def case(c: dict) -> str:
    numbers = (c[k] for k in ("specular", "Rd", "Rd_se", "R_unscattered", "R_unscattered_se", "Tt", "Tt_se"))
    return (
        f'        {{"{c["id"]}", "{c["class"]}", sanguine::Incidence::{c["incidence"]},\n'
        f"         {{{', '.join(layer(x) for x in c['layers'])}}},\n"
        f"         {', '.join(repr(float(x)) for x in numbers)},\n"
        f"         {rings(c['R'])},\n         {sum(c['R_inner']['fraction'])!r}, {rings(c.get('T'))}}},\n"
    )


source, target = sys.argv[1:]
with open(source, encoding="utf-8") as file:
    data = json.load(file)
with open(target, "w", encoding="utf-8") as file:
    file.write(HEAD + "".join(case(c) for c in data["cases"]) + TAIL)
