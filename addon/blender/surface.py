"""A face mesh as the maps need it. Region masks are vertex groups, which an artist can paint."""

from __future__ import annotations

from collections.abc import Mapping

import bpy
import numpy as np
from mathutils import Vector

from ..app.maps import Surface
from ..domain.effects.pressure import ATTRIBUTE
from ..domain.effects.regions import FACE_REGIONS
from ..domain.errors import InputError
from ..domain.face_regions import FoundRegions, find_regions
from ..domain.head import load_regions
from ..domain.head.model import ShapeKey
from ..domain.head_size import HeadSize, head_size
from ..domain.naming import recognise
from ..domain.resources import rigs_path
from ..domain.strain import ShapeKeys

GROUP_PREFIX = "sanguine_"
REST_ATTRIBUTE = "rest_mm"
"""Vertex positions of the neutral face in mm: noise of the material holds on to them while the face moves."""


def store_regions(obj: bpy.types.Object, regions: Mapping[str, np.ndarray]) -> None:
    """Masks (V,) 0-1 as vertex groups `sanguine_<region>`. A group that is there is kept: it may be painted."""
    for region, mask in regions.items():
        if GROUP_PREFIX + region not in obj.vertex_groups:
            store_weights(obj, GROUP_PREFIX + region, mask)


def store_weights(obj: bpy.types.Object, name: str, weights: np.ndarray) -> None:
    """A new vertex group of weights (V,) 0-1."""
    group = obj.vertex_groups.new(name=name)
    # One call per weight is slow for Blender's API, so weights go in 1/255 steps, finer than a painted mask.
    levels = np.round(np.asarray(weights) * 255.0).astype(np.int32)
    for level in np.unique(levels[levels > 0]):
        group.add(np.nonzero(levels == level)[0].tolist(), float(level) / 255.0, "REPLACE")


def face_regions(obj: bpy.types.Object) -> tuple[str, ...]:
    """Regions that the mesh has masks for, in the order in which maps pack them."""
    return tuple(region for region in FACE_REGIONS if GROUP_PREFIX + region in obj.vertex_groups)


def find_face_regions(obj: bpy.types.Object) -> str:
    """Gives a face without masks those that its shape keys tell. Returns what came of it, one line, "" if it has masks."""
    if face_regions(obj):
        return ""
    found = _found(obj, _arkit_moves(obj))
    store_regions(obj, {region: mask for region, mask in found.regions.items() if region in FACE_REGIONS})
    return found.because


def size_of_head(obj: bpy.types.Object) -> HeadSize:
    """How tall it is as it stands in the scene: its object's scale and the scene's unit count."""
    moves = _arkit_moves(obj)
    landmarks = _found(obj, moves).landmarks
    jaw = np.linalg.norm(moves["jawOpen"], axis=1) if "jawOpen" in moves else None
    return head_size(position_mm(obj), {name: 1000.0 * place for name, place in landmarks.items()}, jaw)


def _arkit_moves(obj: bpy.types.Object) -> dict[str, np.ndarray]:
    """ARKit key -> (V, 3) displacement at value 1, in metres, of the keys that the mesh has under any name."""
    to_metres = position_scale_mm(obj) / 1000.0
    moves: dict[str, np.ndarray] = {}
    blocks = obj.data.shape_keys.key_blocks if obj.data.shape_keys else {}
    for name, arkit in recognise(blocks.keys()).strongest().items():
        moved = (_key_positions(blocks[name]) - _key_positions(blocks[name].relative_key)) * to_metres
        moves[arkit] = moves[arkit] + moved if arkit in moves else moved  # browInnerUp of rigs that have it by side
    return moves


def _found(obj: bpy.types.Object, moves: Mapping[str, np.ndarray]) -> FoundRegions:
    triangles = triangles_of(obj)
    indices = {name: np.flatnonzero(moved.any(axis=1)) for name, moved in moves.items()}
    keys = {name: ShapeKey(index, moves[name][index]) for name, index in indices.items()}
    return find_regions(position_mm(obj) / 1000.0, triangles, keys, load_regions(rigs_path("regions.toml")))


def triangles_of(obj: bpy.types.Object) -> np.ndarray:
    """(T, 3) int32, indices of vertices."""
    obj.data.calc_loop_triangles()
    triangles = np.empty(len(obj.data.loop_triangles) * 3, dtype=np.int32)
    obj.data.loop_triangles.foreach_get("vertices", triangles)
    return triangles.reshape(-1, 3)


def _key_positions(key: bpy.types.ShapeKey) -> np.ndarray:
    positions = np.empty(len(key.data) * 3, dtype=np.float32)
    key.data.foreach_get("co", positions)
    return positions.reshape(-1, 3)


