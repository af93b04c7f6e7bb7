"""Images as arrays: packed data images, so that a saved file needs nothing beside it, and pictures in linear light."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

import bpy
import numpy as np
import sanguine_core

from ..domain.effects.effect import Interval
from ..domain.errors import InputError
from ..domain.udim import FIRST_TILE, tile_path
from .osl import find_oslquery

RANGE = "sanguine_range"
"""Custom property of an image: chromophore that it holds -> lowest and highest value over its texels."""

Pixels = np.ndarray | Mapping[int, np.ndarray]
"""(H, W, 1, 3 or 4) float32, row 0 lowest, or one such array per UDIM tile."""

_CHANNELS = {1: ("Y",), 3: ("R", "G", "B"), 4: ("R", "G", "B", "A")}
_TILE = "<UDIM>"


def data_image(name: str, pixels: Pixels, half: bool = False) -> bpy.types.Image:
    """A packed float image of numbers, not colours. half: kept as 16-bit floats, which round to 1 in 2000.

    It goes by way of EXR files, which are gone afterwards: Blender packs a file as it is, compressed, where it would
    pack what it was told pixel by pixel without; and it fills tiles other than the first from files alone.
    """
    tiles = pixels if isinstance(pixels, Mapping) else {FIRST_TILE: pixels}
    tiled = list(tiles) != [FIRST_TILE]
    with tempfile.TemporaryDirectory() as folder:
        for tile, texels in tiles.items():
            path = Path(folder) / (f"map.{tile}.exr" if tiled else "map.exr")
            texels = np.ascontiguousarray(texels, dtype=np.float32)
            sanguine_core.write_exr_map(path, texels, _CHANNELS[texels.shape[2]], {}, half=half)
        image = bpy.data.images.load(str(path))
        image.name = name
        image.colorspace_settings.is_data = True
        # Numbers in alpha are numbers too: nothing may be multiplied by them.
        image.alpha_mode = "CHANNEL_PACKED"
        if tiled:
            image.source = "TILED"  # finds the other tiles
            image.filepath_raw = str(Path(folder) / f"map.{_TILE}.exr")
            image.reload()
            if missing := set(tiles) - {tile.number for tile in image.tiles}:
                raise RuntimeError(f"{name}: Blender did not find the tiles {sorted(missing)}")
        image.pack()
    # No folder of this machine in the file.
    image.filepath_raw = f"//{name}.{_TILE}.exr" if tiled else f"//{name}.exr"
    for packed in image.packed_files:
        packed.filepath = f"//{name}.{packed.tile_number}.exr" if tiled else f"//{name}.exr"
    return image


def store_range(image: bpy.types.Image, ranges: Mapping[str, Interval]) -> None:
    """Keeps with the image what it holds, and between which values: the table has to reach that far."""
    image[RANGE] = {name: list(interval) for name, interval in ranges.items()}


def measure_range(image: bpy.types.Image, channels: tuple[str, ...]) -> None:
    """Stores the ranges of an image from its texels, its channels named in order: of those it is known to hold, or of
    all. Blender shows no texels of tiles other than the first, so a tiled image keeps what it has."""
    if image.library or image.source == "TILED" or not image.size[0]:
        return
    known = stored_range(image) or channels
    texels = np.empty(image.size[0] * image.size[1] * image.channels, dtype=np.float32)
    image.pixels.foreach_get(texels)
    values = texels.reshape(-1, image.channels)
    held = zip(channels, values.min(axis=0), values.max(axis=0), strict=False)
    store_range(image, {name: (float(low), float(high)) for name, low, high in held if name in known})


def stored_range(image: bpy.types.Image) -> dict[str, Interval] | None:
    """What `store_range` kept, or None."""
    held = image.get(RANGE)
    return {name: (values[0], values[1]) for name, values in held.items()} if held is not None else None


def scene_linear(image: bpy.types.Image) -> dict[int, np.ndarray]:
    """Pixels of a picture in the file's working space, linear: UDIM tile (1001 for an ordinary picture) -> (H, W, 4)
    float32, row 0 lowest, alpha straight.

    What is painted and not saved is in it. Raises InputError for a picture without pixels or in a colour space that
    OpenColorIO cannot convert.
    """
    width, height = image.size
    if not width * height or not image.channels:
        raise InputError(f"{image.name}: no pixels: the picture is empty or its file is missing")
    if image.source == "TILED":
        tiles = _tiles(image)
    else:
        pixels = np.empty((height, width, image.channels), dtype=np.float32)
        image.pixels.foreach_get(pixels.ravel())
        tiles = {FIRST_TILE: pixels}
    tiles = {tile: _with_alpha(pixels) for tile, pixels in tiles.items()}
    # Blender keeps pictures of bytes in their own encoding, and those of floats in the working space.
    if not image.is_float and not image.colorspace_settings.is_data:
        for rgba in tiles.values():
            _decode(image, rgba)
    return tiles


def _with_alpha(pixels: np.ndarray) -> np.ndarray:
    """(H, W, 1 to 4) -> (H, W, 4); of two channels the second is alpha."""
    rgba = np.ones((*pixels.shape[:2], 4), dtype=np.float32)
    if pixels.shape[2] < 3:
        rgba[..., :3] = pixels[..., :1]
        if pixels.shape[2] == 2:
            rgba[..., 3] = pixels[..., 1]
    else:
        rgba[..., : pixels.shape[2]] = pixels
    return rgba


def _tiles(image: bpy.types.Image) -> dict[int, np.ndarray]:
    """By way of files, which are gone afterwards: Blender shows the pixels of the first tile alone."""
    if "save_copy" not in image.bl_rna.functions["save"].parameters:  # Blender 4.2
        if image.is_dirty or image.packed_files:
            raise InputError(f"{image.name}: packed or unsaved tiles: save them as files first, this Blender writes no copies")
        pattern = bpy.path.abspath(image.filepath_raw)
        return {tile.number: sanguine_core.read_image(tile_path(pattern, tile.number)) for tile in image.tiles}
    before = image.file_format
    with tempfile.TemporaryDirectory() as folder:
        suffix = ".exr" if image.is_float else ".png"
        try:
            image.file_format = "OPEN_EXR" if image.is_float else "PNG"  # what loses nothing
            image.save(filepath=str(Path(folder) / f"tile.{_TILE}{suffix}"), save_copy=True)
        except RuntimeError as error:
            raise InputError(f"{image.name}: {' '.join(str(error).split())}") from None
        finally:
            image.file_format = before
        return {
            tile.number: sanguine_core.read_image(Path(folder) / f"tile.{tile.number}{suffix}") for tile in image.tiles
        }


def _decode(image: bpy.types.Image, rgba: np.ndarray) -> None:
    """From the picture's colour space to the working space, in place."""
    find_oslquery()  # OpenColorIO lies beside it
    try:
        import PyOpenColorIO as ocio
    except ImportError:  # Blender 4.2
        rgba[..., :3] = _decoded_by_saving(image, rgba)
        return
    name = image.colorspace_settings.name
    data = getattr(bpy.data, "colorspace", None)  # since Blender 5.0 a file chooses its working space
    try:
        if os.environ.get("OCIO"):
            config = ocio.Config.CreateFromEnv()
        else:
            config = ocio.Config.CreateFromFile(
                str(Path(bpy.utils.resource_path("LOCAL")) / "datafiles" / "colormanagement" / "config.ocio")
            )
        target = data.working_space if data else ocio.ROLE_SCENE_LINEAR
        config.getProcessor(name, target).getDefaultCPUProcessor().applyRGBA(rgba)
    except ocio.Exception as error:
        raise InputError(f"{image.name}: colour space '{name}': {' '.join(str(error).split())}") from None


def _decoded_by_saving(image: bpy.types.Image, rgba: np.ndarray) -> np.ndarray:
    """(H, W, 3) in the working space: Blender converts a picture of bytes itself when it writes it as linear EXR."""
    height, width = rgba.shape[:2]
    copy = bpy.data.images.new("sanguine decode", width, height, alpha=True)
    scene = bpy.data.scenes.new("sanguine decode")
    try:
        copy.colorspace_settings.name = image.colorspace_settings.name
        copy.alpha_mode = "CHANNEL_PACKED"  # colours under alpha 0 are colours too
        copy.pixels.foreach_set(rgba.ravel())
        settings = scene.render.image_settings
        settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "linear.exr"
            copy.save_render(str(path), scene=scene)
            return sanguine_core.read_image(path)[..., :3]
    finally:
        bpy.data.images.remove(copy)
        bpy.data.scenes.remove(scene)
