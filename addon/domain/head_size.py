"""How tall a head is, and whether that can be: a mesh in another unit gets pores and light of the wrong size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .face_regions import UNITS

HEAD_MM = (150.0, 350.0)
"""What counts as a head, from chin to crown: a child's face without its crown to a giant's. A guess, wide on purpose:
adults have 200 to 260."""
_USUAL_MM = 230.0  # a guess within what adults have
_CROWN = 4.0  # in distances of the eyes: how far from them the crown is looked for
_CHIN = 0.5  # of the most that the jaw moves: what moves more is chin


@dataclass(frozen=True)
class HeadSize:
    """height_mm: chin to crown, or the longest side of the mesh where nothing tells its chin. factor: what the face should be scaled
    by, 1 if it is a head as it stands."""

    height_mm: float
    whole_mesh: bool
    factor: float

    @property
    def line(self) -> str:
        said = f"the head is {self.height_mm:.4g} mm tall"
        if self.whole_mesh:
            said = f"the mesh measures {self.height_mm:.4g} mm"
        if self.factor == 1.0:
            return said
        return f"{said}, a head has {HEAD_MM[0]:g} to {HEAD_MM[1]:g}: scale it by {self.factor:g}"


def head_size(position_mm: np.ndarray, landmarks: Mapping[str, np.ndarray], jaw: np.ndarray | None = None) -> HeadSize:
    """The size of a head.

    position_mm : (V, 3), any side up. landmarks : those of `face_regions.FoundRegions`, in mm; may be empty.
    jaw : (V,) how far each point moves as the jaw opens, in any unit.
    """
    if len(position_mm) == 0:
        return HeadSize(0.0, True, 1.0)
    position_mm = np.asarray(position_mm, dtype=np.float64)
    whole = not {"eye_left", "eye_right", "mouth"} <= set(landmarks) or jaw is None or not np.any(jaw > 0)
    if whole:
        height = float(np.ptp(position_mm, axis=0).max())
    else:
        left, right, mouth = (np.asarray(landmarks[name], dtype=np.float64) for name in ("eye_left", "eye_right", "mouth"))
        eyes, across = (left + right) / 2, left - right
        apart = float(np.linalg.norm(across))
        up = eyes - mouth
        up -= (up @ across) / (across @ across) * across
        up /= np.linalg.norm(up)
        along = (position_mm - eyes) @ up
        near = np.linalg.norm(position_mm - eyes, axis=1) < _CROWN * apart
        height = float(along[near].max() - along[near & (jaw > _CHIN * jaw[near].max())].min()) if near.any() else 0.0
    return HeadSize(height, whole, _factor(height))


def _factor(height_mm: float) -> float:
    low, high = HEAD_MM
    if low <= height_mm <= high or height_mm <= 0.0:
        return 1.0
    fits = [unit for unit in (*UNITS.values(), *(1.0 / unit for unit in UNITS.values())) if low <= height_mm * unit <= high]
    near = min(fits, key=lambda unit: abs(np.log(height_mm * unit / _USUAL_MM)), default=_USUAL_MM / height_mm)
    return float(f"{near:.3g}")
