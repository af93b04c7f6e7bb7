"""Slopes of heights painted on a UV layout, along the axes in which Blender's Normal Map node takes a normal.

The node's tangent space is that of MikkTSpace (Mikkelsen 2008, "Simulation of Wrinkled Surfaces Revisited"): the tangent
T at a corner is the direction of dP/du, averaged by angle over the triangles of its UV island round the vertex; the other
axis is B = s N x T, with s = -1 where the layout mirrors the skin. A height h turns the normal N into
N - dh/dT T - dh/dB B (Blinn 1978, "Simulation of Wrinkled Surfaces").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import sanguine_core

_TINY = 1e-12


@dataclass(frozen=True)
class TexelAxes:
    """How the texels of a map lie on the skin.

    per_step: (4, H, W) float32, per mm: what a difference of heights over two texels, rightward and upward, adds to the
    slope along T ([0], [1]) and along B ([2], [3]); 0 where there is no skin. one_sided: rightward and upward, (2, N)
    int64, the texels that are the last ones of their UV island and the neighbour that they have, or themselves.
    """

    per_step: np.ndarray
    one_sided: tuple[np.ndarray, np.ndarray]

    def slopes(self, height_mm: np.ndarray, axis: int) -> np.ndarray:
        """(H, W, C) float32 of heights (H, W, C) in mm: mm per mm along T (axis 0) or B (1), by central differences; by
        one-sided ones where an island ends."""
        slopes = np.empty(height_mm.shape, dtype=np.float32)
        right, up = (np.zeros(height_mm.shape[:2], dtype=np.float32) for _ in range(2))
        for channel in range(height_mm.shape[2]):
            height = np.ascontiguousarray(height_mm[..., channel], dtype=np.float32)
            np.subtract(height[:, 2:], height[:, :-2], out=right[:, 1:-1])
            np.subtract(height[2:], height[:-2], out=up[1:-1])
            for step, (texel, beside) in zip((right, up), self.one_sided, strict=True):
                flat = height.ravel()
                step.ravel()[texel] = 2.0 * np.sign(beside - texel) * (flat[beside] - flat[texel])
            right *= self.per_step[2 * axis]
            up *= self.per_step[2 * axis + 1]
            np.add(right, up, out=slopes[..., channel])
        return slopes


def texel_axes(
    position_mm: np.ndarray, uv: np.ndarray, triangles: np.ndarray, corner_vertex: np.ndarray, size: int, padding_px: int
) -> TexelAxes:
    """Of a square map: position_mm (V, 3), uv (L, 2) per corner, triangles (T, 3) of corners, corner_vertex (L,).

    Texels within `padding_px` of an island have the axes of its nearest triangle, whatever skin they show.
    """
    frames, island = _frames(position_mm, uv, triangles, corner_vertex)
    # A corner for each triangle: axes jump where triangles differ in how the layout stretches them.
    values = np.concatenate([frames.reshape(-1, 4) * np.float32(0.5 * size), island.reshape(-1, 1)], axis=1)
    drawn = sanguine_core.rasterize_uv(
        np.ascontiguousarray(uv[triangles].reshape(-1, 2), dtype=np.float32),
        np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3), values, size, size, padding_px,
        np.zeros(5, dtype=np.float32),
    )
    islands = np.pad(drawn[..., 4], 1)
    one_sided = tuple(_ends(islands, step) for step in ((0, 1), (1, 0)))
    return TexelAxes(np.ascontiguousarray(np.moveaxis(drawn[..., :4], 2, 0)), one_sided)


def _ends(islands: np.ndarray, step: tuple[int, int]) -> np.ndarray:
    """(2, N): texels without a neighbour of their island on one side or both along `step`, and the one they have."""
    rows, columns = (length - 2 for length in islands.shape)
    middle = islands[1:-1, 1:-1]
    after, before = (
        islands[1 + i : 1 + i + rows, 1 + j : 1 + j + columns] == middle for i, j in (step, (-step[0], -step[1]))
    )
    texel = np.flatnonzero((middle > 0) & ~(after & before))
    apart = step[0] * columns + step[1]
    beside = np.where(after.ravel()[texel], texel + apart, np.where(before.ravel()[texel], texel - apart, texel))
    return np.stack([texel, beside])


def _frames(
    position_mm: np.ndarray, uv: np.ndarray, triangles: np.ndarray, corner_vertex: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Per corner of each triangle: (T, 3, 2, 2) float32, slopes along T and B in mm per mm by dh/du and dh/dv in mm; and
    (T, 3) float32, the number of its UV island, from 1. Triangles without area have no slopes."""
    vertex = corner_vertex[triangles]
    place, at = position_mm[vertex].astype(np.float64), uv[triangles].astype(np.float64)
    (p1, p2), (a1, a2) = ((x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) for x in (place, at))
    area = a1[:, 0] * a2[:, 1] - a1[:, 1] * a2[:, 0]
    normal = np.cross(p1, p2)
    good = (np.abs(area) > _TINY) & (np.linalg.norm(normal, axis=1) > _TINY)
    by = np.where(good, 1.0 / np.where(good, area, 1.0), 0.0)[:, None]
    along_u = (a2[:, 1:] * p1 - a1[:, 1:] * p2) * by
    along_v = (a1[:, :1] * p2 - a2[:, :1] * p1) * by
    normal = _unit(normal)

    # The gradients of u and v over the skin, per mm, by the metric of the layout.
    uu, vv, uv_ = ((x * y).sum(1) for x, y in ((along_u, along_u), (along_v, along_v), (along_u, along_v)))
    det = uu * vv - uv_**2
    by = np.where(good, 1.0 / np.where(good, det, 1.0), 0.0)[:, None]
    gradients = np.stack([vv[:, None] * along_u - uv_[:, None] * along_v, uu[:, None] * along_v - uv_[:, None] * along_u], 1)
    gradients *= by[:, None]

    _, corner = np.unique(np.column_stack([vertex.ravel(), at.reshape(-1, 2)]), axis=0, return_inverse=True)
    corner = corner.reshape(-1, 3)
    tangent = _corner_tangents(place, 2 * corner + (area < 0.0)[:, None], along_u)
    # In the plane of the triangle, in which the slopes are.
    tangent -= (tangent * normal[:, None]).sum(2, keepdims=True) * normal[:, None]
    flat = np.linalg.norm(tangent, axis=2, keepdims=True)
    tangent = np.where(flat > 1e-6, tangent / np.maximum(flat, 1e-6), _unit(along_u)[:, None])
    other = np.sign(area)[:, None, None] * np.cross(normal[:, None], tangent)
    frames = np.einsum("tkac,tjc->tkaj", np.stack([tangent, other], axis=2), gradients)
    return frames.astype(np.float32), _islands(corner)


def _corner_tangents(place: np.ndarray, group: np.ndarray, along_u: np.ndarray) -> np.ndarray:
    """(T, 3, 3): the direction of dP/du averaged over corners (T, 3) of the same group, by their angles."""
    direction = _unit(along_u)
    sums = np.zeros((group.max() + 1, 3))
    for k in range(3):
        a, b = (_unit(place[:, (k + i) % 3] - place[:, k]) for i in (1, 2))
        angle = np.arccos(np.clip((a * b).sum(1), -1.0, 1.0))
        for axis in range(3):
            sums[:, axis] += np.bincount(group[:, k], angle * direction[:, axis], len(sums))
    return sums[group]


def _islands(corner: np.ndarray) -> np.ndarray:
    """(T, 3) float32: triangles that share corners (T, 3), by themselves or through others, have the same number from 1."""
    label = np.arange(corner.max() + 1)
    while True:
        least = label[corner].min(axis=1)
        before = label.copy()
        np.minimum.at(label, corner.ravel(), np.repeat(least, 3))
        label = label[label]
        if (label == before).all():
            return 1.0 + label[corner].astype(np.float32)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), _TINY)
