"""What the estimator of `sanguine physiology` holds on studies whose truth is known: the tables of docs/physiology.md.

.venv/bin/python bench/physiology.py            # prints Markdown, some minutes
.venv/bin/python bench/physiology.py --example  # writes examples/recording.csv and the plots of the page anew
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))  # tests/support holds the simulator

from sanguine.app.physiology import Settings, read_recordings, study  # noqa: E402
from sanguine.app.physiology_plots import write_plots  # noqa: E402
from sanguine.domain.physiology.cleaning import Settling, clean, levels  # noqa: E402
from sanguine.domain.physiology.estimates import GROUPS, POOLED, change_findings, sex_findings, subject_changes  # noqa: E402
from sanguine.domain.physiology.lag import estimate_lag  # noqa: E402
from scipy import stats  # noqa: E402
from support.sessions import INDEX, PERFUSION, PULSE, SPO2, Answer, Design, simulate, write_csv  # noqa: E402

H = "hemoglobin_index"
ANSWER = Answer(0.3, 0.2, 0.12, 0.06)
BASE = Design(women=8, men=8, emotions=("anger", "fear"), answers={(H, "anger"): ANSWER})
LONGER = Settling(recover_s=120.0)


def with_signal(design: Design, **changes: float) -> Design:
    return dataclasses.replace(design, signals={H: dataclasses.replace(design.signals[H], **changes)})


CASES = {
    "8 + 8 people": (BASE, Settling()),
    "4 + 4 people": (dataclasses.replace(BASE, women=4, men=4), Settling()),
    "20 + 20 people": (dataclasses.replace(BASE, women=20, men=20), Settling()),
    "13 women, 3 men": (dataclasses.replace(BASE, women=13, men=3), Settling()),
    "spread of women 4 x men's": (
        dataclasses.replace(BASE, answers={(H, "anger"): Answer(0.3, 0.2, 0.2, 0.05)}), Settling()
    ),
    "drop-outs, 2 % spikes, drift": (with_signal(BASE, dropped=0.5, spikes=0.02, drift=0.02), Settling()),
    "noise 5 x": (with_signal(BASE, noise=0.1), Settling()),
    "slow noise (AR 0.95)": (with_signal(BASE, noise=0.05, correlation=0.95), Settling()),
    "one reading in 20 s": (dataclasses.replace(BASE, step_s=20.0), Settling()),
    "no repeats of rest (30 s)": (dataclasses.replace(BASE, rest_s=30.0), Settling()),
    "fall of 45 s, recover 60 s": (with_signal(BASE, fall_s=45.0), Settling()),
    "fall of 45 s, recover 120 s": (dataclasses.replace(with_signal(BASE, fall_s=45.0), rest_s=180.0), LONGER),
    "rise of 12 s": (with_signal(BASE, rise_s=12.0), Settling()),
    "no lag of body or sensor": (with_signal(BASE, rise_s=0.0, fall_s=0.0), Settling()),
}  # fmt: skip


def changes_of(recording, settling=Settling(), lag_s=0.0):  # noqa: B008
    cleaned = [clean(track) for track in recording.tracks]
    return subject_changes((c.track, levels(c, lag_s, settling)) for c in cleaned)[0]


def coverage(studies: int) -> None:
    error = 1.96 * np.sqrt(0.95 * 0.05 / studies)
    print(f"\n## Coverage of the 95 % intervals, {studies} studies each (95 % +- {100 * error:.1f} by chance)\n")
    print(
        "| studies | pooled t | pooled bootstrap | women t | men t | women - men (Welch) | d_z, men | bias of the pooled change |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for name, (design, settling) in CASES.items():
        answer = design.answers[H, "anger"]
        truth = {
            POOLED: (design.women * answer.female + design.men * answer.male) / (design.women + design.men),
            "female": answer.female, "male": answer.male, "female - male": answer.female - answer.male,
        }  # fmt: skip
        held: dict[str, list[bool]] = {}
        means = []
        for seed in range(studies):
            changes = changes_of(simulate(design, [17, seed]), settling)
            findings = [f for group in GROUPS for f in change_findings(changes, group, effects=group == "male")]
            for f in (*findings, *sex_findings(changes, effects=False)):
                if f.emotion == "anger":
                    e = f.estimate
                    held.setdefault(f.group, []).append(e.low <= truth[f.group] <= e.high)
                    if f.group == POOLED:
                        means.append(e.mean)
                    if f.d is not None:
                        held.setdefault("d", []).append(f.d.low <= answer.male / answer.spread_male <= f.d.high)
            own = np.array([c.change for c in changes if c.emotion == "anger"])
            random = np.random.default_rng(seed)
            drawn = own[random.integers(0, own.size, (1000, own.size))].mean(axis=1)
            low, high = np.quantile(drawn, (0.025, 0.975))
            held.setdefault("bootstrap", []).append(low <= truth[POOLED] <= high)
        order = (POOLED, "bootstrap", "female", "male", "female - male", "d")
        cells = [f"{100 * np.mean(held[key]):.1f}" for key in order]
        bias = np.mean(means) / truth[POOLED] - 1.0
        print(f"| {name} | {' | '.join(cells)} | {100 * bias:+.1f} % |", flush=True)


def pseudo_replication(studies: int) -> None:
    """What counting samples instead of people would claim."""
    missed = {"subjects": 0, "samples": 0}
    design = dataclasses.replace(BASE, men=0, answers={})
    for seed in range(studies):
        recording = simulate(design, [18, seed])
        (estimate, *_) = (f.estimate for f in change_findings(changes_of(recording), POOLED, effects=False))
        missed["subjects"] += estimate.p < 0.05
        anger = np.concatenate([np.log(t.value[t.emotion == "anger"] / np.median(t.value)) for t in recording.tracks])
        rest = np.concatenate([np.log(t.value[t.emotion == "neutral"] / np.median(t.value)) for t in recording.tracks])
        missed["samples"] += stats.ttest_ind(anger, rest, equal_var=False).pvalue < 0.05
    print(f"\n## False alarms where nobody answers on average, {studies} studies of one emotion in 8 people\n")
    print("| unit of analysis | found something |\n|---|---|")
    for unit, count in missed.items():
        print(f"| {unit} | {100 * count / studies:.1f} % |")


def false_alarms(studies: int) -> None:
    emotions = ("anger", "fear", "sad", "happy")
    names = (H, "pulse", "spo2")
    answers = {(H, e): Answer() for e in emotions} | {("pulse", e): Answer(0, 0, 5, 3) for e in emotions}
    answers |= {("spo2", e): Answer(0, 0, 0.005, 0.005) for e in emotions}
    signals = {H: INDEX, "pulse": dataclasses.replace(PULSE, lag_s=6.0, dropped=0.3), "spo2": SPO2}
    design = dataclasses.replace(BASE, women=9, men=9, emotions=emotions, answers=answers, signals=signals)
    any_, raw, sexes = 0, 0, 0
    for seed in range(studies):
        recording = simulate(design, [19, seed])
        cleaned = [clean(t) for t in recording.tracks]
        lag = {}
        for name in names[1:]:
            found = estimate_lag([c for c in cleaned if c.track.measure.id == name])
            lag[name] = found.value_s if found.usable else 0.0
        changes, _ = subject_changes(
            (c.track, levels(c, lag.get(c.track.measure.id, 0.0), Settling())) for c in cleaned
        )
        findings = change_findings(changes, POOLED, effects=False)
        any_ += any(f.supported for f in findings)
        raw += any(f.estimate.p < 0.05 for f in findings)
        sexes += any(f.supported for f in sex_findings(changes, effects=False))
    print(
        f"\n## Anything found in a study of nothing: {len(emotions) * len(names)} tests each, lag estimated, {studies} studies\n"
    )
    print("| | share of studies |\n|---|---|")
    for what, count in (("uncorrected", raw), ("Holm", any_), ("Holm, women - men", sexes)):
        print(f"| {what} | {100 * count / studies:.1f} % |")


def lags(studies: int) -> None:
    print(f"\n## The lag of a pulse sampled every 2 s, {studies} studies of 12 people each\n")
    print(
        "| answer | true lag | mean estimate | within one sample | interval holds it | usable |\n|---|---|---|---|---|---|"
    )
    for name, size, spread in (("10 +- 4 /min", 10.0, 4.0), ("3 +- 4 /min", 3.0, 4.0), ("none", 0.0, 0.0)):
        for lag_s in (0.0, 6.0, 14.0):
            answers = {("pulse", e): Answer(size, size, spread, spread) for e in ("anger", "fear")}
            signal = dataclasses.replace(PULSE, lag_s=lag_s, dropped=0.3, spikes=0.01)
            design = dataclasses.replace(BASE, women=6, men=6, answers=answers, signals={"pulse": signal})
            found = [estimate_lag([clean(t) for t in simulate(design, [20, seed]).tracks]) for seed in range(studies)]
            value = np.array([lag.value_s for lag in found])
            held = np.mean([lag.low_s <= lag_s <= lag.high_s for lag in found])
            usable = np.mean([lag.usable for lag in found])
            close = np.mean(np.abs(value - lag_s) <= 2.0)
            print(
                f"| {name} | {lag_s:g} s | {value.mean():.1f} s | {100 * close:.0f} % | {100 * held:.0f} % | {100 * usable:.0f} % |",
                flush=True,
            )


def example(folder: Path) -> None:
    """A small study in which anger floods, fear drains, joy warms a little and sadness does nothing to the cheeks."""
    emotions = ("anger", "happy", "sad", "fear")
    means = {
        H: ((0.32, 0.24), (0.1, 0.1), (0.0, 0.0), (-0.2, -0.2)),
        "pulse": ((12.0, 9.0), (4.0, 4.0), (-1.0, -1.0), (14.0, 10.0)),
        "perfusion": ((-0.3, -0.3), (0.0, 0.0), (-0.1, -0.1), (-0.5, -0.5)),
        "spo2": ((0.0, 0.0), (0.0, 0.0), (-0.008, -0.008), (0.0, 0.0)),
    }
    spread = {H: 0.08, "pulse": 4.0, "perfusion": 0.2, "spo2": 0.003}
    late = {"lag_s": 6.0, "dropped": 0.15}
    design = Design(
        women=6, men=6, emotions=emotions, step_s=5.0,
        signals={
            "spo2": dataclasses.replace(SPO2, **late), "pulse": dataclasses.replace(PULSE, **late),
            "perfusion": dataclasses.replace(PERFUSION, **late), H: dataclasses.replace(INDEX, spikes=0.01, drift=0.005),
        },
        answers={
            (measure, emotion): Answer(*pair, spread[measure], spread[measure])
            for measure, row in means.items()
            for emotion, pair in zip(emotions, row, strict=True)
        },
    )  # fmt: skip
    path = folder / "examples" / "recording.csv"
    write_csv(path, simulate(design, 4), "Synthetic: nobody was measured. Written by bench/physiology.py --example")
    settings = Settings()
    done = study(read_recordings([path], settings), settings)
    for name in write_plots(done, folder / "docs"):
        (folder / "docs" / name).replace(folder / "docs" / f"physiology_{name}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--studies", type=int, default=1000)
    parser.add_argument("--example", action="store_true", help="write the example and the page's plots instead")
    options = parser.parse_args()
    if options.example:
        example(ROOT)
        return
    coverage(options.studies)
    pseudo_replication(options.studies)
    false_alarms(max(options.studies // 2, 1))
    lags(max(options.studies // 10, 1))


if __name__ == "__main__":
    main()
