"""Maps that come with a face, from EXR files: what is in its skin at each place, and what a picture has over it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import sanguine_core

from ..domain.effects import residual, skin_map
from ..domain.effects.effect import Interval, inside
from ..domain.errors import InputError, nearest
from ..domain.shot import Maps
from ..domain.udim import find_tiles
from .map_files import CHANNELS, check_channel, read_header

Tiles = dict[int, np.ndarray]
"""UDIM tile -> (H, W, 3 or 4) float32, row 0 lowest; {1001: …} for an ordinary picture."""

_RGB = ("R", "G", "B")
# Of the light that left the skin; beyond it a factor is an error of units, not make-up.
_LARGEST_FACTOR = 100.0


@dataclass(frozen=True)
class FaceMaps:
    """images: map id -> tiles. ranges: what `Scene.maps` wants to know of them. digest: of the files, "" without any."""

    images: Mapping[str, Tiles] = field(default_factory=dict)
    ranges: Mapping[str, Mapping[str, Interval]] = field(default_factory=dict)
    digest: str = ""


def read_face_maps(maps: Maps) -> FaceMaps:
    """The maps of a subject of `read_shot`. Raises InputError, one line: file, channel, what is allowed."""
    images: dict[str, Tiles] = {}
    ranges: dict[str, Mapping[str, Interval]] = {}
    digest = hashlib.sha256()
    if maps.skin is not None:
        read = {tile: _skin_tile(path, digest) for tile, path in find_tiles(maps.skin).items()}
        held = [set(found) for _, found in read.values()]
        if any(names != held[0] for names in held):
            raise InputError(f"{maps.skin}: channels: the tiles hold different ones")
        images[skin_map.MAP] = {tile: image for tile, (image, _) in read.items()}
        ranges[skin_map.MAP] = {
            name: (min(found[name][0] for _, found in read.values()), max(found[name][1] for _, found in read.values()))
            for name in skin_map.CHANNELS
            if name in held[0]
        }
    if maps.residual is not None:
        images[residual.MAP] = {tile: _residual_tile(path, digest) for tile, path in find_tiles(maps.residual).items()}
        ranges[residual.MAP] = {}
    return FaceMaps(images, ranges, digest.hexdigest() if images else "")


def _skin_tile(path: Path, digest: Any) -> tuple[np.ndarray, dict[str, Interval]]:
    """One tile in the order of the map's channels, 0 where the file has none, and the range of those that it has."""
    pixels, names = _read(path, digest)
    for name in names:
        if name not in CHANNELS:
            raise InputError(f"{path}: channel {name}: {nearest(name, skin_map.CHANNELS)}")
    held = [name for name in skin_map.CHANNELS if name in names]
    if not held:
        raise InputError(f"{path}: channels: {', '.join(names)[:200]}: none of {', '.join(skin_map.CHANNELS)}")
    image = np.zeros((*pixels.shape[:2], len(skin_map.CHANNELS)), dtype=np.float32)
    ranges = {}
    for name in held:
        values = pixels[..., names.index(name)]
        check_channel(values, name, str(path))
        ranges[name] = inside(name, (float(values.min()), float(values.max())))
        image[..., skin_map.CHANNELS.index(name)] = values
    return image, ranges


def _residual_tile(path: Path, digest: Any) -> np.ndarray:
    pixels, names = _read(path, digest)
    missing = [name for name in _RGB if name not in names]
    if missing:
        raise InputError(f"{path}: channel {missing[0]}: missing, a residual has {', '.join(_RGB)}")
    image = np.ascontiguousarray(pixels[..., [names.index(name) for name in _RGB]])
    for i, name in enumerate(_RGB):
        check_channel(image[..., i], name, str(path))
        for value in (float(image[..., i].min()), float(image[..., i].max())):
            if not 0.0 <= value <= _LARGEST_FACTOR:
                raise InputError(f"{path}: channel {name}: {value:g} is outside 0 to {_LARGEST_FACTOR:g}")
    return image


def _read(path: Path, digest: Any) -> tuple[np.ndarray, list[str]]:
    """Pixels and channels of anybody's EXR; one whose header says that it is Sanguine's has to be what it says."""
    try:
        pixels, names, attributes = sanguine_core.read_exr_map(str(path))
        with path.open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    except OSError as error:
        text = str(error)
        raise InputError(text if str(path) in text else f"{path}: {text}") from None
    if "sanguine:schema" in attributes:
        read_header(path)
    return pixels, names
