"""Adopt Character and Remove Sanguine: one button puts skin, controls and drivers on the face that an artist has, one
takes them off again."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import sanguine_core

from ..app.tasks import Tasks, TaskRunner, run_tasks
from ..domain.effects import EFFECTS
from ..domain.facs import ARKIT
from ..domain.naming import recognise
from ..domain.parameters import PARAMETERS
from ..domain.people import SEXES, TONES, person
from .albedo import picture_tasks
from .controls import CONTROL_BONE
from .material import MARK
from .operators import (
    SHADING,
    active_face,
    albedo_of,
    live_plan,
    may_change,
    new_rig,
    put_controls,
    shading_of,
    tell_up_to_date,
    window_progress,
)
from .properties import growth_of, measure_maps, set_person, strength_property
from .removal import Change, all_or_nothing, controls_of, has_skin, remove_skin
from .skin import skin_slot, skin_tasks
from .surface import find_face_regions, size_of_head

_TICK_S = 0.05
_EXPECTED = (ValueError, RuntimeError, sanguine_core.Cancelled)


@dataclass
class Adopted:
    """What became of a face: lines for people, and those that they should mind."""

    lines: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def adopt_tasks(context: bpy.types.Context, face: bpy.types.Object, tone: str, shading: str) -> Tasks:
    """Recognises a face, reads its picture or draws a person, and gives it skin, controls and drivers. Returns Adopted.

    Raises InputError for a face that cannot have them. What is half done then is the caller's to undo (`Change`).
    """
    said = Adopted()
    context.view_layer.update()  # scales that a script has just set count too
    _say_names(face, said)
    size = size_of_head(face)
    (said.lines if size.factor == 1.0 else said.warnings).append(size.line)
    slot, image = skin_slot(face), albedo_of(face)
    if image is not None and image.size[0]:
        found = yield from picture_tasks(face, image, shading)
        said.lines.append(f"{image.name}: {found}")
    else:
        if image is not None:
            said.warnings.append(f"{image.name}: no pixels, its file is missing: the skin is drawn, not read")
        said.lines.append(_draw_person(face, tone))
    rig = controls_of(face) or new_rig(context, face)
    driven = put_controls(rig, face)
    said.warnings += driven.occupied and [f"{len(driven.occupied)} shape keys are driven by something else, and left alone"]
    _say_missing(context.scene, face, rig, said)
    measure_maps(face)
    if regions := find_face_regions(face):
        (said.lines if regions.startswith("regions found") else said.warnings).append(regions)
    plan = live_plan(face)
    chosen = shading_of(context.scene, face)
    material = yield from skin_tasks(face, rig, plan, slot, shading=chosen.shading)
    running = ", ".join(effect.label for effect in plan.active)
    said.lines.append(f"{running}; {material[MARK]['entries']} skins solved; {len(driven.driven)} shape keys driven")
    said.lines.append(chosen.line)
    return said


def _say_names(face: bpy.types.Object, said: Adopted) -> None:
    names = [block.name for block in face.data.shape_keys.key_blocks[1:]] if face.data.shape_keys else []
    found = recognise(names)
    if found.convention is None:
        why = f"none of {len(names)} shape keys is known" if names else "the face has no shape keys"
        said.warnings.append(f"{why}: sliders move its blood, not its shape")
        return
    said.lines.append(f"{found.convention} names: {len(found.mapping)} of {len(names)} shape keys are known")


def _say_missing(scene: bpy.types.Scene, face: bpy.types.Object, rig: bpy.types.Object, said: Adopted) -> None:
    """Which of ARKit's keys no mesh of the rig has, and where else they are: tongue and teeth are often meshes apart.

    Those are not driven unasked: whether a mesh beside the rig is of the same character, its names do not tell.
    """
    followed = {face, *rig.children}
    if not (own := _expressed(face)):
        return  # said already: nothing of the face is known
    here = own.union(*map(_expressed, followed))
    missing, elsewhere = [key for key in ARKIT.keys if key not in here], set()
    for mesh in scene.objects:
        if mesh in followed or has_skin(mesh) or not (held := [key for key in missing if key in _expressed(mesh)]):
            continue
        elsewhere.update(held)
        said.warnings.append(
            f"'{mesh.name}' has {_few(held)}, and is not on the rig: if it is this character's, parent it to '{rig.name}' and "
            "apply the skin"
        )
    if rest := [key for key in missing if key not in elsewhere]:
        said.lines.append(f"no mesh has a shape key for {_few(rest)}: these stay still")


def _expressed(mesh: bpy.types.Object) -> frozenset[str]:
    """The ARKit keys that a mesh's shape keys do the work of."""
    keys = getattr(mesh.data, "shape_keys", None) if mesh.type == "MESH" else None
    found = recognise([block.name for block in keys.key_blocks[1:]] if keys else ())
    return frozenset(ARKIT.keys) - set(found.missing) if found.convention else frozenset()


def _few(names: list[str], shown: int = 6) -> str:
    more = len(names) - shown
    return ", ".join(names[:shown]) + (f" and {more} more" if more > 0 else "")


def _draw_person(face: bpy.types.Object, tone: str) -> str:
    """A person of the panel's individual, age, sun and sex; what somebody has set about the skin already stays."""
    strengths = [strength_property(effect.id) for effect in EFFECTS if effect.default_strength is not None]
    if any(face.sanguine.is_property_set(name) for name in (*PARAMETERS, *strengths)):
        return "no picture in its material: the skin of the panel"
    growth = growth_of(face)
    sex = min(SEXES, key=lambda name: abs(SEXES[name] - growth.masculinity))
    drawn = person(tone, sex, growth.age_years, growth.seed, growth.sun)
    set_person(face, drawn)
    return f"no picture in its material: an individual is drawn, {TONES[tone].label}, ITA {drawn.ita:.0f} degrees"


