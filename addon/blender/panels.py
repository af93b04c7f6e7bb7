"""The "Sanguine" tab of the 3D view's sidebar."""

from __future__ import annotations

import bpy

from ..domain.blood import BLOOD_CONTROL, HEART_RATE_CONTROL, MOOD_SUFFIX, PACE_CONTROL, STATES
from ..domain.effects import EFFECTS, Growth, grown, residual, skin_map
from ..domain.facs import ACTION_UNITS, EMOTION_CONTROLS
from ..domain.parameters import PARAMETERS
from ..domain.quality import preset
from .adopt import SANGUINE_OT_adopt, SANGUINE_OT_remove_skin, skinned_face
from .animation import (
    SANGUINE_OT_add_feeling,
    SANGUINE_OT_add_poses,
    SANGUINE_OT_bake_blood,
    SANGUINE_OT_clear_blood,
    SANGUINE_OT_load_profile,
    SANGUINE_OT_remove_feeling,
    rig_of,
)
from .bake import bake_state
from .blood import PROFILE
from .capture import SANGUINE_OT_import_capture
from .controls import CONTROL_BONE, OPTIONAL
from .example import SANGUINE_OT_add_head
from .material import MARK
from .migration import newer
from .operators import (
    SANGUINE_OT_apply_skin,
    SANGUINE_OT_draw_person,
    SANGUINE_OT_follow_working_space,
    SANGUINE_OT_read_picture,
    active_face,
    emotion_bone,
    live_plan,
    strange_colours,
)
from .osl import missing_osl
from .properties import strength_property
from .removal import has_skin


class _SidebarPanel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Sanguine"


class SANGUINE_PT_main(_SidebarPanel, bpy.types.Panel):
    bl_idname = "SANGUINE_PT_main"
    bl_label = "Sanguine"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        face = active_face(context)
        if face is None:
            layout.operator_menu_enum(SANGUINE_OT_add_head.bl_idname, "head", icon="ADD")
        if face is not None and not has_skin(face):
            layout.operator_context = "INVOKE_DEFAULT"
            layout.operator(SANGUINE_OT_adopt.bl_idname, icon="USER")
        layout.operator(SANGUINE_OT_apply_skin.bl_idname, icon="MATERIAL")
        if skinned_face(context) is not None:
            layout.operator(SANGUINE_OT_remove_skin.bl_idname, icon="TRASH")
        if missing_osl():
            layout.label(text="This Blender has no OSL: no skin", icon="ERROR")
        elif face and context.scene.render.engine != "CYCLES" and any(m and MARK in m for m in face.data.materials):
            layout.label(text="Only Cycles shows the skin:", icon="INFO")
            layout.prop(context.scene.render, "engine", text="")
        if face and (why := newer(face)):
            layout.label(text=why, icon="ERROR")
            return
        if face and strange_colours(face):
            layout.label(text="Solved for another working space", icon="ERROR")
            layout.operator(SANGUINE_OT_follow_working_space.bl_idname, icon="COLOR")
        bone = emotion_bone(face) if face else None
        if bone is None:
            return
        for names in (EMOTION_CONTROLS, [*STATES, *OPTIONAL, HEART_RATE_CONTROL], [BLOOD_CONTROL, PACE_CONTROL]):
            column = layout.column(align=True)
            for name in names:
                if name in bone:
                    column.prop(bone, f'["{name}"]', text=_slider_label(bone, name), slider=True)
        row = layout.row(align=True)
        row.operator_context = "INVOKE_DEFAULT"
        row.operator(SANGUINE_OT_add_feeling.bl_idname, text="Add", icon="ADD")
        row.operator(SANGUINE_OT_remove_feeling.bl_idname, text="Remove", icon="REMOVE")
        layout.operator(SANGUINE_OT_import_capture.bl_idname, icon="IMPORT")


def _slider_label(bone: bpy.types.PoseBone, name: str) -> str:
    if name == BLOOD_CONTROL and bone[name] > 1.0:
        return "Blood (exaggerated)"
    if name == PACE_CONTROL and bone[name] > 1.0:
        return "Blood pace (hurried)"
    return STATES[name].label if name in STATES else name.replace("_", " ").capitalize()


class _FacePanel(_SidebarPanel):
    bl_parent_id = SANGUINE_PT_main.bl_idname
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return active_face(context) is not None


