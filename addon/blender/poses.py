"""Poses of the emotions as assets: actions of one frame, for the pose library."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import bpy
import numpy as np

from ..domain.facs import VARIANTS
from ..domain.thumbnail import face_picture
from .controls import CONTROL_BONE, CONTROLS, emotions_of, states_of
from .curves import action_curve, ensure_action, set_keys

CATALOG_TAG = "Sanguine"


def add_poses(armature: bpy.types.Object) -> list[bpy.types.Action]:
    """One pose asset for the neutral face and for each variant of each emotion on the rig. Those of that name are kept.

    A pose holds every emotion's slider, the others at 0: applied, it is that face and no mixture with what was before.
    """
    emotions = emotions_of(armature)
    wanted = {"neutral": {}}
    for emotion in emotions:
        for variant, level in VARIANTS.items():
            wanted[emotion if variant == "full" else f"{emotion}, {variant}"] = {emotion: level}
    made = []
    before = dict(_sliders(armature))
    meshes = [child for child in armature.children if child.type == "MESH" and child.data.shape_keys]
    with _at_rest(armature):
        for label, levels in wanted.items():
            name = f"{armature.name}: {label}"
            if name not in bpy.data.actions:
                pose = _pose(armature, name, {s: levels.get(s, 0.0) for s in (*emotions, *states_of(armature))})
                _picture(pose, armature, meshes, dict.fromkeys(before, 0.0) | levels)
                made.append(pose)
    if made and meshes:
        _set(armature, before)
    return made


@contextlib.contextmanager
def _at_rest(armature: bpy.types.Object) -> Iterator[None]:
    """Without its own animation, which would be stronger than what the sliders are set to."""
    animation = armature.animation_data or armature.animation_data_create()
    action, slot, strips = animation.action, getattr(animation, "action_slot", None), animation.use_nla
    animation.action, animation.use_nla = None, False
    try:
        yield
    finally:
        animation.action, animation.use_nla = action, strips
        if slot is not None:
            animation.action_slot = slot


def _sliders(armature: bpy.types.Object) -> list[tuple[str, float]]:
    """What moves the face: sliders of the control bone that rest at 0."""
    bone = armature.pose.bones[CONTROL_BONE]
    return [(name, bone[name]) for name in bone.keys() if name in CONTROLS and CONTROLS[name].default == 0.0]


def _set(armature: bpy.types.Object, values: dict[str, float]) -> None:
    bone = armature.pose.bones[CONTROL_BONE]
    for name, value in values.items():
        bone[name] = value
    armature.update_tag()
    bpy.context.view_layer.update()


def _picture(
    action: bpy.types.Action, armature: bpy.types.Object, meshes: list[bpy.types.Object], values: dict[str, float]
) -> None:
    """Gives a pose the face that it makes as its preview: the asset shelf shows no names."""
    if not meshes:
        return
    _set(armature, values)
    corners = []
    for mesh in meshes:
        position, rest = (np.empty((len(mesh.data.vertices), 3), dtype=np.float32) for _ in range(2))
        mesh.data.vertices.foreach_get("co", rest.ravel())
        position[:] = rest
        moved = np.empty_like(rest)
        for key in mesh.data.shape_keys.key_blocks[1:]:  # driven values are written back to the keys
            if key.value and not key.mute:
                key.data.foreach_get("co", moved.ravel())
                position += key.value * (moved - rest)
        mesh.data.calc_loop_triangles()
        triangle = np.empty(3 * len(mesh.data.loop_triangles), dtype=np.int32)
        mesh.data.loop_triangles.foreach_get("vertices", triangle)
        into = np.array(armature.matrix_world.inverted() @ mesh.matrix_world)
        corners.append((position @ into[:3, :3].T + into[:3, 3])[triangle].reshape(-1, 3, 3))
    image = face_picture(np.concatenate(corners))
    preview = action.preview_ensure()
    preview.image_size = image.shape[1::-1]
    preview.image_pixels_float.foreach_set(np.ascontiguousarray(image).ravel())


def _pose(armature: bpy.types.Object, name: str, values: dict[str, float]) -> bpy.types.Action:
    action = ensure_action(armature, name)  # the curves are made through the armature itself
    for slider, value in values.items():
        curve = action_curve(armature, f'pose.bones["{CONTROL_BONE}"]["{slider}"]', group=CONTROL_BONE)
        set_keys(curve, [1.0], [value], "CONSTANT")
    armature.animation_data.action = None
    action.name = name
    action.use_fake_user = True
    action.asset_mark()
    action.asset_data.tags.new(CATALOG_TAG)
    action.asset_data.description = "Pose of the Sanguine controls: " + ", ".join(f"{s} {v:g}" for s, v in values.items() if v)
    return action
