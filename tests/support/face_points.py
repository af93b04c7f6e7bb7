"""Points of the example heads that FACS speaks of, and how far a setting of the sliders moves them."""

from __future__ import annotations

from functools import cache

import numpy as np

from sanguine.app.faces import example_head
from sanguine.domain.facs import shape_key_values
from sanguine.domain.head.bust import cut_bust
from sanguine.domain.head.package import HeadPackage

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
