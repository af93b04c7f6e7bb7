"""F-curves of an ID in every supported Blender: flat actions (4.2, 4.3) and slots with channelbags (4.4 and later).

Blender 5 has no `Action.fcurves`; what stands in its place is the channelbag of the owner's slot, which has the same
`fcurves` and `groups`. Everything here goes through that one container.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np


def ensure_action(owner: bpy.types.ID, name: str) -> bpy.types.Action:
    """The owner's active action, made under `name` if it has none, with a slot of its own where Blender has slots.

    Raises ValueError for an action that is linked from another file, which cannot be edited.
    """
    animation = owner.animation_data or owner.animation_data_create()
    if animation.action is None:
        animation.action = bpy.data.actions.new(name)
    action = animation.action
    if action.library is not None:
        raise ValueError(f"{owner.name}: its action '{action.name}' is linked: make it local, or push it down, first")
    if hasattr(action, "slots") and animation.action_slot is None:
        animation.action_slot = action.slots.new(owner.id_type, owner.name)
    return action


def curves(owner: bpy.types.ID) -> list[bpy.types.FCurve]:
    """All curves that the owner's active action (its slot) holds for it; drivers are not among them."""
    channels = _channels(owner)
    return list(channels.fcurves) if channels is not None else []


def find_curve(owner: bpy.types.ID, data_path: str, index: int = -1) -> bpy.types.FCurve | None:
    """The curve of `data_path`, or None. `index` is the component of an array; -1 is a property that is none."""
    channels = _channels(owner)
    return channels.fcurves.find(data_path, index=max(index, 0)) if channels is not None else None


def action_curve(owner: bpy.types.ID, data_path: str, index: int = -1, group: str = "") -> bpy.types.FCurve:
    """The curve of `data_path`, made if missing, in the channel group `group` if it is new. Needs `ensure_action`."""
    curve = find_curve(owner, data_path, index)
    if curve is None:
        channels = _channels(owner, create=True)
        curve = channels.fcurves.new(data_path, index=max(index, 0))
        if group:
            curve.group = channels.groups.get(group) or channels.groups.new(group)
    return curve


def remove_curve(owner: bpy.types.ID, data_path: str, index: int = -1) -> bool:
    """Removes the curve of `data_path`, and its channel group if nothing else is in it; whether there was one."""
    curve = find_curve(owner, data_path, index)
    if curve is not None:
        channels = _channels(owner)
        group = None if hasattr(owner.animation_data.action, "slots") else curve.group  # with slots Blender does it itself
        channels.fcurves.remove(curve)
        if group is not None and not len(group.channels):
            channels.groups.remove(group)
    return curve is not None


def drop_empty_animation(owner: bpy.types.ID) -> None:
    """Takes the owner's animation data away if nothing is left in it."""
    animation = owner.animation_data
    if animation and not (animation.drivers or animation.action or animation.nla_tracks):
        owner.animation_data_clear()


def set_keys(
    curve: bpy.types.FCurve, frames: Sequence[float], values: Sequence[float], interpolation: str = "LINEAR"
) -> None:
    """Makes `frames` (N,), increasing, and `values` (N,) all the keys of `curve`.

    `interpolation` is Blender's: CONSTANT, LINEAR, BEZIER (handles are AUTO_CLAMPED, which never overshoot).
    Raises ValueError for keys that are not finite, not increasing or not as many as values.
    """
    points = np.column_stack([np.asarray(frames, np.float64), np.asarray(values, np.float64)]).astype(np.float32)
    if not np.isfinite(points).all():
        raise ValueError(f"{curve.data_path}: a key is not a finite number")
    if np.any(np.diff(points[:, 0]) <= 0):  # as stored: what float32 cannot tell apart is one key
        raise ValueError(f"{curve.data_path}: the frames of keys must increase")
    keys = curve.keyframe_points
    keys.clear()
    keys.add(len(points))
    keys.foreach_set("co", points.ravel())
    _set_enum(keys, "interpolation", interpolation)
    if interpolation == "BEZIER":
        _set_enum(keys, "handle_left_type", "AUTO_CLAMPED")
        _set_enum(keys, "handle_right_type", "AUTO_CLAMPED")
    curve.update()


def _set_enum(keys: bpy.types.bpy_prop_collection, name: str, value: str) -> None:
    items = bpy.types.Keyframe.bl_rna.properties[name].enum_items
    keys.foreach_set(name, np.full(len(keys), items[value].value, np.int32))


def _channels(owner: bpy.types.ID, create: bool = False) -> bpy.types.bpy_struct | None:
    """What holds `fcurves` and `groups` for the owner: its action (4.2, 4.3) or the channelbag of its slot."""
    animation = owner.animation_data
    action = animation.action if animation else None
    if action is None:
        if create:
            raise ValueError(f"{owner.name}: has no action, make one first")
        return None
    if not hasattr(action, "slots"):
        return action
    slot = animation.action_slot
    if slot is None:
        if create:
            raise ValueError(f"{owner.name}: has no slot in '{action.name}', make one first")
        return None
    # Blender makes one layer of one keyframe strip as yet; what an add-on of the future adds is looked through too.
    strips = [strip for layer in action.layers for strip in layer.strips if strip.type == "KEYFRAME"]
    for strip in strips:
        if (bag := strip.channelbag(slot)) is not None:
            return bag
    if not create:
        return None
    if not strips:
        layer = action.layers[0] if action.layers else action.layers.new("Layer")
        strips = [layer.strips.new(type="KEYFRAME")]
    return strips[0].channelbag(slot, ensure=True)
