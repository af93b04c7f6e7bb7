"""Skin map: what is in the skin at each place, read from a picture or imported, in the place of the skin's own values."""

from .effect import Activation, Bounds, Effect, Fragment, Interval, Scene, ShaderInput, inside

MAP = "skin_map"
"""Image: hemoglobin, melanin and oil and, in alpha, oxygenation; absolute values, of those that the scene names."""

CHANNELS = ("hemoglobin", "melanin", "oil", "oxygenation")


def held(scene: Scene) -> tuple[str, ...]:
    """The quantities that the scene's skin map holds, in the order of its channels."""
    return tuple(name for name in CHANNELS if name in scene.maps.get(MAP, {}))


def _activate(scene: Scene) -> Activation:
    if MAP not in scene.maps:
        return Activation(False, "the face has no skin map")
    if not held(scene):
        return Activation(False, f"the skin map holds none of {', '.join(CHANNELS)}")
    return Activation(True, f"a map holds the skin's {', '.join(held(scene))}", tuple(frame.id for frame in scene.frames))


def _bounds(scene: Scene, bounds: Bounds) -> Bounds:
    def everywhere(chromophore: str) -> dict[str, Interval]:
        return dict.fromkeys(bounds[chromophore], inside(chromophore, scene.maps[MAP][chromophore]))

    return {**bounds, **{name: everywhere(name) for name in held(scene) if name in bounds}}


def _fragments(scene: Scene) -> tuple[Fragment, ...]:
    holds = held(scene)
    inputs = []
    if set(holds) - {"oxygenation"}:
        inputs.append(ShaderInput("skin_map", "color", "map", MAP))
    if "oxygenation" in holds:
        inputs.append(ShaderInput("skin_map_oxygenation", "float", "map:alpha", MAP))
    fragment = Fragment(
        stage="chromophores",
        file="skin_map.osl",
        inputs=tuple(inputs),
        defines={f"SKIN_MAP_{name.upper()}": str(int(name in holds)) for name in CHANNELS},
    )
    return (fragment,)


EFFECT = Effect(
    id="skin_map",
    label="Skin Map",
    help="Blood, pigment and oil of each place as a map holds them, read from a picture or imported.",
    reads=(),
    writes=("hemoglobin", "melanin", "oil", "oxygenation"),
    activate=_activate,
    fragments=_fragments,
    bounds=_bounds,
    maps=lambda scene: (MAP,),
)
