"""UDIM tiles: one picture per unit square of the UV plane, numbered 1001 + u + 10 v.

A set of files is named by a pattern with `<UDIM>` in the place of the number (`face.<UDIM>.exr`); the name of one of
its files (`face.1001.exr`) means the whole set.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from .errors import InputError

FIRST_TILE = 1001
LAST_TILE = 1999
"""Of the numbers that programs agree on: ten columns, a hundred rows (but for 2000, which some refuse)."""

TOKEN = "<UDIM>"

_COLUMNS = 10
# A vertex on the border of a tile belongs to the triangle's own side of it; UVs are rounded to about this.
_BORDER = 1e-5
# The number stands between a dot or an underscore and the extension: name.1001.exr, name_1001.exr. Those above 1999 are
# more often a year or a frame.
_NUMBER = re.compile(r"(?<=[._])(1\d{3})(?=\.[^.]+$)", re.ASCII)


def tile_offset(tile: int) -> tuple[int, int]:
    """Column and row of a tile: its lower left corner in the UV plane."""
    row, column = divmod(tile - FIRST_TILE, _COLUMNS)
    return column, row


def tiles_of(triangle_uv: np.ndarray) -> tuple[int, ...]:
    """Numbers of the tiles that triangles (T, 3, 2) touch, ascending; parts outside of all tiles do not count.

    Raises InputError when nothing is left.
    """
    finite = np.isfinite(triangle_uv).all(axis=(1, 2))
    low = np.floor(triangle_uv[finite].min(axis=1, initial=np.inf) + _BORDER)
    high = np.floor(triangle_uv[finite].max(axis=1, initial=-np.inf) - _BORDER)
    found: set[int] = set()
    for (u0, v0), (u1, v1) in np.unique(np.stack([low, np.maximum(low, high)], axis=1), axis=0):
        columns = range(int(max(u0, 0)), int(min(u1, _COLUMNS - 1)) + 1)
        rows = range(int(max(v0, 0)), int(min(v1, (LAST_TILE - FIRST_TILE) // _COLUMNS)) + 1)
        found |= {FIRST_TILE + _COLUMNS * row + column for row in rows for column in columns}
    found = {tile for tile in found if tile <= LAST_TILE}
    if not found:
        raise InputError(f"UV map: no triangle lies in a tile from {FIRST_TILE} to {LAST_TILE}: move the layout into one")
    return tuple(sorted(found))


def tile_at(u: float, v: float) -> int:
    """Number of the tile that holds (u, v). Raises InputError outside of all tiles."""
    column, row = np.floor(u), np.floor(v)
    tile = FIRST_TILE + column + _COLUMNS * row
    if not (0 <= column < _COLUMNS and row >= 0 and tile <= LAST_TILE):
        raise InputError(
            f"UV ({u:g}, {v:g}) lies outside of the UDIM tiles {FIRST_TILE} to {LAST_TILE}: u from 0 to {_COLUMNS}, v from 0"
        )
    return int(tile)


def pattern_of(path: str | Path) -> str | None:
    """The pattern with `<UDIM>` that a name stands for, or None for an ordinary single file."""
    text = str(path)
    name = Path(text).name
    if TOKEN in name:
        if name.count(TOKEN) > 1 or TOKEN in str(Path(text).parent):
            raise InputError(f"{path}: {TOKEN} is allowed once, in the file's name")
        return text
    if TOKEN in text:
        raise InputError(f"{path}: {TOKEN} is allowed once, in the file's name")
    found = _NUMBER.search(name)
    if not found or not FIRST_TILE <= int(found[1]) <= LAST_TILE:
        return None
    return str(Path(text).with_name(name[: found.start()] + TOKEN + name[found.end() :]))


def tile_path(pattern: str | Path, tile: int) -> Path:
    """The file of one tile. A pattern without `<UDIM>` is a single file, tile 1001."""
    _check(tile, str(pattern))
    if TOKEN in str(pattern):
        return Path(str(pattern).replace(TOKEN, str(tile)))
    if tile != FIRST_TILE:
        raise InputError(f"{pattern}: {TOKEN} is missing from the name, tile {tile} needs it (as in name.{TOKEN}.exr)")
    return Path(pattern)


def find_tiles(path: str | Path) -> dict[int, Path]:
    """The files of a set, by tile: of a pattern, of the name of one of its files, or a single file as {1001: path}.

    Raises InputError when there is none.
    """
    pattern = pattern_of(path)
    if pattern is None:
        if not Path(path).is_file():
            raise InputError(f"{path}: no such file")
        return {FIRST_TILE: Path(path)}
    # The name as one of a set, unless it stands alone: face.1001.exr without siblings is a set of one.
    head, tail = Path(pattern).name.split(TOKEN)
    folder = Path(pattern).parent
    found: dict[int, Path] = {}
    try:
        entries = sorted(folder.iterdir())
    except OSError as error:
        raise InputError(f"{path}: {folder} cannot be read: {error.strerror}") from None
    for entry in entries:
        name = entry.name
        number = name[len(head) : len(name) - len(tail)]
        if (
            name.startswith(head) and name.endswith(tail) and re.fullmatch(r"1\d{3}", number, re.ASCII)
            and FIRST_TILE <= int(number) <= LAST_TILE and entry.is_file()
        ):
            found[int(number)] = entry
    if not found:
        raise InputError(f"{path}: no such file (tiles are {FIRST_TILE} to {LAST_TILE} in the place of {TOKEN})")
    return found


def check_tiles(have: Iterable[int], need: Iterable[int], where: str | Path) -> None:
    """Raises InputError naming the tiles that are needed and absent."""
    missing = sorted(set(need) - set(have))
    if missing:
        shown = ", ".join(map(str, missing[:8])) + (f" and {len(missing) - 8} more" if len(missing) > 8 else "")
        raise InputError(f"{where}: tile {shown} missing, the UVs use {'it' if len(missing) == 1 else 'them'}")


def _check(tile: int, where: str) -> None:
    if isinstance(tile, bool) or not isinstance(tile, (int, np.integer)) or not FIRST_TILE <= tile <= LAST_TILE:
        raise InputError(f"{where}: {tile!r} is no UDIM tile, {FIRST_TILE} to {LAST_TILE} are allowed")
