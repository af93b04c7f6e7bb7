"""A saved .blend renders the same pixels where the add-on is not installed, and from another folder."""

import subprocess
import sys
from pathlib import Path

import numpy as np

TESTS = Path(__file__).resolve().parents[1]

BUILD = """
import sys
sys.path.insert(0, {tests!r})
import bpy
import numpy as np
from sanguine.blender.controls import set_controls
from sanguine.blender.face import add_face
from sanguine.blender.skin import apply_skin
from sanguine.blender.stage import set_stage
from sanguine.domain.effects import Frame, Scene
from sanguine.domain.effects.regions import FACE_REGIONS
from sanguine.domain.parameters import default_skin
from sanguine.domain.plan import check_strengths, make_plan
from support.patch import empty_scene, render_linear

scene = empty_scene(96, 120, 8)
face = add_face("female")
set_stage(scene, **face.stage_landmarks, size=(96, 120))
frames = (Frame("neutral"), Frame("anger", {{"anger": 1.0}}))
strengths = check_strengths({{"mottle": 0.5, "relief": 0.5}}, "test")
apply_skin(face.skin, face.rig, make_plan(Scene(default_skin(), frames, strengths, FACE_REGIONS)))
set_controls(face.rig, {{"anger": 0.8}})
bpy.ops.wm.save_as_mainfile(filepath={blend!r})
np.save({pixels!r}, render_linear())
"""

# Nothing of ours can be imported here: neither the add-on nor the native module.
RENDER = """
import sys
sys.modules["sanguine"] = sys.modules["sanguine_core"] = None
import bpy
import numpy as np
bpy.ops.wm.open_mainfile(filepath={blend!r})
scene = bpy.context.scene
bpy.ops.render.render()
settings = scene.render.image_settings
settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
bpy.data.images["Render Result"].save_render({exr!r}, scene=scene)
image = bpy.data.images.load({exr!r})
pixels = np.empty(image.size[0] * image.size[1] * 4, dtype=np.float32)
image.pixels.foreach_get(pixels)
np.save({pixels!r}, pixels.reshape(image.size[1], image.size[0], 4)[..., :3])
"""


def test_same_pixels_without_the_add_on_from_another_folder(tmp_path):
    first, second = tmp_path / "here", tmp_path / "there"
    first.mkdir()
    second.mkdir()
    blend = str(first / "face.blend")
    built = str(tmp_path / "built.npy")
    subprocess.run([sys.executable, "-c", BUILD.format(tests=str(TESTS), blend=blend, pixels=built)], check=True)
    moved = (first / "face.blend").rename(second / "moved.blend")
    alone = str(tmp_path / "alone.npy")
    subprocess.run(
        [sys.executable, "-c", RENDER.format(blend=str(moved), exr=str(second / "a.exr"), pixels=alone)], check=True
    )
    expected, found = np.load(built), np.load(alone)
    assert expected.std() > 0.01, "the picture is empty"
    # Same file, same seed, same machine: only the float rounding of stored EXR pixels may differ.
    np.testing.assert_allclose(found, expected, atol=1e-6)
