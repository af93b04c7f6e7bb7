"""The effects, each declared in its module and listed here once, in the order in which they act."""

from . import (
    anatomy, diffuse_relief, grown, oil, oxygenation, perfusion, pressure, relief, residual, scattering, skin_map, strain,
    thin, wrinkles,
)
from .effect import ELSEWHERE, Activation, Bounds, Effect, Fragment, Frame, Growth, Scene, ShaderInput

EFFECTS: tuple[Effect, ...] = (
    scattering.EFFECT,
    anatomy.EFFECT,
    skin_map.EFFECT,  # after anatomy: what the map holds stands as it is
    *grown.EFFECTS,  # before perfusion: blood comes on top of what has grown
    perfusion.EFFECT,
    oxygenation.EFFECT,
    strain.EFFECT,
    pressure.EFFECT,
    relief.EFFECT,
    wrinkles.EFFECT,
    diffuse_relief.EFFECT,
    thin.EFFECT,
    residual.EFFECT,  # after the walk, whose light it colours too
    oil.EFFECT,  # after the residual: the film lies over brows and make-up too
)

__all__ = ["EFFECTS", "ELSEWHERE", "Activation", "Bounds", "Effect", "Fragment", "Frame", "Growth", "Scene", "ShaderInput"]
