"""In Blender: a face without masks gets those of its shape keys, painted ones stay."""

import bpy
import numpy as np
import pytest
import sanguine_core

from sanguine.blender.material import MARK
from sanguine.blender.surface import GROUP_PREFIX, face_regions, find_face_regions, read_surface
from sanguine.domain.head import build_head, load_presets, load_regions
from sanguine.domain.head.surface import triangles
from sanguine.domain.face_regions import find_regions
from sanguine.domain.resources import rigs_path

REGIONS = load_regions(rigs_path("regions.toml"))


@pytest.fixture(scope="module")
def part():
    preset = load_presets(rigs_path("heads.toml"))["female"]
    return build_head(preset, REGIONS, lambda path: sanguine_core.read_image(str(path))[::-1]).part("skin")


def add_skin(part, factor=1.0):
    """The head's skin as somebody else's model: a mesh with shape keys, no vertex groups."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = bpy.data.meshes.new("skin")
    mesh.from_pydata((part.vertices * factor).tolist(), [], part.faces.tolist())
    mesh.uv_layers.new(name="UVMap").data.foreach_set("uv", part.uv.ravel())
    face = bpy.data.objects.new("skin", mesh)
    bpy.context.collection.objects.link(face)
    face.shape_key_add(name="Basis")
    for name, key in part.shape_keys.items():
        moved = part.vertices.copy()
        moved[key.indices] += key.delta
        block = face.shape_key_add(name=name)
        block.value = 0.0
        block.data.foreach_set("co", (moved * factor).ravel())
    bpy.context.view_layer.objects.active = face
    return face


def test_regions_are_those_of_the_domain(part):
    face = add_skin(part)
    line = find_face_regions(face)
    assert line.startswith("regions found from shape keys: lips, ears, eyelids")
    expected = find_regions(part.vertices, triangles(part.faces), part.shape_keys, REGIONS).regions
    assert set(face_regions(face)) == set(expected)
    stored = read_surface(face).regions
    for name, mask in expected.items():
        # Blender's triangles split the quads its own way, and weights are kept in steps of 1/255.
        assert np.abs(stored[name] - mask).sum() < 0.03 * mask.sum() + 0.5, name


def test_regions_are_found_under_other_names(part):
    """ICT FaceKit's names: with _L and _R, and browInnerUp and cheekPuff split into sides."""
    face = add_skin(part)
    line = find_face_regions(face)
    stored = read_surface(face).regions
    other = add_skin(part)
    for block in other.data.shape_keys.key_blocks:
        block.name = block.name.replace("Left", "_L").replace("Right", "_R")
    for name in ("browInnerUp", "cheekPuff"):
        block = other.data.shape_keys.key_blocks[name]
        block.name = f"{name}_L"
        half = other.shape_key_add(name=f"{name}_R")
        half.value = 0.0
        for left, right, at in zip(block.data, half.data, part.vertices):
            (right if at[0] < 0 else left).co, (left if at[0] < 0 else right).co = left.co.copy(), at
    assert find_face_regions(other) == line
    for name, mask in read_surface(other).regions.items():
        np.testing.assert_allclose(mask, stored[name], atol=1 / 255 + 1e-6, err_msg=name)


def test_centimetres_are_said_and_the_object_scale_is_the_cure(part):
    face = add_skin(part, 100.0)
    assert "scale the face by 0.01" in find_face_regions(face)
    face = add_skin(part, 100.0)
    face.scale = (0.01, 0.01, 0.01)
    bpy.context.view_layer.update()
    assert "scale" not in find_face_regions(face)


def test_painted_masks_stay(part):
    face = add_skin(part)
    face.vertex_groups.new(name=f"{GROUP_PREFIX}lips").add([5], 1.0, "REPLACE")
    assert find_face_regions(face) == ""
    assert face_regions(face) == ("lips",)


def test_a_face_without_keys_says_so():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_uv_sphere_add()
    face = bpy.context.object
    assert find_face_regions(face).startswith("no regions: no shape key eyeBlinkLeft") and face_regions(face) == ()


def test_the_button_finds_them_too(part, monkeypatch):
    """The operator before it plans, so that anatomy and blood have regions; the baking itself is tested elsewhere."""
    import sanguine
    from sanguine.blender import operators

    face = add_skin(part)
    sanguine.register()
    try:
        plans = []
        monkeypatch.setattr(operators, "apply_skin", lambda face, rig, plan, slot, shading: plans.append(plan) or {MARK: {"entries": 0}})
        assert bpy.ops.sanguine.apply_skin() == {"FINISHED"}
        assert "lips" in plans[0].scene.regions and plans[0].decisions["anatomy"].active
        assert f"{GROUP_PREFIX}nose" in face.vertex_groups
    finally:
        sanguine.unregister()
