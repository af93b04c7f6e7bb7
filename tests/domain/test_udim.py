"""UDIM numbers and the tiles that a layout uses."""

import numpy as np
import pytest
from sanguine.domain.errors import InputError
from sanguine.domain.udim import tile_offset, tiles_of

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
