"""Recordings of people who do not exist: sessions whose true changes are known, with the faults that sensors have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from sanguine.domain.physiology.measures import MEASURES
from sanguine.domain.physiology.recording import NEUTRAL, Recording, Track
from scipy.signal import lfilter


@dataclass(frozen=True)
class Answer:
    """How one measure answers one emotion: the settled mean change of women and of men, and how much people differ.

    On the scale of the measure's changes: logarithms for relative measures.
    """

    female: float = 0.0
    male: float = 0.0
    spread_female: float = 0.1
    spread_male: float = 0.1


@dataclass(frozen=True)
class Signal:
    """One measure at rest and its noise: between people, within one (AR(1)), a linear drift per minute, and the faults.

    dropped: drop-outs to 0 per minute, 4 s each. spikes: share of samples far off. step: the device counts in these.
    lag_s: of the sensor, a pure delay.
    """

    rest: float
    between: float
    noise: float
    correlation: float = 0.5
    drift: float = 0.0
    dropped: float = 0.0
    spikes: float = 0.0
    step: float = 0.0
    lag_s: float = 0.0
    rise_s: float = 6.0
    fall_s: float = 20.0


INDEX = Signal(np.log(1.2), 0.2, 0.02)
SPO2 = Signal(0.975, 0.008, 0.004, step=0.01)
PULSE = Signal(72.0, 9.0, 1.5, step=1.0)
PERFUSION = Signal(np.log(0.03), 0.4, 0.06)


@dataclass(frozen=True)
class Design:
    """A study: who, in which order what, and how often it is sampled. answers: (measure, emotion) -> Answer."""

    women: int = 8
    men: int = 8
    emotions: tuple[str, ...] = ("anger", "fear")
    repeats: int = 1
    first_rest_s: float = 60.0
    emotion_s: float = 60.0
    rest_s: float = 90.0
    step_s: float = 2.0
    signals: Mapping[str, Signal] = field(default_factory=lambda: {"hemoglobin_index": INDEX})
    answers: Mapping[tuple[str, str], Answer] = field(default_factory=dict)
    region: str = "cheeks"


def simulate(design: Design, seed: int | Sequence[int]) -> Recording:
    """One run of the study: everyone's session, emotions in an order drawn anew for each.

    Who takes part depends on the seed alone, not on how often they are sampled.
    """
    people, noise = np.random.default_rng(seed).spawn(2)
    tracks = []
    for k in range(design.women + design.men):
        sex = "female" if k < design.women else "male"
        order = np.concatenate([people.permutation(design.emotions) for _ in range(design.repeats)])
        starts = design.first_rest_s + np.arange(len(order)) * (design.emotion_s + design.rest_s)
        time = np.arange(0.0, starts[-1] + design.emotion_s + design.rest_s, design.step_s)
        label = np.full(time.size, NEUTRAL, dtype=object)
        for start, emotion in zip(starts, order, strict=True):
            label[(time >= start) & (time < start + design.emotion_s)] = str(emotion)
        line = np.arange(time.size) + 2 + k * time.size
        for name, signal in design.signals.items():
            value = _signal(design, name, signal, sex, time, starts, order, people, noise)
            where = design.region if MEASURES[name].device == "analyser" else ""
            tracks.append(Track("synthetic.csv", f"s{k + 1:02d}", sex, MEASURES[name], where, time, label, value, line))
    return Recording("synthetic.csv", "0" * 64, sum(t.time_s.size for t in tracks), tuple(tracks))


def _signal(design, name, signal, sex, time, starts, order, people, noise) -> np.ndarray:
    own = {}
    for emotion in design.emotions:
        answer = design.answers.get((name, emotion), Answer())
        mean, spread = (answer.female, answer.spread_female) if sex == "female" else (answer.male, answer.spread_male)
        own[emotion] = mean + spread * people.standard_normal()
    value = signal.rest + signal.between * people.standard_normal() + signal.drift * time / 60.0
    for start, emotion in zip(starts, order, strict=True):
        since = time - start - signal.lag_s
        over = since - design.emotion_s
        top = 1.0 - np.exp(-design.emotion_s / signal.rise_s) if signal.rise_s else 1.0
        up = 1.0 - np.exp(-np.clip(since, 0.0, design.emotion_s) / signal.rise_s) if signal.rise_s else since >= 0.0
        down = np.exp(-np.maximum(over, 0.0) / signal.fall_s) if signal.fall_s else 0.0
        value = value + own[str(emotion)] * np.where(over >= 0.0, top * down, np.where(since >= 0.0, up, 0.0))
    shocks = noise.standard_normal(time.size) * signal.noise * np.sqrt(1.0 - signal.correlation**2)
    shocks[0] = noise.standard_normal() * signal.noise
    value = value + lfilter([1.0], [1.0, -signal.correlation], shocks)
    if MEASURES[name].relative:
        value = np.exp(value)
    spiked = noise.random(time.size) < signal.spikes
    value = np.where(spiked, value * noise.choice([0.6, 1.5], time.size), value)
    if signal.step:
        value = np.round(value / signal.step) * signal.step
    if name == "spo2":
        value = np.clip(value, 0.0, 1.0)
    for start in noise.uniform(0.0, time[-1], noise.poisson(signal.dropped * time[-1] / 60.0)):
        value = np.where((time >= start) & (time < start + 4.0), 0.0, value)
    return value


COLUMNS = {
    "spo2": ("spo2_percent", 100.0, 0),
    "pulse": ("pulse_bpm", 1.0, 0),
    "perfusion": ("perfusion_percent", 100.0, 2),
    "hemoglobin_index": ("hemoglobin_index", 1.0, 3),
    "melanin_index": ("melanin_index", 1.0, 3),
}


def write_csv(path: Path, recording: Recording, comment: str = "") -> None:
    """As the format of docs/physiology.md; all tracks of a subject share their times."""
    subjects = {}
    for track in recording.tracks:
        subjects.setdefault(track.subject, []).append(track)
    names = [track.measure.id for track in next(iter(subjects.values()))]
    region = any(track.region for track in recording.tracks)
    lines = [f"# {line}" for line in comment.splitlines()]
    lines.append(
        ",".join(
            ["time_s", "subject", "sex", "emotion", *(["region"] if region else []), *(COLUMNS[n][0] for n in names)]
        )
    )
    for own in subjects.values():
        where = next((track.region for track in own if track.region), "")
        for k, time in enumerate(own[0].time_s):
            cells = [f"{time:g}", own[0].subject, own[0].sex, own[0].emotion[k], *([where] if region else [])]
            for track in own:
                _, factor, digits = COLUMNS[track.measure.id]
                cells.append("" if np.isnan(track.value[k]) else f"{track.value[k] * factor:.{digits}f}")
            lines.append(",".join(cells))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
