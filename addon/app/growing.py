"""The `maps` use-case: what is in the skin of a face, place by place, as files that other programs can read."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import sanguine_core

from ..domain.effects import EFFECTS, Frame, Growth, Scene, anatomy, grown
from ..domain.errors import InputError
from ..domain.head import load_presets
from ..domain.parameters import PARAMETERS, Skin, default_skin
from ..domain.people import person
from ..domain.plan import Plan, check_strengths, make_plan
from ..domain.resources import rigs_path
from ..domain.shot import read_shot, scene_of
from ..domain.texel_density import MapSizes
from ..domain.udim import FIRST_TILE, tile_path
from ..domain.uv_checks import uv_warnings
from .faces import example_head, head_surface
from .map_cache import MapCache
from .map_files import MapHeader, write_maps
from .maps import Progress, Surface, bake_maps, hide_seams
from .skin_report import read_skins
from .spectral import write_spectral

SIZES = (16, 8192)

CHROMOPHORES = ("melanin", "hemoglobin", "oxygenation", "oil")
"""Channels that every chromophore map has; those of `_BESIDE` come when something grows there."""

_BESIDE = {"grown_ink": "ink_per_mm", "grown_height": "height_mm"}


@dataclass(frozen=True)
class Request:
    """What `sanguine maps` is asked for beside the face.

    features: strengths that override those of the person. tone: None takes the default skin and no features.
    skin_path: a SKIN.json whose first skin overrides the person's. spectral_nm: wavelengths of a spectral image of the
    reflectance; None for no such image. cache: a folder, "none", or None for the default one.
    """

    features: Mapping[str, float] = field(default_factory=dict)
    tone: str | None = None
    sex: str = "female"
    age_years: float = 30.0
    sun: float = 0.5
    seed: int = 0
    skin_path: str | None = None
    size: int = 2048
    spectral_nm: np.ndarray | None = None
    tx: bool = False
    cache: str | None = None


def feature_list() -> dict[str, Any]:
    """Every feature with what it changes, as JSON."""
    return {"sanguine": sanguine_core.__version__, "features": sanguine_core.features()}


def grow_maps(
    face: str,
    read_mesh: Callable[[str], tuple[Surface, str]],
    out_dir: str | os.PathLike[str],
    request: Request,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Grows the maps of a head of ours, of a mesh file or of the subjects of a shot, and writes them into `out_dir`.

    read_mesh: of a file, the surface and a remark on its regions. Several subjects get a folder each. Returns the
    report; raises InputError, one line that names what is wrong.
    """
    if not SIZES[0] <= request.size <= SIZES[1]:
        raise InputError(f"--size: {request.size} is outside {SIZES[0]} to {SIZES[1]}")
    cache = MapCache() if request.cache is None else MapCache(None if request.cache == "none" else Path(request.cache))
    if face.endswith(".toml"):
        return _grow_shot(face, out_dir, request, cache, progress)
    heads = load_presets(rigs_path("heads.toml"))
    surface, said = (head_surface(example_head(face)), "") if face in heads else read_mesh(face)
    someone = person(request.tone or "intermediate", request.sex, request.age_years, request.seed, request.sun)
    skin, strengths = (someone.skin, someone.strengths) if request.tone else (default_skin(), {})
    if request.skin_path:
        skin = read_skins(request.skin_path)[1][0]
    strengths = check_strengths(_expand(request.features), "--features", strengths)
    plan = maps_plan(skin, strengths, surface, someone.growth)
    report = write_chromophores(
        plan, surface, out_dir, request.size, cache, progress, request.spectral_nm, request.tx
    )
    return report | {"warnings": [said, *report["warnings"]] if said else report["warnings"]}


def _grow_shot(
    path: str, out_dir: str | os.PathLike[str], request: Request, cache: MapCache, progress: Progress | None
) -> dict[str, Any]:
    shot = read_shot(path)
    reports = {}
    for subject in shot.subjects:
        surface = head_surface(example_head(subject.rig.head))
        scene = scene_of(shot, subject, tuple(surface.regions))
        strengths = check_strengths(_expand(request.features), "--features", scene.strengths)
        plan = maps_plan(scene.skin, strengths, surface, scene.growth)
        folder = Path(out_dir) / subject.id if len(shot.subjects) > 1 else out_dir
        reports[subject.id] = write_chromophores(
            plan, surface, folder, request.size, cache, progress, request.spectral_nm, request.tx
        )
    first = next(iter(reports.values()))
    return {**first, "subjects": reports} if len(reports) > 1 else first


def _expand(features: Mapping[str, float]) -> dict[str, float]:
    """`all` stands for every feature; what is named besides keeps its own strength."""
    every = {row["id"]: features["all"] for row in sanguine_core.features()} if "all" in features else {}
    return every | {name: value for name, value in features.items() if name != "all"}


def maps_plan(skin: Skin, strengths: Mapping[str, float], surface: Surface, growth: Growth) -> Plan:
    """The plan of a face at rest."""
    scene = Scene(skin, (Frame("rest"),), strengths, tuple(surface.regions), growth=growth)
    return make_plan(scene)


