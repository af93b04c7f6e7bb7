"""Pictures of any kind as numbers in linear light."""

import bpy
import numpy as np
import pytest
from sanguine.blender.images import _decoded_by_saving, scene_linear
from sanguine.domain.errors import InputError

ENCODED = np.array([0.2, 0.5, 0.8, 1.0], dtype=np.float32)
LINEAR = np.array([0.033105, 0.214041, 0.603827, 1.0], dtype=np.float32)  # IEC 61966-2-1


def picture(**kind):
    image = bpy.data.images.new("picture", 3, 2, **kind)
    image.pixels.foreach_set(np.tile(ENCODED, 6))
    return image


def test_a_painted_picture_of_bytes_is_decoded():
    pixels = scene_linear(picture())[1001]
    assert pixels.shape == (2, 3, 4)
    # Half a step of 8 bits, through the steepest part of the curve.
    np.testing.assert_allclose(pixels, np.broadcast_to(LINEAR, pixels.shape), atol=0.5 / 255 * 2.3)


def test_a_picture_of_floats_is_linear_already():
    np.testing.assert_allclose(scene_linear(picture(float_buffer=True))[1001][0, 0], ENCODED, atol=1e-6)


def test_data_are_left_alone():
    np.testing.assert_allclose(scene_linear(picture(is_data=True))[1001][0, 0], ENCODED, atol=0.51 / 255)


def test_a_packed_picture_reads_as_before():
    image = picture()
    before = scene_linear(image)[1001]
    image.pack()
    np.testing.assert_array_equal(scene_linear(image)[1001], before)


def test_a_missing_file_is_one_line(tmp_path):
    image = bpy.data.images.new("gone", 4, 4)
    image.source = "FILE"
    image.filepath = str(tmp_path / "gone.png")
    with pytest.raises(InputError, match="^gone: no pixels"):
        scene_linear(image)


def test_blender_decodes_as_opencolorio_does():
    """What stands in where Blender has no OpenColorIO for Python (4.2)."""
    image = picture()
    encoded = np.tile(np.round(ENCODED * 255) / 255, (2, 3, 1)).astype(np.float32)
    # float32 on both sides, and Blender's own tables for bytes.
    np.testing.assert_allclose(_decoded_by_saving(image, encoded), scene_linear(image)[1001][..., :3], atol=1e-5)
    assert "sanguine decode" not in bpy.data.images and "sanguine decode" not in bpy.data.scenes


COPIES = "save_copy" in bpy.types.Image.bl_rna.functions["save"].parameters


@pytest.mark.skipif(COPIES, reason="the next test has what holds where Blender writes copies")
def test_where_blender_writes_no_copies_tiles_come_from_their_files(tmp_path):
    image = tiled(tmp_path)
    assert sorted(scene_linear(image)) == [1001, 1012]
    image.pack()
    with pytest.raises(InputError, match="save them as files first"):
        scene_linear(image)


def tiled(folder=None, **kind):
    image = bpy.data.images.new("set", 4, 4, tiled=True, **kind)
    image.tiles.new(1012)
    for tile, red in ((image.tiles[0], 0.2), (image.tiles[1], 0.8)):
        image.tiles.active = tile
        with bpy.context.temp_override(edit_image=image):
            bpy.ops.image.tile_fill(color=(red, 0.5, 0.5, 1.0), width=4, height=4)
    if folder is not None:
        image.filepath_raw, image.file_format = str(folder / "set.<UDIM>.png"), "PNG"
        image.save()
    return image


@pytest.mark.skipif(not COPIES, reason="Blender 4.2 writes no copies of tiles; the test above has its answer")
@pytest.mark.parametrize("kind", [{}, {"float_buffer": True}, {"packed": True}])
def test_every_tile_of_a_set_is_read(kind):
    packed = kind.pop("packed", False)
    image = tiled(**kind)
    if packed:
        image.pack()
    before = image.file_format, image.filepath
    tiles = scene_linear(image)
    assert sorted(tiles) == [1001, 1012] and (image.file_format, image.filepath) == before
    assert tiles[1001].shape == (4, 4, 4)
    # The operator's colour goes to the picture's own encoding; bytes are decoded again to within their half step.
    assert np.ptp(tiles[1001][..., 0]) == 0 and tiles[1001][0, 0, 0] < 0.25 < 0.5 < tiles[1012][0, 0, 0]
