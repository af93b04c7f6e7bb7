"""Blood: how it lies at rest, and where each emotion and each state of the body brings it, by region.

This is the settled answer, which holds once an emotion has stood long enough; `vascular.py` has the way there.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import sanguine_core
from pydantic import Field

from .errors import InputError, nearest
from .facs import EMOTION_CONTROLS, EMOTION_MAX
from .resources import Row, read_rows, read_table, rigs_path
from .response import Response

Quantity = Literal["hemoglobin", "oxygenation"]
FEATURE = "feature"
"""In the place of a quantity: the strength of something that grows on the skin (`sanguine_core.features()`), 0 to 1, whose
id stands in the place of the region."""

Sources = Annotated[tuple[str, ...], Field(min_length=1)]
Change = tuple[float, float]
"""The lowest and the highest change of a quantity that some moment or mix brings."""

ELSEWHERE = "elsewhere"
"""The skin that no region mask covers."""

BLOOD_CONTROL = "blood"
BLOOD_CONTROL_MAX = 2.0
"""The artist's slider over all blood change: 0 none, 1 as in life, above 1 exaggerated."""

PACE_CONTROL = "blood_pace"
PACE = (0.1, 10.0)
"""The slider over how fast blood follows: 1 as in life, above 1 hurried, for shots shorter than a blush is."""

PULSE_CONTROL = "pulse"
HEART_RATE_CONTROL = "heart_rate"
"""Sliders of the heartbeat: how strongly it shows (1 as in life) and its rate per minute. Only baked blood has it."""

PRESSURE_CONTROL = "pressure"
"""The slider over what presses on the skin, where the face says that something does."""

MOOD_SUFFIX = "_blood"
"""`anger_blood` moves the blood of anger without its muscles: for captured performances, which have the muscles."""


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
    # The time course, an id of rigs/vascular.toml; left out, that of the emotion or state, else of the quantity.
    kinetics: str = ""


class Reference(Row):
    """The skin the changes were sized on, and the limits twice any change keeps it in."""

    hemoglobin: float
    oxygenation: float
    hemoglobin_limits: tuple[float, float]
    oxygenation_limits: tuple[float, float]


class StateRow(Row):
    """One table of rigs/states.toml."""

    label: str
    help: str


class _States(Row):
    state: dict[Annotated[str, Field(pattern=r"^[a-z][a-z_]*$")], StateRow]


class _Anatomy(Row):
    baseline: tuple[RestRow, ...]


class _Changes(Row):
    name: str
    kinetics: str = ""
    change: tuple[ChangeRow, ...] = ()
    # What comes out on the skin by it, a feature's id: the slider is its strength.
    feature: str = ""


class _Blood(Row):
    reference: Reference
    emotion: tuple[_Changes, ...]
    state: tuple[_Changes, ...] = ()


@dataclass(frozen=True)
class Rest:
    """A region's skin relative to the skin as a whole: factors, and for oxygenation an offset."""

    hemoglobin: float = 1.0
    melanin: float = 1.0
    oil: float = 1.0
    oxygenation: float = 0.0


@dataclass(frozen=True)
class Drive:
    """What one slider at 1 adds to a channel once it has settled, and the time course by which it does."""

    control: str
    value: float
    kinetics: str


@dataclass(frozen=True)
class BloodChannel:
    """One quantity of one region, the sliders that move it, and how far its vessels go at most."""

    region: str
    quantity: Quantity | Literal["feature"]
    drives: tuple[Drive, ...]
    low: float
    high: float

    @property
    def property_name(self) -> str:
        return blood_property(self.quantity, self.region)

    @property
    def response(self) -> Response:
        """The settled answer: drives add up and cancel, but vessels open no wider, and close no further, than they can."""
        terms = tuple((drive.value, drive.control) for drive in self.drives)
        return Response(terms, self.low, self.high, gain=BLOOD_CONTROL)

    @property
    def reach(self) -> Change:
        """Lowest and highest value that any mix of the sliders brings."""
        ends = [drive.value * control_max(drive.control) for drive in self.drives]
        low, high = sum(end for end in ends if end < 0.0), sum(end for end in ends if end > 0.0)
        return BLOOD_CONTROL_MAX * max(low, self.low), BLOOD_CONTROL_MAX * min(high, self.high)


@dataclass(frozen=True)
class Blood:
    """Every change by (region, quantity) of every emotion and state, on the skin that they were sized on."""

    reference: Reference
    anatomy: Mapping[str, Rest]
    drives: Mapping[tuple[str, str], tuple[Drive, ...]]

    def channels(self, controls: Collection[str]) -> dict[tuple[str, str], BloodChannel]:
        """(region, quantity) -> channel, of a rig that has these sliders. What none of them moves is left out."""
        made = {}
        for (region, quantity), drives in self.drives.items():
            found = [drive for drive in drives if drive.control in controls]
            found += [
                replace(drive, control=mood) for drive in drives if (mood := drive.control + MOOD_SUFFIX) in controls
            ]
            if found:
                # Limits are the vessels' own, so that the same mix gives the same blood on every rig.
                low, high = self._limits(region, quantity, drives)
                made[region, quantity] = BloodChannel(region, quantity, tuple(found), low, high)
        return made

    def _limits(self, region: str, quantity: str, drives: Iterable[Drive]) -> Change:
        """As far as the strongest single slider goes, and with the artist's exaggeration no further than skin can."""
        ends = [drive.value * control_max(drive.control) for drive in drives]
        low, high = self.room(region, quantity)
        return max(min(0.0, *ends), low), min(max(0.0, *ends), high)

    def room(self, region: str, quantity: str) -> Change:
        """How far the reference skin may change so that twice of it stays within its limits."""
        if quantity == FEATURE:
            return 0.0, 1.0
        at_rest, limits = self.at_rest(region, quantity), getattr(self.reference, f"{quantity}_limits")
        return (limits[0] - at_rest) / BLOOD_CONTROL_MAX, (limits[1] - at_rest) / BLOOD_CONTROL_MAX

    def at_rest(self, region: str, quantity: str) -> float:
        """The reference skin's own value in a region."""
        rest = self.anatomy.get(region, Rest())
        if quantity == "hemoglobin":
            return self.reference.hemoglobin * rest.hemoglobin
        return self.reference.oxygenation + rest.oxygenation


