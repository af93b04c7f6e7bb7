"""`sanguine fit`: the answer and its shape, and one clear line for every kind of wrong table."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sanguine_core
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sanguine.app.fitting import fit_report, read_spectra
from sanguine.app.skin_report import report
from sanguine.domain.errors import InputError
from sanguine.domain.parameters import default_skin, skin_rows
from sanguine.domain.skin_preset import read_preset

NM = np.arange(400.0, 701.0, 10.0)
HEADER = "id," + ",".join(f"{nm:g}" for nm in NM)
SKINS = [
    {"melanin": 0.02, "hemoglobin": 0.012, "oxygenation": 0.75, "epidermis_thickness_mm": 0.08},
    {"melanin": 0.15, "hemoglobin": 0.02, "oxygenation": 0.65, "epidermis_thickness_mm": 0.08},
]


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "sanguine.cli.main", "fit", *map(str, arguments)], capture_output=True, text=True
    )


def table(path, header, rows):
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def row(name, values):
    return name + "," + ",".join(f"{value:.6f}" for value in values)


def bare():
    return sanguine_core.reflectance(skin_rows([default_skin() | skin for skin in SKINS]), NM)


def with_surface(share=0.035):
    return share + (1 - share) / (1 - 0.076812) * bare()


@pytest.mark.parametrize("specular", ["included", "excluded"])
def test_finds_the_skins_and_whether_the_surface_is_in_them(tmp_path, specular):
    spectra = with_surface() if specular == "included" else bare()
    path = table(tmp_path / "s.csv", HEADER, [row("light", spectra[0]), row("dark", spectra[1])])
    out = tmp_path / "out.json"
    result = run(path, "--out", out)
    assert result.returncode == 0, result.stderr
    assert result.stdout == "" and f"specular taken as {specular}" in result.stderr
    report = json.loads(out.read_text())
    assert report["sanguine"] == sanguine_core.__version__ and report["specular"] == specular
    assert [answer["id"] for answer in report["results"]] == ["light", "dark"]
    for answer, skin, measured in zip(report["results"], SKINS, spectra, strict=True):
        assert answer["rmse"] < 5e-4 and answer["delta_e_2000"] < 0.1
        np.testing.assert_allclose(answer["reflectance"], measured, atol=2e-3)
        assert answer["parameters"].keys() == answer["standard_errors"].keys() == answer["identifiability"].keys()
        assert ("surface_reflectance" in answer["parameters"]) == (specular == "included")
        # What a spectrum shows well; the rest is tested against its standard errors in tests/native/test_fit.cpp.
        assert answer["parameters"]["hemoglobin"] == pytest.approx(skin["hemoglobin"], rel=0.1)
        assert answer["parameters"]["oxygenation"] == pytest.approx(skin["oxygenation"], abs=0.03)
        assert answer["parameters"]["melanin_blend"] == pytest.approx(0.74, abs=0.04)


def test_json_on_standard_output_alone_and_progress_lines(tmp_path):
    path = table(tmp_path / "s.csv", HEADER, [row("a", with_surface()[0])])
    result = run(path, "--json-progress", "--specular", "included")
    assert result.returncode == 0
    assert json.loads(result.stdout)["results"][0]["id"] == "a"
    lines = [json.loads(line) for line in result.stderr.splitlines()]
    assert lines[-1] == {"stage": "fit", "done": 1, "total": 1}


def test_columns_outside_the_model_are_left_out_and_named(tmp_path):
    nm = [360.0, 370.0, *NM, 790.0]
    header = "id," + ",".join(f"{w:g}" for w in nm)
    path = table(tmp_path / "s.csv", header, [row("a", [0.1, 0.1, *with_surface()[0], 0.6])])
    spectra = read_spectra(path)
    assert spectra.ignored_nm == [360, 370, 790]
    np.testing.assert_array_equal(spectra.wavelength_nm, NM)
    assert fit_report(spectra)["ignored_nm"] == [360, 370, 790]


def test_freed_and_uninformed_parameters_are_told(tmp_path):
    spectra = read_spectra(table(tmp_path / "s.csv", HEADER, [row("a", with_surface()[0]), row("flat", [0.4] * 31)]))
    held, freed = fit_report(spectra, "included"), fit_report(spectra, "included", ["bilirubin_umol_per_l"])
    assert "bilirubin_umol_per_l" not in held["results"][0]["parameters"]
    assert "bilirubin_umol_per_l" in freed["results"][0]["parameters"]
    flat = held["results"][1]
    assert any("does not follow" in warning for warning in flat["warnings"])
    for name in flat["at_bound"]:
        assert any(name in warning for warning in flat["warnings"])
    for answer in held["results"]:
        silent = [name for name, share in answer["identifiability"].items() if share < 0.1]
        assert all(any(name in warning for warning in answer["warnings"]) for name in silent)
        for pair in answer["correlations"]:
            assert abs(pair["correlation"]) > 0.9 and len(pair["parameters"]) == 2


def test_a_table_without_rows_is_an_empty_answer(tmp_path):
    result = run(table(tmp_path / "s.csv", HEADER, []))
    assert result.returncode == 0 and json.loads(result.stdout)["results"] == []


GOOD = row("a", [0.3] * 31)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["empty", "id,380"]),
        ("name,400,410\n", ["line 1", "'name'", "'id'"]),
        (HEADER.replace("450", "red") + "\n" + GOOD, ["line 1", "'red'", "wavelength"]),
        (HEADER.replace("450", "nan") + "\n" + GOOD, ["line 1", "'nan'", "wavelength"]),
        (HEADER.replace("450", "430") + "\n" + GOOD, ["line 1", "430 nm after 440", "increase"]),
        (HEADER.replace("450", "440") + "\n" + GOOD, ["line 1", "440 nm after 440", "increase"]),
        ("id,400,500,600\na,0.1,0.2,0.3\n", ["3 wavelengths", "needs 8"]),
        (HEADER + "\n" + GOOD.replace("a,0.300000", "a,"), ["line 2 (a)", "400 nm", "missing"]),
        (HEADER + "\n" + GOOD + "\n" + GOOD, ["line 3", "'a'", "line 2 already"]),
        (HEADER + "\n" + GOOD[1:], ["line 2", "id: missing"]),
        (HEADER + "\n" + GOOD + ",0.3", ["line 2", "33 cells", "header has 32"]),
        (HEADER + "\n" + GOOD.replace("a,0.300000", "a,x"), ["400 nm", "'x' is not a number"]),
        (HEADER + "\n" + GOOD.replace("a,0.300000", "a,nan"), ["400 nm", "nan", "0 to 1"]),
        (HEADER + "\n" + GOOD.replace("a,0.300000", "a,-0.01"), ["400 nm", "-0.01", "0 to 1"]),
        (HEADER + "\n" + row("a", [35.0] * 31), ["400 nm", "35", "0 to 1", "percent"]),
        (HEADER + "\n" + '"a', ["not valid CSV"]),
        ("id,400\n\x00", ["line 2"]),
    ],
    ids=lambda value: None if isinstance(value, list) else repr(value[-30:]),
)
def test_bad_tables_are_one_line_and_status_2(tmp_path, text, words):
    path = tmp_path / "s.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_spectra(path)
    message = str(caught.value)
    assert "\n" not in message and "s.csv" in message
    for word in words:
        assert word in message


def test_bad_input_through_the_program(tmp_path):
    path = table(tmp_path / "s.csv", HEADER, [row("a", [35.0] * 31)])
    good = table(tmp_path / "good.csv", HEADER, [GOOD])
    for arguments, words in (
        ([path], ["s.csv", "line 2", "percent"]),
        ([tmp_path / "none.csv"], ["none.csv", "no such file"]),
        ([good, "--free", "melanin_blnd"], ["melanin_blnd", "did you mean 'melanin_blend'"]),
        ([good, "--specular", "maybe"], ["--specular", "maybe"]),
    ):
        result = run(*arguments)
        assert result.returncode == 2 and result.stdout == "", result.stderr
        assert len(result.stderr.strip().splitlines()) == 1
        for word in words:
            assert word in result.stderr


def test_a_byte_order_mark_and_blank_lines_do_no_harm(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text("\ufeff" + HEADER + "\r\n\r\n" + GOOD + "\r\n", encoding="utf-8", newline="")
    assert read_spectra(path).ids == ["a"]


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text(alphabet='id,0123456789.\n"e-+x \x00\u00e9', max_size=80))
def test_any_text_is_read_or_refused_in_one_line(tmp_path, text):
    path = tmp_path / "any.csv"
    path.write_text(text, encoding="utf-8")
    try:
        read_spectra(path)
    except InputError as error:
        assert "\n" not in str(error)


def test_the_example_is_of_the_presets_and_gives_them_back():
    """examples/spectra.csv, which README.md fits: what leaves two of the skin presets, to four digits."""
    root = Path(__file__).resolve().parents[2]
    spectra = read_spectra(root / "examples/spectra.csv")
    skins = [read_preset(root / f"rigs/presets/sanguine/skin/{name.title()}.json").skin for name in spectra.ids]
    made = report(list(spectra.ids), skins, spectra.wavelength_nm)["results"]
    np.testing.assert_allclose(spectra.reflectance, [row["reflectance"] for row in made], atol=5.1e-5)
    for skin, row in zip(skins, fit_report(spectra)["results"]):
        for name in ("hemoglobin", "oxygenation"):
            # Scattering, thickness and pigment may stand for each other in a spectrum: a sixth of the blood at most was seen.
            assert row["parameters"][name] == pytest.approx(skin[name], rel=0.2)
        assert row["delta_e_2000"] < 0.1
