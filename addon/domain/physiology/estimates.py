"""From cleaned tracks to one number per subject, emotion and measure, and from those to what the study supports."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from . import statistics as st
from .cleaning import Level
from .measures import MEASURES
from .recording import NEUTRAL, Track

POOLED = "pooled"
GROUPS = (POOLED, "female", "male")
SIGNIFICANT = 1.0 - st.CONFIDENCE


@dataclass(frozen=True)
class SubjectChange:
    """How one subject differed from its own baseline under one emotion.

    change: a difference in the measure's unit, or for a relative measure the logarithm of the ratio. baseline: the
    same subject's, on the same scale.
    """

    subject: str
    sex: str
    measure: str
    region: str
    emotion: str
    change: float
    baseline: float


def subject_changes(found: Iterable[tuple[Track, Sequence[Level]]]) -> tuple[list[SubjectChange], list[Track]]:
    """(changes, tracks without a baseline).

    The baseline of an episode is the line between the neutral levels before and after it, so that a slow drift cancels;
    outside of them the nearest. Episodes of one subject and emotion are averaged: subjects count once, whatever the
    number of their samples.
    """
    episodes: dict[tuple[str, str, str, str, str], list[tuple[float, float]]] = {}
    lost = []
    for track, levels in found:
        rest = [level for level in levels if level.emotion == NEUTRAL]
        others = [level for level in levels if level.emotion != NEUTRAL]
        if not rest:
            lost.append(track)
            continue
        at, value = [level.middle_s for level in rest], [level.value for level in rest]
        for level in others:
            baseline = float(np.interp(level.middle_s, at, value))
            key = (track.subject, track.sex, track.measure.id, track.region, level.emotion)
            episodes.setdefault(key, []).append((level.value - baseline, baseline))
    changes = [SubjectChange(*key, *(float(v) for v in np.mean(values, axis=0))) for key, values in episodes.items()]
    return changes, lost


@dataclass(frozen=True)
class Residue:
    """The share of an emotion's change that the rest after it still holds, with its 95 % interval over subjects."""

    share: float
    low: float
    high: float


def rest_residue(found: Iterable[tuple[Track, Sequence[Level]]]) -> Residue | None:
    """Whether rests were long enough: the slope of (rest after - rest before) over the change of the episode between.

    The change of the episode before is a second regressor, since the rest before may hold some of it; a drift of the
    sensor is in the intercept. What remains is blood that has not come back: the baselines hold half of it, and changes
    are too small by that. Interval: bootstrap over subjects. None with fewer than MIN_SUBJECTS, or if the episodes do
    not tell the two apart.
    """
    moments: dict[str, np.ndarray] = {}
    for track, levels in found:
        previous = 0.0
        for before, episode, after in zip(levels, levels[1:], levels[2:], strict=False):
            if before.emotion == after.emotion == NEUTRAL != episode.emotion:
                x = episode.value - (before.value + after.value) / 2.0
                row = np.array([1.0, x, previous, after.value - before.value])
                moments[track.subject] = moments.get(track.subject, 0.0) + np.outer(row, row)
                previous = x
    if len(moments) < st.MIN_SUBJECTS:
        return None
    each = np.array(list(moments.values()))
    times = np.random.default_rng(0).multinomial(len(each), np.full(len(each), 1.0 / len(each)), 1000)
    total = np.concatenate([each.sum(axis=0)[None], np.tensordot(times, each, axes=1)])
    left, right = total[:, :3, :3], total[:, :3, 3]
    # On the scale of a correlation matrix, whose condition says whether there is an answer.
    scale = np.sqrt(np.maximum(np.diagonal(left, axis1=1, axis2=2), 1e-300))
    scaled = left / (scale[:, :, None] * scale[:, None, :])
    if np.linalg.cond(scaled).max() > 1e6:
        return None
    share = (np.linalg.solve(scaled, (right / scale)[:, :, None])[:, :, 0] / scale)[:, 1]
    low, high = np.quantile(share[1:], (0.025, 0.975))
    return Residue(float(share[0]), float(low), float(high))


@dataclass(frozen=True)
class Finding:
    """What the study says about one change, difference or correlation.

    group: of GROUPS, or "female - male" for a difference. estimate, d, g, correlation are on the scale of the changes;
    baseline is the mean over subjects, likewise. p_holm: over all findings of the same kind. verdict: "supported", or
    why not.
    """

    measure: str
    region: str
    emotion: str
    group: str
    estimate: st.Estimate
    baseline: float
    d: st.Effect | None = None
    g: st.Effect | None = None
    correlation: st.Effect | None = None
    p_holm: float | None = None
    verdict: str = ""

    @property
    def supported(self) -> bool:
        return self.verdict == "supported"


