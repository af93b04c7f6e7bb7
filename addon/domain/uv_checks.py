"""What is wrong with a UV layout, in one line each, before anything is drawn into it."""

from __future__ import annotations

import numpy as np
import sanguine_core

from . import udim
from .errors import InputError

# Finer than the smallest map that is made; what overlaps by less than a thousandth of the layout is a matter of borders.
_SIZE = 1024
_SHARE = 0.001


def uv_warnings(uv: np.ndarray, triangles: np.ndarray) -> list[str]:
    """Warnings about a layout, none for a good one.

    uv: (L, 2) float32 per face corner. triangles: (T, 3) int32 into corners.
    """
    if len(uv) == 0 or len(triangles) == 0:
        return ["UV: the mesh has no UV layout: maps have no place on it"]
    uv = np.ascontiguousarray(uv, dtype=np.float32)
    triangles = np.ascontiguousarray(triangles, dtype=np.int32)
    warnings = []
    degenerate = sanguine_core.count_degenerate_uv(uv, triangles)
    if degenerate == len(triangles):
        return ["UV: no triangle has an area in the layout: it was never unwrapped, maps have no place on it"]
    if degenerate:
        warnings.append(f"UV: {degenerate} of {len(triangles)} triangles have no area in the layout and show no map")
    try:
        tiles = udim.tiles_of(uv[triangles])
    except InputError as error:
        return [*warnings, str(error)]
    outside = len(triangles) - degenerate
    for tile in tiles:
        moved = uv - np.array(udim.tile_offset(tile), dtype=np.float32)
        found = sanguine_core.uv_coverage(moved, triangles, _SIZE, _SIZE)
        outside -= len(triangles) - degenerate - found["outside"]
        if found["covered"] and found["overlapping"] > _SHARE * found["covered"]:
            share = found["overlapping"] / found["covered"]
            warnings.append(
                f"UV: {share:.1%} of tile {tile} is covered more than once (a mirrored or stacked layout): what is"
                " painted or grown there shows at every place that shares it"
            )
    if outside > 0:  # at least: one that lies over a border was counted in each of its tiles
        warnings.append(
            f"UV: {outside} of {len(triangles)} triangles lie outside of the UDIM tiles {udim.FIRST_TILE} to"
            f" {udim.LAST_TILE} and show no map"
        )
    return warnings
