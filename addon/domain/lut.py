"""The table of scattering: Burley lobes over the chromophores that vary, as one image.

Layout, from the first row up: for each quantity (weight of each lobe, then d_mm of each) one block; a block holds one tile
per entry of axis 2, one above the other; a tile has one row per entry of axis 1 and one column per entry of axis 0. Of
axis 3, every entry has all of that for itself, side by side.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import sanguine_core

from .parameters import PARAMETERS, Skin, skin_rows
from .plan import Axis

LOBES = 4
"""The most that a profile is fitted with; `quality.Settings.lobes` may ask for fewer."""
QUANTITIES = 2 * LOBES


@dataclass(frozen=True)
class Table:
    """Lobes of every entry.

    image: (height, columns, 3) float32, row 0 lowest (as Blender stores images). weights are fractions of the
    incident light, d in mm. clamped, fit_error: the worst entry's share per channel.
    """

    axes: tuple[Axis, ...]
    lobes: int
    image: np.ndarray
    clamped: np.ndarray
    fit_error: np.ndarray

    def quantity_offset(self, quantity: int) -> float:
        """How far up the image (0-1) the block of `quantity` begins."""
        return quantity / (2 * self.lobes)


def table_height(axes: tuple[Axis, ...], lobes: int = LOBES) -> int:
    return 2 * lobes * math.prod(axis.count for axis in axes[1:3])


def table_width(axes: tuple[Axis, ...]) -> int:
    return math.prod(axis.count for axis in (*axes[:1], *axes[3:]))


def table_image(quantities: np.ndarray, axes: tuple[Axis, ...]) -> np.ndarray:
    """(N, 2 * lobes, 3) of every entry, axis 0 fastest, laid out as (height, width, 3)."""
    stacks = math.prod(axis.count for axis in axes[3:])
    columns = axes[0].count if axes else 1
    tiles = quantities.reshape(stacks, -1, columns, *quantities.shape[1:])  # (axis 3, axes 2 and 1, axis 0, quantity, 3)
    return tiles.transpose(3, 1, 0, 2, 4).reshape(-1, stacks * columns, 3)


def entry_skins(axes: tuple[Axis, ...], skin: Skin) -> np.ndarray:
    """(N, P) parameters of every entry, axis 0 fastest."""
    rows = np.repeat(skin_rows([skin]), math.prod(axis.count for axis in axes), axis=0)
    grids = np.meshgrid(*(axis.values() for axis in reversed(axes)), indexing="ij")
    columns = list(PARAMETERS)
    for axis, grid in zip(reversed(axes), grids, strict=True):
        rows[:, columns.index(axis.id)] = grid.ravel()
    return rows


def bake(
    axes: tuple[Axis, ...],
    skin: Skin,
    working_space: str | np.ndarray,
    progress: Callable[[int, int], bool] | None = None,
    lobes: int = LOBES,
) -> Table:
    """Solves every entry. `working_space`: a name that `sanguine_core` knows or a 3x3 XYZ (D65) to RGB matrix."""
    fit = sanguine_core.burley_lobes(
        entry_skins(axes, skin), working_space, lobe_count=lobes, threads=0, progress=progress
    )
    quantities = np.concatenate([fit["weights"], fit["d_mm"]], axis=1)  # (N, 2 * lobes, 3)
    image = np.ascontiguousarray(table_image(quantities, axes), dtype=np.float32)
    return Table(axes, lobes, image, fit["clamped"].max(0), fit["fit_error"].max(0))
