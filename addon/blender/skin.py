"""Giving a face its skin: maps, material, and the blood that its controls move."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np

from ..app.maps import Surface, bake_maps
from ..domain.blood import BLOOD_CHANNELS
from ..domain.plan import Plan
from ..domain.texel_density import MapSizes, map_sizes, mm_per_uv
from ..domain.udim import FIRST_TILE
from .controls import drive_blood
from .material import MARK, build_skin_material, remove_skin_material
from .surface import pixel_mm, read_surface, store_rest


def apply_skin(
    face: bpy.types.Object,
    armature: bpy.types.Object | None,
    plan: Plan,
    slot: int = 0,
    progress: Callable[[int, int], bool] | None = None,
) -> bpy.types.Material:
    """Builds the skin of `plan`, puts it into a material slot of `face` and drives its blood from `armature`."""
    maps = _bake(face, plan, progress) if plan.maps else {}
    before = face.material_slots[slot].material if face.material_slots else None
    if before is not None and MARK in before and before.users == 1:
        remove_skin_material(before)
    material = build_skin_material(f"{face.name} skin", plan, maps, progress)
    inputs = {item.key for fragment in plan.fragments for item in fragment.inputs}
    if "rest_mm" in inputs:
        store_rest(face)
    if face.material_slots:
        face.material_slots[slot].material = material  # the slot knows whether it belongs to the object or the mesh
    else:
        face.data.materials.append(material)
    if armature is not None:
        drive_blood(armature, face, [c for c in BLOOD_CHANNELS.values() if c.property_name in inputs])
    return material


def _bake(
    face: bpy.types.Object, plan: Plan, progress: Callable[[int, int], bool] | None
) -> dict[str, np.ndarray | dict[int, np.ndarray]]:
    """Map id -> image, or images by UDIM tile where the layout has more than the first."""
    surface = read_surface(face)
    tiles = bake_maps(plan, surface, needed_sizes(face, surface, plan), progress=progress)
    return {name: images[FIRST_TILE] if list(images) == [FIRST_TILE] else images for name, images in tiles.items()}


def needed_sizes(face: bpy.types.Object, surface: Surface, plan: Plan) -> MapSizes:
    """What the scene's camera can tell apart, at the plan's quality."""
    span_mm = mm_per_uv(surface.position_mm, surface.uv, surface.triangles, surface.corner_vertex)
    return map_sizes(span_mm, pixel_mm(bpy.context.scene, face), plan.settings)


def skin_slot(face: bpy.types.Object) -> int:
    """The slot that holds the skin: the one named so, or the one that most faces use."""
    for i, slot in enumerate(face.material_slots):
        if "skin" in slot.name.lower():
            return i
    indices = [polygon.material_index for polygon in face.data.polygons]
    return max(set(indices), key=indices.count) if indices else 0
