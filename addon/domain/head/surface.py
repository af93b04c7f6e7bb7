"""Work on quad meshes as arrays: subdivision, normals, smoothing, binding of points to a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


def edges_of(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unique edges (E, 2), the edge of each face side (F, 4), and the number of faces at each edge (E,)."""
    sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edges, inverse, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    return edges, inverse.reshape(faces.shape), count


class ScatterMean:
    """Mean (or sum) of rows that share a target, for many columns at once (sorted once, reduced with reduceat)."""

    def __init__(self, target: np.ndarray, size: int):
        target = np.asarray(target).ravel()
        self.order = np.argsort(target, kind="stable")
        self.count = np.bincount(target, minlength=size)
        self.filled = np.nonzero(self.count)[0]
        self.start = np.concatenate([[0], np.cumsum(self.count[self.filled])[:-1]]).astype(np.intp)
        self.size = size

    def sum(self, rows: np.ndarray) -> np.ndarray:
        out = np.zeros((self.size, *rows.shape[1:]), dtype=rows.dtype)
        if self.filled.size:
            out[self.filled] = np.add.reduceat(rows[self.order], self.start, axis=0)
        return out

    def mean(self, rows: np.ndarray) -> np.ndarray:
        count = np.maximum(self.count, 1).reshape(-1, *([1] * (rows.ndim - 1)))
        return self.sum(rows) / count.astype(rows.dtype)


class Subdivision:
    """One step of Catmull and Clark (1978) on a quad mesh, as a linear operator on any per-vertex values.

    What Blender's Subdivision modifier does to the cage is thereby known here, so that lashes, brows and the
    tear line can be rooted on the surface that is rendered and not on the cage above it.
    """

    def __init__(self, faces: np.ndarray, n_vertices: int):
        self.faces_in = faces
        self.edges, side, count = edges_of(faces)
        n, e = n_vertices, len(self.edges)
        self.boundary_edge = count == 1
        self.boundary_vertex = np.zeros(n, bool)
        self.boundary_vertex[self.edges[self.boundary_edge]] = True
        self._face_to_edge = ScatterMean(side, e)
        self._face_to_vertex = ScatterMean(faces, n)
        self._edge_to_vertex = ScatterMean(self.edges, n)
        self._rim_to_vertex = ScatterMean(self.edges[self.boundary_edge], n)
        edge_point, face_point = n + side, n + e + np.arange(len(faces))
        self.faces = np.stack(
            [faces, edge_point, np.repeat(face_point[:, None], 4, 1), np.roll(edge_point, 1, axis=1)], axis=-1
        ).reshape(-1, 4)

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Values (V, C) on the cage -> values on the vertices of the finer mesh."""
        face = values[self.faces_in].mean(axis=1)
        middle = values[self.edges].mean(axis=1)
        inner_edge = (middle + self._face_to_edge.mean(np.repeat(face, 4, axis=0))) / 2
        edge = np.where(self.boundary_edge[:, None], middle, inner_edge)
        valence = np.maximum(self._edge_to_vertex.count, 1)[:, None].astype(values.dtype)
        around_face = self._face_to_vertex.mean(np.repeat(face, 4, axis=0))
        around_edge = self._edge_to_vertex.mean(np.repeat(middle, 2, axis=0))
        inner = (around_face + 2 * around_edge + (valence - 3) * values) / valence
        rim = (self._rim_to_vertex.mean(np.repeat(middle[self.boundary_edge], 2, axis=0)) + values) / 2
        return np.concatenate([np.where(self.boundary_vertex[:, None], rim, inner), edge, face])


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c, d = np.moveaxis(vertices[faces], 1, 0)
    face = np.cross(c - a, d - b)
    return unit(ScatterMean(faces, len(vertices)).sum(np.repeat(face, 4, axis=0)))


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12)


def smooth(values: np.ndarray, faces: np.ndarray, steps: int) -> np.ndarray:
    """Umbrella-operator (uniform Laplacian) smoothing of per-vertex values over the mesh."""
    edges, _, _ = edges_of(faces)
    both = np.concatenate([edges, edges[:, ::-1]])
    gather = ScatterMean(both[:, 0], len(values))
    for _ in range(steps):
        values = (values + gather.mean(values[both[:, 1]])) / 2
    return values


def smoothstep(low: float, high: float, x: np.ndarray) -> np.ndarray:
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def triangles(quads: np.ndarray) -> np.ndarray:
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


@dataclass(frozen=True)
class Binding:
    """Points tied to triangles: vertex indices (N, 3) and barycentric weights (N, 3)."""

    index: np.ndarray
    weight: np.ndarray

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Interpolate per-vertex values (V, C) at the points."""
        return np.einsum("nk,nkc->nc", self.weight, values[self.index])


def locate(points: np.ndarray, plane: np.ndarray, tris: np.ndarray, chunk: int = 512) -> Binding:
    """Tie 2-D points (N, 2) to the triangle of a flat map (V, 2) that holds them; outside, to the nearest rim.

    Brute force over points by triangles: the patches (a brow, a lash card) hold a few hundred triangles.
    """
    a, b, c = (plane[tris[:, k]].astype(np.float64) for k in range(3))
    ab, ac = b - a, c - a
    area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    keep = np.abs(area) > 1e-14
    tris, a, ab, ac, area = tris[keep], a[keep], ab[keep], ac[keep], area[keep]
    index = np.empty((len(points), 3), np.int64)
    weight = np.empty((len(points), 3))
    for start in range(0, len(points), chunk):
        p = points[start : start + chunk, None] - a
        v = (p[..., 0] * ac[:, 1] - p[..., 1] * ac[:, 0]) / area
        w = (p[..., 1] * ab[:, 0] - p[..., 0] * ab[:, 1]) / area
        bary = np.stack([1 - v - w, v, w], axis=-1)
        best = bary.min(axis=-1).argmax(axis=1)
        rows = np.arange(len(best))
        inside = np.clip(bary[rows, best], 0, None)
        index[start : start + chunk] = tris[best]
        weight[start : start + chunk] = inside / inside.sum(axis=-1, keepdims=True)
    return Binding(index, weight)


def scatter_on(
    vertices: np.ndarray, tris: np.ndarray, density: np.ndarray, count: int, rng: np.random.Generator
) -> Binding:
    """`count` random points on triangles, as many per area as the per-vertex density says."""
    a, b, c = (vertices[tris[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) * density[tris].mean(axis=1)
    chosen = rng.choice(len(tris), size=count, p=area / area.sum())
    r1, r2 = np.sqrt(rng.random(count)), rng.random(count)
    return Binding(tris[chosen], np.stack([1 - r1, r1 * (1 - r2), r1 * r2], axis=1))
