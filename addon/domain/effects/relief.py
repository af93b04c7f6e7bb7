"""Pores and fine lines: a bump in true millimetres under the highlights."""

from .effect import Effect, Fragment, Scene, ShaderInput, strength_activation


def _fragments(_scene: Scene) -> tuple[Fragment, ...]:
    fragment = Fragment(
        stage="relief",
        file="relief.osl",
        inputs=(
            ShaderInput("rest_mm", "vector", "vertex", "rest_mm"),
            ShaderInput("relief", "float", "strength", "relief"),
        ),
    )
    return (fragment,)


EFFECT = Effect(
    id="relief",
    label="Relief",
    help="Pores and fine lines of the skin as a bump of the surface, in true millimetres.",
    reads=(),
    writes=(),
    activate=lambda scene: strength_activation(scene, "relief"),
    fragments=_fragments,
    default_strength=0.0,
)
