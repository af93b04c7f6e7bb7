"""Chromophore maps as files: EXR with named channels, units and what made them in the header, one file per UDIM tile.

The one place that writes these headers and checks them; docs/map_files.md is the layout.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pydantic
import sanguine_core

from ..domain import udim
from ..domain.errors import InputError, nearest
from ..domain.files import check_folder, validate
from ..domain.parameters import PARAMETERS

SCHEMA_VERSION = 1
"""Of the layout: it grows when a reader of the old one would misread the new."""

# Absolute amounts are the parameters' own channels; the others are what features add and what a picture leaves over.
CHANNELS: dict[str, str] = {p.channel: p.unit for p in PARAMETERS.values() if p.channel} | {
    "log_hemoglobin": "1",  # natural logarithm of a factor
    "log_melanin": "1",
    "log_oil": "1",
    "oxygenation_change": "1",
    "height_mm": "mm",
    "R": "1",  # of the residual: a factor on the light that left the skin
    "G": "1",
    "B": "1",
    "shading": "1",  # of the light in a picture: a factor
    "mask": "1",
    "error": "Delta E 2000",
}
"""Every channel that a map may have, with its unit ("1": a fraction or a factor)."""

_BY_CHANNEL = {p.channel: p for p in PARAMETERS.values() if p.channel}
_PREFIX = "sanguine:"
# A list of features is a few kilobytes; more is no header of ours.
_MAX_TEXT = 64 * 1024


class MapHeader(pydantic.BaseModel):
    """What a map was made of. mesh: digest of the face's geometry, "" for a map that belongs to no mesh."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    mesh: Annotated[str, pydantic.Field(pattern=r"^[0-9a-zA-Z:_-]{0,200}$")] = ""
    seed: Annotated[int, pydantic.Field(ge=0, le=2**64 - 1)] = 0
    features: dict[str, float] = {}
    """Feature id -> strength."""
    version: str = sanguine_core.__version__
    """Of the Sanguine that wrote it."""


@dataclass(frozen=True)
class Maps:
    """tiles: UDIM tile -> (H, W, C) float32, row 0 at the bottom; 1001 for an ordinary map. channels: C names."""

    tiles: dict[int, np.ndarray]
    channels: tuple[str, ...]
    header: MapHeader


def header_attributes(channels: Sequence[str], header: MapHeader) -> dict[str, str]:
    """The header as EXR string attributes. Raises InputError for an unknown channel."""
    return {
        _PREFIX + "schema": str(SCHEMA_VERSION),
        _PREFIX + "units": json.dumps({name: _unit(name, "channels") for name in channels}, sort_keys=True),
        _PREFIX + "mesh": header.mesh,
        _PREFIX + "seed": str(header.seed),
        _PREFIX + "features": json.dumps(header.features, sort_keys=True),
        _PREFIX + "version": header.version,
    }


def write_maps(
    path: str | os.PathLike[str],
    tiles: Mapping[int, np.ndarray],
    channels: Sequence[str],
    header: MapHeader,
    half: bool = True,
) -> list[Path]:
    """Writes one EXR per tile. Each appears whole or not at all, and none before all of them could be written.

    path: a file, or a pattern with `<UDIM>`. tiles: UDIM tile -> (H, W, C) float32, row 0 at the bottom; an ordinary
    map is {1001: pixels}. Texels beyond the mesh are the caller's: a neutral value and the repeated edge, which
    `rasterize_uv` makes. Returns the paths. Raises InputError.
    """
    if not tiles:
        raise InputError(f"{path}: no tile to write")
    if Path(path).suffix.lower() != ".exr":
        raise InputError(f"{path}: cannot be written: the extension .exr is allowed")
    attributes = header_attributes(channels, header)
    paths = {tile: udim.tile_path(path, tile) for tile in sorted(tiles)}
    check_folder(Path(path).absolute().parent)
    Path(path).absolute().parent.mkdir(parents=True, exist_ok=True)
    try:
        with contextlib.ExitStack() as stack:
            for tile, file in paths.items():
                pixels = np.ascontiguousarray(tiles[tile], dtype=np.float32)
                if pixels.ndim != 3 or pixels.shape[2] != len(channels) or 0 in pixels.shape:
                    raise InputError(f"{file}: pixels of shape {pixels.shape} are no (H, W, {len(channels)})")
                height, width, _ = pixels.shape
                writer = sanguine_core.MapWriter(file, width, height, list(channels), attributes, half)
                stack.enter_context(writer).write_rows(pixels)
    except OSError as error:
        raise InputError(str(error)) from None
    except InputError:
        raise
    except ValueError as error:  # a value that half cannot hold, a size
        raise InputError(f"{file}: {error}") from None
    return list(paths.values())


def read_maps(
    path: str | os.PathLike[str],
    channels: Sequence[str] | None = None,
    tiles: Sequence[int] | None = None,
    mesh: str = "",
) -> Maps:
    """Reads what `write_maps` wrote, one tile or a set.

    path: a file, a pattern with `<UDIM>`, or the name of one tile of a set. channels: those wanted, in this order (None:
    all, as the files have them). tiles: those that have to be there (None: whichever are). mesh: digest that the map has
    to be made for, if it is made for any. Raises InputError, one line: the file and what is wrong with it.
    """
    for name in channels or ():
        _unit(name, str(path))
    found = udim.find_tiles(path)
    if tiles is not None:
        udim.check_tiles(found, tiles, path)
        found = {tile: found[tile] for tile in sorted(set(tiles))}
    read: dict[int, np.ndarray] = {}
    header = None
    names: tuple[str, ...] = ()
    for tile, file in found.items():
        here, in_file = read_header(file)
        wanted = tuple(channels) if channels is not None else in_file
        if header is None:
            header, names, first = here, wanted, file
        elif (differs := _difference(here, header)) is not None:
            raise InputError(f"{file}: {differs} differs from that of {first.name}: the tiles are of different maps")
        elif wanted != names:
            raise InputError(f"{file}: channels {', '.join(wanted)} differ from those of {first.name}: {', '.join(names)}")
        if mesh and here.mesh and here.mesh != mesh:
            raise InputError(f"{file}: was made for another mesh than this one")
        read[tile] = _read_channels(file, wanted, in_file)
    assert header is not None  # find_tiles finds at least one
    return Maps(read, names, header)


