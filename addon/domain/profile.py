"""An emotion profile: changes of blood that were measured in people, as `sanguine physiology` writes them.

Its rows are those of rigs/blood.toml, with the interval beside the value. `with_profile` puts them in; what the profile
does not have stays as it is.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, Literal

import numpy as np
import sanguine_core
from pydantic import Field

from .blood import (
    ANATOMY,
    BLOOD,
    ELSEWHERE,
    STATES,
    Blood,
    Drive,
    Quantity,
    Rest,
    Sources,
    usual_kinetics,
)
from .errors import InputError, nearest
from .facs import EMOTION_CONTROLS
from .files import atomic, read_toml, validate
from .parameters import PARAMETERS, default_skin, skin_rows
from .resources import Row

FORMAT = 1
FINGER = "finger"

# Green, where hemoglobin absorbs, and red, where it hardly does: the diodes of a Mexameter (remembered).
_GREEN_NM, _RED_NM = 568.0, 660.0


class RecordingRow(Row):
    """A file that the profile comes from."""

    file: str
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    samples: Annotated[int, Field(ge=0)]


class Calibration(Row):
    """How indices became units.

    index: of the skin analyser. "linear" changes by the share that blood does, times index_gain. "erythema" is the
    logarithm of the ratio of red to green reflectance (Diffey 1984), whose blood Sanguine's own optics find, on skin with
    this melanin. A perfusion index is linear. index_region: where an index was taken that names no region. oximeter:
    "finger" or a region.
    """

    index: Literal["linear", "erythema"] = "linear"
    index_gain: Annotated[float, Field(gt=0.0, le=100.0)] = 1.0
    melanin: Annotated[float, Field(ge=0.0, le=0.5)] = 0.018
    index_region: tuple[str, ...] = ()
    oximeter: str = FINGER


class ProfileRow(Row):
    """One change; low and high are its 95 % interval."""

    region: str
    quantity: Quantity
    value: Annotated[float, Field(allow_inf_nan=False)]
    low: Annotated[float, Field(allow_inf_nan=False)]
    high: Annotated[float, Field(allow_inf_nan=False)]
    magnitude: Literal["measured"]
    source: Sources
    note: str = ""


class NamedRows(Row):
    """Of one emotion or state."""

    name: str
    change: tuple[ProfileRow, ...]


class UnsupportedRow(Row):
    """A change that the recordings do not show, and why."""

    emotion: str
    measure: str
    region: str
    verdict: str


class Profile(Row):
    """A profile file."""

    format: Literal[1]
    sanguine: str
    sex: Literal["pooled", "female", "male"]
    subjects: Annotated[int, Field(ge=1)]
    calibration: Calibration
    recording: Annotated[tuple[RecordingRow, ...], Field(min_length=1)]
    emotion: tuple[NamedRows, ...] = ()
    state: tuple[NamedRows, ...] = ()
    unsupported: tuple[UnsupportedRow, ...] = ()

    @property
    def rows(self) -> dict[tuple[str, str, str], ProfileRow]:
        """(emotion or state, region, quantity) -> row."""
        return {
            (rows.name, row.region, row.quantity): row for rows in (*self.emotion, *self.state) for row in rows.change
        }


def read_profile(path: str | os.PathLike[str]) -> Profile:
    """A checked profile. Raises InputError, one line with file, key and mend."""
    profile = validate(Profile, read_toml(path), path)
    files = [recording.file for recording in profile.recording]
    seen = set()
    for kind, known, rows in (
        *(("emotion", EMOTION_CONTROLS, rows) for rows in profile.emotion),
        *(("state", STATES, rows) for rows in profile.state),
    ):
        if rows.name not in known:
            raise InputError(f"{path}: {kind}: {rows.name}: no such {kind}, {nearest(rows.name, known)}")
        for row in rows.change:
            where = f"{path}: {rows.name} {row.region} {row.quantity}"
            if row.region not in (*ANATOMY, ELSEWHERE):
                raise InputError(f"{where}: no such region, {nearest(row.region, (*ANATOMY, ELSEWHERE))}")
            if (rows.name, row.region, row.quantity) in seen:
                raise InputError(f"{where}: given twice, remove one")
            seen.add((rows.name, row.region, row.quantity))
            for source in row.source:
                if source not in files:
                    raise InputError(f"{where}: source: {source}: not among the recordings, {nearest(source, files)}")
            if not row.low <= row.value <= row.high:
                raise InputError(f"{where}: value {row.value:g} is not between low {row.low:g} and high {row.high:g}")
            low, high = BLOOD.room(row.region, row.quantity)
            if not low <= row.value <= high:
                raise InputError(
                    f"{where}: {row.value:g} is more than skin can change: keep it from {low:.4f} to {high:.4f}"
                )
    return profile


def with_profile(blood: Blood, profile: Profile) -> Blood:
    """`blood` as it was measured: hemoglobin in place of the table's, oxygenation on top of it.

    What an oximeter measures is arterial, and adds to whatever the tissue takes out. A drive keeps its time course while it
    keeps its direction.
    """
    drives = {key: {drive.control: drive for drive in own} for key, own in blood.drives.items()}
    for (control, region, quantity), row in profile.rows.items():
        own = drives.setdefault((region, quantity), {})
        before = own.get(control)
        low, high = blood.room(region, quantity)
        value = row.value + (before.value if before and quantity == "oxygenation" else 0.0)
        value = min(max(value, low), high)
        keeps = before is not None and before.value * value > 0.0
        own[control] = Drive(control, value, before.kinetics if keeps else usual_kinetics(quantity, value))
    return replace(blood, drives={key: tuple(own.values()) for key, own in drives.items()})


@dataclass(frozen=True)
class Measured:
    """A supported change of a measure, with its 95 % interval: relative (0.1 is 10 % more) or, of SpO2, a fraction."""

    emotion: str
    measure: str
    region: str
    subjects: int
    value: float
    low: float
    high: float


def blood_of_index(calibration: Calibration, measure: str, region: str, relative: float) -> float:
    """Change of the blood volume fraction that a relative change of an index stands for; infinite where no blood gives it."""
    rest = BLOOD.at_rest(region, "hemoglobin")
    if measure != "hemoglobin_index" or calibration.index == "linear":
        return calibration.index_gain * rest * relative
    blood, index = _erythema(calibration.melanin, region)
    wanted = (1.0 + relative) * float(np.interp(rest, blood, index))
    return float(np.interp(wanted, index, blood, left=-math.inf, right=math.inf)) - rest


@lru_cache(maxsize=64)
def _erythema(melanin: float, region: str) -> tuple[np.ndarray, np.ndarray]:
    """(blood volume fractions, erythema index of the region's skin at rest with so much blood), both rising: up to where
    so much blood takes the red away too."""
    rest = ANATOMY.get(region, Rest())
    blood = np.geomspace(1e-4, PARAMETERS["hemoglobin"].hard_max, 200)
    skin = default_skin() | {
        "melanin": min(melanin * rest.melanin, PARAMETERS["melanin"].hard_max),
        "oxygenation": BLOOD.at_rest(region, "oxygenation"),
        "oil": 0.0,
    }
    rows = skin_rows([skin | {"hemoglobin": fraction} for fraction in blood])
    green, red = sanguine_core.reflectance(rows, np.array([_GREEN_NM, _RED_NM])).T
    index = np.log10(red / green)
    rising = int(np.argmax(np.append(np.diff(index) <= 0.0, True))) + 1
    return blood[:rising], index[:rising]


def profile_rows(
    changes: Sequence[Measured], calibration: Calibration, sources: Sequence[str]
) -> tuple[dict[str, list[ProfileRow]], list[UnsupportedRow]]:
    """(emotion -> rows, what cannot become one).

    A finger's perfusion says nothing of the face: it narrows while the face flushes (Drummond and Quah 2001). A change
    of SpO2 is one of arterial blood, which adds to the oxygenation of all skin at constant extraction; it is a hundredth
    or less, which no eye sees.
    """
    rows: dict[str, list[ProfileRow]] = {}
    refused: list[UnsupportedRow] = []
    taken: set[tuple[str, str, str]] = set()

    def add(change: Measured, region: str, quantity: Quantity, note: str) -> None:
        numbers = {}
        for key in ("value", "low", "high"):
            number = getattr(change, key)
            numbers[key] = (
                blood_of_index(calibration, change.measure, region, number) if quantity == "hemoglobin" else number
            )
        low, high = BLOOD.room(region, quantity)
        if (change.emotion, region, quantity) in taken:
            refused.append(_refusal(change, region, "not used: the analyser's index of the same region stands"))
        elif not low <= numbers["value"] <= high:
            allowed = f"({low:.4f} to {high:.4f})"
            refused.append(
                _refusal(change, region, f"not used: {numbers['value']:.4g} is more than skin can change {allowed}")
            )
        else:
            taken.add((change.emotion, region, quantity))
            # An end of the interval that no skin reaches is as far as skin goes.
            numbers = {key: _rounded(min(max(number, low), high)) for key, number in numbers.items()}
            row = ProfileRow(
                region=region, quantity=quantity, magnitude="measured", source=tuple(sources), note=note, **numbers
            )
            rows.setdefault(change.emotion, []).append(row)

    for change in sorted(changes, key=lambda c: ("hemoglobin_index", "perfusion", "spo2").index(c.measure)):
        if change.measure == "spo2":
            for region in (*ANATOMY, ELSEWHERE):
                add(
                    change,
                    region,
                    "oxygenation",
                    f"SpO2 {100 * change.value:+.2f} % points, {change.subjects} subjects",
                )
            continue
        at = (change.region,) if change.region else calibration.index_region
        if change.measure == "perfusion":
            at = (calibration.oximeter,) if calibration.oximeter in ANATOMY else ()
            if not at:
                refused.append(
                    _refusal(change, calibration.oximeter, "not used: a finger's perfusion is not the face's")
                )
        elif not at:
            refused.append(
                _refusal(change, "", "not used: the recording does not say where: a column region, or --region")
            )
        for region in at:
            note = f"{change.measure.replace('_', ' ')} {100 * change.value:+.1f} %, {change.subjects} subjects"
            add(change, region, "hemoglobin", note)
    return rows, refused


def _refusal(change: Measured, region: str, verdict: str) -> UnsupportedRow:
    return UnsupportedRow(emotion=change.emotion, measure=change.measure, region=region, verdict=verdict)


def _rounded(value: float) -> float:
    """To four significant digits: more than any study resolves."""
    return float(f"{value:.4g}")


def write_profile(path: str | os.PathLike[str], profile: Profile) -> None:
    """Whole or not at all."""
    lines = [
        "# Changes of blood that were measured, written by `sanguine physiology`: rows of rigs/blood.toml with 95 % intervals.",
        "# docs/physiology.md says how indices became units, and which rows of the table these replace.",
        f"format = {profile.format}",
        f"sanguine = {_text(profile.sanguine)}",
        f"sex = {_text(profile.sex)}",
        f"subjects = {profile.subjects}",
        "",
        "[calibration]",
        *(f"{key} = {_toml(value)}" for key, value in profile.calibration.model_dump().items()),
    ]
    for recording in profile.recording:
        lines += ["", "[[recording]]", *(f"{key} = {_toml(value)}" for key, value in recording.model_dump().items())]
    for kind, rows in (*(("emotion", rows) for rows in profile.emotion), *(("state", rows) for rows in profile.state)):
        lines += ["", f"[[{kind}]]", f"name = {_text(rows.name)}", "change = ["]
        lines += [f"    {_inline(row.model_dump())}," for row in rows.change]
        lines += ["]"]
    if profile.unsupported:
        lines += ["", "# What the recordings do not show: there the rig keeps what it has."]
    for row in profile.unsupported:
        lines += ["[[unsupported]]", *(f"{key} = {_toml(value)}" for key, value in row.model_dump().items())]
    text = "\n".join(lines) + "\n"
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _toml(value: object) -> str:
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, (tuple, list)):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return repr(value)


def _text(value: str) -> str:
    """A basic string of TOML: JSON's escapes, and DEL, which JSON leaves as it is."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _inline(row: Mapping[str, object]) -> str:
    return "{ " + ", ".join(f"{key} = {_toml(value)}" for key, value in row.items()) + " }"
