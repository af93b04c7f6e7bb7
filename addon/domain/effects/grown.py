"""Features that grow on the skin, freckles, moles, vessels and the like: one effect per row of the native core.

All of them share three maps of sums over their layers, each made only when an active feature writes to it; of heights the
material gets the slopes (domain/slopes.py). A feature
that a state of the body brings out (`feature` in rigs/blood.toml) has its layer in maps of its own besides, times a
strength that the object holds and that moves: on top of its own strength, together no more than the whole layer.
"""

from __future__ import annotations

import math
from typing import Any

import sanguine_core

from ..blood import FEATURE, blood_property
from .blood_change import frame_changes
from .effect import (
    Activation,
    Bounds,
    Effect,
    Fragment,
    Interval,
    Scene,
    ShaderInput,
    scale_bounds,
    shift_bounds,
    strength_activation,
)
from .packed import other

MAPS = {
    "grown": ("log_hemoglobin", "log_melanin", "log_oil", "oxygenation"),
    "grown_ink": ("ink_per_mm",),
    "grown_height": ("height_mm",),
}
"""Map id -> what its channels hold: natural logarithms of factors, or changes that are added."""

_FACTORS = {"log_hemoglobin": "hemoglobin", "log_melanin": "melanin", "log_oil": "oil"}
_CHANGES = ("oxygenation", "ink_per_mm")

_KEYED, _HEIGHT, _SLOPE = "keyed_", "_height", "_slope"

ROWS: dict[str, dict[str, Any]] = {row["id"]: row for row in sanguine_core.features()}


def written(scene: Scene) -> frozenset[str]:
    """Channels that the scene's active features write."""
    active = (row for name, row in ROWS.items() if scene.strengths.get(name, 0.0) > 0.0)
    return frozenset(change["channel"] for row in active for change in row["changes"])


def has_height(scene: Scene) -> bool:
    """Whether a feature, grown or brought out by a state, shapes the surface."""
    brought_out = keyed(scene)
    return any(
        change["channel"] == "height_mm"
        for name, row in ROWS.items()
        if scene.strengths.get(name, 0.0) > 0.0 or name in brought_out
        for change in row["changes"]
    )


def channels_of(name: str) -> tuple[str, ...] | None:
    """What the channels of a painted map, or of the slopes of one, hold; None of any other map."""
    if height_of(name) is not None:
        return ("slope_t", "slope_b")
    if name.startswith(_KEYED):
        return MAPS["grown_height" if name.endswith(_HEIGHT) else "grown"]
    return MAPS.get(name)


def feature_of(name: str) -> str | None:
    """The feature that a painted map holds at full strength, all by itself; None of sums."""
    return name.removeprefix(_KEYED).removesuffix(_HEIGHT) if name.startswith(_KEYED) else None


def height_of(name: str) -> str | None:
    """The painted map whose slopes the material's map `name` holds; None where it holds the painted map itself."""
    if name.endswith(_SLOPE) and (name.startswith(_KEYED) or name == "grown" + _SLOPE):
        return name.removesuffix(_SLOPE) + _HEIGHT
    return None


def keyed(scene: Scene) -> dict[str, float]:
    """Features that a state brings out at some moment, and their highest strength then, on top of their own."""
    found: dict[str, float] = {}
    for frame in scene.frames:
        for (feature, quantity), (_, high) in frame_changes(frame, scene.live).items():
            if quantity == FEATURE and feature not in scene.switched_off:
                found[feature] = max(found.get(feature, 0.0), min(high, _left(scene, feature)))
    return {feature: high for feature, high in found.items() if high > 0.0}


def _left(scene: Scene, feature: str) -> float:
    """How much of its layer its own strength leaves."""
    return 1.0 - scene.strengths.get(feature, 0.0)


def _maps(scene: Scene, row: dict[str, Any]) -> tuple[str, ...]:
    mine = {change["channel"] for change in row["changes"]}
    wanted = [name for name, channels in MAPS.items() if mine & set(channels)]
    if row["id"] in keyed(scene):
        if scene.strengths.get(row["id"], 0.0) == 0.0:
            wanted = []
        names = {"grown": f"{_KEYED}{row['id']}", "grown_height": f"{_KEYED}{row['id']}{_HEIGHT}"}
        wanted += [names[name] for name in names if mine & set(MAPS[name])]
    return tuple(name.removesuffix(_HEIGHT) + _SLOPE if name.endswith(_HEIGHT) else name for name in wanted)


def _fragments(scene: Scene, row: dict[str, Any]) -> tuple[Fragment, ...]:
    channels = written(scene)
    factors = [name for name in _FACTORS if name in channels]
    inputs = []
    if factors:
        inputs.append(ShaderInput("grown", "color", "map", "grown"))
    if "oxygenation" in channels:
        inputs.append(ShaderInput("grown_oxygenation", "float", "map:alpha", "grown"))
    made = {
        "grown": Fragment(
            stage="chromophores",
            file="grown.osl",
            inputs=tuple(inputs),
            defines={f"GROWN_{name.upper()}": str(int(name in channels)) for name in MAPS["grown"]},
        ),
        "grown_ink": Fragment(
            stage="chromophores",
            file="grown_ink.osl",
            inputs=(
                ShaderInput("grown_ink", "color", "map", "grown_ink"),
                ShaderInput("skin_ink_per_mm", "float", "parameter", "ink_per_mm"),
            ),
        ),
        "grown_slope": Fragment(
            stage="slopes",
            file="grown_slope.osl",
            inputs=(ShaderInput("grown_slope", "color", "map", "grown_slope"),),
        ),
    }
    own = tuple(made[name] for name in _maps(scene, row) if name in made)
    return (*own, *_keyed_fragments(scene)) if row["id"] in keyed(scene) else own


