"""From recorded ARKit keys, gaze and head to the sides of action units: what the rig's own table can follow.

The keys of a frame are a sum of units (`ACTION_UNITS[…].keys`), each 0 to 1. The inverse is a bounded least-squares
problem per frame, solved for all frames at once. Some units share keys so closely that the data cannot tell them
apart (23 is nearly a sum of 15, 18, 24 and 28; a jaw at 0.3 is 26 or 27); there the answer must not jump from one to
the other. Two things keep it a continuous function of the keys, so that no flicker is made that was not recorded:

- a small quadratic penalty makes the problem strictly convex: among equals the evenest mix is taken;
- units that are never the first guess (`_LATER`) get only what the others leave over.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from .facs import ACTION_UNITS, ARKIT, UNIT_TABLE, side_of

_FIRST = (
    "1 2 4 5 6 7 8 9 10 12 14 15 16 17 18 19 20 22 24 25 26 28 29 30 34 45 61 62 63 64 65 66"  # 43, 46: see 45
).split()
_LATER = ("27", "23")
"""27: the jaw drops (26) before it is pulled. 23: its keys are those of 15, 18, 24 and 28, which say the same with less
noise. The rest of the table (11, 13, 21, 32, 33, …) needs keys that no recording has, or is a mix of those above."""
_REPLACES = {"27": "26"}  # at full strength it stands in the place of the other, which is at 1 wherever it is needed
_BOTH_EYES = ("61", "62", "63", "64", "65", "66")  # eyes turn together; one side of a gaze is no unit of FACS
_RIDGE = 2e-3  # of each unit's own square: a unit alone comes out 0.2 % low
_ITERATIONS, _TOLERANCE = 600, 1e-4
_CHUNK = 20_000  # frames at a time, for memory
_LEAST_LEFT = 0.5

# How far full units turn the eyes of the example head (fitted rotation of its eyeLook keys), degrees.
EYE_TURN_DEG = {"61": 14.6, "62": 14.6, "63": 9.6, "64": 11.0}


@dataclass(frozen=True)
class Followed:
    """controls : 'AU12L' … -> (N,) 0-1, the sliders that make the face of the recording.
    shown    : the same units as they are then seen, some faded by others (rigs/action_units.toml, interference)
    residual : key -> (N,) recorded less the sum of the units, clamps and fades of the rig aside
    """

    controls: dict[str, np.ndarray]
    shown: dict[str, np.ndarray]
    residual: dict[str, np.ndarray]


def unit_parts(unit: str) -> tuple[str, ...]:
    """The sides of a unit that a recording can move apart: ('12L', '12R'), ('26',)."""
    return (unit,) if unit in _BOTH_EYES else ACTION_UNITS[unit].sides


@cache
def _columns() -> dict[str, np.ndarray]:
    """Part of a unit -> (52,) share of each key at full intensity. A key in the middle is half of each side's."""
    columns = {}
    for unit in (ACTION_UNITS[name] for name in (*_FIRST, *_LATER)):
        parts = unit_parts(unit.id)
        for part in parts:
            column = np.zeros(len(ARKIT.keys))
            for key, share in unit.keys.items():
                if key not in ARKIT.keys:
                    continue
                side = side_of(key)
                if len(parts) == 1 or side == part[-1]:
                    column[ARKIT.keys.index(key)] = share
                elif not side:
                    column[ARKIT.keys.index(key)] = share / 2
            columns[part] = column
    for unit, other in _REPLACES.items():
        columns[unit] = columns[unit] - columns[other]
    return columns


def units_of_keys(keys: Mapping[str, np.ndarray]) -> Followed:
    """The units behind recorded keys: key -> (N,) 0-1; keys not named are 0, other names are left out."""
    count = len(next(iter(keys.values())))
    recorded = np.zeros((count, len(ARKIT.keys)))
    for position, key in enumerate(ARKIT.keys):
        if key in keys:
            recorded[:, position] = keys[key]
    columns = _columns()
    left, found = recorded, {}
    for later in (False, True):
        names = [name for name in columns if (name.rstrip("LR") in _LATER) == later]  # parts of _FIRST, then of _LATER
        matrix = np.array([columns[name] for name in names])
        wanted = np.maximum(left, 0.0) if later else left
        values = np.concatenate(
            [_bounded_least_squares(matrix, wanted[i : i + _CHUNK]) for i in range(0, max(count, 1), _CHUNK)]
        )
        left = left - values @ matrix
        found |= {name: values[:, i] for i, name in enumerate(names)}
    return Followed(
        {f"AU{name}": values for name, values in _before_fading(found).items()},
        {f"AU{name}": values for name, values in found.items()},
        {key: left[:, i] for i, key in enumerate(ARKIT.keys)},
    )


