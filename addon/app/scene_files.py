"""The use-cases of an artist's own file on a farm: bake its blood, render its frames. Never with blood that is stale."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import sanguine_core

from ..domain.errors import InputError, nearest
from ..domain.files import atomic
from .batch import IMAGE_SUFFIXES
from .manifest import Manifest, finished, sha256
from .map_cache import key_of


class Scene(Protocol):
    """What is needed of an opened file."""

    version: str

    @property
    def frames(self) -> range:
        """What its scene renders."""

    def prepare(self, progress: Callable[[int, int], bool] | None = None) -> list[str]:
        """Brings what was made otherwise up to date: what was done, a line each."""

    def stale(self) -> dict[str, str]:
        """Face -> why its blood is not what the animation asks for; "" where it is."""

    def bake(self, progress: Callable[[int, int], bool] | None = None) -> dict[str, tuple[int, int]]:
        """Bakes every face's blood: face -> first and last frame."""

    def save(self, path: Path) -> None: ...

    def render(self, frame: int, png: Path, exr: Path) -> None: ...


def bake_file(
    scene: Scene,
    target: str | os.PathLike[str] | None,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> dict[str, Any]:
    """Bakes the blood of a file and writes it to `target`; None: only says what is stale."""
    before = scene.stale()
    faces = {name: {"was": why or "fresh"} for name, why in before.items()}
    notes = []
    if target is not None:
        notes = scene.prepare(_told(progress, "solving skins"))
        for name, (first, last) in scene.bake(_told(progress)).items():
            faces[name] |= {"first": first, "last": last}
        with atomic(target) as file:
            scene.save(file)
    stale = sorted(name for name, why in before.items() if why)
    return {"sanguine": sanguine_core.__version__, "faces": faces, "stale": stale, "notes": notes}


def render_file(
    scene: Scene,
    path: str | os.PathLike[str],
    out: str | os.PathLike[str],
    only: list[str] | None = None,
    resume: bool = False,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> list[str]:
    """Renders the frames of a file into the folder `out`, after baking its blood anew, and writes the manifest.

    only: names of images, the frames with six digits. Returns what else was brought up to date before, a line each.
    Raises InputError for an image that the scene does not render.
    """
    folder = Path(out)
    names = {f"{frame:06d}": frame for frame in scene.frames}
    for name in only or ():
        if name not in names:
            raise InputError(f"--only: no image '{name}' in {path}, {nearest(name, names)}")
    notes = scene.prepare(_told(progress, "solving skins"))
    baked = scene.bake(_told(progress))
    wanted = [name for name in names if only is None or name in only]
    fingerprint = key_of(scene.version, sha256(Path(path)))
    whole = finished(folder) if resume or only is not None else {}
    kept = {name for name, row in whole.items() if resume and row.get("fingerprint") == fingerprint}
    files = {name: row for name, row in whole.items() if name in kept or Path(name).stem not in wanted}
    with Manifest(folder, path, files) as manifest:
        for done, name in enumerate(wanted):
            if all(name + suffix in kept for suffix in IMAGE_SUFFIXES):
                continue
            progress(f"rendering {name}", done, len(wanted))
            start = time.perf_counter()
            with atomic(folder / f"{name}.png") as png, atomic(folder / f"{name}.exr") as exr:
                scene.render(names[name], png, exr)
                sums = {".png": sha256(png), ".exr": sha256(exr)}
            row = {
                "frame": names[name],
                "baked": {face: list(frames) for face, frames in baked.items()},
                "seconds": round(time.perf_counter() - start, 3),
                "fingerprint": fingerprint,
            }
            manifest.add({name + end: {"file": name + end, "sha256": sums[end], **row} for end in IMAGE_SUFFIXES})
    progress("rendered", len(wanted), len(wanted))
    return notes


def _told(progress: Callable[[str, int, int], None], what: str = "baking blood") -> Callable[[int, int], bool]:
    def tell(done: int, total: int) -> bool:
        progress(what, done, total)
        return True

    return tell
