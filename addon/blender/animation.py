"""Operators of the animator: which emotions a rig has, blood in time, and poses for the Asset Browser."""

from __future__ import annotations

import bpy

from ..domain.blood import STATES
from ..domain.facs import EMOTION_CONTROLS, EMOTIONS
from ..domain.profile import read_profile
from .bake import RECORD, bake_blood, clear_bake
from .blood import blood_properties, redrive_blood, set_profile
from .controls import CONTROL_BONE, OPTIONAL, add_controls, drive_shape_keys, remove_emotion
from .operators import active_face, controls_of, emotion_bone, may_change, window_progress
from .poses import add_poses


def rig_of(context: bpy.types.Context) -> bpy.types.Object | None:
    """The armature with the controls of the active face."""
    face = active_face(context)
    return controls_of(face) if face is not None and emotion_bone(face) is not None else None


def _needs_controls(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    if not may_change(cls, active_face(context)):
        return False
    if rig_of(context) is None:
        cls.poll_message_set("The face has no controls yet: apply the skin first")
        return False
    return True


def _needs_own_controls(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """A library override takes new values for the sliders that it has, and forgets new sliders on saving."""
    if not _needs_controls(cls, context):
        return False
    if rig_of(context).override_library:
        cls.poll_message_set("The rig is a library override, which keeps no other sliders: change them in the file of the rig")
        return False
    return True


# Blender keeps no reference to the texts of a list made on the fly: they have to live here.
_LABELS = {
    **{name: (name.capitalize(), EMOTIONS[name].help) for name in EMOTION_CONTROLS},
    **{name: (row.label, row.help) for name, row in STATES.items()},
    **{name: (row.label, row.help) for name, row in OPTIONAL.items()},
}


# What is chosen is kept as its number, which must not depend on what else is in the list.
_ITEMS = [(name, label, help, "NONE", i) for i, (name, (label, help)) in enumerate(_LABELS.items())]


def _others(_operator: bpy.types.Operator, context: bpy.types.Context) -> list[tuple[str, str, str, str, int]]:
    return [item for item in _ITEMS if not _has(context, item[0])]


def _present(_operator: bpy.types.Operator, context: bpy.types.Context) -> list[tuple[str, str, str, str, int]]:
    return [item for item in _ITEMS if _has(context, item[0])]


def _has(context: bpy.types.Context, name: str) -> bool:
    face = active_face(context)
    bone = emotion_bone(face) if face else None
    return bone is not None and name in bone


class SANGUINE_OT_add_feeling(bpy.types.Operator):
    bl_idname = "sanguine.add_feeling"
    bl_label = "Add Emotion or State"
    bl_description = "Put the slider of an emotion or of a state of the body on the rig. What is not on it costs nothing"
    bl_options = {"REGISTER", "UNDO"}
    bl_property = "feeling"

    feeling: bpy.props.EnumProperty(name="Emotion", description="What the face may show", items=_others)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _needs_own_controls(cls, context)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        context.window_manager.invoke_search_popup(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        rig, name = rig_of(context), self.feeling
        emotions, states = ((name,), ()) if name in EMOTION_CONTROLS else ((), (name,))
        try:
            add_controls(rig, emotions, states)
            drive_shape_keys(rig, [child for child in rig.children if child.type == "MESH"])
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{_LABELS[name][0]} is on the rig. Apply the skin, so that its blood shows")
        return {"FINISHED"}


class SANGUINE_OT_remove_feeling(bpy.types.Operator):
    bl_idname = "sanguine.remove_feeling"
    bl_label = "Remove Emotion or State"
    bl_description = "Take a slider and all that follows from it off the rig. Its keyframes stay in the action"
    bl_options = {"REGISTER", "UNDO"}
    bl_property = "feeling"

    feeling: bpy.props.EnumProperty(name="Emotion", description="What goes", items=_present)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _needs_own_controls(cls, context)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        context.window_manager.invoke_search_popup(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        rig, face, name = rig_of(context), active_face(context), self.feeling
        try:
            clear_bake(face)
            remove_emotion(rig, name)
            drive_shape_keys(rig, [child for child in rig.children if child.type == "MESH"])
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        redrive_blood(rig, face)
        self.report({"INFO"}, f"{_LABELS[name][0]} is off the rig")
        return {"FINISHED"}


class SANGUINE_OT_bake_blood(bpy.types.Operator):
    bl_idname = "sanguine.bake_blood"
    bl_label = "Bake Blood"
    bl_description = (
        "Write the blood of the animated face as F-curves: it lags the muscles and leaves late, which drivers cannot do. "
        "Every frame then renders by itself, here or on a farm, with or without the add-on"
    )
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not _needs_controls(cls, context):
            return False
        if not blood_properties(active_face(context)):
            cls.poll_message_set("The skin reads no blood: apply it with an emotion or a state on the rig")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            with window_progress(context) as progress:
                first, last = bake_blood(active_face(context), rig_of(context), context.scene, progress)
        except (ValueError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Blood baked from frame {first} to {last}")
        return {"FINISHED"}


class SANGUINE_OT_clear_blood(bpy.types.Operator):
    bl_idname = "sanguine.clear_blood"
    bl_label = "Clear Baked Blood"
    bl_description = "Remove the baked curves; the viewport shows the settled answer of the blood again"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not may_change(cls, active_face(context)):
            return False
        if RECORD not in active_face(context):
            cls.poll_message_set("No blood is baked")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        clear_bake(active_face(context))
        return {"FINISHED"}


class SANGUINE_OT_load_profile(bpy.types.Operator):
    bl_idname = "sanguine.load_profile"
    bl_label = "Load Blood Profile"
    bl_description = (
        "Let the face's blood follow what was measured: a profile of `sanguine physiology`. It is kept in the rig. "
        "Without a file, the blood is that of the built-in table again"
    )
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(name="File", subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _needs_own_controls(cls, context)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        rig, face = rig_of(context), active_face(context)
        try:
            profile = read_profile(bpy.path.abspath(self.filepath)) if self.filepath else None
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        set_profile(rig, profile)
        if RECORD not in face:  # baked blood turns stale, and shows it
            redrive_blood(rig, face)
        told = f"{len(profile.rows)} measured changes of {profile.subjects} subjects" if profile else "The built-in table"
        self.report({"INFO"}, f"{told}. Apply the skin, so that its colours reach as far")
        return {"FINISHED"}


class SANGUINE_OT_add_poses(bpy.types.Operator):
    bl_idname = "sanguine.add_poses"
    bl_label = "Add Poses of Emotions"
    bl_description = "Add the rig's emotions, subtle, full and extreme, to the Asset Browser as poses of the control bone"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _needs_controls(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        made = add_poses(rig_of(context))
        self.report({"INFO"}, f"{len(made)} poses in the Asset Browser, of the bone {CONTROL_BONE}")
        return {"FINISHED"}


CLASSES = (
    SANGUINE_OT_add_feeling,
    SANGUINE_OT_remove_feeling,
    SANGUINE_OT_bake_blood,
    SANGUINE_OT_clear_blood,
    SANGUINE_OT_load_profile,
    SANGUINE_OT_add_poses,
)
