"""The OSL shaders of a plan, assembled from `shaders_osl/` and the fragments of the active effects.

`chromophores.osl` says what is in the skin at a point and where the table holds it; Image Texture nodes read the
table; `surface.osl` turns what they read into closures; `relief.osl`, if an effect needs it, bends the normal.
What the plan leaves out is not in the text: no input, no instruction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from .effects import Fragment, ShaderInput
from .lut import LOBES, table_height, table_width
from .plan import Axis, Plan
from .resources import shaders_path


@dataclass(frozen=True)
class Shader:
    """OSL source of one script node and the inputs that effects added to it."""

    source: str
    inputs: tuple[ShaderInput, ...]


def assemble(plan: Plan) -> dict[str, Shader]:
    """Stage -> shader: "chromophores" and "surface", and "relief" when an active effect has a fragment for it."""
    stages = {fragment.stage for fragment in plan.fragments}
    from_points = {item.key for f in plan.fragments for item in f.inputs if item.source == "chromophores"}
    axes = plan.axes
    defines = {
        "AXES": len(axes),
        "TABLE_WIDTH": float(table_width(axes)),
        "TABLE_HEIGHT": float(table_height(axes, plan.settings.lobes)),
        "FILM": int("film" in from_points),
    }
    for i, axis in enumerate(axes):
        defines |= {
            f"AXIS_{i}_VALUE": f"({axis.id} + {axis.offset})" if axis.offset else axis.id,
            f"AXIS_{i}_LOW": axis.low + axis.offset,
            f"AXIS_{i}_HIGH": axis.high + axis.offset,
            f"AXIS_{i}_COUNT": float(axis.count),
            f"AXIS_{i}_LOG": int(axis.logarithmic),
        }
    shaders = {
        "chromophores": _assemble("chromophores", plan.fragments, defines),
        "surface": _assemble(
            "surface",
            plan.fragments,
            {"LOBES": plan.settings.lobes, "SLICES": len(table_slices(axes)), "RELIEF": int("relief" in stages)},
            lobes=_lobe_inputs(plan),
        ),
    }
    if "relief" in stages:
        shaders["relief"] = _assemble("relief", plan.fragments, {})
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
    """The places of the table that are read, 1, 2 or 4 for axes up to 2, 3 or 4: suffix of the surface shader's lobe
    inputs -> output of the chromophores shader that says where."""
    slices = {"": "table_low", "_high": "table_high", "_next": "table_low_next", "_high_next": "table_high_next"}
    return dict(list(slices.items())[: 1 << max(0, len(axes) - 2)])


def table_mixes(axes: tuple[Axis, ...]) -> tuple[str, ...]:
    """Sockets, of both shaders, that say how slices are mixed."""
    return ("table_mix", "table_mix_next")[: max(0, len(axes) - 2)]


def _lobe_inputs(plan: Plan) -> str:
    lines = [
        f"    color weight_{k}{suffix} = 0, color d_mm_{k}{suffix} = 0,\n"
        for suffix in table_slices(plan.axes)
        for k in range(plan.settings.lobes)
    ]
    return "".join(lines) + "".join(f"    float {mix} = 0,\n" for mix in table_mixes(plan.axes))


def lobe_sockets(lobes: int = LOBES, suffix: str = "") -> list[str]:
    """Names of the surface shader's lobe inputs in the order of the table's quantities."""
    return [f"{kind}_{k}{suffix}" for kind in ("weight", "d_mm") for k in range(lobes)]
