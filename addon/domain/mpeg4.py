"""MPEG-4 face animation: feature points (FDP) of a head, its units of measure (FAPU), and parameters (FAP) from and to
shape keys and action units.

A FAP says how far a feature point goes, in 1024ths of a distance of the same face. How far our keys move these points
is measured on a head (`measure_travel`); with that, keys become FAP by a sum, and FAP become keys by bounded least
squares.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from .errors import InputError, nearest
from .facs import ACTION_UNITS, ARKIT, EMOTION_CONTROLS, KNOWN_KEYS, shape_key_values, side_of
from .head.bust import cut_bust
from .head.eyes import fit_sphere
from .head.model import Head, MeshPart
from .head.package import HeadPackage
from .resources import Row, read_rows, read_table, rigs_path

STEPS = 1024.0  # a FAP of 1024 is one FAPU
AU_RAD = 1e-5  # the unit of angles, per step
MOST_INTENSITY = 63.0  # of FAP 2

# Blender's axes: x to the face's left, face toward -Y. Ways without a direction in space are not measured.
_WAYS = {"up": (0, 0, 1), "down": (0, 0, -1), "left": (1, 0, 0), "right": (-1, 0, 0), "forward": (0, -1, 0)}
_AXES = {"x": 0, "z": 2}
_PUPIL_RING = 48  # vertices of the pupil's rim, the first of each eyeball
_TONGUE_MIDDLE = 0.5
_HAIRLINE_VERTICES = 5
_COLUMN_M = 0.005  # a rule that looks at the midline sees this far to both sides
_LEAST_SQUARES_ROUNDS = 400
# Keys that say the same (a smile and a dimple) share what a FAP asks: this much weight, relative to the strongest key,
# on small values. Small enough to change a FAP by less than a step in a hundred.
_RIDGE = 1e-4
# Of a FAP's range: what the face can do of it counts as this much at least, lest the noise of still points count.
_LEAST_SHARE = 0.05
_BLINKS = ("45", "46")  # the shape of 43, told apart by time and side


class Point(Row):
    """One feature point: a place on the skin, the mirror image of another point, or a rule."""

    name: str
    at_mm: tuple[float, float, float] | None = None
    mirror: str | None = None
    rule: str | None = None


class Measure(Row):
    """One FAPU: the distance of two points along an axis."""

    from_: Annotated[str, Field(alias="from")]
    to: str
    axis: Literal["x", "z"]
    name: str


class Fap(Row):
    number: Annotated[int, Field(ge=3, le=68)]
    unit: str
    way: str
    point: str
    range: tuple[int, int]


class Expression(Row):
    number: Annotated[int, Field(ge=1, le=6)]
    emotion: str


class Table(Row):
    """rigs/mpeg4.toml"""

    source: str
    points: dict[str, Point]
    fapu: dict[str, Measure]
    faps: dict[str, Fap]
    expressions: dict[str, Expression]


class TravelRow(Row):
    """One line of rigs/mpeg4_travel.csv: what a key at 1 is as a FAP, on the two example heads."""

    fap: str
    key: str
    female: float
    male: float


def read_mpeg4(path: Path) -> Table:
    """Raises InputError, one line, for a point, unit, way or emotion that is not there, or a number given twice."""
    table = read_table(path, Table)
    for name, point in table.points.items():
        if sum(given is not None for given in (point.at_mm, point.mirror, point.rule)) != 1:
            raise InputError(f"{path}: points.{name}: needs one of at_mm, mirror, rule")
        if point.mirror is not None:
            _check(point.mirror, table.points, f"{path}: points.{name}.mirror", "point")
            if table.points[point.mirror].at_mm is None:
                raise InputError(f"{path}: points.{name}.mirror: {point.mirror} has no at_mm")
        if point.rule is not None:
            _check(point.rule, _RULES, f"{path}: points.{name}.rule", "rule")
    for name, measure in table.fapu.items():
        for end in (measure.from_, measure.to):
            _check(end, table.points, f"{path}: fapu.{name}", "point")
    numbers: set[int] = set()
    for name, fap in table.faps.items():
        _check(fap.point, table.points, f"{path}: faps.{name}.point", "point")
        _check(fap.unit, (*table.fapu, "AU"), f"{path}: faps.{name}.unit", "unit")
        _check(fap.way, (*_WAYS, "growing", "rolling", "turning"), f"{path}: faps.{name}.way", "way")
        if fap.number in numbers:
            raise InputError(f"{path}: faps.{name}.number: {fap.number} is there twice")
        numbers.add(fap.number)
    for name, expression in table.expressions.items():
        _check(expression.emotion, EMOTION_CONTROLS, f"{path}: expressions.{name}", "emotion")
    return table


def _check(name: str, known, where: str, kind: str) -> None:
    if name not in known:
        raise InputError(f"{where}: {name}: no such {kind}, {nearest(name, known)}")


def _midline(part: MeshPart, index: np.ndarray | None = None) -> np.ndarray:
    v = part.vertices if index is None else part.vertices[index]
    return v[np.abs(v[:, 0]) < _COLUMN_M]


def _pupil(head: Head, side: str) -> np.ndarray:
    eyes = head.part("eyes").vertices
    first = 0 if side == "left" else len(eyes) // 2
    return eyes[first : first + _PUPIL_RING].mean(axis=0)


def _tooth(head: Head, upper: bool, top: bool) -> np.ndarray:
    """Of the front teeth: the lower ones are those that the jaw takes along."""
    teeth = head.part("teeth")
    crowns = np.unique(teeth.faces[teeth.material == teeth.slots.index("teeth")])
    lower = np.isin(crowns, teeth.shape_keys["jawOpen"].indices)
    front = _midline(teeth, crowns[~lower] if upper else crowns[lower])
    return front[front[:, 2].argmax() if top else front[:, 2].argmin()]


def _tongue(head: Head, place: str) -> np.ndarray:
    v = head.part("tongue").vertices
    if place == "tip":
        return v[v[:, 1].argmin()]
    middle = v[np.abs(v[:, 1] - (v[:, 1].min() + _TONGUE_MIDDLE * np.ptp(v[:, 1]))) < 2 * _COLUMN_M]
    if place == "middle":
        middle = middle[np.abs(middle[:, 0]) < _COLUMN_M]
        return middle[middle[:, 2].argmax()]
    return middle[middle[:, 0].argmax() if place == "left" else middle[:, 0].argmin()]


def _hairline(head: Head, x: float) -> np.ndarray:
    """The most forward point of the scalp's hair in a column."""
    v = head.part("undercoat").vertices
    column = v[(np.abs(v[:, 0] - x) < _COLUMN_M) & (v[:, 2] > head.landmarks["eyes"][2])]
    return column[np.argsort(column[:, 1], kind="stable")[:_HAIRLINE_VERTICES]].mean(axis=0)


