"""Recorded values onto frames: smoothing without delay, resampling that keeps peaks, and fewer keys.

A blink lasts 0.1-0.15 s. Point samples at 24 frames a second miss its top by up to half of a frame (21 ms) and with
it a good part of its height. Renders see whole frames only, so a peak is worth nothing between them: here every
local extremum of the recording is put, at its full value, on the frame nearest to it. It moves by half a frame at
most, which is less than the recording's own uncertainty of when the shutter was open.
"""

from __future__ import annotations

import numpy as np

LEAST_PEAK = 0.01
"""Extrema that stand out by less are noise: their frames are interpolated like all others."""


def frame_count(seconds: np.ndarray, fps: float) -> int:
    """Frames that a take of these times (N,), first 0, covers at `fps`."""
    return int(np.floor(seconds[-1] * fps + 0.5)) + 1


def resample(seconds: np.ndarray, values: np.ndarray, fps: float) -> np.ndarray:
    """Values (F,) at frames 0, 1, … of `fps` from values (N,) at times (N,), increasing.

    Straight lines between the recorded times, so gaps are bridged; on the frame nearest to a local extremum, its value.
    Of a peak and a dip within one frame the peak stays, of two peaks the greater.
    """
    frames = np.arange(frame_count(seconds, fps))
    result = np.interp(frames / fps, seconds, values)
    nearest = np.minimum(np.floor(seconds * fps + 0.5).astype(int), frames[-1])
    for sign in (-1.0, 1.0):  # dips first: peaks are the muscle's work and overrule them
        tops = _peaks(sign * values)
        order = tops[np.argsort(sign * values[tops], kind="stable")]
        result[nearest[order]] = values[order]  # of several on one frame the last, the greatest, stays
    return result


def _peaks(values: np.ndarray) -> np.ndarray:
    """Indices of local maxima that stand `LEAST_PEAK` above the lowest point on either side before something higher.

    A flat top counts at its first sample. The ends count as lower than everything.
    """
    if len(values) < 2:
        return np.arange(len(values))
    # Turning points with hysteresis: a maximum stands once the curve has fallen by LEAST_PEAK from it.
    peaks = []
    top = bottom = values[0]
    at, rising = 0, True
    for i, value in enumerate(values.tolist()):
        if rising:
            if value > top:
                top, at = value, i
            elif value <= top - LEAST_PEAK:
                peaks.append(at)
                rising, bottom = False, value
        elif value < bottom:
            bottom = value
        elif value >= bottom + LEAST_PEAK:
            rising, top, at = True, value, i
    if rising:
        peaks.append(at)
    return np.array(peaks, dtype=int)


def smooth(seconds: np.ndarray, values: np.ndarray, fps: float, window_s: float) -> np.ndarray:
    """Savitzky-Golay smoothing of values (N, …) at times (N,): a parabola through every `window_s`, without delay.

    Works on the recording's own even grid (`fps`), to which gaps are bridged. The first and the last half window are
    read off the parabolas of the first and the last whole window. A window of less than 5 frames smooths nothing.
    """
    half = int(round(window_s * fps / 2))
    count = int(np.floor(seconds[-1] * fps + 0.5)) + 1
    if half < 2 or count < 2 * half + 1:
        return values
    grid = np.arange(count) / fps
    flat = values.reshape(len(values), -1)
    even = np.column_stack([np.interp(grid, seconds, column) for column in flat.T])
    offsets = np.arange(-half, half + 1)
    # (3, window): least-squares value, slope and half curvature at the window's middle.
    fit = np.linalg.pinv(np.vander(offsets, 3, increasing=True).astype(float))
    result = np.empty_like(even)
    for column in range(even.shape[1]):
        result[half : count - half, column] = np.convolve(even[:, column], fit[0][::-1], mode="valid")
    result[:half] = np.vander(offsets[:half], 3, increasing=True) @ (fit @ even[: 2 * half + 1])
    result[count - half :] = np.vander(offsets[half + 1 :], 3, increasing=True) @ (fit @ even[count - 2 * half - 1 :])
    back = np.column_stack([np.interp(seconds, grid, column) for column in result.T])
    return back.reshape(values.shape)


def reduce_keys(values: np.ndarray, tolerance: float) -> np.ndarray:
    """Indices (M,) of the frames whose keys, joined by straight lines, stay within `tolerance` of values (F,).

    Ramer-Douglas-Peucker on height: the farthest frame is kept until none is farther than `tolerance`.
    """
    keep = {0, len(values) - 1}
    spans = [(0, len(values) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        inside = np.arange(first + 1, last)
        line = values[first] + (values[last] - values[first]) * (inside - first) / (last - first)
        away = np.abs(values[inside] - line)
        far = int(away.argmax())
        if away[far] > tolerance:
            keep.add(first + 1 + far)
            spans += [(first, first + 1 + far), (first + 1 + far, last)]
    return np.array(sorted(keep))
