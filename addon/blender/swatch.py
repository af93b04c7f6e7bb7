"""The swatch of the panel: the colour of a skin and its spectrum as the sliders stand. Nothing of it is in the file.

A redraw looks values up; a skin that was not seen lately is computed. Its picture lives in a collection of previews,
which goes when the add-on is unregistered.
"""

from __future__ import annotations

from collections import OrderedDict

import bpy
import bpy.utils.previews

from ..app import swatch
from ..domain.parameters import Skin
from .colour import Space, working_space

# Skins that are kept: those of several characters and panels, not every step of a slider that is pulled.
_KEPT = 16

_previews: bpy.utils.previews.ImagePreviewCollection | None = None
_known: OrderedDict[tuple, swatch.Swatch] = OrderedDict()
_pictures: OrderedDict[tuple, str] = OrderedDict()


def swatch_of(skin: Skin) -> swatch.Swatch:
    space = working_space()
    key = _key(skin, space)
    if key not in _known:
        _known[key] = swatch.swatch(skin, space)
        if len(_known) > _KEPT:
            _known.popitem(last=False)
    _known.move_to_end(key)
    return _known[key]


def spectrum_icon(skin: Skin) -> int:
    """Icon of the spectrum's plot, for `template_icon`; 0, no icon, where the add-on is not registered."""
    if _previews is None:
        return 0
    key = _key(skin, "")
    if key not in _pictures:
        # A picture that was not looked at for longest makes room, in its place: Blender keeps icons by their number.
        name = f"spectrum {len(_pictures)}" if len(_pictures) < _KEPT else _pictures.popitem(last=False)[1]
        preview = _previews.get(name) or _previews.new(name)
        pixels = swatch.plot(swatch_of(skin).reflectance)
        pixels[..., :3] *= pixels[..., 3:]  # as Blender draws its icons
        preview.image_size = pixels.shape[1::-1]
        preview.image_pixels_float = pixels.ravel()
        _pictures[key] = name
    _pictures.move_to_end(key)
    return _previews[_pictures[key]].icon_id


def _key(skin: Skin, space: Space) -> tuple:
    return (*skin.values(), space if isinstance(space, str) else space.tobytes())


def register() -> None:
    global _previews
    _previews = bpy.utils.previews.new()


def unregister() -> None:
    global _previews
    if _previews is not None:
        bpy.utils.previews.remove(_previews)
    _previews = None
    _known.clear()
    _pictures.clear()
