"""Bake Blood: the blood of an animated face in time, as ordinary F-curves on its skin.

What blood remembers fits in no driver, so the viewport shows the settled answer until the blood is baked. The curves
stand in for the drivers, which are muted: they play and render anywhere, without the add-on, each frame for itself.
What they were computed from is kept as a fingerprint, so that a later change of the animation shows.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ..domain.blood import BLOOD, BLOOD_CONTROL, HEART_RATE_CONTROL, PACE_CONTROL, PRESSURE_CONTROL, blood_property
from ..domain.effects.packed import PRESSURE
from ..domain.errors import InputError
from ..domain.vascular import VASCULAR, Controls, blood_over_time, pressure_over_time
from .blood import PROFILE, blood_model, blood_properties, blood_sliders, mute_blood
from .controls import CONTROL_BONE
from .curves import action_curve, curves, ensure_action, remove_curve, set_keys

RECORD = "sanguine_bake"
"""Custom property of a baked face: what was baked, and from what."""

_TABLES = hashlib.sha256(repr((BLOOD, VASCULAR)).encode()).hexdigest()


@dataclass(frozen=True)
class BakeState:
    """baked: whether the face plays baked blood. stale: why it is not what the animation asks for now, "" if it is.
    driven: whether drivers move a slider, whose own animation the fingerprint does not see."""

    baked: bool
    stale: str = ""
    driven: bool = False


def bake_blood(
    face: bpy.types.Object,
    armature: bpy.types.Object,
    scene: bpy.types.Scene,
    progress: Callable[[int, int], bool] | None = None,
) -> tuple[int, int]:
    """Bakes the scene's frames, and those before them that are keyed already. Returns the first and the last frame.

    progress: called with frames done and to do; False stops it and leaves everything as it was, by KeyboardInterrupt.
    Raises InputError for a face whose material reads no blood.
    """
    if not blood_properties(face):
        raise InputError(f"{face.name}: its material reads no blood: apply the skin with an emotion or a state first")
    first, last = _range(armature, scene)
    print_of_inputs = fingerprint(armature, scene)
    frames = np.arange(first, last + 1)
    values = sample(armature, scene, frames, progress)
    controls = Controls(frames * (scene.render.fps_base / scene.render.fps), values)
    changes = {blood_property(quantity, region): c for (region, quantity), c in blood_over_time(controls, blood_model(armature)).items()}
    if PRESSURE_CONTROL in values:
        changes[PRESSURE] = pressure_over_time(controls, values[PRESSURE_CONTROL])
    write_blood(face, frames, changes)
    face[RECORD] = {"of": print_of_inputs, "first": first, "last": last}
    return first, last


def write_blood(face: bpy.types.Object, frames: np.ndarray, changes: Mapping[str, np.ndarray]) -> None:
    """Puts the changes, by property, on the face as curves, in the place of its drivers. What does not change gets none."""
    ensure_action(face, f"{face.name} blood")
    mute_blood(face, True)
    for name in blood_properties(face):
        path = f'["{name}"]'
        remove_curve(face, path)
        series = changes.get(name)
        face[name] = 0.0  # not what its driver has left there
        if series is not None and np.any(series):
            set_keys(action_curve(face, path, group="Blood"), *_without_still(frames, series))


def clear_bake(face: bpy.types.Object) -> None:
    """Takes the curves away and lets the drivers give the settled answer again."""
    if RECORD not in face:
        return
    del face[RECORD]
    for name in blood_properties(face):
        remove_curve(face, f'["{name}"]')
        face[name] = 0.0
    animation = face.animation_data
    if animation and animation.action and not curves(face):
        action = animation.action
        animation.action = None
        if not action.users or (action.users == 1 and action.use_fake_user):
            bpy.data.actions.remove(action)
    mute_blood(face, False)
    face.update_tag()


def bake_state(face: bpy.types.Object, armature: bpy.types.Object, scene: bpy.types.Scene) -> BakeState:
    """Cheap enough for a panel: compares curves, not frames."""
    if RECORD not in face:
        return BakeState(False)
    record = face[RECORD]
    first, last = _range(armature, scene)
    if first < record["first"] or last > record["last"]:
        return BakeState(True, f"it covers frames {record['first']} to {record['last']}, not {first} to {last}")
    if record["of"] != fingerprint(armature, scene):
        return BakeState(True, "the animation, the frame rate or the model has changed since")
    return BakeState(True, driven=bool(_drivers(armature)))


def sample(
    armature: bpy.types.Object,
    scene: bpy.types.Scene,
    frames: np.ndarray,
    progress: Callable[[int, int], bool] | None = None,
) -> dict[str, np.ndarray]:
    """What every slider that moves blood is at each frame, whatever animates it: curves, the NLA, drivers.

    The armature is evaluated alone, in a scene of its own: no mesh is deformed for this.
    """
    names = _sliders(armature)
    values = np.empty((len(frames), len(names)))
    alone = bpy.data.scenes.new("sanguine bake")
    try:
        alone.render.fps, alone.render.fps_base = scene.render.fps, scene.render.fps_base
        alone.collection.objects.link(armature)
        for i, frame in enumerate(frames):
            alone.frame_set(int(frame))
            bone = armature.evaluated_get(alone.view_layers[0].depsgraph).pose.bones[CONTROL_BONE]
            values[i] = [bone[name] for name in names]
            if progress is not None and i % 100 == 0 and not progress(i, len(frames)):
                raise KeyboardInterrupt
    finally:
        bpy.data.scenes.remove(alone)
    return {name: values[:, i] for i, name in enumerate(names)}


def fingerprint(armature: bpy.types.Object, scene: bpy.types.Scene) -> str:
    """Changes with whatever the bake depends on: curves, strips, drivers and values of the sliders, rate, model."""
    bone = armature.pose.bones[CONTROL_BONE]
    animation = armature.animation_data
    animating = _slider_curves(armature)
    animated = {curve.data_path for curve in animating}
    strips = _strips(animation)
    still = {name: float(bone[name]) for name in _sliders(armature) if not strips and _path(name) not in animated}
    what = [
        _TABLES,
        armature.get(PROFILE, ""),
        scene.render.fps / scene.render.fps_base,
        still,
        [_curve_print(curve) for curve in animating],
        [_properties(strip) for strip in strips],
        [_driver_print(curve) for curve in _drivers(armature)],
    ]
    return hashlib.sha256(json.dumps(what, sort_keys=True, default=str).encode()).hexdigest()


def _range(armature: bpy.types.Object, scene: bpy.types.Scene) -> tuple[int, int]:
    """The scene's frames, from the first key on if that is earlier: blood remembers what was before."""
    keyed = [curve.range()[0] for curve in _slider_curves(armature)]
    keyed += [strip.frame_start for strip in _strips(armature.animation_data)]
    return min([scene.frame_start, *(int(np.floor(frame)) for frame in keyed)]), scene.frame_end


