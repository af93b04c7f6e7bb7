"""Characters that come from another file, and several in one: appended, linked and overridden, alike and different."""

import bpy
import numpy as np
import pytest
from sanguine.blender import controls
from sanguine.blender.operators import emotion_bone
from support.patch import camera_above, empty_scene, render_linear, white_world
from tests.blender.test_adopt import make_face, registered, select, solved_once  # noqa: F401


def stage():
    """An empty lit scene whose camera looks at the front of faces in a row, 0.3 m apart, one pixel in eight."""
    scene = empty_scene(24, 24, 4)
    white_world(scene)
    camera_above(200.0)
    scene.camera.location, scene.camera.rotation_euler = (0.0, -0.5, 0.0), (1.5707963, 0.0, 0.0)
    return scene


def skinned(name, x=0.0, **values):
    face = make_face(name, material=None)
    face.location.x = x
    for key, value in values.items():
        setattr(face.sanguine, key, value)
    select(face)
    assert bpy.ops.sanguine.apply_skin() == {"FINISHED"}
    return face


def look(x=0.0):
    """Linear pixels of the face at x."""
    bpy.context.scene.camera.location.x = x
    bpy.context.view_layer.update()
    return render_linear()


def feel(face, **values):
    controls.set_controls(face.parent, values)
    bpy.context.view_layer.update()


@pytest.fixture
def library(tmp_path):
    """A file with a character that is a little angry, and its picture; a second picture in full anger."""
    stage()
    face = skinned("face", melanin=0.04)
    hero = bpy.data.collections.new("hero")
    bpy.context.scene.collection.children.link(hero)
    for thing in (face, face.parent):
        hero.objects.link(thing)
        bpy.context.scene.collection.objects.unlink(thing)
    pictures = {}
    for anger in (0.25, 1.0):
        feel(face, anger=anger)
        pictures[anger] = look()
    feel(face, anger=0.25)
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    assert np.abs(pictures[1.0] - pictures[0.25]).max() > 0.005, "anger shows"
    return path, pictures


def load(path, link):
    with bpy.data.libraries.load(path, link=link) as (_, here):
        here.collections = ["hero"]
    return here.collections[0]


def equal(found, expected, atol=1e-6):
    """The same seed and the same material: what is left is the rounding of floats."""
    np.testing.assert_allclose(found, expected, atol=atol)


# A metre from the origin a float is 1e-7 m, which moves where paths of 1e-5 m enter and leave.
MOVED = 5e-4


def test_appended_twice_is_two_characters(library):
    path, pictures = library
    scene = stage()
    faces = []
    for x in (0.0, 1.0):
        hero = load(path, link=False)
        scene.collection.children.link(hero)
        (face,) = (thing for thing in hero.objects if thing.type == "MESH")
        face.parent.location.x += x
        faces.append(face)
    bpy.context.view_layer.update()
    assert faces[0] != faces[1] and faces[0].parent != faces[1].parent
    assert all(image.packed_file for image in bpy.data.images if image.size[0])
    equal(look(0.0), pictures[0.25])
    feel(faces[1], anger=1.0)
    equal(look(0.0), pictures[0.25])
    equal(look(1.0), pictures[1.0], MOVED)
    # One changes its skin, the other loses it: neither feels it.
    select(faces[1])
    faces[1].sanguine.melanin = 0.2
    bpy.ops.sanguine.apply_skin()
    equal(look(0.0), pictures[0.25])
    assert look(1.0).mean() < 0.8 * pictures[1.0].mean()
    assert bpy.ops.sanguine.remove_skin() == {"FINISHED"}
    equal(look(0.0), pictures[0.25])
    select(faces[0])
    assert bpy.ops.sanguine.remove_skin() == {"FINISHED"}
    assert not bpy.data.texts and not bpy.data.node_groups and not bpy.data.armatures


