"""The blood of a face as custom properties of its skin, which the material reads: driven live from the controls."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import bpy

from ..domain.blood import BLOOD, BLOOD_DRIVERS, MOOD_SUFFIX, PRESSURE_CONTROL, PULSE_CONTROL, BloodChannel
from ..domain.effects import pressure
from ..domain.facs import EMOTION_CONTROLS
from ..domain.response import Response
from .controls import CONTROL_BONE, describe, drive


def blood_properties(face: bpy.types.Object) -> tuple[str, ...]:
    """The properties by which the material of a face reads its blood."""
    return tuple(name for name in face.keys() if name.startswith("blood_") or name == pressure.PROPERTY)


def blood_sliders(armature: bpy.types.Object) -> tuple[str, ...]:
    """The sliders of a rig that move blood."""
    bone = armature.pose.bones[CONTROL_BONE]
    known = (*BLOOD_DRIVERS, *(name + MOOD_SUFFIX for name in EMOTION_CONTROLS), PULSE_CONTROL)
    return tuple(name for name in known if name in bone)


def drive_settled(armature: bpy.types.Object, skin: bpy.types.Object, names: Collection[str]) -> None:
    """Puts the driven properties `names`, those that a material reads, on `skin`: blood as far as the rig moves it."""
    channels = BLOOD.channels(blood_sliders(armature)).values()
    drive_blood(armature, skin, [channel for channel in channels if channel.property_name in names])
    if pressure.PROPERTY in names:
        drive_pressure(armature, skin)


def drive_blood(
    armature: bpy.types.Object, skin: bpy.types.Object, channels: Iterable[BloodChannel]
) -> tuple[str, ...]:
    """Puts one driven custom property per channel on `skin`, for the material to read. Returns their names."""
    names = []
    for channel in channels:
        name, response = channel.property_name, channel.response
        skin[name] = 0.0
        what = "blood volume fraction" if channel.quantity == "hemoglobin" else "oxygenation"
        describe(skin, name, f"Change of {what} in the region {channel.region}, driven by the emotions", *channel.reach, 0.0)
        drive(skin, f'["{name}"]', response, armature)
        names.append(name)
    return tuple(names)


def drive_pressure(armature: bpy.types.Object, skin: bpy.types.Object) -> None:
    """The same for what presses on the skin, live without the time that the blood takes to come back."""
    skin[pressure.PROPERTY] = 0.0
    describe(skin, pressure.PROPERTY, "How hard it presses, driven by the slider", 0.0, 1.0, 0.0)
    drive(skin, f'["{pressure.PROPERTY}"]', Response(((1.0, PRESSURE_CONTROL),)), armature)


def remove_blood(skin: bpy.types.Object) -> None:
    """Removes the properties of `drive_settled` and their drivers."""
    for name in blood_properties(skin):
        skin.driver_remove(f'["{name}"]')
        del skin[name]
    animation = skin.animation_data
    if animation and not (animation.drivers or animation.action or animation.nla_tracks):
        skin.animation_data_clear()
