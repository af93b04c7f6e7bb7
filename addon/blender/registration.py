"""What Blender is told about: properties, operators, panels and the command line."""

from __future__ import annotations

import bpy

from . import adopt, animation, capture, example, operators, panels, plain, presets, properties, swatch

_MODULES = (properties, operators, adopt, example, animation, capture, plain, presets, panels)
_CLASSES = tuple(cls for module in _MODULES for cls in module.CLASSES)
_commands: list[object] = []


def register() -> None:
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    properties.attach()
    example.add_menu()
    presets.register()
    swatch.register()
    if hasattr(bpy.utils, "register_cli_command"):  # Blender 4.2 has none
        _commands.append(bpy.utils.register_cli_command("sanguine", _command))


def unregister() -> None:
    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())
    swatch.unregister()
    presets.unregister()
    example.remove_menu()
    properties.detach()
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)


def _command(arguments: list[str]) -> int:
    """`blender --command sanguine …`"""
    from ..cli.main import main

    try:
        return main(arguments)
    except SystemExit as leave:  # argparse leaves this way after --help or a wrong flag
        return int(leave.code or 0)
