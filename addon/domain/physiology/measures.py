"""What a recording may measure: columns and their units, what a body can do, and how a change is expressed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Unit:
    """How a column `<measure>_<suffix>` is written.

    factor: a cell times this is in the base unit of the measure. low, high: cells outside are refused. usual: the
    median of a column outside of it is another unit, which `instead` names.
    """

    suffix: str
    factor: float
    low: float
    high: float
    usual: tuple[float, float]
    instead: str = ""


@dataclass(frozen=True)
class Measure:
    """One quantity of a recording.

    name: in messages and plots. device: "oximeter" is one sensor per subject; an "analyser" may visit several regions.
    unit: of values here. relative: changes are ratios to the subject's own baseline, averaged as logarithms; else
    differences. units: how columns may give it. plausible: values outside, in base units, are the sensor's and not
    the body's (guesses, far outside of what rest and emotion do). rate, jitter: a body changes by at most
    jitter + rate x seconds; of the logarithm for a relative measure (guesses; jitter is the device's stated accuracy
    or one beat's variation). frozen_s: no living signal repeats one value for longer (guesses; SpO2 comes in whole
    percents and does stand still at 98 %, melanin does not move within a session).
    """

    id: str
    name: str
    device: Literal["oximeter", "analyser"]
    unit: str
    relative: bool
    units: tuple[Unit, ...]
    plausible: tuple[float, float]
    rate: float
    jitter: float
    frozen_s: float

    @property
    def columns(self) -> dict[str, Unit]:
        """Column name -> unit."""
        return {f"{self.id}_{unit.suffix}" if unit.suffix else self.id: unit for unit in self.units}


MEASURES: Mapping[str, Measure] = {
    measure.id: measure
    for measure in (
        Measure(
            "spo2", "SpO2", "oximeter", "fraction", False,
            (Unit("percent", 0.01, 0.0, 100.0, (2.0, 100.0), "spo2_fraction"),
             Unit("fraction", 1.0, 0.0, 1.0, (0.02, 1.0), "spo2_percent")),
            plausible=(0.5, 1.0), rate=0.015, jitter=0.02, frozen_s=300.0,
        ),
        Measure(
            "pulse", "pulse", "oximeter", "per minute", False,
            (Unit("bpm", 1.0, 0.0, 400.0, (20.0, 400.0), "pulse_hz"),
             Unit("hz", 60.0, 0.0, 400.0, (0.0, 5.0), "pulse_bpm")),
            plausible=(25.0, 230.0), rate=15.0, jitter=8.0, frozen_s=30.0,
        ),
        # Devices show 0.02 to 20 %.
        Measure(
            "perfusion", "perfusion index", "oximeter", "fraction", True,
            (Unit("percent", 0.01, 0.0, 100.0, (0.05, 100.0), "perfusion_fraction"),
             Unit("fraction", 1.0, 0.0, 100.0, (0.0, 0.4), "perfusion_percent")),
            plausible=(1e-4, 0.5), rate=0.5, jitter=0.5, frozen_s=30.0,
        ),
        # Arbitrary units of the device: only the ratio to the subject's own baseline is used.
        Measure(
            "hemoglobin_index", "hemoglobin index", "analyser", "of the device", True,
            (Unit("", 1.0, 0.0, 1e9, (0.0, 1e9)),),
            plausible=(1e-9, 1e9), rate=0.2, jitter=0.3, frozen_s=30.0,
        ),
        Measure(
            "melanin_index", "melanin index", "analyser", "of the device", True,
            (Unit("", 1.0, 0.0, 1e9, (0.0, 1e9)),),
            plausible=(1e-9, 1e9), rate=0.1, jitter=0.2, frozen_s=300.0,
        ),
    )
}  # fmt: skip

COLUMNS: Mapping[str, tuple[Measure, Unit]] = {
    column: (measure, unit) for measure in MEASURES.values() for column, unit in measure.columns.items()
}
"""Column name -> what it measures and how it is written."""

TIME_COLUMNS: Mapping[str, float] = {"time_s": 1.0, "time_ms": 0.001}
"""Column name -> seconds per unit."""
