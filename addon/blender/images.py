"""Arrays as packed data images, so that a saved file needs nothing beside it."""

from __future__ import annotations

import bpy
import numpy as np


def data_image(name: str, pixels: np.ndarray) -> bpy.types.Image:
    """A packed float image of numbers, not colours. pixels: (H, W, 3 or 4), row 0 lowest."""
    height, width, channels = pixels.shape
    rgba = np.ones((height, width, 4), dtype=np.float32)
    rgba[..., :channels] = pixels
    image = bpy.data.images.new(name, width, height, alpha=channels == 4, float_buffer=True, is_data=True)
    # Numbers in alpha are numbers too: nothing may be multiplied by them.
    image.alpha_mode = "CHANNEL_PACKED"
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    image.pack()
    return image
