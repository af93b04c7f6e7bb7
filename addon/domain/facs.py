"""The face: action units with sides, the shape keys that express them, and emotions as sets of action units.

From a slider to a key: what the emotions ask of a unit and the unit's own sliders add up and are clamped, side by
side; units that exclude each other fade (rigs/action_units.toml); each shape key is a sum of what is left of its
units. `Formulas` holds this once, as numbers and as drivers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from .errors import InputError, nearest
from .own_keys import OWN_KEY_NAMES
from .resources import Row, read_table, rigs_path
from .response import MAX_EXPRESSION, Above, Formula, Product, Response, Sum, driver_text

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Weight = Annotated[float, Field(gt=0.0, le=1.0)]

INTENSITIES: dict[str, float] = {"A": 0.2, "B": 0.4, "C": 0.6, "D": 0.8, "E": 1.0}
"""FACS intensity -> value of a unit. FACS's own letters are ordinal; equal steps are the 0-5 scale that databases and
trackers use (DISFA: Mavadati et al. 2013, IEEE Trans. Affective Computing 4:151; OpenFace 2)."""

VARIANTS: dict[str, float] = {"subtle": 0.25, "full": 1.0, "extreme": 1.5}
"""Where on an emotion's slider the three columns of rigs/emotions.toml apply; straight lines between, from 0 at 0."""

EMOTION_MAX = 1.5


class ArkitKeys(Row):
    """rigs/arkit.toml"""

    source: str
    keys: tuple[str, ...]
    unreached: dict[str, str]


def side_of(key: str) -> str:
    """ "L", "R" or "": the side of the face that a shape key's name tells."""
    return "L" if "Left" in key else "R" if "Right" in key else ""


class HeadMove(Row):
    """What a unit does to the head bone at full intensity, in the subject's own view: turned to the left, nodded down,
    tilted to the left, pushed forward."""

    turn_degrees: float = 0.0
    nod_degrees: float = 0.0
    tilt_degrees: float = 0.0
    forward_mm: float = 0.0


