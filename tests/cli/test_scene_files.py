"""`sanguine bake` and `sanguine render` with an artist's .blend: blood that is stale is baked anew, never rendered."""

import json
import subprocess
import sys
from pathlib import Path

import bpy
import pytest
import sanguine_core

import sanguine
from sanguine.blender.curves import find_curve, set_keys
from sanguine.blender.operators import emotion_bone
from support.house_config import write_config
from tests.blender.test_addon import grid


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "sanguine.cli.main", *map(str, arguments)], capture_output=True, text=True, timeout=300
    )


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A lit face with keyed anger, baked, and then keyed otherwise: its file holds stale blood."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    sanguine.register()
    try:
        face = grid()
        face.sanguine.quality = "draft"
        bpy.ops.sanguine.apply_skin()
        bpy.ops.mesh.primitive_plane_add(location=(0, 0, 5))  # something without blood
        bpy.ops.object.camera_add(location=(0.0, 0.0, 0.4))
        scene = bpy.context.scene
        scene.camera = bpy.context.object
        scene.world = bpy.data.worlds.new("white")
        scene.render.engine = "CYCLES"
        scene.cycles.samples, scene.cycles.shading_system = 1, True
        scene.cycles.use_denoising = False
        scene.render.resolution_x = scene.render.resolution_y = 16
        scene.frame_start, scene.frame_end, scene.frame_step = 1, 48, 24
        bpy.context.view_layer.objects.active = face
        bone = emotion_bone(face)
        for frame, value in ((1, 0.0), (6, 1.0)):
            bone["anger"] = value
            bone.keyframe_insert('["anger"]', frame=frame)
        bpy.ops.sanguine.bake_blood()
        set_keys(find_curve(face.parent, 'pose.bones["sanguine"]["anger"]'), [1, 6], [0.0, 0.1])
        path = tmp_path_factory.mktemp("scene") / "face.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
    finally:
        sanguine.unregister()
    return path


def peak(path):
    bpy.ops.wm.open_mainfile(filepath=str(path), use_scripts=False)
    bpy.context.scene.frame_set(48)
    return bpy.data.objects["Grid"]["blood_hemoglobin_cheeks"]


def test_a_check_says_what_is_stale_and_writes_nothing(scene):
    before = scene.read_bytes()
    done = run("bake", scene, "--check")
    assert done.returncode == 1, done.stderr
    report = json.loads(done.stdout)
    assert report["stale"] == ["Grid"] and "changed" in report["faces"]["Grid"]["was"]
    assert scene.read_bytes() == before


def test_baking_a_file_makes_it_fresh(scene, tmp_path):
    saved = tmp_path / "baked.blend"
    done = run("bake", scene, "--save", saved)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["faces"]["Grid"]["last"] == 48
    assert run("bake", saved, "--check").returncode == 0
    assert 0.0 < peak(saved) < 0.2 * peak(scene)


def test_a_render_bakes_first_and_resumes(scene, tmp_path):
    out = tmp_path / "out"
    done = run("render", scene, "--out", out)
    assert done.returncode == 0, done.stderr
    rows = json.loads((out / "manifest.json").read_text())["files"]
    assert [row["file"] for row in rows] == ["000001.exr", "000001.png", "000025.exr", "000025.png"]
    assert rows[0]["baked"] == {"Grid": [1, 48]}
    first = (out / "000025.exr").stat().st_mtime_ns
    assert run("render", scene, "--out", out, "--resume").returncode == 0
    assert (out / "000025.exr").stat().st_mtime_ns == first
    assert run("render", scene, "--out", tmp_path / "one", "--only", "000025").returncode == 0
    alone, in_sequence = (sanguine_core.read_image(str(folder / "000025.exr")) for folder in (tmp_path / "one", out))
    assert (alone == in_sequence).all()


def test_an_older_file_is_rendered_as_it_looks_and_not_written(tmp_path):
    old = Path(__file__).resolve().parents[1] / "data" / "version_1.blend"
    before = old.read_bytes()
    done = run("render", old, "--out", tmp_path / "old", "--only", "000001,000010")
    assert done.returncode == 0, done.stderr
    said = [line for line in done.stderr.splitlines() if "older Sanguine" in line]
    assert len(said) == 1 and "version 1" in said[0] and "until Apply Skin" in said[0] and "not written" in said[0]
    assert old.read_bytes() == before
    first, last = (sanguine_core.read_image(str(tmp_path / "old" / f"{name}.exr")) for name in ("000001", "000010"))
    skin = last.max(2) < 0.95  # the world behind it is white
    red, green, blue = last[skin].mean(0) / first[skin].mean(0)
    # Ten frames after the key blood has come a little way: it took 0.6 % of red, 1.0 % of green and 1.3 % of blue. The
    # samples are the same ones, and a change of shape alone would take the same share of all three.
    assert green < red - 0.002 and blue < red - 0.002, "anger is keyed, and the old skin follows its blood"

    saved = tmp_path / "saved.blend"
    assert "older Sanguine" in run("bake", old, "--save", saved).stderr
    done = run("render", saved, "--out", tmp_path / "new", "--only", "000010")
    assert done.returncode == 0 and "older" not in done.stderr, done.stderr
    assert (sanguine_core.read_image(str(tmp_path / "new" / "000010.exr")) == last).all(), "the same skin"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["bake", "nowhere.blend"], "nowhere.blend: no such file"),
        (["bake", "{text}"], "not a .blend file"),
        (["bake", "{scene}", "--scene", "Scenes", "--check"], "did you mean 'Scene'?"),
        (["bake", "{scene}", "--check", "--save", "x.blend"], "--check writes nothing"),
        (["render", "{scene}", "--out", "{out}", "--only", "000026"], "no image '000026'"),
        (["render", "{scene}", "--out", "{out}", "--quality", "draft"], "has its own settings"),
    ],
)
def test_what_is_wrong_is_one_line(scene, tmp_path, arguments, words):
    text = tmp_path / "text.blend"
    text.write_text("no file of Blender's")
    done = run(*(a.format(text=text, scene=scene, out=tmp_path / "out") for a in arguments))
    assert done.returncode == 2, done.stderr
    assert words in done.stderr and done.stderr.count("\n") == 1 and not done.stdout


def test_another_working_space_is_followed(scene, tmp_path, monkeypatch):
    monkeypatch.setenv("OCIO", str(write_config(tmp_path / "config.ocio", "ACEScg")))
    done = run("render", scene, "--out", tmp_path / "out", "--only", "000001")
    assert done.returncode == 0, done.stderr
    assert "1 skins solved for the file's working space" in done.stderr
    monkeypatch.delenv("OCIO")
    done = run("render", scene, "--out", tmp_path / "own", "--only", "000001")
    assert done.returncode == 0 and "working space" not in done.stderr
    red, own = (sanguine_core.read_image(str(tmp_path / folder / "000001.exr")).mean((0, 1))[0] for folder in ("out", "own"))
    assert red < 0.97 * own, "the red of light skin is less of ACEScg's red"
