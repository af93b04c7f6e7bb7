"""Sanguine: physiologically based skin for Blender.

The same folder is the extension (`bl_ext.<repository>.sanguine`) and, outside Blender, the package `sanguine`
behind the command line; Blender is imported only when it registers.
"""


def register() -> None:
    from .blender import registration

    registration.register()


def unregister() -> None:
    from .blender import registration

    registration.unregister()
