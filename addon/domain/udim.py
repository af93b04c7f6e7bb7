"""UDIM tiles: one picture per unit square of the UV plane, numbered 1001 + u + 10 v."""

from __future__ import annotations

import numpy as np

from .errors import InputError

FIRST_TILE = 1001
LAST_TILE = 1999
"""Of the numbers that programs agree on: ten columns, a hundred rows (but for 2000, which some refuse)."""

_COLUMNS = 10
# A vertex on the border of a tile belongs to the triangle's own side of it; UVs are rounded to about this.
_BORDER = 1e-5


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
