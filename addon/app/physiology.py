"""The `physiology` use-case: what recordings of people say about the blood of their emotions."""

from __future__ import annotations

import dataclasses
import importlib.util
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import sanguine_core

from ..domain.blood import ANATOMY, STATES
from ..domain.errors import InputError, nearest
from ..domain.facs import EMOTION_CONTROLS, EMOTIONS
from ..domain.physiology.cleaning import REASONS, Clean, Level, Settling, blocks, clean, levels
from ..domain.physiology.estimates import (
    GROUPS,
    POOLED,
    Finding,
    PairFinding,
    Residue,
    SubjectChange,
    change_findings,
    pair_findings,
    rest_residue,
    sex_findings,
    subject_changes,
)
from ..domain.physiology.lag import Lag, estimate_lag
from ..domain.physiology.measures import MEASURES
from ..domain.physiology.recording import NEUTRAL, Recording, Track, read_recording
from ..domain.physiology.statistics import CONFIDENCE, Effect
from ..domain.profile import (
    FINGER,
    FORMAT,
    Calibration,
    Measured,
    NamedRows,
    Profile,
    RecordingRow,
    UnsupportedRow,
    profile_rows,
)


def known_labels() -> list[str]:
    """What a recording may be labelled with: emotions, neutral among them, and states of the body."""
    return [*EMOTIONS, *STATES]


@dataclass(frozen=True)
class Settings:
    """What the user may say. lag_s: of the oximeter, None to estimate it. The rest is explained in docs/physiology.md."""

    labels: Mapping[str, str] = field(default_factory=dict)
    ignore: tuple[str, ...] = ()
    lag_s: float | None = None
    settling: Settling = Settling()
    calibration: Calibration = Calibration()
    profile_of: str = POOLED

    def __post_init__(self) -> None:
        for name, emotion in self.labels.items():
            if emotion not in (known := known_labels()):
                raise InputError(f"--labels: {name}={emotion}: no such emotion or state, {nearest(emotion, known)}")
        for region in self.calibration.index_region:
            if region not in ANATOMY:
                raise InputError(f"--region: {region}: no such region, {nearest(region, ANATOMY)}")
        site = self.calibration.oximeter
        if site != FINGER and site not in ANATOMY:
            raise InputError(f"--oximeter: {site}: neither finger nor a region, {nearest(site, (FINGER, *ANATOMY))}")
        if self.lag_s is not None and not 0.0 <= self.lag_s <= 300.0:
            raise InputError(f"--lag-s: {self.lag_s:g} is outside 0 to 300 s")
        for flag, value, low in (
            ("--settle-s", self.settling.settle_s, 0.0),
            ("--recover-s", self.settling.recover_s, 0.0),
            ("--window-s", self.settling.window_s, 0.1),
        ):
            if not low <= value <= 3600.0:
                raise InputError(f"{flag}: {value:g} is outside {low:g} to 3600 s")


@dataclass(frozen=True)
class Study:
    """All that was computed: the report, the profile and the plots are made from it."""

    settings: Settings
    recordings: tuple[Recording, ...]
    tracks: tuple[Clean, ...]
    levels: tuple[tuple[Level, ...], ...]
    lags: Mapping[str, Lag]
    used_lag_s: Mapping[str, float]
    residues: Mapping[str, Residue]
    changes: tuple[SubjectChange, ...]
    findings: tuple[Finding, ...]
    sexes: tuple[Finding, ...]
    pairs: tuple[PairFinding, ...]
    warnings: tuple[str, ...]


# Of a change, left in the rest: half of it is what baselines, and so changes, are off by; below, other errors are larger.
_UNRESTED = 0.05

Progress = Callable[[str, int, int], None]


def check_packages(plots: bool) -> None:
    """Raises InputError, before any work, if a package is missing that Blender does not carry."""
    for flag, package, needed in (("physiology", "scipy", True), ("--plots", "matplotlib", plots)):
        if needed and importlib.util.find_spec(package) is None:
            raise InputError(f"{flag}: needs the Python package '{package}', which is not installed here")


