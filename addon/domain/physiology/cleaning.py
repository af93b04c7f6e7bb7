"""From raw samples to what a sensor really saw: drop-outs, jumps, frozen values and outliers are marked, never repaired."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .measures import Measure
from .recording import NEUTRAL, Track

REASONS = {
    "missing": "empty cells",
    "dropped_out": "0 or next to it: the sensor lost the signal",
    "implausible": "a value that no body at rest or in emotion has",
    "too_fast": "a jump faster than a body changes",
    "frozen": "one value for too long: the sensor hangs",
    "outlier": "far from the samples around it (Hampel)",
}
"""Why a sample is left out -> what that means. In the order of asking: a sample has the first reason that fits."""

# A sensor that finds the signal again needs a moment: samples this close to a drop-out are not believed (a guess).
_GUARD_S = 2.0
# Hampel: a sample is an outlier if it lies farther than 3 robust standard deviations (Pearson's rule) from the median of
# itself and the samples on each side: seven, or as many as half a minute has. Fewer than three are no surroundings.
_SIDE, _LEAST_SIDE, _SIGMAS, _NEAR_S = 7, 3, 3.0, 30.0
_MAD_TO_SD = 1.4826  # of a normal distribution
# The least number of equal samples that can be called frozen: an analyser may read the same twice.
_FROZEN_SAMPLES = 10


@dataclass(frozen=True)
class Clean:
    """The samples of a track that are believed, on the scale of its changes: logarithms for a relative measure.

    time_s, value (N,). counts: reason -> samples left out; "samples" is all there were. first: reason -> the line of the
    first.
    """

    track: Track
    time_s: np.ndarray
    value: np.ndarray
    counts: dict[str, int]
    first: dict[str, int]


def clean(track: Track) -> Clean:
    """Marks and takes out what the sensor made up."""
    measure, time = track.measure, track.time_s
    reason = np.full(time.size, -1)
    names = list(REASONS)

    def mark(what: str, where: np.ndarray) -> None:
        reason[where & (reason < 0)] = names.index(what)

    mark("missing", np.isnan(track.value))
    lost = np.flatnonzero(track.value == 0.0)
    if lost.size:
        mark("dropped_out", _near(time, time[lost], _GUARD_S))
    low, high = measure.plausible
    with np.errstate(invalid="ignore"):
        mark("implausible", ~((track.value >= low) & (track.value <= high)))
    value = np.log(np.where(reason < 0, track.value, 1.0)) if measure.relative else track.value

    for what, finds in (("too_fast", _too_fast), ("frozen", _frozen), ("outlier", _outliers)):
        good = np.flatnonzero(reason < 0)
        found = np.zeros(time.size, bool)
        found[good] = finds(measure, time[good], value[good])
        mark(what, found)

    good = reason < 0
    counts = {name: int((reason == k).sum()) for k, name in enumerate(names)} | {"samples": int(time.size)}
    first = {name: int(track.line[np.argmax(reason == k)]) for k, name in enumerate(names) if counts[name]}
    return Clean(track, time[good], value[good], counts, first)


def _near(time: np.ndarray, events: np.ndarray, within_s: float) -> np.ndarray:
    """Which of `time` are within some seconds of any of `events`; both increase."""
    after = np.searchsorted(events, time)
    left = time - events[np.maximum(after - 1, 0)]
    right = events[np.minimum(after, events.size - 1)] - time
    return ((after > 0) & (left <= within_s)) | ((after < events.size) & (right <= within_s))


def _too_fast(measure: Measure, time: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Samples that a body could not have reached from the last believed one; the longer ago that is, the more it could."""
    found = np.zeros(time.size, bool)
    if time.size < 2 or not (np.abs(np.diff(value)) > measure.jitter + measure.rate * np.diff(time)).any():
        return found
    start = time <= time[0] + 10.0
    at, last = float(time[0]), float(np.median(value[start]))
    for k, (t, v) in enumerate(zip(time.tolist(), value.tolist(), strict=True)):
        if abs(v - last) > measure.jitter + measure.rate * (t - at):
            found[k] = True
        else:
            at, last = t, v
    return found


def _frozen(measure: Measure, time: np.ndarray, value: np.ndarray) -> np.ndarray:
    if not time.size:
        return np.zeros(0, bool)
    run = np.concatenate([[0], np.cumsum(np.diff(value) != 0.0)])
    first = np.flatnonzero(np.concatenate([[True], np.diff(run) > 0]))
    last = np.concatenate([first[1:], [time.size]]) - 1
    hangs = (time[last] - time[first] > measure.frozen_s) & (last - first + 1 >= _FROZEN_SAMPLES)
    return hangs[run]


