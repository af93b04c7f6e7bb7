"""UDIM numbers, names and the tiles that a layout uses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sanguine.domain import udim
from sanguine.domain.errors import InputError
from sanguine.domain.udim import tile_offset, tiles_of
from sanguine.domain.uv_checks import uv_warnings

TILES = st.integers(udim.FIRST_TILE, udim.LAST_TILE)
NAMES = st.text(st.characters(blacklist_characters="/\0<>", blacklist_categories=["Cs", "Cc"]), min_size=1, max_size=20)

UNIT = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


@pytest.mark.parametrize("tile, offset", [(1001, (0, 0)), (1002, (1, 0)), (1010, (9, 0)), (1011, (0, 1)), (1999, (8, 99))])
def test_a_number_says_where_the_tile_lies(tile, offset):
    assert tile_offset(tile) == offset
    assert tiles_of((UNIT + offset)[None]) == (tile,)


def test_a_triangle_over_a_border_uses_both_tiles():
    assert tiles_of((UNIT + [0.5, 0.0])[None]) == (1001, 1002)


def test_several_triangles():
    assert tiles_of(np.stack([UNIT, UNIT + [3, 2], UNIT])) == (1001, 1024)


def test_what_lies_beyond_every_tile_is_left_out():
    assert tiles_of(np.stack([UNIT, UNIT - [5, 0], UNIT + [12, 0], UNIT * np.nan])) == (1001,)


@pytest.mark.parametrize("uv", [UNIT - 3.0, UNIT + [12, 0], UNIT * np.nan, np.zeros((0, 2))])
def test_no_tile_at_all_is_one_line(uv):
    with pytest.raises(InputError, match="^UV map: no triangle lies in a tile from 1001 to 1999"):
        tiles_of(uv.reshape(-1, 3, 2))


@given(TILES)
def test_number_and_place_are_inverse(tile):
    u, v = tile_offset(tile)
    assert udim.tile_at(u + 0.5, v + 0.5) == tile == udim.tile_at(u, v)
    assert 0 <= u < 10 and v >= 0


@given(st.floats(-1e9, 1e9) | st.just(np.nan) | st.just(np.inf), st.floats(-1e9, 1e9))
def test_every_place_is_a_tile_or_one_line(u, v):
    try:
        tile = udim.tile_at(u, v)
    except InputError as error:
        assert "\n" not in str(error) and "1001 to 1999" in str(error)
        assert not (0 <= u < 10 and 0 <= v < 99)
    else:
        assert tile_offset(tile) == (np.floor(u), np.floor(v))


@given(NAMES, TILES, st.sampled_from([".exr", ".png", ".tx"]), st.sampled_from([".", "_"]))
def test_a_numbered_name_means_its_set(name, tile, suffix, separator):
    pattern = udim.pattern_of(f"dir/{name}{separator}{tile}{suffix}")
    assert pattern == f"dir/{name}{separator}<UDIM>{suffix}"
    assert udim.pattern_of(pattern) == pattern
    assert str(udim.tile_path(pattern, tile)) == f"dir/{name}{separator}{tile}{suffix}"


@pytest.mark.parametrize("name", ["face.exr", "face.1000.exr", "face.2024.exr", "face1001.exr", "1001", "a.1001", "a.10011.exr"])
def test_ordinary_names_are_single_files(name):
    assert udim.pattern_of(name) is None


@pytest.mark.parametrize("name", ["<UDIM>/a.exr", "<UDIM>.<UDIM>.exr", "<UDIM>/a.<UDIM>.exr"])
def test_a_token_in_the_wrong_place_is_refused(name):
    with pytest.raises(InputError, match="once, in the file's name"):
        udim.pattern_of(name)


@pytest.mark.parametrize("tile", [0, 1000, 2000, -1, 1001.0, True, "1001"])
def test_what_is_no_tile_is_refused(tile):
    with pytest.raises(InputError, match="no UDIM tile"):
        udim.tile_path("a.<UDIM>.exr", tile)


def test_siblings_are_found_and_strangers_are_not(tmp_path):
    for name in ("a.1001.exr", "a.1012.exr", "a.1999.exr", "a.2000.exr", "a.1001.png", "ab.1001.exr", "a.1001.b.exr", "a.١٠٠١.exr"):
        (tmp_path / name).touch()
    (tmp_path / "a.1002.exr").mkdir()
    for path in ("a.1012.exr", "a.<UDIM>.exr", "a.1003.exr"):
        assert list(udim.find_tiles(tmp_path / path)) == [1001, 1012, 1999]
    (tmp_path / "single.exr").touch()
    assert udim.find_tiles(tmp_path / "single.exr") == {1001: tmp_path / "single.exr"}
    for path in ("b.<UDIM>.exr", "absent.exr", "no/b.<UDIM>.exr"):
        with pytest.raises(InputError) as caught:
            udim.find_tiles(tmp_path / path)
        assert str(caught.value).startswith(str(tmp_path / path)) and "\n" not in str(caught.value)


def test_missing_tiles_are_named():
    udim.check_tiles([1001, 1002], [1002], "a")
    with pytest.raises(InputError, match=r"a: tile 1003 missing, the UVs use it"):
        udim.check_tiles([1001], [1001, 1003], "a")
    with pytest.raises(InputError, match=r"and 2 more missing"):
        udim.check_tiles([], range(1001, 1011), "a")


TRIANGLE = np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]], np.float32)


def test_warnings_about_layouts():
    one = np.array([[0, 1, 2]], np.int32)
    assert uv_warnings(TRIANGLE, one) == []
    assert "no UV layout" in uv_warnings(np.zeros((0, 2), np.float32), np.zeros((0, 3), np.int32))[0]
    assert "never unwrapped" in uv_warnings(TRIANGLE * 0, one)[0]
    (line,) = uv_warnings(TRIANGLE, np.array([[0, 1, 2], [0, 0, 1]], np.int32))
    assert line.startswith("UV: 1 of 2 triangles have no area")
    (line,) = uv_warnings(np.concatenate([TRIANGLE, TRIANGLE - 1]), np.array([[0, 1, 2], [3, 4, 5]], np.int32))
    assert line.startswith("UV: 1 of 2 triangles lie outside")
    (line,) = uv_warnings(np.concatenate([TRIANGLE + 1, TRIANGLE + 1]), np.array([[0, 1, 2], [3, 5, 4]], np.int32))
    assert line.startswith("UV: 99.8% of tile 1012 is covered more than once")  # the rest lies on edges
