"""`sanguine invert`: the bars on a small picture, files in and out, and one clear line for what is wrong."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sanguine_core as core
from sanguine.app import inverting
from sanguine.app.inverting import invert_file, invert_pixels
from sanguine.domain.errors import InputError
from sanguine.domain.parameters import default_skin, skin_rows

ROOT = Path(__file__).parents[2]
SIZE = 256


@pytest.fixture(scope="module")
def bench():
    spec = importlib.util.spec_from_file_location("bench_inversion", ROOT / "bench/inversion.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def optics(bench):
    return bench.Optics()


@pytest.fixture(scope="module")
def albedo(bench, optics):
    """(SIZE, SIZE, 3) float32, linear Rec. 709: light skin with broad and small features."""
    xyz = optics.xyz(bench.noise_points(SIZE, "light", 1)).reshape(-1, 3)
    return core.linear_rgb(np.ascontiguousarray(100 * xyz)).reshape(SIZE, SIZE, 3).astype(np.float32)


def srgb(linear):
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.clip(linear, 0, None) ** (1 / 2.4) - 0.055).astype(np.float32)


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "sanguine.cli.main", "invert", *map(str, arguments)], capture_output=True, text=True
    )


@pytest.mark.parametrize("name", ["very light", "light", "intermediate", "tan", "dark"])
def test_bars_of_the_round_trip(bench, optics, name):
    # The bars of docs/inversion.md, on the head with all that grows on it: what is rendered again from the estimate,
    # against the picture, by a table that the inversion does not know.
    points, there = bench.truth_points(SIZE, name, 1)
    tables = core.SkinInverse(skin_rows([default_skin()])[0])
    got = bench.round_trip(optics, tables, points, there)
    assert got["delta_e_median"] <= bench.BARS["delta_e_median"] and got["delta_e_p95"] <= bench.BARS["delta_e_p95"]
    if name in bench.LIGHT_TO_TAN:
        assert got["melanin_correlation"] >= bench.BARS["melanin_correlation"]
        assert got["hemoglobin_correlation"] >= bench.BARS["hemoglobin_correlation"]
    assert got["shading_kept"] == 0 and got["exposure"] == 1 and got["masked"] < 0.01


def test_numpy_does_the_same(bench, albedo):
    # The comparison of the bench is of one method, not of two: equal to what single precision leaves of ln.
    tables = core.SkinInverse(skin_rows([default_skin()])[0])
    model, made = bench.invert(tables, albedo, False, 0.0, noise=0.0)
    theirs = bench.NumpyInversion(tables)(albedo, model)
    skin = made["mask"] == 1
    np.testing.assert_allclose(made["skin_map"][skin], theirs["skin_map"][skin], rtol=5e-4)
    np.testing.assert_allclose(made["error"][skin], theirs["error"][skin], atol=0.01)
    np.testing.assert_allclose(made["residual"][skin], theirs["residual"][skin], rtol=2e-3)


def test_pixels(albedo):
    made = invert_pixels(np.dstack([albedo, np.ones((SIZE, SIZE), np.float32)]))
    assert made["skin_map"].shape == (SIZE, SIZE, 4) and made["residual"].shape == (SIZE, SIZE, 3)
    assert made["mask"].shape == made["error"].shape == (SIZE, SIZE)
    assert (made["skin_map"][..., 2] == np.float32(default_skin()["oil"])).all()
    # What the priors hold back of oxygenation: on average a hundredth of the light.
    assert np.abs(made["residual"] - 1).mean() < 0.01 and np.abs(made["residual"] - 1).max() < 0.1
    for column, key in ((0, "hemoglobin"), (1, "melanin"), (3, "oxygenation")):
        low, high = made["ranges"][key]
        inside = (made["skin_map"][..., column] >= low * 0.99) & (made["skin_map"][..., column] <= high * 1.01)
        assert inside.mean() > 0.995 and low < high
    assert made["report"]["share_masked"] < 0.01 and made["report"]["delta_e_2000"]["p95"] < 0.5
    with pytest.raises(InputError, match="rows x columns x 3 or 4"):
        invert_pixels(albedo[..., :2])
    with pytest.raises(InputError, match="rows x columns x 3 or 4"):
        invert_pixels(albedo[:0])


def test_spaces_are_one_skin(albedo):
    # The same colours in other primaries give the same chromophores; matrices from the names the core knows.
    to = {name: core.linear_rgb(np.eye(3) * 100, name).T for name in ("rec709", "rec2020", "acescg")}
    here = invert_pixels(albedo)["skin_map"]
    for name in ("rec2020", "acescg"):
        there = (albedo @ (to[name] @ np.linalg.inv(to["rec709"])).T).astype(np.float32)
        np.testing.assert_allclose(invert_pixels(there, name)["skin_map"], here, rtol=5e-3)
        np.testing.assert_allclose(invert_pixels(there, to[name])["skin_map"], here, rtol=5e-3)


def test_another_skin_explains_the_same_colour_otherwise(albedo):
    # Skin that scatters less is darker by itself, so less pigment is left to find; and it is no shading.
    dull = invert_pixels(albedo, skin=default_skin() | {"scatter_scale": 0.8, "oil": 0.0})
    assert np.median(dull["skin_map"][..., 1]) < 0.9 * np.median(invert_pixels(albedo)["skin_map"][..., 1])
    assert (dull["skin_map"][..., 2] == 0).all()
    assert dull["report"]["shading"]["kept"] == 0 and dull["report"]["shading"]["exposure"] == 1


@pytest.mark.parametrize("kind", ["a.png", "a.tif", "a.exr", "a.jpg"])
def test_files_of_every_kind(tmp_path, albedo, kind):
    path = tmp_path / kind
    linear = kind.endswith(".exr")
    core.write_image(path, albedo if linear else srgb(albedo), "uint16" if kind.endswith(".tif") else None)
    report = invert_file(path, tmp_path / "out")
    assert report["space"] == ("linear" if linear else "srgb") and report["share_masked"] < 0.02
    pixels, channels, header = core.read_exr_map(tmp_path / "out/chromophores.exr")
    assert channels == ["hemoglobin", "melanin", "oxygenation"]
    assert json.loads(header["sanguine:units"]) == {"hemoglobin": "1", "melanin": "1", "oxygenation": "1"}
    assert header["sanguine:schema"]
    assert header["sanguine:working_space"] == "rec709"
    truth = invert_pixels(albedo)["skin_map"]
    for k, column, bar in ((1, 1, 0.02), (0, 0, 0.05)):
        assert np.abs(np.log(pixels[..., k] / truth[..., column])).mean() < (bar if not kind.endswith("jpg") else 3 * bar)
    residual = core.read_exr_map(tmp_path / "out/residual.exr")
    assert sorted(residual[1]) == ["B", "G", "R"]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "chromophores.exr", "error.exr", "mask.exr", "residual.exr", "shading.exr",
    ]


def test_bands_change_nothing(tmp_path, albedo, monkeypatch):
    path = tmp_path / "a.exr"
    core.write_image(path, albedo, "float")
    invert_file(path, tmp_path / "one")
    monkeypatch.setattr(inverting, "_BAND_TEXELS", 64 * SIZE)
    invert_file(path, tmp_path / "two", threads=1)
    for file in (tmp_path / "one").iterdir():
        assert file.read_bytes() == (tmp_path / "two" / file.name).read_bytes()


def test_a_set_of_tiles(tmp_path, albedo):
    for tile in (1001, 1002):
        core.write_image(tmp_path / f"face.{tile}.png", srgb(albedo))
    seen = []
    report = invert_file(tmp_path / "face.1002.png", tmp_path / "out", progress=lambda *now: seen.append(now))
    assert [tile["tile"] for tile in report["tiles"]] == [1001, 1002]
    assert (tmp_path / "out/chromophores.1001.exr").is_file() and (tmp_path / "out/mask.1002.exr").is_file()
    assert seen[-1] == ("invert", 2 * SIZE, 2 * SIZE) and seen[0][0] == "overview"
    one, two = (core.read_exr_map(tmp_path / f"out/chromophores.{tile}.exr")[0] for tile in (1001, 1002))
    np.testing.assert_array_equal(one, two)


def test_through_the_program(tmp_path, albedo):
    path = tmp_path / "a.png"
    core.write_image(path, srgb(albedo))
    skin = tmp_path / "skin.json"
    skin.write_text(json.dumps({"skins": [{"epidermis_thickness_mm": 0.08}]}))
    result = run(path, "--out-dir", tmp_path / "out", "--skin", skin, "--shading", "off", "--noise", "0.2", "--json-progress")
    assert result.returncode == 0, result.stderr
    report = json.loads(result.stdout)
    assert report["sanguine"] == core.__version__ and report["noise_lab"] == pytest.approx(0.2)
    assert report["shading"]["kept"] == 0 and report["warnings"] == []
    assert set(report["ranges"]) == {"melanin", "hemoglobin", "oxygenation"}
    assert all(json.loads(line)["stage"] in ("overview", "invert") for line in result.stderr.splitlines())


def test_what_is_no_skin_is_said(tmp_path):
    path = tmp_path / "sky.png"
    core.write_image(path, np.full((32, 32, 3), (0.2, 0.4, 0.8), np.float32))
    report = invert_file(path, tmp_path / "out")
    assert report["share_masked"] == 1 and "colour of skin" in report["warnings"][0]


def test_bad_input_is_one_line(tmp_path, albedo):
    good = tmp_path / "a.png"
    core.write_image(good, srgb(albedo))
    grey, cut, text = tmp_path / "grey.png", tmp_path / "cut.exr", tmp_path / "text.png"
    core.write_image(grey, albedo[..., :1])
    core.write_image(cut, albedo)
    cut.write_bytes(cut.read_bytes()[:20000])
    text.write_text("no picture")
    skins = tmp_path / "skins.json"
    skins.write_text(json.dumps({"skins": [{}, {}]}))
    (tmp_path / "b.1001.png").write_bytes(good.read_bytes())
    core.write_image(tmp_path / "b.1002.png", albedo[..., :1])
    out = ["--out-dir", tmp_path / "out"]
    for arguments, words in (
        ([grey, *out], ["grey.png", "R, G and B"]),
        ([cut, *out], ["cut.exr"]),
        ([text, *out], ["text.png"]),
        ([tmp_path / "none.png", *out], ["none.png", "no such file"]),
        ([tmp_path / "b.1001.png", *out], ["b.1002.png", "R, G and B"]),
        ([good, *out, "--noise", "loud"], ["--noise", "'loud'"]),
        ([good, *out, "--noise", "-1"], ["--noise"]),
        ([good, *out, "--space", "aces"], ["--space", "acescg"]),
        ([good, *out, "--skin", skins], ["skins.json", "2 of them"]),
        ([good, "--out-dir", good / "sub"], ["cannot be written"]),
        ([good], ["--out-dir"]),
    ):
        result = run(*arguments)
        assert result.returncode == 2 and result.stdout == "", (arguments, result.stderr)
        lines = [line for line in result.stderr.splitlines() if not line.startswith("overview")]
        assert len(lines) == 1, result.stderr
        for word in words:
            assert word in lines[0]
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())
