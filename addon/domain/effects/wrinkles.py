"""Wrinkles: furrows that form across the compression of the skin while the face moves, a bump in true millimetres."""

from __future__ import annotations

from .. import strain
from .effect import Effect, Fragment, Scene, ShaderInput
from .strain import component_inputs, component_sum, moving_activation

IMAGES = tuple(f"wrinkles_{i}" for i in range(strain.COMPONENTS // 4))
"""Images: heights in mm of four fold patterns in each (red, green, blue, alpha)."""


def _fragments(_scene: Scene) -> tuple[Fragment, ...]:
    fragment = Fragment(
        stage="relief",
        file="wrinkles.osl",
        inputs=(*component_inputs(IMAGES), ShaderInput("wrinkles", "float", "strength", "wrinkles")),
        defines={"WRINKLE_HEIGHT_MM": component_sum(IMAGES), "HALF_BLEND_MM": f"{strain.HALF_BLEND_MM}"},
    )
    return (fragment,)


EFFECT = Effect(
    id="wrinkles",
    label="Expression wrinkles",
    help="Furrows where the moving face folds its skin, across the compression. From the shape keys.",
    reads=(),
    writes=(),
    activate=lambda scene: moving_activation(scene, "wrinkles"),
    fragments=_fragments,
    maps=lambda scene: IMAGES,
    default_strength=0.0,
)
