"""Reading chromophores from a picture that the file holds, for the face it belongs to."""

from __future__ import annotations

from typing import Any

import bpy

from ..app.inverting import invert_tiles
from ..app.tasks import Progress, Task, Tasks, run_tasks
from ..domain.effects import residual, skin_map
from .colour import READ_IN, as_json, working_space
from .images import data_image, scene_linear, store_range
from .properties import skin_of

READ_FROM = "sanguine_read_from"
"""Custom property of an image that was read from a picture: the picture's name."""

_BYTE = 1 / 255


def read_picture(face: bpy.types.Object, image: bpy.types.Image, shading: str = "auto") -> str:
    """Gives `face` the skin map and the residual that `image` shows. Returns what was found, for people.

    Raises InputError for a picture that cannot be read.
    """
    return run_tasks(picture_tasks(face, image, shading))


def picture_tasks(face: bpy.types.Object, image: bpy.types.Image, shading: str = "auto") -> Tasks:
    """`read_picture` in steps: computing is yielded as a task."""
    pixels, space, skin = scene_linear(image), working_space(), skin_of(face)
    quantum = 0.0 if image.is_float else _BYTE

    def invert(progress: Progress) -> dict[str, Any]:
        return invert_tiles(
            pixels, space, skin, shading=shading, quantum=quantum, progress=lambda _what, done, total: progress(done, total)
        )

    made = yield Task("Reading the picture", invert)
    before = [getattr(face.sanguine, name) for name in (skin_map.MAP, residual.MAP)]
    # Amounts take 32 bits: half floats round to 1 in 2000 of a fraction, which shows as bands where melanin is thin.
    blood = data_image(f"{image.name} skin", made["skin_map"])
    store_range(blood, made["ranges"])  # a picture says nothing of oil: the face's own slider stays
    over = data_image(f"{image.name} residual", made["residual"], half=True)
    blood[READ_FROM] = over[READ_FROM] = image.name
    over[READ_IN] = as_json(space)
    face.sanguine.skin_map, face.sanguine.residual = blood, over
    for old in before:
        if old is not None and not old.users:
            bpy.data.images.remove(old)
    report = made["report"]
    error = report["delta_e_2000"]
    return (
        f"{100 * (1 - report['share_masked']):.0f} % of it is skin, explained to Delta E {error['median']:.1f} "
        f"(median; 95 % within {error['p95']:.1f})"
    )
