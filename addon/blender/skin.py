"""Giving a face its skin: maps, material, and the blood that its controls move."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import bpy

from ..app.maps import Surface, bake_maps, reached, strain_coefficients, wrinkle_coefficients
from ..domain.effects import strain, wrinkles
from ..domain.errors import InputError
from ..domain.plan import Plan
from ..domain.texel_density import MapSizes, map_sizes, mm_per_uv
from ..domain.udim import FIRST_TILE, check_tiles
from .bake import clear_bake
from .blood import drive_settled, remove_blood
from .material import MARK, Map, build_skin_material, remove_skin_material
from .osl import missing_osl
from .properties import images_of
from .strain import drive_components, remove_components
from .surface import pixel_mm, read_surface, store_rest


def apply_skin(
    face: bpy.types.Object,
    armature: bpy.types.Object | None,
    plan: Plan,
    slot: int = 0,
    progress: Callable[[int, int], bool] | None = None,
    given: Mapping[str, Map] | None = None,
) -> bpy.types.Material:
    """Builds the skin of `plan`, puts it into a material slot of `face` and drives its blood from `armature`.

    given: the maps that came with the face, by id; left out, those that its properties point to.
    """
    if why := missing_osl():
        raise InputError(f"{face.name}: {why}")
    surface = read_surface(face) if plan.maps else None
    maps = _maps(face, surface, plan, images_of(face) if given is None else given, progress) if surface else {}
    plan = reached(plan, maps)
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
    clear_bake(face)
    remove_blood(face)
    if armature is not None:
        drive_settled(armature, face, inputs)
    remove_components(face)
    if set(strain.IMAGES) & set(maps):
        drive_components(face, strain.IMAGES, surface.keys.names, strain_coefficients(surface), one_sided=False)
    if set(wrinkles.IMAGES) & set(maps):
        drive_components(face, wrinkles.IMAGES, surface.keys.names, wrinkle_coefficients(surface), one_sided=True)
    return material


def _maps(
    face: bpy.types.Object,
    surface: Surface,
    plan: Plan,
    given: Mapping[str, Map],
    progress: Callable[[int, int], bool] | None,
) -> dict[str, Map]:
    """Map id -> image, or images by UDIM tile where the layout has more than the first."""
    tiles = bake_maps(plan, surface, needed_sizes(face, surface, plan), progress=progress)
    maps: dict[str, Map] = {
        name: images[FIRST_TILE] if list(images) == [FIRST_TILE] else images for name, images in tiles.items()
    }
    for name in plan.maps:
        if name in given:
            if isinstance(given[name], bpy.types.Image) and not given[name].size[0]:
                raise InputError(f"{face.name}: {name}: the image '{given[name].name}' has no pixels: its file is missing")
            check_tiles(_tiles(given[name]), surface.tiles, f"{face.name}: {name}")
            maps[name] = given[name]
    return maps


def _tiles(shown: Map) -> list[int]:
    if isinstance(shown, bpy.types.Image):
        return [tile.number for tile in shown.tiles] if shown.source == "TILED" else [FIRST_TILE]
    return list(shown) if isinstance(shown, Mapping) else [FIRST_TILE]


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
