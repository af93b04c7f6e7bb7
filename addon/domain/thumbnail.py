"""A small picture of a face from its triangles: enough to tell a smile from a frown, without a renderer."""

from __future__ import annotations

import numpy as np

SIZE = 128
_HALVES = 2  # samples per texel and axis, averaged: the edges are smooth
_LIGHT = np.array([-0.35, -0.75, 0.55]) / np.linalg.norm([-0.35, -0.75, 0.55])  # from the front, upper left
_COLOUR = np.array([0.80, 0.72, 0.68])
_AMBIENT = 0.15


def face_picture(corners: np.ndarray, size: int = SIZE) -> np.ndarray:
    """The upper part of a mesh, seen along +Y with Z up: from the crown as far down as it is wide there.

    corners: (N, 3, 3) corners of triangles, any length unit. Returns (size, size, 4) float32, row 0 lowest,
    transparent where there is nothing. Triangles that are not finite are left out.
    """
    corners = corners[np.isfinite(corners).all(axis=(1, 2))].astype(np.float64)
    image = np.zeros((size, size, 4), dtype=np.float32)
    if not len(corners):
        return image
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    seen = (normal[:, 1] < 0) & (area > 0)
    corners, normal = corners[seen], normal[seen] / area[seen, None]
    if not len(corners):
        return image
    centre, scale = _frame(corners)
    fine = _HALVES * size
    at = (corners[:, :, [0, 2]] - centre) * (fine / scale) + fine / 2
    samples = [_samples(at, corners[:, :, 1], rows, steps) for steps, rows in _by_size(at, fine)]
    point, depth, triangle = (np.concatenate(part) for part in zip(*samples, strict=True))
    texel = np.floor(point).astype(np.int64)
    inside = ((texel >= 0) & (texel < fine)).all(axis=1)
    texel, depth, triangle = texel[inside, 1] * fine + texel[inside, 0], depth[inside], triangle[inside]
    far_to_near = np.argsort(-depth, kind="stable")  # of several written to one texel, the last stays
    shown = np.full(fine * fine, -1)
    shown[texel[far_to_near]] = triangle[far_to_near]
    shade = _AMBIENT + (1 - _AMBIENT) * np.clip(normal @ _LIGHT, 0, 1)
    colour = np.where(shown[:, None] >= 0, np.c_[shade[shown, None] * _COLOUR, np.ones(fine * fine)], 0.0)
    image[:] = colour.reshape(size, _HALVES, size, _HALVES, 4).mean(axis=(1, 3))
    image[..., :3] /= np.maximum(image[..., 3:], 1e-6)
    return image


def _frame(corners: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre (x, z) and width of the square: the head is as wide as what lies in the top half of the mesh, or less."""
    top, bottom = corners[..., 2].max(), corners[..., 2].min()
    upper = corners[corners[..., 2].min(axis=1) > (top + bottom) / 2]
    left, right = upper[..., 0].min(initial=np.inf), upper[..., 0].max(initial=-np.inf)
    if not left < right:
        left, right = corners[..., 0].min(), corners[..., 0].max()
    height = min(1.5 * (right - left), top - bottom)
    scale = max(1.05 * max(height, right - left), 1e-12)
    return np.array([(left + right) / 2, top - height / 2]), scale


def _by_size(at: np.ndarray, fine: int) -> list[tuple[int, np.ndarray]]:
    """Steps along an edge that leave no texel out -> the triangles that need so many, in powers of two."""
    edge = np.linalg.norm(at - np.roll(at, 1, axis=1), axis=2).max(axis=1)
    wanted = np.ceil(np.log2(np.clip(1.5 * edge, 1, 2 * fine))).astype(int)
    return [(2 ** int(power), np.flatnonzero(wanted == power)) for power in np.unique(wanted)]


def _samples(at: np.ndarray, depth: np.ndarray, rows: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (M, 2) all over some triangles, their depths (M,) and whose they are (M,)."""
    i, j = np.meshgrid(np.arange(steps), np.arange(steps), indexing="ij")
    keep = i + j < steps
    a, b = (i[keep] + 1 / 3) / steps, (j[keep] + 1 / 3) / steps
    share = np.stack([a, b, 1 - a - b], axis=1)
    point = np.einsum("sk,nkc->nsc", share, at[rows]).reshape(-1, 2)
    return point, (depth[rows] @ share.T).ravel(), np.repeat(rows, len(share))
