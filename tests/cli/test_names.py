"""`sanguine names`: real files in, JSON out, one line for what is wrong."""

import json
import struct

import pytest

from sanguine.cli.main import main
from sanguine.domain.facs import ARKIT

OWN = """
label = "House rig"
source = ["our rigging department"]
[keys]
grin = { mouthSmileLeft = 0.5, mouthSmileRight = 0.5 }
"""


def glb(path, data):
    text = json.dumps(data).encode()
    text += b" " * (-len(text) % 4)
    path.write_bytes(struct.pack("<5I", 0x46546C67, 2, 20 + len(text), len(text), 0x4E4F534A) + text)
    return path


def gltf(*meshes):
    return {"asset": {"version": "2.0"}, "meshes": [{"name": name, "primitives": [{}], "extras": {"targetNames": keys}} for name, keys in meshes]}


def run(capsys, *arguments):
    status = main(["names", *map(str, arguments)])
    out, err = capsys.readouterr()
    return status, json.loads(out) if out else None, err


def test_a_binary_gltf_is_read_mesh_by_mesh(tmp_path, capsys):
    face = glb(tmp_path / "face.vrm", gltf(("Body", []), ("Face", [f"{key[0].upper()}{key[1:]}" for key in ARKIT.keys]), ("Teeth", ["JawOpen"])))
    status, report, _ = run(capsys, face)
    assert status == 0
    body, teeth = report["meshes"]
    assert (body["mesh"], body["convention"], body["missing"]) == ("1 Face", "arkit", [])
    assert body["keys"]["JawOpen"] == {"jawOpen": 1.0} and body["sure"] > 0.95
    assert teeth["mesh"] == "2 Teeth" and len(teeth["missing"]) == 51


def test_names_in_primitives_are_read_too(tmp_path, capsys):
    path = tmp_path / "face.gltf"
    path.write_text(json.dumps({"meshes": [{"primitives": [{"extras": {"targetNames": ["jawOpen"]}}]}]}))
    assert run(capsys, path)[1]["meshes"][0]["keys"] == {"jawOpen": {"jawOpen": 1.0}}


def test_a_list_with_names_of_ones_own(tmp_path, capsys):
    keys, own, out = tmp_path / "keys.txt", tmp_path / "house.toml", tmp_path / "report.json"
    keys.write_text("Basis\nGrin\n\nwobble\n")
    own.write_text(OWN)
    assert run(capsys, keys, "--own", own, "--out", out)[0] == 0
    (mesh,) = json.loads(out.read_text())["meshes"]
    assert (mesh["convention"], mesh["label"]) == ("house", "House rig")
    assert mesh["keys"] == {"Grin": {"mouthSmileLeft": 0.5, "mouthSmileRight": 0.5}} and mesh["unknown"] == ["wobble"]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("empty.txt", b"\n", "no names"),
        ("cut.glb", b"glTF\2\0", "not a binary glTF 2.0 file"),
        ("old.glb", struct.pack("<5I", 0x46546C67, 1, 20, 0, 0), "not a binary glTF 2.0 file"),
        ("torn.vrm", struct.pack("<5I", 0x46546C67, 2, 40, 20, 0x4E4F534A) + b'{"meshes": [', "not a binary glTF 2.0 file"),
        ("list.gltf", b"[]", "not a glTF 2.0 file"),
        ("odd.gltf", b'{"meshes": [3]}', "not a glTF 2.0 file"),
        ("plain.gltf", b'{"meshes": [{"primitives": [{}]}]}', "no mesh in it has shape keys"),
        ("bytes.txt", b"\xff\xfe", "not UTF-8"),
    ],
)
def test_a_wrong_file_is_one_line(tmp_path, capsys, name, content, message):
    path = tmp_path / name
    path.write_bytes(content)
    status, report, err = run(capsys, path)
    assert status == 2 and report is None
    assert err.startswith(f"sanguine: {path}: ") and message in err and err.count("\n") == 1


def test_a_file_that_is_not_there(tmp_path, capsys):
    for name in ("no.glb", "no.txt", "no.gltf"):
        assert run(capsys, tmp_path / name)[2] == f"sanguine: {tmp_path / name}: no such file\n"
