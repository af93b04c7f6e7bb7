"""`sanguine maps`: chromophore maps of a face, in files."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sanguine_core

SANGUINE = Path(sys.executable).parent / "sanguine"

# A strip of skin, 200 x 100 mm, over the whole of tile 1001 or over two tiles.
OBJ = """v 0 0 0
v {x} 0 0
v {x} 0 0.1
v 0 0 0.1
vt 0 0
vt {u} 0
vt {u} 1
vt 0 1
f 1/1 2/2 3/3 4/4
"""


def run(*arguments, check=True):
    done = subprocess.run([SANGUINE, "maps", *map(str, arguments)], capture_output=True, text=True)
    if check:
        assert done.returncode == 0, done.stderr
    return done


def strip(folder, u=1):
    path = folder / "strip.obj"
    path.write_text(OBJ.format(u=u, x=0.2))
    return path


def test_a_head_of_ours_with_named_features(tmp_path):
    done = run("female", "--out-dir", tmp_path, "--features", "freckles,vessels=0.5", "--size", 256)
    report = json.loads(done.stdout)
    assert report["files"] == [str(tmp_path / "chromophores.exr")]
    assert {e["id"] for e in report["effects"] if e["active"]} >= {"anatomy", "freckles", "vessels"}
    pixels, channels, header = sanguine_core.read_exr_map(tmp_path / "chromophores.exr")
    assert pixels.shape == (256, 256, len(channels))
    assert json.loads(header["sanguine:features"]) == {"anatomy": 1.0, "freckles": 1.0, "vessels": 0.5}
    again = json.loads(run("female", "--out-dir", tmp_path, "--features", "freckles,vessels=0.5", "--size", 256).stdout)
    assert again["computed"]["texels_painted"] == again["computed"]["arrays_made"] == 0


def test_the_same_seed_gives_the_same_bytes(tmp_path):
    arguments = ("--tone", "monk-5", "--age", 40, "--seed", 11, "--size", 128, "--cache", "none")
    for name in "ab":
        run("male", "--out-dir", tmp_path / name, *arguments)
    a, b = ((tmp_path / name / "chromophores.exr").read_bytes() for name in "ab")
    assert a == b
    run("male", "--out-dir", tmp_path / "c", *arguments, "--seed", 12)
    assert (tmp_path / "c" / "chromophores.exr").read_bytes() != a


def test_a_mesh_file_and_the_spectrum_of_its_skin(tmp_path):
    report = json.loads(run(strip(tmp_path), "--out-dir", tmp_path, "--features", "freckles", "--size", 64,
                            "--spectral", "450:650:100").stdout)
    assert [Path(name).name for name in report["files"]] == ["chromophores.exr", "reflectance.exr"]
    pixels, channels, _ = sanguine_core.read_exr_map(tmp_path / "reflectance.exr")
    waves = [i for i, name in enumerate(channels) if "550" in name]
    assert len(waves) == 1 and 0.05 < pixels[..., waves[0]].mean() < 0.6


def test_several_tiles_are_several_files(tmp_path):
    report = json.loads(run(strip(tmp_path, u=2), "--out-dir", tmp_path, "--features", "freckles", "--size", 64).stdout)
    assert report["tiles"] == [1001, 1002]
    assert sorted(path.name for path in tmp_path.glob("*.exr")) == ["chromophores.1001.exr", "chromophores.1002.exr"]


def test_a_shot_says_who_and_what(tmp_path):
    shot = tmp_path / "shot.toml"
    shot.write_text('[rig]\nhead = "female"\n[effects]\nfreckles = 0.8\n[skin]\nmelanin = 0.04\n[[expression]]\nid = "rest"\n')
    run(shot, "--out-dir", tmp_path, "--size", 64)
    pixels, channels, header = sanguine_core.read_exr_map(tmp_path / "chromophores.exr")
    assert json.loads(header["sanguine:features"])["freckles"] == 0.8
    np.testing.assert_allclose(pixels[0, 0, channels.index("melanin")], 0.04, rtol=1e-3)  # half floats


def test_the_list_of_features(tmp_path):
    rows = json.loads(run("female", "--out-dir", tmp_path, "--features", "list").stdout)["features"]
    assert {"freckles", "vessels"} <= {row["id"] for row in rows}


@pytest.mark.parametrize("arguments, message", [
    (["female", "--features", "frekles"], "did you mean 'freckles'"),
    (["female", "--features", "freckles=2"], "freckles: 2.0 is outside 0 to 1"),
    (["female", "--features", "freckles=x"], "--features: 'freckles=x' is not ID=NUMBER"),
    (["female", "--size", "100000"], "--size: 100000 is outside 16 to 8192"),
    (["female", "--tone", "purple"], "tone: no such tone 'purple'"),
    (["female", "--age", "300"], "age"),
    (["female", "--seed", "-1"], "seed"),
    (["nobody.obj"], "nobody.obj: cannot be read: No such file"),
    (["nobody"], "nobody: cannot be read"),
    (["female", "--spectral", "100:900:10"], "--spectral"),
])
def test_a_wrong_word_is_one_line(tmp_path, arguments, message):
    done = run(*arguments, "--out-dir", tmp_path / "out", check=False)
    assert done.returncode == 2
    assert message in done.stderr and done.stderr.count("\n") == 1 and done.stdout == ""
    assert not (tmp_path / "out").exists()


def test_broken_and_empty_meshes_are_one_line(tmp_path):
    bare = tmp_path / "bare.obj"
    bare.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    empty = tmp_path / "empty.ply"
    empty.write_text("ply\n")
    for path, message in ((bare, "no UV map"), (empty, "empty.ply")):
        done = run(path, "--out-dir", tmp_path / "out", "--features", "freckles", check=False)
        assert done.returncode == 2 and message in done.stderr and done.stderr.count("\n") == 1, done.stderr