def read_header(path: str | os.PathLike[str]) -> tuple[MapHeader, tuple[str, ...]]:
    """The header and the channel names of one file, without its pixels. Raises InputError."""
    try:
        _, _, names, attributes = sanguine_core.read_exr_map_info(path)
    except OSError as error:
        raise InputError(str(error)) from None
    schema = attributes.get(_PREFIX + "schema")
    if schema is None:
        raise InputError(f"{path}: is no map of Sanguine: the header has no {_PREFIX}schema")
    number = int(schema) if schema.isascii() and schema.isdigit() and len(schema) < 10 else 0
    if number < 1:
        raise InputError(f"{path}: {_PREFIX}schema: {schema[:40]!r} is no version number")
    if number > SCHEMA_VERSION:
        raise InputError(
            f"{path}: {_PREFIX}schema: version {number} is newer than {SCHEMA_VERSION}, which Sanguine"
            f" {sanguine_core.__version__} reads: update Sanguine"
        )
    units = _json(attributes, "units", path)
    for name in names:
        unit = units.get(name) if isinstance(units, dict) else None
        if name in CHANNELS and unit != CHANNELS[name]:
            raise InputError(f"{path}: {_PREFIX}units: channel '{name}' is in {unit!r}, {CHANNELS[name]!r} is needed")
    seed = attributes.get(_PREFIX + "seed", "0")
    fields = {
        "mesh": attributes.get(_PREFIX + "mesh", ""),
        "seed": int(seed) if seed.isascii() and seed.isdigit() and len(seed) <= 20 else seed[:40],
        "features": _json(attributes, "features", path) if _PREFIX + "features" in attributes else {},
        "version": attributes.get(_PREFIX + "version", "")[:40],
    }
    return validate(MapHeader, fields, path), tuple(names)


@dataclass(frozen=True)
class Band:
    """rows: (N, W, C) float32 with its halo; rows[below : below + count] are the picture's rows first to first + count."""

    first: int
    count: int
    below: int
    rows: np.ndarray

    @property
    def core(self) -> np.ndarray:
        return self.rows[self.below : self.below + self.count]


def bands(reader: sanguine_core.RowReader, rows: int, halo: int = 0) -> Iterator[Band]:
    """A picture in bands of `rows` rows, from the top down (files are cheapest to read so; a MapWriter with from_top
    takes them in this order). Each comes with `halo` rows below and above, fewer at the picture's edges.
    """
    end = reader.height
    while end > 0:
        first = max(end - rows, 0)
        low, high = max(first - halo, 0), min(end + halo, reader.height)
        yield Band(first, end - first, first - low, reader.read_rows(low, high - low))
        end = first


def _read_channels(path: Path, wanted: tuple[str, ...], in_file: tuple[str, ...]) -> np.ndarray:
    for name in wanted:
        if name not in in_file:
            raise InputError(f"{path}: channel '{name}' is missing, the file has {', '.join(in_file)[:200]}")
        _unit(name, str(path))
    try:
        pixels, names, _ = sanguine_core.read_exr_map(path)
    except OSError as error:
        raise InputError(str(error)) from None
    if tuple(names) != in_file:
        raise InputError(f"{path}: has changed while it was read")
    if wanted != in_file:
        pixels = np.ascontiguousarray(pixels[..., [in_file.index(name) for name in wanted]])
    for i, name in enumerate(wanted):
        check_channel(pixels[..., i], name, str(path))
    return pixels


def check_channel(values: np.ndarray, channel: str, where: str) -> None:
    """Raises InputError for values that are not finite or outside of the parameter's hard range, if it is a parameter's.

    The rounding of half at the bound of a range is let through.
    """
    low, high = float(values.min()), float(values.max())
    if not np.isfinite(low) or not np.isfinite(high):
        raise InputError(f"{where}: channel '{channel}' holds values that are not finite")
    parameter = _BY_CHANNEL.get(channel)
    if parameter is None:
        return
    rounding = 2.0**-11 * parameter.hard_max
    if low < parameter.hard_min - rounding or high > parameter.hard_max + rounding:
        raise InputError(
            f"{where}: channel '{channel}' holds {low:g} to {high:g}, {parameter.hard_min:g} to {parameter.hard_max:g} are allowed"
        )


def _unit(channel: str, where: str) -> str:
    if channel not in CHANNELS:
        raise InputError(f"{where}: channel {channel[:80]!r} is none of Sanguine's, {nearest(channel[:80], CHANNELS)}")
    return CHANNELS[channel]


def _json(attributes: Mapping[str, str], key: str, path: str | os.PathLike[str]) -> Any:
    text = attributes.get(_PREFIX + key)
    if text is None:
        raise InputError(f"{path}: {_PREFIX}{key}: missing in the header")
    try:
        if len(text) > _MAX_TEXT:
            raise ValueError(f"{len(text)} bytes are too many")
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: {_PREFIX}{key}: not valid JSON: {error}") from None


def _difference(one: MapHeader, other: MapHeader) -> str | None:
    """The first field in which two tiles of one map must not differ, but do."""
    return next((key for key in ("mesh", "seed", "features") if getattr(one, key) != getattr(other, key)), None)
