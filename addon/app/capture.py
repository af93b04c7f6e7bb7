"""The `capture` use-case: a recorded face as curves on the controls of a rig, at the frames of a scene."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..domain.blood import MOOD_SUFFIX
from ..domain.capture_curves import frame_count, reduce_keys, resample, smooth
from ..domain.capture_emotion import UNREADABLE, infer_emotions
from ..domain.capture_files import Take, read_take
from ..domain.capture_units import units_of_gaze, units_of_head, units_of_keys
from ..domain.errors import InputError, nearest
from ..domain.facs import ARKIT, DEFAULT_EMOTIONS, EMOTION_CONTROLS, shape_key_values

MIN_FPS, MAX_FPS = 1.0, 240.0
MAX_SMOOTH_S = 2.0
MAX_FRAMES = 500_000
_STILL = 0.01  # a control that never gets this far gets no curve
_RESIDUAL_FRAMES = 500
_WORTH_SAYING = 0.1  # root mean square that a key leaves unfollowed


@dataclass
class Performance:
    """A recorded face for the controls of a rig.

    fps, frames : rate, and number of frames from 0
    controls    : 'AU12L' …, 'anger_blood' … -> (frame (K,), value (K,)); the rest of the controls stays at 0
    head_deg    : 'yaw', 'pitch', 'roll' -> the same, degrees from the head's median: to the subject's left, up, onto
                  the left shoulder. Units 51 to 56 hold the same, as far as the rig's head goes
    residual    : key -> {"rms", "max"} of what the rig does not follow, with all its clamps and fades, on up to 500
                  recorded frames
    peak_error  : largest loss of a control's highest value by resampling and reduction, as a share of that value
    notes       : what was found in and done to the data, one line each
    """

    name: str
    kind: str
    source_fps: float
    fps: float
    frames: int
    seconds: float
    controls: dict[str, tuple[np.ndarray, np.ndarray]]
    head_deg: dict[str, tuple[np.ndarray, np.ndarray]]
    residual: dict[str, dict[str, float]]
    peak_error: float
    notes: list[str] = field(default_factory=list)

    def emotions(self) -> dict[str, float]:
        """Highest level of each emotion that was inferred."""
        return {
            name.removesuffix(MOOD_SUFFIX): float(values.max())
            for name, (_, values) in self.controls.items()
            if name.endswith(MOOD_SUFFIX)
        }


def capture(
    path: str | os.PathLike[str],
    fps: float = 24.0,
    smooth_s: float = 0.0,
    emotions: Sequence[str] = DEFAULT_EMOTIONS,
    source_fps: float | None = None,
    reduce: float = 0.0,
    head: bool = True,
) -> Performance:
    """The performance in the file `path`. Raises InputError for a bad file or option.

    Parameters
    ----------
    fps : frames per second of the scene
    smooth_s : window of the smoothing, seconds; 0 for none
    emotions : those to be inferred; empty for none
    source_fps : the recording's rate, for a file that does not tell the time
    reduce : leave out keys as far as no value is off by more than this; 0 for a key on every frame
    head : whether the head's turns become units 51 to 56
    """
    for flag, value, low, high in (
        ("--fps", fps, MIN_FPS, MAX_FPS),
        ("--smooth", smooth_s, 0.0, MAX_SMOOTH_S),
        ("--reduce", reduce, 0.0, 0.5),
    ):
        if not low <= value <= high:
            raise InputError(f"{flag}: {value:g} is outside {low:g} to {high:g}")
    for name in emotions:
        if name not in EMOTION_CONTROLS:
            raise InputError(f"--emotions: {name}: no such emotion, {nearest(name, EMOTION_CONTROLS)}")
    take = read_take(path, source_fps)
    for rate in (fps, take.fps):
        if frame_count(take.seconds, rate) > MAX_FRAMES:
            raise InputError(
                f"{path}: {take.seconds[-1]:.0f} s at {rate:g} frames a second are more than {MAX_FRAMES} frames"
            )
    return perform(take, fps, smooth_s, emotions, reduce, head)


def perform(
    take: Take,
    fps: float,
    smooth_s: float = 0.0,
    emotions: Sequence[str] = DEFAULT_EMOTIONS,
    reduce: float = 0.0,
    head: bool = True,
) -> Performance:
    """The performance of a take that was read."""
    notes = list(take.notes)
    if smooth_s > 0:
        _smooth(take, smooth_s)
    if take.keys:
        followed = units_of_keys(take.keys)
        units, shown = followed.controls, followed.shown
        residual = _residual(take, units, notes)
    else:
        units = {f"AU{unit}": values for unit, values in take.units.items()}
        shown, residual = units, {}
    turned = {name: values - np.median(values) for name, values in take.head.items()}
    units = units | units_of_gaze(take.gaze) | (units_of_head(turned) if head else {})
    levels = infer_emotions(take.seconds, shown, emotions)
    notes += [f"{name}: not inferred, {UNREADABLE[name]}" for name in emotions if name in UNREADABLE]
    curves = {name: values for name, values in units.items() if values.max() >= _STILL}
    curves |= {name + MOOD_SUFFIX: values for name, values in levels.items() if values.max() >= _STILL}

    controls, peak_error = {}, 0.0
    for name, values in curves.items():
        controls[name] = _keys(take.seconds, values, fps, reduce)
        peak_error = max(peak_error, float(values.max() - controls[name][1].max()) / float(values.max()))
    head_deg = {name: _keys(take.seconds, np.degrees(values), fps, 60 * reduce) for name, values in turned.items()}
    return Performance(
        take.name,
        take.kind,
        take.fps,
        fps,
        frame_count(take.seconds, fps),
        float(take.seconds[-1]),
        controls,
        head_deg,
        residual,
        peak_error,
        notes,
    )


def _smooth(take: Take, window_s: float) -> None:
    for curves in (take.keys, take.units, take.head, take.gaze):
        if not curves:
            continue
        values = smooth(take.seconds, np.column_stack(list(curves.values())), take.fps, window_s)
        if curves is take.keys or curves is take.units:
            values = np.clip(values, 0.0, 1.0)
        curves.update({name: values[:, i] for i, name in enumerate(list(curves))})


def _keys(seconds: np.ndarray, values: np.ndarray, fps: float, reduce: float) -> tuple[np.ndarray, np.ndarray]:
    at_frames = resample(seconds, values, fps)
    frames = reduce_keys(at_frames, reduce) if reduce > 0 else np.arange(len(at_frames))
    return frames, at_frames[frames]


def _residual(take: Take, units: dict[str, np.ndarray], notes: list[str]) -> dict[str, dict[str, float]]:
    some = np.unique(np.linspace(0, len(take.seconds) - 1, _RESIDUAL_FRAMES).astype(int))
    faces = [shape_key_values({name: float(values[i]) for name, values in units.items()}) for i in some]
    found = {}
    for key in ARKIT.keys:
        recorded = take.keys[key][some] if key in take.keys else np.zeros(len(some))
        off = recorded - [face.get(key, 0.0) for face in faces]
        found[key] = {"rms": float(np.sqrt(np.mean(off**2))), "max": float(np.abs(off).max())}
    for key, size in found.items():
        if size["rms"] > _WORTH_SAYING and key not in ARKIT.unreached:
            notes.append(f"{key}: the rig is off by {size['rms']:.2f} (rms), {size['max']:.2f} at most")
        elif key in ARKIT.unreached and size["max"] > _WORTH_SAYING:
            notes.append(f"{key}: recorded up to {size['max']:.2f}, no unit drives it: {ARKIT.unreached[key]}")
    return found


def capture_report(performance: Performance) -> dict[str, Any]:
    """The answer of `sanguine capture`, as docs/capture.md lays it out."""
    import sanguine_core

    def curves(of: dict[str, tuple[np.ndarray, np.ndarray]]) -> dict[str, dict[str, list[float]]]:
        return {
            name: {"frame": frames.tolist(), "value": [round(float(value), 6) for value in values]}
            for name, (frames, values) in of.items()
        }

    return {
        "sanguine": sanguine_core.__version__,
        "take": performance.name,
        "format": performance.kind,
        "source_fps": performance.source_fps,
        "fps": performance.fps,
        "frames": performance.frames,
        "seconds": performance.seconds,
        "controls": curves(performance.controls),
        "head_deg": curves(performance.head_deg),
        "emotions": performance.emotions(),
        "residual": performance.residual,
        "peak_error": performance.peak_error,
        "notes": performance.notes,
    }
