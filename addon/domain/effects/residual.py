"""Residual: what a picture has over its skin (brows, make-up, baked shade), as a factor on the light that left it."""

from .effect import Activation, Effect, Fragment, Scene, ShaderInput

MAP = "residual"
"""Image: a factor per channel, 1 where there is bare skin."""


def _activate(scene: Scene) -> Activation:
    if MAP not in scene.maps:
        return Activation(False, "the face has no residual")
    return Activation(True, "a map holds what is over the skin", tuple(frame.id for frame in scene.frames))


EFFECT = Effect(
    id="residual",
    label="Residual",
    help="What a picture has over its skin (brows, make-up, baked shade): a factor on the light that left the skin.",
    reads=(),
    writes=(),
    activate=_activate,
    fragments=lambda scene: (
        Fragment(stage="surface", file="residual.osl", inputs=(ShaderInput("residual", "color", "map", MAP, default=1.0),)),
    ),
    maps=lambda scene: (MAP,),
)
