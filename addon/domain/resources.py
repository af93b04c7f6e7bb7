"""The add-on's data files: where they are (in the installed extension, or beside it in a checkout), checked on reading."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict

from .files import read_text, read_toml, validate

_PACKAGE = Path(__file__).resolve().parent.parent


def rigs_path(name: str) -> Path:
    return _find("rigs", name)


def shaders_path(name: str) -> Path:
    return _find("shaders_osl", name)


def bundled(folder: str) -> Path | None:
    """A folder that only the installed extension has; None in a checkout."""
    path = _PACKAGE / folder
    return path if path.is_dir() else None


def _find(folder: str, name: str) -> Path:
    for root in (_PACKAGE, _PACKAGE.parent):
        path = root / folder / name
        if path.exists():
            return path
    raise FileNotFoundError(f"{folder}/{name}: not part of this Sanguine; install the add-on again")


class Row(BaseModel):
    """Base of what is read from rigs/. Unknown keys are errors: a misspelt key must not be ignored."""

    model_config = ConfigDict(extra="forbid", frozen=True)


Model = TypeVar("Model", bound=Row)


def read_table(path: Path, model: type[Model]) -> Model:
    """A TOML table as `model`. Raises InputError, one line naming file, key and mend."""
    return validate(model, read_toml(path), path)


def read_rows(path: Path, model: type[Model]) -> tuple[Model, ...]:
    """A CSV table, one `model` per line. Raises InputError, one line naming file, line, key and mend."""
    reader = csv.DictReader(read_text(path).splitlines())
    return tuple(validate(model, row, f"{path}, line {reader.line_num}") for row in reader)
