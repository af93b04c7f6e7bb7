"""Bad input: one clear line on standard error that names file, key and mend; status 2; nothing on standard output."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "five_expressions.toml"
SKIN = {"skins": [{"id": "a", "melanin": 0.05}]}


def run(*arguments, **kwargs):
    return subprocess.run(
        [sys.executable, "-m", "sanguine.cli.main", *map(str, arguments)], capture_output=True, text=True, **kwargs
    )


def assert_one_line(result, *words):
    assert result.returncode == 2, result.stderr
    assert result.stdout == ""
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1, result.stderr
    for word in words:
        assert word in lines[0]


def skin(tmp_path, data, *flags):
    path = tmp_path / "skin.json"
    path.write_text(data if isinstance(data, str) else json.dumps(data))
    return run("skin", path, *flags)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"skins": [{"id": "a", "melannin": 0.05}]}, ["skin.json", "melannin", "did you mean 'melanin'"]),
        ({"skins": [{"id": "a", "melanin": 7}]}, ["skin.json", "melanin", "7", "0 to"]),
        ({"skins": [{"id": "a", "melanin": "dark"}]}, ["melanin", "dark", "not a number"]),
        ({"skins": [{"id": "a", "hemoglobin": True}]}, ["hemoglobin", "not a number"]),
        ({"skin": []}, ["skins", "missing"]),
        ({"skins": [3]}, ["skins.0", "not an object"]),
        ({"skins": [{"oxyhemoglobin": 0.01}]}, ["deoxyhemoglobin", "missing"]),
        ({"skins": [{"oxyhemoglobin": 0.01, "deoxyhemoglobin": 0.01, "oxygenation": 1}]}, ["oxygenation", "together"]),
        ('{"skins": [}', ["not valid JSON", "line 1"]),
        ('{"skins": [{"melanin": NaN}]}', ["NaN"]),
        ("\ufeff{}", ["JSON"]),
        ('{"skins": [{"melanin": 1' + "0" * 400 + "}]}", ["melanin", "outside"]),
        ('{"skins": [{"melanin": 1' + "0" * 5000 + "}]}", ["not valid JSON"]),
    ],
    ids=lambda v: None if isinstance(v, list) else str(v)[:40],
)
def test_bad_skin(tmp_path, data, words):
    assert_one_line(skin(tmp_path, data), *words)


@pytest.mark.parametrize("text", ["red", "700:400:10", "380:780:0", "300:500:10", "nan", "400:500:1e-9"])
def test_bad_wavelengths(tmp_path, text):
    assert_one_line(skin(tmp_path, SKIN, "--wavelengths", text), "--wavelengths", text)


def test_more_numbers_than_memory(tmp_path):
    many = {"skins": [{}] * 300}
    assert_one_line(skin(tmp_path, many, "--wavelengths", "380:780:0.005"), "--wavelengths", "300 skins", "at most")


def test_missing_file(tmp_path):
    assert_one_line(run("skin", tmp_path / "none.json"), "none.json", "no such file")


def test_unwritable_output(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    path = tmp_path / "skin.json"
    path.write_text(json.dumps(SKIN))
    assert_one_line(run("skin", path, "--out", blocked / "out.json"), str(blocked), "cannot be written")


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda t: t.replace("[rig]", "[rig"), ["not valid TOML", "line"]),
        (lambda t: t.replace("[rig]\n", "").replace('head = "female"\n', ""), ["rig", "neither"]),
        (lambda t: t.replace('head = "female"', 'head = "femal"'), ["rig.head", "did you mean 'female'"]),
        (lambda t: t.replace("width = 512", "widht = 640"), ["image.widht", "did you mean 'width'"]),
        (lambda t: t.replace("width = 512", "width = 4"), ["image.width", "16"]),
        (lambda t: t.replace("melanin = 0.020", "melanin = 2"), ["melanin", "outside"]),
        (lambda t: t.replace("anger = 1.0", "anger = 1.5"), ["expression.0.emotions.anger", "1"]),
        (lambda t: t.replace("anger = 1.0", "angre = 1.0"), ["angre", "did you mean 'anger'"]),
        (lambda t: t.replace("vessels = 0.6", "vesels = 0.6"), ["vesels", "did you mean 'vessels'"]),
        (lambda t: t.replace('id = "sad"', 'id = "fear"'), ["two have the id 'fear'"]),
        (lambda t: t.replace('id = "sad"', 'id = "contact_sheet"'), ["two pictures", "contact_sheet"]),
        (lambda t: t.replace('id = "sad"', 'id = "../sad"'), ["expression.3.id", "file"]),
        (lambda t: t.replace('id = "sad"\n', ""), ["expression.3.id", "missing"]),
    ],
    ids=["broken", "no-rig", "head", "unknown-key", "range", "skin-range", "over", "emotion", "effect", "twice", "taken", "path", "no-id"],
)
@pytest.mark.parametrize("verb", ["plan", "render"])
def test_bad_shot(tmp_path, edit, words, verb):
    text = EXAMPLE.read_text()
    broken = edit(text)
    assert broken != text
    path = tmp_path / "shot.toml"
    path.write_text(broken)
    flags = ["--out", tmp_path / "out"] if verb == "render" else []
    assert_one_line(run(verb, path, *flags), "shot.toml", *words)


def test_unwritable_folder(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    assert_one_line(run("render", EXAMPLE, "--out", blocked / "out"), str(blocked), "cannot be written")


def test_no_blender_module(tmp_path):
    (tmp_path / "sitecustomize.py").write_text("import sys; sys.modules['bpy'] = None")
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    result = run("render", EXAMPLE, "--out", tmp_path / "out", env=environment)
    assert_one_line(result, "no Blender module")
    assert not (tmp_path / "out").exists()


def test_unknown_image(tmp_path):
    assert_one_line(run("render", EXAMPLE, "--out", tmp_path / "out", "--only", "angr"), "angr", "did you mean 'anger'")


def test_help_needs_no_native_module(tmp_path):
    (tmp_path / "sitecustomize.py").write_text("import sys; sys.modules['sanguine_core'] = None")
    result = run("--help", env=os.environ | {"PYTHONPATH": str(tmp_path)})
    assert result.returncode == 0 and "render" in result.stdout


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--quality", "finel"], ["--quality", "did you mean 'final'"]),
        (["--delta-e", "0.001"], ["--delta-e", "no measured setting", "the best"]),
        (["--delta-e", "nan"], ["--delta-e", "above 0"]),
        (["--delta-e", "much"], ["--delta-e", "much"]),
        (["--quality", "final", "--delta-e", "2"], ["not allowed with"]),
    ],
)
@pytest.mark.parametrize("verb", ["plan", "render"])
def test_bad_quality(tmp_path, verb, flags, words):
    out = ["--out", str(tmp_path / "out")] if verb == "render" else []
    assert_one_line(run(verb, EXAMPLE, *flags, *out), *words)
    assert not (tmp_path / "out").exists()
