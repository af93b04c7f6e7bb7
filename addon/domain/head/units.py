"""Mends of the package's face units, each with its reason. They are made once, on the unshaped mesh, for all heads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..own_keys import Bump
from .package import ARKIT_NAMES, swelling


@dataclass(frozen=True)
class Mend:
    """How a unit's displacement is altered.

    gain     : (mm from the midline, factor) pairs, applied to the whole displacement
    together : a point may go toward the midline by this share of its distance from it, no farther
    bump     : added to it, given for the left side; a unit without sides gets it on both
    """

    unit: str
    gain: tuple[tuple[float, float], ...]
    together: float
    reason: str
    bump: Bump | None = None


MENDS = (
    Mend(
        "browDown",
        ((0, 1.25), (12, 1.55), (20, 1.5), (34, 0.95), (48, 0.4)),
        0.38,
        "as sculpted the tail falls 5 mm and the inner end 3: a low brow, not an angry one. Corrugator and "
        "depressors pull at the inner end; the tail only follows. The skin between the brows folded over itself.",
    ),
    Mend(
        "browInnerUp",
        ((0, 1.5), (12, 2.0), (20, 1.8), (30, 1.0), (42, 0.4)),
        0.38,
        "as sculpted the inner end rises 4 mm, lost on a heavy brow; the medial frontalis lifts it by 8 and more. Its lower "
        "edge stayed behind, which drew the hairs apart.",
        Bump(center=(14.0, -149.0, 738.0), radius_mm=5.0, move_mm=(0.0, 0.0, 3.2)),
    ),
    Mend(
        "noseSneer",
        ((0, 1.0),),
        0.2,
        "draws the brows together as well; with browDown the skin between them folded over itself.",
    ),
    Mend(
        "cheekSquint",
        ((0, 1.0),),
        1.0,
        "as sculpted the skin under the lid slides up along its slope into the eyeball, which came out through it beside "
        "eyeSquint. The muscle that lifts it swells as it contracts.",
        Bump(center=(42.0, -137.0, 713.0), radius_mm=9.0, move_mm=(0.4, -1.5, 0.0)),
    ),
)


def mend(units: np.ndarray, base: np.ndarray) -> None:
    """Mends units (K, V, 3) in place, the first of which are ARKit's; `base` (V, 3) is the unshaped mesh, metres."""
    from_middle = np.abs(base[:, 0]) * 1e3
    for row in MENDS:
        factor = np.interp(from_middle, *np.array(row.gain).T).astype(np.float32)
        for name in ARKIT_NAMES:
            if name.removesuffix("Left").removesuffix("Right") == row.unit:
                move = units[ARKIT_NAMES.index(name)]
                move *= factor[:, None]
                for side, flip in (("Left", np.float32([1, 1, 1])), ("Right", np.float32([-1, 1, 1]))):
                    if row.bump is not None and (name.endswith(side) or name == row.unit):
                        move += swelling(row.bump, base * flip) * flip
                inward = -np.sign(base[:, 0]) * move[:, 0]
                limit = row.together * np.abs(base[:, 0])
                # Half the limit is free; beyond it the way inward approaches the limit and never reaches it.
                free = limit / 2
                over = np.maximum(inward - free, 0)
                room = np.maximum(limit - free, 1e-9)
                move[:, 0] += np.sign(base[:, 0]) * (over - room * np.tanh(over / room))
