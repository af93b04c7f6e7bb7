"""Head presets: which shaping targets, how strongly, and what hair; read from rigs/heads.toml."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, field_validator

from ..errors import nearest
from ..files import read_toml, validate
from ..resources import Row
from .package import ARKIT_NAMES

Fraction = Annotated[float, Field(ge=0, le=1)]
Millimetres = Annotated[float, Field(gt=0, le=500)]
Color = tuple[Fraction, Fraction, Fraction]  # linear Rec.709


class Eyes(Row):
    iris: Color  # toward the limbus
    collarette: Color  # around the pupil
    pupil: Fraction  # pupil radius over iris radius


class Brows(Row):
    count: Annotated[int, Field(ge=1, le=5000)]  # hairs in each brow
    length_mm: Millimetres
    radius_mm: Millimetres
    thickness: Annotated[float, Field(gt=0, le=3)]  # height of the brow, 1 as drawn in strands.BROW
    lift_mm: Annotated[float, Field(ge=-10, le=10)]  # the whole brow higher (+) or lower (-)
    color: Color


class Hair(Row):
    style: Literal["crop", "tied"]  # lies forward and down, or is swept to a knot behind
    count: Annotated[int, Field(ge=1, le=200_000)]
    length_mm: Millimetres  # of cropped hair on top; tied hair is as long as its way to the knot
    radius_mm: Millimetres
    melanin: Fraction  # of Principled Hair: 0 white, 1 black
    redness: Fraction
    # (degrees from the front, mm above the eyes), from the forehead round to the nape
    hairline: Annotated[tuple[tuple[float, float], ...], Field(min_length=2)]


class Preset(Row):
    id: str
    label: str
    help: str
    morphs: dict[str, Annotated[float, Field(ge=-2, le=2)]]  # target under mpfb2/targets -> weight
    rest: dict[str, Annotated[float, Field(ge=0, lt=1)]]  # ARKit unit -> weight that neutral already holds
    eyes: Eyes
    brows: Brows
    lash_radius_mm: Millimetres
    hair: Hair

    @field_validator("rest")
    @classmethod
    def _arkit(cls, rest: dict[str, float]) -> dict[str, float]:
        for name in rest:
            if name not in ARKIT_NAMES:
                raise ValueError(f"'{name}' is not an ARKit unit, {nearest(name, ARKIT_NAMES)}")
        return rest


def load_presets(path: Path) -> dict[str, Preset]:
    """All presets of a heads.toml, by id. Raises InputError, one line naming file, key and mend."""
    return {
        name: validate(Preset, {"id": name, **table} if isinstance(table, dict) else table, f"{path}: [{name}]")
        for name, table in read_toml(path).items()
    }
