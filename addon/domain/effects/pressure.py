"""Pressure: what lies on the skin (a finger, a mask, a pillow) drives the blood out from under it."""

from __future__ import annotations

import math

from .effect import Activation, Bounds, Effect, Fragment, Scene, ShaderInput, scale_bounds, strength_activation
from .packed import PRESSURE, other

ATTRIBUTE = "sanguine_pressure"
"""Vertex group or float attribute of the mesh, 0 to 1: painted, or written by a modifier."""

# What stays under full pressure. Blood leaves the beds of the skin one after another as pressure grows (Popov et al.
# 2017, J. Biomed. Opt. 22:110504); in a finger pressed white the deeper ones keep theirs. How much: a guess.
LOG_HEMOGLOBIN = math.log(0.3)


def _activate(scene: Scene) -> Activation:
    if not scene.pressure:
        return Activation(False, f"the face has no vertex group or attribute {ATTRIBUTE}")
    return strength_activation(scene, "pressure")


def _fragments(scene: Scene) -> tuple[Fragment, ...]:
    numbers, pressing = other(PRESSURE)
    fragment = Fragment(
        stage="chromophores",
        file="pressure.osl",
        inputs=(
            ShaderInput(ATTRIBUTE, "float", "vertex:weight", ATTRIBUTE),
            ShaderInput("pressure", "float", "strength", "pressure"),
            *([numbers] if scene.presses else []),
        ),
        defines={"PRESSURE_LOG_HEMOGLOBIN": f"({LOG_HEMOGLOBIN:.6f})", "PRESSING": pressing if scene.presses else "1.0"},
    )
    return (fragment,)


def _bounds(scene: Scene, bounds: Bounds) -> Bounds:
    least = math.exp(scene.strengths["pressure"] * LOG_HEMOGLOBIN)
    return scale_bounds(bounds, "hemoglobin", dict.fromkeys(bounds["hemoglobin"], (least, 1.0)))


EFFECT = Effect(
    id="pressure",
    label="Pressure",
    help=f"What presses on the skin drives its blood out, where the vertex group or attribute {ATTRIBUTE} says so.",
    reads=("hemoglobin",),
    writes=("hemoglobin",),
    activate=_activate,
    fragments=_fragments,
    bounds=_bounds,
    default_strength=1.0,
    group="blood",
)