class ActionUnit(Row):
    """One unit of rigs/action_units.toml.

    It has sides when its keys have: then "12L" and "12R" are parts of it. `one_sided` units are never scored on both.
    """

    id: Annotated[str, Field(pattern=r"^\d+$")]
    name: str
    muscles: Annotated[tuple[str, ...], Field(min_length=1)]
    keys: dict[str, Weight] = {}
    head: HeadMove | None = None
    fit: Literal["same", "near", "weak"]
    one_sided: bool = False
    note: str = ""

    @model_validator(mode="after")
    def _has_both_sides(self) -> ActionUnit:
        if not self.keys and self.head is None:
            raise ValueError(f"unit {self.id}: keys: none, and no head: a unit that shows nothing is [[inexpressible]]")
        if {side_of(key) for key in self.keys} & {"L", "R"} not in (set(), {"L", "R"}):
            raise ValueError(f"unit {self.id}: keys: has those of one side only")
        return self

    @property
    def sided(self) -> bool:
        return any(side_of(key) for key in self.keys)

    @property
    def sides(self) -> tuple[str, ...]:
        """Ids of its parts: ("12L", "12R"), or ("26",) for a unit that cannot be told apart."""
        return (f"{self.id}L", f"{self.id}R") if self.sided else (self.id,)

    @property
    def whole(self) -> tuple[str, ...]:
        """The controls that move as much of it as is ever moved at once: AU12; of a one-sided unit each of its two."""
        return tuple(f"AU{side}" for side in self.sides) if self.one_sided else (f"AU{self.id}",)

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of its sliders: AU12, AU12L, AU12R."""
        return tuple(dict.fromkeys((*self.whole, *(f"AU{side}" for side in self.sides))))

    @property
    def help(self) -> str:
        return f"{self.name} ({'; '.join(self.muscles)})" + (f". {self.note[0].upper()}{self.note[1:]}" if self.note else "")


class Interference(Row):
    """The units lose `share` of their effect at full strength of another; with `keys` (names without side) only there."""

    units: Annotated[tuple[str, ...], Field(min_length=1)]
    by: Annotated[dict[str, Weight], Field(min_length=1)]
    keys: tuple[str, ...] = ()
    reason: str


class Need(Row):
    """The unit shows only as far as the others do."""

    unit: str
    of: Annotated[dict[str, Weight], Field(min_length=1)]
    reason: str


class Inexpressible(Row):
    """A unit of FACS that no shape here shows, and why."""

    id: Annotated[str, Field(pattern=r"^M?\d+$")]
    name: str
    muscles: Annotated[tuple[str, ...], Field(min_length=1)]
    reason: str


class UnitTable(Row):
    """rigs/action_units.toml"""

    source: str
    unit: tuple[ActionUnit, ...]
    interference: tuple[Interference, ...] = ()
    need: tuple[Need, ...] = ()
    inexpressible: tuple[Inexpressible, ...] = ()


class Emotion(Row):
    """One table of rigs/emotions.toml. units: unit, or one side of it -> its share in (subtle, full, extreme)."""

    help: str
    units: dict[str, tuple[Share, Share, Share]]
    source: Annotated[tuple[str, ...], Field(min_length=1)]


class _Emotions(Row):
    sources: dict[str, str]
    emotion: dict[str, Emotion]


def read_action_units(path: Path, known_keys: Iterable[str]) -> UnitTable:
    """Raises InputError for a shape key that is not one of `known_keys`, an id given twice, a unit that is not there."""
    table = read_table(path, UnitTable)
    ids: set[str] = set()
    for unit in (*table.unit, *table.inexpressible):
        if unit.id in ids:
            raise InputError(f"{path}: unit {unit.id}: given twice, remove one")
        ids.add(unit.id)
    units = {unit.id: unit for unit in table.unit}
    for unit in table.unit:
        for key in unit.keys:
            _check_known(key, known_keys, f"{path}: unit {unit.id}: keys", "shape key")
    for row in table.interference:
        where = f"{path}: interference of {', '.join(row.units)}"
        for name in (*row.units, *row.by):
            _check_known(name, units, where, "action unit")
        for name in row.keys:
            stems = {_stem(key) for unit in row.units for key in units[unit].keys}
            _check_known(name, stems, where, "key of these units")
    for row in table.need:
        for name in (row.unit, *row.of):
            _check_known(name, units, f"{path}: need of {row.unit}", "action unit")
    return table


def read_emotions(path: Path, units: Mapping[str, ActionUnit]) -> dict[str, Emotion]:
    """Emotions by name. Raises InputError for an action unit or a source that is not declared, or a unit given twice."""
    table = read_table(path, _Emotions)
    known = [name for unit in units.values() for name in ((unit.id,) if not unit.one_sided else ()) + unit.sides]
    for name, emotion in table.emotion.items():
        for unit in emotion.units:
            _check_known(unit, known, f"{path}: emotion.{name}.units", "action unit")
            if unit[-1] in "LR" and unit[:-1] in emotion.units:
                raise InputError(f"{path}: emotion.{name}.units: {unit}: {unit[:-1]} has it already, remove one")
        for source in emotion.source:
            _check_known(source, table.sources, f"{path}: emotion.{name}.source", "row of [sources]")
    return table.emotion


def _check_known(name: str, known: Iterable[str], where: str, kind: str) -> None:
    if name not in known:
        raise InputError(f"{where}: {name}: no such {kind}, {nearest(name, known)}")


def _stem(key: str) -> str:
    return key.replace("Left", "").replace("Right", "")


ARKIT: ArkitKeys = read_table(rigs_path("arkit.toml"), ArkitKeys)
KNOWN_KEYS: tuple[str, ...] = (*ARKIT.keys, *OWN_KEY_NAMES)
UNIT_TABLE: UnitTable = read_action_units(rigs_path("action_units.toml"), KNOWN_KEYS)
ACTION_UNITS: dict[str, ActionUnit] = {unit.id: unit for unit in UNIT_TABLE.unit}
EMOTIONS: dict[str, Emotion] = read_emotions(rigs_path("emotions.toml"), ACTION_UNITS)

EMOTION_MAX = 1.5
"""How far the slider of an emotion goes."""

EMOTION_CONTROLS: tuple[str, ...] = tuple(name for name, emotion in EMOTIONS.items() if emotion.units)
"""Emotions with a slider; neutral is all of them at 0."""

DEFAULT_EMOTIONS: tuple[str, ...] = ("anger", "happy", "sad", "fear")
"""Those that a rig gets when nobody says which."""

SIDES = {"": "", "L": ", left side only", "R": ", right side only"}

UNIT_CONTROLS: dict[str, str] = {
    control: unit.name + SIDES[control[-1] if control[-1] in SIDES else ""] + unit.help.removeprefix(unit.name)
    for unit in ACTION_UNITS.values()
    for control in unit.controls
}
"""Slider of a unit or of one side of it -> its help, in the order of the table."""


def _curve(name: str, shares: tuple[float, float, float]) -> tuple[tuple[float, str | Formula], ...]:
    """The share of a unit as a function of the emotion's slider: slope from 0, and how it bends at each variant."""
    at, values = (0.0, *VARIANTS.values()), (0.0, *shares)
    slopes = [(values[i + 1] - values[i]) / (at[i + 1] - at[i]) for i in range(len(shares))]
    bends = [slopes[0], *(after - before for before, after in zip(slopes, slopes[1:]))]
    # A millionth of a unit is not seen, and drivers have to be short.
    terms = ((round(bend, 6), name if not knee else Above(name, knee)) for knee, bend in zip(at, bends))
    return tuple(term for term in terms if term[0])


