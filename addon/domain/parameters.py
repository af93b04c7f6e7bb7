"""The skin parameters as the native schema declares them; nothing about them is typed here again."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import sanguine_core

from .errors import InputError, nearest


@dataclass(frozen=True)
class Parameter:
    """One row of `native/schema/parameters.toml`."""

    id: str
    label: str
    unit: str
    default: float
    hard_min: float
    hard_max: float
    soft_min: float
    soft_max: float
    group: str
    channel: str
    help: str
    source: str

    @property
    def caption(self) -> str:
        """The label of a slider: with the unit, where it has one. Blender's own units of length are the scene's, of which a
        hundredth of a millimetre is too little."""
        return self.label if self.unit in ("", "1") else f"{self.label} ({self.unit})"


def _rows(rows: list[dict[str, Any]]) -> dict[str, Parameter]:
    return {row["id"]: Parameter(**{k: row[k] for k in Parameter.__dataclass_fields__}) for row in rows}


PARAMETERS: dict[str, Parameter] = _rows(sanguine_core.parameters())

# Two views of `hemoglobin` and `oxygenation`: blood volume fractions of either kind.
OXY, DEOXY = "oxyhemoglobin", "deoxyhemoglobin"

Skin = Mapping[str, float]
"""A whole skin: every parameter id with its value."""


def default_skin() -> dict[str, float]:
    return {p.id: p.default for p in PARAMETERS.values()}


def check_value(parameter: Parameter, value: Any, where: str) -> float:
    """`value` as a float inside the hard range. Raises InputError naming `where`, the key and the range."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or isinstance(value, float) and not math.isfinite(value):
        raise InputError(f"{where}: {parameter.id}: {value!r} is not a number")
    if not parameter.hard_min <= value <= parameter.hard_max:
        unit = f" {parameter.unit}" if parameter.unit not in ("", "1") else ""
        raise InputError(
            f"{where}: {parameter.id}: {value} is outside {parameter.hard_min:g} to {parameter.hard_max:g}{unit}"
        )
    return float(value)


def skin_from(values: Mapping[str, Any], where: str, base: Skin | None = None) -> dict[str, float]:
    """A whole skin from some of its values; what is missing is as in `base`, else the schema's default.

    The pair `oxyhemoglobin`, `deoxyhemoglobin` is taken instead of `hemoglobin`, `oxygenation`.
    Raises InputError, one line that begins with `where`.
    """
    values = dict(values)
    if OXY in values or DEOXY in values:
        _unpair(values, where)
    skin = default_skin() if base is None else dict(base)
    for key, value in values.items():
        if key not in PARAMETERS:
            raise InputError(f"{where}: {key}: unknown key, {nearest(key, [*PARAMETERS, OXY, DEOXY])}")
        skin[key] = check_value(PARAMETERS[key], value, where)
    return skin


def _unpair(values: dict[str, Any], where: str) -> None:
    """Replaces the oxy/deoxy pair in `values` by total hemoglobin and its oxygenation."""
    missing = [key for key in (OXY, DEOXY) if key not in values]
    if missing:
        raise InputError(f"{where}: {missing[0]}: missing, {OXY} and {DEOXY} come as a pair")
    for key in ("hemoglobin", "oxygenation"):
        if key in values:
            raise InputError(f"{where}: {key}: given together with {OXY} and {DEOXY}, leave one of them out")
    blood = PARAMETERS["hemoglobin"]
    fractions = {}
    for key in (OXY, DEOXY):
        value = values.pop(key)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value <= blood.hard_max:
            raise InputError(f"{where}: {key}: {value!r} is outside 0 to {blood.hard_max:g}")
        fractions[key] = float(value)
    total = sum(fractions.values())
    values["hemoglobin"] = total
    if total > 0:
        values["oxygenation"] = fractions[OXY] / total


def skin_rows(skins: list[Skin]) -> np.ndarray:
    """(N, P) float64 in schema order: what `sanguine_core` takes."""
    return np.array([[skin[key] for key in PARAMETERS] for skin in skins], dtype=np.float64).reshape(-1, len(PARAMETERS))
