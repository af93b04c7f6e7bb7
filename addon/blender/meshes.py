"""Meshes from files, for commands that work on a face outside of any scene: Blender's own importers read them."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import bpy

from ..app.maps import Surface
from ..domain.errors import InputError, nearest
from .render import quiet
from .surface import find_face_regions, read_surface

MAX_FILE_BYTES = 2 * 1024**3


def _gltf(path: str) -> None:
    import addon_utils

    addon_utils.enable("io_scene_gltf2")
    bpy.ops.import_scene.gltf(filepath=path)


def _blend(path: str) -> None:
    with bpy.data.libraries.load(path) as (there, here):
        here.objects = there.objects
    for obj in here.objects:
        bpy.context.scene.collection.objects.link(obj)


_READERS: dict[str, Callable[[str], object]] = {
    ".blend": _blend,
    ".obj": lambda path: bpy.ops.wm.obj_import(filepath=path),
    ".ply": lambda path: bpy.ops.wm.ply_import(filepath=path),
    ".usd": lambda path: bpy.ops.wm.usd_import(filepath=path),
    ".usdc": lambda path: bpy.ops.wm.usd_import(filepath=path),
    ".glb": _gltf,
    ".gltf": _gltf,
}
SUFFIXES = tuple(_READERS)


METRES = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "in": 0.0254}


def read_mesh(path: str | os.PathLike[str], name: str | None = None, unit: str = "m") -> tuple[Surface, str]:
    """The mesh of a file as maps need it, and what came of looking for its regions, one line or "".

    The object `name`, or the one with the most faces. Regions are its vertex groups or else what its shape keys tell.

    unit: of the lengths as Blender's importer gives them, a key of METRES. Empties the open scene. Raises InputError for a file
    that is missing, too large, not a mesh or without a UV map.
    """
    path = Path(path)
    try:
        size = path.stat().st_size
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    if size > MAX_FILE_BYTES:
        raise InputError(f"{path}: {size} bytes: more than the {MAX_FILE_BYTES} a mesh file may have")
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: no mesh: {', '.join(SUFFIXES)} are read")
    with quiet():
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        try:
            reader(str(path.resolve()))
        except (RuntimeError, OSError) as error:
            raise InputError(f"{path}: cannot be read: {' '.join(str(error).split())}") from None
        bpy.context.view_layer.update()
    meshes = {obj.name: obj for obj in bpy.context.scene.objects if obj.type == "MESH" and len(obj.data.polygons)}
    if not meshes:
        raise InputError(f"{path}: holds no mesh with faces")
    if name is not None and name not in meshes:
        raise InputError(f"{path}: no mesh '{name}', {nearest(name, meshes)}")
    bpy.context.scene.unit_settings.scale_length = METRES[unit]
    face = meshes[name] if name else max(meshes.values(), key=lambda obj: len(obj.data.polygons))
    said = find_face_regions(face)
    return read_surface(face), said
