"""Quality: how finely the skin is simulated, and what that was measured to cost (`rigs/quality.toml`).

The points and the presets among them are written by `bench/picture.py`: errors against path-traced layered media,
seconds from the same run. `docs/accuracy_picture.md` has the scenes.
"""

from __future__ import annotations

import os
from typing import Annotated, NamedTuple

import pydantic

from .errors import InputError, nearest
from .files import read_toml, validate
from .resources import rigs_path


class Settings(pydantic.BaseModel):
    """What a quality fixes.

    lobes: of the fitted profile. table_step: distance of the table's entries, 1 as in `plan.py`. map_size: texels
    along a side of the chromophore maps. samples: per pixel.
    """

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)

    lobes: Annotated[int, pydantic.Field(ge=1, le=4)]
    table_step: Annotated[float, pydantic.Field(ge=0.1, le=20.0, allow_inf_nan=False)]
    map_size: Annotated[int, pydantic.Field(ge=16, le=16384)]
    samples: Annotated[int, pydantic.Field(ge=1, le=65536)]


class Point(Settings):
    """Settings with what was measured.

    delta_e: Delta E 2000 against the truth, 95th percentile of the pixels, mean over the scenes; delta_e_median
    likewise. prepare_seconds: table and maps of a shot. seconds_per_megapixel: rendering.
    """

    delta_e: Annotated[float, pydantic.Field(gt=0.0)]
    delta_e_median: Annotated[float, pydantic.Field(gt=0.0)]
    prepare_seconds: Annotated[float, pydantic.Field(gt=0.0)]
    seconds_per_megapixel: Annotated[float, pydantic.Field(gt=0.0)]
    preset: str | None = None

    @property
    def settings(self) -> Settings:
        return Settings(**{name: getattr(self, name) for name in Settings.model_fields})

    @property
    def measured(self) -> str:
        """For panels and messages."""
        return f"Delta E {self.delta_e:.1f}, {self.seconds_per_megapixel:.3g} s per megapixel"

    @property
    def means(self) -> str:
        """What it fixes, for panels and messages."""
        lobes = f"{self.lobes} lobe{'' if self.lobes == 1 else 's'}"
        return f"{self.samples} samples, {lobes}, maps of {self.map_size}"


class Choice(NamedTuple):
    """Settings that somebody chose. point: what was measured of exactly these, if anything was."""

    settings: Settings
    point: Point | None
    because: str


class _File(pydantic.BaseModel):
    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)

    machine: str
    point: Annotated[list[Point], pydantic.Field(min_length=1)]


# From coarse to fine; the file has one point for each.
PRESET_NAMES = ("draft", "preview", "final", "reference")
DEFAULT = "final"


def read_points(path: str | os.PathLike[str] | None = None) -> list[Point]:
    """Every point, the fastest first. Raises InputError for a file that lacks a preset."""
    path = path or rigs_path("quality.toml")
    points = validate(_File, read_toml(path), path).point
    names = [point.preset for point in points if point.preset]
    if sorted(names) != sorted(PRESET_NAMES):
        raise InputError(f"{path}: point.preset: {', '.join(names)} instead of {', '.join(PRESET_NAMES)}")
    return points


POINTS = read_points()
PRESETS = {name: next(point for point in POINTS if point.preset == name) for name in PRESET_NAMES}


def preset(name: str) -> Point:
    """The point of a preset. Raises ValueError that names the nearest."""
    if name not in PRESETS:
        raise ValueError(f"no such quality '{name}', {nearest(name, PRESETS)}")
    return PRESETS[name]


def within(delta_e: float) -> Point:
    """The cheapest measured point that meets `delta_e`. Raises ValueError that names the best when none does."""
    if not delta_e > 0.0:
        raise ValueError(f"{delta_e:g} is not above 0")
    for point in POINTS:
        if point.delta_e <= delta_e:
            return point
    best = min(POINTS, key=lambda point: point.delta_e)
    name = f" ('{best.preset}')" if best.preset else ""
    raise ValueError(f"no measured setting is within {delta_e:g}, the best{name} has {best.delta_e:g}")


WITHIN = "within"
"""What a panel calls "the cheapest within an error that somebody names", beside the presets."""

BEST_DELTA_E = min(point.delta_e for point in POINTS)


def chosen_point(quality: str, delta_e: float) -> Point:
    """The point of a preset, or of WITHIN at `delta_e`, below the best measured one taken as that."""
    return within(max(delta_e, BEST_DELTA_E)) if quality == WITHIN else preset(quality)


def choice(quality: str | None, delta_e: float | None) -> Choice | None:
    """What the flags `--quality` and `--delta-e` ask for; None when neither is given. Raises InputError."""
    try:
        if quality is not None:
            return Choice(preset(quality).settings, preset(quality), f"--quality {quality}")
        if delta_e is not None:
            point = within(delta_e)
            return Choice(point.settings, point, f"the cheapest measured setting within --delta-e {delta_e:g}")
    except ValueError as error:
        raise InputError(f"{'--quality' if quality is not None else '--delta-e'}: {error}") from None
    return None
