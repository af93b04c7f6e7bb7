"""OSL script nodes from source text, kept inside the file."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy


def missing_osl() -> str:
    """Why this Blender cannot show the skin's material, one line, "" when it can. Debian's Cycles is built without OSL."""
    try:
        import _cycles
    except ImportError:
        return "this Blender has no Cycles, which renders the skin"
    if not _cycles.with_osl:
        return "the Cycles of this Blender was built without OSL, which the skin is made of: use a Blender of blender.org"
    return ""


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