def read_recordings(paths: Sequence[str | os.PathLike[str]], settings: Settings) -> list[Recording]:
    """All files. Raises InputError for a fault in one, and for faults between them."""
    recordings: list[Recording] = []
    sexes: dict[str, tuple[str, str]] = {}
    for path in paths:
        recording = read_recording(path, known_labels(), list(ANATOMY), settings.labels, settings.ignore)
        for other in recordings:
            if other.sha256 == recording.sha256:
                raise InputError(f"{path}: the same samples as in {other.file}: give each file once")
            if other.file == recording.file:
                raise InputError(
                    f"{path}: another recording has this name: reports could not tell them apart, rename one"
                )
        for track in recording.tracks:
            sex, file = sexes.setdefault(track.subject, (track.sex, recording.file))
            if sex != track.sex:
                raise InputError(
                    f"{path}: sex of {track.subject!r} is {track.sex or 'empty'}, in {file} it is {sex or 'empty'}: "
                    "one subject has one"
                )
        recordings.append(recording)
    return recordings


def study(recordings: Sequence[Recording], settings: Settings, progress: Progress | None = None) -> Study:
    """Cleans, aligns and estimates. Raises InputError if there is nothing to compare."""
    tracks = [track for recording in recordings for track in recording.tracks]
    if not tracks:
        raise InputError(f"{recordings[0].file}: not one measured value")
    cleaned = []
    for k, track in enumerate(tracks):
        cleaned.append(clean(track))
        if progress and (k + 1 == len(tracks) or (k + 1) % 50 == 0):
            progress("clean", k + 1, len(tracks))
    warnings = _cleaning_warnings(cleaned)
    lags, used = _lags(cleaned, settings, warnings)
    settled = [tuple(levels(c, used[c.track.measure.id], settings.settling)) for c in cleaned]
    changes, lost = subject_changes((c.track, own) for c, own in zip(cleaned, settled, strict=True))
    warnings += _lost_warnings(lost, cleaned, settled)
    if not changes:
        raise InputError(
            f"{recordings[0].file}: nothing to compare: no subject has a settled '{NEUTRAL}' and a settled emotion "
            "(--settle-s, --recover-s)"
        )
    residues = _residues(cleaned, settled, warnings)
    if progress:
        progress("estimate", 0, 1)
    findings = [finding for group in GROUPS for finding in change_findings(changes, group)]
    sexes, pairs = sex_findings(changes), pair_findings(changes)
    if progress:
        progress("estimate", 1, 1)
    return Study(
        settings, tuple(recordings), tuple(cleaned), tuple(settled), lags, used, residues, tuple(changes), tuple(findings),
        tuple(sexes), tuple(pairs), tuple(warnings),
    )  # fmt: skip


def _cleaning_warnings(cleaned: Sequence[Clean]) -> list[str]:
    """One line per file, measure and reason of what was left out, but for single outliers, which every sensor has."""
    warnings = []
    files: dict[tuple[str, str], list[Clean]] = {}
    for c in cleaned:
        files.setdefault((c.track.file, c.track.measure.id), []).append(c)
    for (file, measure), own in files.items():
        samples = sum(c.counts["samples"] for c in own)
        for reason, meaning in REASONS.items():
            left_out = sum(c.counts[reason] for c in own)
            if left_out and reason not in ("missing", "outlier"):
                first = next(c for c in own if c.counts[reason])
                warnings.append(
                    f"{file}: {measure}: {left_out} of {samples} samples left out ({meaning}), the first on line "
                    f"{first.first[reason]} ({first.track.subject})"
                )
    return warnings


def _lags(cleaned: Sequence[Clean], settings: Settings, warnings: list[str]) -> tuple[dict[str, Lag], dict[str, float]]:
    lags, used = {}, {}
    for measure in MEASURES.values():
        own = [c for c in cleaned if c.track.measure is measure]
        if not own:
            continue
        used[measure.id] = 0.0
        if measure.device != "oximeter":
            continue
        if settings.lag_s is not None:
            used[measure.id] = settings.lag_s
            continue
        lag = lags[measure.id] = estimate_lag(own)
        if lag.usable:
            used[measure.id] = lag.value_s
        elif lag.value_s is None:
            warnings.append(
                f"{measure.id}: too few onsets of emotions to estimate the sensor's lag: taken as 0 s (--lag-s)"
            )
        else:
            warnings.append(
                f"{measure.id}: the sensor's lag cannot be told from these data (95 % interval {lag.low_s:.0f} to "
                f"{lag.high_s:.0f} s): taken as 0 s (--lag-s)"
            )
    return lags, used


