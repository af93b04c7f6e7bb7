"""What the panel's buttons do."""

from __future__ import annotations

import bpy

from ..domain.effects import Frame, Scene
from ..domain.facs import EMOTION_CONTROLS
from ..domain.plan import Plan, make_plan
from .controls import CONTROL_BONE, add_controls, drive_shape_keys
from .properties import map_ranges_of, measure_maps, quality_of, skin_of, strengths_of
from .skin import apply_skin, skin_slot
from .surface import face_regions, find_face_regions


def active_face(context: bpy.types.Context) -> bpy.types.Object | None:
    """The active mesh object, or the face that hangs on the active armature."""
    obj = context.active_object
    if obj is not None and obj.type == "ARMATURE":
        return next((child for child in obj.children if child.type == "MESH" and face_regions(child)), None)
    return obj if obj is not None and obj.type == "MESH" else None


def controls_of(face: bpy.types.Object) -> bpy.types.Object | None:
    """The armature that carries the face's controls."""
    rigs = [face.parent, *(m.object for m in face.modifiers if m.type == "ARMATURE")]
    return next((rig for rig in rigs if rig is not None and rig.type == "ARMATURE"), None)


def live_plan(face: bpy.types.Object) -> Plan:
    """The plan while an artist works: every emotion may still be pulled, every skin slider moved."""
    return make_plan(
        Scene(
            skin=skin_of(face),
            frames=(Frame("live", dict.fromkeys(EMOTION_CONTROLS, 1.0)),),
            strengths=strengths_of(face),
            regions=face_regions(face),
            live=True,
            maps=map_ranges_of(face),
        ),
        quality_of(face),
    )


class SANGUINE_OT_apply_skin(bpy.types.Operator):
    bl_idname = "sanguine.apply_skin"
    bl_label = "Apply Skin"
    bl_description = "Give the active face a skin of blood and pigment, and sliders for its emotions"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        face = active_face(context)
        if face is None:
            cls.poll_message_set("Select a face: a mesh object")
            return False
        if face.library or face.data.library:
            cls.poll_message_set("The face is linked: make it local, or override its library, first")
            return False
        if context.mode != "OBJECT":
            cls.poll_message_set("Leave to object mode first")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        face = active_face(context)
        try:
            rig = controls_of(face) or _new_rig(context, face)
            add_controls(rig)
            driven = drive_shape_keys(rig, [child for child in (face, *rig.children) if child.type == "MESH"])
            measure_maps(face)
            regions = find_face_regions(face)
            plan = live_plan(face)
            apply_skin(face, rig, plan, skin_slot(face))
        except (ValueError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        context.scene.cycles.shading_system = True
        running = ", ".join(effect.label for effect in plan.active)
        done = f"{running}; {plan.entries} skins solved; {len(driven.driven)} shape keys driven"
        self.report({"INFO"}, f"{done}; {regions}" if regions else done)
        return {"FINISHED"}


def _new_rig(context: bpy.types.Context, face: bpy.types.Object) -> bpy.types.Object:
    """An armature for the controls of a face that has none; it does not deform anything."""
    rig = bpy.data.objects.new(f"{face.name} controls", bpy.data.armatures.new(f"{face.name} controls"))
    face.users_collection[0].objects.link(rig)
    world = face.matrix_world.copy()
    rig.parent = face.parent
    rig.matrix_world = world
    face.parent = rig
    context.view_layer.update()
    face.matrix_world = world
    return rig


def emotion_bone(face: bpy.types.Object) -> bpy.types.PoseBone | None:
    rig = controls_of(face)
    return rig.pose.bones.get(CONTROL_BONE) if rig is not None and rig.pose is not None else None


CLASSES = (SANGUINE_OT_apply_skin,)
