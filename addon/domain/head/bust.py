"""The bust: what is kept of the whole body, and its closed, rounded lower edge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .package import BaseMesh, Group
from .surface import edges_of

SLOTS = ("skin", "mouth")

# The cut is an ellipse seen from the front (metres on the unshaped base mesh): through the upper arms, below the
# collar bones, well under the frame of a portrait. Above its centre everything is kept but the arms.
CUT_HEIGHT = 0.575
CUT_HALF_WIDTH = 0.190
CUT_DEPTH = 0.165
MOUTH_UV = ((0.75, 0.93), (0.0, 0.14))  # hm08's island of the mouth's inside: u range, v range
SOCKET_UV = ((0.0, 0.16), (0.54, 0.64))  # and of the eye sockets


@dataclass(frozen=True)
class Bust:
    """The kept piece of the body, its vertices numbered anew.

    source   : (V,) vertex of the base mesh behind each vertex
    faces    : (F, 4), uv (F, 4, 2), material (F,) 0 skin, 1 mucosa
    """

    source: np.ndarray
    faces: np.ndarray
    uv: np.ndarray
    material: np.ndarray


def _cut_radius(v: np.ndarray) -> np.ndarray:
    """Elliptical distance from the middle of the neck; 1 on the cut."""
    below = np.minimum(v[:, 2] - CUT_HEIGHT, 0)
    return np.hypot(v[:, 0] / CUT_HALF_WIDTH, below / CUT_DEPTH)


def _in(uv: np.ndarray, box: tuple[tuple[float, float], tuple[float, float]]) -> np.ndarray:
    (u0, u1), (v0, v1) = box
    return (uv[:, 0] > u0) & (uv[:, 0] < u1) & (uv[:, 1] > v0) & (uv[:, 1] < v1)


def cut_bust(base: BaseMesh) -> Bust:
    body: Group = base.groups["body"]
    keep = (_cut_radius(base.vertices)[body.faces] < 1).any(axis=1)
    source, faces = np.unique(body.faces[keep], return_inverse=True)
    uv = body.uv[keep]
    centre = uv.mean(axis=1)
    mucosa = _in(centre, MOUTH_UV) | _in(centre, SOCKET_UV)
    return Bust(source, faces.reshape(-1, 4).astype(np.int32), uv, mucosa.astype(np.int32))


def round_edge(bust: Bust, base: BaseMesh) -> np.ndarray:
    """Displacement (V, 3) that draws the staircase of the cut edge onto the ellipse."""
    edges, _, count = edges_of(bust.faces)
    rim = np.unique(edges[count == 1])
    v = base.vertices[bust.source]
    shift = np.zeros_like(v)
    radius = _cut_radius(v[rim])[:, None]
    flat = np.stack([v[rim, 0], np.zeros(len(rim)), np.minimum(v[rim, 2] - CUT_HEIGHT, 0)], axis=-1)
    shift[rim] = flat * (1 / radius - 1)
    return shift
