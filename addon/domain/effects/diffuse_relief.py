"""Diffuse relief: the fine shape of the surface shades the light from under the skin too, not the highlights alone."""

from . import grown
from .effect import Activation, Effect, Fragment, Scene, ShaderInput, strength_activation

_SHAPES = ("relief", "wrinkles")


def _activate(scene: Scene) -> Activation:
    decision = strength_activation(scene, "diffuse_relief")
    if not decision.active or grown.has_height(scene) or any(scene.strengths.get(name, 0.0) > 0.0 for name in _SHAPES):
        return decision
    return Activation(False, "nothing shapes the surface")


EFFECT = Effect(
    id="diffuse_relief",
    label="Diffuse relief",
    help="Pores, furrows and wrinkles shade the light from under the skin too, not its highlights alone. Costs time: "
    "Cycles then runs what bends the surface a second time where light leaves the skin, and all of a material of OSL.",
    reads=(),
    writes=(),
    activate=_activate,
    fragments=lambda scene: (
        Fragment(
            stage="surface",
            file="diffuse_relief.osl",
            inputs=(ShaderInput("diffuse_relief", "float", "strength", "diffuse_relief"),),
            defines={"RELIEF": "1"},
        ),
    ),
    default_strength=1.0,
)
