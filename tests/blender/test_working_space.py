"""Colour management: skin has one colour in every working space, maps stay numbers, and views touch only the display."""

import ast
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
import sanguine
import sanguine_core
from sanguine.blender import looks
from sanguine.blender.colour import READ_IN, follow_working_space, strange_images, working_space
from sanguine.blender.images import data_image
from sanguine.blender.material import build_skin_material
from sanguine.blender.render import quiet, save_render
from sanguine.domain.effects import Frame, Scene
from sanguine.domain.parameters import default_skin
from sanguine.domain.plan import make_plan
from sanguine.domain.quality import preset
from support.house_config import write_config, xyz_of
from support.patch import camera_above, empty_scene, plane, render_linear, white_world
from tests.blender.test_addon import draw, grid

SPACES = {"rec709": "sRGB", "rec2020": "ITU-R BT.2020", "acescg": "ACEScg"}
ROOT = Path(__file__).resolve().parents[2]
CHOOSES = hasattr(bpy.data, "colorspace")
"""Since Blender 5.0 a file chooses its working space."""


def patch(oil=0.0):
    """A flat patch of live skin in a white world. Returns its material."""
    scene = empty_scene(16, 16, 64)
    white_world(scene)
    plan = make_plan(Scene(default_skin() | {"hemoglobin": 0.03, "oil": oil}, (Frame("0"),), live=True), preset("draft").settings)
    material = build_skin_material("patch", plan, {})
    plane(material)
    camera_above(20.0)
    return material


def mean():
    pixels = render_linear().reshape(-1, 3)
    return pixels.mean(0), (pixels.std(0) / np.sqrt(len(pixels))).max()


