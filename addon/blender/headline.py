"""The first row of the panel: which emotion, how much of it. Both are views of the rig's sliders, which stay the truth.

What is kept here is only the emotion that was chosen last: with all sliders at 0 nothing else says which one the
intensity is to move.
"""

from __future__ import annotations

import bpy

from ..domain.facs import EMOTION_CONTROLS, EMOTION_MAX, EMOTIONS
from .controls import CONTROL_BONE, control_path, controls_of, emotions_of
from .curves import find_curve

NEUTRAL, MIX = "NEUTRAL", "MIX"

# A mix that is pulled to nothing would forget what it is of.
_LEAST_OF_A_MIX = 0.01

# Blender keeps no reference to texts of a list made on the fly, and shows a choice by its number: both are fixed here.
_ITEMS = {
    name: (name, label, help, "NONE", i)
    for i, (name, label, help) in enumerate(
        [
            (NEUTRAL, "Neutral", "No emotion: every emotion's slider to 0"),
            (MIX, "Mix", "Several emotions at once, by their sliders"),
            *((name, name.capitalize(), EMOTIONS[name].help) for name in EMOTION_CONTROLS),
        ]
    )
}
_NAMES = list(_ITEMS)


def rig_with_sliders(face: bpy.types.Object) -> bpy.types.Object | None:
    """The face's rig, if it has the control bone."""
    rig = controls_of(face)
    return rig if rig is not None and rig.pose is not None and CONTROL_BONE in rig.pose.bones else None


def shown_emotions(rig: bpy.types.Object) -> dict[str, float]:
    """The emotions whose sliders are not at 0."""
    bone = rig.pose.bones[CONTROL_BONE]
    return {name: bone[name] for name in emotions_of(rig) if bone[name] > 0.0}


def emotion_of(face: bpy.types.Object) -> str:
    """The one emotion that shows, MIX of several, and of none the one chosen last, or NEUTRAL."""
    rig = rig_with_sliders(face)
    shown = shown_emotions(rig) if rig is not None else {}
    if len(shown) > 1:
        return MIX
    last = face.sanguine.last_emotion
    return next(iter(shown), last if rig is not None and last in emotions_of(rig) else NEUTRAL)


def animated_emotions(rig: bpy.types.Object) -> list[str]:
    """Those that curves or drivers move: what is set here they take back at the next frame."""
    return [name for name in emotions_of(rig) if find_curve(rig, control_path(name)) is not None or _is_driven(rig, name)]


def _is_driven(rig: bpy.types.Object, name: str) -> bool:
    return rig.animation_data is not None and rig.animation_data.drivers.find(control_path(name)) is not None


def _items(settings: bpy.types.PropertyGroup, _context: bpy.types.Context | None) -> list[tuple[str, str, str, str, int]]:
    rig = rig_with_sliders(settings.id_data)
    present = emotions_of(rig) if rig is not None else ()
    mixed = [MIX] if emotion_of(settings.id_data) == MIX else []
    return [_ITEMS[name] for name in (NEUTRAL, *mixed, *present)]


def _get_emotion(settings: bpy.types.PropertyGroup) -> int:
    return _NAMES.index(emotion_of(settings.id_data))


def _set_emotion(settings: bpy.types.PropertyGroup, number: int) -> None:
    rig, name = rig_with_sliders(settings.id_data), _NAMES[number]
    if rig is None or name == MIX:
        return
    intensity = max(shown_emotions(rig).values(), default=1.0)
    _move(rig, {other: intensity if other == name else 0.0 for other in emotions_of(rig)})
    settings.last_emotion = "" if name == NEUTRAL else name


def _get_intensity(settings: bpy.types.PropertyGroup) -> float:
    rig = rig_with_sliders(settings.id_data)
    return max(shown_emotions(rig).values(), default=0.0) if rig is not None else 0.0


def _set_intensity(settings: bpy.types.PropertyGroup, value: float) -> None:
    rig, name = rig_with_sliders(settings.id_data), emotion_of(settings.id_data)
    if rig is None or name == NEUTRAL:
        return
    if name == MIX:
        shown = shown_emotions(rig)
        factor = max(value, _LEAST_OF_A_MIX) / max(shown.values())
        _move(rig, {emotion: factor * before for emotion, before in shown.items()})
    else:
        settings.last_emotion = name
        _move(rig, {name: value})


def _move(rig: bpy.types.Object, values: dict[str, float]) -> None:
    """Sets sliders as a hand would. A linked rig stays as it is, and so does a slider that a driver holds."""
    if rig.library is not None:
        return
    bone = rig.pose.bones[CONTROL_BONE]
    for name, value in values.items():
        if not _is_driven(rig, name):
            bone[name] = min(float(value), EMOTION_MAX)
    rig.update_tag()


def properties() -> dict[str, object]:
    """For the property group of a face."""
    return {
        # Not animatable: keys belong to the sliders, which these two only move.
        "emotion": bpy.props.EnumProperty(
            name="Emotion",
            description="Show this emotion, as strongly as the one before (fully, after a neutral face): its slider takes over, "
            "the other emotions' go to 0. To key it, or to mix, use the sliders in Blood. A slider that is animated goes "
            "back to its curve at the next frame",
            items=_items,
            get=_get_emotion,
            set=_set_emotion,
            options=set(),
        ),
        "intensity": bpy.props.FloatProperty(
            name="Intensity",
            description="How much of the emotion shows, 0 to 1.5: 0.25 subtle, 1 full, 1.5 extreme. It moves the emotion's slider; "
            "a mix keeps its proportions. Key the sliders in Blood",
            min=0.0,
            max=EMOTION_MAX,
            precision=2,
            step=1,
            get=_get_intensity,
            set=_set_intensity,
            options=set(),
        ),
        "last_emotion": bpy.props.StringProperty(
            name="Last Emotion", description="The emotion that the intensity moves while every slider is at 0",
            options={"HIDDEN"}, override={"LIBRARY_OVERRIDABLE"},
        ),
    }
