"""The file's working space, in which Cycles computes and to which spectra go."""

from __future__ import annotations

import bpy

# Names of `Blend file > Working Space` (Blender 5.0 on) -> names that sanguine_core knows.
_WORKING_SPACES = {"Linear Rec.709": "rec709", "Linear Rec.2020": "rec2020", "ACEScg": "acescg"}


def working_space() -> str:
    """Name of the open file's working space for `sanguine_core`; before Blender 5.0 it is linear Rec.709."""
    data = getattr(bpy.data, "colorspace", None)
    if data is None:
        return "rec709"
    name = data.working_space
    if name not in _WORKING_SPACES:
        raise RuntimeError(f"working space {name!r} is not known: use one of {', '.join(_WORKING_SPACES)}")
    return _WORKING_SPACES[name]
