"""Scalp hair: a hairline on the skull and strands grown from it, cropped or tied back."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np

from .model import StrandPart
from .presets import Hair
from .surface import scatter_on, smoothstep, triangles, unit, vertex_normals

AXIS_BEHIND_EYES_MM = 70.0  # the vertical line about which the hairline's azimuth is counted
KNOT_HEIGHT_MM = 12.0  # of tied hair, above the eyes
KNOT_RADIUS_MM = 30.0
TIED_DEPTH_MM = 3.0  # of swept hair, over the undercoat; deeper, its fewer-than-real hairs part into fuzz at the rim
WHORL_HEIGHT_MM = 88.0  # of cropped hair, at the back of the crown


def scalp_mask(hair: Hair, base: np.ndarray, ears: np.ndarray, eyes: np.ndarray) -> np.ndarray:
    """(V,) 0..1: how densely hair grows. `base` is the unshaped mesh, so one hairline fits all faces."""
    line = np.array(hair.hairline)
    rel = (base - eyes) * 1000
    azimuth = np.degrees(np.arctan2(np.abs(rel[:, 0]), AXIS_BEHIND_EYES_MM - rel[:, 1]))
    above = rel[:, 2] - np.interp(azimuth, line[:, 0], line[:, 1])
    # The line is never a line: it wanders by a few millimetres and thins out over a centimetre.
    wander = 2.5 * np.sin(rel @ [0.31, 0.17, 0.07]) + 1.5 * np.sin(rel @ [-0.43, 0.38, 0.61])
    return smoothstep(-6, 10, above + wander) * (1 - smoothstep(0.02, 0.2, ears))


class SkullRadius:
    """Distance of the scalp from a centre: a polynomial of direction (spherical harmonics up to `degree`)."""

    def __init__(self, points: np.ndarray, centre: np.ndarray, degree: int = 7):
        self.centre = centre
        self.powers = [c for d in (degree - 1, degree) for c in combinations_with_replacement(range(3), d)]
        rel = points - centre
        self.coefficients, *_ = np.linalg.lstsq(self._basis(unit(rel)), np.linalg.norm(rel, axis=1), rcond=1e-6)

    def _basis(self, direction: np.ndarray) -> np.ndarray:
        return np.stack([np.prod(direction[..., list(p)], axis=-1) for p in self.powers], axis=-1)

    def __call__(self, direction: np.ndarray) -> np.ndarray:
        return self._basis(direction) @ self.coefficients


def _taper(count: int, points: int, radius_mm: float, rng: np.random.Generator) -> np.ndarray:
    along = np.interp(np.linspace(0, 1, points), [0, 0.7, 1], [1, 0.85, 0.2])
    return radius_mm * 1e-3 * along * rng.uniform(0.75, 1.15, (count, 1))


def _crop(hair: Hair, root: np.ndarray, normal: np.ndarray, eyes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Short hair: away from the whorl, steep on top, lying on the sides."""
    n = len(root)
    whorl = eyes + np.array([0, AXIS_BEHIND_EYES_MM + 75, WHORL_HEIGHT_MM]) * 1e-3
    away = unit(root - whorl) + [0, -0.35, -0.25]
    # Neighbouring hairs lean together: a slow wave over the scalp beside each hair's own whim.
    wave = np.sin(root @ np.array([[210, 90, -60], [-80, 170, 130], [120, -60, 190]]).T + [0.3, 1.7, 4.1])
    along = away + 0.22 * wave + rng.normal(0, 0.16, (n, 3))
    along = unit(along - (along * normal).sum(axis=1, keepdims=True) * normal)
    height = (root[:, 2] - eyes[2]) * 1000
    top = smoothstep(25, 95, height)
    length = hair.length_mm * 1e-3 * (0.3 + 0.7 * top) * rng.uniform(0.6, 1.1, n)
    rise = np.radians(22 + 30 * top + rng.normal(0, 10, n))
    s = np.linspace(0, 1, 6)
    reach = length[:, None] * s
    out = np.sin(rise)[:, None] * reach * (1 - 0.38 * s) - (reach * np.cos(rise)[:, None]) ** 2 / 0.2
    out = out - 4e-4 * (s == 0)  # rooted in the skin
    forth = np.cos(rise)[:, None] * reach
    return root[:, None] + along[:, None] * forth[..., None] + normal[:, None] * out[..., None]