def control_max(control: str) -> float:
    """How far the slider of an emotion or state goes."""
    return EMOTION_MAX if control.removesuffix(MOOD_SUFFIX) in EMOTION_CONTROLS else 1.0


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


def read_states(path: Path) -> dict[str, StateRow]:
    """States of the body by name. Raises InputError for one that has the name of an emotion."""
    states = read_table(path, _States).state
    for name in states:
        if name in EMOTION_CONTROLS:
            raise InputError(f"{path}: state.{name}: an emotion has this name, choose another")
    return states


def read_blood(
    path: Path, anatomy: Mapping[str, Rest], evidence: Mapping[str, Evidence], states: Collection[str] = ()
) -> Blood:
    """Raises InputError for unknown names and for changes that no skin could make."""
    table = read_table(path, _Blood)
    blood = Blood(table.reference, anatomy, {})
    drives: dict[tuple[str, str], dict[str, Drive]] = {}
    for kind, known, rows in (("emotion", EMOTION_CONTROLS, table.emotion), ("state", states, table.state)):
        for group in rows:
            if group.name not in known:
                raise InputError(f"{path}: {kind}: {group.name}: no such {kind}, {nearest(group.name, known)}")
            for row in group.change:
                where = f"{path}: {group.name} {row.region} {row.quantity}"
                _check_source(row.source, evidence, where)
                if row.region not in (*anatomy, ELSEWHERE):
                    raise InputError(f"{where}: no such region, {nearest(row.region, (*anatomy, ELSEWHERE))}")
                _check_plausible(row, blood, where)
                channel = drives.setdefault((row.region, row.quantity), {})
                if group.name in channel:
                    raise InputError(f"{where}: given twice, remove one")
                kinetics = row.kinetics or group.kinetics or usual_kinetics(row.quantity, row.value)
                channel[group.name] = Drive(group.name, row.value, kinetics)
            if group.feature:
                if group.feature not in FEATURES:
                    raise InputError(f"{path}: {group.name}: feature: {group.feature}: no such feature, {nearest(group.feature, FEATURES)}")
                channel = drives.setdefault((group.feature, FEATURE), {})
                channel[group.name] = Drive(group.name, 1.0, group.kinetics or usual_kinetics(FEATURE, 1.0))
            elif not group.change:
                raise InputError(f"{path}: {group.name}: change: it changes nothing, give it rows or a feature")
    return replace(blood, drives={key: tuple(channel.values()) for key, channel in drives.items()})


def usual_kinetics(quantity: str, value: float) -> str:
    """The time course of a change that has none of its own."""
    if quantity == "oxygenation":
        return "oxygenation"
    return "dilation" if value >= 0.0 else "constriction"


def _check_source(sources: tuple[str, ...], evidence: Mapping[str, Evidence], where: str) -> None:
    for source in sources:
        if source not in evidence:
            raise InputError(f"{where}: source: {source}: no such row in evidence.csv, {nearest(source, evidence)}")


def _check_plausible(row: ChangeRow, blood: Blood, where: str) -> None:
    low, high = blood.room(row.region, row.quantity)
    if not low <= row.value <= high:
        limits = getattr(blood.reference, f"{row.quantity}_limits")
        raise InputError(
            f"{where}: {row.value} would take the reference skin beyond {limits[0]:g} to {limits[1]:g} at {BLOOD_CONTROL} = "
            f"{BLOOD_CONTROL_MAX:g}: keep it from {low:.4f} to {high:.4f}"
        )


# What the material can fade in and out: colour and height of the skin. Ink is an axis of its own and stays.
FEATURES: tuple[str, ...] = tuple(
    row["id"] for row in sanguine_core.features() if all(change["channel"] != "ink_per_mm" for change in row["changes"])
)
"""Features that a state may bring out."""

EVIDENCE: dict[str, Evidence] = {row.id: row for row in read_rows(rigs_path("evidence.csv"), Evidence)}
ANATOMY: dict[str, Rest] = read_anatomy(rigs_path("anatomy.toml"), EVIDENCE)
STATES: dict[str, StateRow] = read_states(rigs_path("states.toml"))
BLOOD: Blood = read_blood(rigs_path("blood.toml"), ANATOMY, EVIDENCE, STATES)

BLOOD_DRIVERS: tuple[str, ...] = (*EMOTION_CONTROLS, *STATES)
"""Every slider that moves blood."""


def settled(
    controls: Mapping[str, float], amount: float = 1.0, blood: Blood = BLOOD
) -> dict[tuple[str, str], float]:
    """(region, quantity) -> settled change under a mix of emotions and states; what does not move is left out."""
    values = {**controls, BLOOD_CONTROL: amount}
    moved = {key: channel.response.value(values) for key, channel in blood.channels(controls).items()}
    return {key: value for key, value in moved.items() if value}


def blood_change(controls: Mapping[str, float], region: str, amount: float = 1.0) -> tuple[float, float]:
    """Settled change of (hemoglobin, oxygenation) in `region` under a mix of emotions and states."""
    moved = settled(controls, amount)
    return moved.get((region, "hemoglobin"), 0.0), moved.get((region, "oxygenation"), 0.0)
