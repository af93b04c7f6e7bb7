#!/usr/bin/env python3
"""Build the Blender extension: one zip with the add-on, its data and its wheels.

The native wheel has to be in dist/wheels (`make native`), one for each platform
asked for. The other wheels are those of requirements-addon.txt, for both Pythons
that Blender has. The example heads come as those files of the head package that
they are made of. Packing and checking is done by Blender's own extension tool,
out of the bpy package of the Python that runs this.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import importlib.util
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
REQUIREMENTS = ROOT / "tools/requirements-addon.txt"

# Blender 4.2 to 5.0 have Python 3.11, 5.1 and later 3.13. Each wheel is taken
# for the older of the C libraries of the day.
PYTHON_VERSIONS = ("3.11", "3.13")
# Blender's name of a platform -> pip's names of it, and how a native wheel for it is tagged.
PLATFORMS = {
    "linux-x64": (("manylinux2014_x86_64", "manylinux_2_17_x86_64", "manylinux_2_28_x86_64"), r"manylinux\w+_x86_64"),
    "macos-arm64": (("macosx_11_0_arm64",), r"macosx_\d+_\d+_arm64"),
    "macos-x64": (("macosx_10_12_x86_64", "macosx_11_0_x86_64"), r"macosx_\d+_\d+_x86_64"),
    "windows-x64": (("win_amd64",), r"win_amd64"),
}

# What the add-on reads beside its code, as it lies next to addon/ in the tree.
DATA = ("rigs", "shaders_osl")
UNWANTED = shutil.ignore_patterns("__pycache__", "*.pyc", "*.egg-info", "build", "pyproject.toml")


def blender_extension_tool() -> Path:
    spec = importlib.util.find_spec("bpy")
    if spec is None:
        sys.exit("build_extension: this Python has no bpy, which holds Blender's extension tool")
    (tool,) = Path(spec.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    return tool


def native_wheel(platform: str) -> Path:
    tag = re.compile(PLATFORMS[platform][1])
    wheels = [wheel for wheel in (ROOT / "dist/wheels").glob("sanguine_core-*.whl") if tag.search(wheel.stem)]
    if len(wheels) != 1:
        found = f"{len(wheels)} native wheels for {platform} in dist/wheels"
        sys.exit(f"build_extension: {found}, expected one: run `make native`")
    return wheels[0]


def pinned_wheels(platform: str) -> list[Path]:
    """The wheels of requirements-addon.txt, downloaded once per version of that list."""
    digest = hashlib.sha256(REQUIREMENTS.read_bytes()).hexdigest()[:12]
    folder = ROOT / ".cache/wheels" / digest / platform
    if not folder.exists():
        partial = folder.with_suffix(".partial")
        shutil.rmtree(partial, ignore_errors=True)
        for version in PYTHON_VERSIONS:
            command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary", ":all:"]
            command += ["--python-version", version, "--implementation", "cp"]
            command += [word for tag in PLATFORMS[platform][0] for word in ("--platform", tag)]
            subprocess.run([*command, "--requirement", str(REQUIREMENTS), "--dest", str(partial)], check=True)
        partial.rename(folder)
    return sorted(folder.glob("*.whl"))


def this_tree() -> None:
    """Makes `import sanguine` mean this tree's add-on, whatever is installed."""
    spec = importlib.util.spec_from_file_location(
        "sanguine", ROOT / "addon/__init__.py", submodule_search_locations=[str(ROOT / "addon")]
    )
    sys.modules["sanguine"] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)


def stage_heads(folder: Path) -> None:
    """Builds every example head and keeps what was read on the way, with its licence."""
    this_tree()
    package_module = importlib.import_module("sanguine.domain.head.package")
    example_head = importlib.import_module("sanguine.app.faces").example_head
    package = package_module.HeadPackage()
    for head in tomllib.loads((ROOT / "rigs/heads.toml").read_text()):
        example_head(head, package)
    for name in sorted(package.used | {package_module.LICENCE_FILE}):
        target = folder / package_module.BUNDLE / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(package.root / name, target)


def stage(folder: Path, platforms: list[str]) -> None:
    """The extension as a folder: what Blender will unpack."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "addon", folder, ignore=UNWANTED)
    for name in DATA:
        shutil.copytree(ROOT / name, folder / name, ignore=UNWANTED)
    stage_heads(folder)
    shutil.copy2(ROOT / "LICENSE", folder)
    (folder / "wheels").mkdir()
    wheels = {}  # those that serve every platform come once
    for platform in platforms:
        wheels.update((wheel.name, wheel) for wheel in [native_wheel(platform), *pinned_wheels(platform)])
    for wheel in wheels.values():
        shutil.copy2(wheel, folder / "wheels")
    names = "".join(f'    "./wheels/{name}",\n' for name in wheels)
    manifest = folder / "blender_manifest.toml"
    text = re.sub(r"(?m)^platforms = .*$", f"platforms = {platforms!r}".replace("'", '"'), manifest.read_text())
    manifest.write_text(f"wheels = [\n{names}]\n\n" + text)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="folder for the zip (dist/)")
    parser.add_argument(
        "--platform", action="append", choices=PLATFORMS, dest="platforms",
        help="one zip for each (linux-x64; only that one is tested)",
    )  # fmt: skip
    arguments = parser.parse_args()
    output, platforms = arguments.output.resolve(), arguments.platforms or ["linux-x64"]
    output.mkdir(parents=True, exist_ok=True)
    staging = output / "extension"
    stage(staging, platforms)

    tool = [sys.executable, str(blender_extension_tool())]
    for old in output.glob("sanguine-*.zip"):
        old.unlink()
    split = ["--split-platforms"] if len(platforms) > 1 else []
    subprocess.run([*tool, "build", "--source-dir", str(staging), "--output-dir", str(output), *split], check=True)
    for archive in sorted(output.glob("sanguine-*.zip")):
        subprocess.run([*tool, "validate", str(archive)], check=True)
        print(f"{archive}: {archive.stat().st_size / 1e6:.1f} MB")
    shutil.rmtree(staging)


if __name__ == "__main__":
    main()
