"""Maps as files: what is written is read; what is wrong is one line that names the file."""

import json

import numpy as np
import pytest
import sanguine_core
from hypothesis import given
from hypothesis import strategies as st
from sanguine.app import map_files
from sanguine.app.inverting import invert_file
from sanguine.app.map_files import MapHeader, bands, read_header, read_maps, write_maps
from sanguine.domain.errors import InputError
from sanguine.domain.parameters import PARAMETERS, default_skin, skin_rows

HEADER = MapHeader(mesh="0a1b", seed=7, features={"freckles": 0.5, "moles": 1.0})
NAMES = ("melanin", "hemoglobin", "oxygenation")
PIXELS = np.random.default_rng(4).random((12, 10, 3), dtype=np.float32) * np.float32(0.2)


def one_line(path, **arguments) -> str:
    with pytest.raises(InputError) as caught:
        read_maps(path, **arguments)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def write_raw(path, attributes, names=NAMES, pixels=PIXELS):
    """A map whose header somebody else wrote."""
    sanguine_core.write_exr_map(path, pixels, list(names), attributes, half=False)


def good_attributes(**changes):
    made = map_files.header_attributes(NAMES, HEADER)
    return {k: v for k, v in (made | {f"sanguine:{key}": value for key, value in changes.items()}).items() if v is not None}


@pytest.mark.parametrize("half", [True, False])
def test_a_map_comes_back(tmp_path, half):
    assert write_maps(tmp_path / "new" / "a.exr", {1001: PIXELS}, NAMES, HEADER, half) == [tmp_path / "new" / "a.exr"]
    maps = read_maps(tmp_path / "new" / "a.exr", NAMES)
    assert (maps.channels, maps.header) == (NAMES, HEADER)
    expected = PIXELS.astype(np.float16).astype(np.float32) if half else PIXELS
    np.testing.assert_array_equal(maps.tiles[1001], expected)
    assert read_maps(tmp_path / "new" / "a.exr").channels == tuple(sorted(NAMES))  # as every EXR has them


def test_units_are_those_of_the_schema(tmp_path):
    for parameter in PARAMETERS.values():
        if parameter.channel:
            assert map_files.CHANNELS[parameter.channel] == parameter.unit
    write_maps(tmp_path / "a.exr", {1001: PIXELS}, ("melanin", "height_mm", "ink_per_mm"), HEADER)
    attributes = sanguine_core.read_exr_map_info(tmp_path / "a.exr")[3]
    assert json.loads(attributes["sanguine:units"]) == {"melanin": "1", "height_mm": "mm", "ink_per_mm": "1/mm"}
    assert attributes["sanguine:version"] == sanguine_core.__version__


def test_every_channel_of_a_feature_has_a_unit():
    for feature in sanguine_core.features():
        for change in feature["changes"]:
            name = change["channel"]
            assert ("oxygenation_change" if name == "oxygenation" else name) in map_files.CHANNELS


def test_a_set_of_tiles(tmp_path):
    tiles = {1001: PIXELS, 1012: PIXELS[:5, :4] * 0.5}
    paths = write_maps(tmp_path / "a.<UDIM>.exr", tiles, NAMES, HEADER, half=False)
    assert [path.name for path in paths] == ["a.1001.exr", "a.1012.exr"]
    for path in ("a.<UDIM>.exr", "a.1012.exr"):
        maps = read_maps(tmp_path / path, NAMES, tiles=[1001, 1012])
        for tile, pixels in tiles.items():
            np.testing.assert_array_equal(maps.tiles[tile], pixels)
    assert list(read_maps(tmp_path / "a.<UDIM>.exr", tiles=[1012]).tiles) == [1012]
    assert one_line(tmp_path / "a.<UDIM>.exr", tiles=[1001, 1002]).endswith("tile 1002 missing, the UVs use it")


