"""Emotion, action-unit and blood sliders on a control bone, and the drivers of the shape keys that listen to them.

Nothing here runs after it is built: a file with these controls works without the add-on, with auto-run off,
and as a library override. That is why every driver is a simple expression and no handler exists.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import bpy

from ..domain.blood import BLOOD_CONTROL, BLOOD_CONTROL_MAX
from ..domain.errors import InputError, nearest
from ..domain.facs import ACTION_UNITS, EMOTION_CONTROLS, EMOTIONS, SHAPE_KEYS
from ..domain.response import Response

CONTROL_BONE = "sanguine"

# Blender stores a driver's expression in 256 bytes and cuts what is longer without a word.
_MAX_EXPRESSION = 255


@dataclass(frozen=True)
class Control:
    """One slider: a custom property of the control bone."""

    help: str
    default: float = 0.0
    maximum: float = 1.0


CONTROLS: dict[str, Control] = {
    **{name: Control(EMOTIONS[name].help) for name in EMOTION_CONTROLS},
    BLOOD_CONTROL: Control(
        "How strongly emotion moves blood: 0 not at all, 1 as in life, above 1 exaggerated", 1.0, BLOOD_CONTROL_MAX
    ),
    **{unit.control: Control(unit.help) for unit in ACTION_UNITS.values()},
}
"""Every slider, in the order in which they are added."""


@dataclass(frozen=True)
class DriveReport:
    """What became of the shape keys that the controls know.

    `occupied` lists "mesh: key" for keys left alone because something else drives them already.
    """

    driven: tuple[str, ...]
    missing: tuple[str, ...]
    occupied: tuple[str, ...]


def add_controls(armature: bpy.types.Object) -> bpy.types.PoseBone:
    """Puts all sliders on the control bone, which is made if the armature has none. Values already set are kept."""
    if CONTROL_BONE not in armature.data.bones:
        with _edit_bones(armature) as bones:
            bone = bones.new(CONTROL_BONE)
            bone.tail = (0.0, 0.0, 0.1)  # a bone of no length is deleted on leaving edit mode
            bone.use_deform = False
    if armature.pose is None:  # an armature made by a script has no pose until it is first evaluated
        bpy.context.view_layer.update()
    bone = armature.pose.bones[CONTROL_BONE]
    for name, control in CONTROLS.items():
        if name not in bone:
            bone[name] = control.default
        describe(bone, name, control.help, 0.0, control.maximum, control.default)
        bone.property_overridable_library_set(f'["{name}"]', True)
    # A driver that is evaluated before the armature's evaluated copy has this pose is marked invalid for good.
    armature.update_tag()
    bpy.context.view_layer.update()
    return bone


def remove_controls(armature: bpy.types.Object) -> None:
    """Removes the sliders and their bone. Remove the drivers that listen to them first."""
    if CONTROL_BONE in armature.data.bones:
        with _edit_bones(armature) as bones:
            bones.remove(bones[CONTROL_BONE])  # its custom properties go with it


def set_controls(armature: bpy.types.Object, values: Mapping[str, float]) -> None:
    """Sets sliders by name. Raises InputError for an unknown name or a value outside the slider."""
    bone = armature.pose.bones[CONTROL_BONE]
    for name, value in values.items():
        if name in EMOTIONS and name not in CONTROLS:
            continue  # neutral is a face to ask for, not a slider
        if name not in CONTROLS:
            raise InputError(f"{name}: no such control, {nearest(name, CONTROLS)}")
        if not 0.0 <= value <= CONTROLS[name].maximum:
            raise InputError(f"{name}: {value} is outside 0 to {CONTROLS[name].maximum:g}")
        bone[name] = float(value)
    armature.update_tag()  # writing a custom property from Python does not by itself re-evaluate drivers


def drive_shape_keys(armature: bpy.types.Object, meshes: Iterable[bpy.types.Object]) -> DriveReport:
    """Drives every known shape key of `meshes` from the controls. Doing it twice changes nothing.

    A key that someone else drives is left alone. Raises ValueError when a driver cannot be made, naming the key.
    """
    driven, occupied = set(), []
    for mesh in meshes:
        keys = getattr(mesh.data, "shape_keys", None)
        for name, response in SHAPE_KEYS.items():
            if keys is None or name not in keys.key_blocks:
                continue
            path = f'key_blocks["{name}"].value'
            existing = _driver(keys, path)
            if existing and not _listens_to(existing, armature):
                occupied.append(f"{mesh.name}: {name}")
                continue
            drive(keys, path, response, armature)
            driven.add(name)
    return DriveReport(
        driven=tuple(name for name in SHAPE_KEYS if name in driven),
        missing=tuple(name for name in SHAPE_KEYS if name not in driven),
        occupied=tuple(occupied),
    )


def remove_shape_key_drivers(armature: bpy.types.Object, meshes: Iterable[bpy.types.Object]) -> None:
    """Removes the drivers of `drive_shape_keys` and sets the keys back to rest."""
    for mesh in meshes:
        keys = getattr(mesh.data, "shape_keys", None)
        for path in remove_drivers(keys, armature) if keys else ():
            keys.path_resolve(path.removesuffix(".value")).value = 0.0


def describe(owner, name: str, help: str, low: float, high: float, default: float) -> None:
    owner.id_properties_ui(name).update(
        description=help, min=low, max=high, soft_min=low, soft_max=high, default=default, step=1.0, precision=3
    )


@contextmanager
def _edit_bones(armature: bpy.types.Object) -> Iterator[bpy.types.ArmatureEditBones]:
    """The armature's edit bones, with mode and active object as they were afterwards."""
    bpy.context.view_layer.update()  # objects just linked by a script are not in the layer before
    if not armature.visible_get():
        raise InputError(f"{armature.name}: hidden or not in the view layer, so its bones cannot be edited: show it first")
    objects = bpy.context.view_layer.objects
    active = objects.active
    if active and active.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        yield armature.data.edit_bones
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
        objects.active = active


