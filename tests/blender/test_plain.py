"""The plain twin in Blender: the same sockets, nothing of OSL, and Bake to Plain Material."""

import bpy
import numpy as np
import pytest
import sanguine
from sanguine.blender import plain
from sanguine.blender.osl import has_scripts
from sanguine.blender.removal import nothing_left_behind
from sanguine.blender.skin import apply_skin
from sanguine.blender.surface import store_regions
from sanguine.domain.effects import Frame, Scene
from sanguine.domain.effects.regions import FACE_REGIONS
from sanguine.domain.errors import InputError
from sanguine.domain.parameters import default_skin
from sanguine.domain.plan import check_strengths, make_plan
from sanguine.domain.shading import EEVEE_PROPERTIES
from support.patch import camera_above, empty_scene, render_linear, white_world

KINDS = ("images", "materials", "node_groups", "texts")


@pytest.fixture
def addon():
    sanguine.register()
    yield
    sanguine.unregister()


@pytest.fixture
def face():
    """A patch of 2 cm with UVs and regions, seen from above."""
    white_world(empty_scene(24, 24, 4))
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8, size=0.02)
    face = bpy.context.object
    masks = {region: np.zeros(len(face.data.vertices)) for region in FACE_REGIONS}
    masks["cheeks"][:] = 1.0
    store_regions(face, masks)
    camera_above(20.0)
    return face


def plan(**strengths):
    frames = (Frame("neutral"), Frame("fear", {"fear": 1.0}))
    return make_plan(Scene(default_skin() | {"oil": 0.6}, frames, check_strengths(strengths, "test"), FACE_REGIONS, live=True))


def count():
    return {kind: len(getattr(bpy.data, kind)) for kind in KINDS}


def group(face):
    (node,) = (node for node in face.material_slots[0].material.node_tree.nodes if node.type == "GROUP")
    return node


def every_node(tree):
    for node in tree.nodes:
        yield node
        if node.bl_idname == "ShaderNodeGroup":
            yield from every_node(node.node_tree)


def interface(face):
    return [
        (item.name, item.in_out, item.socket_type, item.description, getattr(item, "default_value", None))
        for item in group(face).node_tree.interface.items_tree
    ]


def reads(face):
    """Attributes and maps."""
    nodes = list(group(face).node_tree.nodes)
    return {(node.attribute_type, node.attribute_name) for node in nodes if node.type == "ATTRIBUTE"}, {
        node.label for node in nodes if node.type == "TEX_IMAGE"
    }


def test_twins_have_the_same_sliders_attributes_and_maps(face):
    asked = plan(relief=0.5, mottle=0.5)
    apply_skin(face, None, asked, shading="OSL")
    sockets, read = interface(face), reads(face)
    apply_skin(face, None, asked, shading="NODES")
    assert interface(face) == sockets and reads(face) == read
    assert not bpy.data.texts and not has_scripts()
    assert face.material_slots[0].material["sanguine"]["shading"] == "NODES"


def test_what_is_not_called_for_has_no_node(face):
    nothing = make_plan(Scene(default_skin() | {"oil": 0.0}, (Frame("neutral"),), check_strengths({"anatomy": 0.0}, "test"), FACE_REGIONS))
    apply_skin(face, None, nothing, shading="NODES")
    kinds = {node.bl_idname for node in every_node(group(face).node_tree)}
    assert "ShaderNodeTexImage" not in kinds and "ShaderNodeTexNoise" not in kinds and "ShaderNodeBsdfPrincipled" not in kinds
    assert not bpy.data.images


def test_applying_either_again_leaves_nothing_of_the_other(face):
    asked = plan(relief=0.5)
    apply_skin(face, None, asked, shading="NODES")
    once = count()
    apply_skin(face, None, asked, shading="OSL")
    apply_skin(face, None, asked, shading="NODES")
    assert count() == once
    assert not [name for kind in KINDS for name in getattr(bpy.data, kind).keys() if name.endswith(".001")]


