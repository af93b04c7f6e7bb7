"""What the effects of a plan cost: time of solving the table, memory of the maps. For `sanguine plan` and the panel."""

from __future__ import annotations

import functools
import time
from collections.abc import Mapping
from dataclasses import dataclass

import sanguine_core

from ..domain.effects import grown, wrinkles
from ..domain.lut import entry_skins
from ..domain.parameters import default_skin
from ..domain.plan import Plan
from ..domain.texel_density import MapSizes
from ..domain.walk import match_walk, slab_rgb, solved_slabs
from .maps import LARGEST_WRINKLES

_TIMED_ENTRIES = 4
# Of several runs the quickest: what else the machine does only ever adds.
_RUNS = 3

_BYTES_PER_TEXEL = 16  # four floats, as Blender holds them


@dataclass(frozen=True)
class MapCost:
    """A map that is painted: texels along a side of each tile; whether the camera decides on them alone."""

    size: int
    detail: bool
    megabytes: float


@dataclass(frozen=True)
class EffectCost:
    """What an active effect adds to the preparation: entries of the table that would not be there without it (of thin
    parts, what matching the walk takes), at what solving them takes on one core; the memory of its maps, of which `shared` serve another active effect too."""

    milliseconds: float
    megabytes: float
    shared: tuple[str, ...] = ()


@functools.cache
def entry_ms(lobes: int) -> float:
    """What one entry of a table takes on this machine, on one core, measured once."""
    skins = entry_skins((), default_skin()).repeat(_TIMED_ENTRIES, axis=0)
    times = []
    for _ in range(_RUNS):
        start = time.perf_counter()
        sanguine_core.burley_lobes(skins, "rec709", lobe_count=lobes, threads=1)
        times.append(time.perf_counter() - start)
    return min(times) * 1000.0 / _TIMED_ENTRIES


@functools.cache
def _walk_ms() -> tuple[float, float]:
    """What a slab of skin takes to solve, and an entry of the table to match with a walk, on this machine and one core."""
    skins = entry_skins((), default_skin())
    back = sanguine_core.burley_lobes(skins, "rec709", lobe_count=1)["weights"].sum(1)
    match_walk(back, slab_rgb(skins, "rec709"))  # the walk's own table is made once
    slabs, matches, many = [], [], 256
    for _ in range(_RUNS):
        start = time.perf_counter()
        through = slab_rgb(skins, "rec709")
        slabs.append(time.perf_counter() - start)
        start = time.perf_counter()
        match_walk(back.repeat(many, axis=0), through.repeat(many, axis=0))
        matches.append(time.perf_counter() - start)
    return min(slabs) * 1000.0 / solved_slabs(set()), min(matches) * 1000.0 / many


def walk_ms(plan: Plan) -> float:
    """What the walk adds to the table of a plan that has one."""
    slab, match = _walk_ms()
    return solved_slabs({axis.id for axis in plan.axes}) * slab + plan.entries * match


def map_costs(plan: Plan, sizes: MapSizes, tiles: int) -> dict[str, MapCost]:
    """Map id -> its cost, of those that the face itself gives. tiles: how many UDIM tiles the face has."""
    costs = {}
    for name in [name for name in plan.maps if name not in plan.scene.maps]:
        detail = grown.channels_of(name) is not None or name in wrinkles.IMAGES
        size = sizes.detail if detail else sizes.smooth
        if name in wrinkles.IMAGES:
            size = min(size, LARGEST_WRINKLES)
        costs[name] = MapCost(size, detail, tiles * size * size * _BYTES_PER_TEXEL / 1e6)
    return costs


def effect_costs(plan: Plan, megabytes: Mapping[str, float]) -> dict[str, EffectCost]:
    """Of every active effect. megabytes: of each map of the plan; one that is not there counts as 0."""
    used = {effect.id: set(effect.maps(plan.scene)) for effect in plan.active}
    costs = {}
    for name, maps in used.items():
        others = set().union(*(other for key, other in used.items() if key != name))
        without = plan.without(name)
        walk = walk_ms(plan) if plan.walk and not without.walk else 0.0
        costs[name] = EffectCost(
            (plan.entries - without.entries) * entry_ms(plan.settings.lobes) + walk,
            sum(megabytes.get(key, 0.0) for key in maps),
            tuple(sorted(maps & others)),
        )
    return costs
