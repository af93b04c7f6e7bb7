"""Spectral EXR: the layout of Fichet et al. 2021, and values against the solver texel by texel."""

import re
import warnings

import numpy as np
import pytest
import sanguine_core
from sanguine.app.map_files import MapHeader, write_maps
from sanguine.app.spectral import TOLERANCE, channel_name, write_spectral
from sanguine.domain.errors import InputError
from sanguine.domain.parameters import PARAMETERS, default_skin, skin_rows

RANDOM = np.random.default_rng(6)
COARSE = 0.05  # a small table, for what does not depend on its size
NM = np.arange(400.0, 701.0, 20.0)
SHAPE = (37, 23)
MAPS = {
    "hemoglobin": RANDOM.uniform(0.0, 0.08, SHAPE).astype(np.float32),
    "melanin": RANDOM.uniform(0.0, 0.3, SHAPE).astype(np.float32),
    "oxygenation": RANDOM.uniform(0.3, 1.0, SHAPE).astype(np.float32),
    "oil": RANDOM.uniform(0.0, 1.0, SHAPE).astype(np.float32),
}


def solved(maps) -> np.ndarray:
    """(H, W, wavelengths) by the solver alone, as `sanguine skin` does it."""
    rows = np.repeat(skin_rows([default_skin()]), MAPS["oil"].size, axis=0)
    for name, values in maps.items():
        rows[:, list(PARAMETERS).index(name)] = values.ravel()
    film = sanguine_core.surface(rows)[:, :1]
    return ((1 - film) * sanguine_core.reflectance(rows, NM)).reshape(*SHAPE, len(NM))


def read(path):
    """(pixels by wavelength, RGB, attributes), found by the names alone."""
    pixels, channels, attributes = sanguine_core.read_exr_map(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # colour-science misses matplotlib, which nobody needs here
        from colour.io.fichet2021 import match_groups_to_nm
    # The paper's pattern of names (section 3.1), as its authors' reader has it.
    pattern = re.compile(r"^((S([0-3]))|T)\.(\d*,?\d*([Ee][+-]?\d+)?)(Y|Z|E|P|T|G|M|k|h|da|d|c|m|u|n|p)?(m|Hz)$")
    found = {}
    for i, name in enumerate(channels):
        if match := pattern.match(name):
            assert match[1] == "T"  # reflective
            found[match_groups_to_nm(match[4], match[6], match[7])] = i
    nm = sorted(found)
    np.testing.assert_allclose(nm, NM, rtol=0, atol=1e-9)
    rgb = pixels[..., [channels.index(c) for c in "RGB"]]
    assert len(channels) == len(nm) + 3
    return pixels[..., [found[x] for x in nm]], rgb, attributes


def test_names():
    assert channel_name(550) == "T.550,000000nm"
    assert channel_name(412.5) == "T.412,500000nm"


def test_values_are_the_solvers(tmp_path):
    report = write_spectral(tmp_path / "a.exr", MAPS, default_skin(), NM, MapHeader(seed=5), half=False)
    spectra, rgb, attributes = read(tmp_path / "a.exr")
    # Twice what the table met at its own places: these texels are others.
    assert report.table_error <= TOLERANCE
    np.testing.assert_allclose(spectra, solved(MAPS), rtol=0, atol=2 * TOLERANCE)
    assert attributes["spectralLayoutVersion"] == "1.0"
    assert float(attributes["sanguine:table_error"]) == pytest.approx(report.table_error, rel=0.05)
    assert attributes["sanguine:seed"] == "5"
    assert set(report.nodes) == {"hemoglobin", "melanin", "oxygenation"}  # oil is no axis
    assert spectra.min() > 0 and spectra.max() < 1
    # R, G, B from the whole spectrum, not from the wavelengths that are written.
    colour_nm = np.arange(380.0, 781.0, 5.0)
    rows = skin_rows([default_skin() | {name: float(values[30, 7]) for name, values in MAPS.items()}])
    xyz = sanguine_core.xyz((1 - sanguine_core.surface(rows)[:, :1]) * sanguine_core.reflectance(rows, colour_nm), colour_nm)
    np.testing.assert_allclose(rgb[30, 7], sanguine_core.linear_rgb(xyz, "rec709")[0], rtol=0, atol=2 * TOLERANCE)


def test_half_costs_its_rounding(tmp_path):
    report = write_spectral(tmp_path / "a.exr", MAPS, default_skin(), NM, tolerance=COARSE)
    np.testing.assert_allclose(read(tmp_path / "a.exr")[0], solved(MAPS), rtol=2.0**-11, atol=2 * report.table_error)


def test_a_constant_channel_is_no_axis(tmp_path):
    maps = {"hemoglobin": np.full(SHAPE, 0.03, np.float32), "oil": np.zeros(SHAPE, np.float32)}
    report = write_spectral(tmp_path / "a.exr", maps, default_skin(), NM, half=False)
    assert report.nodes == {} and report.table_error == 0
    np.testing.assert_allclose(read(tmp_path / "a.exr")[0], solved(maps), rtol=0, atol=1e-6)


def test_a_map_file_is_the_same_as_its_arrays(tmp_path):
    names = tuple(sorted(MAPS))
    write_maps(tmp_path / "maps.exr", {1001: np.stack([MAPS[n] for n in names], axis=-1)}, names, MapHeader(), half=False)
    write_spectral(tmp_path / "a.exr", tmp_path / "maps.exr", default_skin(), NM, tolerance=COARSE)
    write_spectral(tmp_path / "b.exr", {name: MAPS[name] for name in names}, default_skin(), NM, tolerance=COARSE)
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"wavelengths_nm": []}, "1 to 61 are allowed"),
        ({"wavelengths_nm": np.linspace(400, 700, 62)}, "1 to 61 are allowed"),
        ({"wavelengths_nm": [500, 500]}, "increasing values from 380 to 780"),
        ({"wavelengths_nm": [300, 500]}, "increasing values from 380 to 780"),
        ({"wavelengths_nm": [np.nan]}, "increasing values from 380 to 780"),
        ({"maps": {}}, "there is none"),
        ({"maps": {"hemoglobine": MAPS["oil"]}}, "did you mean 'hemoglobin'?"),
        ({"maps": {"log_melanin": MAPS["oil"]}}, "'log_melanin' is no amount of a skin"),
        ({"maps": {"oil": MAPS["oil"], "melanin": MAPS["melanin"][1:]}}, "all need one and the same (H, W)"),
        ({"maps": {"melanin": MAPS["melanin"] * np.nan}}, "not finite"),
        ({"maps": {"melanin": MAPS["melanin"] + 5}}, "0 to 0.5 are allowed"),
        ({"maps": "absent.exr"}, "absent.exr: "),
        ({"path": "a.png"}, "a.png: cannot be written"),
    ],
)
def test_wrong_input_is_one_line_and_no_file(tmp_path, monkeypatch, change, says):
    monkeypatch.chdir(tmp_path)
    arguments = {"path": "a.exr", "maps": MAPS, "skin": default_skin(), "wavelengths_nm": NM} | change
    with pytest.raises(InputError) as caught:
        write_spectral(**arguments)
    assert says in str(caught.value) and "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_cancelling_leaves_nothing(tmp_path):
    with pytest.raises(sanguine_core.Cancelled):
        write_spectral(tmp_path / "a.exr", MAPS, default_skin(), NM, tolerance=COARSE, progress=lambda done, total: False)
    assert list(tmp_path.iterdir()) == []
