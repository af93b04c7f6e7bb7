#!/usr/bin/env python3
"""Build the Blender extension: one zip with the add-on, its data and its wheels.

The native wheel has to be in dist/wheels (`make native`). The other wheels are
those of requirements-addon.txt, for both Pythons that Blender has. Packing and
checking is done by Blender's own extension tool, out of the bpy package of the
Python that runs this.
"""

import argparse
import hashlib
import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
REQUIREMENTS = ROOT / "tools/requirements-addon.txt"

# Blender 4.2 to 5.0 have Python 3.11, 5.1 and later 3.13. Each wheel is taken
# for the older of the C libraries of the day.
PYTHON_VERSIONS = ("3.11", "3.13")
PLATFORMS = ("manylinux2014_x86_64", "manylinux_2_17_x86_64", "manylinux_2_28_x86_64")

# What the add-on reads beside its code, as it lies next to addon/ in the tree.
DATA = ("rigs", "shaders_osl")
UNWANTED = shutil.ignore_patterns("__pycache__", "*.pyc", "*.egg-info", "build", "pyproject.toml")


def blender_extension_tool() -> Path:
    spec = importlib.util.find_spec("bpy")
    if spec is None:
        sys.exit("build_extension: this Python has no bpy, which holds Blender's extension tool")
    (tool,) = Path(spec.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    return tool


def native_wheel() -> Path:
    wheels = list((ROOT / "dist/wheels").glob("sanguine_core-*.whl"))
    if len(wheels) != 1:
        sys.exit(f"build_extension: {len(wheels)} native wheels in dist/wheels, expected one: run `make native`")
    return wheels[0]


def pinned_wheels() -> list[Path]:
    """The wheels of requirements-addon.txt, downloaded once per version of that list."""
    digest = hashlib.sha256(REQUIREMENTS.read_bytes()).hexdigest()[:12]
    folder = ROOT / ".cache/wheels" / digest
    if not folder.exists():
        partial = folder.with_suffix(".partial")
        shutil.rmtree(partial, ignore_errors=True)
        for version in PYTHON_VERSIONS:
            command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary", ":all:"]
            command += ["--python-version", version, "--implementation", "cp"]
            command += [word for platform in PLATFORMS for word in ("--platform", platform)]
            subprocess.run([*command, "--requirement", str(REQUIREMENTS), "--dest", str(partial)], check=True)
        partial.rename(folder)
    return sorted(folder.glob("*.whl"))


def stage(folder: Path) -> None:
    """The extension as a folder: what Blender will unpack."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "addon", folder, ignore=UNWANTED)
    for name in DATA:
        shutil.copytree(ROOT / name, folder / name, ignore=UNWANTED)
    shutil.copy2(ROOT / "LICENSE", folder)
    (folder / "wheels").mkdir()
    wheels = [native_wheel(), *pinned_wheels()]
    for wheel in wheels:
        shutil.copy2(wheel, folder / "wheels")
    names = "".join(f'    "./wheels/{wheel.name}",\n' for wheel in wheels)
    manifest = folder / "blender_manifest.toml"
    manifest.write_text(f"wheels = [\n{names}]\n\n" + manifest.read_text())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="folder for the zip (dist/)")
    output = parser.parse_args().output.resolve()
    output.mkdir(parents=True, exist_ok=True)
    staging = output / "extension"
    stage(staging)

    tool = [sys.executable, str(blender_extension_tool())]
    for old in output.glob("sanguine-*.zip"):
        old.unlink()
    subprocess.run([*tool, "build", "--source-dir", str(staging), "--output-dir", str(output)], check=True)
    (archive,) = output.glob("sanguine-*.zip")
    subprocess.run([*tool, "validate", str(archive)], check=True)
    shutil.rmtree(staging)
    print(archive)


if __name__ == "__main__":
    main()
