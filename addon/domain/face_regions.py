"""Regions of a face that nobody painted, found from its shape keys.

Geometry alone does not say where a face has its mouth; what `mouthPucker` moves does. The places that keys move most are
landmarks (rigs/face_landmarks.toml). They carry the face into the frame of rigs/regions.toml, whose ellipsoids are then its
regions; lips lie round the line where a jaw that opens parts them.

The face may have any size and look anywhere: the landmarks say. Left and right are the face's own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from pydantic import Field

from .head.model import ShapeKey
from .head.regions import Region
from .head.surface import ScatterMean, smooth, smoothstep
from .resources import Row, read_table, rigs_path

Point = tuple[float, float, float]
Millimetres = Annotated[float, Field(gt=0.0)]

EYE_MM = (30.8, 0.0, 0.0)  # the middle of the left eyeball of the base mesh
# Distance of the pupils: 62 mm, all but a few adults within 10 of it (Dodgson 2004, Proc. SPIE 5291:36: 52 to 78 mm).
PUPILS_MM = 62.0
PUPILS_TOLERANCE_MM = 10.0
# What a mesh may be modelled in, as metres per unit.
UNITS = {"kilometres": 1e3, "metres": 1.0, "feet": 0.3048, "decimetres": 0.1, "inches": 0.0254, "centimetres": 0.01, "millimetres": 0.001}
_ASTRAY_MM = PUPILS_MM / 3  # a landmark farther off its place is another place: no face is longer or broader by so much
_BALL_MM = 11.5  # radius within which nothing is lid: an eyeball has 12
_STILL = 1e-4  # of the face's size: a key that moves less does not move
_EDGE_MM = 4.3  # of the base mesh, on which the smoothing steps of regions.toml are counted
_MOST_STEPS = 60
_PAINT = " (are left and right keys swapped?); paint vertex groups"
_PIXEL_MM = 2.0
_HEAD_MM = 280.0  # from between the eyes: what lies beyond is no region of a face
_SKIN_MM = 4.0  # behind what is seen: still the same skin, at a glancing angle
# Views from which skin is seen: yaw and pitch in degrees, 0 is the face's front.
_FRONT = [(0, 0), (35, 0), (-35, 0), (0, 40), (0, -40)]
_ROUND = _FRONT + [(yaw, 0) for yaw in (70, -70, 110, -110, 145, -145, 180)] + [(60, -40), (-60, -40)]


class Landmark(Row):
    keys: Annotated[tuple[str, ...], Field(min_length=1)]
    at_mm: Point
    trust_mm: Millimetres
    needed: bool = False


class Form(Row):
    at_mm: Point
    trust_mm: Millimetres


class Forms(Row):
    nose_tip: Form
    mouth_line: Form


class Lips(Row):
    outline: tuple[Point, ...]
    edge_mm: Millimetres
    depth_mm: Millimetres


class Ears(Row):
    ellipsoid: tuple[float, float, float, Millimetres, Millimetres, Millimetres]
    core: Annotated[float, Field(ge=0.0, lt=1.0)]
    stand_off_mm: Millimetres


class FaceTable(Row):
    """rigs/face_landmarks.toml"""

    landmark: dict[str, Landmark]
    form: Forms
    lips: Lips
    ears: Ears


TABLE: FaceTable = read_table(rigs_path("face_landmarks.toml"), FaceTable)


@dataclass(frozen=True)
class FoundRegions:
    """What was found.

    regions: id -> (V,) float32, 0 to 1, together at most 1; empty if nothing was. metres_per_unit: the unit of the mesh,
    1 if it is in metres as it should be. because: one line for the user.
    """

    regions: dict[str, np.ndarray]
    because: str
    metres_per_unit: float = 1.0
    landmarks: dict[str, np.ndarray] = field(default_factory=dict)


def find_regions(
    vertices: np.ndarray, triangles: np.ndarray, shape_keys: Mapping[str, ShapeKey], regions: tuple[Region, ...]
) -> FoundRegions:
    """The regions of a face by its shape keys.

    vertices : (V, 3) of the neutral face, in whatever unit. triangles : (T, 3) of vertices.
    shape_keys : ARKit name -> displacement at value 1. regions : those of rigs/regions.toml.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    triangles = np.asarray(triangles, dtype=np.int64)
    if not (len(vertices) and len(triangles) and np.isfinite(vertices).all()):
        return FoundRegions({}, "no regions: the mesh has no faces, or places that are not finite")
    area = _vertex_area(vertices, triangles)
    motion = {n: _first_motion(row, shape_keys, vertices) for n, row in TABLE.landmark.items()}
    missing = ["/".join(TABLE.landmark[n].keys) for n, moved in motion.items() if moved is None and TABLE.landmark[n].needed]
    if missing:
        return FoundRegions({}, f"no regions: no shape key {', '.join(missing)} that moves the face; paint vertex groups")
    motion = {name: moved for name, moved in motion.items() if moved is not None}

    # Keys move what nobody sees too, each sculptor's in a way of his own: the second time only skin counts.
    outer = area > 0
    for first in (True, False):
        places = {name: _landmark(moved, area * outer, vertices) for name, moved in motion.items()}
        (scale, turn, shift), astray = _frame(places)
        for name in astray:
            if TABLE.landmark[name].needed:
                key = TABLE.landmark[name].keys[0]
                return FoundRegions({}, f"no regions: {key} does not act where a face has it{_PAINT}")
        if astray:  # somebody means something else by these keys
            motion = {name: moved for name, moved in motion.items() if name not in astray}
            places = {name: places[name] for name in motion}
            (scale, turn, shift), _ = _frame(places)
        frame = scale * vertices @ turn.T + shift
        if first:
            outer = _outer(frame, triangles, _FRONT)

    rows = [TABLE.landmark[name] for name in motion]
    placed = scale * np.array(list(places.values())) @ turn.T + shift
    form = _form_landmarks(frame, outer, motion["jaw"])
    if "nose_tip" not in form or np.linalg.norm(form["nose_tip"][0] - TABLE.form.nose_tip.at_mm) > _ASTRAY_MM:
        return FoundRegions({}, f"no regions: no nose between eyes and mouth{_PAINT}")
    placed = np.concatenate([placed, [place for place, _ in form.values()]])
    rows = [*rows, *(row for _, row in form.values())]
    target = np.array([row.at_mm for row in rows])
    trust = np.array([row.trust_mm for row in rows])
    mm = frame + _warp(placed, target - placed, trust, frame)

    found = _weights(mm, triangles, _outer(mm, triangles, _ROUND), regions)
    back = {name: (place - shift) @ turn / scale for name, place in zip([*motion, *form], placed, strict=True)}
    return FoundRegions(found, *_said(found, len(placed), scale, turn), back)