@dataclass(frozen=True)
class PairFinding:
    """How two measures move together within subjects; region of the analyser's, where it names one."""

    measures: tuple[str, str]
    region: str
    subjects: int
    df: int
    correlation: st.Effect
    p: float
    p_holm: float | None = None
    verdict: str = ""


Key = tuple[str, str, str]


def _grouped(changes: Sequence[SubjectChange]) -> dict[Key, list[SubjectChange]]:
    grouped: dict[Key, list[SubjectChange]] = {}
    for change in changes:
        grouped.setdefault((change.measure, change.region, change.emotion), []).append(change)
    order = list(MEASURES)
    return dict(sorted(grouped.items(), key=lambda item: (order.index(item[0][0]), item[0])))


def change_findings(changes: Sequence[SubjectChange], group: str, effects: bool = True) -> list[Finding]:
    """One finding per measure, region and emotion for one of GROUPS, corrected for each other.

    effects: with sizes and correlations, whose intervals take milliseconds each.
    """
    found = []
    for (measure, region, emotion), rows in _grouped(changes).items():
        own = [row for row in rows if group in (POOLED, row.sex)]
        if not own:
            continue
        estimate = st.mean_interval([row.change for row in own])
        d, g = (effects and st.paired_effect(estimate)) or (None, None)
        found.append(
            Finding(
                measure, region, emotion, group, estimate, float(np.mean([row.baseline for row in own])), d, g,
                st.label_correlation(estimate) if effects else None,
            )
        )  # fmt: skip
    return _judged(found, lambda finding: finding.estimate.n)


def sex_findings(changes: Sequence[SubjectChange], effects: bool = True) -> list[Finding]:
    """Female minus male, per measure, region and emotion where both are there."""
    found, smaller = [], {}
    for key, rows in _grouped(changes).items():
        women, men = ([row.change for row in rows if row.sex == sex] for sex in ("female", "male"))
        if not women or not men:
            continue
        estimate = st.difference_interval(women, men)
        d = st.difference_effect(women, men) if effects else None
        finding = Finding(*key, "female - male", estimate, float(np.mean([row.baseline for row in rows])), d)
        found.append(finding)
        smaller[key] = min(len(women), len(men))
    return _judged(found, lambda finding: smaller[finding.measure, finding.region, finding.emotion])


def pair_findings(changes: Sequence[SubjectChange]) -> list[PairFinding]:
    """Repeated-measures correlation of every two measures over each subject's baseline and emotions.

    An analyser's region is paired with itself and with the oximeter.
    """
    points: dict[tuple[str, str], dict[tuple[str, str], float]] = {}
    for row in changes:
        own = points.setdefault((row.measure, row.region), {})
        own[row.subject, row.emotion] = row.change
        own[row.subject, NEUTRAL] = 0.0  # the changes' own zero: subjects' means are taken off anyway
    keys = sorted(points, key=lambda key: (list(MEASURES).index(key[0]), key[1]))
    found = []
    for i, first in enumerate(keys):
        for second in keys[i + 1 :]:
            analyser = [key for key in (first, second) if MEASURES[key[0]].device == "analyser"]
            if first[0] == second[0] or len({region for _, region in analyser}) > 1:
                continue
            shared = sorted(points[first].keys() & points[second].keys())
            if not shared:
                continue
            subject = np.array([who for who, _ in shared])
            x, y = (np.array([points[key][at] for at in shared]) for key in (first, second))
            result = st.common_correlation(subject, x, y)
            if result is not None:
                region = analyser[0][1] if analyser else ""
                found.append(
                    PairFinding((first[0], second[0]), region, len(set(subject)), result[1], result[0], result[2])
                )
    adjusted = st.holm([finding.p for finding in found])
    return [
        replace(finding, p_holm=p, verdict=_verdict(finding.subjects, p, finding.p, len(found)))
        for finding, p in zip(found, adjusted, strict=True)
    ]


def _judged(found: list[Finding], subjects: Callable[[Finding], int]) -> list[Finding]:
    p = [finding.estimate.p if subjects(finding) >= st.MIN_SUBJECTS else None for finding in found]
    tests = sum(value is not None for value in p)
    return [
        replace(finding, p_holm=adjusted, verdict=_verdict(subjects(finding), adjusted, finding.estimate.p, tests))
        for finding, adjusted in zip(found, st.holm(p), strict=True)
    ]


def _verdict(subjects: int, p_holm: float | None, p: float | None, tests: int) -> str:
    if subjects < st.MIN_SUBJECTS:
        return f"not supported: too few subjects ({subjects}, at least {st.MIN_SUBJECTS} are needed)"
    if p is None:
        return "not supported: all subjects are equal, which no sensor that resolves them shows"
    if p >= SIGNIFICANT:
        return "not supported: the interval includes 0"
    if p_holm >= SIGNIFICANT:
        return f"not supported: may be chance among {tests} tests (Holm)"
    return "supported"
