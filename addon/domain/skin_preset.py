"""A skin as a JSON file: who somebody is without the face, to keep, to send and to use again.

Unlike the presets that Blender keeps, which are Python, such a file is only read, and checked.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict
from typing import Annotated, Any

import pydantic

from .effects import Growth
from .errors import InputError, nearest
from .files import read_json, validate, write_json
from .parameters import skin_from
from .people import AGES, SEEDS, Person
from .plan import check_strengths
from .quality import PRESETS, WITHIN

FORMAT = 1
_FORMAT_KEY = "sanguine_skin"
# Some fifty numbers are two kilobytes.
MAX_BYTES = 256 * 1024

Fraction = Annotated[float, pydantic.Field(ge=0.0, le=1.0, allow_inf_nan=False)]


class _Growth(pydantic.BaseModel):
    """Whose features grow: the fields of `Growth`."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True, strict=True)

    seed: Annotated[int, pydantic.Field(ge=SEEDS[0], le=SEEDS[1])] = Growth.seed
    age_years: Annotated[float, pydantic.Field(ge=AGES[0], le=AGES[1], allow_inf_nan=False)] = Growth.age_years
    sun: Fraction = Growth.sun
    masculinity: Fraction = Growth.masculinity


class SkinPreset(pydantic.BaseModel):
    """skin: every parameter. effects: the strength of every effect that has one; what a file leaves out is the default.

    quality: a preset of rigs/quality.toml, or "within" with the error that `delta_e` allows; None: nothing is said of it.
    source: where the numbers are from.
    """

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True, strict=True)

    label: Annotated[str, pydantic.Field(max_length=200)] = ""
    source: Annotated[str, pydantic.Field(max_length=2000)] = ""
    skin: dict[str, float] = {}
    effects: dict[str, float] = {}
    growth: _Growth = _Growth()
    quality: str | None = None
    delta_e: Annotated[float, pydantic.Field(gt=0.0, le=100.0, allow_inf_nan=False)] | None = None

    @pydantic.field_validator("quality")
    @classmethod
    def _known(cls, value: str | None) -> str | None:
        if value not in (None, WITHIN, *PRESETS):
            raise ValueError(f"no such quality '{value}', {nearest(value, [*PRESETS, WITHIN])}")
        return value

    @property
    def grown(self) -> Growth:
        return Growth(**self.growth.model_dump())


def read_preset(path: str | os.PathLike[str]) -> SkinPreset:
    """A checked preset, its skin and effects whole. Raises InputError, one line: file, key, value, what is allowed."""
    data = read_json(path, MAX_BYTES)
    if not isinstance(data, dict) or _FORMAT_KEY not in data:
        raise InputError(f'{path}: {_FORMAT_KEY}: missing, a skin preset begins with {{"{_FORMAT_KEY}": {FORMAT}, …}}')
    version = data.pop(_FORMAT_KEY)
    if version != FORMAT or isinstance(version, bool):
        raise InputError(f"{path}: {_FORMAT_KEY}: {version!r} is no format that this Sanguine reads, which is {FORMAT}")
    preset = validate(SkinPreset, data, path)
    whole = {
        "skin": skin_from(preset.skin, f"{path}: skin"),
        "effects": check_strengths(preset.effects, f"{path}: effects"),
    }
    return preset.model_copy(update=whole)


def write_preset(path: str | os.PathLike[str], preset: SkinPreset) -> None:
    """Writes it whole or not at all. Raises InputError for a place that cannot be written to."""
    write_json(path, {_FORMAT_KEY: FORMAT, **preset.model_dump(exclude_none=True, exclude_defaults=True)})


def preset_of(person: Person, label: str = "", source: str = "") -> SkinPreset:
    return make_preset(person.skin, person.strengths, person.growth, label=label, source=source)


def make_preset(skin: Mapping[str, float], effects: Mapping[str, float], growth: Growth, **more: Any) -> SkinPreset:
    return SkinPreset(skin=dict(skin), effects=dict(effects), growth=_Growth(**asdict(growth)), **more)