def _before_fading(shown: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The units that are seen as `shown` after they faded each other: a few rounds of division by what is left.

    Fades of single keys are left alone, and where less than half is left (a lid raised under a closed one) the
    recording cannot say how strong the unit was, and noise would grow.
    """
    values = dict(shown)
    for _ in range(4):
        values = {
            part: np.minimum(seen / np.maximum(_left_over(part, values), _LEAST_LEFT), 1.0)
            for part, seen in shown.items()
        }
    return values


def _left_over(part: str, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """The share of a part that other units leave of it, as `domain/facs.py` has it."""
    unit, side = part.rstrip("LR"), part[-1] if part[-1] in "LR" else ""
    left = np.ones_like(values[part])
    for row in UNIT_TABLE.interference:
        if unit in row.units and not row.keys and unit not in _REPLACES.values():
            left = left * np.maximum(
                1.0 - sum(share * _beside(other, side, values) for other, share in row.by.items()), 0.0
            )
    for need in UNIT_TABLE.need:
        if unit == need.unit:
            left = left * np.clip(
                sum(share * _beside(other, side, values) for other, share in need.of.items()), 0.0, 1.0
            )
    return left


def _beside(unit: str, side: str, values: Mapping[str, np.ndarray]) -> np.ndarray | float:
    """A unit as one side of the face sees it."""
    names = [name for name in ((unit + side,) if unit + side in values else unit_parts(unit)) if name in values]
    return sum(values[name] for name in names) / len(names) if names else 0.0


def _bounded_least_squares(matrix: np.ndarray, target: np.ndarray) -> np.ndarray:
    """x (N, U) in 0-1 that minimises |x matrix - target|^2 + ridge, for matrix (U, K), target (N, K).

    Accelerated projected gradient with restart (Beck & Teboulle 2009, SIAM J. Imaging Sci. 2:183; O'Donoghue &
    Candes 2015, Found. Comput. Math. 15:715): one small matrix product for all frames a step.
    """
    hessian = matrix @ matrix.T
    hessian[np.diag_indices_from(hessian)] *= 1.0 + _RIDGE
    slope = target @ matrix.T
    step = 1.0 / np.linalg.eigvalsh(hessian)[-1]
    x = np.clip(slope / np.diag(hessian), 0.0, 1.0)
    ahead, momentum = x, 1.0
    for _ in range(_ITERATIONS):
        gradient = ahead @ hessian - slope
        after = np.clip(ahead - step * gradient, 0.0, 1.0)
        change = after - x
        if np.sum((ahead - after) * change) > 0:
            momentum = 1.0
        grown = (1.0 + np.sqrt(1.0 + 4.0 * momentum**2)) / 2.0
        ahead = after + (momentum - 1.0) / grown * change
        x, momentum = after, grown
        if np.abs(change).max(initial=0.0) < _TOLERANCE:
            break
    return x


def units_of_gaze(gaze: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The eyes' turn in the head, radians to the left and up, as units 61 to 64."""
    found = {}
    for name, positive, negative in (("yaw", "61", "62"), ("pitch", "63", "64")):
        if name in gaze:
            degrees = np.degrees(gaze[name])
            found[f"AU{positive}"] = np.clip(degrees / EYE_TURN_DEG[positive], 0.0, 1.0)
            found[f"AU{negative}"] = np.clip(-degrees / EYE_TURN_DEG[negative], 0.0, 1.0)
    return found


def units_of_head(head: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The head's turns, radians to the left, up and onto the left shoulder, as units 51 to 56."""
    found = {}
    for name, pair, field, sign in (
        ("yaw", ("51", "52"), "turn_degrees", 1.0),
        ("pitch", ("53", "54"), "nod_degrees", -1.0),
        ("roll", ("55", "56"), "tilt_degrees", 1.0),
    ):
        for unit in pair if name in head else ():
            full = sign * getattr(ACTION_UNITS[unit].head, field)
            found[f"AU{unit}"] = np.clip(np.degrees(head[name]) / full, 0.0, 1.0)
    return found
