"""Reads a recording: a CSV whose column names say the units. docs/physiology.md is the format."""

from __future__ import annotations

import csv
import hashlib
import io
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError, nearest
from ..files import read_text
from .measures import COLUMNS, MEASURES, TIME_COLUMNS, Measure

NEUTRAL = "neutral"
SEXES: Mapping[str, str] = {"female": "female", "f": "female", "male": "male", "m": "male", "": ""}
"""Cell -> sex; "" is not stated: such a subject counts in pooled results only."""

MAX_COLUMNS = 200
_MAX_NAME = 80
# Nobody sits through half a day of films, and none has an emotion and a rest within ten seconds: the unit is wrong.
_LONGEST_S, _SHORTEST_S = 43_200.0, 10.0


@dataclass(frozen=True)
class Track:
    """One measure of one subject in one file, at one region for a skin analyser ("" where the file names none).

    time_s (N,), increasing. emotion (N,) str, "" unlabelled. value (N,) in the measure's base unit, NaN where the cell
    is empty. line (N,): in the file.
    """

    file: str
    subject: str
    sex: str
    measure: Measure
    region: str
    time_s: np.ndarray
    emotion: np.ndarray
    value: np.ndarray
    line: np.ndarray


@dataclass(frozen=True)
class Recording:
    """One file: its name without folders, the hash of its bytes, its tracks and the rows it has."""

    file: str
    sha256: str
    rows: int
    tracks: tuple[Track, ...]


@dataclass(frozen=True)
class _Layout:
    """Which column holds what."""

    time: int
    seconds: float
    subject: int
    sex: int
    emotion: int
    region: int | None
    measures: tuple[tuple[int, str], ...]


class _Rows:
    """The rows of one subject at one region, column by column."""

    def __init__(self, measures: int):
        self.time: list[float] = []
        self.emotion: list[str] = []
        self.line: list[int] = []
        self.values: list[list[float]] = [[] for _ in range(measures)]


def read_recording(
    path: str | os.PathLike[str],
    emotions: Sequence[str],
    regions: Sequence[str],
    labels: Mapping[str, str] | None = None,
    ignore: Sequence[str] = (),
) -> Recording:
    """The tracks of a file.

    emotions: labels that are known, NEUTRAL among them. labels: the file's own words -> emotions. regions: known ones.
    ignore: columns to leave out. Raises InputError, one line with file, line, column and mend.
    """
    text = read_text(path)
    rows = _table(path, text)
    if not rows:
        raise InputError(f"{path}: empty, needs a header like 'time_s,subject,sex,emotion,spo2_percent'")
    header_line, header = rows[0]
    layout = _layout(f"{path}: line {header_line}", header, ignore)
    if len(rows) == 1:
        raise InputError(f"{path}: line {header_line}: no samples below the header")

    time_column = header[layout.time].strip()
    words = {name: name for name in emotions} | {name.lower(): emotion for name, emotion in (labels or {}).items()}
    people: dict[str, tuple[str, int]] = {}
    groups: dict[tuple[str, str], _Rows] = {}
    for line, row in rows[1:]:
        where = f"{path}: line {line}"
        if len(row) != len(header):
            raise InputError(f"{where}: {len(row)} cells, the header has {len(header)}")
        subject = _name(f"{where}: subject", row[layout.subject])
        _check_sex(where, subject, row[layout.sex].strip().lower(), line, people)
        region = "" if layout.region is None else row[layout.region].strip()
        if region and region not in regions:
            raise InputError(f"{where}: region: {_show(region)} is none, {nearest(region[:_MAX_NAME], regions)}")
        group = groups.setdefault((subject, region), _Rows(len(layout.measures)))
        time = _number(f"{where}: {time_column}", row[layout.time], "every sample needs one") * layout.seconds
        if group.time and time <= group.time[-1]:
            raise InputError(
                _out_of_order(f"{where}: {time_column}", row[layout.time].strip(), time, group, subject, region)
            )
        label = row[layout.emotion].strip().lower()
        if label and label not in words:
            raise InputError(
                f"{where}: emotion: {_show(label)} is unknown, {nearest(label[:_MAX_NAME], words)} (--labels maps others)"
            )
        group.time.append(time)
        group.emotion.append(words[label] if label else "")
        group.line.append(line)
        for (column, name), values in zip(layout.measures, group.values, strict=True):
            values.append(_value(where, name, row[column]))
    _check_time(path, time_column, groups)
    _check_units(path, layout, groups)
    return Recording(
        _file_name(path),
        hashlib.sha256(Path(path).read_bytes()).hexdigest(),
        len(rows) - 1,
        tuple(_tracks(path, layout, groups, people)),
    )