def drive(owner: bpy.types.ID, path: str, response: Response, armature: bpy.types.Object) -> None:
    expression = response.expression()
    if len(expression) >= _MAX_EXPRESSION:
        raise ValueError(f"{path}: driver of {len(expression)} characters, Blender keeps {_MAX_EXPRESSION - 1}: split it")
    owner.driver_remove(path)
    curve = owner.driver_add(path)
    curve.keyframe_points.clear()  # the default curve is an identity that rounds; without keys the value passes as it is
    driver = curve.driver
    driver.type = "SCRIPTED"
    for name in response.controls():
        variable = driver.variables.new()
        variable.name = name
        variable.targets[0].id = armature
        variable.targets[0].data_path = f'pose.bones["{CONTROL_BONE}"]["{name}"]'
    driver.expression = expression
    if not (driver.is_valid and driver.is_simple_expression):
        owner.driver_remove(path)
        raise ValueError(f"{path}: Blender does not take this as a simple expression: {expression}")


def _driver(owner: bpy.types.ID, path: str) -> bpy.types.FCurve | None:
    return owner.animation_data.drivers.find(path) if owner.animation_data else None


def _listens_to(curve: bpy.types.FCurve, armature: bpy.types.Object) -> bool:
    return any(
        target.id == armature and target.data_path.startswith(f'pose.bones["{CONTROL_BONE}"]')
        for variable in curve.driver.variables
        for target in variable.targets
    )


def remove_drivers(owner: bpy.types.ID, armature: bpy.types.Object) -> list[str]:
    """Removes the drivers of `owner` that listen to the controls; returns their paths."""
    curves = owner.animation_data.drivers if owner.animation_data else ()
    paths = [curve.data_path for curve in curves if _listens_to(curve, armature)]
    for path in paths:
        owner.driver_remove(path)
    animation = owner.animation_data
    if animation and not (animation.drivers or animation.action or animation.nla_tracks):
        owner.animation_data_clear()
    return paths
