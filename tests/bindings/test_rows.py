"""Pictures in bands through Python: contracts, context managers, memory. Formats are in tests/native/test_row_reader.cpp."""

import resource
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import sanguine_core

PIXELS = np.random.default_rng(2).random((70, 9, 2), dtype=np.float32)
NAMES = ["hemoglobin", "melanin"]


@pytest.fixture
def picture(tmp_path):
    sanguine_core.write_exr_map(tmp_path / "a.exr", PIXELS, NAMES, {}, half=False)
    return tmp_path / "a.exr"


def test_rows_are_those_of_the_picture(picture):
    with sanguine_core.RowReader(picture) as reader:
        assert (reader.width, reader.height, reader.channels) == (9, 70, NAMES)
        assert (reader.pixel_type, reader.alpha_channel) == ("float", None)
        rows = reader.read_rows(60, 10)
        np.testing.assert_array_equal(reader.read_rows(0, 70), PIXELS)
    np.testing.assert_array_equal(rows, PIXELS[60:])  # alive after the file is closed
    with pytest.raises(ValueError, match="closed"):
        reader.read_rows(0, 1)
    with pytest.raises(ValueError, match="closed"):
        reader.width  # noqa: B018


def test_threads_share_a_reader(picture):
    def band(first):
        return reader.read_rows(first, 1 + first % 7)

    with sanguine_core.RowReader(picture) as reader, ThreadPoolExecutor(4) as pool:
        firsts = [(7 * i) % 60 for i in range(200)]
        for first, rows in zip(firsts, pool.map(band, firsts), strict=True):
            np.testing.assert_array_equal(rows, PIXELS[first : first + 1 + first % 7])


@pytest.mark.parametrize("rows", [(-1, 1), (70, 1), (0, 0), (0, 71), (0, -5), (69, 2)])
def test_rows_that_are_not_there_are_refused(picture, rows):
    with sanguine_core.RowReader(picture) as reader, pytest.raises(ValueError, match="read_rows"):
        reader.read_rows(*rows)


@pytest.mark.parametrize("from_top", [False, True])
def test_a_map_written_in_bands(tmp_path, from_top):
    path = tmp_path / "a.exr"
    with sanguine_core.MapWriter(path, 9, 70, NAMES, {"sanguine:schema": "1"}, half=False, from_top=from_top) as writer:
        for first in (range(60, -1, -10) if from_top else range(0, 70, 10)):
            writer.write_rows(PIXELS[first : first + 10])
        assert writer.rows_left == 0 and not path.exists()
    assert path.exists()
    pixels, channels, attributes = sanguine_core.read_exr_map(path)
    np.testing.assert_array_equal(pixels, PIXELS)
    assert channels == NAMES and attributes["sanguine:schema"] == "1"
    assert sanguine_core.read_exr_map_info(path)[:3] == (9, 70, NAMES)


def test_an_unfinished_map_leaves_nothing(tmp_path):
    def writer():
        return sanguine_core.MapWriter(tmp_path / "a.exr", 9, 70, NAMES, {})

    with pytest.raises(KeyError), writer() as w:
        w.write_rows(PIXELS)
        raise KeyError
    with pytest.raises(ValueError, match="60 of 70 rows are missing"), writer() as w:
        w.write_rows(PIXELS[:10])
    with pytest.raises(ValueError, match="9 x 2 values are wanted, not of 9 x 1"), writer() as w:
        w.write_rows(np.ascontiguousarray(PIXELS[..., :1]))
    with writer() as w:
        w.abandon()
    with pytest.raises(ValueError, match="committed or abandoned"):
        w.write_rows(PIXELS)
    del w
    kept = writer()
    del kept
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_an_error_and_leaves_nothing(tmp_path):
    """OpenEXR itself says nothing when the end of a file cannot be written."""
    noise = np.random.default_rng(3).random((64, 64, 2), dtype=np.float32)  # 32 KiB that do not compress
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    for limit in (100, 20_000, 32_000):
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))  # Python ignores the signal: writing fails
        try:
            with pytest.raises(OSError, match=r"a\.exr: cannot be written"):
                sanguine_core.write_exr_map(tmp_path / "a.exr", noise, NAMES, {}, half=False)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


def test_textures_have_levels(tmp_path, picture):
    sanguine_core.make_tx(picture, tmp_path / "a.tx")
    info = sanguine_core.texture_info(tmp_path / "a.tx")
    assert (info["tile_width"], info["tile_height"], info["levels"]) == (64, 64, 7)  # 70, 35, 17, 8, 4, 2, 1
    # Levels of odd sizes weigh their border less: near the mean, not on it.
    np.testing.assert_allclose(info["mean"], PIXELS.mean(axis=(0, 1)), atol=0.05)
    np.testing.assert_array_equal(sanguine_core.read_image(tmp_path / "a.tx"), PIXELS)
    assert sanguine_core.texture_info(picture)["levels"] == 1
    with pytest.raises(OSError, match=r"a\.exr: cannot be written: the extension \.tx"):
        sanguine_core.make_tx(tmp_path / "a.tx", picture)


BANDS = """
import resource, sys
import numpy as np
import sanguine_core

size, rows = 8192, 64
def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
band = np.zeros((rows, size, 3), np.float32)
band[:] = (np.arange(size) // 256 / 32)[None, :, None]
start = peak()
with sanguine_core.MapWriter("a.exr", size, size, ["b", "g", "r"], {}, from_top=True) as writer:
    for first in range(0, size, rows):
        writer.write_rows(band)
written = peak()
with sanguine_core.RowReader("a.exr") as reader, sanguine_core.MapWriter("b.exr", size, size, ["b", "g", "r"], {}, from_top=True) as writer:
    for first in range(size - rows, -1, -rows):
        halo = reader.read_rows(max(first - 8, 0), min(first + rows + 8, size) - max(first - 8, 0))
        writer.write_rows(halo[first - max(first - 8, 0):][:rows])
assert sanguine_core.RowReader("b.exr").read_rows(4000, 1)[0, 4096, 1] == 0.5
print(written - start, peak() - start)
"""


def test_an_8k_map_is_never_whole_in_memory(tmp_path):
    result = subprocess.run([sys.executable, "-c", BANDS], capture_output=True, text=True, cwd=tmp_path, check=True)
    one_copy_mib = 8192 * 8192 * 3 * 2 / 2**20  # 384, as half
    writing, both = map(float, result.stdout.split())
    # A band and its halo are 7.5 MiB as floats; what the reader keeps, what it answers, and the half copy of 64 rows.
    assert writing < one_copy_mib / 10 and both < one_copy_mib / 4