def test_linked_and_overridden_plays_and_renders_as_at_home(library, tmp_path):
    path, pictures = library
    scene = stage()
    hero = load(path, link=True)
    made = hero.override_hierarchy_create(scene, bpy.context.view_layer, do_fully_editable=True)
    face = next(thing for thing in made.all_objects if thing.type == "MESH")
    assert face.override_library and face.parent.override_library and face.material_slots[0].material.library
    bpy.context.view_layer.update()
    equal(look(), pictures[0.25])
    bone = emotion_bone(face)
    for frame, value in ((1, 0.25), (2, 1.0)):
        bone["anger"] = value
        bone.keyframe_insert('["anger"]', frame=frame)
    shot = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=shot)
    for again in (False, True):
        if again:
            bpy.ops.wm.open_mainfile(filepath=shot)
        for frame, anger in ((1, 0.25), (2, 1.0), (1, 0.25)):
            bpy.context.scene.frame_set(frame)
            equal(look(), pictures[anger])
    face = next(thing for thing in bpy.data.objects if thing.type == "MESH" and thing.override_library)
    select(face)
    for name in ("adopt", "remove_skin", "apply_skin", "add_feeling", "remove_feeling", "load_profile"):
        with pytest.raises(RuntimeError, match="library override"):
            getattr(bpy.ops.sanguine, name)()
    with pytest.raises(RuntimeError, match="linked"):
        bpy.ops.sanguine.bake_plain()
    assert bpy.ops.sanguine.bake_blood() == {"FINISHED"}, "which an override keeps"


def test_two_skins_in_one_scene_keep_their_own(tmp_path):
    stage()
    light = skinned("light", melanin=0.01)
    dark = skinned("dark", x=1.0, melanin=0.25, hemoglobin=0.03)
    feel(light, anger=1.0)
    feel(dark, fear=1.0)
    pictures = look(0.0), look(1.0)
    assert pictures[0].mean() > 1.5 * pictures[1].mean()
    assert light["blood_hemoglobin_cheeks"] > 0.0 > dark["blood_hemoglobin_cheeks"]
    for name in ("material", "table"):
        found = {i.name for i in (bpy.data.images if name == "table" else bpy.data.materials) if "skin" in i.name and (name != "table" or "table" in i.name)}
        assert len(found) == 2, found
    path = str(tmp_path / "two.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    for x, picture in enumerate(pictures):
        equal(look(float(x)), picture)
    select(bpy.data.objects["dark"])
    assert bpy.ops.sanguine.remove_skin() == {"FINISHED"}
    equal(look(0.0), pictures[0])
    assert emotion_bone(bpy.data.objects["light"])["anger"] == 1.0


def test_two_faces_of_one_mesh_or_one_rig_keep_their_own():
    stage()
    first = skinned("first", melanin=0.02)
    second = bpy.data.objects.new("second", first.data)  # the mesh is shared, and with it the material of its slot
    bpy.context.collection.objects.link(second)
    second.location.x, second.rotation_euler = 1.0, first.rotation_euler
    second.material_slots[0].link = "OBJECT"
    second.sanguine.quality, second.sanguine.melanin = "draft", 0.2
    before = look(0.0)
    select(second)
    assert bpy.ops.sanguine.apply_skin() == {"FINISHED"}
    equal(look(0.0), before)
    assert look(1.0).mean() < 0.8 * before.mean()
    assert bpy.ops.sanguine.remove_skin() == {"FINISHED"}
    equal(look(0.0), before)
    # One rig moves two faces of different skins.
    third = make_face("third", material=None)
    third.parent, third.sanguine.melanin = first.parent, 0.2
    third.matrix_parent_inverse = first.parent.matrix_world.inverted()
    third.location.x = 2.0
    select(third)
    assert bpy.ops.sanguine.apply_skin() == {"FINISHED"}
    assert third.parent == first.parent
    equal(look(0.0), before)
    feel(first, anger=1.0)
    assert third["blood_hemoglobin_cheeks"] == pytest.approx(first["blood_hemoglobin_cheeks"]) != 0.0
    feel(first, anger=0.0)
    select(third)
    assert bpy.ops.sanguine.remove_skin() == {"FINISHED"}
    equal(look(0.0), before)
    assert first.parent is not None and "anger" in emotion_bone(first)
