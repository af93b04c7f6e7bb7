"""Blood: how it lies at rest, and how each emotion moves it, by region."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from .errors import InputError, nearest
from .facs import EMOTION_CONTROLS
from .resources import Row, read_rows, read_table, rigs_path
from .response import Response

Quantity = Literal["hemoglobin", "oxygenation"]
Sources = Annotated[tuple[str, ...], Field(min_length=1)]

BLOOD_CONTROL = "blood"
BLOOD_CONTROL_MAX = 2.0
"""The artist's slider over all blood change: 0 none, 1 as declared, 2 twice."""

STATES: dict[str, str] = {}
"""States of the body (exertion, cold, ...) -> help: sliders 0-1 that move blood and no muscle."""


class Evidence(Row):
    """One row of rigs/evidence.csv: what was seen, in whom, by whom."""

    id: str
    emotion_or_condition: str
    region: str
    measure: str
    direction: str
    magnitude: str
    n_subjects: str
    source: str
    status: Literal["seen_abstract", "seen_summary", "seen_press", "computed_from_data", "remembered"]


class RestRow(Row):
    """One row of rigs/anatomy.toml."""

    region: str
    quantity: Literal["hemoglobin", "melanin", "oil", "oxygenation"]
    value: float
    magnitude: Literal["measured", "derived", "guess"]
    source: Sources
    note: str = ""


class ChangeRow(Row):
    """One change of rigs/blood.toml."""

    region: str
    quantity: Quantity
    value: float
    magnitude: Literal["measured", "guess"]
    source: Sources
    note: str = ""


class Reference(Row):
    """The skin the changes were sized on, and the limits twice any change keeps it in."""

    hemoglobin: float
    oxygenation: float
    hemoglobin_limits: tuple[float, float]
    oxygenation_limits: tuple[float, float]


class _Anatomy(Row):
    baseline: tuple[RestRow, ...]


class _EmotionChange(Row):
    name: str
    change: tuple[ChangeRow, ...]


class _Blood(Row):
    reference: Reference
    emotion: tuple[_EmotionChange, ...]


@dataclass(frozen=True)
class Rest:
    """A region's skin relative to the skin as a whole: factors, and for oxygenation an offset."""

    hemoglobin: float = 1.0
    melanin: float = 1.0
    oil: float = 1.0
    oxygenation: float = 0.0


@dataclass(frozen=True)
class BloodChannel:
    """One quantity of one region that some emotion moves."""

    region: str
    quantity: Quantity
    response: Response

    @property
    def property_name(self) -> str:
        return blood_property(self.quantity, self.region)


def blood_property(quantity: str, region: str) -> str:
    """Name of the object property that carries the change into the material."""
    return f"blood_{quantity}_{region}"


def read_anatomy(path: Path, evidence: Mapping[str, Evidence]) -> dict[str, Rest]:
    """Region -> its skin at rest. Raises InputError for a pair given twice or a source that is not in `evidence`."""
    values: dict[str, dict[str, float]] = {}
    for row in read_table(path, _Anatomy).baseline:
        where = f"{path}: {row.region} {row.quantity}"
        _check_source(row.source, evidence, where)
        region = values.setdefault(row.region, {})
        if row.quantity in region:
            raise InputError(f"{where}: given twice, remove one")
        region[row.quantity] = row.value
    return {region: Rest(**row) for region, row in values.items()}


def read_blood(
    path: Path, anatomy: Mapping[str, Rest], evidence: Mapping[str, Evidence]
) -> dict[tuple[str, str], BloodChannel]:
    """(region, quantity) -> channel. Raises InputError for unknown names and for changes no skin could make."""
    table = read_table(path, _Blood)
    terms: dict[tuple[str, str], dict[str, float]] = {}
    for emotion in table.emotion:
        if emotion.name not in EMOTION_CONTROLS:
            raise InputError(f"{path}: emotion: {emotion.name}: no such emotion, {nearest(emotion.name, EMOTION_CONTROLS)}")
        for row in emotion.change:
            where = f"{path}: {emotion.name} {row.region} {row.quantity}"
            _check_source(row.source, evidence, where)
            if row.region not in anatomy:
                raise InputError(f"{where}: no such region, {nearest(row.region, anatomy)}")
            _check_plausible(row, anatomy[row.region], table.reference, where)
            changes = terms.setdefault((row.region, row.quantity), {})
            if emotion.name in changes:
                raise InputError(f"{where}: given twice, remove one")
            changes[emotion.name] = row.value
    return {key: BloodChannel(*key, _response(changes)) for key, changes in terms.items()}


def _response(changes: Mapping[str, float]) -> Response:
    """Emotions add up and cancel, but vessels open no wider, and close no further, than for the strongest one."""
    values = changes.values()
    return Response(
        tuple((value, emotion) for emotion, value in changes.items()),
        low=min(0.0, *values),
        high=max(0.0, *values),
        gain=BLOOD_CONTROL,
    )


def _check_source(sources: tuple[str, ...], evidence: Mapping[str, Evidence], where: str) -> None:
    for source in sources:
        if source not in evidence:
            raise InputError(f"{where}: source: {source}: no such row in evidence.csv, {nearest(source, evidence)}")


def _check_plausible(row: ChangeRow, rest: Rest, reference: Reference, where: str) -> None:
    if row.quantity == "hemoglobin":
        at_rest, (low, high) = reference.hemoglobin * rest.hemoglobin, reference.hemoglobin_limits
    else:
        at_rest, (low, high) = reference.oxygenation + rest.oxygenation, reference.oxygenation_limits
    low_change, high_change = ((limit - at_rest) / BLOOD_CONTROL_MAX for limit in (low, high))
    if not low_change <= row.value <= high_change:
        raise InputError(
            f"{where}: {row.value} would take the reference skin beyond {low:g} to {high:g} at {BLOOD_CONTROL} = "
            f"{BLOOD_CONTROL_MAX:g}: keep it from {low_change:.4f} to {high_change:.4f}"
        )


EVIDENCE: dict[str, Evidence] = {row.id: row for row in read_rows(rigs_path("evidence.csv"), Evidence)}
ANATOMY: dict[str, Rest] = read_anatomy(rigs_path("anatomy.toml"), EVIDENCE)
BLOOD_CHANNELS: dict[tuple[str, str], BloodChannel] = read_blood(rigs_path("blood.toml"), ANATOMY, EVIDENCE)


def blood_change(emotions: Mapping[str, float], region: str, amount: float = 1.0) -> tuple[float, float]:
    """Settled change of (hemoglobin, oxygenation) in `region` under a mix of emotions, each 0-1."""
    controls = {**emotions, BLOOD_CONTROL: amount}
    hemoglobin, oxygenation = (
        channel.response.value(controls) if (channel := BLOOD_CHANNELS.get((region, quantity))) else 0.0
        for quantity in ("hemoglobin", "oxygenation")
    )
    return hemoglobin, oxygenation


def blood_bounds(
    emotions: Mapping[str, float], amount: float, region: str, quantity: str, mixable: bool = False
) -> tuple[float, float]:
    """Lowest and highest change of one quantity: of this very mix, or (`mixable`) of every mix the sliders allow."""
    channel = BLOOD_CHANNELS.get((region, quantity))
    if channel is None:
        return 0.0, 0.0
    if mixable:
        return BLOOD_CONTROL_MAX * channel.response.low, BLOOD_CONTROL_MAX * channel.response.high
    value = channel.response.value({**emotions, BLOOD_CONTROL: amount})
    return value, value
