"""The planner: which effects a scene calls for, and the smallest table and shader that serve them."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

from .effects import EFFECTS, ELSEWHERE, Activation, Bounds, Effect, Fragment, Scene, grown, scattering, skin_map, thin
from .effects.packed import packed
from .errors import InputError, nearest
from .parameters import PARAMETERS, Skin
from .quality import DEFAULT, Settings, preset

AXIS_CHROMOPHORES = ("hemoglobin", "melanin", "oxygenation", "ink_per_mm")
"""Chromophores that the table can vary over, fastest axis first."""

# Colour goes with the logarithm of an absorber's concentration over most of its range, so these axes are
# spaced by ratio; oxygenation mixes two absorbers linearly. Steps keep linear interpolation between entries
# within Delta E 0.3 at a table_step of 1 (tests/domain/test_lut.py measures it).
_LOG_STEP = {"hemoglobin": 0.24, "melanin": 0.20, "ink_per_mm": 0.70}
_LINEAR_STEP = {"oxygenation": 0.15}
# A logarithm needs a floor: below these fractions an absorber no longer shows.
_LOG_FLOOR = {"hemoglobin": 5e-4, "melanin": 5e-4}
# Or an offset, where most skin has none: about what the dermis absorbs without ink, so that steps are even in shade.
_LOG_OFFSET = {"ink_per_mm": 0.04}


@dataclass(frozen=True)
class Axis:
    """One axis of the table: `count` values of a chromophore from `low` to `high`.

    Evenly spaced, or if `logarithmic` by equal ratios of the value plus `offset`.
    """

    id: str
    low: float
    high: float
    count: int
    logarithmic: bool
    offset: float = 0.0

    def value(self, t: float) -> float:
        """What stands at `t`, 0 to 1 along the axis."""
        if self.logarithmic:
            low, high = self.low + self.offset, self.high + self.offset
            return low * math.exp(math.log(high / low) * t) - self.offset
        return self.low + (self.high - self.low) * t

    def values(self) -> list[float]:
        inside = [self.value(i / (self.count - 1)) for i in range(1, self.count - 1)]
        return [self.low, *inside, self.high]


@dataclass(frozen=True)
class Plan:
    """What will be simulated for a scene, and why."""

    scene: Scene
    settings: Settings
    decisions: Mapping[str, Activation]
    axes: tuple[Axis, ...]
    # What is no axis is the same everywhere: the scene's skin, or what a map of one value holds in its place.
    skin: Skin
    fragments: tuple[Fragment, ...]
    maps: tuple[str, ...]

    @property
    def active(self) -> tuple[Effect, ...]:
        return tuple(e for e in EFFECTS if self.decisions[e.id].active)

    @property
    def walk(self) -> bool:
        """Whether the table holds the medium of a walk too."""
        return self.decisions[thin.EFFECT.id].active

    def without(self, effect_id: str) -> Plan:
        """The plan as it would be if one effect did not exist, to price that effect."""
        return make_plan(replace(self.scene, switched_off=self.scene.switched_off | {effect_id}), self.settings)

    @property
    def sliders(self) -> frozenset[str]:
        """Parameters that a material of this plan has sliders for: they act at once, as far as the table reaches."""
        inputs = [item for fragment in self.fragments for item in fragment.inputs]
        named = {item.key for item in inputs if item.source == "parameter"} | {axis.id for axis in self.axes}
        if any(item.source == "chromophores" and item.key == "film" for item in inputs):
            named.add("oil")
        return frozenset(named - set(skin_map.held(self.scene)))

    @property
    def packed(self) -> dict[str, tuple[str, ...]]:
        """What the material reads of the object's blood: property of three numbers -> the properties that people key and
        bake, which these follow, "" where none."""
        return packed(self.fragments)

    @property
    def fingerprint(self) -> str:
        """Changes with whatever a material of this plan was made from and cannot follow by a slider; samples, which no
        material holds, apart. What the painted features were found to reach follows from the rest."""
        maps = {name: held for name, held in self.scene.maps.items() if grown.channels_of(name) is None}
        plan = self if len(maps) == len(self.scene.maps) else make_plan(replace(self.scene, maps=maps), self.settings)
        scene = plan.scene
        what = {
            "skin": {name: value for name, value in plan.skin.items() if name not in plan.sliders},
            "axes": [asdict(axis) for axis in plan.axes],
            "fragments": [asdict(fragment) for fragment in plan.fragments],
            "strengths": {name: value for name, value in scene.strengths.items() if value},
            "active": [effect.id for effect in plan.active],
            "regions": scene.regions,
            "growth": asdict(scene.growth),
            "maps": maps,
            "quality": self.settings.model_dump(exclude={"samples"}),
        }
        return hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()[:16]

    @property
    def entries(self) -> int:
        """How many skins must be solved (1: a constant, no table; 0: nothing scatters)."""
        return math.prod(axis.count for axis in self.axes) if scattering.EFFECT in self.active else 0


def make_plan(scene: Scene, settings: Settings | None = None) -> Plan:
    """Decides from the scene alone, at some quality (the default one if none is given); does none of the work."""
    settings = settings or preset(DEFAULT).settings
    off = Activation(False, "switched off")
    decisions = {effect.id: off if effect.id in scene.switched_off else effect.activate(scene) for effect in EFFECTS}
    active = [effect for effect in EFFECTS if decisions[effect.id].active]
    axes, constants = _axes(scene, active, settings.table_step)
    fragments = [fragment for effect in active for fragment in effect.fragments(scene)]
    return Plan(
        scene=scene,
        settings=settings,
        decisions=decisions,
        axes=axes,
        skin={**scene.skin, **constants},
        fragments=tuple({fragment.file: fragment for fragment in fragments}.values()),
        maps=tuple(dict.fromkeys(name for effect in active for name in effect.maps(scene))),
    )


def default_strengths() -> dict[str, float]:
    return {effect.id: effect.default_strength for effect in EFFECTS if effect.default_strength is not None}


def check_strengths(given: Mapping[str, float], where: str, base: Mapping[str, float] | None = None) -> dict[str, float]:
    """Strengths; what is missing is as in `base`, else the default.

    Raises InputError for an effect that has no strength of its own or a value beyond 0-1.
    """
    strengths = default_strengths() | dict(base or {})
    for key, value in given.items():
        if key not in strengths:
            raise InputError(f"{where}: {key}: no effect with a strength of its own, {nearest(key, strengths)}")
        if not 0.0 <= value <= 1.0:
            raise InputError(f"{where}: {key}: {value} is outside 0 to 1")
        strengths[key] = float(value)
    return strengths


def check_switches(given: Mapping[str, bool], where: str) -> frozenset[str]:
    """The effects that are off. Raises InputError for an unknown one, or one that cannot be off."""
    switches = [effect.id for effect in EFFECTS if effect.switchable]
    for key in given:
        if key not in switches:
            raise InputError(f"{where}: {key}: no effect that can be switched, {nearest(key, switches)}")
    return frozenset(key for key, on in given.items() if not on)


def _axes(scene: Scene, active: list[Effect], table_step: float) -> tuple[tuple[Axis, ...], dict[str, float]]:
    """The chromophores that differ between places or moments, with the range each one takes, and the others' value."""
    regions = (*scene.regions, ELSEWHERE)
    written = {name for effect in active for name in effect.writes}
    bounds: Bounds = {
        name: {region: _slider_reach(scene, name, written) for region in regions} for name in AXIS_CHROMOPHORES
    }
    for effect in active:
        bounds = effect.bounds(scene, bounds)
    axes, constants = [], {}
    for name in AXIS_CHROMOPHORES:
        low = min(interval[0] for interval in bounds[name].values())
        high = max(interval[1] for interval in bounds[name].values())
        axis = spaced(name, low, high, table_step)
        if axis:
            axes.append(axis)
        else:
            constants[name] = low
    return tuple(axes), constants


def _slider_reach(scene: Scene, name: str, written: set[str]) -> tuple[float, float]:
    """The skin's own value, or all that the artist's slider reaches while he works. Ink has one where a tattoo is."""
    if scene.live and (name != "ink_per_mm" or name in written):
        row = PARAMETERS[name]
        value = scene.skin[name]
        return min(row.soft_min, value), max(row.soft_max, value)
    return scene.skin[name], scene.skin[name]


def spaced(name: str, low: float, high: float, table_step: float) -> Axis | None:
    """The axis of a chromophore that runs from `low` to `high`; None where it stays."""
    offset = _LOG_OFFSET.get(name, 0.0)
    if name in _LOG_STEP:
        floor = _LOG_FLOOR.get(name, 0.0)
        low, high = max(low, floor), max(high, floor)
        span, step = math.log((high + offset) / (low + offset)), table_step * _LOG_STEP[name]
    else:
        span, step = high - low, table_step * _LINEAR_STEP[name]
    if span < 1e-9:
        return None
    return Axis(name, low, high, max(2, math.ceil(span / step) + 1), name in _LOG_STEP, offset)
