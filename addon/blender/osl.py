"""OSL script nodes from source text, kept inside the file."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy

from ..domain.shading import Renderer


def missing_osl() -> str:
    """Why this Blender runs no OSL, one line, "" when it does. Debian's Cycles is built without."""
    try:
        import _cycles
    except ImportError:
        return "this Blender has no Cycles"
    return "" if _cycles.with_osl else "the Cycles of this Blender was built without OSL"


def renderer_of(scene: bpy.types.Scene) -> Renderer:
    """What would render the scene here."""
    device = "CPU"
    if getattr(getattr(scene, "cycles", None), "device", "CPU") == "GPU":
        addon = bpy.context.preferences.addons.get("cycles")
        device = getattr(addon.preferences, "compute_device_type", "NONE") if addon is not None else "NONE"
        device = "CPU" if device == "NONE" else device
    return Renderer(scene.render.engine, missing_osl(), device)


def has_scripts() -> bool:
    """Whether a material of the file holds a script node."""
    trees = (*(material.node_tree for material in bpy.data.materials if material.node_tree), *bpy.data.node_groups)
    return any(node.bl_idname == "ShaderNodeScript" for tree in trees for node in tree.nodes)


def find_oslquery() -> None:
    """Puts Blender's own packages on the path where they are not: in `bpy` as a module they are left off.

    Without `oslquery` a script node gets no sockets. Appended, so that nothing of the user's is shadowed.
    """
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    packages = Path(bpy.utils.resource_path("LOCAL")) / "python" / "lib" / version / "site-packages"
    if packages.is_dir() and str(packages) not in sys.path:
        sys.path.append(str(packages))


@contextlib.contextmanager
def _cycles() -> Iterator[None]:
    """Cycles as the scene's engine: Blender asks the current engine to compile a script, and only Cycles can."""
    render = bpy.context.scene.render
    engine = render.engine
    render.engine = "CYCLES"
    try:
        yield
    finally:
        render.engine = engine


def script_node(tree: bpy.types.NodeTree, name: str, source: str) -> bpy.types.Node:
    """A script node in INTERNAL mode: text and bytecode are stored in the file. Raises RuntimeError with the log."""
    find_oslquery()
    text = bpy.data.texts.new(f"{name}.osl")
    text.write(source)
    node = tree.nodes.new("ShaderNodeScript")
    node.name = node.label = name
    node.mode = "INTERNAL"
    with _cycles():
        node.script = text
    if not node.outputs:
        raise RuntimeError(f"{name}: OSL did not compile; Blender's console has the reason")
    return node
