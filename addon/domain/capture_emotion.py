"""Which emotions a recorded face shows, over time: a mix of the patterns of rigs/emotions.toml.

The recorded units move the muscles already; what is inferred here moves the blood alone, so it needs to be right over
seconds, not frames. Three things make it robust to what faces do beside feeling:

- A blink is shorter and a syllable faster than an emotion: upper-face units count by their median over 0.7 s, units of
  speech by a low quantile over 1.2 s, which syllables fall below again and again and a held expression does not.
- An emotion needs all of its units: a pattern that asks for more than is seen costs much, what is seen beyond the
  pattern costs little. Raised brows alone are not fear.
- Levels rise and fall as a person's do: smoothed without delay, and shown only where they once stand out.

It is a fit to our own table of prototypes, not a trained classifier; docs/capture.md has what it gets right on
performances made from that table, and what that proves.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache

import numpy as np

from .capture_units import units_of_keys
from .facs import ACTION_UNITS, DEFAULT_EMOTIONS, EMOTION_MAX, emotion_units, shape_key_values

UNREADABLE = {"arousal": "its open lips and heavy lids are those of anyone who speaks or blinks"}
"""Emotions that no recording of a face tells."""

_SPEECH = frozenset("8 10 14 16 17 18 19 20 22 23 24 25 26 27 28 29 30 32 34".split())
_NOT_FELT = frozenset(
    "43 45 46 51 52 53 54 55 56 57 58 61 62 63 64 65 66".split()
)  # lids, head and gaze go everywhere in every mood
_RATE_HZ = 20.0
_UPPER_S, _SPEECH_S, _SPEECH_QUANTILE = 0.7, 1.2, 0.35
_RESTING_FACE = 0.1  # at most this much of a unit is taken for how the face is at rest
_BEYOND_COST, _SPEECH_WEIGHT = 0.3, 0.5
_OPTIONAL, _OPTIONAL_COST = frozenset({"25", "26", "27"}), 0.2  # EMFACS lists them as variants: a smile may be closed
_SPARSITY = 0.02
_SMOOTH_S, _ON, _OFF, _LEAST_S = 0.35, 0.14, 0.06, 0.5
_LEVELS = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5)

Patterns = Callable[[str, float], Mapping[str, float]]


def infer_emotions(
    seconds: np.ndarray, units: Mapping[str, np.ndarray], emotions: Sequence[str] = DEFAULT_EMOTIONS
) -> dict[str, np.ndarray]:
    """Level of each emotion (N,), 0 to 1.5, from controls 'AU12L' or 'AU12' … -> (N,) at times (N,)."""
    emotions = tuple(name for name in emotions if name not in UNREADABLE)
    if not emotions or not len(seconds):
        return {}
    patterns = _face_patterns if any(name[-1] in "LR" for name in units) else _unit_patterns
    features = tuple(sorted(name for name in units if name[2:].rstrip("LR") not in _NOT_FELT))
    if not features:
        return {name: np.zeros(len(seconds)) for name in emotions}
    model = _Model(features, tuple(emotions), patterns)
    count = max(2, int(np.ceil(seconds[-1] * _RATE_HZ)) + 1)
    grid = np.arange(count) / _RATE_HZ
    seen = np.array([_steady(np.interp(grid, seconds, units[name]), name) for name in features]).T
    levels = _settled(model.levels(seen))
    return {name: np.interp(seconds, grid, levels[:, i]) for i, name in enumerate(emotions)}


def _steady(values: np.ndarray, control: str) -> np.ndarray:
    """What stands behind blinks and syllables, above the resting face."""
    if control[2:].rstrip("LR") in _SPEECH:
        held = _rolling_quantile(values, _SPEECH_S, _SPEECH_QUANTILE)
    else:
        held = _rolling_quantile(values, _UPPER_S, 0.5)
    rest = min(float(np.quantile(held, 0.1)), _RESTING_FACE)
    return np.maximum(held - rest, 0.0)


def _rolling_quantile(values: np.ndarray, window_s: float, quantile: float) -> np.ndarray:
    half = int(round(window_s * _RATE_HZ / 2))
    padded = np.pad(values, half, mode="edge")
    return np.quantile(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), quantile, axis=1)


class _Model:
    """The mix of patterns that explains units best, and the slider levels behind it."""

    def __init__(self, features: tuple[str, ...], emotions: tuple[str, ...], patterns: Patterns):
        self._weights = np.array([_SPEECH_WEIGHT if f[2:].rstrip("LR") in _SPEECH else 1.0 for f in features])
        self._short = np.array([_OPTIONAL_COST if f[2:].rstrip("LR") in _OPTIONAL else 1.0 for f in features])

        def row(name: str, level: float) -> np.ndarray:
            asked = patterns(name, level)
            return np.array([asked.get(feature, 0.0) for feature in features])

        self._full = np.array([row(name, 1.0) for name in emotions])
        # Faces of the table at known levels calibrate what the fit finds in them (its cost, and patterns that change
        # with the level, make it less or more).
        found = np.array(
            [self._mix(np.array([row(name, level) for level in _LEVELS]))[:, i] for i, name in enumerate(emotions)]
        )
        self._found = np.maximum.accumulate(found, axis=1)

    def levels(self, seen: np.ndarray) -> np.ndarray:
        """(T, E) slider levels, 0 to 1.5, for units (T, U)."""
        mix = self._mix(seen)
        levels = [np.interp(mix[:, i], np.r_[0.0, found], (0.0, *_LEVELS)) for i, found in enumerate(self._found)]
        return np.where(mix > 0.0, np.column_stack(levels), 0.0)  # faint levels, too, may be found as nothing

    def _mix(self, seen: np.ndarray) -> np.ndarray:
        """(T, E) amounts of each full pattern: accelerated projected gradient on a convex, one-sided loss."""
        weighted = self._full * self._weights
        mix = ahead = np.zeros((len(seen), len(self._full)))
        steepest = np.linalg.eigvalsh(weighted @ self._full.T)[-1]
        if steepest <= 0.0:  # none of these emotions has a unit that was recorded
            return mix
        step = 1.0 / steepest
        momentum = 1.0
        for _ in range(300):
            off = ahead @ self._full - seen
            gradient = np.where(off > 0.0, self._short * off, _BEYOND_COST * off) @ weighted.T + _SPARSITY
            after = np.maximum(ahead - step * gradient, 0.0)
            grown = (1.0 + np.sqrt(1.0 + 4.0 * momentum**2)) / 2.0
            ahead, mix_before, mix, momentum = after + (momentum - 1.0) / grown * (after - mix), mix, after, grown
            if np.abs(mix - mix_before).max() < 1e-5:
                break
        return mix


def _settled(levels: np.ndarray) -> np.ndarray:
    """Levels (T, E) smoothed forth and back, and 0 where they never stand out for long enough."""
    keep = np.exp(-1.0 / (_RATE_HZ * _SMOOTH_S))
    smooth = levels.copy()
    for direction in (1, -1):
        run = smooth[::direction]
        for i in range(1, len(run)):
            run[i] = keep * run[i - 1] + (1.0 - keep) * run[i]
    result = np.zeros_like(smooth)
    for e in range(smooth.shape[1]):
        above = np.flatnonzero(np.diff(np.r_[False, smooth[:, e] > _OFF, False].astype(int)))
        for start, stop in above.reshape(-1, 2):
            if np.sum(smooth[start:stop, e] > _ON) >= _LEAST_S * _RATE_HZ:
                # From 0 at the threshold, so that nothing jumps.
                level = smooth[start:stop, e]
                result[start:stop, e] = level * np.clip((level - _OFF) / (_ON - _OFF), 0.0, 1.0)
    return np.minimum(result, EMOTION_MAX)


@cache
def _face_patterns(name: str, level: float) -> Mapping[str, float]:
    """What `units_of_keys` makes of the rig's own face: recordings of ARKit keys are seen through the same glasses."""
    keys = shape_key_values({name: level})
    return {
        unit: float(values[0])
        for unit, values in units_of_keys({k: np.array([v]) for k, v in keys.items()}).shown.items()
    }


@cache
def _unit_patterns(name: str, level: float) -> Mapping[str, float]:
    """The table's own units, without sides: for recordings of units."""
    asked = emotion_units(name, level)
    return {
        f"AU{unit.id}": sum(asked.get(side, 0.0) for side in unit.sides) / (1 if unit.one_sided else len(unit.sides))
        for unit in ACTION_UNITS.values()
    }
