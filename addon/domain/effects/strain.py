"""Strain: skin that is stretched or folded loses blood, skin that gathers holds more."""

from __future__ import annotations

import math

from .. import strain
from .effect import Activation, Bounds, Effect, Fragment, Scene, ShaderInput, scale_bounds, strength_activation
from .packed import NUMBERS

IMAGES = tuple(f"strain_{i}" for i in range(strain.COMPONENTS // 4))
"""Images: components of the logarithm of the change of area, four in each (red, green, blue, alpha)."""

HALVES = ("left", "right")


def moving_activation(scene: Scene, effect_id: str) -> Activation:
    """The rule of effects of a face that moves: on by strength, and only where shape keys move in some frame."""
    decision = strength_activation(scene, effect_id)
    if not decision.active:
        return decision
    if not scene.shape_keys:
        return Activation(False, "the face has no shape keys")
    frames = tuple(frame.id for frame in scene.frames if frame.moves)
    if not frames and not scene.live:
        return Activation(False, "no frame moves the face")
    return Activation(True, decision.because, frames)


def packed_components(driven: tuple[str, ...]) -> dict[str, tuple[int, ...]]:
    """Properties, but for the half of the face in their names -> the components, four to each of `driven`, that their
    numbers are: the first three of each, under its name, and by threes those that are left."""
    alphas = [4 * i + NUMBERS for i in range(len(driven))]
    kind = driven[0].rpartition("_")[0]
    colors = {name: tuple(range(4 * i, 4 * i + NUMBERS)) for i, name in enumerate(driven)}
    return colors | {f"{kind}_alpha_{i // NUMBERS}": tuple(alphas[i : i + NUMBERS]) for i in range(0, len(alphas), NUMBERS)}


def component_inputs(driven: tuple[str, ...], images: tuple[str, ...]) -> tuple[ShaderInput, ...]:
    """Images of components, the properties that drive them in each half of the face (of `packed_components`), and the
    place that says which."""
    inputs = [ShaderInput("rest_mm", "vector", "vertex", "rest_mm")]
    for image in images:
        inputs.append(ShaderInput(image, "color", "map", image))
        inputs.append(ShaderInput(f"{image}_alpha", "float", "map:alpha", image))
    names = [f"{name}_{half}" for name in packed_components(driven) for half in HALVES]
    return (*inputs, *(ShaderInput(name, "color", "object", name) for name in names))


def component_sum(driven: tuple[str, ...], images: tuple[str, ...]) -> str:
    """OSL for the sum of the components, four in an image, as they are driven; `left` is the share of the left half."""
    terms = []
    for name, held in packed_components(driven).items():
        alphas = [f"{images[i // 4]}_alpha" for i in held] + ["0.0"] * (NUMBERS - len(held))
        components = images[driven.index(name)] if name in driven else ", ".join(alphas)
        terms.append(f"dot(vector({components}), vector(mix({name}_right, {name}_left, left)))")
    return "(" + " + ".join(terms) + ")"


def _fragments(_scene: Scene) -> tuple[Fragment, ...]:
    fragment = Fragment(
        stage="chromophores",
        file="strain.osl",
        inputs=(*component_inputs(IMAGES, IMAGES), ShaderInput("strain", "float", "strength", "strain")),
        defines={
            "STRAIN_LOG_AREA": component_sum(IMAGES, IMAGES),
            "HALF_BLEND_MM": f"{strain.HALF_BLEND_MM}",
            "STRAIN_STRETCH": f"{strain.STRETCH_PER_LOG_AREA}",
            "STRAIN_POOL": f"{strain.POOL_PER_LOG_AREA}",
            "STRAIN_FOLD": f"{strain.FOLD_PER_LOG_AREA}",
            "STRAIN_FOLD_FROM": f"({strain.FOLD_FROM_LOG_AREA})",
            "STRAIN_LOW": f"({strain.LOW})",
        },
    )
    return (fragment,)


def _bounds(scene: Scene, bounds: Bounds) -> Bounds:
    strength = scene.strengths["strain"]
    factors = math.exp(strength * strain.LOW), math.exp(strength * strain.HIGH)
    return scale_bounds(bounds, "hemoglobin", dict.fromkeys(bounds["hemoglobin"], factors))


EFFECT = Effect(
    id="strain",
    label="Strain",
    help="Blood follows the shape: stretched and folded skin pales, skin that gathers reddens. From the shape keys.",
    reads=("hemoglobin",),
    writes=("hemoglobin",),
    activate=lambda scene: moving_activation(scene, "strain"),
    fragments=_fragments,
    bounds=_bounds,
    maps=lambda scene: IMAGES,
    default_strength=0.0,
    group="blood",
)