class SANGUINE_PT_time(_FacePanel, bpy.types.Panel):
    bl_label = "Blood in Time"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return rig_of(context) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, rig = self.layout, rig_of(context)
        state = bake_state(active_face(context), rig, context.scene)
        if not state.baked:
            layout.label(text="Settled: not in time yet", icon="INFO")
        elif state.stale:
            layout.label(text="Stale: bake again", icon="ERROR")
            layout.label(text=state.stale)
        else:
            layout.label(text="Baked", icon="CHECKMARK")
            if state.driven:
                layout.label(text="Drivers move a slider: bake before rendering", icon="INFO")
        layout.operator(SANGUINE_OT_bake_blood.bl_idname, icon="FCURVE")
        layout.operator(SANGUINE_OT_clear_blood.bl_idname, icon="X")
        layout.operator(SANGUINE_OT_add_poses.bl_idname, icon="ASSET_MANAGER")
        layout.operator(SANGUINE_OT_load_profile.bl_idname, icon="FILE_FOLDER")
        if PROFILE in rig:
            layout.label(text="Measured blood, of a profile")
        bone = rig.pose.bones[CONTROL_BONE]
        moods = [name + MOOD_SUFFIX for name in EMOTION_CONTROLS if name + MOOD_SUFFIX in bone]
        column = layout.column(align=True)
        for name in moods:
            column.prop(bone, f'["{name}"]', text=_slider_label(bone, name), slider=True)


class SANGUINE_PT_units(_FacePanel, bpy.types.Panel):
    bl_idname = "SANGUINE_PT_units"
    bl_label = "Action Units"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return rig_of(context) is not None

    def draw(self, context: bpy.types.Context) -> None:
        bone = rig_of(context).pose.bones[CONTROL_BONE]
        column = self.layout.column(align=True)
        for unit in ACTION_UNITS.values():
            if f"AU{unit.id}" in bone:
                column.prop(bone, f'["AU{unit.id}"]', text=f"{unit.id} {unit.name}", slider=True)


class SANGUINE_PT_sides(_FacePanel, bpy.types.Panel):
    # Of its own: beside the slider of both sides there is no room, and the names would be cut.
    bl_label = "Left and Right"
    bl_parent_id = SANGUINE_PT_units.bl_idname

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return rig_of(context) is not None

    def draw(self, context: bpy.types.Context) -> None:
        bone = rig_of(context).pose.bones[CONTROL_BONE]
        column = self.layout.column(align=True)
        for unit in ACTION_UNITS.values():
            row = column.row(align=True)
            for side, text in (("R", f"{unit.id} right"), ("L", "left")):  # as one sees them, face to face
                if f"AU{unit.id}{side}" in bone:
                    row.prop(bone, f'["AU{unit.id}{side}"]', text=text, slider=True)


class SANGUINE_PT_skin(_FacePanel, bpy.types.Panel):
    bl_label = "Skin"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        settings = active_face(context).sanguine
        layout.prop(settings, "quality")
        layout.label(text=preset(settings.quality).measured)
        layout = layout.column(align=True)
        layout.use_property_split = False  # names and numbers side by side would both be cut
        for row in PARAMETERS.values():
            layout.prop(settings, row.id)
        for effect in EFFECTS:
            if effect.default_strength is not None and effect not in grown.EFFECTS:
                layout.prop(settings, strength_property(effect.id), slider=True)


class SANGUINE_PT_picture(_FacePanel, bpy.types.Panel):
    bl_label = "From a Picture"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.operator_context = "INVOKE_DEFAULT"
        layout.operator(SANGUINE_OT_read_picture.bl_idname, icon="IMAGE_DATA")
        for name in (skin_map.MAP, residual.MAP):
            layout.prop(active_face(context).sanguine, name)


class SANGUINE_PT_features(_FacePanel, bpy.types.Panel):
    bl_label = "Features"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        settings = active_face(context).sanguine
        layout.operator_context = "INVOKE_DEFAULT"
        layout.operator(SANGUINE_OT_draw_person.bl_idname, icon="USER")
        column = layout.column(align=True)
        for name in Growth.__dataclass_fields__:
            column.prop(settings, name)
        column = layout.column(align=True)
        for effect in grown.EFFECTS:
            column.prop(settings, strength_property(effect.id), slider=True)


class SANGUINE_PT_plan(_FacePanel, bpy.types.Panel):
    bl_label = "Plan"

    def draw(self, context: bpy.types.Context) -> None:
        plan = live_plan(active_face(context))
        for effect in EFFECTS:
            decision = plan.decisions[effect.id]
            self.layout.label(
                text=f"{effect.label}: {decision.because}", icon="CHECKMARK" if decision.active else "BLANK1"
            )
        self.layout.label(text=f"{plan.entries} skins in the table")


CLASSES = (
    SANGUINE_PT_main,
    SANGUINE_PT_time,
    SANGUINE_PT_units,
    SANGUINE_PT_sides,
    SANGUINE_PT_skin,
    SANGUINE_PT_features,
    SANGUINE_PT_picture,
    SANGUINE_PT_plan,
)
