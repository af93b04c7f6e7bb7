"""An emotion profile: changes of blood that were measured in people, as `sanguine physiology` writes them.

Its rows are those of rigs/blood.toml, with the interval beside the value. A rig that reads a profile takes its rows in
place of the table's for the same emotion, region and quantity; what the profile does not have stays as it is.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Literal

from pydantic import Field

from .blood import ANATOMY, BLOOD_CONTROL_MAX, Quantity, Reference, Rest, Sources
from .errors import InputError, nearest
from .facs import EMOTION_CONTROLS
from .files import atomic, read_toml, validate
from .resources import Row, rigs_path

FORMAT = 1


class RecordingRow(Row):
    """A file that the profile comes from."""

    file: str
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    samples: Annotated[int, Field(ge=0)]


class Calibration(Row):
    """How indices became units: change of blood volume fraction = index_gain x relative change of the index x
    reference_hemoglobin x the region's factor at rest."""

    index_gain: Annotated[float, Field(gt=0.0, le=100.0)]
    index_region: tuple[str, ...]
    oximeter: str
    reference_hemoglobin: float
    note: str


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


class EmotionRows(Row):
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
    emotion: tuple[EmotionRows, ...] = ()
    unsupported: tuple[UnsupportedRow, ...] = ()

    @property
    def rows(self) -> dict[tuple[str, str, str], ProfileRow]:
        """(emotion, region, quantity) -> row."""
        return {(rows.name, row.region, row.quantity): row for rows in self.emotion for row in rows.change}


def read_profile(path: str | os.PathLike[str]) -> Profile:
    """A checked profile. Raises InputError, one line with file, key and mend."""
    profile = validate(Profile, read_toml(path), path)
    files = [recording.file for recording in profile.recording]
    seen = set()
    for rows in profile.emotion:
        if rows.name not in EMOTION_CONTROLS:
            raise InputError(f"{path}: emotion: {rows.name}: no such emotion, {nearest(rows.name, EMOTION_CONTROLS)}")
        for row in rows.change:
            where = f"{path}: {rows.name} {row.region} {row.quantity}"
            if row.region not in ANATOMY:
                raise InputError(f"{where}: no such region, {nearest(row.region, ANATOMY)}")
            if (rows.name, row.region, row.quantity) in seen:
                raise InputError(f"{where}: given twice, remove one")
            seen.add((rows.name, row.region, row.quantity))
            for source in row.source:
                if source not in files:
                    raise InputError(f"{where}: source: {source}: not among the recordings, {nearest(source, files)}")
            if not row.low <= row.value <= row.high:
                raise InputError(f"{where}: value {row.value:g} is not between low {row.low:g} and high {row.high:g}")
            low, high = room(row.region, row.quantity)
            if not low <= row.value <= high:
                raise InputError(f"{where}: {row.value:g} is more than skin can change: keep it from {low:.4f} to {high:.4f}")
    return profile


@lru_cache(maxsize=1)
def _reference() -> Reference:
    return validate(Reference, read_toml(rigs_path("blood.toml"))["reference"], rigs_path("blood.toml"))


def at_rest(region: str, quantity: str) -> float:
    """The reference skin's own value in a region."""
    rest = ANATOMY.get(region, Rest())
    if quantity == "hemoglobin":
        return _reference().hemoglobin * rest.hemoglobin
    return _reference().oxygenation + rest.oxygenation


def room(region: str, quantity: str) -> tuple[float, float]:
    """How far the reference skin may change so that the slider's full exaggeration stays within its limits."""
    limits = getattr(_reference(), f"{quantity}_limits")
    return tuple((limit - at_rest(region, quantity)) / BLOOD_CONTROL_MAX for limit in limits)


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


def profile_rows(
    changes: Sequence[Measured], index_gain: float, index_regions: Sequence[str], oximeter: str, sources: Sequence[str]
) -> tuple[dict[str, list[ProfileRow]], list[UnsupportedRow]]:
    """(emotion -> rows, what cannot become one).

    A hemoglobin index, or the perfusion index of an oximeter on the face, changes by the share that blood does, times
    index_gain. A finger's perfusion says nothing of the face: it narrows while the face flushes (Drummond and Quah
    2001). A change of SpO2 is one of arterial blood, which adds to the oxygenation of all skin at constant extraction;
    it is a hundredth or less, which no eye sees.

    index_regions: where an index without a region was taken. oximeter: "finger" or a region.
    """
    rows: dict[str, list[ProfileRow]] = {}
    refused: list[UnsupportedRow] = []
    taken: set[tuple[str, str, str]] = set()

    def add(change: Measured, region: str, quantity: Quantity, factor: float, note: str) -> None:
        low, high = room(region, quantity)
        value = change.value * factor
        if (change.emotion, region, quantity) in taken:
            refused.append(_refusal(change, region, "not used: the analyser's index of the same region stands"))
        elif not low <= value <= high:
            refused.append(_refusal(change, region, f"not used: {value:.4g} is more than skin can change ({low:.4f} to {high:.4f})"))
        else:
            taken.add((change.emotion, region, quantity))
            numbers = {key: _rounded(getattr(change, key) * factor) for key in ("value", "low", "high")}
            row = ProfileRow(region=region, quantity=quantity, magnitude="measured", source=tuple(sources), note=note, **numbers)
            rows.setdefault(change.emotion, []).append(row)

    for change in sorted(changes, key=lambda c: ("hemoglobin_index", "perfusion", "spo2").index(c.measure)):
        if change.measure == "spo2":
            for region in ANATOMY:
                add(change, region, "oxygenation", 1.0, f"SpO2 {100 * change.value:+.2f} % points, {change.subjects} subjects")
            continue
        at = (change.region,) if change.region else tuple(index_regions)
        if change.measure == "perfusion":
            at = (oximeter,) if oximeter in ANATOMY else ()
            if not at:
                refused.append(_refusal(change, oximeter, "not used: a finger's perfusion is not the face's"))
        elif not at:
            refused.append(_refusal(change, "", "not used: the recording does not say where: a column region, or --region"))
        for region in at:
            note = f"{change.measure.replace('_', ' ')} {100 * change.value:+.1f} %, {change.subjects} subjects"
            add(change, region, "hemoglobin", index_gain * at_rest(region, "hemoglobin"), note)
    return rows, refused


def _refusal(change: Measured, region: str, verdict: str) -> UnsupportedRow:
    return UnsupportedRow(emotion=change.emotion, measure=change.measure, region=region, verdict=verdict)


def _rounded(value: float) -> float:
    """To four significant digits: more than any study resolves."""
    return float(f"{value:.4g}") if math.isfinite(value) else value


def write_profile(path: str | os.PathLike[str], profile: Profile) -> None:
    """Whole or not at all."""
    lines = [
        "# Changes of blood that were measured, written by `sanguine physiology`; read in place of the same rows of",
        "# rigs/blood.toml. low and high are 95 % intervals. docs/physiology.md says how indices became units.",
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
    for rows in profile.emotion:
        lines += ["", "[[emotion]]", f"name = {_text(rows.name)}", "change = ["]
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