def table():
    (image,) = (i for i in bpy.data.images if i.name == "patch table")
    pixels = np.empty(image.size[0] * image.size[1] * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(-1, 4)[:, :3]


def choose(name, convert=False):
    """Sets the file's working space, found by what it does: what a configuration calls it is its own affair."""
    for called in choices():
        bpy.ops.wm.set_working_color_space(working_space=called, convert_colors=convert)
        if isinstance(working_space(), str) and working_space() == name:
            return
    raise AssertionError(f"no {name}")


def choices():
    with pytest.raises(TypeError) as error:
        bpy.ops.wm.set_working_color_space(working_space="?")
    return re.findall(r"'([^']+)'", str(error.value).partition(" in ")[2])


def test_blenders_own_space_is_known():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert working_space() == "rec709"


@pytest.mark.skipif(not CHOOSES, reason="before Blender 5.0 a configuration chooses, not the file: see the test below")
@pytest.mark.parametrize("convert", [False, True])
def test_a_change_of_the_working_space_is_followed(convert):
    patch()
    before, error = mean()
    expected = xyz_of("sRGB") @ before
    solved = table()
    for name in ("acescg", "rec2020", "rec709"):
        choose(name, convert)
        (strange,) = strange_images()
        assert strange.name == "patch table" and strange.colorspace_settings.is_data
        assert follow_working_space([strange]) == [] and strange_images() == []
        found, noise = mean()
        # Four standard errors of two pictures, and 1e-3 for float sums; lobes are fitted per space, energy kept.
        np.testing.assert_allclose(xyz_of(SPACES[name]) @ found, expected, atol=4 * (error + noise) + 1e-3)
        assert (name == "rec709") == np.array_equal(table(), solved)
    assert [image.name for image in bpy.data.images if "table" in image.name] == ["patch table"]


@pytest.mark.skipif(not CHOOSES, reason="before Blender 5.0 a file does not choose")
def test_the_panel_says_so_and_one_click_follows():
    from sanguine.blender.panels import SANGUINE_PT_main

    bpy.ops.wm.read_factory_settings(use_empty=True)
    sanguine.register()
    try:
        face = grid()
        face.sanguine.quality = "draft"
        bpy.ops.sanguine.apply_skin()
        follow = "sanguine.follow_working_space"
        assert follow not in draw(SANGUINE_PT_main) and not bpy.ops.sanguine.follow_working_space.poll()
        choose("acescg")
        assert follow in draw(SANGUINE_PT_main)
        residual = data_image("made up", np.ones((2, 2, 3), np.float32))
        residual[READ_IN] = json.dumps("rec709")
        assert bpy.ops.sanguine.follow_working_space() == {"FINISHED"}
        assert follow not in draw(SANGUINE_PT_main)
        assert [image.name for image in strange_images()] == ["made up"], "a picture has to be read anew"
        choose("rec709")
        bpy.ops.sanguine.apply_skin()
        assert follow not in draw(SANGUINE_PT_main), "Apply Skin solves for the space that the file has"
    finally:
        sanguine.unregister()


@pytest.mark.skipif(not CHOOSES, reason="before Blender 5.0 a file does not choose")
def test_colours_of_the_example_heads_are_those_of_the_sources():
    def reds():
        n = looks.Nodes("look")
        material = n.principled(Base_Color=(0.5, 0.1, 0.05))
        mixed = n.mix(0.5, (0.5, 0.1, 0.05), (0.2, 0.2, 0.2)).node
        (shader,) = (node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
        sockets = [shader.inputs["Base Color"], *(s for s in mixed.inputs if s.identifier in ("A_Color", "B_Color"))]
        return np.array([socket.default_value[:3] for socket in sockets])

    bpy.ops.wm.read_factory_settings(use_empty=True)
    own = reds()
    np.testing.assert_allclose(own[0], (0.5, 0.1, 0.05), atol=1e-7)
    choose("acescg")
    # Single precision, and Blender's rounding of the matrices.
    np.testing.assert_allclose(reds() @ xyz_of("ACEScg").T, own @ xyz_of("sRGB").T, atol=1e-3)


CUSTOM = """
import json, sys
sys.path[:0] = [{tests!r}, {root!r}]
import bpy, numpy as np
from sanguine.blender.colour import follow_working_space, strange_images, working_space
from tests.blender import test_working_space as t
bpy.ops.wm.open_mainfile(filepath={blend!r})
space = working_space()
strange = [image.name for image in strange_images()]
said = follow_working_space(strange_images())
followed, noise = t.mean()
pngs = {{view: t.png(view, {folder!r}) for view in t.views()}}
t.patch()
images = [(i.name, i.colorspace_settings.is_data, i.packed_file is not None) for i in bpy.data.images if i.name.endswith("table")]
made, _ = t.mean()
np.save({folder!r} + "/table.npy", t.table())
print("ANSWER" + json.dumps({{"space": space if isinstance(space, str) else space.tolist(), "strange": strange, "said": said,
    "followed": followed.tolist(), "made": made.tolist(), "noise": noise, "images": images, "pngs": pngs}}))
"""


def views():
    """The view transforms of the configuration; only this message has them."""
    with pytest.raises(TypeError) as error:
        bpy.context.scene.view_settings.view_transform = "?"
    return re.findall(r"'([^']+)'", str(error.value).partition(" in ")[2])


def png(view, folder):
    """Bytes of the scene's last picture, as a PNG of a view transform."""
    scene = bpy.context.scene
    scene.view_settings.view_transform = view
    path = Path(folder) / f"{view}.png"
    save_render(scene, path, "PNG")
    return float(sanguine_core.read_image(str(path))[..., :3].mean())


@pytest.mark.parametrize("name", ["acescg", "Display P3"])
def test_a_configuration_of_its_own(name, tmp_path):
    """One working space that Sanguine knows under other names, one that it does not; a file comes from Blender's own."""
    config = write_config(tmp_path / "config.ocio", SPACES.get(name, name))
    patch()
    expected, error = mean()
    solved = table()
    blend = str(tmp_path / "patch.blend")
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    script = CUSTOM.format(tests=str(ROOT / "tests"), root=str(ROOT), blend=blend, folder=str(tmp_path))
    done = subprocess.run([sys.executable, "-c", script], env=os.environ | {"OCIO": str(config)}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout.partition("ANSWER")[2].splitlines()[0])
    to_xyz = xyz_of(SPACES.get(name, name))
    if name in SPACES:
        assert answer["space"] == name
    else:
        # Blender's matrices are single precision, by way of AP0: 5e-4 were seen.
        np.testing.assert_allclose(answer["space"], np.linalg.inv(to_xyz), atol=2e-3)
    assert answer["strange"] == ["patch table"] and answer["said"] == []
    for kind in ("followed", "made"):
        np.testing.assert_allclose(to_xyz @ answer[kind], xyz_of("sRGB") @ expected, atol=4 * (error + answer["noise"]) + 1e-3)
    assert answer["images"] == [["patch table", True, True]], "numbers, under a configuration without a space of that name"
    assert set(answer["pngs"]) == {"House Film", "House Raw"} and answer["pngs"]["House Film"] > answer["pngs"]["House Raw"] > 0.05
    # Another space is another table, but numbers as they were written: a table of the same space would be the same.
    assert not np.array_equal(np.load(tmp_path / "table.npy"), solved)


def test_views_change_the_display_alone(tmp_path):
    patch(oil=0.3)
    scene = bpy.context.scene
    wanted = [view for view in views() if view.startswith(("Standard", "AgX", "ACES"))]
    assert {"Standard", "AgX"} <= set(wanted) and (not CHOOSES or any(view.startswith("ACES") for view in wanted))
    pictures, linear = {}, []
    for view in wanted:
        scene.view_settings.view_transform = view
        linear.append(render_linear())
        pictures[view] = png(view, tmp_path)
    assert all(np.array_equal(linear[0], other) for other in linear[1:])
    assert len({round(value, 3) for value in pictures.values()}) == len(wanted), pictures


def test_every_map_is_numbers_and_reads_as_written():
    with quiet():
        bpy.ops.wm.read_factory_settings(use_empty=True)
    written = np.random.default_rng(7).random((4, 5, 3), dtype=np.float32) * 4 - 1
    image = data_image("numbers", written)
    found = np.empty(4 * 5 * 4, dtype=np.float32)
    image.pixels.foreach_get(found)
    assert image.colorspace_settings.is_data
    np.testing.assert_array_equal(found.reshape(4, 5, 4)[..., :3], written)


def test_no_name_of_a_colour_space_stands_in_the_sources():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with pytest.raises(TypeError) as error:
        bpy.data.images.new("x", 1, 1).colorspace_settings.name = "?"
    names = set(re.findall(r"'([^']+)'", str(error.value).partition(" in ")[2])) | {"Non-Color", "ACEScg", "Linear Rec.709"}
    assert "sRGB" in names
    found = []
    for path in sorted((ROOT / "addon" / "blender").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and node.value in names:
                found.append(f"{path.name}:{node.lineno}: {node.value}")
    assert not found
