"""The head: CC0 base mesh and targets in, parts with ARKit shape keys, hair and region weights out. No bpy."""

from .build import build_head
from .model import Head, MeshPart, ShapeKey, StrandPart
from .package import ARKIT_NAMES, KEY_NAMES, HeadError, HeadPackage
from .presets import Preset, load_presets
from .regions import Region, load_regions

__all__ = [
    "ARKIT_NAMES",
    "Head",
    "HeadError",
    "HeadPackage",
    "KEY_NAMES",
    "MeshPart",
    "Preset",
    "Region",
    "ShapeKey",
    "StrandPart",
    "build_head",
    "load_presets",
    "load_regions",
]