def _lost_warnings(lost: Sequence[Track], cleaned: Sequence[Clean], settled: Sequence[Sequence[Level]]) -> list[str]:
    warnings = []
    for track in lost:
        where = f"{track.file}: {track.subject}: {track.measure.id}" + (f" at {track.region}" if track.region else "")
        had = NEUTRAL in track.emotion
        why = "its settled part has no good samples" if had else "it has none"
        warnings.append(f"{where}: no baseline, left out: label '{NEUTRAL}': {why}")
    gone: dict[tuple[str, str], int] = {}
    for c, own in zip(cleaned, settled, strict=True):
        unsettled = len([block for block in blocks(c.track) if block.emotion != NEUTRAL]) - len(
            [level for level in own if level.emotion != NEUTRAL]
        )
        if unsettled > 0:
            key = (c.track.file, c.track.measure.id)
            gone[key] = gone.get(key, 0) + unsettled
    for (file, measure), count in gone.items():
        warnings.append(
            f"{file}: {measure}: {count} episodes of emotion left out: no settled good samples (--settle-s)"
        )
    return warnings


def _residues(cleaned: Sequence[Clean], settled: Sequence[Sequence[Level]], warnings: list[str]) -> dict[str, Residue]:
    residues = {}
    for measure in MEASURES:
        own = [(c.track, levels) for c, levels in zip(cleaned, settled, strict=True) if c.track.measure.id == measure]
        residue = rest_residue(own)
        if residue is None:
            continue
        residues[measure] = residue
        if residue.low > _UNRESTED:
            warnings.append(
                f"{measure}: the rest after an emotion still holds {100 * residue.share:.0f} % of its change (95 % interval "
                f"{100 * residue.low:.0f} to {100 * residue.high:.0f} %): changes are too small by half of that "
                "(--recover-s, or longer rests)"
            )
    return residues


def shown(measure: str, value: float | None) -> float | None:
    """A change as reports give it: a ratio less 1 for relative measures, else as it is."""
    if value is None:
        return None
    return math.expm1(value) if MEASURES[measure].relative else value


def report(done: Study) -> dict[str, Any]:
    """The answer of `sanguine physiology`. docs/physiology.md explains it key by key."""
    subjects = {(c.track.subject, c.track.sex) for c in done.tracks}
    return {
        "sanguine": sanguine_core.__version__,
        "confidence": CONFIDENCE,
        "recordings": [
            {"file": r.file, "sha256": r.sha256, "samples": r.rows, "subjects": len({t.subject for t in r.tracks})}
            for r in done.recordings
        ],
        "subjects": {
            "all": len(subjects),
            **{sex or "not stated": sum(s == sex for _, s in subjects) for sex in sorted({s for _, s in subjects})},
        },
        "settings": {
            "settle_s": done.settings.settling.settle_s,
            "recover_s": done.settings.settling.recover_s,
            "window_s": done.settings.settling.window_s,
            "lag_s": "estimated" if done.settings.lag_s is None else done.settings.lag_s,
        },
        "cleaning": _cleaning_report(done),
        "lag": {
            measure: {"used_s": used, "estimated": None if (lag := done.lags.get(measure)) is None else dataclasses.asdict(lag)}
            for measure, used in done.used_lag_s.items()
        },
        "rest_residue": {measure: dataclasses.asdict(residue) for measure, residue in done.residues.items()},
        "changes": [_finding(finding) for finding in done.findings],
        "sex_differences": [_finding(finding) for finding in done.sexes],
        "correlations": [
            {
                "measures": list(pair.measures), "region": pair.region or None, "subjects": pair.subjects, "df": pair.df,
                "r": _effect(pair.correlation), "p": pair.p, "p_holm": pair.p_holm, "verdict": pair.verdict,
            }
            for pair in done.pairs
        ],
        "warnings": list(done.warnings),
    }  # fmt: skip


def _cleaning_report(done: Study) -> list[dict[str, Any]]:
    rows = {}
    for c, own in zip(done.tracks, done.levels, strict=True):
        row = rows.setdefault(
            c.track.measure.id, dict.fromkeys(("samples", *REASONS, "unsettled_or_unlabelled", "used"), 0)
        )
        for reason, count in c.counts.items():
            row[reason] += count
        used = sum(level.samples for level in own)
        row["used"] += used
        row["unsettled_or_unlabelled"] += c.time_s.size - used
    return [{"measure": measure, **row} for measure, row in rows.items()]


