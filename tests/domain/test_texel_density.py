"""Maps have as many texels as the camera can tell apart, and no more."""

import numpy as np
import pytest
from sanguine.domain.quality import PRESETS
from sanguine.domain.texel_density import DETAIL_WITHOUT_CAMERA, LARGEST_DETAIL, SMALLEST_SIZE, map_sizes, mm_per_uv

# Two triangles: a square of 1 in UV, or of whatever `square` is given, over 200 x 200 mm.
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
CORNER_VERTEX = np.arange(4, dtype=np.int32)
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32)


def span(uv_side=1.0, side_mm=200.0):
    position_mm = np.c_[SQUARE * side_mm, np.zeros(4)].astype(np.float32)
    return mm_per_uv(position_mm, SQUARE * uv_side, TRIANGLES, CORNER_VERTEX)


def test_a_layout_that_fills_the_tile_spans_its_own_width():
    assert span() == pytest.approx(200.0)


def test_half_the_tile_means_twice_the_millimetres():
    assert span(uv_side=0.5) == pytest.approx(400.0)


def test_meshes_without_area_span_nothing():
    assert span(uv_side=0.0) == 0.0
    assert span(side_mm=0.0) == 0.0


def test_a_crammed_tenth_does_not_decide():
    """A small triangle squeezed in UV would ask for a hundred times the texels everywhere."""
    position_mm = np.c_[SQUARE * 200, np.zeros(4)].astype(np.float32)
    position_mm = np.concatenate([position_mm, position_mm[:3] * 0.1])
    uv = np.concatenate([SQUARE, SQUARE[:3] * 0.001])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6]], dtype=np.int32)
    assert mm_per_uv(position_mm, uv, triangles, np.arange(7, dtype=np.int32)) == pytest.approx(200.0)


FINAL, DRAFT = PRESETS["final"].settings, PRESETS["draft"].settings


def test_details_have_a_texel_per_pixel_in_powers_of_root_two():
    assert map_sizes(200.0, 0.2, FINAL).detail == 1024  # 1000 texels
    assert map_sizes(200.0, 0.19, FINAL).detail == 1448
    assert map_sizes(200.0, 0.12, FINAL).detail == 2048
    assert map_sizes(200.0, 0.001, FINAL).detail == LARGEST_DETAIL
    assert map_sizes(200.0, 50.0, FINAL).detail == SMALLEST_SIZE
    assert map_sizes(200.0, None, FINAL).detail == DETAIL_WITHOUT_CAMERA


def test_a_lower_quality_has_fewer_in_proportion():
    assert map_sizes(200.0, 0.2, DRAFT).detail == 1024 * DRAFT.map_size // FINAL.map_size


def test_smooth_maps_stop_at_the_size_the_quality_was_measured_with():
    assert map_sizes(200.0, 0.001, FINAL).smooth == FINAL.map_size
    assert map_sizes(200.0, None, DRAFT).smooth == DRAFT.map_size
    assert map_sizes(200.0, 1.0, FINAL).smooth == 256  # 200 pixels
    assert map_sizes(0.0, 1.0, DRAFT).smooth == DRAFT.map_size