def test_what_an_inversion_writes_is_read(tmp_path):
    skins = skin_rows([default_skin() | {"hemoglobin": h} for h in (0.01, 0.02, 0.03, 0.04)])
    nm = np.arange(380.0, 781.0, 5.0)
    rgb = sanguine_core.linear_rgb(sanguine_core.xyz(sanguine_core.reflectance(skins, nm), nm), "rec709")
    picture = np.tile(rgb.astype(np.float32)[None], (4, 4, 1)).repeat(4, axis=1)
    for tile in (1001, 1002):
        sanguine_core.write_image(tmp_path / f"skin.{tile}.exr", picture, "float")
    invert_file(tmp_path / "skin.<UDIM>.exr", tmp_path)
    maps = read_maps(tmp_path / "chromophores.<UDIM>.exr", ["hemoglobin", "melanin", "oxygenation"], tiles=[1001, 1002])
    assert maps.tiles[1002].shape == (4, 64, 3) and maps.header.mesh == ""
    for name in ("error", "mask", "shading", "residual"):
        assert list(read_maps(tmp_path / f"{name}.1001.exr").tiles) == [1001, 1002]


def test_tiles_of_different_maps_are_refused(tmp_path):
    write_maps(tmp_path / "a.1001.exr", {1001: PIXELS}, NAMES, HEADER)
    write_maps(tmp_path / "a.1002.exr".replace("1002", "<UDIM>"), {1002: PIXELS}, NAMES, HEADER.model_copy(update={"seed": 8}))
    assert "seed differs from that of a.1001.exr" in one_line(tmp_path / "a.<UDIM>.exr")
    write_maps(tmp_path / "a.<UDIM>.exr", {1002: PIXELS[..., :2]}, NAMES[:2], HEADER)
    assert "a.1002.exr: channels hemoglobin, melanin differ" in one_line(tmp_path / "a.<UDIM>.exr")


def test_none_of_a_set_appears_when_one_cannot_be_written(tmp_path):
    for bad in (PIXELS * np.nan, PIXELS + 1e6, PIXELS[..., :2], PIXELS[:0], PIXELS[..., 0]):
        with pytest.raises(InputError, match=r"a\.1002\.exr: "):
            write_maps(tmp_path / "a.<UDIM>.exr", {1001: PIXELS, 1002: bad}, NAMES, HEADER)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("path", "tiles", "channels", "says"),
    [
        ("a.png", {1001: PIXELS}, NAMES, "the extension .exr is allowed"),
        ("a.exr", {}, NAMES, "no tile"),
        ("a.exr", {1001: PIXELS, 1002: PIXELS}, NAMES, "<UDIM> is missing from the name"),
        ("a.<UDIM>.exr", {1000: PIXELS}, NAMES, "1000 is no UDIM tile"),
        ("a.exr", {1001: PIXELS}, ("melanin", "haemoglobin", "oil"), "did you mean 'hemoglobin'?"),
        ("a.exr", {1001: PIXELS}, ("oil", "oil", "melanin"), "a channel name is used twice"),
    ],
)
def test_what_cannot_be_written_is_one_line(tmp_path, path, tiles, channels, says):
    with pytest.raises(InputError) as caught:
        write_maps(tmp_path / path, tiles, channels, HEADER)
    assert says in str(caught.value) and "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"schema": None}, "is no map of Sanguine"),
        ({"schema": "2"}, "version 2 is newer than 1, which Sanguine"),
        ({"schema": "one"}, "'one' is no version number"),
        ({"schema": "0"}, "'0' is no version number"),
        ({"schema": "9" * 5000}, "is no version number"),
        ({"units": None}, "sanguine:units: missing"),
        ({"units": "{"}, "sanguine:units: not valid JSON"),
        ({"units": "[" * 60000}, "sanguine:units: not valid JSON"),
        ({"units": " " * 100_000}, "100000 bytes are too many"),
        ({"units": "[]"}, "channel 'hemoglobin' is in None"),
        ({"units": json.dumps(dict.fromkeys(NAMES, "1") | {"melanin": "percent"})}, "channel 'melanin' is in 'percent', '1' is needed"),
        ({"seed": "-1"}, "seed: "),
        ({"seed": "9" * 20}, "seed: "),
        ({"features": "[1]"}, "features: "),
        ({"features": '{"freckles": NaN}'}, "features.freckles: "),
        ({"features": '{"freckles": "much"}'}, "features.freckles: "),
        ({"mesh": "a b"}, "mesh: "),
    ],
)
def test_a_wrong_header_is_one_line(tmp_path, changes, says):
    path = tmp_path / "a.exr"
    write_raw(path, good_attributes(**changes))
    line = one_line(path)
    assert line.startswith(f"{path}: ") and says in line and len(line) < 400 + len(str(path))


