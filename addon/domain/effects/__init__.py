"""The effects, each declared in its module and listed here once, in the order in which they act."""

from . import anatomy, mottle, oil, oxygenation, perfusion, relief, scattering
from .effect import ELSEWHERE, Activation, Bounds, Effect, Fragment, Frame, Growth, Scene, ShaderInput

EFFECTS: tuple[Effect, ...] = (
    scattering.EFFECT,
    anatomy.EFFECT,
    perfusion.EFFECT,
    oxygenation.EFFECT,
    mottle.EFFECT,  # after perfusion: a flush is blotchy too
    relief.EFFECT,
    oil.EFFECT,
)

__all__ = ["EFFECTS", "ELSEWHERE", "Activation", "Bounds", "Effect", "Fragment", "Frame", "Growth", "Scene", "ShaderInput"]