def emotion_units(name: str, level: float) -> dict[str, float]:
    """What an emotion at `level` (0 to EMOTION_MAX) asks of the sides of the units, each 0-1."""
    asked: dict[str, float] = {}
    for unit, shares in EMOTIONS[name].units.items():
        share = Response(_curve(name, shares)).value({name: level})
        if share > 0.0:
            asked |= dict.fromkeys(ACTION_UNITS[unit].sides if unit in ACTION_UNITS else (unit,), share)
    return asked


@dataclass(frozen=True)
class Formulas:
    """How the controls of one rig move its face.

    properties : intermediate values by name, each of controls and of properties before it
                 (`sum_12` what the emotions ask of unit 12, `unit_12L` its left side, 0-1)
    units      : side of a unit -> what is left of it beside the others, of properties
    keys       : shape key -> its value, of properties
    head       : field of HeadMove -> how far the head bone goes, of properties
    """

    properties: dict[str, Formula]
    units: dict[str, Formula]
    keys: dict[str, Response]
    head: dict[str, Formula]

    def values(self, of: Mapping[str, Formula], controls: Mapping[str, float]) -> dict[str, float]:
        """The numbers of `units`, `keys` or `head` for these control values."""
        known = dict(controls)
        for name, formula in self.properties.items():
            known[name] = formula.value(known)
        return {name: formula.value(known) for name, formula in of.items()}

    def needed(self, names: Iterable[str]) -> dict[str, Formula]:
        """The properties that these names stand for or rest on, in the order of `properties`."""
        found, waiting = set(), [name for name in names if name in self.properties]
        while waiting:
            name = waiting.pop()
            if name not in found:
                found.add(name)
                waiting += [n for n in self.properties[name].controls() if n in self.properties]
        return {name: formula for name, formula in self.properties.items() if name in found}


@cache
def formulas(emotions: tuple[str, ...] = EMOTION_CONTROLS, sided: bool = True) -> Formulas:
    """Those of a rig that has these emotions, and sliders for single sides of units or not."""
    properties: dict[str, Formula] = {}
    for unit in ACTION_UNITS.values():
        _add_unit(properties, unit, emotions, sided)
    units = {side: Product((f"unit_{side}", *_factors(side))) for unit in ACTION_UNITS.values() for side in unit.sides}
    head = {
        field: Sum(
            tuple(
                (getattr(unit.head, field), Product((f"unit_{unit.id}", *_factors(unit.id))))
                for unit in ACTION_UNITS.values()
                if unit.head and getattr(unit.head, field)
            )
        )
        for field in HeadMove.model_fields
    }
    return Formulas(properties, units, _key_responses(), head)


def _add_unit(properties: dict[str, Formula], unit: ActionUnit, emotions: tuple[str, ...], sided: bool) -> None:
    sums = {}
    for part in dict.fromkeys((unit.id, *unit.sides)):
        curves = [_curve(name, EMOTIONS[name].units[part]) for name in emotions if part in EMOTIONS[name].units]
        pieces = _short_sums([curve for curve in curves if curve])
        sums[part] = [f"sum_{part}" if i == 0 else f"sum_{part}_{i + 1}" for i in range(len(pieces))]
        properties.update(zip(sums[part], pieces))
    for side in unit.sides:
        own = [] if unit.one_sided else [f"AU{unit.id}"]
        if unit.sided and (sided or unit.one_sided):
            own.append(f"AU{side}")
        asked = dict.fromkeys((*sums[unit.id], *sums[side]))
        properties[f"unit_{side}"] = Response(tuple((1.0, name) for name in (*own, *asked)))