def _outliers(measure: Measure, time: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Hampel's identifier; its scale is at least the step in which the device counts."""
    if time.size < 2:
        return np.zeros(time.size, bool)
    side = min(_SIDE, int(_NEAR_S / np.median(np.diff(time)) + 1e-6))
    width = 2 * side + 1
    if side < _LEAST_SIDE or time.size < width:
        return np.zeros(time.size, bool)
    around = np.lib.stride_tricks.sliding_window_view(value, width)
    index = np.clip(np.arange(time.size) - side, 0, time.size - width)
    middle = np.median(around, axis=1)
    spread = _MAD_TO_SD * np.median(np.abs(around - middle[:, None]), axis=1)
    # Where samples are missing, the window reaches farther than the body stays the same.
    close = (time[width - 1 :] - time[: 1 - width])[index] <= 4.0 * _NEAR_S
    steps = np.abs(np.diff(value))
    step = float(steps[steps > 1e-9 * max(1.0, np.abs(value).max())].min(initial=np.inf))
    spread = np.maximum(spread, step if np.isfinite(step) else 0.0)
    return close & (np.abs(value - middle[index]) > _SIGMAS * spread[index])


@dataclass(frozen=True)
class Block:
    """An unbroken stretch of one label: [start, end) in seconds. moved_s: when the last emotion before it ended, -inf if
    there was none."""

    emotion: str
    start_s: float
    end_s: float
    moved_s: float


def blocks(track: Track) -> list[Block]:
    """The labels of a track in time. A label holds until the next sample has another."""
    label, time = track.emotion, track.time_s
    first = np.flatnonzero(np.concatenate([[True], label[1:] != label[:-1]]))
    step = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    starts = time[first].tolist()
    found, moved = [], -np.inf
    for emotion, start, end in zip(label[first], starts, [*starts[1:], float(time[-1]) + step], strict=True):
        if emotion:
            found.append(Block(emotion, start, end, moved))
        if emotion not in ("", NEUTRAL):
            moved = end
    return found


@dataclass(frozen=True)
class Settling:
    """How the samples of a block become one number.

    settle_s: left out after any label begins: the body is on its way. recover_s: left out of neutral labels after an
    emotion has ended: blood comes back slowly. window_s: samples are averaged in windows of this length and the
    block is the mean of its windows, so that a denser stretch counts no more. Defaults are guesses made from the time
    constants of a blush that are said to be 5-8 s up and 30-60 s down (no stored source).
    """

    settle_s: float = 15.0
    recover_s: float = 60.0
    window_s: float = 5.0

    def begin_s(self, block: Block) -> float:
        """Where a block is settled."""
        calm = block.moved_s + self.recover_s if block.emotion == NEUTRAL else -np.inf
        return max(block.start_s + self.settle_s, calm)


@dataclass(frozen=True)
class Level:
    """What one block settled on: its middle in seconds, the mean of its windows, and how many samples went into it."""

    emotion: str
    middle_s: float
    value: float
    samples: int


def levels(cleaned: Clean, lag_s: float, settling: Settling) -> list[Level]:
    """One level per block that has a window with at least half of its samples left; labels are moved by the sensor's lag."""
    found = []
    for block in blocks(cleaned.track):
        start, end = settling.begin_s(block) + lag_s, block.end_s + lag_s
        lo, hi = np.searchsorted(cleaned.time_s, (start, end))
        if hi <= lo:
            continue
        window = ((cleaned.time_s[lo:hi] - start) // settling.window_s).astype(np.int64)
        window -= window[0]
        count = np.bincount(window)
        all_lo, all_hi = np.searchsorted(cleaned.track.time_s, (start, end))
        full = ((cleaned.track.time_s[all_lo:all_hi] - start) // settling.window_s).astype(np.int64)
        offset = int((cleaned.time_s[lo] - start) // settling.window_s)
        had = np.bincount(full)[offset : offset + count.size]
        good = (count > 0) & (2 * count >= had)
        if not good.any():
            continue
        means = np.bincount(window, weights=cleaned.value[lo:hi])[good] / count[good]
        found.append(Level(block.emotion, (start + end) / 2.0, float(means.mean()), int(count[good].sum())))
    return found
