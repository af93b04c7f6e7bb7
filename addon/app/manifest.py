"""`manifest.json` of a folder of images: what each file is, how it was made, its checksum; whole after any kill."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import sanguine_core

from ..domain.errors import InputError
from ..domain.files import read_json, read_text, write_json

MANIFEST = "manifest.json"
# Between two writings of the manifest each new row is one line here: writing all rows for each of thousands of images
# would take longer than rendering them.
_JOURNAL = "manifest.journal"
_SECONDS_BETWEEN = 20.0
# A manifest of so few rows is written each time: it costs a few milliseconds.
_FEW_ROWS = 400
# A study of 100,000 images has about this much to say.
_MAX_BYTES = 1 << 30


class Manifest:
    """The manifest of a run. As a context it is written on entering (an unwritable folder is found at once) and on leaving.

    files: file name -> its row, which has "file" and "sha256".
    """

    def __init__(self, folder: Path, shot_path: str | os.PathLike[str], files: Mapping[str, dict[str, Any]]) -> None:
        self.folder, self.shot_path, self.files = folder, shot_path, dict(files)

    def __enter__(self) -> Manifest:
        self._write()
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self._write()

    def add(self, rows: Mapping[str, dict[str, Any]]) -> None:
        """Rows of files that have just been finished."""
        self.files |= rows
        if len(self.files) <= _FEW_ROWS or time.monotonic() - self._written > _SECONDS_BETWEEN:
            self._write()
            return
        with (self.folder / _JOURNAL).open("a", encoding="utf-8") as journal:
            journal.writelines(json.dumps(row) + "\n" for row in rows.values())

    @property
    def content(self) -> dict[str, Any]:
        """What the file says."""
        rows = [self.files[name] for name in sorted(self.files)]
        return {"sanguine": sanguine_core.__version__, "shot": Path(self.shot_path).name, "files": rows}

    def _write(self) -> None:
        write_json(self.folder / MANIFEST, self.content)
        (self.folder / _JOURNAL).unlink(missing_ok=True)
        self._written = time.monotonic()


def finished(folder: Path) -> dict[str, dict[str, Any]]:
    """Files of an earlier run that are there and whole. Raises InputError for a manifest that is not ours."""
    rows: list[Any] = []
    if (folder / MANIFEST).exists():
        data = read_json(folder / MANIFEST, _MAX_BYTES)
        rows = data.get("files") if isinstance(data, dict) else None
        if not isinstance(rows, list) or not all(isinstance(row, dict) and "file" in row for row in rows):
            raise InputError(f"{folder / MANIFEST}: files: not a manifest of sanguine; remove it or leave --resume out")
    whole = {}
    for row in (*rows, *_journal(folder)):
        path = folder / Path(str(row["file"])).name
        if path.is_file() and sha256(path) == row.get("sha256"):
            whole[row["file"]] = row
    return whole


def _journal(folder: Path) -> list[dict[str, Any]]:
    """Rows that a killed run wrote down; its last line may be cut short."""
    if not (folder / _JOURNAL).exists():
        return []
    rows = []
    for line in read_text(folder / _JOURNAL, _MAX_BYTES).splitlines():
        try:
            row = json.loads(line)
        except ValueError:
            continue
        if isinstance(row, dict) and "file" in row:
            rows.append(row)
    return rows


def sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