def _highest_hair(head: Head) -> np.ndarray:
    """Over the top of the skull; on it where the hair lies flat."""
    skull, points = _skull(head, "top"), head.hair.points.reshape(-1, 3)
    over = points[np.hypot(*(points[:, :2] - skull[:2]).T) < 2 * _COLUMN_M]
    return np.array([*skull[:2], over[:, 2].max(initial=skull[2])])


def _skull(head: Head, place: str) -> np.ndarray:
    middle = _midline(head.part("skin"))
    if place == "top":
        return middle[middle[:, 2].argmax()]
    middle = middle[middle[:, 2] > head.landmarks["eyes"][2] - 0.02]  # above the nape
    return middle[middle[:, 1].argmax()]


# The skull turns on the atlas between the mastoids, behind the lobes of the ears: their middle, at the height between
# lobe and upper end of the ear's root. A rule of thumb.
def _spine(points: Mapping[str, np.ndarray]) -> np.ndarray:
    return np.mean([points[name] for name in ("10.7", "10.8", "10.9", "10.10")], axis=0)


_RULES = {
    "pupil_left": lambda head, points: _pupil(head, "left"),
    "pupil_right": lambda head, points: _pupil(head, "right"),
    "tongue_tip": lambda head, points: _tongue(head, "tip"),
    "tongue_middle": lambda head, points: _tongue(head, "middle"),
    "tongue_left": lambda head, points: _tongue(head, "left"),
    "tongue_right": lambda head, points: _tongue(head, "right"),
    "spine": lambda head, points: _spine(points),
    "upper_teeth_top": lambda head, points: _tooth(head, upper=True, top=True),
    "upper_teeth_bottom": lambda head, points: _tooth(head, upper=True, top=False),
    "lower_teeth_top": lambda head, points: _tooth(head, upper=False, top=True),
    "lower_teeth_bottom": lambda head, points: _tooth(head, upper=False, top=False),
    "hairline_middle": lambda head, points: _hairline(head, 0.0),
    "hairline_left": lambda head, points: _hairline(head, points["4.5"][0]),
    "hairline_right": lambda head, points: _hairline(head, points["4.6"][0]),
    "hair_top": lambda head, points: _highest_hair(head),
    "skull_top": lambda head, points: _skull(head, "top"),
    "skull_back": lambda head, points: _skull(head, "back"),
}

