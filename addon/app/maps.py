"""Maps of a face from the masks of its regions: where blood may move, and how the skin differs by anatomy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import sanguine_core

from ..domain.blood import ANATOMY, Rest
from ..domain.effects import anatomy
from ..domain.effects.regions import region_images

# Texels that repeat a UV island's edge outward, so that filtering never meets the background.
_PADDING = 16


@dataclass(frozen=True)
class Surface:
    """A face as the maps need it.

    position_mm: (V, 3) float32, of the neutral face. uv: (L, 2) float32 per face corner. triangles: (T, 3) int32 into
    corners. corner_vertex: (L,) int32. regions: region id -> (V,) float32 mask, 0-1, in the order of the vertices.
    """

    position_mm: np.ndarray
    uv: np.ndarray
    triangles: np.ndarray
    corner_vertex: np.ndarray
    regions: Mapping[str, np.ndarray]


def bake_maps(wanted: tuple[str, ...], surface: Surface, size: int) -> dict[str, np.ndarray]:
    """The maps of a plan. Returns map id -> (size, size, 3 or 4) float32, row 0 lowest; nothing unasked for."""
    if not wanted:
        return {}
    names = tuple(surface.regions)
    weights = np.stack([surface.regions[name] for name in names], axis=1).astype(np.float32)
    masks = sanguine_core.rasterize_uv(
        surface.uv, surface.triangles, weights[surface.corner_vertex], size, size, _PADDING,
        np.zeros(len(names), dtype=np.float32),
    )
    made = {}
    images = region_images(names)
    for name in wanted:
        if name == anatomy.MAP:
            made[name] = _anatomy(masks, names)
        else:
            made[name] = _channels(masks, [names.index(region) for region in images[name]])
    return made


def _channels(masks: np.ndarray, columns: list[int]) -> np.ndarray:
    image = np.zeros((*masks.shape[:2], 3), dtype=np.float32)
    image[..., : len(columns)] = masks[..., columns]
    return image


def _anatomy(masks: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    rest = [ANATOMY.get(name, Rest()) for name in names]
    table = np.array([[r.hemoglobin - 1.0, r.melanin - 1.0, r.oil - 1.0, r.oxygenation] for r in rest], dtype=np.float32)
    return masks @ table + np.array([1.0, 1.0, 1.0, 0.0], dtype=np.float32)
