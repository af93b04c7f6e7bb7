"""Region masks as shader inputs: three masks to an image, and sums over them as OSL."""

from __future__ import annotations

from collections.abc import Mapping

from ..blood import ANATOMY
from .effect import ELSEWHERE, Scene, ShaderInput

FACE_REGIONS = tuple(ANATOMY)
"""Every region a face can have masks for, in the order in which masks are packed."""

MASKS_PER_IMAGE = 3


def region_images(regions: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Map id -> the regions in its red, green and blue."""
    return {
        f"regions_{i // MASKS_PER_IMAGE}": regions[i : i + MASKS_PER_IMAGE]
        for i in range(0, len(regions), MASKS_PER_IMAGE)
    }


def mask_inputs(scene: Scene, regions: tuple[str, ...]) -> tuple[ShaderInput, ...]:
    """The images that hold the masks of `regions`; what is elsewhere is known by all of them."""
    return tuple(
        ShaderInput(image, "color", "map", image)
        for image, held in region_images(scene.regions).items()
        if ELSEWHERE in regions or set(held) & set(regions)
    )


def masked_sum(scene: Scene, terms: Mapping[str, str]) -> str:
    """OSL for the sum over regions of mask x term."""
    channel = {
        region: f"{image}[{i}]"
        for image, held in region_images(scene.regions).items()
        for i, region in enumerate(held)
    }
    if ELSEWHERE in terms:
        # Rounded masks may sum to a little more than 1.
        channel[ELSEWHERE] = f"max(0.0, {' - '.join(['1.0', *channel.values()])})"
    return "(" + " + ".join(f"{channel[region]} * {term}" for region, term in terms.items()) + ")"
