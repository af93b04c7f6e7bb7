"""What an effect declares, and the view of a scene by which the planner decides.

An effect is one module of this package that holds one `EFFECT`, listed once in `effects/__init__.py`.
The planner asks it whether the scene calls for it and what range each chromophore then takes; the shader
is assembled from the fragments of the active effects, and only their maps and inputs are made.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ..blood import ELSEWHERE as ELSEWHERE
from ..blood import Change
from ..parameters import PARAMETERS, Skin

Interval = tuple[float, float]
Bounds = Mapping[str, Mapping[str, Interval]]
"""chromophore id -> region id -> the lowest and highest value it takes there."""


@dataclass(frozen=True)
class Frame:
    """One moment of a shot: which emotions and states are on, and how strongly blood answers."""

    id: str
    emotions: Mapping[str, float] = field(default_factory=dict)
    blood: float = 1.0
    # (region, quantity) -> the change of blood at this moment, lowest and highest; None: settled, as `emotions` ask.
    changes: Mapping[tuple[str, str], Change] | None = None
    # False when neither an emotion nor an action unit moves the face.
    moves: bool = True


@dataclass(frozen=True)
class Growth:
    """Whose features grow, and which individual's. See `sanguine/feature.hpp` for the ranges."""

    seed: int = 0
    age_years: float = 30.0
    sun: float = 0.5
    masculinity: float = 0.0


@dataclass(frozen=True)
class Scene:
    """All that the planner may look at."""

    skin: Skin
    frames: tuple[Frame, ...]
    # Effects an artist switches by strength rather than by a skin parameter: effect id -> 0-1.
    strengths: Mapping[str, float] = field(default_factory=dict)
    # Regions whose masks the face has. A face without masks has none.
    regions: tuple[str, ...] = ()
    # True while an artist works: every control may still move, so axes span what sliders reach.
    live: bool = False
    growth: Growth = Growth()
    # Maps that came with the face (from a picture, from elsewhere) or are painted already: map id -> what it holds ->
    # the range over its texels.
    maps: Mapping[str, Mapping[str, Interval]] = field(default_factory=dict)
    # Whether the face has shape keys, by which it moves, and a vertex group (or attribute) of outer pressure.
    shape_keys: bool = True
    pressure: bool = False
    # Whether the rig has a slider by which the pressure comes and goes.
    presses: bool = False
    # Effects that somebody has switched off, whatever calls for them: their strength is 0, their map is as if not there.
    switched_off: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if off := self.switched_off:
            object.__setattr__(self, "strengths", {k: 0.0 if k in off else v for k, v in self.strengths.items()})
            object.__setattr__(self, "maps", {k: v for k, v in self.maps.items() if k not in off})


@dataclass(frozen=True)
class Activation:
    """Whether an effect runs, why, and in which frames (their ids)."""

    active: bool
    because: str
    frames: tuple[str, ...] = ()


@dataclass(frozen=True)
class ShaderInput:
    """One input of the assembled shader and where its value comes from.

    source: "parameter" (a schema id, a slider of the node group), "strength" (the effect's own slider),
    "object" (a custom property of the object, of three numbers), "vertex" (an attribute of the mesh, "vertex:weight" a
    single number of it), "map" (a packed image, "map:alpha" its alpha channel), "chromophores" (an output of the first
    shader, for inputs of the second).
    """

    name: str
    type: str  # OSL type: "float", "color" or "vector"
    source: str
    key: str
    default: float = 0.0
    # Of "object": the properties that its three numbers follow by drivers, "" where none (effects/packed.py).
    parts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Fragment:
    """OSL of one effect: a file of `shaders_osl/effects/`, its inputs, and macros the file uses."""

    stage: str  # "chromophores", "surface", "relief" or "slopes": the file of `shaders_osl/` it goes into
    file: str
    inputs: tuple[ShaderInput, ...] = ()
    defines: Mapping[str, str] = field(default_factory=dict)


def _unchanged(_scene: Scene, bounds: Bounds) -> Bounds:
    return bounds


def _no_maps(_scene: Scene) -> tuple[str, ...]:
    return ()


@dataclass(frozen=True)
class Effect:
    """One effect, declared once."""

    id: str
    label: str
    help: str
    reads: tuple[str, ...]  # chromophores or parameters it needs
    writes: tuple[str, ...]  # chromophores it changes
    activate: Callable[[Scene], Activation]
    # Effects may share a fragment: of those with the same file, all alike, the shader gets one.
    fragments: Callable[[Scene], tuple[Fragment, ...]]
    bounds: Callable[[Scene, Bounds], Bounds] = _unchanged
    maps: Callable[[Scene], tuple[str, ...]] = _no_maps
    # An effect with a slider of its own has a default strength (0 = off unless asked for).
    default_strength: float | None = None
    # Whether people may switch it off. What everything else stands on has no switch.
    switchable: bool = True
    # Where panels show its slider: a group of parameters (native/schema), or "features".
    group: str = "features"


def strength_activation(scene: Scene, effect_id: str, needs_regions: bool = False) -> Activation:
    """The rule of effects that run when their own strength is above 0."""
    strength = scene.strengths.get(effect_id, 0.0)
    if strength <= 0.0:
        return Activation(False, f"its strength is {strength:g}")
    if needs_regions and not scene.regions:
        return Activation(False, "the face has no region masks")
    return Activation(True, f"its strength is {strength:g}", tuple(frame.id for frame in scene.frames))


def scale_bounds(bounds: Bounds, chromophore: str, factors: Mapping[str, Interval]) -> Bounds:
    """`bounds` with one chromophore multiplied by a range of factors per region (1 where not named)."""
    return _mapped(bounds, chromophore, factors, (1.0, 1.0), lambda v, f: (v[0] * f[0], v[1] * f[1]))


def shift_bounds(bounds: Bounds, chromophore: str, changes: Mapping[str, Interval]) -> Bounds:
    """`bounds` with a range of changes per region added to one chromophore (0 where not named)."""
    return _mapped(bounds, chromophore, changes, (0.0, 0.0), lambda v, c: (v[0] + c[0], v[1] + c[1]))


def inside(chromophore: str, interval: Interval) -> Interval:
    """`interval` cut to what the chromophore may be."""
    row = PARAMETERS[chromophore]
    low, high = (min(max(v, row.hard_min), row.hard_max) for v in interval)
    return low, high


def _mapped(bounds, chromophore, by_region, neutral, combine) -> Bounds:
    changed = {
        name: inside(chromophore, combine(value, by_region.get(name, neutral)))
        for name, value in bounds[chromophore].items()
    }
    return {**bounds, chromophore: changed}
