"""Region masks as shader inputs: three masks to an image, and sums over them as OSL."""

from __future__ import annotations

from collections.abc import Collection

from ..blood import ANATOMY, blood_property
from .effect import ELSEWHERE, Scene, ShaderInput
from .packed import other, packed_input

FACE_REGIONS = tuple(ANATOMY)
"""Every region a face can have masks for, in the order in which masks are packed."""

MASKS_PER_IMAGE = 3


def region_images(regions: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Map id -> the regions in its red, green and blue."""
    return {
        f"regions_{i // MASKS_PER_IMAGE}": regions[i : i + MASKS_PER_IMAGE]
        for i in range(0, len(regions), MASKS_PER_IMAGE)
    }


def mask_inputs(scene: Scene, regions: Collection[str]) -> tuple[ShaderInput, ...]:
    """The images that hold the masks of `regions`; what is elsewhere is known by all of them."""
    return tuple(
        ShaderInput(image, "color", "map", image)
        for image, held in region_images(scene.regions).items()
        if ELSEWHERE in regions or set(held) & set(regions)
    )


def masked_sum(scene: Scene, quantity: str, regions: Collection[str]) -> tuple[str, tuple[ShaderInput, ...]]:
    """OSL for the sum over regions of mask x what the object says of a quantity of blood there, and its inputs of the
    object: three numbers for the three masks of an image."""
    terms, inputs, rest = [], [], ["1.0"]
    for i, (image, held) in enumerate(region_images(scene.regions).items()):
        rest += [f"{image}[{k}]" for k in range(len(held))]
        if set(held) & set(regions):
            parts = [blood_property(quantity, region) if region in regions else "" for region in held]
            inputs.append(packed_input(f"{quantity}_{i}", parts))
            terms.append(f"dot(vector({image}), vector({inputs[-1].name}))")
    if ELSEWHERE in regions:
        item, number = other(blood_property(quantity, ELSEWHERE))
        inputs.append(item)
        # Rounded masks may sum to a little more than 1.
        terms.append(f"max(0.0, {' - '.join(rest)}) * {number}")
    return f"({' + '.join(terms)})", tuple(inputs)
