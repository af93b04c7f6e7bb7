"""A frame of a timeline is one picture: in its sequence, alone on a farm node, and from the file without the add-on."""

import os
import subprocess
import sys

import numpy as np
import pytest
from sanguine.app.batch import render_batch
from sanguine.blender.render import BlenderRenderer
from sanguine.domain.files import read_json
from sanguine.domain.shot import read_shot
from support.patch import read_linear

# Anger leaves late and fear is on its way: blood that no look at frame 120 alone could tell.
SHOT = """
rig = { head = "female" }
effects = { anatomy = 1.0, relief = 0.5 }
image = { width = 48, height = 60, samples = 4 }

[timeline]
fps = 24
first = 18
last = 120
step = 34
key = [
    { frame = 1, pulse = 1.0 },
    { frame = 8, pulse = 1.0, emotions = { anger = 1.0 } },
    { frame = 70, pulse = 1.0, heart_rate = 90, emotions = { anger = 1.0 } },
    { frame = 80, emotions = { fear = 1.0 } },
    { frame = 115, emotions = { fear = 0.5 } },
]
"""

CLI = "import sys; from sanguine.cli.main import main; sys.exit(main())"

# Nothing of ours can be imported here: neither the add-on nor the native module.
WITHOUT_US = """
import sys
sys.modules["sanguine"] = sys.modules["sanguine_core"] = None
import bpy
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
scene = bpy.context.scene
scene.frame_set(120)
bpy.ops.render.render()
settings = scene.render.image_settings
settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
bpy.data.images["Render Result"].save_render(sys.argv[2], scene=scene)
"""


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    """The folder of the whole sequence, with its .blend, and the shot."""
    folder = tmp_path_factory.mktemp("sequence")
    shot = folder / "shot.toml"
    shot.write_text(SHOT)
    render_batch(read_shot(shot), shot, folder / "frames", BlenderRenderer(), keep_blend=True)
    return folder


def run(*arguments):
    done = subprocess.run([sys.executable, "-c", *map(str, arguments)], capture_output=True, text=True, env=os.environ)
    assert done.returncode == 0, done.stdout + done.stderr


def test_frame_alone_is_the_frame_of_the_sequence(sequence, tmp_path):
    run(CLI, "render", sequence / "shot.toml", "--out", tmp_path, "--only", "000120")
    in_sequence, alone = (read_linear(folder / "000120.exr") for folder in (sequence / "frames", tmp_path))
    assert in_sequence.std() > 0.01, "the picture is empty"
    assert np.array_equal(in_sequence, alone)
    # Blood of earlier frames is in it.
    rows = {row["file"]: row for row in read_json(sequence / "frames/manifest.json")["files"]}
    assert {"perfusion", "oxygenation"} <= set(rows["000120.exr"]["effects"])


def test_frame_without_the_add_on(sequence, tmp_path):
    """Plain Blender, in a process that cannot import us, from a copy of the file in another folder."""
    moved = tmp_path / "moved.blend"
    moved.write_bytes((sequence / "frames/subject.blend").read_bytes())
    run(WITHOUT_US, moved, tmp_path / "a.exr")
    assert np.array_equal(read_linear(sequence / "frames/000120.exr"), read_linear(tmp_path / "a.exr"))
    # The file plays: another frame of it is another picture.
    run(WITHOUT_US.replace("frame_set(120)", "frame_set(52)"), moved, tmp_path / "b.exr")
    assert np.array_equal(read_linear(sequence / "frames/000052.exr"), read_linear(tmp_path / "b.exr"))
    assert not np.array_equal(read_linear(tmp_path / "a.exr"), read_linear(tmp_path / "b.exr"))
