"""Import Capture: a recorded face as an action on the control bone.

What animates the rig already is pushed down into an NLA strip of its own and plays on below, so the take replaces only
the controls that it holds. The curves are ordinary ones: a file with them plays without the add-on.
"""

from __future__ import annotations

import time

import bpy

from ..app.capture import Performance, capture
from ..domain.blood import MOOD_SUFFIX
from ..domain.errors import InputError
from .bake import RECORD
from .blood import blood_properties, drive_settled
from .controls import CONTROL_BONE, add_controls, emotions_of
from .curves import action_curve, ensure_action, set_keys
from .operators import active_face, controls_of, emotion_bone

GROUP = "Capture"


def import_performance(
    rig: bpy.types.Object, performance: Performance, start: int = 1
) -> tuple[bpy.types.Action, tuple[str, ...]]:
    """Makes `performance` the action of `rig`, its first frame at `start`.

    Sliders that the rig lacks are added, but not on a library override, which forgets them on saving. Returns the
    action and the controls that had to be left out. Raises ValueError where Blender cannot take it, with nothing
    changed.
    """
    if rig.library is not None:
        raise InputError(f"{rig.name}: linked from another file: make a library override of it first")
    animation = rig.animation_data or rig.animation_data_create()
    if animation.use_tweak_mode:
        raise InputError(f"{rig.name}: an NLA strip is being edited: leave tweak mode first")
    if rig.override_library is None:
        _add_sliders(rig, performance)
    bone = rig.pose.bones[CONTROL_BONE]
    _push_down(animation)
    action = ensure_action(rig, performance.name)
    for name, (frames, values) in performance.controls.items():
        if name in bone:
            curve = action_curve(rig, f'pose.bones["{CONTROL_BONE}"]["{name}"]', group=GROUP)
            set_keys(curve, frames + start, values)
    rig.update_tag()
    return action, tuple(name for name in performance.controls if name not in bone)


def _add_sliders(rig: bpy.types.Object, performance: Performance) -> None:
    """Sides of units, and the blood of inferred emotions without their muscles, which the rig's skins then hear."""
    moods = [name for name in performance.controls if name.endswith(MOOD_SUFFIX)]
    new = [name for name in moods if name not in rig.pose.bones[CONTROL_BONE]]
    add_controls(rig, emotions_of(rig), moods)
    for face in rig.children if new else ():
        if face.type == "MESH" and RECORD not in face and (names := blood_properties(face)):  # baked blood turns stale
            drive_settled(rig, face, names)


def _push_down(animation: bpy.types.AnimData) -> None:
    """The active action into a strip on a track of its own, blended as it was, so that nothing of it is lost."""
    action = animation.action
    if action is None:
        return
    slot = getattr(animation, "action_slot", None)
    first, last = action.frame_range
    track = animation.nla_tracks.new()
    track.name = action.name
    strip = track.strips.new(action.name, int(first), action)
    if slot is not None:
        strip.action_slot = slot
    if last > first:  # a strip starts on whole frames, an action need not
        strip.frame_start, strip.frame_end = first, last
        strip.action_frame_start, strip.action_frame_end = first, last
    strip.extrapolation = animation.action_extrapolation
    strip.blend_type = animation.action_blend_type
    strip.influence = animation.action_influence
    animation.action = None


class SANGUINE_OT_import_capture(bpy.types.Operator):
    bl_idname = "sanguine.import_capture"
    bl_label = "Import Capture"
    bl_description = (
        "Make a recorded face (Live Link Face, OpenFace or MediaPipe CSV) the animation of the active face's controls: "
        "action units, head and eyes, and the blood of the emotions that the face shows. Other animation is pushed "
        "down, not replaced"
    )
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(name="File", subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(default="*.csv", options={"HIDDEN"})
    start: bpy.props.IntProperty(name="Start Frame", description="Where the take begins", default=1)
    smooth: bpy.props.FloatProperty(
        name="Smoothing",
        description="Window in seconds; 0.1 takes a tracker's noise. There is no delay",
        min=0.0,
        max=2.0,
        soft_max=0.5,
        default=0.0,
        step=1,
        precision=2,
    )
    reduce: bpy.props.FloatProperty(
        name="Fewer Keys",
        description="Leave out keys as long as no value is off by more than this; 0 keys every frame",
        min=0.0,
        max=0.5,
        soft_max=0.05,
        default=0.0,
        step=0.1,
        precision=3,
    )
    emotions: bpy.props.BoolProperty(
        name="Infer Emotions",
        description="Let the blood of the rig's emotions follow what the face shows",
        default=True,
    )
    head: bpy.props.BoolProperty(name="Head", description="Turn the head too, by units 51 to 56", default=True)
    source_fps: bpy.props.FloatProperty(
        name="Recorded at",
        description="Frames per second of a recording that does not tell the time; 0 finds out",
        min=0.0,
        max=1000.0,
        default=0.0,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        face = active_face(context)
        if context.mode not in {"OBJECT", "POSE"}:
            cls.poll_message_set("Leave to object or pose mode first")
        elif face is None:
            cls.poll_message_set("Select a face: a mesh object, or its armature")
        elif emotion_bone(face) is None:
            cls.poll_message_set("The face has no controls yet: apply the skin first")
        elif controls_of(face).library is not None:
            cls.poll_message_set("The rig is linked: override its library first")
        elif (animation := controls_of(face).animation_data) is not None and animation.use_tweak_mode:
            cls.poll_message_set("Leave the NLA's tweak mode first")
        else:
            return True
        return False

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        self.start = context.scene.frame_current
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        rig = controls_of(active_face(context))
        render = context.scene.render
        began = time.perf_counter()
        try:
            performance = capture(
                bpy.path.abspath(self.filepath),
                fps=render.fps / render.fps_base,
                smooth_s=self.smooth,
                emotions=emotions_of(rig) if self.emotions else (),
                source_fps=self.source_fps or None,
                reduce=self.reduce,
                head=self.head,
            )
            _, left_out = import_performance(rig, performance, self.start)
        except (ValueError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        notes = list(performance.notes)
        if (
            performance.head_deg
            and self.head
            and not any('"].rotation_' in curve.data_path for curve in rig.animation_data.drivers)
        ):
            notes.append("the take turns the head, but the head's units move no bone of this rig")
        if left_out:
            notes.append(
                f"{', '.join(left_out)}: left out, the linked rig has no such sliders: add them in its own file"
            )
        for note in notes:
            self.report({"INFO"}, note)
        felt = ", ".join(f"{name} {level:.2f}" for name, level in performance.emotions().items())
        self.report(
            {"INFO"},
            f"{performance.name}: {performance.seconds:.1f} s at {performance.source_fps:g} frames a second on frames "
            f"{self.start} to {self.start + performance.frames - 1}, {len(performance.controls)} controls, "
            f"in {time.perf_counter() - began:.1f} s" + (f"; the blood follows {felt}" if felt else ""),
        )
        return {"FINISHED"}


CLASSES = (SANGUINE_OT_import_capture,)