def _tied(hair: Hair, root: np.ndarray, skull: SkullRadius, eyes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Long hair swept over the skull to a knot behind."""
    n, points = len(root), 18
    s = np.linspace(0, 1, points)
    knot = eyes + np.array([0, AXIS_BEHIND_EYES_MM + 120, KNOT_HEIGHT_MM]) * 1e-3
    d0, d1 = unit(root - skull.centre), unit(knot - skull.centre)
    # Locks: hairs lean toward a shared path as they go, and each lock lies at a depth of its own.
    guides = rng.choice(n, size=max(1, n // 45), replace=False)
    owner = np.empty(n, np.int64)
    for start in range(0, n, 2048):
        rows = slice(start, start + 2048)
        owner[rows] = guides[(d0[rows] @ d0[guides].T).argmax(axis=1)]
    depth = rng.uniform(0.0, 1.0, n)[owner] * 0.6 + rng.uniform(0, 1, n) * 0.4
    # Combed back first, then in to the knot: the path bows upward over the ear.
    via = unit(d0 + d1 + np.array([0, 0.05, 0.12]))
    a, b, c = ((1 - s) ** 2)[:, None], (2 * s * (1 - s))[:, None], (s**2)[:, None]
    path = unit(a * d0[:, None] + b * via[:, None] + c * d1)
    pull = (0.75 * smoothstep(0, 0.5, s))[:, None]
    path = unit(path * (1 - pull) + path[owner] * pull + rng.normal(0, 0.004, (n, 1, 3)) * s[:, None])
    surface = skull(path)
    seat = np.linalg.norm(root - skull.centre, axis=1) - skull(d0)
    height = (0.4 + TIED_DEPTH_MM * depth[:, None] * smoothstep(0, 0.35, s)) * 1e-3
    stray = rng.random(n) < 0.005
    height[stray] += (rng.uniform(1, 5, (stray.sum(), 1)) * np.sin(np.pi * s)) * 1e-3
    height[:, 0] = -4e-4
    return skull.centre + path * (surface + height + seat[:, None] * (1 - s) ** 4)[..., None]


def _knot(count: int, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The knot: arcs wound about a ball."""
    pole = unit(np.array([0, 1.0, 0.15]) + rng.normal(0, 0.25, (count, 3)))
    start = unit(np.cross(pole, rng.normal(0, 1, (count, 3))))
    turn = np.linspace(0, np.pi * 1.2, 18)[:, None]
    ring = np.cos(turn) * start[:, None] + np.sin(turn) * np.cross(pole, start)[:, None]
    lift = rng.uniform(-0.8, 0.8, (count, 1, 1)) * pole[:, None]
    return centre + unit(ring + lift) * rng.uniform(0.9, 1.0, (count, 1, 1)) * KNOT_RADIUS_MM * 1e-3


def grow(
    hair: Hair, density: np.ndarray, vertices: np.ndarray, faces: np.ndarray, eyes: np.ndarray, rng: np.random.Generator
) -> StrandPart:
    """Strands on the shaped skin: `density` per vertex (scalp_mask), `eyes` the point between the eyes."""
    normals = vertex_normals(vertices, faces)
    haired = faces[density[faces].max(axis=1) > 0]
    binding = scatter_on(vertices, triangles(haired), density, hair.count, rng)
    root, normal = binding(vertices), unit(binding(normals))
    if hair.style == "crop":
        points = _crop(hair, root, normal, eyes, rng)
    else:
        skull = SkullRadius(vertices[np.unique(haired)], eyes + np.array([0, AXIS_BEHIND_EYES_MM, 20]) * 1e-3)
        points = _tied(hair, root, skull, eyes, rng)
        knot = points[:, -1].mean(axis=0) + [0, KNOT_RADIUS_MM * 0.4e-3, 0]
        points = np.concatenate([points, _knot(hair.count // 10, knot, rng)])
    radius = _taper(len(points), points.shape[1], hair.radius_mm, rng)
    return StrandPart("hair", points.astype(np.float32), radius.astype(np.float32))
