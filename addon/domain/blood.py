"""Blood: how it lies at rest, and where each emotion and each state of the body brings it, by region.

This is the settled answer, which holds once an emotion has stood long enough; `vascular.py` has the way there.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from .errors import InputError, nearest
from .facs import EMOTION_CONTROLS, EMOTION_MAX
from .resources import Row, read_rows, read_table, rigs_path
from .response import Response

Quantity = Literal["hemoglobin", "oxygenation"]
Sources = Annotated[tuple[str, ...], Field(min_length=1)]
Change = tuple[float, float]
"""The lowest and the highest change of a quantity that some moment or mix brings."""

ELSEWHERE = "elsewhere"
"""The skin that no region mask covers."""

BLOOD_CONTROL = "blood"
BLOOD_CONTROL_MAX = 2.0
"""The artist's slider over all blood change: 0 none, 1 as in life, above 1 exaggerated."""

PULSE_CONTROL = "pulse"
HEART_RATE_CONTROL = "heart_rate"
"""Sliders of the heartbeat: how strongly it shows (1 as in life) and its rate per minute. Only baked blood has it."""

PRESSURE_CONTROL = "pressure"
"""The slider over what presses on the skin, where the face says that something does."""

MOOD_SUFFIX = "_blood"
"""`anger_blood` moves the blood of anger without its muscles: for captured performances, which have the muscles."""

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
    change: tuple[ChangeRow, ...]


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
    quantity: Quantity
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
    def blood_change(controls: Mapping[str, float], region: str, amount: float = 1.0) -> tuple[float, float]:
    """Settled change of (hemoglobin, oxygenation) in `region` under a mix of emotions and states."""
    moved = settled(controls, amount)
    return moved.get((region, "hemoglobin"), 0.0), moved.get((region, "oxygenation"), 0.0)
