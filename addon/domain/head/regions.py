"""Soft anatomical regions on the skin: package masks and ellipsoids, read from rigs/regions.toml.

Regions are drawn on the unshaped base mesh, so one description fits every face, and in the order of the file:
an earlier region (lips) takes its share first, a later one (chin) gets what is left. They sum to at most 1.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from ..files import read_toml, validate
from ..resources import Row
from .bust import Bust
from .package import BaseMesh, HeadPackage
from .surface import ScatterMean, smooth, smoothstep

Radius = Annotated[float, Field(gt=0)]
ImageReader = Callable[[Path], np.ndarray]  # path -> (H, W) or (H, W, C) float, row 0 on top


class Region(Row):
    """One region.

    mask      : name of a package mask image, or ''
    ellipsoids: rows (x, y, z, rx, ry, rz) in mm from the point between the eyes of the base mesh; x is used on both
                sides; y grows backward, z up. Weight falls from 1 at `core` of the radius to 0 at the radius.
    smooth    : Laplacian steps over the mesh
    """

    id: str
    label: str
    help: str
    mask: Literal["", "lips", "ears", "eyelids", "face"] = ""
    ellipsoids: tuple[tuple[float, float, float, Radius, Radius, Radius], ...] = ()
    core: Annotated[float, Field(ge=0, lt=1)] = 0.4
    smooth: Annotated[int, Field(ge=0, le=50)] = 0

    @model_validator(mode="after")
    def _somewhere(self) -> Region:
        if not (self.mask or self.ellipsoids):
            raise ValueError("needs a mask or ellipsoids")
        return self


def load_regions(path: Path) -> tuple[Region, ...]:
    """All regions of a regions.toml, in its order. Raises InputError, one line naming file, key and mend."""
    return tuple(
        validate(Region, {"id": name, **table} if isinstance(table, dict) else table, f"{path}: [{name}]")
        for name, table in read_toml(path).items()
    )


def sample(image: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Bilinear lookup of the first channel at UVs (N, 2); v = 1 is the top row."""
    image = image if image.ndim == 2 else image[..., 0]
    height, width = image.shape
    x = np.clip(uv[:, 0] * width - 0.5, 0, width - 1.001)
    y = np.clip((1 - uv[:, 1]) * height - 0.5, 0, height - 1.001)
    c, r = x.astype(int), y.astype(int)
    fx, fy = x - c, y - r
    top = image[r, c] * (1 - fx) + image[r, c + 1] * fx
    return top * (1 - fy) + (image[r + 1, c] * (1 - fx) + image[r + 1, c + 1] * fx) * fy


def region_weights(
    regions: tuple[Region, ...], package: HeadPackage, base: BaseMesh, bust: Bust, read_image: ImageReader
) -> dict[str, np.ndarray]:
    """Region id -> (V_skin,) float32, 0..1."""
    origin = np.concatenate([base.vertices[base.vertices_of(f"helper-{s}-eye")] for s in "lr"]).mean(axis=0)
    place = (base.vertices[bust.source] - origin) * 1000
    place[:, 0] = np.abs(place[:, 0])
    corner = ScatterMean(bust.faces, len(place))
    inside = corner.mean(np.repeat(bust.material, 4).astype(np.float32)) > 0.99
    # The masks were painted by hand, a pixel off here and there: both sides get the mean.
    twin = np.searchsorted(bust.source, package.mirror()[bust.source])
    left = np.ones(len(place), np.float32)
    weights = {}
    for region in regions:
        w = np.zeros(len(place), np.float32)
        if region.mask:
            w = corner.mean(sample(read_image(package.mask_path(region.mask)), bust.uv.reshape(-1, 2)))
        for row in region.ellipsoids:
            distance = np.linalg.norm((place - row[:3]) / row[3:], axis=1)
            w = np.maximum(w, 1 - smoothstep(region.core, 1, distance))
        w = smooth((w + w[twin]) / 2, bust.faces, region.smooth).astype(np.float32) * left
        w[inside] = 0
        weights[region.id] = np.clip(w, 0, 1)
        left = left - weights[region.id]
    return weights
