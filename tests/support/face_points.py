"""Points of the example heads that FACS speaks of, and how far a setting of the sliders moves them."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy import ndimage

from sanguine.app.faces import example_head
from sanguine.domain.facs import shape_key_values
from sanguine.domain.head.bust import cut_bust
from sanguine.domain.head.package import HeadPackage
from sanguine.domain.head.surface import Subdivision

# On the unshaped mesh, mm, x to the subject's left; those off the midline have a twin on the right.
SIDED = {
    "inner brow": (16, -149, 746),
    "outer brow": (48, -133, 745),
    "upper lid": (35, -141, 733),
    "lower lid": (35, -140, 724),
    "cheek": (50, -125, 680),
    "hollow cheek": (51, -119, 668),
    "nostril": (17, -150, 690),
    "nose wing": (14, -158, 690),
    "nasolabial fold": (36, -140, 682),
    "upper lip side": (14, -155, 668),
    "lower lip side": (10, -151, 661),
    "lip corner": (29, -141, 661),
    "cheek beside the lips": (38, -135, 665),
    "jaw angle": (54, -91, 653),
    "neck": (22, -76, 620),
}
MIDDLE = {
    "upper lip": (0, -155, 661),
    "red of the upper lip": (0, -160, 667),
    "lower lip": (0, -155, 659),
    "red of the lower lip": (0, -157, 656),
    "chin": (0, -150, 639),
    "jaw": (0, -145, 623),
}
PLACES = MIDDLE | {
    f"{name} {side}": (sign * x, y, z) for name, (x, y, z) in SIDED.items() for side, sign in (("L", 1), ("R", -1))
}
NAMES = (*PLACES, "gaze L", "gaze R", "tongue")

PARTS = {
    "brows": ("inner brow", "outer brow"),
    "eyes": ("upper lid", "lower lid", "gaze"),
    "nose": ("nostril", "nose wing", "nasolabial fold"),
    "cheeks": ("cheek", "hollow cheek", "cheek beside the lips"),
    "mouth": ("upper lip side", "lower lip side", "lip corner", "upper lip", "red of the upper lip", "lower lip",
              "red of the lower lip"),
    "jaw": ("chin", "jaw", "jaw angle", "neck", "tongue"),
}  # fmt: skip


@cache
def head(head_id: str):
    return example_head(head_id)


@cache
def skin_points() -> dict[str, int]:
    """Name -> vertex of the skin; the same for every head."""
    base = HeadPackage().base_mesh()
    skin = base.vertices[cut_bust(base).source] * 1e3
    return {name: int(np.linalg.norm(skin - np.array(place), axis=1).argmin()) for name, place in PLACES.items()}


@cache
def _moves(head_id: str) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of the keys, and (K, N, 3) mm what each moves of the points NAMES."""
    built = head(head_id)
    skin, eyes, tongue = built.part("skin"), built.part("eyes"), built.part("tongue")
    tip = int(tongue.vertices[:, 1].argmin())
    front = {}
    for side, sign in (("L", 1), ("R", -1)):
        own = np.flatnonzero(sign * eyes.vertices[:, 0] > 0)
        front[f"gaze {side}"] = int(own[eyes.vertices[own, 1].argmin()])
    where = [(skin, skin_points()[name]) for name in PLACES]
    where += [(eyes, front["gaze L"]), (eyes, front["gaze R"]), (tongue, tip)]
    names = tuple(dict.fromkeys(name for part in (skin, eyes, tongue) for name in part.shape_keys))
    table = np.zeros((len(names), len(where), 3))
    for k, name in enumerate(names):
        for n, (part, vertex) in enumerate(where):
            if name in part.shape_keys:
                key = part.shape_keys[name]
                at = np.flatnonzero(key.indices == vertex)
                if at.size:
                    table[k, n] = key.delta[at[0]] * 1e3
    return names, table


def displacements(head_id: str, controls: dict[str, float]) -> np.ndarray:
    """(N, 3) mm of the points NAMES: x to the subject's left, y backward, z up."""
    names, table = _moves(head_id)
    values = shape_key_values(controls)
    return np.einsum("k,knx->nx", np.array([values.get(name, 0.0) for name in names]), table)


