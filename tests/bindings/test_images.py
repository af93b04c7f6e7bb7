"""Images and chromophore maps through Python: contracts, errors, captions."""

import numpy as np
import pytest
import sanguine_core

RANDOM = np.random.default_rng(1)


def test_map_keeps_names_attributes_and_values(tmp_path):
    pixels = RANDOM.random((5, 7, 3), dtype=np.float32)
    attributes = {"sanguine:schema": "1", "sanguine:units": "hemoglobin: fraction"}
    sanguine_core.write_exr_map(tmp_path / "a.exr", pixels, ["melanin", "hemoglobin", "oil"], attributes, half=False)
    read, channels, header = sanguine_core.read_exr_map(tmp_path / "a.exr")
    assert channels == ["hemoglobin", "melanin", "oil"]
    np.testing.assert_array_equal(read, pixels[..., [1, 0, 2]])
    assert attributes.items() <= header.items()


def test_half_is_the_default(tmp_path):
    pixels = RANDOM.random((4, 4, 1), dtype=np.float32)
    sanguine_core.write_exr_map(tmp_path / "a.exr", pixels, ["melanin"], {})
    read, _, _ = sanguine_core.read_exr_map(tmp_path / "a.exr")
    np.testing.assert_array_equal(read, pixels.astype(np.float16).astype(np.float32))


def test_openimageio_and_openexr_agree_on_rows(tmp_path):
    pixels = np.arange(12, dtype=np.float32).reshape(4, 3, 1)
    sanguine_core.write_exr_map(tmp_path / "a.exr", pixels, ["Y"], {})
    np.testing.assert_array_equal(sanguine_core.read_image(tmp_path / "a.exr"), pixels)


def test_png_keeps_every_8_bit_value(tmp_path):
    values = np.arange(256).reshape(16, 16, 1)
    sanguine_core.write_image(tmp_path / "a.png", (values / 255).astype(np.float32))
    np.testing.assert_array_equal(np.rint(sanguine_core.read_image(tmp_path / "a.png") * 255), values)


@pytest.mark.parametrize(("pixel_type", "tolerance"), [("uint8", 0.5 / 255), ("uint16", 0.5 / 65535), ("float", 0)])
def test_pixel_types(tmp_path, pixel_type, tolerance):
    pixels = RANDOM.random((3, 3, 3), dtype=np.float32)
    sanguine_core.write_image(tmp_path / "a.tif", pixels, pixel_type)
    np.testing.assert_allclose(sanguine_core.read_image(tmp_path / "a.tif"), pixels, atol=tolerance + 1e-7, rtol=0)


@pytest.mark.parametrize("read", [sanguine_core.read_image, sanguine_core.read_exr_map])
def test_a_broken_file_is_an_oserror_of_one_line_that_names_it(tmp_path, read):
    whole = tmp_path / "whole.exr"
    sanguine_core.write_exr_map(whole, RANDOM.random((64, 64, 4), dtype=np.float32), list("abcd"), {})
    cut = tmp_path / "cut.exr"
    cut.write_bytes(whole.read_bytes()[:-200])
    for path in (cut, tmp_path / "absent.exr"):
        with pytest.raises(OSError) as caught:
            read(path)
        assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_bad_writes_are_refused_and_leave_nothing(tmp_path):
    pixel = np.zeros((1, 1, 1), np.float32)
    with pytest.raises(ValueError, match="melanin"):
        sanguine_core.write_exr_map(tmp_path / "a.exr", pixel * np.nan, ["melanin"], {})
    with pytest.raises(ValueError, match="2 names for 1 channel"):
        sanguine_core.write_exr_map(tmp_path / "a.exr", pixel, ["a", "b"], {})
    with pytest.raises(ValueError, match="pixels"):
        sanguine_core.write_image(tmp_path / "a.png", np.zeros((0, 1, 1), np.float32))
    with pytest.raises(ValueError, match="'int8' is not one of"):
        sanguine_core.write_image(tmp_path / "a.png", pixel, "int8")
    with pytest.raises(sanguine_core.ImageError, match=r"a\.xyz: cannot be written"):
        sanguine_core.write_image(tmp_path / "a.xyz", pixel)
    assert list(tmp_path.iterdir()) == []


def test_contact_sheet_copies_pixels_and_draws_captions(tmp_path):
    pictures, paths = [], []
    for i in range(3):
        pictures.append(RANDOM.integers(0, 256, (40, 160, 3)))
        paths.append(tmp_path / f"{i}.png")
        sanguine_core.write_image(paths[-1], (pictures[-1] / 255).astype(np.float32))

    def sheet(captions):
        sanguine_core.contact_sheet(paths, captions, tmp_path / "sheet.png", columns=3, gap_px=4, background=0)
        return np.rint(sanguine_core.read_image(tmp_path / "sheet.png") * 255)[::-1]  # from the top

    for captions, caption_height in (([], 0), (["anger", "fear", "happy"], 20)):
        pixels = sheet(captions)
        assert pixels.shape == (40 + caption_height + 2 * 4, 3 * 160 + 4 * 4, 3)
        for i, picture in enumerate(pictures):
            left = 4 + i * 164
            np.testing.assert_array_equal(pixels[4:44, left : left + 160], picture[::-1])
            band = pixels[44 : 44 + caption_height, left : left + 160]
            assert bool(captions) == bool((band > 100).any())
