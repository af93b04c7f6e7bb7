"""Shape keys of the example heads beyond ARKit's: rigs/own_keys.toml."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, model_validator

from .errors import InputError
from .resources import Row, read_table, rigs_path

Vector = tuple[float, float, float]


class Bump(Row):
    """A swelling: `move_mm` at `center` (mm, on the unshaped mesh), nothing from two radii on."""

    center: Vector
    radius_mm: Annotated[float, Field(gt=0.0, le=100.0)]
    move_mm: Vector


class OwnKey(Row):
    """A pair of keys, as the left one is made. targets: under mpfb2/targets in the head package -> weight."""

    name: Annotated[str, Field(pattern=r"^sanguine_[a-z][A-Za-z]*$")]
    help: str
    targets: dict[str, Annotated[float, Field(ge=-2.0, le=2.0)]] = {}
    bump: Bump | None = None

    @model_validator(mode="after")
    def _moves_something(self) -> OwnKey:
        if not self.targets and self.bump is None:
            raise ValueError(f"{self.name}: has neither targets nor a bump")
        return self

    @property
    def names(self) -> tuple[str, str]:
        return f"{self.name}Left", f"{self.name}Right"


class _OwnKeys(Row):
    key: tuple[OwnKey, ...]


def read_own_keys(path: Path) -> tuple[OwnKey, ...]:
    """Raises InputError for a key given twice."""
    keys = read_table(path, _OwnKeys).key
    for i, key in enumerate(keys):
        if key.name in {other.name for other in keys[:i]}:
            raise InputError(f"{path}: {key.name}: given twice, remove one")
    return keys


OWN_KEYS: tuple[OwnKey, ...] = read_own_keys(rigs_path("own_keys.toml"))
OWN_KEY_NAMES: tuple[str, ...] = tuple(name for key in OWN_KEYS for name in key.names)
