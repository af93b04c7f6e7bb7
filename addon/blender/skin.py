"""Giving a face its skin: maps, material, and the blood that its controls move."""

from __future__ import annotations

from collections.abc import Mapping

import bpy
import numpy as np

from ..app.maps import Surface, bake_maps, reached, strain_coefficients, wrinkle_coefficients
from ..app.tasks import Progress, Task, Tasks, run_tasks
from ..domain.effects import strain, thin, wrinkles
from ..domain.errors import InputError
from ..domain.lut import bake
from ..domain.migration import SCHEMA, check_version
from ..domain.plan import Plan
from ..domain.shading import AUTO, OSL, choose
from ..domain.texel_density import MapSizes, map_sizes, mm_per_uv
from ..domain.udim import FIRST_TILE, check_tiles
from .bake import clear_bake
from .blood import drive_packed, drive_settled, remove_blood
from .colour import working_space
from .material import MARK, Map, build_skin_material, number_free, remove_skin_material
from .osl import renderer_of
from .properties import images_of
from .strain import drive_components, remove_components
from .surface import pixel_mm, read_surface, store_rest
from .thin import store_thin

VERSION = "sanguine_version"
"""Custom property of a face with a skin: the version of what the add-on wrote onto it (domain/migration.py)."""


def apply_skin(
    face: bpy.types.Object,
    armature: bpy.types.Object | None,
    plan: Plan,
    slot: int = 0,
    progress: Progress | None = None,
    given: Mapping[str, Map] | None = None,
    shading: str = AUTO,
) -> bpy.types.Material:
    """Builds the skin of `plan`, puts it into a material slot of `face` and drives its blood from `armature`.

    given: the maps that came with the face, by id; left out, those that its properties point to. shading: of
    `domain.shading`, what the material is made of.
    """
    return run_tasks(skin_tasks(face, armature, plan, slot, given, shading), progress)


def skin_tasks(
    face: bpy.types.Object,
    armature: bpy.types.Object | None,
    plan: Plan,
    slot: int = 0,
    given: Mapping[str, Map] | None = None,
    shading: str = AUTO,
) -> Tasks:
    """`apply_skin` in steps: computing is yielded as tasks. Returns the material.

    The skin that was there goes when the new one stands, and stays where that fails.
    """
    if VERSION in face:
        check_version(face[VERSION], face.name)
    chosen = choose(shading, renderer_of(bpy.context.scene))
    surface = read_surface(face) if plan.maps else None
    maps: dict[str, Map] = {}
    if surface:
        sizes = needed_sizes(face, surface, plan)
        tiles = yield Task("Painting maps", lambda progress: bake_maps(plan, surface, sizes, progress=progress))
        maps = _maps(face, surface, plan, tiles, images_of(face) if given is None else given)
    plan, space = reached(plan, maps), working_space()
    table = yield Task("Solving skin", lambda progress: bake(plan.axes, plan.skin, space, progress, plan.settings.lobes, plan.walk))
    components = []
    for images, driven, solve, one_sided in (
        (strain.IMAGES, strain.IMAGES, strain_coefficients, False),
        (wrinkles.IMAGES, wrinkles.DRIVEN, wrinkle_coefficients, True),
    ):
        if set(images) & set(maps):
            coefficients = yield Task("Following shape keys", lambda _progress, solve=solve: solve(surface))
            components.append((driven, coefficients, one_sided))
    before = face.material_slots[slot].material if face.material_slots else None
    material = build_skin_material(f"{face.name} skin", plan, maps, table, chosen.shading)
    inputs = {item.key for fragment in plan.fragments for item in fragment.inputs}
    if "rest_mm" in inputs:
        store_rest(face)
    if thin.ATTRIBUTE in inputs:
        store_thin(face)
    if face.material_slots:
        face.material_slots[slot].material = material  # the slot knows whether it belongs to the object or the mesh
    else:
        face.data.materials.append(material)
    try:
        clear_bake(face)
        remove_blood(face)
        if armature is not None:
            drive_settled(armature, face, {name for parts in plan.packed.values() for name in parts})
        drive_packed(face, plan.packed)
        remove_components(face)
        for driven, coefficients, one_sided in components:
            drive_components(face, driven, surface.keys.names, coefficients, one_sided)
    except BaseException:
        face.material_slots[slot].material = before
        remove_skin_material(material)
        raise
    if before is not None and MARK in before and not before.users:
        remove_skin_material(before)
        number_free(material)
    if chosen.shading == OSL:
        bpy.context.scene.cycles.shading_system = True
    face[VERSION] = SCHEMA
    return material


def _maps(
    face: bpy.types.Object,
    surface: Surface,
    plan: Plan,
    tiles: Mapping[str, Mapping[int, np.ndarray]],
    given: Mapping[str, Map],
) -> dict[str, Map]:
    """Map id -> image, or images by UDIM tile where the layout has more than the first."""
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
    """The slot that holds the skin: ours, or the one named so, or the one that most faces use."""
    if (ours := our_slot(face)) is not None:
        return ours
    for i, slot in enumerate(face.material_slots):
        if "skin" in slot.name.lower():
            return i
    indices = [polygon.material_index for polygon in face.data.polygons]
    return max(set(indices), key=indices.count) if indices else 0


def our_slot(face: bpy.types.Object) -> int | None:
    """The slot that holds a skin of ours."""
    return next((i for i, slot in enumerate(face.material_slots) if slot.material and MARK in slot.material), None)
