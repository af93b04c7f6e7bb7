"""The "Sanguine" tab of the 3D view's sidebar."""

from __future__ import annotations

import bpy

from ..domain.blood import BLOOD_CONTROL
from ..domain.effects import EFFECTS, Growth, grown, residual, skin_map
from ..domain.facs import EMOTION_CONTROLS
from ..domain.parameters import PARAMETERS
from ..domain.quality import preset
from .capture import SANGUINE_OT_import_capture
from .operators import (
    SANGUINE_OT_apply_skin,
    SANGUINE_OT_draw_person,
    SANGUINE_OT_read_picture,
    active_face,
    emotion_bone,
    live_plan,
)
from .properties import strength_property


class _SidebarPanel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Sanguine"


class SANGUINE_PT_main(_SidebarPanel, bpy.types.Panel):
    bl_idname = "SANGUINE_PT_main"
    bl_label = "Sanguine"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator(SANGUINE_OT_apply_skin.bl_idname, icon="MATERIAL")
        face = active_face(context)
        bone = emotion_bone(face) if face else None
        if bone is None:
            return
        column = layout.column(align=True)
        for name in (*EMOTION_CONTROLS, BLOOD_CONTROL):
            if name in bone:
                column.prop(bone, f'["{name}"]', text=name.capitalize(), slider=True)
        layout.operator(SANGUINE_OT_import_capture.bl_idname, icon="IMPORT")


class _FacePanel(_SidebarPanel):
    bl_parent_id = SANGUINE_PT_main.bl_idname
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return active_face(context) is not None


class SANGUINE_PT_skin(_FacePanel, bpy.types.Panel):
    bl_label = "Skin"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        settings = active_face(context).sanguine
        layout.prop(settings, "quality")
        layout.label(text=preset(settings.quality).measured)
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


CLASSES = (SANGUINE_PT_main, SANGUINE_PT_skin, SANGUINE_PT_features, SANGUINE_PT_picture, SANGUINE_PT_plan)
