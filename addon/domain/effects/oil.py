"""The oil film: a Torrance-Sparrow reflection above the skin; what it reflects does not enter."""

import sanguine_core

from ..film import ENTRIES, film_table
from . import skin_map
from .effect import Activation, Effect, Fragment, Scene, ShaderInput


def _activate(scene: Scene) -> Activation:
    frames = tuple(frame.id for frame in scene.frames)
    if "oil" in skin_map.held(scene):
        low, high = scene.maps[skin_map.MAP]["oil"]
        if high <= 0.0:
            return Activation(False, "oil is 0 in the skin map")
        return Activation(True, f"oil is {low:g} to {high:g} in the skin map", frames)
    oil = scene.skin["oil"]
    if oil <= 0.0 and not scene.live:
        return Activation(False, "oil is 0")
    return Activation(True, f"oil is {oil:g}", frames)


def _fragments(_scene: Scene) -> tuple[Fragment, ...]:
    fragment = Fragment(
        stage="surface",
        file="oil.osl",
        inputs=(
            ShaderInput("film", "float", "chromophores", "film"),
            ShaderInput("roughness", "float", "parameter", "roughness"),
        ),
        defines={
            "FILM_IOR": f"{sanguine_core.OIL_FILM_INDEX}",
            "FILM_ENTRIES": f"{ENTRIES}",
            "FILM_LENGTH": f"{ENTRIES * ENTRIES}",  # OSL wants a literal for the length of an array
            "FILM_ALBEDO": ", ".join(f"{value:.5f}" for value in film_table(sanguine_core.OIL_FILM_INDEX).ravel()),
        },
    )
    return (fragment,)


EFFECT = Effect(
    id="oil",
    label="Oil film",
    help="Highlights of the oil film on the skin. The light it reflects is taken from what enters.",
    reads=("oil", "roughness"),
    writes=(),
    activate=_activate,
    fragments=_fragments,
)
