"""Taking Sanguine off a face, so that the file is as it was before.

What a face, its rig and its shape keys were like is kept with them as a custom property, from the first Apply Skin or
Adopt Character on; the material that the slot had is a pointer there, which keeps it alive when the file is saved.
What is shared (a mesh, a rig) goes with the last face that needs it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import bpy
from mathutils import Matrix

from ..domain.errors import InputError
from .albedo import READ_FROM
from .bake import clear_bake
from .blood import PROFILE, remove_blood
from .controls import CONTROL_BONE, controls_of, drive_shape_keys, remove_controls, remove_drivers, remove_head_drivers
from .controls import remove_shape_key_drivers
from .curves import curves, drop_empty_animation, remove_curve
from .material import MARK, remove_skin_material
from .poses import CATALOG_TAG
from .properties import VIEWS
from .skin import VERSION, our_slot
from .strain import remove_components
from .surface import GROUP_PREFIX, REST_ATTRIBUTE

BEFORE = "sanguine_before"
"""Custom property of a face, a rig, a datablock of shape keys or a scene: what it was before it got a skin."""

_PLACE = ("location", "rotation_mode", "rotation_euler", "rotation_quaternion", "rotation_axis_angle", "scale")
_NEW = ("objects", "meshes", "armatures", "materials", "node_groups", "images", "texts", "actions", "scenes")


def has_skin(face: bpy.types.Object) -> bool:
    """Whether the skin is the face's own: one that it shows only because another face has the same mesh is not."""
    slot = our_slot(face)
    if BEFORE in face or slot is None:
        return BEFORE in face
    return face.material_slots[slot].link == "OBJECT" or not _others_of_mesh(face)


@contextmanager
def nothing_left_behind() -> Iterator[None]:
    """What fails within leaves no new datablock."""
    there = _everything()
    try:
        yield
    except BaseException:
        _remove_since(there)
        raise


class Change:
    """A face on its way to a skin: `undo` leaves face and file as they were when this was made."""

    def __init__(self, face: bpy.types.Object, slot: int):
        self.face, self.first = face, BEFORE not in face
        self.there = _everything()
        self.groups = [group.name for group in face.vertex_groups]
        if self.first:
            remember(face, slot)

    def keep(self) -> None:
        """What came with the skin is known to be ours from now on."""
        if BEFORE in self.face:
            state = _read(self.face)
            state["groups"] += [group.name for group in self.face.vertex_groups if group.name not in self.groups]
            _write(self.face, state)

    def undo(self) -> None:
        if self.first:
            self.keep()
            remove_skin(self.face)
        else:
            _remove_groups(self.face, [g.name for g in self.face.vertex_groups if g.name not in self.groups])
        _remove_since(self.there)


@contextmanager
def all_or_nothing(face: bpy.types.Object, slot: int) -> Iterator[None]:
    """A skin is put on `face` within; what fails there leaves no trace."""
    change = Change(face, slot)
    try:
        yield
    except BaseException:
        change.undo()
        raise
    change.keep()


def remember(face: bpy.types.Object, slot: int) -> None:
    """Keeps with `face`, its rig, its shape keys and its scene what Remove Sanguine gives back."""
    rig = controls_of(face)
    record: dict[str, Any] = {}
    state: dict[str, Any] = {
        "slot": slot if face.material_slots else -1,
        "groups": [],
        "active_group": face.vertex_groups.active_index,
        "attributes": [REST_ATTRIBUTE] if REST_ATTRIBUTE not in face.data.attributes else [],
        "parent_type": face.parent_type,
        "parent_bone": face.parent_bone,
        "parent_vertices": list(face.parent_vertices),
        "parent_inverse": [list(row) for row in face.matrix_parent_inverse],
        "place": {name: _plain(getattr(face, name)) for name in _PLACE},
        "settings": _settings(face),
    }
    material = face.material_slots[slot].material if face.material_slots else None
    for other in _others_of_mesh(face):  # one mesh, one slot: what it had before the first of them
        if material is not None and MARK in material and material == _skin_material(other):
            material = other[BEFORE].get("material")
            state["slot"] = _read(other)["slot"]
    record |= {"material": material} if material is not None and MARK not in material else {}
    record |= {"parent": face.parent} if face.parent is not None else {}
    record |= {name: getattr(face.sanguine, name) for name in _images(face)}
    face[BEFORE] = record | {"state": json.dumps(state)}
    if rig is not None and CONTROL_BONE not in rig.data.bones and BEFORE not in rig:
        rig[BEFORE] = {"made": False}
    for mesh in {face, *(rig.children if rig is not None else ())}:
        remember_keys(mesh, rig)
    scene = bpy.context.scene
    if BEFORE not in scene and not scene.cycles.shading_system:
        scene[BEFORE] = {"shading_system": scene.cycles.is_property_set("shading_system")}


