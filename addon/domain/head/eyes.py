"""Eyeballs fitted into the sockets of the base mesh: sclera, iris bowl and pupil inside, a wet shell outside."""

from __future__ import annotations

import numpy as np

from .surface import unit

SLOTS = ("eye", "cornea")
LIMBUS_UV = 0.25  # radius of the limbus in the eye's UV map, about (0.5, 0.5); the look is drawn in its multiples
IRIS_RADIUS_M = 0.0060  # horizontal visible iris diameter 11.7 +- 0.5 mm (Rufer et al. 2005), a little over
IRIS_DEPTH_M = 0.0009
CORNEA_BULGE_M = 0.0010  # height of the cornea (radius 7.8 mm) above the globe at the apex
FILM_M = 0.00006  # the shell floats this far off the sclera
# A blink draws the globe back (Doane 1980, about 1 mm; the rest is a guess): the lids' linear keys take a short cut
# through it on their way down, and the cornea must not come out through a half-closed lid.
BLINK_RETRACTION_M = 0.0026
GAZE_M = 1.0  # the eyes converge on a point this far in front: the portrait camera

SEGMENTS = 48


def fit_sphere(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre and radius of the sphere nearest to points, by linear least squares."""
    origin = points.mean(axis=0)
    p = (points - origin).astype(np.float64)
    solution, *_ = np.linalg.lstsq(np.c_[2 * p, np.ones(len(p))], (p**2).sum(axis=1), rcond=None)
    centre = solution[:3]
    return (centre + origin).astype(np.float32), float(np.sqrt(solution[3] + centre @ centre))


def rigid(rest: np.ndarray, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation R and shift t with moved = R rest + t in the least-squares sense (Kabsch 1976)."""
    a, b = rest.mean(axis=0), moved.mean(axis=0)
    u, _, vt = np.linalg.svd((rest - a).T @ (moved - b))
    flip = np.diag([1, 1, np.sign(np.linalg.det(vt.T @ u.T))])
    rotation = vt.T @ flip @ u.T
    return rotation, b - rotation @ a


def carried(points: np.ndarray, rest: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Displacements (units, N, 3) of points that move rigidly with a guide (rest (G, 3), units (units, G, 3))."""
    out = np.zeros((len(units), *points.shape), dtype=np.float32)
    for row, delta in zip(out, units):
        if np.abs(delta).max() > 1e-5:
            rotation, shift = rigid(rest, rest + delta)
            row[:] = points @ rotation.T + shift - points
    return out


def _lathe(angle: np.ndarray, radius: np.ndarray, depth: np.ndarray, limbus: float) -> tuple[np.ndarray, ...]:
    """Turn a profile (distance from the axis, position along it) about +Z: vertices, quads, corner UVs.

    The UV map is azimuthal, radius in proportion to `angle`, so a look can be drawn in polar coordinates.
    """
    turn = np.linspace(0, 2 * np.pi, SEGMENTS, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    level = np.broadcast_to(depth[:, None, None], (len(depth), SEGMENTS, 1))
    vertices = np.concatenate([radius[:, None, None] * ring, level], axis=-1)
    uv = 0.5 + LIMBUS_UV * (angle / limbus)[:, None, None] * ring
    here = np.arange(SEGMENTS)
    there = np.roll(here, -1)
    row = np.arange(len(radius) - 1)[:, None] * SEGMENTS
    faces = np.stack([row + here, row + SEGMENTS + here, row + SEGMENTS + there, row + there], axis=-1).reshape(-1, 4)
    return vertices.reshape(-1, 3), faces, uv.reshape(-1, 2)[faces]


def eyeball(
    centre: np.ndarray, globe_m: float, target: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """One eye looking at `target`: vertices, faces, uv, material (0 eye, 1 cornea)."""
    limbus = np.arcsin(IRIS_RADIUS_M / globe_m)
    # Inside: the iris bowl to the limbus, then the globe. The first ring is a hair's breadth inside the pupil.
    iris = np.linspace(0.004, 1, 14)[:-1] * limbus
    globe = np.r_[limbus, limbus * 1.04, limbus * 1.12, np.linspace(limbus * 1.25, np.pi - 0.01, 22)]
    angle = np.r_[iris, globe]
    bowl = IRIS_DEPTH_M * (1 - np.clip(angle / limbus, 0, 1) ** 6)
    inner_radius = np.r_[IRIS_RADIUS_M * iris / limbus, globe_m * np.sin(globe)]
    inner_depth = np.r_[np.full(len(iris), globe_m * np.cos(limbus)), globe_m * np.cos(globe)] - bowl
    # Outside: cornea and tear film, as far round as the lids can ever show.
    shell = np.linspace(0.004, 1.35, 26)
    edge = limbus * 1.18
    height = FILM_M + CORNEA_BULGE_M * np.clip(1 - (shell / edge) ** 2, 0, None) ** 1.5
    meshes = [
        _lathe(angle, inner_radius, inner_depth, limbus),
        _lathe(shell, (globe_m + height) * np.sin(shell), (globe_m + height) * np.cos(shell), limbus),
    ]
    forward = unit(target - centre)
    right = unit(np.cross(np.array([0, 0, 1.0]), forward))
    frame = np.stack([right, np.cross(forward, right), forward])
    (v0, f0, uv0), (v1, f1, uv1) = meshes
    vertices = np.concatenate([v0, v1]) @ frame + centre
    material = np.repeat(np.array([0, 1], np.int32), [len(f0), len(f1)])
    return vertices.astype(np.float32), np.concatenate([f0, f1 + len(v0)]), np.concatenate([uv0, uv1]), material
