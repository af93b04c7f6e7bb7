"""Maps by the hash of what made them: what was computed once is read again, what depends on a change is not."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import sanguine_core

from ..domain.errors import InputError
from ..domain.files import atomic
from ..domain.resources import rigs_path, shaders_path

_SUFFIX = ".npy"


def default_folder() -> Path:
    """$SANGUINE_CACHE, or `sanguine` in the user's folder for caches."""
    if chosen := os.environ.get("SANGUINE_CACHE"):
        return Path(chosen)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "sanguine"


@dataclass
class MapCache:
    """A folder of arrays. folder: None keeps nothing. max_bytes: the arrays unused for longest go first.

    A cache is a help, never a need: a folder that cannot be written to, a file that somebody cut short or removed,
    cost the time of computing again and nothing else.
    """

    folder: Path | None = field(default_factory=default_folder)
    max_bytes: int = 4 * 1024**3
    hits: int = 0
    made: int = 0

    def get(self, key: str, make: Callable[[], np.ndarray]) -> np.ndarray:
        """The array of `key` (see `key_of`), made if it is not there."""
        path = self.folder / (key + _SUFFIX) if self.folder else None
        if path is not None and (found := _load(path)) is not None:
            self.hits += 1
            return found
        array = make()
        self.made += 1
        if path is not None:
            with contextlib.suppress(OSError, InputError):
                self._store(path, array)
        return array

    def _store(self, path: Path, array: np.ndarray) -> None:
        with atomic(path) as temporary, temporary.open("wb") as file:
            np.save(file, array, allow_pickle=False)
        self._trim()

    def _trim(self) -> None:
        files = [(item.stat(), Path(item.path)) for item in os.scandir(self.folder) if item.name.endswith(_SUFFIX)]
        total = sum(stat.st_size for stat, _ in files)
        for stat, path in sorted(files, key=lambda row: row[0].st_mtime):
            if total <= self.max_bytes:
                return
            path.unlink(missing_ok=True)
            total -= stat.st_size


def _load(path: Path) -> np.ndarray | None:
    try:
        array = np.load(path, allow_pickle=False)
        os.utime(path)  # used just now
    except (OSError, ValueError, EOFError):
        return None
    return array


def key_of(*what: Any) -> str:
    """A hash of numbers, texts, lists, dicts and arrays, and of the program that turns them into maps."""
    digest = hashlib.sha256(_program())
    for part in what:
        if isinstance(part, np.ndarray):
            digest.update(f"{part.dtype.str}{part.shape}".encode())
            digest.update(np.ascontiguousarray(part).data)
        else:
            digest.update(json.dumps(part, sort_keys=True).encode())
    return digest.hexdigest()


@functools.cache
def _program() -> bytes:
    """Another build, or an edit of the files that lead to a map or a picture, may paint another one without another version."""
    here = Path(__file__).resolve().parent
    data = (rigs_path("blood.toml").parent, shaders_path("surface.osl").parent)
    sources = sorted(
        path
        for folder in (here, here.parent / "domain", *data)
        for path in folder.rglob("*")
        if path.suffix in (".py", ".toml", ".csv", ".osl")
    )
    digest = hashlib.sha256()
    for path in (Path(sanguine_core._core.__file__), *sources):
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.digest()
