"""Add Head: an example head with its shape keys and sliders, for those who have no character at hand."""

from __future__ import annotations

import bpy

from ..domain.head import HeadError, load_presets
from ..domain.resources import rigs_path
from .face import add_face
from .removal import nothing_left_behind


def _heads() -> list[tuple[str, str, str]]:
    return [(head.id, head.label, head.help) for head in load_presets(rigs_path("heads.toml")).values()]


class SANGUINE_OT_add_head(bpy.types.Operator):
    bl_idname = "sanguine.add_head"
    bl_label = "Add Head"
    bl_description = (
        "Add a head with eyes, teeth, hair, shape keys and sliders for its emotions, life-size, at the 3D cursor. Adopt "
        "Character then gives it its skin"
    )
    bl_options = {"REGISTER", "UNDO"}

    head: bpy.props.EnumProperty(name="Head", description="Whose head", items=_heads())

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Leave to object mode first")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            with nothing_left_behind():
                face = add_face(self.head)
        except HeadError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        face.rig.location = context.scene.cursor.location
        for obj in context.selected_objects:
            obj.select_set(False)
        face.skin.select_set(True)
        context.view_layer.objects.active = face.skin
        return {"FINISHED"}


def _draw_menu(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.operator_menu_enum(SANGUINE_OT_add_head.bl_idname, "head", text="Sanguine Head", icon="USER")


def add_menu() -> None:
    bpy.types.VIEW3D_MT_mesh_add.append(_draw_menu)


def remove_menu() -> None:
    bpy.types.VIEW3D_MT_mesh_add.remove(_draw_menu)


CLASSES = (SANGUINE_OT_add_head,)
