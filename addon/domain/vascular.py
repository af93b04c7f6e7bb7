"""Blood in time: vessels open and close by their own time constants, after a delay, and the heart beats in them.

Every slider that moves blood asks for a settled answer (`blood.py`). What it asks for in one region and by one time
course is a target u(t), with its sign taken off; the blood y(t) follows by

    dy/dt = (u(t - delay) - y) / tau,   tau = attack where u > y, decay where u < y,

and the channel is the sum of its parts, held within what the vessels can. Between frames u is linear, and for a linear
u this equation has a closed solution (including the moment at which it passes from attack to decay): the update is
exact, so a step of any length gives the same blood as many short ones, and errors do not add up. Before the first
frame all is taken to have stood still: the blood starts settled.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from .blood import (
    ANATOMY,
    BLOOD,
    BLOOD_CONTROL,
    BLOOD_CONTROL_MAX,
    ELSEWHERE,
    EVIDENCE,
    HEART_RATE_CONTROL,
    PACE,
    PACE_CONTROL,
    PULSE_CONTROL,
    Blood,
    BloodChannel,
    Change,
    Evidence,
)
from .errors import InputError, nearest
from .resources import Row, read_table, rigs_path

Seconds = Annotated[float, Field(ge=0.0, le=86400.0, allow_inf_nan=False)]
Factor = Annotated[float, Field(ge=0.1, le=10.0, allow_inf_nan=False)]
Basis = Literal["measured", "derived", "default"]

# A time constant below this is an answer at once; it keeps the formulas free of divisions by 0.
_INSTANT_S = 1e-9
HEART_RATE = (20.0, 250.0)
HEART_RATE_AT_REST = 70.0


class _Sourced(Row):
    basis: Basis
    source: tuple[str, ...]
    note: str = ""

    def check(self, where: str, evidence: Mapping[str, Evidence]) -> None:
        for source in self.source:
            if source not in evidence:
                raise InputError(f"{where}: source: {source}: no such row in evidence.csv, {nearest(source, evidence)}")
        if self.basis != "default" and not self.source:
            raise InputError(f"{where}: source: basis is '{self.basis}', so name its source, or make it 'default'")

    @property
    def told_by(self) -> str:
        """Its sources for people."""
        told = ", ".join(self.source)
        if self.basis == "default":
            return f"default, {f'after {told}' if told else 'no source'}"
        return f"{self.basis}, {told}"


class Kinetics(_Sourced):
    """One time course of rigs/vascular.toml."""

    id: str
    label: str
    delay_s: Seconds
    attack_s: Seconds
    decay_s: Seconds


class RegionKinetics(_Sourced):
    """How a region differs from the rest by some time courses."""

    region: str
    kinetics: tuple[str, ...]
    delay_s: Seconds
    attack: Factor
    decay: Factor


class Pulse(_Sourced):
    """The heartbeat in the skin's blood."""

    depth: Annotated[float, Field(ge=0.0, le=0.5)]
    harmonics: Annotated[tuple[float, ...], Field(min_length=1, max_length=8)]
    delay_s: dict[str, Seconds]

    def wave(self, beats: np.ndarray) -> np.ndarray:
        """The swing after so many heartbeats: mean 0, 1 from lowest to highest."""
        total = self._sum(beats)
        one = self._sum(np.linspace(0.0, 1.0, 721))
        return total / (one.max() - one.min())

    def _sum(self, beats: np.ndarray) -> np.ndarray:
        turns = 2.0 * np.pi * np.asarray(beats)
        return sum(share * np.sin((k + 1) * turns) for k, share in enumerate(self.harmonics))


class Vascular(Row):
    """rigs/vascular.toml"""

    kinetics: tuple[Kinetics, ...]
    region: tuple[RegionKinetics, ...]
    pulse: Pulse

    def times(self, kinetics: str, region: str) -> tuple[float, float, float]:
        """(delay_s, attack_s, decay_s) of a time course in a region."""
        course = next(row for row in self.kinetics if row.id == kinetics)
        delay, attack, decay = course.delay_s, course.attack_s, course.decay_s
        for row in self.region:
            if row.region == region and kinetics in row.kinetics:
                delay, attack, decay = delay + row.delay_s, attack * row.attack, decay * row.decay
        return delay, attack, decay


