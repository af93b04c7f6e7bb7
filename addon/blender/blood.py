"""The blood of a face as custom properties of its skin, which the material reads: driven live from the controls."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ..domain.blood import BLOOD_CONTROL_MAX, BloodChannel
from .controls import describe, drive, remove_drivers


def drive_blood(
    armature: bpy.types.Object, skin: bpy.types.Object, channels: Iterable[BloodChannel]
) -> tuple[str, ...]:
    """Puts one driven custom property per channel on `skin`, for the material to read. Returns their names."""
    names = []
    for channel in channels:
        name, response = channel.property_name, channel.response
        limits = BLOOD_CONTROL_MAX * response.low, BLOOD_CONTROL_MAX * response.high
        skin[name] = 0.0
        what = "blood volume fraction" if channel.quantity == "hemoglobin" else "oxygenation"
        describe(skin, name, f"Change of {what} in the {channel.region}, driven by the emotions", *limits, 0.0)
        drive(skin, f'["{name}"]', response, armature)
        names.append(name)
    return tuple(names)


def remove_blood(armature: bpy.types.Object, skin: bpy.types.Object) -> None:
    """Removes the drivers of `drive_blood` and the properties they drove."""
    for path in remove_drivers(skin, armature):
        del skin[path.removeprefix('["').removesuffix('"]')]
