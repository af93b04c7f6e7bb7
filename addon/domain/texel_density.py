"""How many texels a map needs: no more than what the camera can tell apart."""

from __future__ import annotations

import math

import numpy as np

# Below this a map holds too little to filter; above, the quality's own size is the bound.
SMALLEST_SIZE = 64

# Share of the surface (by area) that gets at least one texel per pixel. The rest is where a UV layout crams skin
# together: the back of the ears, the rim of the neck.
_SERVED_SHARE = 0.9


def mm_per_uv(position_mm: np.ndarray, uv: np.ndarray, triangles: np.ndarray, corner_vertex: np.ndarray) -> float:
    """Millimetres of surface that the side of one UV tile spans where the layout is coarse (see _SERVED_SHARE).

    position_mm (V, 3), uv (L, 2), triangles (T, 3) of corners, corner_vertex (L,). 0 for a mesh without area.
    """
    corner = position_mm[corner_vertex[triangles]].astype(np.float64)
    area_mm2 = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1) / 2
    a, b = (uv[triangles[:, k]].astype(np.float64) - uv[triangles[:, 0]] for k in (1, 2))
    area_uv = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2
    good = (area_uv > 1e-14) & (area_mm2 > 0) & np.isfinite(area_mm2)
    if not good.any():
        return 0.0
    scale = np.sqrt(area_mm2[good] / area_uv[good])
    order = np.argsort(scale)
    below = np.cumsum(area_mm2[good][order])
    return float(scale[order][np.searchsorted(below, _SERVED_SHARE * below[-1])])


def map_size(span_mm: float, pixel_mm: float | None, largest: int) -> int:
    """Texels along a side, a power of two: one per pixel of `pixel_mm` on the skin, at most `largest`.

    span_mm: of `mm_per_uv`. pixel_mm: what one pixel covers where the camera is nearest; None when no camera is known.
    """
    if pixel_mm is None or not pixel_mm > 0.0 or not span_mm > 0.0:
        return largest
    wanted = span_mm / pixel_mm
    return max(min(2 ** math.ceil(math.log2(max(wanted, 1.0))), largest), min(SMALLEST_SIZE, largest))
