"""Maps in the material: rendered, they are what `sanguine skin` says of the same values; and they are in the file."""

import subprocess
import sys

import bpy
import colour
import numpy as np
import pytest
import sanguine
from sanguine.app.skin_report import report
from sanguine.blender import operators
from sanguine.blender.blood import drive_packed
from sanguine.blender.images import data_image, store_range, stored_range
from sanguine.blender.material import MARK, build_skin_material, remove_skin_material
from sanguine.domain.effects import Frame, Scene
from sanguine.domain.parameters import PARAMETERS, default_skin
from sanguine.domain.plan import check_strengths, make_plan
from support.features import declare
from support.patch import camera_above, empty_scene, plane, render_linear, white_world

D65 = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
QUANTITIES = ("hemoglobin", "melanin", "oil", "oxygenation")
LIGHT = {"hemoglobin": 0.03, "melanin": 0.015, "oil": 0.0, "oxygenation": 0.85}
DARK = {"hemoglobin": 0.01, "melanin": 0.12, "oil": 0.0, "oxygenation": 0.6}


def said(**values):
    """Linear Rec.709 of `sanguine skin`."""
    skin = default_skin() | {"oil": 0.0} | values
    return np.array(report(["skin"], [skin], np.array([550.0]))["results"][0]["linear_rec709"])


def difference(rgb, expected):
    """Delta E 2000. The bar of the render tests, 1.5, holds for every picture here too."""
    both = (colour.XYZ_to_Lab(colour.RGB_to_XYZ(np.maximum(c, 0.0), "sRGB"), D65) for c in (rgb, expected))
    return colour.delta_E(*both, method="CIE 2000")


def plan_of(maps=None, strengths=None, **skin):
    strengths = check_strengths({"anatomy": 0.0} | (strengths or {}), "test")
    return make_plan(Scene(default_skin() | {"oil": 0.0} | skin, (Frame("0"),), strengths, maps=maps or {}))


