"""The file's working space, in which Cycles computes and to which spectra go; and tables that were solved for another."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict

import bpy
import numpy as np
import sanguine_core
from mathutils import Color

from ..domain.lut import Table, bake, layout
from ..domain.plan import Axis
from .images import data_image

Space = str | np.ndarray
"""A working space as `sanguine_core` takes it: its name, or the 3x3 matrix from XYZ (D65, Y = 1) to RGB."""

_KNOWN = ("rec709", "rec2020", "acescg")
# Versions of Blender round their matrices (5e-4 at most was seen); two spaces that are known differ by 0.05 and more.
_SAME = 2e-3

TABLE = "sanguine_table"
"""Custom property of a table's image: what was solved, and for which working space, as JSON."""

READ_IN = "sanguine_read_in"
"""Custom property of a residual, whose factors belong to a working space: which, as JSON."""


def working_space() -> Space:
    """The open file's: asked by what it does and not by its name, which any OCIO configuration may choose as it likes."""
    matrix = np.array([Color(axis).from_xyz_d65_to_scene_linear() for axis in np.eye(3).tolist()], dtype=np.float64).T
    return next((name for name in _KNOWN if np.abs(matrix - _matrix(name)).max() < _SAME), np.ascontiguousarray(matrix))


def _matrix(space: Space) -> np.ndarray:
    """(3, 3), from XYZ to RGB."""
    return sanguine_core.linear_rgb(100.0 * np.eye(3), space).T if isinstance(space, str) else space


def from_rec709(rgb: tuple[float, float, float]) -> tuple[float, float, float]:
    """A colour that stands in the sources as linear Rec.709, in the file's working space."""
    return rgb if working_space() == "rec709" else tuple(Color(rgb).from_rec709_linear_to_scene_linear())


def as_json(space: Space) -> str:
    return json.dumps(space if isinstance(space, str) else space.tolist())


def _is_here(kept: str | list[list[float]]) -> bool:
    """Whether a space that a file kept is the one that it has now."""
    return np.abs(_matrix(kept if isinstance(kept, str) else np.array(kept)) - _matrix(working_space())).max() < _SAME


def sign_table(image: bpy.types.Image, table: Table, skin: Mapping[str, float]) -> None:
    """Keeps with the image of a table what it takes to solve it again."""
    request = {"axes": [asdict(axis) for axis in table.axes], "skin": dict(skin), "lobes": table.lobes, "walk": table.walk}
    request["space"] = json.loads(as_json(working_space()))
    image[TABLE] = json.dumps(request)


def strange_images(images: Iterable[bpy.types.Image] | None = None) -> list[bpy.types.Image]:
    """Tables and residuals, of these images or of the file, that belong to another working space than the file's."""
    found = []
    for image in bpy.data.images if images is None else images:
        if TABLE in image and not _is_here(json.loads(image[TABLE])["space"]):
            found.append(image)
        elif READ_IN in image and not _is_here(json.loads(image[READ_IN])):
            found.append(image)
    return found


def images_in(material: bpy.types.Material | None) -> Iterator[bpy.types.Image]:
    """Of the groups of a skin's material."""
    for node in material.node_tree.nodes if material is not None and material.node_tree else ():
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree:
            yield from {inner.image for inner in node.node_tree.nodes if inner.bl_idname == "ShaderNodeTexImage" and inner.image}


def follow_working_space(
    images: Iterable[bpy.types.Image], progress: Callable[[int, int], bool] | None = None
) -> list[str]:
    """Solves strange tables again for the file's working space. Returns what cannot follow, a line each.

    What is linked follows as long as the file is open, which is enough for a render.
    """
    notes, space, solved = [], working_space(), []
    for image in images:
        if TABLE not in image:
            notes.append(f"{image.name}: made in another working space: read its picture again, and apply the skin")
            continue
        request = json.loads(image[TABLE])
        axes = tuple(Axis(**row) for row in request["axes"])
        if tuple(image.size) != layout(axes, request["lobes"], request.get("walk", False)).shape[::-1]:
            notes.append(f"{image.name}: laid out by another version of Sanguine: apply the skin again")
            continue
        table = bake(axes, request["skin"], space, progress, request["lobes"], request.get("walk", False))
        solved.append((image, request["skin"], table))
    for image, skin, table in solved:  # nothing is changed before all are solved
        name, linked = image.name, image.library is not None
        new = data_image(name, table.image)
        sign_table(new, table, skin)
        image.user_remap(new)
        if not linked:
            bpy.data.images.remove(image)
            new.name = name
    return notes
