"""What a head is, as plain arrays: parts, shape keys, strands, landmarks."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class ShapeKey:
    """Displacement of some vertices at value 1. indices (K,) int32, delta (K, 3) float32, metres."""

    indices: np.ndarray
    delta: np.ndarray


@dataclass(frozen=True)
class MeshPart:
    """One object of the head.

    vertices    : (V, 3) float32, metres, Z up, face toward -Y
    faces       : (F, 4) int32, all quads
    uv          : (F, 4, 2) float32, one per face corner
    material    : (F,) int32, into `slots`
    slots       : names of the looks, in slot order
    shape_keys  : name (ARKit's or of rigs/own_keys.toml) -> displacement; only the keys that move this part
    subdivision : Catmull-Clark levels at which the part is meant to be rendered
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray
    material: np.ndarray
    slots: tuple[str, ...]
    shape_keys: dict[str, ShapeKey] = field(default_factory=dict)
    subdivision: int = 0


@dataclass(frozen=True)
class StrandPart:
    """Scalp hair: points (N, K, 3) float32 metres from root to tip, radius (N, K) float32 metres."""

    name: str
    points: np.ndarray
    radius: np.ndarray
    slot: str = "hair"


@dataclass(frozen=True)
class Head:
    """A whole head.

    parts     : skin, eyes, tears, teeth, tongue, lashes, brows, undercoat
    hair      : scalp strands
    regions   : region id -> (V_skin,) float32, 0..1, in the order of the skin's vertices; they sum to at most 1
    landmarks : name -> (3,) float32 position in the neutral face, metres
    preset    : the id in heads.toml
    licence   : of the geometry
    """

    parts: tuple[MeshPart, ...]
    hair: StrandPart
    regions: dict[str, np.ndarray]
    landmarks: dict[str, np.ndarray]
    preset: str
    licence: str

    def part(self, name: str) -> MeshPart:
        return next(part for part in self.parts if part.name == name)


def shape_keys(names: tuple[str, ...], dense: np.ndarray, threshold_m: float = 1e-5) -> dict[str, ShapeKey]:
    """Dense displacements (units, V, 3) -> only the keys, and in them only the vertices, that move."""
    moved = (np.abs(dense) > threshold_m).any(axis=-1)
    rows = [np.nonzero(m)[0].astype(np.int32) for m in moved]
    return {
        name: ShapeKey(index, delta[index].astype(np.float32))
        for name, index, delta in zip(names, rows, dense)
        if index.size
    }
