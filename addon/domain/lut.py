"""The table of scattering: Burley lobes over the chromophores that vary, and where asked for a walk, as one image.

A tile has one column per entry of the first axis and one row per entry of the second: an image's own linear filter does
these two. Oxygenation, as the third, stands in levels one above the other, so close that the nearest one is read. Ink,
whose steps are long, stands side by side, and two of its entries are mixed. All of that is one block; there is one for
each quantity (weight of each lobe, then d_mm of each, then colour and radius in mm of the walk), side by side.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import sanguine_core

from .parameters import PARAMETERS, Skin, skin_rows
from .plan import Axis
from .walk import walk_of

LOBES = 4
"""The most that a profile is fitted with; `quality.Settings.lobes` may ask for fewer."""
QUANTITIES = 2 * LOBES
WALK_QUANTITIES = ("walk_color", "walk_radius_mm")

LEVEL_STEP = 0.01
"""Distance of the levels of oxygenation at most: half of it is Delta E 0.13 in the bloodiest skin, 0.03 in most."""


@dataclass(frozen=True)
class Table:
    """Lobes of every entry, and if `walk` the medium of `walk.py`.

    image: (height, columns, 3) float32, row 0 lowest (as Blender stores images). weights are fractions of the
    incident light, d in mm. clamped, fit_error: the worst entry's share per channel.
    """

    axes: tuple[Axis, ...]
    lobes: int
    image: np.ndarray
    clamped: np.ndarray
    fit_error: np.ndarray
    walk: bool = False

    def quantity_offset(self, quantity: int) -> float:
        """How far to the right (0-1) the block of `quantity` begins."""
        return quantity / quantity_count(self.lobes, self.walk)


@dataclass(frozen=True)
class Layout:
    """How the axes of a table stand in its image. columns, rows: of a tile; levels: how many tiles stand one above the
    other; stacks: how many side by side in a block. level, mixed: the axis that is read so. quantities: blocks."""

    columns: int
    rows: int
    level: Axis | None
    mixed: Axis | None
    quantities: int

    @property
    def levels(self) -> int:
        if self.level is None:
            return 1
        return max(self.level.count, math.ceil((self.level.high - self.level.low) / LEVEL_STEP) + 1)

    @property
    def stacks(self) -> int:
        return self.mixed.count if self.mixed else 1

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the image."""
        return self.rows * self.levels, self.columns * self.stacks * self.quantities


def quantity_count(lobes: int, walk: bool) -> int:
    return 2 * lobes + (len(WALK_QUANTITIES) if walk else 0)


def layout(axes: tuple[Axis, ...], lobes: int = LOBES, walk: bool = False) -> Layout:
    counts = [axis.count for axis in axes[:2]] + [1, 1]
    further = {axis.id: axis for axis in axes[2:]}
    return Layout(counts[0], counts[1], further.get("oxygenation"), further.get("ink_per_mm"), quantity_count(lobes, walk))


def table_image(quantities: np.ndarray, axes: tuple[Axis, ...]) -> np.ndarray:
    """(N, quantities, 3) of every entry, axis 0 fastest, laid out as (height, width, 3). Levels between entries are linear."""
    form = replace(layout(axes), quantities=quantities.shape[1])
    solved = form.level.count if form.level else 1
    entries = quantities.reshape(form.stacks, solved, form.rows, form.columns, *quantities.shape[1:])
    at = np.linspace(0.0, solved - 1.0, form.levels)
    first = np.minimum(at.astype(int), max(solved - 2, 0))
    share = (at - first)[:, None, None, None, None]
    levels = entries[:, first] * (1.0 - share) + entries[:, np.minimum(first + 1, solved - 1)] * share
    # (stack, level, row, column, quantity, 3) -> (level, row, quantity, stack, column, 3)
    return levels.transpose(1, 2, 4, 0, 3, 5).reshape(*form.shape, 3)


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
    walk: bool = False,
) -> Table:
    """Solves every entry. `working_space`: a name that `sanguine_core` knows or a 3x3 XYZ (D65) to RGB matrix."""
    skins = entry_skins(axes, skin)
    fit = sanguine_core.burley_lobes(skins, working_space, lobe_count=lobes, threads=0, progress=progress)
    quantities = np.concatenate([fit["weights"], fit["d_mm"]], axis=1)  # (N, 2 * lobes, 3)
    if walk:
        quantities = np.concatenate([quantities, walk_of(skins, fit["weights"].sum(1), working_space)], axis=1)
    image = np.ascontiguousarray(table_image(quantities, axes), dtype=np.float32)
    return Table(axes, lobes, image, fit["clamped"].max(0), fit["fit_error"].max(0), walk)


RELIEF_MM = 0.3
"""Width of a furrow or a pore, about."""


def relief_kept(skin: Skin) -> float:
    """Share (0-1) of the relief that light from under the skin still shows: it has forgotten the shape of the place where
    it entered once it has gone further than the relief is wide. A guess of ours by eye."""
    fit = sanguine_core.burley_lobes(skin_rows([skin]), "rec709", lobe_count=1)
    weights, d_mm = fit["weights"], fit["d_mm"]
    return float((weights * RELIEF_MM / (RELIEF_MM + d_mm)).sum() / max(weights.sum(), 1e-6))
