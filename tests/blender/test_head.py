"""In Blender: the head's objects carry their keys, follow its bone and render as a face before a backdrop."""

import bpy
import numpy as np
import pytest
import sanguine_core
from mathutils import Euler

from sanguine.blender.head import CONTROL_BONE, build_face
from sanguine.blender.stage import set_stage
from sanguine.domain.head import KEY_NAMES, build_head, load_presets, load_regions
from sanguine.domain.resources import rigs_path


def read_top_down(path):
    return sanguine_core.read_image(str(path))[::-1]


@pytest.fixture(scope="module")
def preset():
    return load_presets(rigs_path("heads.toml"))["female"]


@pytest.fixture(scope="module")
def head(preset):
    return build_head(preset, load_regions(rigs_path("regions.toml")), read_top_down)


@pytest.fixture
def face(head, preset):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return build_face(head, preset, bpy.data.materials.new("skin"))


def evaluated(obj):
    bpy.context.view_layer.update()
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    positions = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get("co", positions)
    world = np.array(obj.matrix_world)
    return positions.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]


def test_meshes_are_valid_and_stand_where_the_domain_put_them(face, head):
    for part in head.parts:
        obj = face.parts[part.name]
        assert not obj.data.validate(verbose=True), part.name
        assert len(obj.data.polygons) == len(part.faces)
        assert [slot.material is not None for slot in obj.material_slots] == [True] * len(part.slots)
        obj.modifiers.clear()
        np.testing.assert_allclose(evaluated(obj), part.vertices, atol=1e-5, err_msg=part.name)


def test_shape_keys_bear_arkits_names_and_rest_at_zero(face, head):
    names = {key for obj in face.parts.values() for key in obj.data.shape_keys.key_blocks.keys()}
    assert names == {"Basis", *KEY_NAMES}
    for part in head.parts:
        blocks = face.parts[part.name].data.shape_keys.key_blocks
        assert list(blocks.keys()) == ["Basis", *part.shape_keys]
        assert all(block.value == 0.0 for block in blocks[1:])


def test_everything_turns_with_the_head_bone(face, head):
    assert set(face.rig.data.bones.keys()) == {"root", "head", CONTROL_BONE}
    before = {name: evaluated(obj) for name, obj in face.parts.items()}
    hair = face.hair.matrix_world.copy()
    bone = face.rig.pose.bones["head"]
    bone.rotation_mode = "XYZ"
    bone.rotation_euler = Euler((0, 0.4, 0))
    for name, obj in face.parts.items():
        moved = np.linalg.norm(evaluated(obj) - before[name], axis=1)
        if name == "skin":  # the shoulders stay
            low = before[name][:, 2] < head.landmarks["neck"][2] - 0.06
            assert moved[low].max() < 1e-3
            assert moved[before[name][:, 2] > head.landmarks["chin"][2]].mean() > 0.02
        else:
            assert moved.max() > 0.004, name
    assert face.hair.matrix_world != hair


def test_two_heads_share_a_scene(face, head, preset):
    other = build_face(head, preset, bpy.data.materials.new("skin"))
    assert other.skin is not face.skin and other.collection is not face.collection


def test_a_portrait_shows_a_face_before_a_backdrop(face, head, tmp_path):
    scene = bpy.context.scene
    marks = {name: tuple(map(float, head.landmarks[name])) for name in ("eyes", "chin", "crown")}
    camera = set_stage(scene, **marks, size=(64, 80))
    assert scene.camera is camera and (scene.render.resolution_x, scene.render.resolution_y) == (64, 80)
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", 8
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = str(tmp_path / "portrait.exr")
    bpy.ops.render.render(write_still=True)
    image = read_top_down(tmp_path / "portrait.exr")[..., :3]
    assert np.isfinite(image).all()
    cheek, corner = image[40:48, 22:30].mean(), image[:10, :10].mean()
    assert cheek > 2 * corner > 0.0


def test_the_camera_sees_crown_and_neck_whatever_the_image_shape(face, head):
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    marks = {name: tuple(map(float, head.landmarks[name])) for name in ("eyes", "chin", "crown")}
    for size in ((512, 640), (640, 512), (400, 400)):
        camera = set_stage(bpy.context.scene, **marks, size=size)
        bpy.context.view_layer.update()
        for name in ("crown", "neck", "eye_left", "eye_right"):
            x, y, _ = world_to_camera_view(bpy.context.scene, camera, Vector(head.landmarks[name]))
            assert 0.05 < x < 0.95 and 0.05 < y < 0.95, (size, name)
