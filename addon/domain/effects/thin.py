"""Thin parts: ears and nostrils let light through, which a volumetric walk follows where Burley lobes cannot."""

from __future__ import annotations

import math

import numpy as np

from .. import walk
from ..head.surface import smoothstep
from .effect import Activation, Effect, Fragment, Scene, ShaderInput, strength_activation

ATTRIBUTE = "sanguine_thin"
"""Vertex group or float attribute of the mesh, 0 to 1: measured when the skin is applied, unless somebody painted it."""

# Skin of 6 mm lets 1 % of red light through, which a sun behind an ear makes a glow; of 10 mm 0.1 %, which nothing does
# (light skin, `domain/walk.py`): there the walk may end. Ears are 2 to 6 mm thick, wings of the nose 3 to 6 mm.
FULL_MM, GONE_MM = 6.0, 10.0


# Of the directions around a place, the share that must be open for light to count as coming in: none up to the first, all
# from the second on. Inside a nostril 0.1 to 0.3 are, behind an ear 0.3, within a closed mouth and behind a lid 0 to 0.03.
OPEN = (0.04, 0.12)


# Meshes are symmetric, and a ray that meets an edge of a triangle to the bit may slip through: none lies in a plane of theirs.
_ASKEW = 0.3779


def _directions(rings: tuple[tuple[float, int], ...]) -> tuple[tuple[float, float, float], ...]:
    """Unit vectors in rings around z: (degrees from it, how many)."""
    made = []
    for degrees, count in rings:
        tilt = math.radians(degrees)
        for k in range(count):
            turn = 2.0 * math.pi * (k + _ASKEW) / count
            made.append((math.sin(tilt) * math.cos(turn), math.sin(tilt) * math.sin(turn), math.cos(tilt)))
    return tuple(made)


CONE = _directions(((0.5, 1), (20.0, 6), (40.0, 12)))
"""Rays into the flesh, about the inward normal."""
SKY = _directions(((18.0, 6), (41.0, 12), (66.0, 12)))
"""Rays out of it, about the outward one; each stands for about as much of the light."""


def thinness(thickness_mm: np.ndarray) -> np.ndarray:
    """1 up to FULL_MM, 0 from GONE_MM on, smooth between."""
    return 1.0 - smoothstep(FULL_MM, GONE_MM, np.asarray(thickness_mm, dtype=float))


def lit_share(open_to: np.ndarray) -> np.ndarray:
    """1 where the share of directions that are open lets light in, 0 where it does not, smooth between."""
    return smoothstep(*OPEN, np.asarray(open_to))


def _fragments(_scene: Scene) -> tuple[Fragment, ...]:
    fragment = Fragment(
        stage="surface",
        file="thin.osl",
        inputs=(
            ShaderInput(ATTRIBUTE, "float", "vertex:weight", ATTRIBUTE),
            ShaderInput("thin", "float", "strength", "thin"),
        ),
        defines={
            "WALK_INDEX": f"{walk.INDEX}",
            **{f"WALK_CURVE_{k}": f"({value})" for k, value in enumerate(walk.CURVE)},
            **{f"WALK_SLANT_{k}": f"({value})" for k, value in enumerate(walk.CURVE_SLANT)},
        },
    )
    return (fragment,)


EFFECT = Effect(
    id="thin",
    label="Thin parts",
    help=f"Ears and nostrils glow when lit from behind, where they are thin: measured, or painted as the vertex group {ATTRIBUTE}.",
    reads=(),
    writes=(),
    activate=lambda scene: strength_activation(scene, "thin"),
    fragments=_fragments,
    default_strength=0.0,
    group="structure",
)