def _sliders(armature: bpy.types.Object) -> list[str]:
    """What the blood depends on."""
    bone = armature.pose.bones[CONTROL_BONE]
    return [n for n in (*blood_sliders(armature), BLOOD_CONTROL, PACE_CONTROL, HEART_RATE_CONTROL, PRESSURE_CONTROL) if n in bone]


def _path(slider: str) -> str:
    return f'pose.bones["{CONTROL_BONE}"]["{slider}"]'


def _slider_curves(armature: bpy.types.Object) -> list[bpy.types.FCurve]:
    paths = {_path(name) for name in _sliders(armature)}
    return [curve for curve in curves(armature) if curve.data_path in paths and len(curve.keyframe_points)]


def _drivers(armature: bpy.types.Object) -> list[bpy.types.FCurve]:
    """Somebody else's, that move sliders."""
    paths = {_path(name) for name in _sliders(armature)}
    animation = armature.animation_data
    return [curve for curve in animation.drivers if curve.data_path in paths] if animation else []


def _strips(animation: bpy.types.AnimData | None) -> list[bpy.types.NlaStrip]:
    return [strip for track in animation.nla_tracks if not track.mute for strip in track.strips] if animation else []


def _curve_print(curve: bpy.types.FCurve) -> list[Any]:
    points = curve.keyframe_points
    digest = hashlib.sha256()
    for name in ("co", "handle_left", "handle_right"):
        numbers = np.empty(2 * len(points), np.float32)
        points.foreach_get(name, numbers)
        digest.update(numbers)
    for name in ("interpolation", "easing"):
        kinds = np.empty(len(points), np.int32)
        points.foreach_get(name, kinds)
        digest.update(kinds)
    return [curve.data_path, curve.mute, curve.extrapolation, digest.hexdigest(),
            [_properties(modifier) for modifier in curve.modifiers]]


def _driver_print(curve: bpy.types.FCurve) -> list[Any]:
    driver = curve.driver
    targets = [(v.name, str(t.id and t.id.name), t.data_path) for v in driver.variables for t in v.targets]
    return [curve.data_path, driver.type, driver.expression, targets]


def _properties(item: bpy.types.bpy_struct) -> dict[str, Any]:
    """Plain settings of a modifier or strip, and the curves that it plays."""
    found: dict[str, Any] = {}
    for prop in item.bl_rna.properties:
        if prop.type in ("FLOAT", "INT", "BOOLEAN", "ENUM") and prop.identifier not in ("active", "select", "show_expanded"):
            value = getattr(item, prop.identifier)
            found[prop.identifier] = list(value) if getattr(prop, "is_array", False) else value
    action = getattr(item, "action", None)
    if action is not None:
        found["curves"] = [_curve_print(curve) for curve in _action_curves(action)]
    return found


def _action_curves(action: bpy.types.Action) -> Iterator[bpy.types.FCurve]:
    if not hasattr(action, "layers"):
        yield from action.fcurves
        return
    for layer in action.layers:
        for strip in layer.strips:
            for bag in strip.channelbags:
                yield from bag.fcurves


def _without_still(frames: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Keys that lie on the line between their neighbours, as stored, say nothing: left out where nothing moves at all."""
    v = values.astype(np.float32)
    still = np.zeros(len(v), bool)
    still[1:-1] = (v[1:-1] == v[:-2]) & (v[1:-1] == v[2:])
    return frames[~still], v[~still]