def _file_name(path: str | os.PathLike[str]) -> str:
    return os.fsencode(Path(path).name).decode("utf-8", "replace")


def _show(text: str) -> str:
    """Whatever a cell holds, on one line and short."""
    return repr(text if len(text) <= 40 else text[:37] + "…")


def _table(path: str | os.PathLike[str], text: str) -> list[tuple[int, list[str]]]:
    """(line, cells) of all rows; comments (#) and blank lines are none."""
    lines = text.removeprefix("\ufeff").split("\n")
    reader = csv.reader(io.StringIO("\n".join("" if line.startswith("#") else line for line in lines)), strict=True)
    rows = []
    try:
        for row in reader:
            if any(cell.strip() for cell in row):
                rows.append((reader.line_num, row))
    except csv.Error as error:
        raise InputError(f"{path}: line {reader.line_num}: not valid CSV: {error}") from None
    return rows


def _layout(where: str, header: list[str], ignore: Sequence[str]) -> _Layout:
    if len(header) > MAX_COLUMNS:
        raise InputError(f"{where}: {len(header)} columns, at most {MAX_COLUMNS} are read")
    names = [cell.strip() for cell in header]
    if len(names) == 1 and (";" in names[0] or "\t" in names[0]):
        raise InputError(f"{where}: the cells are not divided by commas: write the file with ',' and decimal points")
    found: dict[str, int] = {}
    measures: dict[str, str] = {}
    known = [*TIME_COLUMNS, "subject", "sex", "emotion", "region", *COLUMNS]
    for k, name in enumerate(names):
        if name in ignore:
            continue
        if name in found:
            raise InputError(f"{where}: column {_show(name)} stands there twice: remove one")
        if name in MEASURES and name not in COLUMNS:
            allowed = " or ".join(MEASURES[name].columns)
            raise InputError(f"{where}: column {_show(name)} does not say its unit: call it {allowed}")
        if name == "time":
            raise InputError(f"{where}: column 'time' does not say its unit: call it {' or '.join(TIME_COLUMNS)}")
        if name not in known:
            hint = nearest(name[:_MAX_NAME], known)
            raise InputError(f"{where}: column {_show(name)} is unknown, {hint} (--ignore leaves a column out)")
        if name in COLUMNS:
            measure = COLUMNS[name][0].id
            if measure in measures:
                raise InputError(
                    f"{where}: columns {measures[measure]!r} and {name!r} are the same measure: remove one"
                )
            measures[measure] = name
        found[name] = k
    times = [name for name in TIME_COLUMNS if name in found]
    if len(times) != 1:
        raise InputError(f"{where}: {len(times)} columns of time, needs one: {' or '.join(TIME_COLUMNS)}")
    for name in ("subject", "sex", "emotion"):
        if name not in found:
            raise InputError(f"{where}: column '{name}' is missing")
    if not measures:
        raise InputError(f"{where}: nothing is measured: needs a column of {', '.join(COLUMNS)}")
    return _Layout(
        found[times[0]], TIME_COLUMNS[times[0]], found["subject"], found["sex"], found["emotion"], found.get("region"),
        tuple((found[name], name) for name in measures.values()),
    )  # fmt: skip


def _name(where: str, cell: str) -> str:
    name = cell.strip()
    if not name:
        raise InputError(f"{where}: missing")
    if len(name) > _MAX_NAME or not name.isprintable():
        raise InputError(f"{where}: {_show(name)}: at most {_MAX_NAME} printable characters are allowed")
    return name


def _check_sex(where: str, subject: str, cell: str, line: int, people: dict[str, tuple[str, int]]) -> None:
    """Notes the sex of a new subject in `people` (name -> sex and line), and compares it for a known one."""
    if cell not in SEXES:
        raise InputError(f"{where}: sex: {_show(cell)} is not female, male, f, m or empty")
    sex = SEXES[cell]
    before, first = people.setdefault(subject, (sex, line))
    if before != sex:
        raise InputError(
            f"{where}: sex: {sex or 'empty'}, but {_show(subject)} is {before or 'empty'} on line {first}: one subject has one"
        )


def _number(where: str, cell: str, empty: str) -> float:
    text = cell.strip()
    if not text:
        raise InputError(f"{where}: missing: {empty}")
    try:
        value = math.nan if "_" in text else float(text)
    except ValueError:
        raise InputError(f"{where}: {_show(text)} is not a number") from None
    if not math.isfinite(value):
        raise InputError(f"{where}: {_show(text)} is not a number: leave the cell empty where nothing was measured")
    return value


