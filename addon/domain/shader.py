"""The OSL shaders of a plan, assembled from `shaders_osl/` and the fragments of the active effects.

`chromophores.osl` says what is in the skin at a point and where the table holds it; Image Texture nodes read the
table; `surface.osl` turns what they read into closures. The normal is bent by `slopes.osl`, by what is painted, and by
`relief.osl`, by what is computed, each if an effect needs it.
What the plan leaves out is not in the text: no input, no instruction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from .effects import Fragment, ShaderInput
from .lut import LOBES, WALK_QUANTITIES, layout
from .plan import Axis, Plan
from .resources import shaders_path


@dataclass(frozen=True)
class Shader:
    """OSL source of one script node and the inputs that effects added to it."""

    source: str
    inputs: tuple[ShaderInput, ...]


def assemble(plan: Plan) -> dict[str, Shader]:
    """Stage -> shader: "chromophores" and "surface"; "slopes" and "relief" when an active effect has a fragment for them."""
    stages = {fragment.stage for fragment in plan.fragments}
    from_points = {item.key for f in plan.fragments for item in f.inputs if item.source == "chromophores"}
    axes = plan.axes
    form = layout(axes, plan.settings.lobes, plan.walk)
    height, width = form.shape
    defines: dict[str, object] = {
        "AXES": min(len(axes), 2),
        "TABLE_WIDTH": float(width),
        "TABLE_HEIGHT": float(height),
        "LEVELS": int(form.level is not None),
        "SLICES": len(table_slices(axes)),
        "FILM": int("film" in from_points),
    }
    named = {f"AXIS_{i}": (axis, axis.count) for i, axis in enumerate(axes[:2])}
    if form.level:
        named["LEVEL"] = form.level, form.levels
    if form.mixed:
        named["MIXED"] = form.mixed, form.mixed.count
    for name, (axis, count) in named.items():
        defines |= {
            f"{name}_VALUE": f"({axis.id} + {axis.offset})" if axis.offset else axis.id,
            f"{name}_LOW": axis.low + axis.offset,
            f"{name}_HIGH": axis.high + axis.offset,
            f"{name}_COUNT": float(count),
            f"{name}_LOG": int(axis.logarithmic),
        }
    shaders = {
        "chromophores": _assemble("chromophores", plan.fragments, defines),
        "surface": _assemble(
            "surface",
            plan.fragments,
            {"LOBES": plan.settings.lobes, "SLICES": len(table_slices(axes)), "RELIEF": 0},
            lobes=_lobe_inputs(plan),
        ),
    }
    for stage in ("slopes", "relief"):
        if stage in stages:
            shaders[stage] = _assemble(stage, plan.fragments, {})
    return shaders


def _assemble(stage: str, fragments: tuple[Fragment, ...], defines: Mapping[str, object], lobes: str = "") -> Shader:
    mine = [fragment for fragment in fragments if fragment.stage == stage]
    inputs = tuple({item.name: item for fragment in mine for item in fragment.inputs}.values())
    for fragment in mine:
        defines = {**defines, **fragment.defines}
    head = "".join(f"#define {name} {value}\n" for name, value in defines.items())
    text = shaders_path(f"{stage}.osl").read_text(encoding="utf-8")
    text = text.replace("//@lobes\n", lobes)
    text = text.replace("//@inputs\n", "".join(f"    {_declare(item)},\n" for item in inputs))
    body = "\n".join(shaders_path(f"effects/{f.file}").read_text(encoding="utf-8") for f in mine)
    return Shader(head + text.replace("//@fragments\n", body), inputs)


def _declare(item: ShaderInput) -> str:
    return f"{item.type} {item.name} = {float(item.default)}"


def table_slices(axes: tuple[Axis, ...]) -> dict[str, str]:
    """The places of the table that are read, two where an axis is mixed: suffix of the surface shader's lobe inputs ->
    output of the chromophores shader that says where."""
    return {"": "table_at", "_next": "table_next"} if layout(axes).mixed else {"": "table_at"}


TABLE_MIX = "table_mix"
"""Socket, of both shaders, that says how two places are mixed."""


def _lobe_inputs(plan: Plan) -> str:
    sockets = [name for suffix in table_slices(plan.axes) for name in lobe_sockets(plan.settings.lobes, suffix, plan.walk)]
    lines = [f"    color {name} = 0,\n" for name in sockets]
    return "".join(lines) + (f"    float {TABLE_MIX} = 0,\n" if layout(plan.axes).mixed else "")


def lobe_sockets(lobes: int = LOBES, suffix: str = "", walk: bool = False) -> list[str]:
    """Names of the surface shader's inputs from the table, in the order of its quantities."""
    names = [f"{kind}_{k}" for kind in ("weight", "d_mm") for k in range(lobes)]
    return [name + suffix for name in (*names, *(WALK_QUANTITIES if walk else ()))]