def remember_keys(mesh: bpy.types.Object, rig: bpy.types.Object | None) -> None:
    """Keeps the values of shape keys that nobody of ours drives yet."""
    keys = getattr(mesh.data, "shape_keys", None)
    if keys is None or keys.library or BEFORE in keys or rig is not None and _driven_by(keys, rig):
        return
    keys[BEFORE] = json.dumps({block.name: block.value for block in keys.key_blocks if block.value})


def mark_rig(rig: bpy.types.Object) -> None:
    """The rig was made for a face, and goes with it."""
    rig[BEFORE] = {"made": True}


def remove_skin(face: bpy.types.Object) -> list[str]:
    """Takes everything of ours off a face. Returns what could not be given back, a line each.

    Raises InputError, before anything is changed, where Blender would not let it be done.
    """
    rig, known, notes = controls_of(face), BEFORE in face, []
    state = _read(face) if known else None
    parent = face[BEFORE].get("parent") if known else None
    others = [obj for obj in bpy.data.objects if obj.type == "MESH" and obj != face and has_skin(obj)]
    last = rig is not None and not any(controls_of(other) == rig for other in others)
    # Controls that were there before the skin stay; a skin from nobody knows where takes them with it.
    made = BEFORE in rig and bool(rig[BEFORE]["made"]) if rig is not None else False
    controls = last and (BEFORE in rig or not known)
    if controls and not made and CONTROL_BONE in rig.data.bones and not rig.visible_get():
        raise InputError(f"{rig.name}: hidden or not in the view layer, so its controls cannot be removed: show it first")

    clear_bake(face)
    remove_components(face)
    remove_blood(face)
    if VERSION in face:
        del face[VERSION]
    if not known:
        notes.append("the material that the face had is not known")
    _give_material_back(face, state)
    if not any(other.data == face.data for other in others):
        if REST_ATTRIBUTE in face.data.attributes and (state is None or REST_ATTRIBUTE in state["attributes"]):
            face.data.attributes.remove(face.data.attributes[REST_ATTRIBUTE])
        if state is not None:
            _remove_groups(face, state["groups"])
            if -1 < state["active_group"] < len(face.vertex_groups):
                face.vertex_groups.active_index = state["active_group"]
    else:
        _hand_over(state, others, face)
    if rig is None:
        _free_shape_keys(None, _keys_of(face))
    elif last:
        own = [*_keys_of(face), *(keys for child in rig.children for keys in _keys_of(child))]
        of_rig = [keys for keys in bpy.data.shape_keys if not keys.library and (_driven_by(keys, rig) or keys in own)]
        _free_shape_keys(rig, of_rig if controls else [keys for keys in of_rig if BEFORE in keys])
    if known and (made or rig is None) and parent not in (rig, face.parent):
        _give_parent_back(face, parent, state)
    if controls:
        _remove_rig(rig) if made else _remove_controls(rig)
    if known:
        _give_settings_back(face, state)
        del face[BEFORE]
    for scene in bpy.data.scenes:
        if BEFORE in scene and not any(obj.type == "MESH" and has_skin(obj) for obj in scene.objects):
            if scene[BEFORE]["shading_system"]:
                scene.cycles.shading_system = False
            else:
                scene.cycles.property_unset("shading_system")
            del scene[BEFORE]
    for other in others:  # a mesh that two rigs wanted to move
        if other.data == face.data and (its := controls_of(other)) is not None and its != rig and CONTROL_BONE in its.data.bones:
            drive_shape_keys(its, [other])
    face.update_tag()
    return notes