def read_vascular(path: Path, blood: Blood, evidence: Mapping[str, Evidence]) -> Vascular:
    """Raises InputError for unknown sources, regions and time courses, and for one that `blood` needs and is missing."""
    table = read_table(path, Vascular)
    ids = [row.id for row in table.kinetics]
    regions = (*ANATOMY, ELSEWHERE)
    for row in table.kinetics:
        row.check(f"{path}: kinetics {row.id}", evidence)
        if ids.count(row.id) > 1:
            raise InputError(f"{path}: kinetics {row.id}: given twice, remove one")
    for row in table.region:
        row.check(f"{path}: region {row.region}", evidence)
        for name, known, kind in ((row.region, regions, "region"), *((k, ids, "kinetics") for k in row.kinetics)):
            if name not in known:
                raise InputError(f"{path}: region {row.region}: {name}: no such {kind}, {nearest(name, known)}")
    table.pulse.check(f"{path}: pulse", evidence)
    for region in table.pulse.delay_s:
        if region not in regions:
            raise InputError(f"{path}: pulse.delay_s: {region}: no such region, {nearest(region, regions)}")
    for name in ("refill", *{drive.kinetics for drives in blood.drives.values() for drive in drives}):
        if name not in ids:
            raise InputError(f"{path}: kinetics: {name}: blood.toml names it and it is not here, {nearest(name, ids)}")
    return table


VASCULAR: Vascular = read_vascular(rigs_path("vascular.toml"), BLOOD, EVIDENCE)


@dataclass(frozen=True)
class Controls:
    """Sliders over time: their values at times that rise. A slider that is missing is at rest all the time.

    time_s : shape (n,), seconds
    values : slider -> shape (n,)
    """

    time_s: np.ndarray
    values: Mapping[str, np.ndarray]

    @property
    def blood_time_s(self) -> np.ndarray:
        """The blood's own clock, which the artist's pace makes run faster or slower than time."""
        pace = np.clip(np.broadcast_to(self.values.get(PACE_CONTROL, 1.0), self.time_s.shape), *PACE)
        if (pace == 1.0).all():
            return self.time_s
        return _integral(pace, self.time_s)