def chromophore_maps(
    plan: Plan, surface: Surface, size: int, cache: MapCache, progress: Progress | None = None
) -> tuple[tuple[str, ...], dict[int, np.ndarray]]:
    """What is in the skin at each texel: (channel names, UDIM tile -> (size, size, C) float32, row 0 lowest).

    Fractions within the ranges of the schema, `ink_per_mm` and `height_mm` in their units. Where there is no skin, a map
    holds the skin's own values: neutral for every filter.
    """
    names = [grown.height_of(name) or name for name in plan.maps]
    maps = bake_maps(plan, surface, MapSizes(size, size), cache, progress, names)
    beside = [name for name in _BESIDE if name in maps]
    channels = CHROMOPHORES + tuple(_BESIDE[name] for name in beside)
    tiles = {}
    for tile in surface.tiles:
        held = {name: images[tile] for name, images in maps.items()}
        image = np.stack([np.broadcast_to(column, (size, size)) for column in _columns(plan, held)], axis=2)
        tiles[tile] = np.concatenate([image, *(held[name] for name in beside)], axis=2).astype(np.float32)
    # The logarithms are alike there; what is between two texels of their exponentials need not be.
    hide_seams(surface, tiles, cache)
    return channels, tiles


def _columns(plan: Plan, maps: Mapping[str, np.ndarray]) -> list[np.ndarray]:
    """The chromophores, each a number or (H, W): the skin's own, by anatomy, by what has grown, as the shader does it."""
    value: dict[str, Any] = {name: plan.scene.skin[name] for name in CHROMOPHORES}
    if anatomy.MAP in maps:
        strength, factors = plan.scene.strengths["anatomy"], maps[anatomy.MAP]
        for i, name in enumerate(("hemoglobin", "melanin", "oil")):
            value[name] = value[name] * (1.0 + strength * (factors[..., i] - 1.0))
        value["oxygenation"] = value["oxygenation"] + strength * factors[..., 3]
    if "grown" in maps:
        for channel, change in zip(grown.MAPS["grown"], np.moveaxis(maps["grown"], 2, 0), strict=True):
            name = channel.removeprefix("log_")
            value[name] = value[name] * np.exp(change) if name != channel else value[name] + change
    return [np.clip(value[n], PARAMETERS[n].hard_min, PARAMETERS[n].hard_max) for n in CHROMOPHORES]


def write_chromophores(
    plan: Plan,
    surface: Surface,
    out_dir: str | os.PathLike[str],
    size: int,
    cache: MapCache,
    progress: Progress | None = None,
    spectral_nm: np.ndarray | None = None,
    tx: bool = False,
) -> dict[str, Any]:
    """Writes `chromophores.exr` (with `.<UDIM>` before the suffix if the layout has several tiles) into `out_dir`.

    spectral_nm: wavelengths of a spectral image of the reflectance to be written beside it. tx: a tiled, mip-mapped copy.
    Returns the report of `sanguine maps`. Raises InputError when there is nothing to map.
    """
    start = time.perf_counter()
    if not plan.maps:
        raise InputError("maps: no effect is on that makes a map: switch a feature on (--features), or give the face regions")
    painted = sanguine_core.counters()["texels_painted"]
    channels, tiles = chromophore_maps(plan, surface, size, cache, progress)
    several = list(tiles) != [FIRST_TILE]
    path = Path(out_dir) / ("chromophores.<UDIM>.exr" if several else "chromophores.exr")
    strengths = {e.id: plan.scene.strengths[e.id] for e in plan.active if e.id in plan.scene.strengths}
    header = MapHeader(mesh=surface.digest, seed=plan.scene.growth.seed, features=strengths)
    files = write_maps(path, tiles, channels, header)
    if spectral_nm is not None:
        files += write_spectral_set(path, tiles, channels, plan.scene.skin, spectral_nm)
    if tx:
        for exr in list(files):
            files.append(exr.with_suffix(".tx"))
            sanguine_core.make_tx(exr, files[-1])
    return {
        "sanguine": sanguine_core.__version__,
        "files": [str(file) for file in files],
        "channels": list(channels),
        "size": size,
        "tiles": list(tiles),
        "seed": plan.scene.growth.seed,
        "effects": [
            {"id": effect.id, "active": decision.active, "because": decision.because}
            for effect in EFFECTS
            if (decision := plan.decisions[effect.id]) and (decision.active or effect.default_strength is not None)
        ],
        "computed": {
            "texels_painted": sanguine_core.counters()["texels_painted"] - painted,
            "arrays_made": cache.made,
            "arrays_from_cache": cache.hits,
        },
        "warnings": uv_warnings(surface.uv, surface.triangles),
        "seconds": round(time.perf_counter() - start, 3),
    }


def write_spectral_set(
    path: Path, tiles: Mapping[int, np.ndarray], channels: tuple[str, ...], skin: Skin, wavelengths_nm: np.ndarray
) -> list[Path]:
    """Reflectance of every tile as spectral images beside `path`."""
    written = []
    for tile, image in tiles.items():
        maps = {name: image[..., i] for i, name in enumerate(channels) if name in PARAMETERS}
        file = tile_path(path.with_name(path.name.replace("chromophores", "reflectance")), tile)
        write_spectral(file, maps, skin, wavelengths_nm)
        written.append(file)
    return written
