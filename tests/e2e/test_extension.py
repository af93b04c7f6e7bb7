"""The zip that users get: built, installed into an empty Blender user folder, enabled, and used from there."""

import json
import os
import subprocess
import sys
from pathlib import Path
from site import getsitepackages as site_packages

import pytest

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

    The interpreter sees Blender and the head data, and nothing else of this environment: what the add-on imports
    has to come out of the zip.
    """
    user = tmp_path_factory.mktemp("blender_user")
    site = tmp_path_factory.mktemp("site")
    for name in ("bpy", "numpy", "numpy.libs", "anny"):
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