def unit_alone(control: str, emotions: Iterable[str]) -> Response:
    """What a unit's own slider and these emotions ask of it, for a key that stands beside the rest of the face: neither
    its sides nor other units count."""
    curves = [_curve(name, EMOTIONS[name].units[control[2:]]) for name in emotions if control[2:] in EMOTIONS[name].units]
    return Response(((1.0, control), *(term for curve in curves for term in curve)))


def _short_sums(curves: list[tuple[tuple[float, str | Formula], ...]]) -> list[Sum]:
    """The sum of the curves in as many parts as drivers need."""
    sums: list[Sum] = []
    for curve in curves:
        longer = Sum(((*sums[-1].terms, *curve))) if sums else None
        if longer and len(driver_text(longer)[0]) < MAX_EXPRESSION:
            sums[-1] = longer
        else:
            sums.append(Sum(curve))
    return sums


def _factors(side: str, key: str = "") -> tuple[Formula, ...]:
    """What fades one side of a unit, as a whole or (with `key`) on the way to one of its keys."""
    unit = side.rstrip("LR")
    fades = [
        Sum(tuple((-share * weight, prop) for weight, prop in _beside(other, side)), 1.0)
        for row in UNIT_TABLE.interference
        if unit in row.units and (not row.keys or _stem(key) in row.keys)
        for other, share in row.by.items()
    ]
    needs = [
        Response(tuple((share * weight, prop) for other, share in row.of.items() for weight, prop in _beside(other, side)))
        for row in UNIT_TABLE.need
        if unit == row.unit
    ]
    return (*fades, *needs)


def _beside(other: str, side: str) -> tuple[tuple[float, str], ...]:
    """The unit `other` as a side of a face sees it: the same side of it; both halves where one of the two has none."""
    if not ACTION_UNITS[other].sided:
        return ((1.0, f"unit_{other}"),)
    if side[-1] in "LR":
        return ((1.0, f"unit_{other}{side[-1]}"),)
    return ((0.5, f"unit_{other}L"), (0.5, f"unit_{other}R"))


def _key_responses() -> dict[str, Response]:
    """Units with the same factors share them: drivers have to be short."""
    groups: dict[str, dict[tuple[Formula, ...], list[tuple[float, str]]]] = {}
    for unit in ACTION_UNITS.values():
        for key, weight in unit.keys.items():
            sides = [side for side in unit.sides if not unit.sided or side_of(key) in (side[-1], "")]
            for side in sides:
                group = groups.setdefault(key, {}).setdefault(_factors(side, key), [])
                group.append((weight / len(sides), f"unit_{side}"))
    order = [key for key in KNOWN_KEYS if key in groups]
    return {key: Response(tuple(term for group in groups[key].items() for term in _terms(*group))) for key in order}


def _terms(factors: tuple[Formula, ...], units: list[tuple[float, str]]) -> list[tuple[float, str | Formula]]:
    if not factors:
        return list(units)
    if len(units) == 1:
        return [(units[0][0], Product((units[0][1], *factors)))]
    return [(1.0, Product((Sum(tuple(units)), *factors)))]


SHAPE_KEYS: tuple[str, ...] = tuple(formulas().keys)
"""Every shape key that a control moves."""


def unit_values(controls: Mapping[str, float]) -> dict[str, float]:
    """Every side of every action unit, 0-1, for these emotions and action units, after units that exclude each other."""
    return formulas().values(formulas().units, controls)


def shape_key_values(controls: Mapping[str, float]) -> dict[str, float]:
    """The value of every shape key for these emotions and action units."""
    return formulas().values(formulas().keys, controls)


def head_values(controls: Mapping[str, float]) -> dict[str, float]:
    """How far the head is turned (field of HeadMove -> degrees or mm) for these emotions and action units."""
    return formulas().values(formulas().head, controls)
