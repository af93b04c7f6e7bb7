"""A picture in the file, painted, packed or unsaved, becomes blood and pigment; the rendered skin is the picture again."""

import bpy
import numpy as np
import pytest
import sanguine
from sanguine.app.skin_report import report
from sanguine.blender.images import stored_range
from sanguine.blender.operators import albedo_of
from sanguine.domain.parameters import default_skin
from sanguine.domain.people import person
from support.patch import camera_above, empty_scene, plane, render_linear, white_world

PALE = {"melanin": 0.015, "hemoglobin": 0.008, "oxygenation": 0.75}
FLUSHED = {"melanin": 0.015, "hemoglobin": 0.03, "oxygenation": 0.75}


@pytest.fixture(autouse=True)
def registered():
    empty_scene(64, 64, 64)
    sanguine.register()
    yield
    sanguine.unregister()


def look(skin):
    whole = default_skin() | {"oil": 0.0} | skin
    return np.array(report(["skin"], [whole], np.array([550.0]))["results"][0]["linear_rec709"])


def encoded(linear):
    """IEC 61966-2-1."""
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055)


def painted(kind="bytes", size=64):
    """Left half pale, right half flushed, a black stroke (a brow) across a corner."""
    rgba = np.ones((size, size, 4))
    rgba[:, : size // 2, :3], rgba[:, size // 2 :, :3] = look(PALE), look(FLUSHED)
    rgba[-size // 8 :, : size // 4, :3] = 0.01
    image = bpy.data.images.new("albedo", size, size, float_buffer=kind == "floats")
    rgba[..., :3] = rgba[..., :3] if kind == "floats" else encoded(rgba[..., :3])
    image.pixels.foreach_set(rgba.astype(np.float32).ravel())
    if kind == "packed":
        image.pack()
    return image, rgba


def face_with(image):
    material = bpy.data.materials.new("painted")
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    face = flat_face(material)
    face.sanguine.oil = 0.0
    face.sanguine.quality = "draft"
    return face


def flat_face(material):
    face = plane(material)
    layer = face.data.uv_layers.new(name="UVMap")
    layer.data.foreach_set("uv", [0, 0, 1, 0, 1, 1, 0, 1])
    bpy.context.view_layer.objects.active = face
    return face


def pixels_of(image):
    out = np.empty(image.size[0] * image.size[1] * image.channels, dtype=np.float32)
    image.pixels.foreach_get(out)
    return out.reshape(image.size[1], image.size[0], -1)


@pytest.mark.parametrize("kind", ["bytes", "packed", "floats"])
def test_blood_and_pigment_are_read_from_what_is_painted(kind):
    image, _ = painted(kind)
    face = face_with(image)
    assert albedo_of(face) == image
    assert bpy.ops.sanguine.read_picture(shading="off") == {"FINISHED"}
    held = pixels_of(face.sanguine.skin_map)
    pale, flushed = held[16:40, 8:24], held[16:40, 40:56]
    # 8 bits of colour leave a few percent of an amount open.
    for half, skin in ((pale, PALE), (flushed, FLUSHED)):
        np.testing.assert_allclose(np.median(half[..., 0]), skin["hemoglobin"], rtol=0.1)
        np.testing.assert_allclose(np.median(half[..., 1]), skin["melanin"], rtol=0.1)
    low, high = stored_range(face.sanguine.skin_map)["hemoglobin"]
    assert low < 0.01 and high > 0.027


def test_the_rendered_skin_is_the_picture_again_brow_and_all():
    image, rgba = painted("floats")
    face = face_with(image)
    bpy.ops.sanguine.read_picture(shading="off")
    bpy.ops.sanguine.apply_skin()
    white_world(bpy.context.scene)
    camera_above(200.0)
    bpy.context.scene.cycles.samples = 64
    shown = render_linear()
    assert shown.shape[0] == shown.shape[1]
    step = shown.shape[0] // 8
    for row, column in ((4, 2), (4, 6)):
        expected = rgba[row * 8 - 2 : row * 8 + 2, column * 8 - 2 : column * 8 + 2, :3].mean((0, 1))
        found = shown[row * step - 2 : row * step + 2, column * step - 2 : column * step + 2, :3].mean((0, 1))
        np.testing.assert_allclose(found, expected, rtol=0.06)  # noise of 64 samples, and light from the other half
    assert shown.min(axis=(0, 1))[0] < 0.5 * look(PALE)[0]  # the stroke is there


def test_reading_twice_leaves_no_picture_behind():
    image, _ = painted()
    face_with(image)
    bpy.ops.sanguine.read_picture(shading="off")
    count = len(bpy.data.images)
    bpy.ops.sanguine.read_picture(shading="off")
    assert len(bpy.data.images) == count


def test_without_a_picture_it_says_so():
    flat_face(None)
    with pytest.raises(RuntimeError, match="no picture"):
        bpy.ops.sanguine.read_picture()
    with pytest.raises(RuntimeError, match="no picture 'x'"):
        bpy.ops.sanguine.read_picture(image="x")


def test_a_person_sets_skin_features_and_growth():
    face = flat_face(None)
    face.sanguine.seed, face.sanguine.age_years = 7, 61.0
    face.sanguine.strength_tattoo = 1.0
    assert bpy.ops.sanguine.draw_person(tone="monk-3", sex="male") == {"FINISHED"}
    drawn = person("monk-3", "male", 61.0, 7, 0.5)
    assert face.sanguine.melanin == pytest.approx(drawn.skin["melanin"])
    assert face.sanguine.strength_lentigines == pytest.approx(drawn.strengths.get("lentigines", 0.0))
    assert face.sanguine.strength_tattoo == pytest.approx(drawn.strengths.get("tattoo", 0.0))
    assert face.sanguine.masculinity == 1.0 and face.sanguine.seed == 7
