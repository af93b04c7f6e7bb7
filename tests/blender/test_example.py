"""Add Head: the example heads for those who have no character at hand."""

import math

import bpy
import pytest
import sanguine
from mathutils import Vector
from sanguine.blender import example


def test_two_heads_stand_where_the_cursor_was_and_share_no_mesh(addon):
    places = ((0.0, 0.0, 0.0), (0.5, 0.0, 1.0))
    faces = []
    for place in places:
        bpy.context.scene.cursor.location = place
        assert bpy.ops.sanguine.add_head(head="female") == {"FINISHED"}
        faces.append(bpy.context.object)
        assert bpy.context.selected_objects == [faces[-1]]
    bpy.context.view_layer.update()
    assert [tuple(face.matrix_world.translation) for face in faces] == list(places)
    assert faces[0].data is not faces[1].data and faces[0].parent is not faces[1].parent
    bone = faces[1].parent.pose.bones["sanguine"]
    bone["anger"] = 1.0
    faces[1].parent.update_tag()
    bpy.context.view_layer.update()
    values = [face.data.shape_keys.key_blocks["browDownLeft"].value for face in faces]
    assert values[0] == 0.0 and values[1] > 0.1


@pytest.mark.parametrize("hidden", [False, True])
def test_blenders_first_cube_is_left_alone_and_named(addon, capfd, hidden):
    bpy.ops.wm.read_homefile(use_empty=False, use_factory_startup=True)
    cube = bpy.context.object
    cube.name, cube.hide_viewport = "Würfel", hidden  # as another language has it
    assert bpy.ops.sanguine.add_head(head="female") == {"FINISHED"}
    assert ("The head is inside 'Würfel'" in capfd.readouterr().out) != hidden
    assert bpy.data.objects["Würfel"] == cube and bpy.context.object.name == "female_skin"


def test_a_cube_beside_the_head_or_another_one_around_it_is_no_matter(addon, capfd):
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(1.0, 0.0, 0.0))
    bpy.ops.mesh.primitive_cube_add(size=3.0)
    assert bpy.ops.sanguine.add_head(head="female") == {"FINISHED"}
    assert "inside" not in capfd.readouterr().out


def test_a_view_is_moved_only_where_the_head_would_not_be_seen():
    """The head in the views of a camera: 0.35 m high at 18 m, as Blender's first view has it, is a speck, at 1 m it is not."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.object.camera_add()
    camera = bpy.context.object
    head = [Vector((x, y, z)) for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (0.0, 0.35)]

    def speck(location, rotation=(math.pi / 2, 0.0, 0.0)):
        camera.location, camera.rotation_euler = location, rotation
        bpy.context.view_layer.update()
        clip = camera.calc_matrix_camera(bpy.context.evaluated_depsgraph_get(), x=scene.render.resolution_x, y=scene.render.resolution_y)
        return example.is_speck(clip @ camera.matrix_world.inverted(), head)

    assert speck((0.0, -18.0, 0.0)) and not speck((0.0, -1.0, 0.2))
    assert speck((0.0, 1.0, 0.2)), "behind"
    assert speck((2.0, -1.0, 0.2)), "beside"
    assert speck((0.0, 0.0, 0.2)), "from within"


def test_the_operator_lists_the_heads_of_the_rig_files(addon):
    listed = bpy.ops.sanguine.add_head.get_rna_type().properties["head"].enum_items
    assert [item.identifier for item in listed] == ["female", "male"]
    assert all(item.description for item in listed)


def test_it_is_refused_outside_object_mode_and_leaves_the_file_alone(addon):
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.object.mode_set(mode="EDIT")
    assert not bpy.ops.sanguine.add_head.poll()
    with pytest.raises(RuntimeError, match="object mode"):
        bpy.ops.sanguine.add_head()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(bpy.data.objects) == 1


def test_a_spoilt_head_file_is_one_line_and_leaves_nothing(addon, monkeypatch):
    def fails(_head):
        bpy.data.meshes.new("half made")
        raise example.HeadError("base.obj: not in the head package")

    monkeypatch.setattr(example, "add_face", fails)
    with pytest.raises(RuntimeError, match="base.obj: not in the head package"):
        bpy.ops.sanguine.add_head()
    assert not bpy.data.meshes


def test_the_menu_is_there_once_and_goes_with_the_addon(addon):
    menu = bpy.types.VIEW3D_MT_mesh_add
    assert menu.draw._draw_funcs.count(example._draw_menu) == 1
    sanguine.unregister()
    assert example._draw_menu not in menu.draw._draw_funcs
    sanguine.register()