def halves(left, right, size=16):
    """(size, size, C): one value on the left, another on the right."""
    left, right = (np.atleast_1d(np.asarray(side, dtype=np.float32)) for side in (left, right))
    image = np.empty((size, size, len(left)), dtype=np.float32)
    image[:, : size // 2], image[:, size // 2 :] = left, right
    return image


def values(skin):
    return [skin[name] for name in QUANTITIES]


def ranges(*skins):
    return {name: (min(s[name] for s in skins), max(s[name] for s in skins)) for name in QUANTITIES}


def patch(material, uv_width=1.0):
    """A plate of 200 mm under a white world, its UVs from 0 to `uv_width`."""
    scene = empty_scene(16, 16, 64)
    white_world(scene)
    thing = plane(material())
    uv = np.array([[0, 0], [uv_width, 0], [uv_width, 1], [0, 1]], dtype=np.float32)
    thing.data.uv_layers.new(name="UVMap").data.foreach_set("uv", uv.ravel())
    camera_above(20.0)
    return thing


def seen(thing, half):
    """Mean colour in the middle of the left (-1) or right (1) half, 50 mm from the other: none of its light gets there."""
    thing.location.x = -0.05 * half
    return render_linear().mean((0, 1))


def test_a_skin_map_is_what_skin_says():
    plan = plan_of({"skin_map": ranges(LIGHT, DARK)})
    maps = {"skin_map": halves(values(LIGHT), values(DARK))}
    thing = patch(lambda: build_skin_material("skin", plan, maps))
    for half, skin in ((-1, LIGHT), (1, DARK)):
        assert difference(seen(thing, half), said(**skin)) < 1.5


def test_a_constant_skin_map_is_what_skin_says():
    plan = plan_of({"skin_map": ranges(LIGHT)})
    assert plan.entries == 1
    thing = patch(lambda: build_skin_material("skin", plan, {"skin_map": halves(values(LIGHT), values(LIGHT))}))
    assert difference(seen(thing, -1), said(**LIGHT)) < 1.5


def test_a_tattoo_darkens_as_skin_says(monkeypatch):
    """Half a strength in the map's own sum: the map holds what is in the skin, on top of the skin's own ink."""
    declare(monkeypatch, "inked", ink_per_mm=(0.0, 6.0))
    plan = plan_of(strengths={"inked": 1.0, "mottle": 0.01}, ink_per_mm=0.1)  # mottle: for two axes more
    assert [axis.id for axis in plan.axes] == ["hemoglobin", "melanin", "ink_per_mm"]
    maps = {"grown": halves([0.0] * 4, [0.0] * 4), "grown_ink": halves([0.0], [3.0])}
    thing = patch(lambda: build_skin_material("skin", plan, maps))
    bare, inked = seen(thing, -1), seen(thing, 1)
    assert difference(bare, said(ink_per_mm=0.1)) < 1.5
    assert difference(inked, said(ink_per_mm=3.1)) < 1.5
    assert difference(bare, inked) > 10.0


def test_four_axes_are_what_skin_says(monkeypatch):
    """A tattoo and a map at once: the bilinear mix of four slices of the table."""
    declare(monkeypatch, "inked", ink_per_mm=(0.0, 6.0))
    plan = plan_of({"skin_map": ranges(LIGHT, DARK)}, {"inked": 1.0})
    assert len(plan.axes) == 4
    maps = {"skin_map": halves(values(LIGHT), values(DARK)), "grown_ink": halves([1.3], [0.0])}
    thing = patch(lambda: build_skin_material("skin", plan, maps))
    assert difference(seen(thing, -1), said(**LIGHT, ink_per_mm=1.3)) < 1.5
    assert difference(seen(thing, 1), said(**DARK)) < 1.5


def test_grown_factors_are_what_skin_says(monkeypatch):
    declare(monkeypatch, "spotted", log_hemoglobin=(0.0, 1.0), log_melanin=(0.0, 1.0), oxygenation=(-0.3, 0.0))
    plan = plan_of(strengths={"spotted": 1.0})
    grown = halves([0.0, 0.0, 0.0, 0.0], [0.5, 0.8, 0.0, -0.25])
    thing = patch(lambda: build_skin_material("skin", plan, {"grown": grown}))
    skin = default_skin()
    there = {"hemoglobin": skin["hemoglobin"] * np.exp(0.5), "melanin": skin["melanin"] * np.exp(0.8),
             "oxygenation": skin["oxygenation"] - 0.25}
    assert difference(seen(thing, -1), said()) < 1.5
    assert difference(seen(thing, 1), said(**there)) < 1.5


def test_what_a_state_brings_out_follows_the_object():
    """One material: its strength is a property of the object, and more of it than the whole layer is the whole layer."""
    plan = make_plan(Scene(default_skin() | {"oil": 0.0}, (Frame("0", {"rash": 1.0}),), {"anatomy": 0.0}))
    maps = {"keyed_rash": halves([0.0, 0.0, 0.0, 0.0], [1.2, 0.0, 0.0, 0.1]), "keyed_rash_slope": halves([0.0, 0.0, 0.0], [0.0, 0.0, 0.0])}
    thing = patch(lambda: build_skin_material("skin", plan, maps))
    drive_packed(thing, plan.packed)
    skin = default_skin()
    for strength in (0.0, 0.5, 1.0, 2.0):
        thing["blood_feature_rash"] = strength
        thing.update_tag()
        held = min(strength, 1.0)
        there = {"hemoglobin": skin["hemoglobin"] * np.exp(1.2 * held), "oxygenation": skin["oxygenation"] + 0.1 * held}
        assert difference(seen(thing, 1), said(**there)) < 1.5, strength
    assert difference(seen(thing, -1), said()) < 1.5


def test_a_residual_multiplies_and_never_makes_light():
    plan = plan_of({"residual": {}})
    thing = patch(lambda: build_skin_material("skin", plan, {"residual": halves([0.4, 0.7, 1.0], [9.0, 9.0, 9.0])}))
    bare = said()
    # The mean is known to 1e-3 (furnace tests), half floats to 5e-4.
    np.testing.assert_allclose(seen(thing, -1) / bare, [0.4, 0.7, 1.0], rtol=0.01)
    white = seen(thing, 1)
    np.testing.assert_allclose(white, 1.0, atol=0.01)


def test_slopes_bend_the_light(monkeypatch):
    """Waves of 0.1 mm under a low sun are bands of light; no slope is no relief."""
    declare(monkeypatch, "bumpy", height_mm=(-0.1, 0.1))
    plan = plan_of(strengths={"bumpy": 1.0, "diffuse_relief": 1.0})

    def spread(slope):
        def material():
            return build_skin_material("skin", plan, {"grown_slope": (slope[..., None] * [1.0, 0.0, 0.0]).astype(np.float32)})

        patch(material)
        bpy.context.scene.world = None
        sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
        sun.rotation_euler = (0.0, 1.4, 0.0)
        bpy.context.scene.collection.objects.link(sun)
        bpy.context.scene.cycles.samples = 256
        columns = render_linear().mean((0, 2))
        return columns.std() / columns.mean()

    # About 8 mm from crest to crest: 0.3 of a radian to a texel of 0.39 mm.
    across = np.broadcast_to(0.1 * 0.3 / 0.39 * np.cos(np.arange(512) * 0.3), (512, 512))
    waves, flat = spread(across), spread(np.zeros((512, 512)))
    print(f"waves {waves:.3f}, flat {flat:.3f}")
    assert waves > 4 * flat


def pixels_of(image):
    held = np.empty(image.size[0] * image.size[1] * 4, dtype=np.float32)
    image.pixels.foreach_get(held)
    return held.reshape(image.size[1], image.size[0], 4)


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("half", [False, True])
def test_data_images_hold_their_numbers(channels, half):
    """Negative, above 1, beside an alpha that is a number too; halves within half a unit of their 11 bits."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    numbers = np.random.default_rng(0).uniform(-3.0, 3.0, (9, 7, channels)).astype(np.float32)
    image = data_image("numbers", numbers, half)
    found = pixels_of(image)
    expected = np.ones((9, 7, 4), dtype=np.float32)
    expected[..., : max(3, channels)] = numbers
    np.testing.assert_allclose(found, expected, rtol=2.0**-11 if half else 0.0)
    assert image.packed_file is not None and image.colorspace_settings.is_data and image.alpha_mode == "CHANNEL_PACKED"
    assert "tmp" not in image.filepath


def test_half_maps_make_small_files():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    numbers = np.random.default_rng(0).random((256, 256, 4), dtype=np.float32)
    sizes = [data_image("numbers", numbers, half).packed_file.size for half in (False, True)]
    assert sizes[1] < 0.55 * sizes[0]  # noise, which does not compress


RENDER = """
import sys
sys.modules["sanguine"] = sys.modules["sanguine_core"] = None
import bpy
import numpy as np
bpy.ops.wm.open_mainfile(filepath={blend!r})
scene = bpy.context.scene
found = []
for x in (0.05, -0.05):
    bpy.data.objects["patch"].location.x = x
    bpy.ops.render.render()
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
    bpy.data.images["Render Result"].save_render({exr!r}, scene=scene)
    image = bpy.data.images.load({exr!r})
    pixels = np.empty(image.size[0] * image.size[1] * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    found.append(pixels.reshape(-1, 4)[:, :3].mean(0))
np.save({pixels!r}, found)
"""


def test_udim_tiles_are_in_the_file(tmp_path):
    """Two tiles, each with its own skin: as `sanguine skin` says, also where neither the add-on nor a file beside is."""
    plan = plan_of({"skin_map": ranges(LIGHT, DARK)})
    tiles = {1001: halves(values(LIGHT), values(LIGHT)), 1002: halves(values(DARK), values(DARK))}
    thing = patch(lambda: build_skin_material("skin", plan, {"skin_map": tiles}), uv_width=2.0)
    here = [seen(thing, half) for half in (-1, 1)]
    for rgb, skin in zip(here, (LIGHT, DARK), strict=True):
        assert difference(rgb, said(**skin)) < 1.5
    (image,) = (i for i in bpy.data.images if i.source == "TILED")
    assert [tile.number for tile in image.tiles] == [1001, 1002] and len(image.packed_files) == 2
    blend = str(tmp_path / "a.blend")
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    (tmp_path / "there").mkdir()
    (tmp_path / "a.blend").rename(tmp_path / "there" / "b.blend")
    found = str(tmp_path / "found.npy")
    script = RENDER.format(blend=str(tmp_path / "there" / "b.blend"), exr=str(tmp_path / "a.exr"), pixels=found)
    subprocess.run([sys.executable, "-c", script], check=True, stdout=subprocess.DEVNULL)
    # Same file, same seed, same machine.
    np.testing.assert_allclose(np.load(found), here, atol=1e-5)


def test_a_map_of_the_face_outlives_the_material():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    image = data_image("mine", halves(values(LIGHT), values(DARK)))
    plan = plan_of({"skin_map": ranges(LIGHT, DARK)}, {"relief": 0.5})
    material = build_skin_material("skin", plan, {"skin_map": image})
    assert material[MARK]["effects"] and len(bpy.data.images) == 2  # the map and the table
    group = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup")
    names = {item.name for item in group.node_tree.interface.items_tree if item.in_out == "INPUT"}
    assert "Melanin" not in names and "Relief" in names  # no slider moves what the map holds
    remove_skin_material(material)
    assert list(bpy.data.images) == [image]


@pytest.fixture
def face():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    sanguine.register()
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=6, y_subdivisions=6, size=0.2)
    grid = bpy.context.object
    grid.vertex_groups.new(name="sanguine_cheeks").add([0, 1, 7], 1.0, "REPLACE")
    grid.sanguine.quality = "draft"
    yield grid
    sanguine.unregister()


def labels(face):
    group = face.material_slots[0].material.node_tree.nodes[0].node_tree
    return {node.label for node in group.nodes if node.bl_idname == "ShaderNodeTexImage"}


def test_maps_stay_with_the_object(face, tmp_path):
    image = data_image("mine", halves(values(LIGHT), values(DARK)))
    face.sanguine.skin_map = image
    face.sanguine.residual = data_image("over", halves([1.0, 1.0, 1.0], [0.5, 0.5, 0.5]), half=True)
    # Unknown yet: as far as the sliders reach.
    melanin = {axis.id: axis for axis in operators.live_plan(face).axes}["melanin"]
    assert (melanin.low, melanin.high) == (PARAMETERS["melanin"].soft_min, PARAMETERS["melanin"].soft_max)
    assert bpy.ops.sanguine.apply_skin() == {"FINISHED"}
    melanin = {axis.id: axis for axis in operators.live_plan(face).axes}["melanin"]
    assert (melanin.low, melanin.high) == pytest.approx((LIGHT["melanin"], DARK["melanin"]))
    assert {"skin_map", "residual"} <= labels(face) and "anatomy" not in labels(face)
    # Painted on, the table reaches further the next time.
    painted = pixels_of(image)
    painted[0, 0, 1] = 0.2
    image.pixels.foreach_set(painted.ravel())
    bpy.ops.sanguine.apply_skin()
    melanin = {axis.id: axis for axis in operators.live_plan(face).axes}["melanin"]
    assert melanin.high == pytest.approx(0.2) and list(bpy.data.images).count(image) == 1
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    again = bpy.data.objects["Grid"]
    assert again.sanguine.skin_map.name == "mine"
    assert operators.live_plan(again).scene.maps["skin_map"]["melanin"][1] == pytest.approx(0.2)
    again.sanguine.skin_map = again.sanguine.residual = None
    bpy.context.view_layer.objects.active = again
    bpy.ops.sanguine.apply_skin()
    assert "anatomy" in labels(again) and not {"skin_map", "residual"} & labels(again)
    assert "mine" in bpy.data.images  # the artist's: no skin throws it away


def test_a_range_says_what_the_map_holds(face):
    image = data_image("mine", halves(values(LIGHT), values(DARK)))
    store_range(image, {"hemoglobin": (0.0, 0.1)})
    face.sanguine.skin_map = image
    bpy.ops.sanguine.apply_skin()
    assert set(operators.live_plan(face).scene.maps["skin_map"]) == {"hemoglobin"}
    assert stored_range(image)["hemoglobin"] == pytest.approx((DARK["hemoglobin"], LIGHT["hemoglobin"]))
    assert "anatomy" in labels(face)


def test_an_image_without_pixels_is_one_line(face):
    image = bpy.data.images.new("gone", 4, 4, float_buffer=True)
    image.source, image.filepath = "FILE", "//gone.exr"
    face.sanguine.skin_map = image
    with pytest.raises(RuntimeError, match="'gone' has no pixels"):
        bpy.ops.sanguine.apply_skin()