def test_wrong_channels_and_values_are_one_line(tmp_path):
    path = tmp_path / "a.exr"
    write_maps(path, {1001: PIXELS}, NAMES, HEADER)
    assert "channel 'oil' is missing, the file has hemoglobin, melanin, oxygenation" in one_line(path, channels=["oil"])
    assert "channel 'red' is none of Sanguine's" in one_line(path, channels=["red"])
    assert "was made for another mesh" in one_line(path, mesh="ffff")
    assert read_maps(path, mesh="0a1b").header == HEADER
    write_raw(path, good_attributes(), ("a", "b", "c"))
    assert "channel 'a' is none of Sanguine's" in one_line(path)
    write_raw(path, good_attributes(), NAMES, PIXELS + 1)
    assert "channel 'hemoglobin' holds 1" in one_line(path) and "0 to 0.25 are allowed" in one_line(path)
    for bad in (np.nan, np.inf, -np.inf):
        pixels = np.full((4, 4, 1), 0.1, np.float32)
        pixels[1, 2] = bad
        sanguine_core.write_image(path, pixels, "float")  # EXR without our header: refused for that first
        assert "is no map of Sanguine" in one_line(path)
        with pytest.raises(InputError, match="'melanin' holds values that are not finite"):
            map_files.check_channel(pixels[..., 0], "melanin", "a")


def test_hard_bounds_survive_half(tmp_path):
    """The bound 0.1 of a range rounds upward in half: what was legal is not refused on the way back."""
    for parameter in PARAMETERS.values():
        if parameter.channel:
            pixels = np.array([[[parameter.hard_min], [parameter.hard_max]]], np.float32)
            write_maps(tmp_path / "a.exr", {1001: pixels}, [parameter.channel], HEADER)
            read_maps(tmp_path / "a.exr")


@given(st.data())
def test_damaged_files_are_one_line_or_a_map(tmp_path_factory, data):
    folder = tmp_path_factory.getbasetemp() / "damaged-maps"
    folder.mkdir(exist_ok=True)
    whole = folder / "whole.exr"
    if not whole.exists():
        write_maps(whole, {1001: PIXELS}, NAMES, HEADER)
    content = bytearray(whole.read_bytes())
    for _ in range(data.draw(st.integers(0, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = folder / "damaged.exr"
    path.write_bytes(content[: data.draw(st.integers(0, len(content)) | st.just(len(content)))])
    try:
        maps = read_maps(path)
    except InputError as error:
        assert str(error).startswith(str(path)) and "\n" not in str(error)
    else:
        assert np.isfinite(maps.tiles[1001]).all()


@given(st.integers(1, 40), st.integers(1, 50), st.integers(0, 9))
def test_bands_cover_the_picture_once(height, rows, halo):
    picture = np.arange(height * 2, dtype=np.float32).reshape(height, 2, 1)

    class Reader:
        def __init__(self):
            self.height = height

        def read_rows(self, first, count):
            assert 0 <= first and first + count <= height and count > 0
            return picture[first : first + count]

    met = list(bands(Reader(), rows, halo))
    np.testing.assert_array_equal(np.concatenate([band.core for band in reversed(met)]), picture)
    for band in met:
        low, high = max(band.first - halo, 0), min(band.first + band.count + halo, height)
        np.testing.assert_array_equal(band.rows, picture[low:high])


def test_bands_of_a_file(tmp_path):
    write_maps(tmp_path / "a.exr", {1001: PIXELS}, NAMES, HEADER, half=False)
    with sanguine_core.RowReader(tmp_path / "a.exr") as reader, sanguine_core.MapWriter(
        tmp_path / "b.exr", reader.width, reader.height, reader.channels, {}, half=False, from_top=True
    ) as writer:
        for band in bands(reader, 5, halo=2):
            writer.write_rows(band.core)
    np.testing.assert_array_equal(sanguine_core.read_image(tmp_path / "b.exr"), sanguine_core.read_image(tmp_path / "a.exr"))
    assert read_header(tmp_path / "a.exr")[0] == HEADER