TABLE: Table = read_mpeg4(rigs_path("mpeg4.toml"))


@functools.cache
def _skin_vertices() -> dict[str, int]:
    """Point -> vertex of the bust's skin; the same on every head of the package."""
    base = HeadPackage().base_mesh()
    bust = cut_bust(base)
    outside = np.unique(bust.faces[bust.material == 0])  # not inside the mouth
    places = base.vertices[bust.source][outside]
    found = {}
    for name, point in TABLE.points.items():
        at = point.at_mm or (TABLE.points[point.mirror].at_mm if point.mirror else None)
        if at is not None:
            place = np.array(at) * [-1 if point.mirror else 1, 1, 1] / 1e3
            found[name] = int(outside[np.linalg.norm(places - place, axis=1).argmin()])
    return found


def fdp_points(head: Head) -> dict[str, np.ndarray]:
    """The 84 feature points of a head: "group.number" -> (3,) metres, in the order of the table."""
    skin = head.part("skin").vertices
    points = {name: skin[vertex].astype(np.float64) for name, vertex in _skin_vertices().items()}
    for name, point in TABLE.points.items():
        if point.rule is not None:
            points[name] = np.asarray(_RULES[point.rule](head, points), dtype=np.float64)
    return {name: points[name] for name in TABLE.points}


def fapu_mm(points: Mapping[str, np.ndarray]) -> dict[str, float]:
    """ES0, IRISD0, ENS0, MNS0, MW0 in mm from feature points in metres. Raises InputError for a face where one is not
    above 0."""
    found = {}
    for name, measure in TABLE.fapu.items():
        axis = _AXES[measure.axis]
        found[name] = float(points[measure.to][axis] - points[measure.from_][axis]) * 1e3
        if not found[name] > 0.0:
            between = f"between points {measure.from_} and {measure.to}"
            raise InputError(f"{name}: {found[name]:.3g} mm {between}, has to be above 0")
    return found


def fap_to_mm(values: Mapping[str, float], fapu: Mapping[str, float]) -> dict[str, float]:
    """How far (mm; radians for angles) these FAP move their points on a face with these FAPU (mm)."""
    return {name: value * _step(name, fapu) for name, value in _checked(values).items()}


def mm_to_fap(moves: Mapping[str, float], fapu: Mapping[str, float]) -> dict[str, float]:
    """The other way round: what was measured on one face, for any face."""
    return {name: move / _step(name, fapu) for name, move in _checked(moves).items()}


def _step(name: str, fapu: Mapping[str, float]) -> float:
    unit = TABLE.faps[name].unit
    return AU_RAD if unit == "AU" else fapu[unit] / STEPS


def _checked(values: Mapping[str, float]) -> dict[str, float]:
    for name, value in values.items():
        if name not in TABLE.faps:
            raise InputError(f"{name}: no such FAP, {nearest(name, TABLE.faps)}")
        if not np.isfinite(value):
            raise InputError(f"{name}: {value} is not a number that a FAP can be")
    return dict(values)


