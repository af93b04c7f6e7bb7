"""Features that grow on the skin, freckles, moles, vessels and the like: one effect per row of the native core.

All of them share three maps of sums over their layers, each made only when an active feature writes to it.
"""

from __future__ import annotations

import math
from typing import Any

import sanguine_core

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

MAPS = {
    "grown": ("log_hemoglobin", "log_melanin", "log_oil", "oxygenation"),
    "grown_ink": ("ink_per_mm",),
    "grown_height": ("height_mm",),
}
"""Map id -> what its channels hold: natural logarithms of factors, or changes that are added."""

_FACTORS = {"log_hemoglobin": "hemoglobin", "log_melanin": "melanin", "log_oil": "oil"}
_CHANGES = ("oxygenation", "ink_per_mm")

ROWS: dict[str, dict[str, Any]] = {row["id"]: row for row in sanguine_core.features()}


def written(scene: Scene) -> frozenset[str]:
    """Channels that the scene's active features write."""
    active = (row for name, row in ROWS.items() if scene.strengths.get(name, 0.0) > 0.0)
    return frozenset(change["channel"] for row in active for change in row["changes"])


def _maps(scene: Scene, row: dict[str, Any]) -> tuple[str, ...]:
    mine = {change["channel"] for change in row["changes"]}
    return tuple(name for name, channels in MAPS.items() if mine & set(channels))


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
        "grown_height": Fragment(
            stage="relief",
            file="grown_height.osl",
            inputs=(ShaderInput("grown_height", "color", "map", "grown_height"),),
        ),
    }
    return tuple(made[name] for name in _maps(scene, row))


def _bounds(scene: Scene, bounds: Bounds, row: dict[str, Any]) -> Bounds:
    for change in row["changes"]:
        low, high = _reach(scene, row, change)
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
    if change["channel"] not in found:
        strength = scene.strengths[row["id"]]
        return strength * change["low"], strength * change["high"]
    first = next(
        name
        for name, other in ROWS.items()
        if scene.strengths.get(name, 0.0) > 0.0 and change["channel"] in [c["channel"] for c in other["changes"]]
    )
    return found[change["channel"]] if row["id"] == first else (0.0, 0.0)


def _activate(scene: Scene, row: dict[str, Any]) -> Activation:
    return strength_activation(scene, row["id"])


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
