"""Sanguine's native core: skin optics, chromophore images, UV raster.

Everything public is in the compiled module; `_core.pyi` documents it.
"""

from ._core import *  # noqa: F403 - the compiled module is the list
from ._core import __version__ as __version__