@dataclass(frozen=True)
class Travel:
    """What each shape key at 1 is as FAP: ARKit's and our own.

    faps : names of the rows, those that keys can move; keys : names of the columns
    steps: (rows, columns) FAP values
    """

    faps: tuple[str, ...]
    keys: tuple[str, ...]
    steps: np.ndarray


def measure_travel(head: Head) -> Travel:
    """Travel of the head's feature points under its own shape keys, in its own FAPU."""
    points, vertices = fdp_points(head), _skin_vertices()
    fapu = fapu_mm(points)
    faps = tuple(name for name, fap in TABLE.faps.items() if fap.way in _WAYS)
    steps = np.zeros((len(faps), len(KNOWN_KEYS)))
    for row, name in zip(steps, faps):
        fap = TABLE.faps[name]
        way = np.array(_WAYS[fap.way], dtype=float)
        for column, key in enumerate(KNOWN_KEYS):
            if fap.unit == "AU":
                row[column] = _turn(head, fap.point, way, key) / AU_RAD
            else:
                part = {"6": "tongue", "3": "eyes"}.get(fap.point[0], "skin") if fap.point not in vertices else "skin"
                vertex = vertices.get(fap.point)
                move = _move(head.part(part), key, points[fap.point] if vertex is None else vertex)
                row[column] = move @ way * 1e3 / _step(name, fapu)
    return Travel(faps, KNOWN_KEYS, steps)


def _move(part: MeshPart, key: str, where: int | np.ndarray) -> np.ndarray:
    """(3,) metres by which a key at 1 moves a vertex, or the vertex nearest to a place."""
    vertex = where if isinstance(where, int) else int(np.linalg.norm(part.vertices - where, axis=1).argmin())
    if (moved := part.shape_keys.get(key)) is None:
        return np.zeros(3)
    at = np.searchsorted(moved.indices, vertex)
    return moved.delta[at].astype(float) if at < len(moved.indices) and moved.indices[at] == vertex else np.zeros(3)


def _turn(head: Head, point: str, way: np.ndarray, key: str) -> float:
    """Radians by which a key at 1 turns an eye toward `way`."""
    eyes = head.part("eyes")
    half = len(eyes.vertices) // 2
    own = slice(0, half) if TABLE.points[point].rule == "pupil_left" else slice(half, None)
    centre, _ = fit_sphere(eyes.vertices[own])
    moved = eyes.vertices.astype(float)
    if shape := eyes.shape_keys.get(key):
        moved[shape.indices] += shape.delta
    ring = slice(own.start, own.start + _PUPIL_RING)
    before, after = (v[ring].mean(axis=0) - centre for v in (eyes.vertices.astype(float), moved))
    forward = np.array([0.0, -1.0, 0.0])
    return float(np.arctan2(after @ way, after @ forward) - np.arctan2(before @ way, before @ forward))


@functools.cache
def example_travel() -> Travel:
    """The mean of the two example heads (rigs/mpeg4_travel.csv): for rigs that cannot be measured. FAPU make it fit any
    face whose keys are ARKit's."""
    rows = read_rows(rigs_path("mpeg4_travel.csv"), TravelRow)
    faps = tuple(name for name, fap in TABLE.faps.items() if fap.way in _WAYS)
    steps = np.zeros((len(faps), len(KNOWN_KEYS)))
    for row in rows:
        steps[faps.index(row.fap), KNOWN_KEYS.index(row.key)] = (row.female + row.male) / 2
    return Travel(faps, KNOWN_KEYS, steps)


def keys_to_fap(keys: Mapping[str, float], travel: Travel | None = None) -> dict[str, float]:
    """FAP values for shape key values, where they are not 0; within the range of each FAP."""
    travel = travel or example_travel()
    for name in keys:
        _check(name, travel.keys, "keys", "shape key")
    values = travel.steps @ [keys.get(name, 0.0) for name in travel.keys]
    found = {}
    for name, value in zip(travel.faps, values):
        low, high = TABLE.faps[name].range
        if value := float(np.clip(value, low, high)):
            found[name] = value
    return found