def _read(face: bpy.types.Object) -> dict[str, Any]:
    return json.loads(face[BEFORE]["state"])


def _write(face: bpy.types.Object, state: dict[str, Any]) -> None:
    face[BEFORE]["state"] = json.dumps(state)


def _plain(value: Any) -> Any:
    return value if isinstance(value, (str, int, float, bool)) else list(value)


def _skin_material(face: bpy.types.Object) -> bpy.types.Material | None:
    slot = our_slot(face)
    return face.material_slots[slot].material if slot is not None else None


def _others_of_mesh(face: bpy.types.Object) -> list[bpy.types.Object]:
    return [obj for obj in bpy.data.objects if obj != face and obj.data == face.data and BEFORE in obj]


def _give_material_back(face: bpy.types.Object, state: dict[str, Any] | None) -> None:
    """What shows another material than ours by now keeps that."""
    slot = our_slot(face)
    if slot is None:
        return
    skin = face.material_slots[slot].material
    if face.material_slots[slot].link == "DATA" and any(skin == _skin_material(other) for other in _others_of_mesh(face)):
        return  # the mesh's slot, which another face still needs
    if state is not None and state["slot"] < 0 and len(face.data.materials) == 1:
        face.data.materials.clear()
    else:
        face.material_slots[slot].material = face[BEFORE].get("material") if state is not None else None
    if not skin.users:
        remove_skin_material(skin)


def _remove_groups(face: bpy.types.Object, names: list[str]) -> None:
    for name in names:
        if name.startswith(GROUP_PREFIX) and name in face.vertex_groups:
            face.vertex_groups.remove(face.vertex_groups[name])


def _hand_over(state: dict[str, Any] | None, others: list[bpy.types.Object], face: bpy.types.Object) -> None:
    """What of ours the shared mesh has goes with the next face that uses it."""
    heir = next((other for other in others if other.data == face.data and BEFORE in other), None)
    if state is None or heir is None:
        return
    theirs = _read(heir)
    theirs["groups"] = list(dict.fromkeys([*theirs["groups"], *state["groups"]]))
    theirs["attributes"] = list(dict.fromkeys([*theirs["attributes"], *state["attributes"]]))
    _write(heir, theirs)


def _keys_of(face: bpy.types.Object) -> list[bpy.types.Key]:
    keys = getattr(face.data, "shape_keys", None)
    return [keys] if keys else []


def _driven_at_all(keys: bpy.types.Key) -> bool:
    return any(
        CONTROL_BONE in target.data_path or target.data_path.startswith(('["unit_', '["sum_'))
        for curve in (keys.animation_data.drivers if keys.animation_data else ())
        for variable in curve.driver.variables
        for target in variable.targets
    )


def _driven_by(keys: bpy.types.Key, rig: bpy.types.Object) -> bool:
    return any(
        target.id == rig
        for curve in (keys.animation_data.drivers if keys.animation_data else ())
        for variable in curve.driver.variables
        for target in variable.targets
    )


def _free_shape_keys(rig: bpy.types.Object | None, several: list[bpy.types.Key]) -> None:
    """Takes the rig's drivers (None: those whose rig is gone) off shape keys, which get the values back that they had."""
    for keys in several:
        values = json.loads(keys[BEFORE]) if BEFORE in keys else {}
        for path in remove_drivers(keys, rig):
            with suppress(ValueError):  # a key that somebody has removed since
                block = keys.path_resolve(path.removesuffix(".value"))
                block.value = values.get(block.name, 0.0)
        if BEFORE in keys and not _driven_at_all(keys):
            del keys[BEFORE]
    if rig is not None:
        remove_shape_key_drivers(rig, ())  # and what stands between the sliders and them


def _remove_controls(rig: bpy.types.Object) -> None:
    """Sliders, their curves and poses off a rig that is not ours."""
    remove_head_drivers(rig)
    path = f'pose.bones["{CONTROL_BONE}"]'
    ours = [(curve.data_path, curve.array_index) for curve in curves(rig) if curve.data_path.startswith(path)]
    for data_path, index in ours:
        remove_curve(rig, data_path, index)
    animation = rig.animation_data
    if ours and animation.action and not curves(rig):
        action = animation.action
        animation.action = None
        if not action.users:
            bpy.data.actions.remove(action)
    _remove_poses(rig)
    remove_controls(rig)
    for name in (PROFILE, BEFORE):
        if name in rig:
            del rig[name]
    drop_empty_animation(rig)


