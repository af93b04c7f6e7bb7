"""`sanguine skin`: the fields that others script against, and what holds between them."""

import json
import subprocess
import sys

import numpy as np
import pytest
from sanguine.app.skin_report import read_skins, report
from sanguine.domain.parameters import default_skin

NM = np.arange(380.0, 781.0, 10.0)


def one(**skin):
    return report(["a"], [default_skin() | skin], NM)["results"][0]


@pytest.fixture(scope="module", params=[0.01, 0.05, 0.3], ids=lambda m: f"melanin {m}")
def answer(request):
    return one(melanin=request.param, oil=0.0)


def test_fields_of_the_contract(answer):
    assert set(answer) == {
        "id", "wavelength_nm", "reflectance", "surface_reflectance", "XYZ", "Lab", "linear_rec709", "profile"
    }
    assert set(answer["profile"]) == {"radius_mm", "rec709_per_mm2", "lobes", "clamped"}
    assert len(answer["profile"]["lobes"]) <= 4
    json.dumps(answer, allow_nan=False)


def test_profile_integrates_to_the_colour(answer):
    """Within 1 %: the trapezoid rule a reader would use on these radii, with the disk inside the first one."""
    radius = np.array(answer["profile"]["radius_mm"])
    profile = np.array(answer["profile"]["rec709_per_mm2"])
    ring = profile * (2.0 * np.pi * radius)[:, None]
    total = (0.5 * (ring[1:] + ring[:-1]) * np.diff(radius)[:, None]).sum(0) + ring[0] * radius[0]
    np.testing.assert_allclose(total, answer["linear_rec709"], rtol=0.01, atol=1e-4)


def test_lobes_keep_the_energy_and_are_not_negative(answer):
    weights = np.array([lobe["weight"] for lobe in answer["profile"]["lobes"]])
    widths = np.array([lobe["d_mm"] for lobe in answer["profile"]["lobes"]])
    assert np.all(weights >= 0) and np.all(widths > 0)
    np.testing.assert_allclose(weights.sum(0), answer["linear_rec709"], rtol=1e-6)


def test_light_is_never_made(answer):
    reflectance = np.array(answer["reflectance"])
    assert np.all(reflectance > 0)
    assert np.all(reflectance + answer["surface_reflectance"] < 1)
    # Diffuse Fresnel reflection of an index of 1.4 (Egan and Hilgeman 1973; p13 of the reference gives 0.0768).
    assert answer["surface_reflectance"] == pytest.approx(0.0768, abs=2e-4)


def test_oil_takes_once_what_it_reflects():
    bare, oily = one(oil=0.0), one(oil=1.0)
    film = (oily["surface_reflectance"] - bare["surface_reflectance"]) / (1 - bare["surface_reflectance"])
    np.testing.assert_allclose(oily["reflectance"], (1 - film) * np.array(bare["reflectance"]), rtol=1e-6)
    weights = [np.sum([lobe["weight"] for lobe in a["profile"]["lobes"]], axis=0) for a in (bare, oily)]
    np.testing.assert_allclose(weights[1], (1 - film) * weights[0], rtol=1e-6)


def test_either_pair_of_blood_is_the_same_skin(tmp_path):
    path = tmp_path / "skins.json"
    path.write_text(json.dumps({"skins": [
        {"id": "total", "hemoglobin": 0.02, "oxygenation": 0.75},
        {"id": "pair", "oxyhemoglobin": 0.015, "deoxyhemoglobin": 0.005},
        {"id": "bloodless", "oxyhemoglobin": 0, "deoxyhemoglobin": 0},
    ]}))
    ids, skins = read_skins(path)
    assert ids == ["total", "pair", "bloodless"]
    assert skins[0] == pytest.approx(skins[1])
    assert skins[2]["hemoglobin"] == 0.0


@pytest.mark.parametrize("wavelengths", ["380:780:10", "450,550.5,650", "550"])
def test_wavelengths_and_standard_output(tmp_path, wavelengths):
    path = tmp_path / "skins.json"
    path.write_text('{"skins": [{}]}')
    command = [sys.executable, "-m", "sanguine.cli.main", "skin", str(path), "--wavelengths", wavelengths]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    answer = json.loads(result.stdout)["results"][0]
    assert len(answer["reflectance"]) == len(answer["wavelength_nm"]) == (41 if ":" in wavelengths else wavelengths.count(",") + 1)


def test_no_skins_is_no_results(tmp_path):
    path = tmp_path / "skins.json"
    path.write_text('{"skins": []}')
    assert report(*read_skins(path), NM)["results"] == []
