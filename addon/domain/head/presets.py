"""Head presets: which shaping targets, how strongly, and what hair; read from rigs/heads.toml."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from .package import ARKIT_NAMES, HeadError


@dataclass(frozen=True)
class Brows:
    count: int  # hairs in each brow
    length_mm: float
    radius_mm: float
    thickness: float  # height of the brow, 1 as drawn in strands.BROW
    lift_mm: float  # the whole brow higher (+) or lower (-)
    color: tuple[float, float, float]  # linear Rec.709


@dataclass(frozen=True)
class Hair:
    style: str  # 'crop' (lies forward and down) or 'tied' (swept to a knot behind)
    count: int
    length_mm: float
    radius_mm: float
    melanin: float  # of Principled Hair, 0 white .. 1 black
    redness: float
    hairline: tuple[tuple[float, float], ...]  # (degrees from the front, mm above the eyes)


@dataclass(frozen=True)
class Eyes:
    iris: tuple[float, float, float]  # linear Rec.709, mid iris
    collarette: tuple[float, float, float]  # around the pupil
    pupil: float  # pupil radius over iris radius


@dataclass(frozen=True)
class Preset:
    id: str
    label: str
    help: str
    morphs: dict[str, float]  # target under mpfb2/targets -> weight
    rest: dict[str, float]  # ARKit unit -> weight that neutral already holds
    eyes: Eyes
    brows: Brows
    lash_radius_mm: float
    hair: Hair


def _record(kind: type, table: Any, where: str) -> Any:
    """A dataclass from a TOML table; missing and unknown keys are errors that say where."""
    names = {f.name for f in fields(kind)}
    if not isinstance(table, dict) or set(table) != names:
        got = set(table) if isinstance(table, dict) else set()
        raise HeadError(f"{where}: missing {sorted(names - got)}, unknown {sorted(got - names)}")
    return kind(**{k: tuple(map(tuple, v)) if k == "hairline" else tuple(v) if isinstance(v, list) else v for k, v in table.items()})


def load_presets(path: Path) -> dict[str, Preset]:
    """All presets of a heads.toml, by id."""
    try:
        document = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise HeadError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise HeadError(f"{path}: {error}") from None
    presets = {}
    for name, table in document.items():
        where = f"{Path(path).name}: [{name}]"
        parts = {"eyes": Eyes, "brows": Brows, "hair": Hair}
        if not isinstance(table, dict):
            raise HeadError(f"{where}: not a table")
        table = {k: _record(parts[k], v, f"{where} {k}") if k in parts else v for k, v in table.items()}
        preset = _record(Preset, {"id": name, **table}, where)
        if unknown := set(preset.rest) - set(ARKIT_NAMES):
            raise HeadError(f"{where} rest: not an ARKit name: {sorted(unknown)}")
        presets[name] = preset
    return presets