def _said(found: Mapping[str, np.ndarray], landmarks: int, scale: float, turn: np.ndarray) -> tuple[str, float]:
    """The line for the user, and metres per unit."""
    text = f"regions found from shape keys: {', '.join(found)} ({landmarks} landmarks)"
    unit, pupils = 1.0, 2 * EYE_MM[0] * 1000.0 / scale
    if abs(pupils - PUPILS_MM) > PUPILS_TOLERANCE_MM:
        name, unit = min(UNITS.items(), key=lambda item: abs(np.log(item[1] * pupils / PUPILS_MM)))
        if abs(unit * pupils - PUPILS_MM) > PUPILS_TOLERANCE_MM:
            name, unit = "no usual unit", float(f"{PUPILS_MM / pupils:.3g}")
        text += f"; the eyes are {pupils:.3g} mm apart: modelled in {name}, scale the face by {unit:g}"
    angle = np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
    if angle > 20:
        text += f"; the face is turned by {angle:.0f} degrees: Sanguine takes -Y for its front and Z for up"
    return text, unit


def _vertex_area(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(V,) so that a densely meshed lid counts no more than a coarse cheek."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    third = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6
    return sum(np.bincount(triangles[:, k], third, minlength=len(vertices)) for k in range(3))


def _motion(key: ShapeKey, count: int) -> np.ndarray:
    """(V,) length of the displacement."""
    moved = np.zeros(count)
    moved[key.indices] = np.linalg.norm(key.delta, axis=1)
    return moved


def _first_motion(row: Landmark, shape_keys: Mapping[str, ShapeKey], vertices: np.ndarray) -> np.ndarray | None:
    """(V,) motion of the first key of the row that moves anything."""
    for name in row.keys:
        if name in shape_keys:
            moved = _motion(shape_keys[name], len(vertices))
            if np.isfinite(moved).all() and moved.max() > _STILL * np.ptp(vertices, axis=0).max():
                return moved
    return None


def _landmark(moved: np.ndarray, area: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """(3,) the middle of what a key moves."""
    weight = area * (moved / moved.max()) ** 4
    return weight @ vertices / max(weight.sum(), 1e-300)


def _frame(places: Mapping[str, np.ndarray]) -> tuple[tuple[float, np.ndarray, np.ndarray], list[str]]:
    """The similarity that takes landmarks to their places on the base mesh, and those that stay far from theirs."""
    rows = [TABLE.landmark[name] for name in places]
    source, target = np.array(list(places.values())), np.array([row.at_mm for row in rows])
    scale, turn, shift = _similarity(source, target, np.array([row.trust_mm for row in rows]) ** -2.0)
    off = np.linalg.norm(scale * source @ turn.T + shift - target, axis=1)
    return (scale, turn, shift), [name for name, far in zip(places, off > _ASTRAY_MM, strict=True) if far]


def _similarity(source: np.ndarray, target: np.ndarray, weight: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Scale, rotation (3, 3) and shift that take `source` (N, 3) nearest to `target`: Umeyama 1991, PAMI 13:376."""
    weight = weight / weight.sum()
    middle, aim = weight @ source, weight @ target
    a, b = source - middle, target - aim
    u, s, vt = np.linalg.svd((weight[:, None] * b).T @ a)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    turn = u * signs @ vt
    scale = float(s @ signs / (weight @ (a**2).sum(axis=1)))
    return scale, turn, aim - scale * turn @ middle


def _form_landmarks(frame: np.ndarray, outer: np.ndarray, jaw: np.ndarray) -> dict[str, tuple[np.ndarray, Form]]:
    """Tip of the nose and the line between the lips, on the roughly placed face."""
    found = {}
    x, y, z = frame.T
    nose = np.flatnonzero(outer & (np.abs(x) < 12) & (z < -15) & (z > -55))
    if len(nose):
        found["nose_tip"] = frame[nose[y[nose].argmin()]], TABLE.form.nose_tip
    # Upper lips rest while the jaw opens, lower ones go nearly as far as the chin.
    lips = (np.abs(x) < 35) & (np.abs(z - TABLE.form.mouth_line.at_mm[2]) < 14) & (y < y[nose].min() + 40 if len(nose) else y < 0)
    level = np.quantile(jaw[lips], 0.95) if lips.any() else 0.0
    if level > 0:
        upper, lower = lips & (jaw < 0.3 * level), lips & (jaw > 0.7 * level)
        middle = _parting(frame, upper, lower, 6.0, 4.0)
        if middle is not None:
            found["mouth_line"] = middle, TABLE.form.mouth_line
    return found


def _parting(frame: np.ndarray, upper: np.ndarray, lower: np.ndarray, half_width: float, depth: float) -> np.ndarray | None:
    """The point between upper and lower lip in the middle: lowest of the one, highest of the other, as seen from the front."""
    sides = []
    for side, lowest in ((upper, True), (lower, False)):
        near = np.flatnonzero(side & (np.abs(frame[:, 0]) < half_width))
        if not len(near):
            return None
        front = near[frame[near, 1] < frame[near, 1].min() + depth]
        height = frame[front, 2]
        sides.append(frame[front[height.argmin() if lowest else height.argmax()]])
    return np.array([0.0, *np.mean(sides, axis=0)[1:]])


def _warp(at: np.ndarray, by: np.ndarray, trust: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Displacement (V, 3) of points that follows `by` (N, 3) at `at` as far as it is trusted: a Gaussian process.

    Its prior: faces differ by 10 mm over distances of 60 mm, and by 10 % in width, depth and height.
    """

    def kernel(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        apart = ((a[:, None] - b[None]) ** 2).sum(axis=-1)
        return 100.0 * np.exp(-apart / (2 * 60.0**2)) + 0.01 * a @ b.T

    weights = np.linalg.solve(kernel(at, at) + np.diag(trust**2), by)
    return kernel(points, at) @ weights


def _outer(mm: np.ndarray, triangles: np.ndarray, views: list[tuple[int, int]]) -> np.ndarray:
    """(V,) bool: skin that can be seen from outside, not the mouth's bag nor what lies behind the eyeballs."""
    near = np.linalg.norm(mm, axis=1) < _HEAD_MM
    triangles = triangles[near[triangles].all(axis=1)]
    points = _spread(mm, triangles, _PIXEL_MM / 2)
    balls = np.concatenate([np.array([side * EYE_MM[0], *EYE_MM[1:]]) + _BALL_MM * _sphere(2000) for side in (-1, 1)])
    outer = np.zeros(len(mm), bool)
    for yaw, pitch in np.radians(views):
        forward = np.array([np.sin(yaw) * np.cos(pitch), -np.cos(yaw) * np.cos(pitch), np.sin(pitch)])  # to the eye
        right = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        axes = np.stack([right, np.cross(right, -forward), forward], axis=1)
        cover = np.concatenate([points, balls]) @ axes
        low = cover[:, :2].min(axis=0)
        columns = int((cover[:, 0].max() - low[0]) / _PIXEL_MM) + 1
        rows = int((cover[:, 1].max() - low[1]) / _PIXEL_MM) + 1
        nearest = np.full(rows * columns, -np.inf)
        where = ((cover[:, :2] - low) / _PIXEL_MM).astype(np.int64)
        np.maximum.at(nearest, where[:, 1] * columns + where[:, 0], cover[:, 2])
        own = mm @ axes
        where = np.clip(((own[:, :2] - low) / _PIXEL_MM).astype(np.int64), 0, [columns - 1, rows - 1])
        outer |= own[:, 2] > nearest[where[:, 1] * columns + where[:, 0]] - _SKIN_MM
    outer &= np.isin(np.arange(len(mm)), triangles)  # neither loose vertices nor a body
    for side in (-1, 1):
        outer &= np.linalg.norm(mm - np.array([side * EYE_MM[0], *EYE_MM[1:]]), axis=1) > _BALL_MM
    return outer


def _spread(mm: np.ndarray, triangles: np.ndarray, spacing_mm: float) -> np.ndarray:
    """Points all over the triangles and their vertices, one per spacing^2 of area."""
    a, b, c = (mm[triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    count = np.minimum(area / spacing_mm**2, 10_000).astype(np.int64)
    of = np.repeat(np.arange(len(triangles)), count)
    # The plastic number's sequence (Roberts 2018) fills the square, folded to the triangle.
    index = np.arange(len(of)) + 0.5
    u, v = (index * 0.7548776662466927) % 1, (index * 0.5698402909980532) % 1
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    inner = a[of] + u[:, None] * (b - a)[of] + v[:, None] * (c - a)[of]
    return np.concatenate([mm[np.unique(triangles)], inner])


def _sphere(count: int) -> np.ndarray:
    """(count, 3) points of the unit sphere, by Fibonacci's lattice."""
    k = np.arange(count) + 0.5
    height, turn = 1 - 2 * k / count, k * np.pi * (1 + 5**0.5)
    ring = np.sqrt(1 - height**2)
    return np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=1)


def _weights(mm: np.ndarray, triangles: np.ndarray, outer: np.ndarray, regions: tuple[Region, ...]) -> dict[str, np.ndarray]:
    """Region id -> (V,) float32, as head/regions.py paints them on the base mesh."""
    place = np.stack([np.abs(mm[:, 0]), mm[:, 1], mm[:, 2]], axis=1)
    edges = np.linalg.norm(mm[triangles] - mm[np.roll(triangles, -1, axis=1)], axis=-1)[outer[triangles].all(axis=1)]
    finer = (_EDGE_MM / max(float(np.median(edges)) if len(edges) else _EDGE_MM, 0.3)) ** 2
    left, found = np.ones(len(mm)), {}
    for region in regions:
        if region.mask == "lips":
            w = _lips(place)
        elif region.mask == "ears":
            w = _ears(place, outer)
        elif region.ellipsoids:
            w = np.max([_ellipsoid(place, row, region.core) for row in region.ellipsoids], axis=0)
        else:
            continue
        steps = 0 if region.mask else min(max(round(region.smooth * finer), 1 if region.smooth else 0), _MOST_STEPS)
        w = smooth(w * 1.0, triangles, steps) * left
        w[~outer] = 0
        w = np.clip(w, 0, 1)
        if w.max() > 0.5:  # else the mesh ends before it (a mask without a neck), or there is none
            found[region.id] = w.astype(np.float32)
            left = left - found[region.id]
    return found


def _ellipsoid(place: np.ndarray, row: tuple[float, ...], core: float) -> np.ndarray:
    return 1 - smoothstep(core, 1, np.linalg.norm((place - row[:3]) / np.array(row[3:]), axis=1))


def _ears(place: np.ndarray, outer: np.ndarray) -> np.ndarray:
    w = _ellipsoid(place, TABLE.ears.ellipsoid, TABLE.ears.core)
    across = place[outer & (w > 0.5), 0]
    if not len(across) or np.ptp(np.quantile(across, [0.02, 0.98])) < TABLE.ears.stand_off_mm:
        return np.zeros(len(place))
    return w


def _lips(place: np.ndarray) -> np.ndarray:
    x, above, below = np.array(TABLE.lips.outline).T
    line = TABLE.form.mouth_line.at_mm
    height = place[:, 2] - line[2]
    rim = np.where(height > 0, np.interp(place[:, 0], x, above), np.interp(place[:, 0], x, below))
    inside = rim - np.abs(height)
    w = smoothstep(-TABLE.lips.edge_mm / 2, TABLE.lips.edge_mm / 2, inside)
    w = w * (place[:, 0] < x[-1])
    return w * (place[:, 1] < line[1] + TABLE.lips.depth_mm)