def _value(where: str, name: str, cell: str) -> float:
    """In the base unit; NaN for an empty cell."""
    if not cell.strip():
        return math.nan
    where = f"{where}: {name}"
    value = _number(where, cell, "")
    unit = COLUMNS[name][1]
    if value < unit.low:
        raise InputError(
            f"{where}: {value:g} is negative, {unit.low:g} to {unit.high:g} is allowed: leave the cell empty where nothing "
            "was measured"
        )
    if value > unit.high:
        hint = f" (if it is another unit, call the column {unit.instead})" if unit.instead else ""
        raise InputError(f"{where}: {value:g} is outside {unit.low:g} to {unit.high:g}{hint}")
    return value * unit.factor


def _out_of_order(where: str, cell: str, time: float, group: _Rows, subject: str, region: str) -> str:
    whose = f"of {_show(subject)}" + (f" at {region}" if region else "")
    k = int(np.searchsorted(group.time, time))
    if k < len(group.time) and group.time[k] == time:
        return f"{where}: {_show(cell)} {whose} stands on line {group.line[k]} already: remove one of the two samples"
    return f"{where}: {_show(cell)} {whose} after a later time on line {group.line[-1]}: sort the samples by time"


def _check_time(path: object, column: str, groups: Mapping[tuple[str, str], _Rows]) -> None:
    spans = {who: group.time[-1] - group.time[0] for (who, _), group in groups.items()}
    subject, longest = max(spans.items(), key=lambda item: item[1])
    if longest > _LONGEST_S:
        hint = (
            "this looks like milliseconds: call the column time_ms"
            if column == "time_s"
            else "call the column by its unit"
        )
        raise InputError(
            f"{path}: {column}: the samples of {_show(subject)} span {longest / 3600.0:.0f} hours: {hint} (or give each "
            "session a file)"
        )
    if column == "time_ms" and longest < _SHORTEST_S:
        raise InputError(
            f"{path}: {column}: no subject has more than {longest:g} s: this looks like seconds: call the column time_s"
        )


def _check_units(path: object, layout: _Layout, groups: Mapping[tuple[str, str], _Rows]) -> None:
    for k, (_, name) in enumerate(layout.measures):
        unit = COLUMNS[name][1]
        values = np.concatenate([np.asarray(group.values[k]) for group in groups.values()])
        values = values[values > 0.0] / unit.factor  # 0 is a sensor that lost the signal; NaN is above nothing
        if not values.size or not unit.instead:
            continue
        middle = float(np.median(values))
        if not unit.usual[0] <= middle <= unit.usual[1]:
            raise InputError(
                f"{path}: {name}: half of the values are {'below' if middle < unit.usual[0] else 'above'} {middle:.3g}: "
                f"this looks like another unit: call the column {unit.instead}"
            )


def _tracks(
    path: object, layout: _Layout, groups: Mapping[tuple[str, str], _Rows], people: Mapping[str, tuple[str, int]]
) -> list[Track]:
    tracks = []
    file = _file_name(path)
    by_subject: dict[str, dict[str, _Rows]] = {}
    for (subject, region), group in groups.items():
        by_subject.setdefault(subject, {})[region] = group
    for subject, own in by_subject.items():
        sex = people[subject][0]
        arrays = {
            region: (np.array(g.time), np.array(g.emotion, dtype=object), np.array(g.line)) for region, g in own.items()
        }
        for k, (_, name) in enumerate(layout.measures):
            measure = COLUMNS[name][0]
            if measure.device == "analyser" or len(own) == 1:
                for region, group in own.items():
                    values = np.array(group.values[k])
                    if np.isfinite(values).any():
                        where = region if measure.device == "analyser" else ""
                        tracks.append(
                            Track(file, subject, sex, measure, where, *arrays[region][:2], values, arrays[region][2])
                        )
                continue
            # One sensor, whose readings stand beside those of every region that the analyser visits.
            merged = [np.concatenate([arrays[region][part] for region in own]) for part in range(3)]
            values = np.concatenate([np.asarray(group.values[k]) for group in own.values()])
            some = np.isfinite(values)
            order = np.flatnonzero(some)[np.lexsort((merged[2][some], merged[0][some]))]
            if not order.size:
                continue
            time, emotion, line, values = merged[0][order], merged[1][order], merged[2][order], values[order]
            again = np.flatnonzero(np.diff(time) == 0.0) + 1
            for j in again:
                if values[j] != values[j - 1] or emotion[j] != emotion[j - 1]:
                    raise InputError(
                        f"{path}: line {line[j]}: {name} or emotion of {_show(subject)} differs from line {line[j - 1]} at the "
                        "same time: one subject has one sensor"
                    )
            keep = np.setdiff1d(np.arange(order.size), again)
            tracks.append(Track(file, subject, sex, measure, "", time[keep], emotion[keep], values[keep], line[keep]))
    return tracks
