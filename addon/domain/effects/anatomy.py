"""Anatomy: cheeks, nose, ears and lips carry more vessels; pigment and oil differ by region."""

from dataclasses import replace

from ..blood import ANATOMY
from . import skin_map
from .effect import Activation, Bounds, Effect, Fragment, Scene, ShaderInput, scale_bounds, shift_bounds, strength_activation

MAP = "anatomy"
"""Image: hemoglobin, melanin and oil factors (1 = as the skin's own value) and, in alpha, the oxygenation shift."""


def _bounds(scene: Scene, bounds: Bounds) -> Bounds:
    strength = scene.strengths["anatomy"]
    present = {region: row for region, row in ANATOMY.items() if region in scene.regions}
    for chromophore in ("hemoglobin", "melanin"):
        factors = {r: 1.0 + strength * (getattr(row, chromophore) - 1.0) for r, row in present.items()}
        bounds = scale_bounds(bounds, chromophore, {r: (f, f) for r, f in factors.items()})
    shifts = {r: strength * row.oxygenation for r, row in present.items()}
    return shift_bounds(bounds, "oxygenation", {r: (s, s) for r, s in shifts.items()})


def _fragments(_scene: Scene) -> tuple[Fragment, ...]:
    fragment = Fragment(
        stage="chromophores",
        file="anatomy.osl",
        inputs=(
            ShaderInput("anatomy_factors", "color", "map", MAP, default=1.0),
            ShaderInput("anatomy_shift", "float", "map:alpha", MAP),
            ShaderInput("anatomy", "float", "strength", "anatomy"),
        ),
    )
    return (fragment,)


def _activate(scene: Scene) -> Activation:
    """The skin map comes after and stands: what it holds is not multiplied by the region's density a second time."""
    decision = strength_activation(scene, "anatomy", needs_regions=True)
    held = skin_map.held(scene)
    if not decision.active or not held:
        return decision
    left = [name for name in skin_map.CHANNELS if name not in held]
    if not left:
        return Activation(False, "the skin map holds all that it would change")
    return replace(decision, because=f"{decision.because}; {', '.join(left)} alone: the skin map holds the rest")


EFFECT = Effect(
    id="anatomy",
    label="Anatomy",
    help="Regional vascular density, pigment and oil of a face: cheeks, nose, ears, lips and the rest.",
    reads=("hemoglobin", "melanin", "oxygenation", "oil"),
    writes=("hemoglobin", "melanin", "oxygenation", "oil"),
    activate=_activate,
    fragments=_fragments,
    bounds=_bounds,
    maps=lambda scene: (MAP,),
    default_strength=1.0,
    group="structure",
)
