"""Wrinkles: furrows that form across the compression of the skin while the face moves, in true millimetres."""

from __future__ import annotations

from .. import strain
from .effect import Effect, Fragment, Scene, ShaderInput
from .strain import component_inputs, component_sum, moving_activation

DRIVEN = tuple(f"wrinkles_{i}" for i in range(strain.COMPONENTS // 4))
"""What drives fold patterns, four by each."""

SLOPES = tuple(tuple(f"{name}_slope_{axis}" for name in DRIVEN) for axis in ("t", "b"))
"""Images: slopes of four fold patterns in each (red, green, blue, alpha), along the tangent and along the bitangent."""

IMAGES = tuple(name for pair in zip(*SLOPES, strict=True) for name in pair)


def _fragments(_scene: Scene) -> tuple[Fragment, ...]:
    fragment = Fragment(
        stage="slopes",
        file="wrinkles.osl",
        inputs=(*component_inputs(DRIVEN, IMAGES), ShaderInput("wrinkles", "float", "strength", "wrinkles")),
        defines={
            **{f"WRINKLE_SLOPE_{axis}": component_sum(DRIVEN, images) for axis, images in zip("TB", SLOPES, strict=True)},
            "HALF_BLEND_MM": f"{strain.HALF_BLEND_MM}",
        },
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