def _keyed_fragments(scene: Scene) -> tuple[Fragment, ...]:
    """One for the colour and one for the height of all features that are keyed."""
    terms: dict[str, list[str]] = {}
    inputs: dict[str, list[ShaderInput]] = {"grown": [], "grown_height": []}
    for feature in keyed(scene):
        name = f"{_KEYED}{feature}"
        item, slider = other(blood_property(FEATURE, feature))
        read = {
            **{channel: f"{name}[{MAPS['grown'].index(channel)}]" for channel in _FACTORS},
            "oxygenation": f"{name}_oxygenation",
            "height_mm": f"vector({name}{_SLOPE})",
        }
        mine = [change["channel"] for change in ROWS[feature]["changes"]]
        for channel in mine:
            terms.setdefault(channel, []).append(f"{read[channel]} * clamp({slider}, 0.0, {_left(scene, feature):g})")
        if set(mine) & set(_FACTORS):
            inputs["grown"].append(ShaderInput(name, "color", "map", name))
        if "oxygenation" in mine:
            inputs["grown"].append(ShaderInput(f"{name}_oxygenation", "float", "map:alpha", name))
        if "height_mm" in mine:
            inputs["grown_height"].append(ShaderInput(f"{name}{_SLOPE}", "color", "map", f"{name}{_SLOPE}"))
        for kind in inputs:
            if set(mine) & set(MAPS[kind]):
                inputs[kind].append(item)
    sums = {f"KEYED_{channel.upper()}": f"({' + '.join(added)})" for channel, added in terms.items()}
    slope = sums.pop("KEYED_HEIGHT_MM", "")
    made = []
    if inputs["grown"]:
        made.append(Fragment("chromophores", "keyed.osl", tuple(inputs["grown"]), sums))
    if slope:
        made.append(Fragment("slopes", "keyed_slope.osl", tuple(inputs["grown_height"]), {"KEYED_SLOPE": slope}))
    return tuple(made)


def _bounds(scene: Scene, bounds: Bounds, row: dict[str, Any]) -> Bounds:
    brought_out = keyed(scene).get(row["id"], 0.0)
    for change in row["changes"]:
        low, high = _reach(scene, row, change)
        if brought_out:
            layer = scene.maps.get(f"{_KEYED}{row['id']}", {}).get(change["channel"], (change["low"], change["high"]))
            low, high = low + brought_out * min(0.0, layer[0]), high + brought_out * max(0.0, layer[1])
        chromophore = _FACTORS.get(change["channel"], change["channel"])
        if chromophore not in bounds:  # oil and height have no axis
            continue
        if change["channel"] in _FACTORS:
            factors = math.exp(low), math.exp(high)
            bounds = scale_bounds(bounds, chromophore, dict.fromkeys(bounds[chromophore], factors))
        elif change["channel"] in _CHANGES:
            bounds = shift_bounds(bounds, chromophore, dict.fromkeys(bounds[chromophore], (low, high)))
    return bounds


def _reach(scene: Scene, row: dict[str, Any], change: dict[str, Any]) -> Interval:
    """What a feature may add to its channel; of a map that is painted, what the sum was found to be, with the first."""
    found = {channel: interval for name in MAPS for channel, interval in scene.maps.get(name, {}).items()}
    strength = scene.strengths.get(row["id"], 0.0)
    if strength == 0.0:
        return 0.0, 0.0
    if change["channel"] not in found:
        return strength * change["low"], strength * change["high"]
    first = next(
        name
        for name, other in ROWS.items()
        if scene.strengths.get(name, 0.0) > 0.0 and change["channel"] in [c["channel"] for c in other["changes"]]
    )
    return found[change["channel"]] if row["id"] == first else (0.0, 0.0)


def _activate(scene: Scene, row: dict[str, Any]) -> Activation:
    own = strength_activation(scene, row["id"])
    if own.active or row["id"] not in keyed(scene):
        return own
    frames = tuple(f.id for f in scene.frames if (row["id"], FEATURE) in frame_changes(f, scene.live))
    return Activation(True, "a state of the body brings it out", frames)


def _effect(row: dict[str, Any]) -> Effect:
    channels = [change["channel"] for change in row["changes"]]
    chromophores = tuple(_FACTORS.get(name, name) for name in channels if name in _FACTORS or name in _CHANGES)
    return Effect(
        id=row["id"],
        label=row["label"],
        help=f"{row['help'].rstrip('.')}. It is painted into a map: after a change, apply the skin again. "
        f"Source: {row['source'].rstrip('.')}.",
        reads=chromophores,
        writes=chromophores,
        activate=lambda scene: _activate(scene, row),
        fragments=lambda scene: _fragments(scene, row),
        bounds=lambda scene, bounds: _bounds(scene, bounds, row),
        maps=lambda scene: _maps(scene, row),
        default_strength=0.0,
    )


EFFECTS: tuple[Effect, ...] = tuple(_effect(row) for row in ROWS.values())