def _finding(finding: Finding) -> dict[str, Any]:
    measure, estimate = MEASURES[finding.measure], finding.estimate
    difference = finding.group not in GROUPS

    def change(value: float | None) -> float | None:
        return shown(finding.measure, value)

    return {
        "measure": finding.measure,
        "region": finding.region or None,
        "emotion": finding.emotion,
        "sex": finding.group,
        "unit": "relative" if measure.relative else measure.unit,
        "subjects": estimate.n,
        "baseline": math.exp(finding.baseline) if measure.relative else finding.baseline,
        "difference" if difference else "change": change(estimate.mean),
        "low": change(estimate.low),
        "high": change(estimate.high),
        "sd": estimate.sd,
        "t": estimate.t,
        "df": estimate.df,
        "p": estimate.p,
        "p_holm": finding.p_holm,
        **({"d": _effect(finding.d)} if difference else {"d_z": _effect(finding.d), "hedges_g": _effect(finding.g)}),
        **({} if difference else {"label_correlation": _effect(finding.correlation)}),
        "supported": finding.supported,
        "verdict": finding.verdict,
    }


def _effect(effect: Effect | None) -> dict[str, float] | None:
    return None if effect is None else dataclasses.asdict(effect)


def summary(done: Study) -> list[str]:
    """One line per pooled finding and per difference of the sexes, for people."""
    lines = []
    for finding in (*(f for f in done.findings if f.group == POOLED), *done.sexes):
        estimate = finding.estimate
        what = " ".join(filter(None, (finding.emotion, finding.region, MEASURES[finding.measure].name)))
        if finding.group != POOLED:
            what += f", {finding.group}"
        interval = ""
        if estimate.low is not None:
            interval = f" ({_human(finding.measure, estimate.low)} to {_human(finding.measure, estimate.high)})"
        lines.append(
            f"{what}: {_human(finding.measure, estimate.mean)}{interval}, {estimate.n} subjects: {finding.verdict}"
        )
    return lines


def _human(measure: str, value: float) -> str:
    change = shown(measure, value)
    if measure == "pulse":
        return f"{change:+.1f}/min"
    return f"{100 * change:+.1f} %" if MEASURES[measure].relative else f"{100 * change:+.2f} % points"


def make_profile(done: Study) -> Profile:
    """The supported changes of one group as rows of blood. Raises InputError if an index has no region to go to."""
    settings = done.settings
    own = [f for f in done.findings if f.group == settings.profile_of]
    used = ("hemoglobin_index", "perfusion", "spo2")
    measured = [
        Measured(
            f.emotion, f.measure, f.region, f.estimate.n,
            *(shown(f.measure, value) for value in (f.estimate.mean, f.estimate.low, f.estimate.high)),
        )
        for f in own
        if f.supported and f.measure in used
    ]  # fmt: skip
    nowhere = next((f for f in own if f.measure == "hemoglobin_index" and not f.region), None)
    if nowhere is not None and not settings.calibration.index_region:
        raise InputError(
            f"--profile: the hemoglobin index has no region: a column 'region', or --region {nearest('', ANATOMY)}"
        )
    files = [recording.file for recording in done.recordings]
    rows, refused = profile_rows(measured, settings.calibration, files)
    refused += [
        UnsupportedRow(emotion=f.emotion, measure=f.measure, region=f.region, verdict=f.verdict)
        for f in own
        if not f.supported
    ]
    people = {change.subject for change in done.changes if settings.profile_of in (POOLED, change.sex)}
    if not people:
        raise InputError(f"--sex: {settings.profile_of}: no such subject in {files[0]}")
    return Profile(
        format=FORMAT,
        sanguine=sanguine_core.__version__,
        sex=settings.profile_of,
        subjects=len(people),
        calibration=settings.calibration,
        recording=tuple(RecordingRow(file=r.file, sha256=r.sha256, samples=r.rows) for r in done.recordings),
        emotion=tuple(
            NamedRows(name=name, change=tuple(own)) for name, own in rows.items() if name in EMOTION_CONTROLS
        ),
        state=tuple(NamedRows(name=name, change=tuple(own)) for name, own in rows.items() if name in STATES),
        unsupported=tuple(refused),
    )
