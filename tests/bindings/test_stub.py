"""The committed stub is the one the module makes: a change of the interface shows in review."""

import subprocess
import sys
from pathlib import Path

COMMITTED = Path(__file__).parents[2] / "native/python/sanguine_core/_core.pyi"


def test_committed_stub_is_current(tmp_path):
    generated = tmp_path / "_core.pyi"
    command = [sys.executable, "-m", "nanobind.stubgen", "-q", "-m", "sanguine_core._core", "-o", str(generated)]
    subprocess.run(command, check=True, cwd=tmp_path)
    assert generated.read_text() == COMMITTED.read_text(), "run `make stub`, read the difference, and commit it"
