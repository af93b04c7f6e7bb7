"""The blood of a face as custom properties of its skin, driven live from the controls.

People see, key and bake one property a number. The material reads others, three numbers each, that follow them.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

import bpy

from ..domain.blood import (
    BLOOD,
    BLOOD_DRIVERS,
    FEATURE,
    MOOD_SUFFIX,
    PRESSURE_CONTROL,
    PULSE_CONTROL,
    Blood,
    BloodChannel,
)
from ..domain.effects.packed import NUMBERS, PREFIX, PRESSURE
from ..domain.facs import EMOTION_CONTROLS
from ..domain.files import validate
from ..domain.profile import Profile, with_profile
from ..domain.response import MAX_EXPRESSION, Response, Sum, driver_text
from .controls import CONTROL_BONE, describe, drive
from .curves import drop_empty_animation


# Partial sums of a channel, this many sliders each: 255 characters hold them with any values and short names.
_PART = "_part"
_PART_TERMS = 14


def blood_properties(face: bpy.types.Object) -> tuple[str, ...]:
    """The properties that people see and key, that drivers or a bake move, and that the material's own follow."""
    return tuple(name for name in _driven(face) if _PART not in name)


def _driven(face: bpy.types.Object) -> list[str]:
    """Those that depend on the rig: the above, and their partial sums."""
    return [name for name in _ours(face) if not name.startswith(PREFIX)]


def _ours(face: bpy.types.Object) -> list[str]:
    return [name for name in face.keys() if name.startswith("blood_") or name == PRESSURE]


def blood_sliders(armature: bpy.types.Object) -> tuple[str, ...]:
    """The sliders of a rig that move blood."""
    bone = armature.pose.bones[CONTROL_BONE]
    known = (*BLOOD_DRIVERS, *(name + MOOD_SUFFIX for name in EMOTION_CONTROLS), PULSE_CONTROL)
    return tuple(name for name in known if name in bone)


PROFILE = "sanguine_profile"
"""Custom property of a rig whose blood was measured: the profile as JSON, so that the file needs no other."""


def set_profile(armature: bpy.types.Object, profile: Profile | None) -> None:
    """Makes the rig's blood that of a profile; None: that of rigs/blood.toml. Apply the skin, or bake, after it."""
    if profile is not None:
        armature[PROFILE] = profile.model_dump_json()
    elif PROFILE in armature:
        del armature[PROFILE]


def blood_model(armature: bpy.types.Object) -> Blood:
    """What moves the blood of a rig. Raises InputError for a profile that this version cannot read."""
    if PROFILE not in armature:
        return BLOOD
    return with_profile(BLOOD, validate(Profile, json.loads(armature[PROFILE]), f"{armature.name}: {PROFILE}"))


def drive_settled(armature: bpy.types.Object, skin: bpy.types.Object, names: Collection[str]) -> None:
    """Puts the driven properties `names` on `skin`: blood as far as the rig moves it."""
    channels = blood_model(armature).channels(blood_sliders(armature)).values()
    drive_blood(armature, skin, [channel for channel in channels if channel.property_name in names])
    if PRESSURE in names:
        drive_pressure(armature, skin)


def drive_blood(
    armature: bpy.types.Object, skin: bpy.types.Object, channels: Iterable[BloodChannel]
) -> tuple[str, ...]:
    """Puts one driven custom property per channel on `skin`. Returns their names."""
    names = []
    for channel in channels:
        name, response = channel.property_name, channel.response
        what = "blood volume fraction" if channel.quantity == "hemoglobin" else "oxygenation"
        help = f"Change of {what} in the region {channel.region}, driven by the emotions"
        if channel.quantity == FEATURE:
            help = f"Strength of what has come out on the skin ({channel.region}), driven by a state of the body"
        skin[name] = 0.0
        describe(skin, name, help, *channel.reach, 0.0)
        skin.property_overridable_library_set(f'["{name}"]', True)
        if len(driver_text(response)[0]) < MAX_EXPRESSION:
            drive(skin, f'["{name}"]', response, armature)
        else:
            _drive_in_parts(armature, skin, name, response)
        names.append(name)
    return tuple(names)


def _drive_in_parts(armature: bpy.types.Object, skin: bpy.types.Object, name: str, response: Response) -> None:
    """A sum of too many sliders for one driver: partial sums are properties of their own."""
    parts = {}
    for i in range(0, len(response.terms), _PART_TERMS):
        part = f"{name}{_PART}{len(parts)}"
        parts[part] = Sum(response.terms[i : i + _PART_TERMS])
        skin[part] = 0.0
        drive(skin, f'["{part}"]', parts[part], armature)
    total = replace(response, terms=tuple((1.0, part) for part in parts))
    drive(skin, f'["{name}"]', total, armature, own=parts)


def drive_packed(skin: bpy.types.Object, packed: Mapping[str, tuple[str, ...]]) -> None:
    """Puts the properties that the material reads on `skin`, following those that people see (`Plan.packed`). What of
    these no rig moves is there as 0, to be set or keyed."""
    for name, parts in packed.items():
        skin[name] = [0.0] * NUMBERS
        read = ", ".join(filter(None, parts))
        skin.id_properties_ui(name).update(description=f"What the material reads. It follows {read}: key these instead")
        for i, part in enumerate(parts):
            if not part:
                continue
            if part not in skin:
                skin[part] = 0.0
                skin.property_overridable_library_set(f'["{part}"]', True)
            curve = skin.driver_add(f'["{name}"]', i)
            curve.keyframe_points.clear()  # as in controls.drive
            curve.driver.type = "SUM"  # of one: a copy, for which nothing is parsed
            variable = curve.driver.variables.new()
            variable.targets[0].id, variable.targets[0].data_path = skin, f'["{part}"]'


def drive_pressure(armature: bpy.types.Object, skin: bpy.types.Object) -> None:
    """The same for what presses on the skin, live without the time that the blood takes to come back."""
    skin[PRESSURE] = 0.0
    describe(skin, PRESSURE, "How hard it presses, driven by the slider", 0.0, 1.0, 0.0)
    skin.property_overridable_library_set(f'["{PRESSURE}"]', True)
    drive(skin, f'["{PRESSURE}"]', Response(((1.0, PRESSURE_CONTROL),)), armature)


def remove_blood(skin: bpy.types.Object) -> None:
    """Removes the properties of `drive_settled` and `drive_packed` and their drivers."""
    for name in _ours(skin):
        skin.driver_remove(f'["{name}"]')
        del skin[name]
    drop_empty_animation(skin)


def mute_blood(skin: bpy.types.Object, mute: bool) -> None:
    """Silences the drivers of the blood, or lets them speak again; unlike a removal, a library override keeps this. What
    the material reads goes on following."""
    ours = {f'["{name}"]' for name in _driven(skin)}
    for curve in skin.animation_data.drivers if skin.animation_data else ():
        if curve.data_path in ours:
            curve.mute = mute


def redrive_blood(armature: bpy.types.Object, skin: bpy.types.Object) -> None:
    """Drives the blood as the rig's sliders and profile now want it; what they leave still is 0."""
    kept = blood_properties(skin)
    for name in _driven(skin):
        skin.driver_remove(f'["{name}"]')
        if name in kept:
            skin[name] = 0.0
        else:
            del skin[name]
    drive_settled(armature, skin, kept)
