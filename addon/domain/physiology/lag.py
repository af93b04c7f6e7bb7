"""How late a sensor answers a label: a finger is farther from the lungs than a face, and oximeters average."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .cleaning import Clean, blocks
from .recording import NEUTRAL

MAX_LAG_S = 30.0
WIDEST_S = 10.0
"""An estimate whose interval is wider says nothing that could be used."""

_BEFORE_S, _AFTER_S, _LEAST_S = 20.0, 60.0, 10.0
_RISE_S = (0.0, 2.0, 4.0, 8.0, 15.0)  # time constants of the rise that are tried
_RESAMPLES = 200
_MIN_SUBJECTS = 3


@dataclass(frozen=True)
class Lag:
    """Seconds from a label to the begin of the answer, with a 95 % interval over subjects; None: no estimate."""

    value_s: float | None
    low_s: float | None
    high_s: float | None
    onsets: int

    @property
    def usable(self) -> bool:
        """Narrow enough, and not at the end of what was searched."""
        return self.value_s is not None and self.high_s - self.low_s <= WIDEST_S and self.value_s < MAX_LAG_S


def estimate_lag(tracks: Sequence[Clean]) -> Lag:
    """The lag of one measure, from every change of label from neutral to an emotion.

    Each onset is fitted by a rest, a lag and an exponential rise to another level: level and rest are its own, with the
    lag and the time constant common to all. Which way an onset goes plays no part, so that choosing the lag favours no
    direction of the change that is estimated later. The lag is the one of least sum of n/2 log(residual sum of squares),
    the likelihood of onsets that differ in noise; its interval is the percentile bootstrap over subjects.
    """
    onsets, subjects = [], []
    steps = [float(np.median(np.diff(c.time_s))) for c in tracks if c.time_s.size > 1]
    if not steps:
        return Lag(None, None, None, 0)
    step = min(max(float(np.median(steps)), 0.5), 5.0)
    grid = np.arange(-_BEFORE_S, _AFTER_S + step / 2, step)
    for cleaned in tracks:
        found = blocks(cleaned.track)
        for before, block in zip(found, found[1:], strict=False):
            if block.emotion == NEUTRAL or before.emotion != NEUTRAL or before.end_s != block.start_s:
                continue
            if min(before.end_s - before.start_s, block.end_s - block.start_s) < _LEAST_S:
                continue
            place = np.rint((cleaned.time_s - block.start_s - grid[0]) / step).astype(np.int64)
            inside = (place >= 0) & (place < grid.size)
            inside &= (cleaned.time_s >= before.start_s) & (cleaned.time_s < block.end_s)
            count = np.bincount(place[inside], minlength=grid.size)
            total = np.bincount(place[inside], weights=cleaned.value[inside], minlength=grid.size)
            # Too few samples, or all before or all after: no level and no rest.
            if (count > 0).sum() < 10 or not count[grid < 0].any() or not count[grid > MAX_LAG_S / 2].any():
                continue
            onsets.append(np.stack([count > 0, np.where(count > 0, total / np.maximum(count, 1), 0.0)]))
            subjects.append(cleaned.track.subject)
    names, who = np.unique(np.array(subjects, dtype=object), return_inverse=True) if onsets else ([], np.zeros(0, int))
    if len(names) < _MIN_SUBJECTS:
        return Lag(None, None, None, len(onsets))

    lags = np.arange(0.0, MAX_LAG_S + step / 2, step)
    cost = np.array(
        [_cost(np.array(onsets), _rises(grid, lags, rise, step)) for rise in _RISE_S]
    )  # (rises, onsets, lags)
    by_subject = np.zeros((len(names), *cost.shape[::2]))  # (subjects, rises, lags)
    np.add.at(by_subject, who, cost.transpose(1, 0, 2))
    random = np.random.default_rng(0)
    times = random.multinomial(len(names), np.full(len(names), 1.0 / len(names)), _RESAMPLES)

    def best(sums: np.ndarray) -> np.ndarray:
        """(…, rises, lags) -> (…) seconds."""
        return lags[sums.min(axis=-2).argmin(axis=-1)]

    drawn = best(np.tensordot(times, by_subject, axes=1))
    low, high = np.quantile(drawn, (0.025, 0.975))
    return Lag(float(best(by_subject.sum(axis=0))), float(low), float(high), len(onsets))


def _rises(grid: np.ndarray, lags: np.ndarray, rise_s: float, step: float) -> np.ndarray:
    """(lags, T): 0 before the lag, then toward 1."""
    since = grid - lags[:, None]
    if rise_s == 0.0:
        return np.clip(since / step + 0.5, 0.0, 1.0)
    return -np.expm1(-np.maximum(since, 0.0) / rise_s)


def _cost(onsets: np.ndarray, rises: np.ndarray) -> np.ndarray:
    """(onsets, lags) of n/2 log(residual sum of squares). onsets (N, 2, T): where there are samples, and their means."""
    there, x = onsets[:, 0], onsets[:, 1]
    n = there.sum(axis=1)[:, None]
    x = (x - x.sum(axis=1, keepdims=True) / n) * there
    mean = there @ rises.T / n
    spread = np.maximum(there @ (rises**2).T - n * mean**2, 1e-9)
    both = x @ rises.T  # x has the mean 0
    total = (x**2).sum(axis=1)[:, None]
    # The floor keeps an onset without any noise from deciding alone.
    return n / 2 * np.log(np.maximum(total - both**2 / spread, 1e-6 * total + 1e-15))