def fap_to_keys(values: Mapping[str, float], travel: Travel | None = None) -> dict[str, float]:
    """ARKit key values, 0-1, that come nearest to these FAP; a FAP not named is not asked for, one of 0 is.

    What keys cannot do (head, ears, pupils) is left out. Raises InputError for a name that is no FAP.
    """
    travel = travel or example_travel()
    arkit = [column for column, name in enumerate(travel.keys) if name in ARKIT.keys]
    return _solve(values, travel, tuple(travel.keys[column] for column in arkit), travel.steps[:, arkit])


def fap_to_controls(values: Mapping[str, float], travel: Travel | None = None) -> dict[str, float]:
    """Action units, side by side (`AU12L`, `AU26`), 0-1, that come nearest to these FAP.

    Units that the rig shows only by keys of others (fit "weak"), and the blinks 45 and 46, which are 43, are not used.
    """
    travel = travel or example_travel()
    controls, columns = _unit_columns(travel)
    return _solve(values, travel, controls, columns)


def controls_to_fap(controls: Mapping[str, float], travel: Travel | None = None) -> dict[str, float]:
    """FAP values of a face with these emotions and action units."""
    return keys_to_fap(shape_key_values(controls), travel)


def expression_to_controls(select: int, intensity: float) -> dict[str, float]:
    """FAP 2: our emotion for expression_select 1-6 at an intensity of 0-63."""
    emotions = {row.number: row.emotion for row in TABLE.expressions.values()}
    if select == 0:
        return {}
    if select not in emotions:
        raise InputError(f"expression_select: {select}, has to be 0 (none) to {max(emotions)}")
    if not 0.0 <= intensity <= MOST_INTENSITY:
        raise InputError(f"expression_intensity: {intensity}, has to be 0 to {MOST_INTENSITY:g}")
    return {emotions[select]: intensity / MOST_INTENSITY}


def _unit_columns(travel: Travel) -> tuple[tuple[str, ...], np.ndarray]:
    names, columns = [], []
    for unit in ACTION_UNITS.values():
        if unit.fit == "weak" or unit.id in _BLINKS:
            continue
        for side in unit.sides:
            own = {key: share for key, share in unit.keys.items() if not unit.sided or side_of(key) in (side[-1], "")}
            halved = {key: share / 2 if unit.sided and not side_of(key) else share for key, share in own.items()}
            names.append(f"AU{side}")
            columns.append(travel.steps @ [halved.get(key, 0.0) for key in travel.keys])
    return tuple(names), np.stack(columns, axis=1)


def _solve(
    values: Mapping[str, float], travel: Travel, names: tuple[str, ...], columns: np.ndarray
) -> dict[str, float]:
    """min |columns x - values|^2, 0 <= x <= 1, by coordinate descent: exact steps, so that it never rises."""
    wanted = _checked(values)
    rows = [row for row, name in enumerate(travel.faps) if name in wanted]
    # A FAP counts by what the face can do of it: a brow that is raised by a tenth of its range as an eyelid that shuts.
    most = np.abs(travel.steps).max(axis=1)
    ranges = np.array([TABLE.faps[name].range[1] for name in travel.faps], dtype=float)
    weight = 1.0 / np.clip(most, _LEAST_SHARE * ranges, ranges)[rows]
    a = columns[rows] * weight[:, None]
    b = np.array([wanted[travel.faps[row]] for row in rows]) * weight
    gram, toward = a.T @ a, a.T @ b
    ridge = _RIDGE * float(np.diag(gram).max(initial=0.0))
    used = [i for i in range(len(names)) if gram[i, i] > 0.0]
    x = np.zeros(len(names))
    for _ in range(_LEAST_SQUARES_ROUNDS):
        change = 0.0
        for i in used:
            step = (toward[i] - gram[i] @ x - ridge * x[i]) / (gram[i, i] + ridge)
            new = min(max(x[i] + step, 0.0), 1.0)
            change = max(change, abs(new - x[i]))
            x[i] = new
        if change < 1e-6:
            break
    return {name: float(value) for name, value in zip(names, x) if value > 1e-6}
