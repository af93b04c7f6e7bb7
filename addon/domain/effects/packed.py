"""What the material reads of the object: properties of three numbers, as Cycles looks each property up by itself.

The blood that people see, key and bake is one property a number (`blood_hemoglobin_cheeks`, …); those that the material
reads follow them by drivers, three at a time (`Plan.packed`). A number that the plan does not move is 0, without a driver.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ..blood import BLOOD, ELSEWHERE, FEATURE, FEATURES, blood_property
from .effect import Fragment, ShaderInput

NUMBERS = 3
PREFIX = "blood_packed_"
"""How the properties are called that the material reads, and nobody else."""

PRESSURE = "pressure"
"""Custom property of the face: how hard it presses now, 0 to 1, of a face whose rig has a slider for it."""

_OTHERS = (
    blood_property("hemoglobin", ELSEWHERE),
    blood_property("oxygenation", ELSEWHERE),
    PRESSURE,
    # Those first that a state brings out.
    *(blood_property(FEATURE, name) for name in sorted(FEATURES, key=lambda name: (name, FEATURE) not in BLOOD.drives)),
)


def packed_input(name: str, parts: Sequence[str]) -> ShaderInput:
    """The input of a property PREFIX + `name` whose numbers are those of the properties `parts`, "" for a 0."""
    name = f"{PREFIX}{name}"
    return ShaderInput(name, "color", "object", name, parts=(*parts, *[""] * (NUMBERS - len(parts))))


def other(part: str) -> tuple[ShaderInput, str]:
    """The input that holds a property of no region, and the number in it as OSL."""
    at = _OTHERS.index(part)
    first, i = at - at % NUMBERS, at % NUMBERS
    item = packed_input(f"others_{first // NUMBERS}", [part if k == i else "" for k in range(NUMBERS)])
    return item, f"{item.name}[{i}]"


def packed(fragments: Iterable[Fragment]) -> dict[str, tuple[str, ...]]:
    """Property of three numbers -> the properties that these follow, "" where none; all that the fragments together read."""
    found: dict[str, tuple[str, ...]] = {}
    for item in (item for fragment in fragments for item in fragment.inputs if item.parts):
        before = found.get(item.key, ("",) * NUMBERS)
        found[item.key] = tuple(part or held for part, held in zip(item.parts, before, strict=True))
    return found
