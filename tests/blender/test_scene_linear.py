"""Pictures of any kind as numbers in linear light."""

import bpy
import numpy as np
import pytest
from sanguine.blender.images import scene_linear
from sanguine.domain.errors import InputError

ENCODED = np.array([0.2, 0.5, 0.8, 1.0], dtype=np.float32)
LINEAR = np.array([0.033105, 0.214041, 0.603827, 1.0], dtype=np.float32)  # IEC 61966-2-1


def picture(**kind):
    image = bpy.data.images.new("picture", 3, 2, **kind)
    image.pixels.foreach_set(np.tile(ENCODED, 6))
    return image


def test_a_painted_picture_of_bytes_is_decoded():
    pixels = scene_linear(picture())
    assert pixels.shape == (2, 3, 4)
    # Half a step of 8 bits, through the steepest part of the curve.
    np.testing.assert_allclose(pixels, np.broadcast_to(LINEAR, pixels.shape), atol=0.5 / 255 * 2.3)


def test_a_picture_of_floats_is_linear_already():
    np.testing.assert_allclose(scene_linear(picture(float_buffer=True))[0, 0], ENCODED, atol=1e-6)


def test_data_are_left_alone():
    np.testing.assert_allclose(scene_linear(picture(is_data=True))[0, 0], ENCODED, atol=0.51 / 255)


def test_a_packed_picture_reads_as_before():
    image = picture()
    before = scene_linear(image)
    image.pack()
    np.testing.assert_array_equal(scene_linear(image), before)


def test_a_missing_file_is_one_line(tmp_path):
    image = bpy.data.images.new("gone", 4, 4)
    image.source = "FILE"
    image.filepath = str(tmp_path / "gone.png")
    with pytest.raises(InputError, match="^gone: no pixels"):
        scene_linear(image)
