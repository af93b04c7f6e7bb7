"""Brows, lashes and the tear line: fine tubes rooted on the skin, so that every shape key carries them."""

from __future__ import annotations

import numpy as np

from .presets import Brows
from .surface import Binding, locate, triangles, unit

SIDES = 3  # of a hair's tube: it is under a pixel wide

# The brow, drawn once on the unshaped base mesh, left side, seen from the front: fraction along the brow,
# x from the midline, z above the middle of the eye, half height; mm.
BROW = np.array(
    [
        [0.00, 12.5, 15.5, 2.6],
        [0.15, 17.5, 17.0, 4.0],
        [0.40, 28.0, 19.8, 4.0],
        [0.65, 40.0, 22.0, 3.1],
        [0.85, 49.0, 20.5, 1.9],
        [1.00, 55.0, 17.0, 0.6],
    ]
)
# Direction of the hairs, degrees from "outward along the brow" to "up", at the lower and the upper rim.
BROW_LEAN = np.array([[0.0, 78, 62], [0.12, 60, 38], [0.3, 42, 12], [0.6, 22, -14], [1.0, 6, -8]])


def tubes(
    spine: np.ndarray, offset_from: np.ndarray, radius: np.ndarray, sides: int = SIDES
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tubes around strands: spine (N, K, 3), a direction off the strand (N, K, 3), radius (N, K).

    Returns vertices (N*K*sides, 3), quads, and for each vertex its row in the flattened spine, by which any
    displacement of the spine becomes one of the tube.
    """
    n, k, _ = spine.shape
    tangent = unit(np.gradient(spine, axis=1))
    side = unit(np.cross(tangent, offset_from))
    up = np.cross(side, tangent)
    turn = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.cos(turn)[:, None] * side[:, :, None] + np.sin(turn)[:, None] * up[:, :, None]
    vertices = spine[:, :, None] + radius[:, :, None, None] * ring
    here = np.arange(sides)
    there = np.roll(here, -1)
    row = (np.arange(n)[:, None, None] * k + np.arange(k - 1)[:, None]) * sides
    quads = np.stack([row + here, row + there, row + sides + there, row + sides + here], axis=-1)
    owner = np.repeat(np.arange(n * k), sides)
    return vertices.reshape(-1, 3).astype(np.float32), quads.reshape(-1, 4).astype(np.int32), owner


def brow_binding(
    brows: Brows,
    side: float,
    eye: np.ndarray,
    base: np.ndarray,
    faces: np.ndarray,
    rng: np.random.Generator,
    points: int = 6,
) -> tuple[Binding, np.ndarray]:
    """Strands of one brow tied to the surface: a binding of N*points rows, and the height of each over the skin, m.

    side        : +1 left, -1 right
    base, faces : the refined skin, unshaped, so that one drawing of the brow fits every face
    eye         : middle of this eye on the unshaped mesh
    """
    n = brows.count
    # More hairs where the brow is higher; a sparse inner end, a dense tail.
    fine = np.linspace(0, 1, 201)
    share = np.interp(fine, BROW[:, 0], BROW[:, 3] * [0.7, 1, 1, 1.1, 1.3, 1.3])
    t = np.interp(rng.random(n), np.cumsum(share) / share.sum(), fine)
    across = np.clip(rng.normal(0, 0.6, n), -1.35, 1.35)  # thinner toward the rims, with a few strays
    line = [np.interp(t, BROW[:, 0], BROW[:, c]) for c in (1, 2, 3)]
    x, z, half = line[0], line[1] + brows.lift_mm, line[2] * brows.thickness
    slope = np.interp(t, BROW[:, 0], np.degrees(np.arctan2(np.gradient(BROW[:, 2]), np.gradient(BROW[:, 1]))))
    low, high = (np.interp(t, BROW_LEAN[:, 0], BROW_LEAN[:, c]) for c in (1, 2))
    lean = np.radians(slope + low + (high - low) * (across + 1) / 2 + rng.normal(0, 11, n))
    bend = np.radians(rng.normal(-16, 8, n)) * np.where(t < 0.5, 1, 0.6)  # tips turn outward
    length = brows.length_mm * np.interp(t, [0, 0.2, 0.6, 1], [0.6, 1, 0.95, 0.6]) * rng.uniform(0.5, 1.1, n)
    s = np.linspace(0, 1, points)
    angle = lean[:, None] + bend[:, None] * s
    step = length[:, None] / (points - 1)
    px = x[:, None] + np.c_[np.zeros(n), np.cumsum(np.cos(angle[:, :-1]) * step, axis=1)]
    pz = (z + across * half)[:, None] + np.c_[np.zeros(n), np.cumsum(np.sin(angle[:, :-1]) * step, axis=1)]
    flat = np.stack([side * px, pz], axis=-1).reshape(-1, 2) * 1e-3 + [0, eye[2]]
    centre = base[faces].mean(axis=1)
    low_corner, high_corner = flat.min(axis=0) - 0.004, flat.max(axis=0) + 0.004
    front = centre[:, [0, 2]]
    near = ((front > low_corner) & (front < high_corner)).all(axis=1) & (centre[:, 1] < eye[1] + 0.02)
    height = np.sin(np.pi * np.clip(s * 0.75, 0, 1)) * 0.55 + rng.uniform(-0.1, 0.25, (n, 1)) * s
    height = (height + 0.05 - 0.15 * (s == 0)) * 1e-3
    return locate(flat, base[:, [0, 2]], triangles(faces[near])), height.ravel()


def grid_of(faces: np.ndarray) -> np.ndarray:
    """The vertex grid (rows, columns) of a patch of quads with four corners."""
    across = {(int(q[i]), int(q[(i + 1) % 4])): np.roll(q, -i) for q in faces for i in range(4)}
    corner = np.nonzero(np.bincount(faces.ravel()) == 1)[0][0]
    quad = next(np.roll(q, -i) for q in faces for i in range(4) if q[i] == corner)
    rows = []
    while quad is not None:
        first, top, bottom, cell = quad, [quad[0]], [quad[3]], quad
        while cell is not None:
            top.append(cell[1])
            bottom.append(cell[2])
            # The neighbour beyond a side runs through it the other way; turn it so that its first corner is ours.
            cell = across.get((int(cell[2]), int(cell[1])))
            cell = None if cell is None else np.roll(cell, -1)
        rows.append(top)
        quad = across.get((int(first[3]), int(first[2])))
    return np.array([*rows, bottom])


def lash_binding(
    card: np.ndarray,
    eye: np.ndarray,
    base: np.ndarray,
    count: int,
    reach: float,
    rng: np.random.Generator,
    points: int = 6,
) -> Binding:
    """Single lashes laid in a lash card of the base mesh (quads), up to `reach` times as long: count*points rows."""
    grid = grid_of(card)
    if grid.shape[0] > grid.shape[1]:
        grid = grid.T
    from_eye = np.linalg.norm(base[grid] - eye, axis=-1).mean(axis=1)
    if from_eye[0] > from_eye[-1]:
        grid = grid[::-1]
    rows, columns = grid.shape
    # Lashes stand in loose tufts whose tips meet. They grow past the card's tip, straight on (row fraction above 1).
    s0 = np.sort(rng.uniform(0.07, 0.93, count))
    tuft = np.round(s0 * 16 + rng.normal(0, 0.25, count)) / 16
    length = reach * rng.uniform(0.65, 1.0, count) * (0.7 + 0.3 * np.sin(np.pi * s0))
    v = np.linspace(0, 1, points)
    along = s0[:, None] + (tuft - s0)[:, None] * 0.45 * v**1.5 + rng.normal(0, 0.012, count)[:, None] * v
    out = length[:, None] * v
    column = np.clip(along * (columns - 1), 0, columns - 1.001).ravel()
    row = (out * (rows - 1)).ravel()
    c, r = column.astype(int), np.minimum(row.astype(int), rows - 2)
    fc, fr = column - c, row - r
    index = np.stack([grid[r, c], grid[r, c + 1], grid[r + 1, c], grid[r + 1, c + 1]], axis=-1)
    weight = np.stack([(1 - fr) * (1 - fc), (1 - fr) * fc, fr * (1 - fc), fr * fc], axis=-1)
    return Binding(index, weight)


def tear_binding(
    vertices: np.ndarray, edges: np.ndarray, centre: np.ndarray, globe_m: float, points: int = 60
) -> Binding:
    """The line where the lids touch the globe, as a closed loop of `points` bound to skin edges (two weights each).

    vertices, edges : the refined skin. An edge that passes through the globe's surface gives one point; in each of
    `points` directions about the optical axis the foremost is taken, the visible one.
    """
    near = (np.linalg.norm(vertices - centre, axis=1) < globe_m * 1.35) & (vertices[:, 1] < centre[1] - globe_m * 0.2)
    edges = edges[near[edges].all(axis=1)]
    distance = np.linalg.norm(vertices - centre, axis=1) - globe_m
    a, b = distance[edges].T
    edges, a, b = (column[a * b < 0] for column in (edges, a, b))
    weight = np.stack([b, -a], axis=-1) / (b - a)[:, None]
    place = np.einsum("nk,nkc->nc", weight, vertices[edges]) - centre
    angle = np.arctan2(place[:, 2] * 2.2, place[:, 0])  # the opening is about 2.2 times as wide as high
    bin_ = ((angle + np.pi) / (2 * np.pi) * points).astype(int) % points
    order = np.lexsort((place[:, 1], bin_))
    first = order[np.unique(bin_[order], return_index=True)[1]]
    loop = np.r_[first, first[:1]]
    return Binding(edges[loop], weight[loop])