def _integral(rate: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """Since the first moment, of a rate that is linear between times."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time_s))])


def follow(
    target: np.ndarray,
    time_s: np.ndarray,
    delay_s: float | np.ndarray,
    attack_s: float | np.ndarray,
    decay_s: float | np.ndarray,
) -> np.ndarray:
    """The blood that follows a target of one sign, exact for a target that is linear between its times.

    Parameters
    ----------
    target : (n,) or (n, m), at least 0; m targets with the same times
    time_s : (n,) rising
    delay_s, attack_s, decay_s : at least 0, of all targets or (m,) of each

    Returns
    -------
    array of the shape of `target`, never outside of what the target has been

    Examples
    --------
    >>> time_s = np.array([0.0, 1e-9, 5.0])
    >>> follow(np.array([0.0, 1.0, 1.0]), time_s, 0.0, 5.0, 40.0).round(3)
    array([0.   , 0.   , 0.632])
    """
    shape = np.shape(target)
    t = np.asarray(time_s, float)
    u = np.asarray(target, float).reshape(len(t), -1)
    m = u.shape[1]
    delay, attack, decay = (np.broadcast_to(np.asarray(a, float), (m,)) for a in (delay_s, attack_s, decay_s))
    attack, decay = np.maximum(attack, _INSTANT_S), np.maximum(decay, _INSTANT_S)
    if len(t) == 1:
        return np.array(u).reshape(shape)
    step = np.diff(t)
    slope = np.diff(u, axis=0) / step[:, None]
    at_knots = np.empty_like(u)
    at_knots[0] = u[0]
    for k in range(len(t) - 1):
        at_knots[k + 1] = _advance(at_knots[k], u[k], slope[k], step[k], attack, decay)
    if not delay.any():
        return at_knots.reshape(shape)
    asked = t[:, None] - delay
    k = np.clip(np.searchsorted(t, asked, side="right") - 1, 0, len(t) - 2)
    column = np.arange(m)
    since = np.maximum(asked - t[k], 0.0)  # before the first moment all stood as it stands then
    return _advance(at_knots[k, column], u[k, column], slope[k, column], since, attack, decay).reshape(shape)


def _advance(y, u, slope, step_s, attack_s, decay_s) -> np.ndarray:
    """y after `step_s` under a target that is `u` now and changes by `slope` per second. Arrays broadcast.

    The gap e = y - u obeys e' = -e / tau - slope, so e(t) = (e0 + slope tau) exp(-t / tau) - slope tau. It passes 0 at
    most once in a step, after which the other time constant holds.
    """
    gap = y - u
    rising = (gap < 0.0) | ((gap == 0.0) & (slope > 0.0))
    first, second = np.where(rising, attack_s, decay_s), np.where(slope > 0.0, attack_s, decay_s)
    # The gap closes where the target comes to meet the blood, after log1p(gap / (slope tau)) time constants.
    meets = gap * slope > 0.0
    with np.errstate(over="ignore"):  # a slope too small to meet it ever
        ratio = np.divide(gap, slope * first, out=np.zeros(np.shape(meets)), where=meets)
    crossing = np.where(meets, first * np.log1p(ratio), np.inf)
    met = crossing < step_s
    tau, left = np.where(met, second, first), np.where(met, step_s - crossing, step_s) if met.any() else step_s
    gap = np.where(met, 0.0, gap) * np.exp(-left / tau) + slope * tau * np.expm1(-left / tau)
    return np.maximum(u + slope * step_s + gap, 0.0)


def blood_over_time(
    controls: Controls, blood: Blood = BLOOD, vascular: Vascular = VASCULAR
) -> dict[tuple[str, str], np.ndarray]:
    """(region, quantity) -> its change at each time, of the channels that the sliders move; the exaggeration is in it."""
    values = controls.values
    gain = np.asarray(values.get(BLOOD_CONTROL, 1.0))
    channels = blood.channels([name for name, series in values.items() if np.any(series)])
    made = {key: gain * change for key, change in _answers(channels, controls, vascular).items()}
    strength = np.asarray(values.get(PULSE_CONTROL, 0.0))
    if strength.any():
        for region, delay_s in vascular.pulse.delay_s.items():
            depth = vascular.pulse.depth * blood.at_rest(region, "hemoglobin")
            swing = gain * strength * depth * vascular.pulse.wave(_beats(controls, delay_s))
            made[region, "hemoglobin"] = made.get((region, "hemoglobin"), 0.0) + swing
    return made


def _answers(
    channels: Mapping[tuple[str, str], BloodChannel], controls: Controls, vascular: Vascular
) -> dict[tuple[str, str], np.ndarray]:
    """Every channel without gain. All parts, each of one time course and one sign, are followed at once."""
    parts: dict[tuple[tuple[str, str], str, float], np.ndarray] = {}
    for key, channel in channels.items():
        for drive in channel.drives:
            part = key, drive.kinetics, np.sign(drive.value)
            parts[part] = parts.get(part, 0.0) + abs(drive.value) * np.asarray(controls.values[drive.control], float)
    if not parts:
        return {}
    times = np.array([vascular.times(kinetics, key[0]) for key, kinetics, _ in parts])
    answers = follow(np.stack(list(parts.values()), axis=1), controls.blood_time_s, *times.T)
    sums = {key: np.zeros(len(controls.time_s)) for key in channels}
    for (key, _, sign), answer in zip(parts, answers.T, strict=True):
        sums[key] += sign * answer
    return {key: np.clip(total, channels[key].low, channels[key].high) for key, total in sums.items()}


def reach(controls: Collection[str], blood: Blood = BLOOD, vascular: Vascular = VASCULAR) -> dict[tuple[str, str], Change]:
    """(region, quantity) -> lowest and highest change that the sliders of a rig allow, at any moment."""
    reached = {key: channel.reach for key, channel in blood.channels(controls).items()}
    for region in vascular.pulse.delay_s if PULSE_CONTROL in controls else ():
        swing = BLOOD_CONTROL_MAX * vascular.pulse.depth * blood.at_rest(region, "hemoglobin")
        low, high = reached.get((region, "hemoglobin"), (0.0, 0.0))
        reached[region, "hemoglobin"] = low - swing, high + swing
    return reached


def pressure_over_time(controls: Controls, pressure: np.ndarray, vascular: Vascular = VASCULAR) -> np.ndarray:
    """How much of the blood under a pressed place is away: at once with the pressure, back by the capillary refill."""
    return follow(pressure, controls.blood_time_s, *vascular.times("refill", ELSEWHERE))


def _beats(controls: Controls, delay_s: float) -> np.ndarray:
    """Heartbeats since the first moment, of the blood that is `delay_s` late: the rate's integral, exact where it is linear."""
    t = controls.time_s
    rate = np.broadcast_to(controls.values.get(HEART_RATE_CONTROL, HEART_RATE_AT_REST), t.shape) / 60.0
    if len(t) == 1:
        return (t - delay_s) * rate
    at_knots = _integral(rate, t)
    asked = t - delay_s
    k = np.clip(np.searchsorted(t, asked, side="right") - 1, 0, len(t) - 2)
    step = asked - t[k]
    slope = (rate[k + 1] - rate[k]) / (t[k + 1] - t[k])
    # Before the first moment the heart beat at the rate that it has then.
    slope = np.where(step < 0.0, 0.0, slope)
    return at_knots[k] + rate[k] * step + 0.5 * slope * step**2
