"""Add Head: an example head with its shape keys and sliders, for those who have no character at hand."""

from __future__ import annotations

import bpy
from mathutils import Matrix, Vector

from ..domain.head import HeadError, load_presets
from ..domain.resources import rigs_path
from .face import add_face
from .removal import nothing_left_behind


_SPECK = 0.1
"""Share of the view's height below which nobody finds a head. Blender's first view shows a life-size one at 0.04."""

_START_CUBE_M = 2.0


def _heads() -> list[tuple[str, str, str]]:
    return [(head.id, head.label, head.help) for head in load_presets(rigs_path("heads.toml")).values()]


class SANGUINE_OT_add_head(bpy.types.Operator):
    bl_idname = "sanguine.add_head"
    bl_label = "Add Head"
    bl_description = (
        "Add a head with eyes, teeth, hair, shape keys and sliders for its emotions, life-size, at the 3D cursor, and frame it "
        "where it would not be seen. Adopt Character then gives it its skin"
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
        context.view_layer.update()
        corners = [face.skin.matrix_world @ Vector(corner) for corner in face.skin.bound_box]
        if (cube := _cube_around(context.view_layer, corners)) is not None:
            self.report({"WARNING"}, f"The head is inside '{cube.name}', which hides it from the camera: hide or delete that")
        _frame(context, corners)
        return {"FINISHED"}


def _cube_around(layer: bpy.types.ViewLayer, corners: list[Vector]) -> bpy.types.Object | None:
    """The cube that a new file of Blender's has, if it is seen and holds all these points of the world. What else is round
    a head (a room, a helmet) is meant to be."""
    for obj in layer.objects:
        if obj.type != "MESH" or len(obj.data.vertices) != 8 or not obj.visible_get():
            continue
        if all(abs(side - _START_CUBE_M) < 1e-4 for side in obj.dimensions):
            low, high = Vector(obj.bound_box[0]), Vector(obj.bound_box[6])
            inward = obj.matrix_world.inverted_safe()
            if all(low[i] <= (inward @ point)[i] <= high[i] for point in corners for i in range(3)):
                return obj
    return None


def _frame(context: bpy.types.Context, corners: list[Vector]) -> None:
    """Frames what is selected in the 3D view that the operator was called from, if it would not be seen there. A view that
    shows the head stays where it is, as with Blender's own Add, and so does one through a camera."""
    space = context.space_data
    if space is None or space.type != "VIEW_3D" or space.region_3d.view_perspective == "CAMERA":
        return
    if is_speck(space.region_3d.perspective_matrix, corners):
        region = next(region for region in context.area.regions if region.type == "WINDOW")
        with context.temp_override(region=region):
            bpy.ops.view3d.view_selected()


def is_speck(view: Matrix, corners: list[Vector]) -> bool:
    """Whether points of the world, as a view (4x4, to clip space) shows them, are behind it, beside it or next to nothing."""
    clipped = [view @ point.to_4d() for point in corners]
    if any(point.w <= 0.0 for point in clipped):
        return True
    x, y = ([point[i] / point.w for point in clipped] for i in (0, 1))
    beside = max(x) < -1.0 or min(x) > 1.0 or max(y) < -1.0 or min(y) > 1.0
    return beside or max(y) - min(y) < 2.0 * _SPECK


def _draw_menu(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.operator_menu_enum(SANGUINE_OT_add_head.bl_idname, "head", text="Sanguine Head", icon="USER")


def add_menu() -> None:
    bpy.types.VIEW3D_MT_mesh_add.append(_draw_menu)


def remove_menu() -> None:
    bpy.types.VIEW3D_MT_mesh_add.remove(_draw_menu)


CLASSES = (SANGUINE_OT_add_head,)