def _remove_rig(rig: bpy.types.Object) -> None:
    """A rig that was made for the controls alone. What somebody hung on it stays where it is."""
    for child in list(rig.children):
        place = child.matrix_world.copy()
        child.parent = rig.parent
        child.matrix_world = place
    _remove_poses(rig)
    actions = {rig.animation_data.action} if rig.animation_data else set()
    armature = rig.data
    bpy.data.objects.remove(rig)
    if not armature.users:
        bpy.data.armatures.remove(armature)
    bpy.data.batch_remove([action for action in actions if action and not action.users])


def _remove_poses(rig: bpy.types.Object) -> None:
    """Pose assets of the rig, unless somebody uses them."""
    poses = [
        action
        for action in bpy.data.actions
        if action.name.startswith(f"{rig.name}: ")
        and action.asset_data
        and CATALOG_TAG in action.asset_data.tags
        and action.users == int(action.use_fake_user)
    ]
    bpy.data.batch_remove(poses)


def _give_parent_back(face: bpy.types.Object, parent: bpy.types.Object | None, state: dict[str, Any]) -> None:
    """The parent and the place that it had, to the bit; where it was moved since, it stays there."""
    bpy.context.view_layer.update()
    now = face.matrix_world.copy()
    face.parent = parent
    face.parent_type, face.parent_bone = state["parent_type"], state["parent_bone"]
    face.parent_vertices = state["parent_vertices"]
    face.matrix_parent_inverse = Matrix(state["parent_inverse"])
    for name, value in state["place"].items():
        setattr(face, name, value)
    bpy.context.view_layer.update()
    apart = max(abs(a - b) for row, other in zip(now, face.matrix_world, strict=True) for a, b in zip(row, other, strict=True))
    # Single precision through two matrices: 1e-5 of the size of the numbers.
    if apart > 1e-5 * max(1.0, *(abs(value) for row in now for value in row)):
        face.matrix_world = now


def _settings(face: bpy.types.Object) -> dict[str, Any]:
    """The properties that somebody has set, pictures apart."""
    rows = face.sanguine.bl_rna.properties
    return {
        row.identifier: getattr(face.sanguine, row.identifier)
        for row in rows
        if row.identifier not in ("name", "rna_type", *VIEWS) and row.type != "POINTER" and face.sanguine.is_property_set(row.identifier)
    }


def _images(face: bpy.types.Object) -> list[str]:
    rows = face.sanguine.bl_rna.properties
    return [row.identifier for row in rows if row.type == "POINTER" and row.identifier != "rna_type" and getattr(face.sanguine, row.identifier)]


def _give_settings_back(face: bpy.types.Object, state: dict[str, Any]) -> None:
    images = {name: getattr(face.sanguine, name) for name in _images(face)}
    kept = {name: face[BEFORE].get(name) for name in face.sanguine.bl_rna.properties.keys() if face[BEFORE].get(name) is not None}
    if _settings(face) != state["settings"] or images != kept or not (kept or state["settings"]):
        cycles = bpy.context.scene.cycles
        samples = cycles.samples if cycles.is_property_set("samples") else None
        face.property_unset("sanguine")
        for name, value in {**state["settings"], **kept}.items():
            setattr(face.sanguine, name, value)
        if samples is None:  # the quality sets them
            cycles.property_unset("samples")
        elif cycles.samples != samples:
            cycles.samples = samples
    bpy.data.batch_remove([image for image in images.values() if READ_FROM in image and not image.users])


def _everything() -> set[tuple[str, int]]:
    return {(name, item.session_uid) for name in _NEW for item in getattr(bpy.data, name)}


def _remove_since(there: set[tuple[str, int]]) -> None:
    bpy.data.batch_remove([item for name in _NEW for item in getattr(bpy.data, name) if (name, item.session_uid) not in there])
