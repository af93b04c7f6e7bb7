"""How thick the flesh of a mesh is, measured by rays, and where that makes it thin: a vertex group that can be painted."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ..domain.effects.thin import ATTRIBUTE, CONE, GONE_MM, SKY, lit_share, thinness
from .surface import position_mm, position_scale_mm, store_weights, triangles_of

# A ray begins this far below the surface, so that it does not end on the triangles that it starts from.
_START_MM = 0.01
_SMOOTHING = 2
_REACH_MM = 1.5 * GONE_MM  # a slanted ray may find an end where the straight one goes a little too far


@dataclass(frozen=True)
class Flesh:
    """Per vertex: thickness_mm (V,), the mean over the rays that came out within _REACH_MM, infinite where none did;
    thin (V,), 0 to 1."""

    thickness_mm: np.ndarray
    thin: np.ndarray


def store_thin(face: bpy.types.Object) -> None:
    """Measures where the face is thin, as a vertex group. One that is there is kept: it may be painted."""
    if ATTRIBUTE not in face.vertex_groups and ATTRIBUTE not in face.data.attributes:
        store_weights(face, ATTRIBUTE, measure_flesh(face).thin)


def measure_flesh(obj: bpy.types.Object) -> Flesh:
    """Casts a cone of rays from every vertex into the flesh below it.

    A ray at an angle to the normal counts by its depth below the surface (a slab is as thick under each of them), and only
    where it leaves the flesh from inside (not where it ends nowhere, in an open mesh, or comes upon a surface from outside)
    and light can get there: the wall of a closed mouth, or a lid over its eye, is no window. That is the shape diameter
    function of Shapira, Shamir and Cohen-Or 2008, but for light.
    """
    places, triangles = _finite(position_mm(obj).astype(np.float64), triangles_of(obj))
    normals = vertex_normals(places, triangles)
    flesh = BVHTree.FromPolygons(places.tolist(), triangles.tolist(), all_triangles=True)
    frames = _frames(normals)
    origins = places - _START_MM * normals
    depth_mm = np.full((len(places), len(CONE)), np.inf)
    ends = np.full((len(places), len(CONE)), -1)
    used = np.flatnonzero(normals.any(axis=1))
    for k, (x, y, down) in enumerate(CONE):
        if k == 1:  # most of a body is thick: where nothing ends the straight ray, slanted ones are not cast
            used = used[ends[used, 0] >= 0]
        directions = np.array([x, y, -down]) @ frames
        for v in used.tolist():
            direction = Vector(directions[v])
            _place, normal, triangle, distance = flesh.ray_cast(Vector(origins[v]), direction, _REACH_MM / down)
            if normal is not None and normal.dot(direction) > 0.0:
                depth_mm[v, k] = distance * down + _START_MM
                ends[v, k] = triangle
    found = ends >= 0
    lit = np.zeros(len(triangles) + 1)  # the last stands for no triangle
    there = np.unique(ends[found])
    if len(there):
        corners, where = np.unique(triangles[there], return_inverse=True)
        lit[there] = _lit(obj, places[corners], frames[corners])[where.reshape(-1, 3)].mean(1)
    thin = (thinness(depth_mm) * lit[ends]).mean(1)
    for _ in range(_SMOOTHING):
        thin = _smoothed(thin, triangles)
    mean_mm = np.where(found, depth_mm, 0.0).sum(1) / np.maximum(found.sum(1), 1)
    return Flesh(np.where(found.any(1), mean_mm, np.inf), thin)


def _lit(obj: bpy.types.Object, places: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """(N,) 0 to 1: whether places on the surface see enough of what is around the figure to let light in."""
    corners, triangles = _figure(obj)
    tree = BVHTree.FromPolygons(corners.tolist(), triangles.tolist(), all_triangles=True)
    reach = 2.0 * float(np.linalg.norm(np.ptp(corners, axis=0)))
    origins = places + _START_MM * frames[:, 2]
    open_to = np.zeros(len(places))
    for x, y, up in SKY:
        directions = np.array([x, y, up]) @ frames
        for v in range(len(places)):
            open_to[v] += tree.ray_cast(Vector(origins[v]), Vector(directions[v]), reach)[0] is None
    return lit_share(open_to / len(SKY))


def _figure(obj: bpy.types.Object) -> tuple[np.ndarray, np.ndarray]:
    """The mesh with what belongs to it (eyes, teeth: meshes below the same parent, or below it), in mm in its own frame."""
    family = [obj, *obj.children, *(obj.parent.children if obj.parent is not None else ())]
    seen = [each for each in dict.fromkeys(family) if each.type == "MESH" and (each == obj or each.visible_get())]
    to_own = np.diag(np.append(position_scale_mm(obj), 1.0)) @ np.array(obj.matrix_world.inverted_safe())
    corners, triangles, count = [], [], 0
    for each in seen:
        at = np.empty(len(each.data.vertices) * 3, dtype=np.float32)
        each.data.vertices.foreach_get("co", at)
        there = at.reshape(-1, 3) @ (to_own @ np.array(each.matrix_world))[:3, :3].T + (to_own @ np.array(each.matrix_world))[:3, 3]
        there, of = _finite(there, triangles_of(each))
        corners.append(there)
        triangles.append(of + count)
        count += len(there)
    return np.concatenate(corners), np.concatenate(triangles)


def _finite(places: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Without triangles that have a corner nowhere."""
    good = np.isfinite(places).all(axis=1)
    return np.where(good[:, None], places, 0.0), triangles[good[triangles].all(axis=1)]


def _frames(normals: np.ndarray) -> np.ndarray:
    """(V, 3, 3): rows are two directions along the surface and the normal."""
    side = np.cross(normals, np.where(np.abs(normals[:, :1]) < 0.7, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-12)
    return np.stack([side, np.cross(normals, side), normals], axis=1)


def vertex_normals(places: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(V, 3) unit normals, triangles weighted by their area; zero for a vertex that has none."""
    a, b, c = (places[triangles[:, k]] for k in range(3))
    normals = np.zeros_like(places)
    for k in range(3):
        np.add.at(normals, triangles[:, k], np.cross(b - a, c - a))
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(np.isfinite(length) & (length > 0.0), normals / np.where(length > 0.0, length, 1.0), 0.0)


def _smoothed(values: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Half way to the mean of the corners around: single rays do not show."""
    total, count = np.zeros_like(values), np.zeros_like(values)
    mean = values[triangles].mean(1)
    for k in range(3):
        np.add.at(total, triangles[:, k], mean)
        np.add.at(count, triangles[:, k], 1.0)
    return np.where(count > 0.0, 0.5 * values + 0.5 * total / np.maximum(count, 1.0), values)
