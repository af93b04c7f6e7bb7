"""The array contract of rasterize_uv; what it draws is proven in tests/native/test_raster.cpp."""

import numpy as np
import pytest
import sanguine_core

UV = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def draw(uv=UV, triangles=TRIANGLES, values=UV, width=6, height=4, padding_px=0, fill=(0, 0), **rest):
    fill = np.asarray(fill, np.float32)
    return sanguine_core.rasterize_uv(uv, triangles, values, width, height, padding_px, fill, **rest)


def test_draws_u_and_v_with_row_zero_at_the_bottom():
    pixels = draw()
    assert pixels.shape == (4, 6, 2) and pixels.dtype == np.float32
    np.testing.assert_allclose(pixels[..., 0], np.tile((np.arange(6) + 0.5) / 6, (4, 1)), atol=1e-6)
    np.testing.assert_allclose(pixels[..., 1], np.tile((np.arange(4) + 0.5) / 4, (6, 1)).T, atol=1e-6)


def test_the_result_outlives_its_inputs_and_can_be_written():
    pixels = draw(uv=UV.copy())
    pixels += 1
    assert pixels.min() > 1


def test_counts_triangles_without_area():
    triangles = np.array([[0, 1, 2], [0, 0, 1]], np.int32)
    assert sanguine_core.count_degenerate_uv(UV, triangles) == 1


@pytest.mark.parametrize(
    "change",
    [
        {"triangles": np.array([[0, 1, 4]], np.int32)},
        {"triangles": np.array([[0, 1, -1]], np.int32)},
        {"values": UV[:3]},
        {"fill": (0, 0, 0)},
        {"width": 0},
        {"height": 16385},
        {"padding_px": -1},
    ],
    ids=str,
)
def test_bad_values_are_refused(change):
    with pytest.raises(ValueError, match="rasterize_uv"):
        draw(**change)


@pytest.mark.parametrize("change", [{"uv": np.zeros((4, 3), np.float32)}, {"values": np.zeros(4, np.float32)}], ids=str)
def test_wrong_shapes_are_a_type_error(change):
    with pytest.raises(TypeError):
        draw(**change)
