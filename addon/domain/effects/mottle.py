"""Mottle: small-scale unevenness of blood and pigment, without which skin looks like wax."""

from .effect import Bounds, Effect, Fragment, Scene, ShaderInput, scale_bounds, strength_activation

# Largest relative change at strength 1. Skin is uneven by a few Delta E over millimetres; these give about
# that on light skin. A guess by eye: no source gives the variance by scale.
BLOOD_SHARE, PIGMENT_SHARE = 0.35, 0.22


def _bounds(scene: Scene, bounds: Bounds) -> Bounds:
    strength = scene.strengths["mottle"]
    for chromophore, share in (("hemoglobin", BLOOD_SHARE), ("melanin", PIGMENT_SHARE)):
        around = (1.0 - share * strength, 1.0 + share * strength)
        bounds = scale_bounds(bounds, chromophore, {region: around for region in bounds[chromophore]})
    return bounds


def _fragments(_scene: Scene) -> tuple[Fragment, ...]:
    fragment = Fragment(
        stage="chromophores",
        file="mottle.osl",
        inputs=(
            ShaderInput("rest_mm", "vector", "vertex", "rest_mm"),
            ShaderInput("mottle", "float", "strength", "mottle"),
        ),
        defines={"BLOOD_SHARE": f"{BLOOD_SHARE}", "PIGMENT_SHARE": f"{PIGMENT_SHARE}"},
    )
    return (fragment,)


EFFECT = Effect(
    id="mottle",
    label="Mottle",
    help="Unevenness of blood and pigment over millimetres.",
    reads=("hemoglobin", "melanin"),
    writes=("hemoglobin", "melanin"),
    activate=lambda scene: strength_activation(scene, "mottle"),
    fragments=_fragments,
    bounds=_bounds,
    default_strength=0.0,
)