def rest_mm(head_id: str, point: str) -> np.ndarray:
    return head(head_id).part("skin").vertices[skin_points()[point]] * 1e3


PIXEL_MM = 0.35


def posed(part, controls: dict[str, float]) -> np.ndarray:
    """(V, 3) mm: the vertices of a part of a head."""
    vertices = part.vertices.astype(np.float64)
    for name, value in shape_key_values(controls).items():
        if value and name in part.shape_keys:
            key = part.shape_keys[name]
            vertices[key.indices] += value * key.delta
    return vertices * 1e3


@cache
def _subdivisions(head_id: str) -> tuple[Subdivision, Subdivision]:
    skin = head(head_id).part("skin")
    first = Subdivision(skin.faces, len(skin.vertices))
    return first, Subdivision(first.faces, int(first.faces.max()) + 1)


def fine_skin(head_id: str, controls: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """The skin as it is rendered: vertices (W, 3) mm and quads."""
    first, second = _subdivisions(head_id)
    return second(first(posed(head(head_id).part("skin"), controls).astype(np.float32))), second.faces


def _front(vertices: np.ndarray, faces: np.ndarray, window: tuple[float, float, float, float], steps: int) -> np.ndarray:
    """Depth (y, mm) of what is foremost in each pixel of a window (x0, x1, z0, z1), seen from the front; inf: nothing."""
    x0, x1, z0, z1 = window
    corners = vertices[faces]
    inside = ((corners[..., 0] > x0) & (corners[..., 0] < x1) & (corners[..., 2] > z0) & (corners[..., 2] < z1)).any(axis=1)
    t = (np.arange(steps) + 0.5) / steps
    u, v = (a.ravel()[None, :, None] for a in np.meshgrid(t, t))
    a, b, c, d = (corners[inside, i][:, None] for i in range(4))
    points = ((1 - u) * (1 - v) * a + u * (1 - v) * b + u * v * c + (1 - u) * v * d).reshape(-1, 3)
    columns, rows = int((x1 - x0) / PIXEL_MM), int((z1 - z0) / PIXEL_MM)
    i = np.floor((points[:, 0] - x0) / PIXEL_MM).astype(int)
    j = np.floor((points[:, 2] - z0) / PIXEL_MM).astype(int)
    keep = (i >= 0) & (i < columns) & (j >= 0) & (j < rows)
    depth = np.full(rows * columns, np.inf)
    back_to_front = np.argsort(-points[keep, 1])
    depth[(j[keep] * columns + i[keep])[back_to_front]] = points[keep, 1][back_to_front]
    return depth.reshape(rows, columns)


@cache
def _windows(head_id: str) -> list[tuple[tuple[float, float, float, float], np.ndarray, np.ndarray]]:
    """Of both eyes: the window, the eye's faces, and the fine skin's faces that can come near it."""
    eyes = head(head_id).part("eyes")
    vertices, faces = fine_skin(head_id, {})
    found = []
    for sign in (1, -1):
        own = eyes.faces[(sign * eyes.vertices[eyes.faces, 0] > 0).all(axis=1)]
        x, _, z = eyes.vertices[np.unique(own)].mean(axis=0) * 1e3
        at = vertices[faces].mean(axis=1)
        near = (np.abs(at[:, 0] - x) < 40) & (np.abs(at[:, 2] - z) < 35) & (at[:, 1] < -90)
        found.append(((x - 20, x + 20, z - 15, z + 15), own, faces[near]))
    return found


def eye_openings(head_id: str, controls: dict[str, float]) -> list[list[float]]:
    """Of both eyes: areas (mm^2) of the separate patches in which it is seen from the front, largest first."""
    ball = posed(head(head_id).part("eyes"), controls)
    skin, _ = fine_skin(head_id, controls)
    areas = []
    for window, eye, lids in _windows(head_id):
        seen = _front(ball, eye, window, 10) < _front(skin, lids, window, 9)
        patches, count = ndimage.label(seen)
        areas.append(sorted((np.bincount(patches.ravel())[1:] * PIXEL_MM**2).tolist(), reverse=True) if count else [])
    return areas
