"""Lips that meet: the package's are a quarter to three quarters of a millimetre apart, a dark line in every picture."""

from __future__ import annotations

import numpy as np

from .surface import Subdivision, smoothstep

OVERLAP_MM = 0.35  # of the two rims' extremes; they lie about a millimetre apart in depth, so they just touch
REACH_MM = (1.5, 9.0)  # distance from the line between the lips: moved whole up to the first, not at all from the second
BASE_LINE_M = 0.6609  # the unshaped mesh's lips part at this height from corner to corner
HALF_WIDTH_MM = 26.0
CORNER_MM = (23.0, 25.5)  # from the midline of the unshaped mesh: the seal fades out where the lips are one anyway
DEPTH_MM = 20.0  # from the most forward point of the lips to the corners of the mouth
ROUNDS = 4


def parting(fine: np.ndarray, lower: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """In columns a millimetre wide: where they stand (x, mm), the upper lip's lowest and the lower lip's highest z, mm.

    fine : (W, 3) the skin as rendered, metres; lower, near (W,) bool. NaN where a column lacks one of the lips.
    """
    x, z = fine[near, 0] * 1e3, fine[near, 2] * 1e3
    columns = np.arange(-HALF_WIDTH_MM, HALF_WIDTH_MM + 1)
    upper_z, lower_z = np.full(len(columns), np.nan), np.full(len(columns), np.nan)
    for k, column in enumerate(columns):
        here = np.abs(x - column) < 0.8
        above, below = z[here & ~lower[near]], z[here & lower[near]]
        if above.size and below.size:
            upper_z[k], lower_z[k] = above.min(), below.max()
    return columns, upper_z, lower_z


def near_lips(base: np.ndarray) -> np.ndarray:
    """Vertices of the lips and their inner side, on the unshaped mesh."""
    box = (np.abs(base[:, 0]) < HALF_WIDTH_MM * 1e-3) & (np.abs(base[:, 2] - BASE_LINE_M) < 0.010)
    return box & (base[:, 1] < base[box, 1].min() + DEPTH_MM * 1e-3)


def seal(skin: np.ndarray, base: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Displacement (V, 3) of the skin's cage that closes the lips along their whole length.

    skin, base : (V, 3) the cage in the head's shape and unshaped, metres
    """
    first = Subdivision(faces, len(skin))
    second = Subdivision(first.faces, int(first.faces.max()) + 1)
    lower_cage = base[:, 2] < BASE_LINE_M
    fine_base = second(first(base))
    lower, near = fine_base[:, 2] < BASE_LINE_M, near_lips(fine_base)
    here = near_lips(base)
    shift = np.zeros_like(skin)
    for _ in range(ROUNDS):
        moved = skin + shift
        columns, upper_z, lower_z = parting(second(first(moved)), lower, near)
        both = np.isfinite(upper_z)
        gap = np.interp(columns, columns[both], (upper_z - lower_z)[both] + OVERLAP_MM)
        line = np.interp(columns, columns[both], (upper_z + lower_z)[both] / 2)
        gap = np.convolve(np.pad(gap, 1, "edge"), [0.25, 0.5, 0.25], "valid")
        x, z = moved[here, 0] * 1e3, moved[here, 2] * 1e3
        share = 1 - smoothstep(*REACH_MM, np.abs(z - np.interp(x, columns, line)))
        share *= 1 - smoothstep(*CORNER_MM, np.abs(base[here, 0]) * 1e3)
        step = np.interp(x, columns, gap) / 2 * share * 1e-3
        shift[here, 2] += np.where(lower_cage[here], step, -step)
    return shift
