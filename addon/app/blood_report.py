"""The `blood` use-case: what each emotion and each state of the body does to the blood and to the colour of a skin.

Settled changes: sliders at 1 for as long as it takes. How long that is, `kinetics` says.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sanguine_core

from ..domain import people
from ..domain.blood import (
    ANATOMY, BLOOD, BLOOD_CONTROL, BLOOD_CONTROL_MAX, BLOOD_DRIVERS, ELSEWHERE, STATES, Rest, settled,
)
from ..domain.effects.effect import inside
from ..domain.errors import InputError
from ..domain.parameters import Skin, default_skin, skin_rows
from ..domain.vascular import VASCULAR
from .skin_report import read_skins

REGIONS = (*ANATOMY, ELSEWHERE)

TONES: Mapping[str, float] = {"light": 48.0, "tan": 19.0, "brown": -10.0, "dark": -50.0}
"""Skins that are shown when none is asked for: label -> ITA in degrees, a typical face of the class of that name."""

_COLOUR_NM = np.arange(380.0, 781.0, 5.0)


@dataclass(frozen=True)
class Colour:
    """What one region looks like: L*a*b* (D65, 2 degrees), and the green of its linear Rec.709, as a camera sees it."""

    lab: np.ndarray
    green: float


def tone_skins() -> dict[str, dict[str, float]]:
    """The reference skin, on which the changes were sized, with the melanin of each of TONES and nothing else changed."""
    reference = BLOOD.reference
    base = {**default_skin(), "hemoglobin": reference.hemoglobin, "oxygenation": reference.oxygenation}
    return {name: {**base, "melanin": people.melanin_for(base, ita)} for name, ita in TONES.items()}


def region_skin(skin: Skin, region: str, change: tuple[float, float] = (0.0, 0.0)) -> dict[str, float]:
    """A region's skin with a change of (hemoglobin, oxygenation), as the material makes it at anatomy = 1."""
    rest = ANATOMY.get(region, Rest())
    values = {
        "hemoglobin": skin["hemoglobin"] * rest.hemoglobin + change[0],
        "melanin": skin["melanin"] * rest.melanin,
        "oil": min(skin["oil"] * rest.oil, 1.0),
        "oxygenation": skin["oxygenation"] + rest.oxygenation + change[1],
    }
    return {**skin, **{key: inside(key, (value, value))[0] for key, value in values.items()}}


def colours(skins: Sequence[Skin]) -> list[Colour]:
    """What each of these skins looks like through its own film of oil, without the film's reflection (`sanguine skin`)."""
    rows = skin_rows(skins)
    under_film = 1.0 - sanguine_core.surface(rows)[:, :1]
    xyz = sanguine_core.xyz(under_film * sanguine_core.reflectance(rows, _COLOUR_NM), _COLOUR_NM)
    green = sanguine_core.linear_rgb(xyz, "rec709")[:, 1].tolist()
    return [Colour(*both) for both in zip(sanguine_core.lab(xyz), green, strict=True)]


def changes_of(controls: Mapping[str, float], amount: float = 1.0) -> dict[str, tuple[float, float]]:
    """Region -> settled change of (hemoglobin, oxygenation), of regions that change at all."""
    moved = settled(controls, amount)
    found = {r: (moved.get((r, "hemoglobin"), 0.0), moved.get((r, "oxygenation"), 0.0)) for r in REGIONS}
    return {region: change for region, change in found.items() if change != (0.0, 0.0)}


