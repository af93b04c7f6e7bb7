"""The zip that users get: built, installed into an empty Blender user folder, enabled, and used from there."""

import json
import os
import subprocess
import sys
from pathlib import Path
from site import getsitepackages as site_packages

import pytest

BUILDER = Path(__file__).parents[2] / "tools/build_extension.py"

# Runs in a Blender of its own. The last line it prints is what it found.
INSTALL = """
import json, sys
import bpy

archive = sys.argv[1]
result = bpy.ops.extensions.package_install_files(
    filepath=archive, repo="user_default", enable_on_install=True
)
assert result == {"FINISHED"}, result

import bl_ext.user_default.sanguine as addon
import sanguine_core, pydantic
import bl_ext.user_default.sanguine.domain.resources as resources

print(json.dumps({
    "enabled": "bl_ext.user_default.sanguine" in bpy.context.preferences.addons,
    "addon": addon.__file__,
    "native": sanguine_core.__file__,
    "pydantic": pydantic.__file__,
    "rigs": str(resources.rigs_path("emotions.toml")),
}))
"""


@pytest.fixture(scope="session")
def archive(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("extension")
    subprocess.run([sys.executable, str(BUILDER), "--output", str(folder)], check=True)
    (archive,) = folder.glob("*.zip")
    return archive


@pytest.fixture(scope="session")
def run_in_blender(tmp_path_factory):
    """Run a script in a new Blender that shares one user folder, empty at first, with the session's others.

    The interpreter sees Blender and the head data, and nothing else of this environment: what the add-on imports
    has to come out of the zip.
    """
    user = tmp_path_factory.mktemp("blender_user")
    site = tmp_path_factory.mktemp("site")
    for name in ("bpy", "numpy", "numpy.libs", "anny"):
        for folder in map(Path, site_packages()):
            if (folder / name).exists():
                (site / name).symlink_to(folder / name)

    def run(script: str, *arguments: str) -> str:
        environment = dict(os.environ, BLENDER_USER_RESOURCES=str(user), PYTHONPATH=str(site))
        command = [sys.executable, "-S", "-c", script, *arguments]  # -S: without this environment's packages
        result = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=user)
        assert result.returncode == 0, result.stdout + result.stderr
        return result.stdout

    run.user = user
    return run


@pytest.fixture(scope="session")
def installed(archive, run_in_blender) -> dict:
    return json.loads(run_in_blender(INSTALL, str(archive)).rstrip().splitlines()[-1])


def test_installs_and_enables(installed):
    assert installed["enabled"]


@pytest.mark.parametrize("part", ["addon", "native", "pydantic", "rigs"])
def test_everything_comes_from_the_installed_copy(installed, run_in_blender, part):
    assert Path(installed[part]).is_relative_to(run_in_blender.user)