def test_bake_to_plain_material_keeps_the_picture_and_needs_nothing(face, addon, tmp_path):
    apply_skin(face, None, plan(relief=0.5, mottle=0.5), shading="OSL")
    scene = bpy.context.scene
    assert scene.cycles.shading_system and has_scripts()
    group(face).inputs["Melanin"].default_value = 0.04
    face["blood_hemoglobin_cheeks"] = -0.005
    bpy.context.view_layer.objects.active = face
    before, sockets, read = render_linear(), interface(face), reads(face)
    assert bpy.ops.sanguine.bake_plain() == {"FINISHED"}
    assert not has_scripts() and not bpy.data.texts and not scene.cycles.shading_system
    assert interface(face) == sockets and reads(face) == read
    assert group(face).inputs["Melanin"].default_value == pytest.approx(0.04)
    for image in bpy.data.images:
        assert image.packed_file is not None or image.type == "RENDER_RESULT"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "plain.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "plain.blend"))
    after = render_linear()
    if bpy.app.version >= (4, 3):
        # The same operations in another order of rounding.
        np.testing.assert_allclose(after, before, rtol=1e-3, atol=1e-4)
    else:  # of other paths: tests/render/test_twins.py
        np.testing.assert_allclose(after.mean((0, 1)), before.mean((0, 1)), rtol=0.01)


def test_for_eevee_the_object_is_read_by_drivers(face, addon):
    """Also where they stand for an array; what is moved afterwards shows in the picture."""
    face.shape_key_add(name="Basis")
    face.shape_key_add(name="jawOpen").data[0].co.x -= 0.005
    asked = plan(strain=1.0)
    apply_skin(face, None, asked, shading="NODES")
    bpy.context.view_layer.objects.active = face
    blood = [part for parts in asked.packed.values() for part in parts if part]
    names = {node.attribute_name for node in group(face).node_tree.nodes if node.type == "ATTRIBUTE" and node.attribute_type == "OBJECT"}
    assert len(names) > EEVEE_PROPERTIES, "more than EEVEE reads"
    for name in blood:
        face[name] = -0.004
    face.update_tag()
    pale = render_linear()
    assert bpy.ops.sanguine.bake_plain(eevee=True) == {"FINISHED"}
    assert not reads(face)[0] & {("OBJECT", name) for name in names}
    drivers = group(face).node_tree.animation_data.drivers
    assert {curve.driver.variables[0].targets[0].data_path.split('"')[1] for curve in drivers} == names
    np.testing.assert_allclose(render_linear(), pale, rtol=1e-3, atol=1e-4)
    for name in blood:
        face[name] = 0.01 if "hemoglobin" in name else 0.0
    face.update_tag()
    flushed = render_linear()
    assert flushed[..., 1].mean() < 0.97 * pale[..., 1].mean(), "more blood takes green"
    other = face.copy()
    bpy.context.scene.collection.objects.link(other)
    other.material_slots[0].link = "OBJECT"
    other.material_slots[0].material = face.material_slots[0].material
    with pytest.raises(RuntimeError, match="make it single-user"):
        bpy.ops.sanguine.bake_plain(eevee=True)


def test_baking_twice_is_no_harm_and_a_script_without_plain_nodes_changes_nothing(face, addon):
    apply_skin(face, None, plan(relief=0.5), shading="OSL")
    bpy.context.view_layer.objects.active = face
    script = next(node for node in group(face).node_tree.nodes if node.type == "SCRIPT" and "relief" in node.name)
    text = script.script.as_string()
    script.script.from_string(text.replace("noise(\"perlin\"", "noise(\"gabor\""))
    once = count()
    with pytest.raises(RuntimeError, match=r"relief: line \d+: noise\('gabor'\): plain nodes have nothing for it"):
        bpy.ops.sanguine.bake_plain()
    assert count() == once and has_scripts()
    script.script.from_string(text)
    assert bpy.ops.sanguine.bake_plain() == {"FINISHED"}
    plain_ = count()
    assert bpy.ops.sanguine.bake_plain() == {"FINISHED"}
    assert count() == plain_


def test_where_it_cannot_be_it_says_why(addon):
    empty_scene(8, 8, 1)
    bpy.ops.mesh.primitive_plane_add()
    with pytest.raises(RuntimeError, match="no skin of Sanguine"):
        bpy.ops.sanguine.bake_plain()


def test_an_image_whose_file_is_missing_is_named(face, tmp_path):
    apply_skin(face, None, plan(), shading="OSL")
    node = next(node for node in group(face).node_tree.nodes if node.type == "TEX_IMAGE")
    gone = bpy.data.images.new("gone", 4, 4)
    gone.filepath, gone.source = str(tmp_path / "gone.png"), "FILE"
    node.image = gone
    with pytest.raises(InputError, match="'gone' has no pixels"), nothing_left_behind():
        plain.bake_plain(face)
    assert has_scripts()
