"""Colours against colour-science, an independent implementation of the CIE's documents."""

import colour
import numpy as np
import pytest

import sanguine_core as core

NM = np.arange(380.0, 781.0, 5.0)
SHAPE = colour.SpectralShape(380, 780, 5)
OBSERVER = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(SHAPE)
D65 = colour.SDS_ILLUMINANTS["D65"].copy().align(SHAPE)

DEFAULTS = [row["default"] for row in core.parameters()]


def spectra() -> np.ndarray:
    """Skins over the range of tones, and a steep, a flat and a narrow spectrum."""
    rows = np.array([DEFAULTS] * 4)
    rows[:, 0] = [0.01, 0.03, 0.1, 0.4]
    ramp = 1 / (1 + np.exp((600 - NM) / 8))
    return np.vstack([core.reflectance(rows, NM), ramp, np.full_like(NM, 0.5), np.exp(-(((NM - 540) / 10) ** 2))])


def oracle_xyz() -> np.ndarray:
    return np.array(
        [
            colour.sd_to_XYZ(colour.SpectralDistribution(row, NM), OBSERVER, D65, method="Integration")
            for row in spectra()
        ]
    )


def test_xyz_and_lab():
    xyz = core.xyz(spectra(), NM)
    np.testing.assert_allclose(xyz, oracle_xyz(), atol=2e-4)
    # Lab of both relative to the same white, the sum over the table.
    white = colour.XYZ_to_xy(core.xyz(np.ones((1, len(NM))), NM)[0])
    expected = colour.XYZ_to_Lab(oracle_xyz() / 100, white)
    assert np.linalg.norm(core.lab(xyz) - expected, axis=1).max() < 0.05
    # And to the tabulated white of D65, as others will compute it.
    d65 = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    tabulated = colour.XYZ_to_Lab(oracle_xyz() / 100, d65)
    assert np.linalg.norm(core.lab(xyz) - tabulated, axis=1).max() < 0.05


@pytest.mark.parametrize(
    ("name", "space"), [("rec709", "ITU-R BT.709"), ("rec2020", "ITU-R BT.2020"), ("acescg", "ACEScg")]
)
def test_linear_rgb(name, space):
    xyz = core.xyz(spectra(), NM)
    white = colour.XYZ_to_xy(core.xyz(np.ones((1, len(NM))), NM)[0])
    expected = colour.XYZ_to_RGB(
        xyz / 100, colour.RGB_COLOURSPACES[space], illuminant=white, chromatic_adaptation_transform="Bradford"
    )
    # Published matrices are rounded to four or more digits; ours are derived from the primaries.
    np.testing.assert_allclose(core.linear_rgb(xyz, name), expected, atol=3e-4)