def store_rest(obj: bpy.types.Object) -> None:
    """Writes the neutral positions, in mm, as a vertex attribute."""
    mesh = obj.data
    attribute = mesh.attributes.get(REST_ATTRIBUTE) or mesh.attributes.new(REST_ATTRIBUTE, "FLOAT_VECTOR", "POINT")
    attribute.data.foreach_set("vector", position_mm(obj).ravel())


def position_mm(obj: bpy.types.Object) -> np.ndarray:
    """(V, 3) float32: the neutral face at the object's scale, in mm."""
    positions = np.empty(len(obj.data.vertices) * 3, dtype=np.float32)
    obj.data.vertices.foreach_get("co", positions)
    return positions.reshape(-1, 3) * position_scale_mm(obj)


def position_scale_mm(obj: bpy.types.Object) -> np.ndarray:
    """(3,) float32: mm per unit of the mesh, along its axes. Of a mirrored object the lengths: the mesh is not mirrored
    with it, so its left stays left and its up stays up."""
    mm_per_unit = 1000.0 * bpy.context.scene.unit_settings.scale_length
    return np.abs(np.array(obj.matrix_world.to_scale(), dtype=np.float32)) * np.float32(mm_per_unit)


def pixel_mm(scene: bpy.types.Scene, obj: bpy.types.Object) -> float | None:
    """What a pixel of the scene's camera covers where `obj` is nearest to it, in mm of its surface.

    None without a camera, or when it sees none of the object from outside.
    """
    camera = scene.camera
    if camera is None or camera.data.type == "PANO":
        return None
    seen = camera.matrix_world.inverted() @ obj.matrix_world
    corner = camera.data.view_frame(scene=scene)  # in the camera's own space, at depth -z for a perspective
    width = max(point.x for point in corner) - min(point.x for point in corner)
    if camera.data.type == "PERSP":
        depth = min(-(seen @ Vector(place)).z for place in obj.bound_box)
        if depth <= camera.data.clip_start:
            return None
        width *= depth / -corner[0].z
    pixels = scene.render.resolution_x * scene.render.resolution_percentage / 100.0
    return 1000.0 * scene.unit_settings.scale_length * width / pixels


def read_surface(obj: bpy.types.Object) -> Surface:
    """UVs, triangles and region masks of a mesh. Raises InputError when it has no UV map."""
    mesh = obj.data
    layer = next((each for each in mesh.uv_layers if each.active_render), None)  # the one that Cycles shows maps by
    if layer is None:
        raise InputError(f"{obj.name}: no UV map, which the chromophore maps need: unwrap it first")
    corners = len(mesh.loops)
    uv = np.empty(corners * 2, dtype=np.float32)
    layer.data.foreach_get("uv", uv)
    corner_vertex = np.empty(corners, dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", corner_vertex)
    mesh.calc_loop_triangles()
    triangles = np.empty(len(mesh.loop_triangles) * 3, dtype=np.int32)
    mesh.loop_triangles.foreach_get("loops", triangles)
    regions = {region: _group_weights(obj, GROUP_PREFIX + region) for region in face_regions(obj)}
    return Surface(
        position_mm(obj), uv.reshape(-1, 2), triangles.reshape(-1, 3), corner_vertex, regions, _shape_keys(obj)
    )


def has_shape_keys(obj: bpy.types.Object) -> bool:
    """Whether keys that add up move the mesh (absolute keys, which follow one another, do not)."""
    keys = obj.data.shape_keys
    return keys is not None and keys.use_relative and any(not block.mute for block in keys.key_blocks[1:])


def _shape_keys(obj: bpy.types.Object) -> ShapeKeys | None:
    """What each key moves at value 1, at the object's scale; keys that move nothing, or are muted, are left out."""
    if not has_shape_keys(obj):
        return None
    names, deltas = [], []
    for block in obj.data.shape_keys.key_blocks[1:]:
        delta = _key_positions(block) - _key_positions(block.relative_key)
        if block.vertex_group in obj.vertex_groups:
            delta *= _group_weights(obj, block.vertex_group)[:, None]
        if not block.mute and delta.any():
            names.append(block.name)
            deltas.append(delta * position_scale_mm(obj))
    return ShapeKeys(tuple(names), np.float32(deltas)) if names else None


def has_pressure(obj: bpy.types.Object) -> bool:
    """Whether the mesh says where something presses on it: itself, or after its modifiers."""
    if ATTRIBUTE in obj.vertex_groups or ATTRIBUTE in obj.data.attributes:
        return True
    depsgraph = bpy.context.view_layer.depsgraph  # as it stands: panels ask while they draw
    return depsgraph is not None and ATTRIBUTE in getattr(obj.evaluated_get(depsgraph).data, "attributes", ())


def _group_weights(obj: bpy.types.Object, group: str) -> np.ndarray:
    index = obj.vertex_groups[group].index
    weights = np.zeros(len(obj.data.vertices), dtype=np.float32)
    for vertex in obj.data.vertices:
        for element in vertex.groups:
            if element.group == index:
                weights[vertex.index] = element.weight
    return weights
