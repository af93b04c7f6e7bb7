"""The face: action units, the shape keys that express them, and emotions as sets of action units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from .errors import InputError, nearest
from .resources import Row, read_table, rigs_path
from .response import Response

Share = Annotated[float, Field(gt=0.0, le=1.0)]


class ArkitKeys(Row):
    """rigs/arkit.toml"""

    source: str
    keys: tuple[str, ...]
    unreached: dict[str, str]


class ActionUnit(Row):
    """One row of rigs/action_units.toml."""

    id: Annotated[str, Field(pattern=r"^\d+[LR]?$")]
    name: str
    muscles: Annotated[tuple[str, ...], Field(min_length=1)]
    keys: Annotated[dict[str, Share], Field(min_length=1)]
    fit: Literal["same", "near", "weak"]
    note: str = ""

    @property
    def control(self) -> str:
        """Name of the custom property that drives it."""
        return f"AU{self.id}"

    @property
    def help(self) -> str:
        return f"{self.name} ({'; '.join(self.muscles)})" + (f". {self.note[0].upper()}{self.note[1:]}" if self.note else "")


class _ActionUnits(Row):
    source: str
    unit: tuple[ActionUnit, ...]


class Emotion(Row):
    """One table of rigs/emotions.toml."""

    help: str
    units: dict[str, Share]
    source: Annotated[tuple[str, ...], Field(min_length=1)]


class _Emotions(Row):
    sources: dict[str, str]
    emotion: dict[str, Emotion]


def read_action_units(path: Path, known_keys: Iterable[str]) -> dict[str, ActionUnit]:
    """Action units by id. Raises InputError for a shape key that is not one of `known_keys`, or an id given twice."""
    units: dict[str, ActionUnit] = {}
    for unit in read_table(path, _ActionUnits).unit:
        if unit.id in units:
            raise InputError(f"{path}: unit {unit.id}: given twice, remove one")
        for key in unit.keys:
            _check_known(key, known_keys, f"{path}: unit {unit.id}: keys", "shape key")
        units[unit.id] = unit
    return units


def read_emotions(path: Path, known_units: Iterable[str]) -> dict[str, Emotion]:
    """Emotions by name. Raises InputError for an action unit or a source that is not declared."""
    table = read_table(path, _Emotions)
    for name, emotion in table.emotion.items():
        for unit in emotion.units:
            _check_known(unit, known_units, f"{path}: emotion.{name}.units", "action unit")
        for source in emotion.source:
            _check_known(source, table.sources, f"{path}: emotion.{name}.source", "row of [sources]")
    return table.emotion


def _check_known(name: str, known: Iterable[str], where: str, kind: str) -> None:
    if name not in known:
        raise InputError(f"{where}: {name}: no such {kind}, {nearest(name, known)}")


ARKIT: ArkitKeys = read_table(rigs_path("arkit.toml"), ArkitKeys)
ACTION_UNITS: dict[str, ActionUnit] = read_action_units(rigs_path("action_units.toml"), ARKIT.keys)
EMOTIONS: dict[str, Emotion] = read_emotions(rigs_path("emotions.toml"), ACTION_UNITS)

EMOTION_CONTROLS: tuple[str, ...] = tuple(name for name, emotion in EMOTIONS.items() if emotion.units)
"""Emotions with a slider; neutral is all of them at 0."""


def _unit_response(unit: ActionUnit) -> Response:
    """The unit's own slider plus what the emotions ask of it."""
    asked = [(EMOTIONS[name].units[unit.id], name) for name in EMOTION_CONTROLS if unit.id in EMOTIONS[name].units]
    return Response(((1.0, unit.control), *asked))


def _key_responses() -> dict[str, Response]:
    terms: dict[str, list[tuple[float, Response]]] = {}
    for unit in ACTION_UNITS.values():
        response = _unit_response(unit)
        for key, weight in unit.keys.items():
            terms.setdefault(key, []).append((weight, response))
    return {key: _sum(terms[key]) for key in ARKIT.keys if key in terms}


def _sum(terms: list[tuple[float, Response]]) -> Response:
    """The sum of `terms`; one whole term is itself, already clamped."""
    weight, response = terms[0]
    return response if len(terms) == 1 and weight == 1.0 else Response(tuple(terms))


SHAPE_KEYS: dict[str, Response] = _key_responses()
"""Shape key -> how the controls (emotions and action units) move it."""


def shape_key_values(controls: Mapping[str, float]) -> dict[str, float]:
    """The value of every shape key for these emotions and action units."""
    return {key: response.value(controls) for key, response in SHAPE_KEYS.items()}
