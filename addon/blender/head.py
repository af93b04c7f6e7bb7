"""A head as Blender objects: meshes with ARKit shape keys, hair curves, and the armature that carries the controls."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..domain.head import Head, MeshPart, Preset, StrandPart
from .controls import CONTROL_BONE
from .looks import looks

NECK_BLEND_M = 0.05  # half the height over which the neck passes the head bone's turn on to the shoulders


@dataclass(frozen=True)
class FaceObjects:
    """The objects of one head.

    parts : part name ('skin', 'eyes', 'teeth', …) -> mesh object
    hair  : Curves object
    rig   : armature with the bones root, head and `sanguine` (the carrier of the controls)
    """

    collection: bpy.types.Collection
    rig: bpy.types.Object
    parts: dict[str, bpy.types.Object]
    hair: bpy.types.Object

    @property
    def skin(self) -> bpy.types.Object:
        return self.parts["skin"]


def _mesh(name: str, part: MeshPart) -> bpy.types.Mesh:
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(part.vertices))
    mesh.vertices.foreach_set("co", part.vertices.ravel())
    mesh.loops.add(part.faces.size)
    mesh.loops.foreach_set("vertex_index", part.faces.ravel())
    mesh.polygons.add(len(part.faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, part.faces.size, 4, dtype=np.int32))
    mesh.polygons.foreach_set("material_index", part.material)
    mesh.uv_layers.new(name="UVMap").data.foreach_set("uv", part.uv.ravel())
    mesh.update(calc_edges=True)
    mesh.shade_smooth()
    return mesh


def _add_shape_keys(obj: bpy.types.Object, part: MeshPart) -> None:
    if not part.shape_keys:
        return
    obj.shape_key_add(name="Basis", from_mix=False)
    for name, key in part.shape_keys.items():
        block = obj.shape_key_add(name=name, from_mix=False)
        block.value = 0.0  # 5.x starts new keys at 1
        position = part.vertices.copy()
        position[key.indices] += key.delta
        block.data.foreach_set("co", position.ravel())


def _curves(name: str, strands: StrandPart) -> bpy.types.Curves:
    curves = bpy.data.hair_curves.new(name)
    n, k, _ = strands.points.shape
    curves.add_curves([k] * n)
    curves.points.foreach_set("position", strands.points.ravel())
    radius = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", strands.radius.ravel())
    return curves


def _control_shape() -> bpy.types.Mesh:
    """A drop, in outline, one unit long."""
    t = np.linspace(0, 2 * np.pi, 33)[:-1]
    drop = np.stack([0.35 * np.sin(t) * np.sin(t / 2) ** 1.5, 0.5 + 0.5 * np.cos(t), np.zeros_like(t)], axis=-1)
    mesh = bpy.data.meshes.new(f"{CONTROL_BONE}_shape")
    mesh.from_pydata(drop.tolist(), [(i, (i + 1) % len(t)) for i in range(len(t))], [])
    return mesh


def _rig(name: str, head: Head, collection: bpy.types.Collection) -> bpy.types.Object:
    """Armature at the head: root on the ground, head from the neck up, the control above the crown."""
    rig = bpy.data.objects.new(name, bpy.data.armatures.new(name))
    collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    crown, neck = Vector(head.landmarks["crown"]), Vector(head.landmarks["neck"])
    bpy.ops.object.mode_set(mode="EDIT")
    bones = rig.data.edit_bones
    above = crown + Vector((0, 0, 0.05))
    for bone, start, end, parent in (
        ("root", Vector((0, 0, 0)), Vector((0, 0, 0.06)), None),
        ("head", neck, crown, "root"),
        (CONTROL_BONE, above, above + Vector((0, 0, 0.04)), "head"),
    ):
        edit = bones.new(bone)
        edit.head, edit.tail = start, end
        edit.parent = bones[parent] if parent else None
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.pose.bones[CONTROL_BONE].custom_shape = bpy.data.objects.new(f"{CONTROL_BONE}_shape", _control_shape())
    return rig


def _follow_head(obj: bpy.types.Object, rig: bpy.types.Object) -> None:
    """Parent to the head bone, staying where it is (a bone's children hang at its tail)."""
    bone = rig.data.bones["head"]
    obj.parent, obj.parent_type, obj.parent_bone = rig, "BONE", bone.name
    obj.matrix_parent_inverse = (bone.matrix_local @ Matrix.Translation((0, bone.length, 0))).inverted()


def _bind_skin(obj: bpy.types.Object, rig: bpy.types.Object, head: Head) -> None:
    """The skin bends at the neck: weights pass from root to head over a short height."""
    obj.parent = rig
    heights = head.part("skin").vertices[:, 2] - head.landmarks["neck"][2]
    weights = np.clip(heights / (2 * NECK_BLEND_M) + 0.5, 0, 1)
    for name, values in (("head", weights), ("root", 1 - weights)):
        group = obj.vertex_groups.new(name=name)
        # Weights go in by value: a hundred steps are finer than anyone sees and a hundred calls are quick.
        steps = np.round(values * 100).astype(int)
        for step in np.unique(steps[steps > 0]):
            group.add(np.nonzero(steps == step)[0].tolist(), step / 100, "REPLACE")
    obj.modifiers.new("Armature", "ARMATURE").object = rig


def build_face(head: Head, preset: Preset, skin_material: bpy.types.Material) -> FaceObjects:
    """Make the objects of a head in the open scene, in a collection of their own named after the preset."""
    collection = bpy.data.collections.new(head.preset)
    bpy.context.scene.collection.children.link(collection)
    materials = {"skin": skin_material, **looks(preset)}
    rig = _rig(f"{head.preset}_rig", head, collection)
    objects = {}
    for part in head.parts:
        name = f"{head.preset}_{part.name}"
        obj = bpy.data.objects.new(name, _mesh(name, part))
        collection.objects.link(obj)
        for slot in part.slots:
            obj.data.materials.append(materials[slot])
        _add_shape_keys(obj, part)
        objects[part.name] = obj
        if part.name == "skin":
            _bind_skin(obj, rig, head)
        else:
            _follow_head(obj, rig)
        if part.subdivision:
            modifier = obj.modifiers.new("Subdivision", "SUBSURF")
            modifier.levels, modifier.render_levels = 1, part.subdivision
    name = f"{head.preset}_{head.hair.name}"
    hair = bpy.data.objects.new(name, _curves(name, head.hair))
    hair.data.materials.append(materials[head.hair.slot])
    collection.objects.link(hair)
    _follow_head(hair, rig)
    return FaceObjects(collection, rig, objects, hair)