def delta_e(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """CIEDE2000 of rows of L*a*b*."""
    return sanguine_core.delta_e_2000(np.atleast_2d(a), np.atleast_2d(b))


def rows_of(skin: Skin, controls: Mapping[str, float], amount: float = 1.0) -> list[dict[str, Any]]:
    """Per region that changes: chromophores and colour at rest and once it has settled."""
    changes = changes_of(controls, amount)
    if not changes:
        return []
    skins = [region_skin(skin, region) for region in changes]
    skins += [region_skin(skin, region, change) for region, change in changes.items()]
    seen = colours(skins)
    n = len(changes)
    before, after = np.array([c.lab for c in seen[:n]]), np.array([c.lab for c in seen[n:]])
    distance = delta_e(before, after)
    return [
        {
            "region": region,
            **{f"{key}_change": new[key] - old[key] for key in ("hemoglobin", "oxygenation")},
            "deoxyhemoglobin_change": deoxyhemoglobin(new) - deoxyhemoglobin(old),
            **{key: new[key] for key in ("hemoglobin", "oxygenation")},
            "deoxyhemoglobin": deoxyhemoglobin(new),
            "Lab_before": before[i].tolist(),
            "Lab_after": after[i].tolist(),
            "delta_Lab": (after[i] - before[i]).tolist(),
            "delta_e_2000": float(distance[i]),
        }
        for i, (region, old, new) in enumerate(zip(changes, skins[:n], skins[n:], strict=True))
    ]


def deoxyhemoglobin(skin: Skin) -> float:
    """Blood volume fraction times the share without oxygen: what makes skin blue (Lundsgaard & Van Slyke 1923)."""
    return skin["hemoglobin"] * (1.0 - skin["oxygenation"])


def pulse_rows(skin: Skin) -> list[dict[str, Any]]:
    """Per region the swing of the heartbeat, and what it does to the green light that the skin sends back."""
    found = []
    for region, delay_s in VASCULAR.pulse.delay_s.items():
        swing = VASCULAR.pulse.depth * BLOOD.at_rest(region, "hemoglobin")
        low, high = colours([region_skin(skin, region, (sign * 0.5 * swing, 0.0)) for sign in (-1.0, 1.0)])
        found.append(
            {
                "region": region,
                "delay_s": delay_s,
                "hemoglobin_swing": swing,
                "green_swing": (low.green - high.green) / (0.5 * (low.green + high.green)),
                "delta_e_2000": float(delta_e(low.lab, high.lab)[0]),
            }
        )
    return found


def kinetics_rows() -> list[dict[str, Any]]:
    """Every time course with where it comes from."""
    used: dict[str, set[str]] = {}
    for drives in BLOOD.drives.values():
        for drive in drives:
            used.setdefault(drive.kinetics, set()).add(drive.control)
    return [
        {**row.model_dump(), "source": list(row.source), "used_by": sorted(used.get(row.id, ()))}
        for row in VASCULAR.kinetics
    ]


def report(skins: Iterable[tuple[str, Skin]], amount: float = 1.0) -> dict[str, Any]:
    """The answer of `sanguine blood` for skins by id. amount: the slider `blood`, above 1 exaggerated. Raises InputError."""
    if not 0.0 <= amount <= BLOOD_CONTROL_MAX:
        raise InputError(f"--{BLOOD_CONTROL}: {amount:g} is outside 0 to {BLOOD_CONTROL_MAX:g}")
    return {
        "sanguine": sanguine_core.__version__,
        "blood": amount,
        "exaggerated": amount > 1.0,
        "skins": [
            {
                "id": name,
                "skin": dict(skin),
                "changes": [
                    {"kind": "state" if control in STATES else "emotion", "name": control, "regions": rows}
                    for control in BLOOD_DRIVERS
                    if (rows := rows_of(skin, {control: 1.0}, amount))
                ],
                "pulse": pulse_rows(skin),
            }
            for name, skin in skins
        ],
        "kinetics": kinetics_rows(),
        "regions": [{**row.model_dump(), "kinetics": list(row.kinetics), "source": list(row.source)} for row in VASCULAR.region],
    }


def asked_skins(tone: str | None, path: str | os.PathLike[str] | None) -> list[tuple[str, Skin]]:
    """The skins of `--tone` and `--skin`; without either those of TONES. Raises InputError."""
    if path is not None:
        return list(zip(*read_skins(path), strict=True))
    if tone is not None:
        person = people.person(tone)
        return [(person.tone, person.skin)]
    return list(tone_skins().items())
