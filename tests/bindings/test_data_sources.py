"""The data of native/data: provenance, checksums, and what independent sources say of the same quantities."""

import hashlib
from pathlib import Path

import colour
import numpy as np
import pytest

import sanguine_core as core

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "native/data"
SHAPE = colour.SpectralShape(380, 780, 5)


def table(path: Path) -> np.ndarray:
    return np.genfromtxt([line for line in path.read_text(encoding="utf-8").splitlines() if line[0].isdigit()],
                         delimiter=",")


def test_every_file_has_its_checksum_and_every_table_its_source():
    listed = dict(line.split()[::-1] for line in (DATA / "SHA256SUMS").read_text().splitlines())
    files = {path.name for path in DATA.iterdir()} - {"SHA256SUMS"}
    assert set(listed) == {name for name in files if not name.endswith(".txt")}
    for name, digest in listed.items():
        assert hashlib.sha256((DATA / name).read_bytes()).hexdigest() == digest, name
    for path in (*DATA.glob("*.csv"), *(ROOT / "tests/data").glob("hemoglobin_*.csv")):
        head = [line for line in path.read_text(encoding="utf-8").splitlines() if not line[0].isdigit()]
        assert any(line.startswith("# Source: ") for line in head), path
        assert head[-1].startswith("wavelength_nm,"), path
        assert (np.diff(table(path)[:, 0]) > 0).all(), path


def test_observer_and_illuminants_are_those_of_the_cie():
    # colour-science has them at 1 nm and more digits: half a unit of our last printed one.
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(SHAPE)
    np.testing.assert_allclose(table(DATA / "cie_1931_2_degree.csv")[:, 1:], observer.values, atol=1e-8)
    for name in ("D65", "A"):
        values = colour.SDS_ILLUMINANTS[name].copy().align(SHAPE).values
        np.testing.assert_allclose(table(DATA / f"cie_{name.lower()}.csv")[:, 1], values, atol=5e-5)


def test_illuminant_a_is_planck_s_law():
    # CIE 015:2018: 100 (560 / nm)^5 (exp(1.435e7 / (2848 * 560)) - 1) / (exp(1.435e7 / (2848 nm)) - 1), 6 digits.
    nm, power = table(DATA / "cie_a.csv").T
    planck = 100 * (560 / nm) ** 5 * np.expm1(1.435e7 / (2848 * 560)) / np.expm1(1.435e7 / (2848 * nm))
    np.testing.assert_allclose(power, planck, rtol=1e-5)


@pytest.mark.parametrize("illuminant", ["D65", "A"])
def test_colour_under_either_light(illuminant):
    nm = np.arange(380.0, 781.0, 5.0)
    spectra = 0.2 + 0.5 / (1 + np.exp((np.array([[480.0], [580.0], [640.0]]) - nm) / 15))
    ours = core.xyz(spectra, nm, illuminant=illuminant)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(SHAPE)
    light = colour.SDS_ILLUMINANTS[illuminant].copy().align(SHAPE)
    theirs = [colour.sd_to_XYZ(colour.SpectralDistribution(row, nm), observer, light, method="Integration")
              for row in spectra]  # fmt: skip
    np.testing.assert_allclose(ours, theirs, atol=2e-4)
    white = core.xyz(np.ones((1, len(nm))), nm, illuminant=illuminant)
    np.testing.assert_allclose(core.lab(white, illuminant=illuminant), [[100, 0, 0]], atol=1e-9)
    expected = colour.XYZ_to_Lab(np.array(theirs) / 100, colour.XYZ_to_xy(white[0]))
    np.testing.assert_allclose(core.lab(ours, illuminant=illuminant), expected, atol=1e-3)
    with pytest.raises(ValueError, match="illuminant: F2"):
        core.xyz(spectra, nm, illuminant="F2")


# Prahl's table over the other source's. Outside 436-454 nm the sources agree as laboratories do; the bounds are the
# differences as they are, rounded up, so that a table with shifted or swapped columns fails by far. In HbO2 above
# 600 nm the values are a hundredth of the peak's, and Dervieux's have an artefact at 590-600 nm.
@pytest.mark.parametrize(
    ("source", "substance", "low", "high", "median", "worst"),
    [
        ("zijlstra", "HbO2", 450, 580, 0.03, 0.12),
        ("zijlstra", "HbO2", 600, 700, 0.15, 0.35),
        ("zijlstra", "Hb", 454, 580, 0.14, 0.24),
        ("zijlstra", "Hb", 610, 780, 0.07, 0.35),
        ("dervieux2020", "HbO2", 380, 454, 0.04, 0.17),
        ("dervieux2020", "HbO2", 454, 580, 0.12, 0.31),
        ("dervieux2020", "Hb", 380, 436, 0.07, 0.18),
        ("dervieux2020", "Hb", 454, 580, 0.08, 0.26),
        ("dervieux2020", "Hb", 610, 780, 0.07, 0.32),
    ],
)
def test_hemoglobin_agrees_with_a_second_source(source, substance, low, high, median, worst):
    difference = np.abs(ratio(source, substance, low, high) - 1)
    assert np.median(difference) < median and difference.max() < worst


@pytest.mark.parametrize(("source", "low"), [("zijlstra", 1.45), ("dervieux2020", 1.3)])
def test_prahl_s_deoxyhemoglobin_is_an_outlier_on_the_edge_of_the_soret_band(source, low):
    # Known, and the reason for the fit's wider noise at 438-453 nm (sanguine/fit.hpp). Should the table ever be
    # mended, this fails and that weight goes.
    inside = ratio(source, "Hb", 438, 454)
    assert inside.min() > low and inside.max() < 2.4
    assert abs(ratio(source, "Hb", 456, 458) - 1).max() < 0.15


def ratio(source: str, substance: str, low: float, high: float) -> np.ndarray:
    """Ours over theirs at the wavelengths low <= nm < high that both have."""
    ours, theirs = table(DATA / "hemoglobin.csv"), table(ROOT / f"tests/data/hemoglobin_{source}.csv")
    column = {"HbO2": 1, "Hb": 2}[substance]
    nm = np.intersect1d(ours[:, 0], theirs[:, 0])
    nm = nm[(nm >= low) & (nm < high)]
    assert len(nm)
    return ours[np.isin(ours[:, 0], nm), column] / theirs[np.isin(theirs[:, 0], nm), column]
