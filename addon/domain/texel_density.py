"""How many texels a map needs: no more than what the camera can tell apart."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .quality import DEFAULT, Settings, preset

# Below this a map holds too little to filter.
SMALLEST_SIZE = 64
# A head at 0.3 mm per texel. Beyond it a tile takes more than a gigabyte while it is painted: use UDIM tiles.
LARGEST_DETAIL = 4096
DETAIL_WITHOUT_CAMERA = 2048

# Share of the surface (by area) that gets a texel per pixel even where the camera is nearest. The rest is where a UV layout
# crams skin together (the neck, the back of the ears), mostly farther from the camera or turned away from it.
_SERVED_SHARE = 0.6


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


@dataclass(frozen=True)
class MapSizes:
    """Texels along a side. smooth: masks of regions and what follows from them. detail: features down to the pore."""

    smooth: int
    detail: int


def map_sizes(span_mm: float, pixel_mm: float | None, settings: Settings) -> MapSizes:
    """Sizes of the maps of one UV tile, powers of the root of two (a camera that moves a little asks for the same).

    span_mm: of `mm_per_uv`. pixel_mm: what one pixel covers on the skin where the camera is nearest; None when no
    camera is known. Smooth maps have at most the size that the quality was measured with; details get a texel per pixel
    at the default quality, fewer below it in the same proportion.
    """
    default = preset(DEFAULT).map_size
    smooth = _bounded(span_mm, pixel_mm, settings.map_size)
    texel_mm = pixel_mm and pixel_mm * default / min(settings.map_size, default)
    return MapSizes(smooth, _bounded(span_mm, texel_mm, LARGEST_DETAIL if texel_mm else DETAIL_WITHOUT_CAMERA))


def _bounded(span_mm: float, texel_mm: float | None, largest: int) -> int:
    if texel_mm is None or not texel_mm > 0.0 or not span_mm > 0.0:
        return largest
    wanted = round(2.0 ** (math.ceil(2.0 * math.log2(max(span_mm / texel_mm, 1.0))) / 2.0))
    return max(min(wanted, largest), min(SMALLEST_SIZE, largest))
