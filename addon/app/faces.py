"""Faces that need no Blender: the example heads as the maps see them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import sanguine_core

from ..domain.head import Head, HeadPackage, MeshPart, build_head, load_presets, load_regions
from ..domain.head.surface import triangles
from ..domain.resources import rigs_path
from ..domain.strain import ShapeKeys
from .maps import Surface


def example_head(head_id: str, package: HeadPackage | None = None) -> Head:
    """A head of `rigs/heads.toml`. Raises HeadError when its package is not installed."""
    preset = load_presets(rigs_path("heads.toml"))[head_id]
    return build_head(preset, load_regions(rigs_path("regions.toml")), _read_top_down, package)


def head_surface(head: Head) -> Surface:
    """The skin of a head, its quads as triangles."""
    skin = head.part("skin")
    corners = np.arange(skin.faces.size, dtype=np.int32).reshape(-1, 4)
    return Surface(
        position_mm=skin.vertices * np.float32(1000.0),
        uv=np.ascontiguousarray(skin.uv.reshape(-1, 2), dtype=np.float32),
        triangles=triangles(corners),
        corner_vertex=np.ascontiguousarray(skin.faces.ravel(), dtype=np.int32),
        regions=head.regions,
        keys=_keys(skin),
    )


def _keys(skin: MeshPart) -> ShapeKeys:
    delta_mm = np.zeros((len(skin.shape_keys), *skin.vertices.shape), dtype=np.float32)
    for dense, key in zip(delta_mm, skin.shape_keys.values(), strict=True):
        dense[key.indices] = key.delta * np.float32(1000.0)
    return ShapeKeys(tuple(skin.shape_keys), delta_mm)


def _read_top_down(path: Path) -> np.ndarray:
    return sanguine_core.read_image(str(path))[::-1]