def _may_adopt(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Whether the active face, and its rig, are the file's own."""
    face = active_face(context)
    if context.mode != "OBJECT":
        cls.poll_message_set("Leave to object mode first")
        return False
    if not may_change(cls, face):
        return False
    rig = controls_of(face)
    if face.override_library or face.data.override_library:
        cls.poll_message_set("The face is a library override: make it local first")
    elif rig is not None and (rig.library or rig.override_library or rig.data.library) and CONTROL_BONE not in rig.data.bones:
        cls.poll_message_set("The face's rig is linked, so it can get no controls: make it local first")
    else:
        return True
    return False


class SANGUINE_OT_adopt(bpy.types.Operator):
    bl_idname = "sanguine.adopt"
    bl_label = "Adopt Character"
    bl_description = (
        "Give the active face all at once: its shape keys are recognised, blood and pigment are read from its material's "
        "picture or drawn, and skin, sliders and drivers are made. Esc stops it and leaves the file as it was"
    )
    bl_options = {"REGISTER", "UNDO"}

    tone: bpy.props.EnumProperty(
        name="Tone",
        description="Of the individual that is drawn for a face without a picture",
        items=[(tone.id, tone.label, tone.help) for tone in TONES.values()],
        default="intermediate",
    )
    shading: bpy.props.EnumProperty(
        name="Light in Picture",
        description="Light that is baked into the picture of the face's material",
        items=SHADING,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not _may_adopt(cls, context):
            return False
        if has_skin(active_face(context)):
            cls.poll_message_set("The face has a skin: Apply Skin changes it, Remove Sanguine takes it off")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """In one go, as scripts and the redo panel want it."""
        face = active_face(context)
        try:
            with window_progress(context) as progress, all_or_nothing(face, skin_slot(face)):
                said = run_tasks(adopt_tasks(context, face, self.tone, self.shading), progress)
        except _EXPECTED as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return self._finish(said)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Beside the window, which shows how far it is and listens to Esc alone."""
        if bpy.app.background or context.window is None:
            return self.execute(context)
        self._face = active_face(context)
        self._change = Change(self._face, skin_slot(self._face))
        self._runner = TaskRunner(adopt_tasks(context, self._face, self.tone, self.shading))
        self._timer = context.window_manager.event_timer_add(_TICK_S, window=context.window)
        context.window_manager.progress_begin(0, 1000)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC" and event.value == "PRESS":
            self.cancel(context)
            self.report({"WARNING"}, "Stopped: the file is as it was")
            return {"CANCELLED"}
        if event.type == "TIMER":
            try:
                self._runner.step()
            except BaseException as error:
                self.cancel(context)
                if not isinstance(error, _EXPECTED):
                    raise
                self.report({"ERROR"}, str(error))
                return {"CANCELLED"}
            if self._runner.done:
                self._change.keep()
                self._leave(context)
                return self._finish(self._runner.result)
            context.window_manager.progress_update(int(1000 * self._runner.share))
            context.workspace.status_text_set(f"Adopt Character: {self._runner.label} {self._runner.share:.0%}, Esc stops it")
        return {"RUNNING_MODAL"}  # nothing else may change the face meanwhile

    def cancel(self, context: bpy.types.Context) -> None:
        """Esc, or Blender closes."""
        self._runner.stop()
        self._change.undo()
        self._leave(context)

    def _leave(self, context: bpy.types.Context) -> None:
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)

    def _finish(self, said: Adopted) -> set[str]:
        for line in said.lines:
            self.report({"INFO"}, line)
        for line in said.warnings:
            self.report({"WARNING"}, line)
        return {"FINISHED"}


class SANGUINE_OT_remove_skin(bpy.types.Operator):
    bl_idname = "sanguine.remove_skin"
    bl_label = "Remove Sanguine"
    bl_description = (
        "Take skin, maps, sliders, drivers and baked blood off the active face, which gets back the material, the parent and "
        "the shape that it had. Keyframes of the sliders go too"
    )
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        face = skinned_face(context)
        if face is None:
            cls.poll_message_set("Select a face that has a skin of Sanguine")
            return False
        return _may_adopt(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        face, active = skinned_face(context), context.view_layer.objects.active
        tell_up_to_date(self, face)
        rig = controls_of(face)
        on_rig = active is not None and active == rig
        try:
            notes = remove_skin(face)
        except (ValueError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if on_rig and context.view_layer.objects.active is None:
            context.view_layer.objects.active = face
        for note in notes:
            self.report({"WARNING"}, f"{face.name}: {note}")
        self.report({"INFO"}, f"{face.name} is without Sanguine")
        return {"FINISHED"}


def skinned_face(context: bpy.types.Context) -> bpy.types.Object | None:
    """The active face if it has a skin, or the one that hangs on the active armature and has one."""
    face = active_face(context)
    if face is not None and has_skin(face):
        return face
    obj = context.active_object
    children = obj.children if obj is not None and obj.type == "ARMATURE" else ()
    return next((child for child in children if child.type == "MESH" and has_skin(child)), None)


CLASSES = (SANGUINE_OT_adopt, SANGUINE_OT_remove_skin)
