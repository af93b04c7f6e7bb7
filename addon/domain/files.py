"""Reading the files people write (TOML, JSON) and writing results whole or not at all.

Every reader turns every fault into one `InputError` line that names the file, the key and the mend.
"""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar, get_origin

import pydantic

from .errors import InputError, nearest

# A hand-written shot, skin list or table is a few kilobytes; this bound only stops a wrong file
# (an image, a device) from being read into memory.
MAX_TEXT_BYTES = 16 * 1024 * 1024

Model = TypeVar("Model", bound=pydantic.BaseModel)


def read_text(path: str | os.PathLike[str], max_bytes: int = MAX_TEXT_BYTES) -> str:
    """Text of `path`. Raises InputError when it is missing, unreadable, larger than `max_bytes` or not UTF-8."""
    try:
        size = os.stat(path).st_size
        if size > max_bytes:
            raise InputError(f"{path}: {size} bytes: more than the {max_bytes} a text input may have")
        return Path(path).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start})") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Parsed TOML. Raises InputError with the line and column of a syntax fault."""
    try:
        return tomllib.loads(read_text(path))
    except InputError:
        raise
    except (ValueError, RecursionError) as error:  # syntax; or a number or a nesting beyond any sense
        raise InputError(f"{path}: not valid TOML: {error}") from None


def read_json(path: str | os.PathLike[str], max_bytes: int = MAX_TEXT_BYTES) -> Any:
    """Parsed JSON. Raises InputError with the line of a syntax fault; NaN and Infinity are not JSON."""

    def no_constant(name: str) -> Any:
        raise InputError(f"{path}: {name} is not a number that JSON allows")

    try:
        return json.loads(read_text(path, max_bytes), parse_constant=no_constant)
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: not valid JSON: line {error.lineno}, column {error.colno}: {error.msg}") from None
    except InputError:
        raise
    except (ValueError, RecursionError) as error:  # a number or a nesting beyond any sense
        raise InputError(f"{path}: not valid JSON: {error}") from None


def validate(model: type[Model], data: Any, where: str | os.PathLike[str]) -> Model:
    """`data` as `model`, or one InputError line for the first fault: file, key, value, what is allowed."""
    try:
        return model.model_validate(data)
    except pydantic.ValidationError as error:
        raise InputError(f"{where}: {_first_fault(error, model)}") from None


def _first_fault(error: pydantic.ValidationError, model: type[pydantic.BaseModel]) -> str:
    fault = error.errors()[0]
    key = ".".join(str(part) for part in fault["loc"]) or "(top level)"
    if fault["type"] == "missing":
        return f"{key}: missing"
    if fault["type"] == "extra_forbidden":
        return f"{key}: unknown key, {nearest(str(fault['loc'][-1]), _keys_at(model, fault['loc'][:-1]))}"
    message = fault["msg"].removeprefix("Value error, ")
    shown = json.dumps(fault["input"], default=str)
    return f"{key}: {message}" + (f" (is {shown})" if len(shown) < 60 else "")


def _keys_at(model: type[pydantic.BaseModel], loc: tuple[int | str, ...]) -> list[str]:
    """Field names allowed at `loc` inside `model`, for the hint at an unknown key."""
    of_dict = False
    for part in loc:
        if isinstance(part, int) or of_dict:  # a row's number, or its name: not a field
            of_dict = False
            continue
        field = model.model_fields.get(part) or next(
            (f for f in model.model_fields.values() if f.alias == part), None
        )
        inner = next((m for m in _models_in(field.annotation)), None) if field else None
        if inner is None:
            return []
        of_dict = get_origin(field.annotation) is dict
        model = inner
    return [field.alias or name for name, field in model.model_fields.items()]


def _models_in(annotation: Any) -> Iterator[type[pydantic.BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, pydantic.BaseModel):
        yield annotation
    for argument in getattr(annotation, "__args__", ()):
        yield from _models_in(argument)


def check_folder(path: str | os.PathLike[str]) -> None:
    """Raises InputError if a file in the folder `path`, which need not exist yet, could not be written. Makes nothing."""
    folder = Path(path).absolute()
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"{path}: cannot be written: {folder} is not a folder that may be written to")


def check_file(path: str | os.PathLike[str] | None) -> None:
    """Raises InputError if `path` could not be written: better before long work than after. None is standard output."""
    if path is None:
        return
    if Path(path).is_dir():
        raise InputError(f"{path}: cannot be written: Is a directory")
    check_folder(Path(path).absolute().parent)


@contextlib.contextmanager
def atomic(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yields a temporary path beside `path` (same suffix) and renames it over `path` on success.

    Raises InputError when the folder cannot be written to.
    """
    target = Path(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}.", suffix=target.suffix, dir=target.parent)
        os.close(handle)
    except OSError as error:
        raise InputError(f"{target}: cannot be written: {error.strerror}") from None
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes files only their owner can read; results are ordinary files.
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        try:
            os.replace(temporary, target)
        except OSError as error:
            raise InputError(f"{target}: cannot be written: {error.strerror}") from None
    finally:
        temporary.unlink(missing_ok=True)


def write_json(path: str | os.PathLike[str], data: Any) -> None:
    """`data` as JSON (no NaN), written whole or not at all."""
    text = json.dumps(data, indent=1, allow_nan=False) + "\n"
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
