"""Arrows point one way (docs/architecture.md): each folder may import only what is below it."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ADDON = ROOT / "addon"

# folder of addon/ -> folders of addon/ it may import
ALLOWED = {
    "domain": {"domain"},
    "app": {"app", "domain"},
    "blender": {"blender", "app", "domain", "cli"},  # cli: only registration.py, for `blender --command`
    "cli": {"cli", "app", "domain", "blender"},  # blender: only the renderer behind the batch's port
}
SOURCES = sorted(ADDON.rglob("*.py"))


def imports(path: Path) -> set[str]:
    """Absolute module names and, for relative imports, `./folder` of addon/."""
    found = set()
    package = path.relative_to(ADDON).parts[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add(node.module.split(".")[0])
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1]
            target = (*base, *(node.module.split(".") if node.module else ()))
            found |= {"./" + (target[0] if target else alias.name) for alias in node.names}
    return found


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ADDON)))
def test_layers(path):
    relative = path.relative_to(ADDON)
    folder = relative.parts[0] if len(relative.parts) > 1 else None
    for name in imports(path):
        if name in ("bpy", "bmesh", "mathutils", "gpu", "idprop"):
            assert folder == "blender", f"{relative} imports {name}: only addon/blender may"
        if name == "sanguine":
            pytest.fail(f"{relative} imports the package by name: inside the add-on imports are relative")
        if name.startswith("./") and folder in ALLOWED and name[2:] in ALLOWED:
            assert name[2:] in ALLOWED[folder], f"{relative} imports {name[2:]}"
    if folder == "blender" and "./cli" in imports(path):
        assert relative.name == "registration.py"


def test_no_top_level_bpy_in_init():
    """Importing the package must not need Blender: the command line does it."""
    for node in ast.parse((ADDON / "__init__.py").read_text(encoding="utf-8")).body:
        assert not isinstance(node, (ast.Import, ast.ImportFrom))


def test_domain_app_and_cli_import_with_bpy_blocked():
    modules = [
        "sanguine." + ".".join(p.relative_to(ADDON).with_suffix("").parts).removesuffix(".__init__")
        for p in SOURCES
        if p.relative_to(ADDON).parts[0] in ("domain", "app", "cli")
    ]
    assert len(modules) > 20
    code = "import sys; sys.modules['bpy'] = None\n" + "\n".join(f"import {name}" for name in modules)
    subprocess.run([sys.executable, "-c", code], check=True)


IMAGE_LIBRARIES = ("OpenImageIO", "OpenEXR", "Imf", "Imath")
PYTHON_LIBRARIES = ("nanobind", "Python.h", "pybind")
FILES_AND_STREAMS = ("fstream", "iostream", "cstdio", "filesystem")


@pytest.mark.parametrize(
    "path", sorted((ROOT / "native").rglob("*.[ch]pp")), ids=lambda p: str(p.relative_to(ROOT / "native"))
)
def test_native_layers(path):
    """Only bindings know Python, only texture knows image libraries, optics does no I/O."""
    where = path.relative_to(ROOT / "native").as_posix()
    includes = re.findall(r'#include\s+[<"]([^>"]+)[>"]', path.read_text(encoding="utf-8"))
    forbidden: tuple[str, ...] = ()
    if not where.startswith("bindings/"):
        forbidden += PYTHON_LIBRARIES
    if not where.startswith("src/texture/"):
        forbidden += IMAGE_LIBRARIES
    if where.startswith(("src/optics/", "src/mesh/")):
        forbidden += FILES_AND_STREAMS
    assert not [name for name in includes if name.startswith(forbidden)]
