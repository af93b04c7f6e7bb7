"""`sanguine bench accuracy`: its quick mode runs and is sound; so are the results that stand in the repository."""

import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import sanguine_core

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "bench" / "results" / "accuracy.json"
PAGE = ROOT / "docs" / "accuracy.md"


def run(*arguments, **kwargs):
    return subprocess.run(
        [sys.executable, "-m", "sanguine.cli.main", *map(str, arguments)], capture_output=True, text=True, **kwargs
    )


def report():
    sys.path.insert(0, str(ROOT / "bench"))
    try:
        import accuracy_report

        return accuracy_report
    finally:
        sys.path.pop(0)


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    out = tmp_path_factory.mktemp("bench")
    result = run("bench", "accuracy", "--quick", "--out", out)
    assert result.returncode == 0, result.stderr
    assert result.stdout == ""
    return json.loads((out / "accuracy.json").read_text()), (out / "accuracy.md").read_text()


@pytest.fixture(scope="module")
def committed():
    return json.loads(RESULTS.read_text())


def assert_sound(results):
    """What must hold of any run, on any machine."""
    # The truth of the colours agrees with the reference's Monte Carlo within its noise, and with its second number,
    # which is good to 1e-4, within that and twice its own last step.
    for row in results["truth"]["against_reference"]:
        assert abs(row["error"]) < 3 * row["floor"], row
        assert abs(row["against_second"]) < 1e-4 + 2 * abs(row["step"]), row
    known = {row["id"] for row in sanguine_core.solvers()}
    assert {row["solver"] for row in results["ladder"]} == known
    for row in results["ladder"]:
        if row["refused"]:
            continue
        # No time without its error, no error without its time.
        for seconds, error in (("seconds", "Rd_error"), ("profile_seconds", "profile_error")):
            assert (row[seconds] is None) == (row[error] is None), row
        assert row["seconds"] > 0 and math.isfinite(row["Rd_error"])
    for row in results["colour"] + results["wavelengths"]:
        assert row["seconds"] > 0 and 0 <= row["delta_e_D65_median"] <= row["delta_e_D65_worst"]
        assert 0 <= row["delta_e_A_median"] <= row["delta_e_A_worst"]
    # Times are what they seem: more work takes longer.
    for rows in (results["wavelengths"], [row for row in results["colour"] if row["solver"] == "adding-doubling"]):
        assert [row["seconds"] for row in rows] == sorted(row["seconds"] for row in rows)
    # More wavelengths, a better colour: 3 are off by what anyone sees, 41 by what nobody can (1 is about visible).
    colours = {row["wavelengths"]: row["delta_e_D65_worst"] for row in results["wavelengths"]}
    assert colours[3] > 1 > 10 * colours[41]
    # Fewer nodes or entries, larger errors.
    nodes = [row["Rd_change_worst"] for row in results["tau_nodes"]]
    assert nodes == sorted(nodes)
    for axis in ("hemoglobin", "melanin"):
        # (The planner's own count lies between two others, and the worst of so many places is not that smooth.)
        entries = [row["delta_e_D65_worst"] for row in results["lut"] if row["axis"] == axis and not row["planned"]]
        assert len(entries) >= 2 and entries == sorted(entries, reverse=True)
    for row in results["equal_error"]:
        assert row["factor"] == pytest.approx(row["seconds"] / row["skin_s"])
    limit = results["speed"]["limit"]
    assert 0 < limit["share_of_peak"] < 1


def test_quick_run(quick):
    results, page = quick
    assert results["quick"] and results["sanguine"] == sanguine_core.__version__
    assert_sound(results)
    assert page == report().tables(results)


def test_committed_results(committed, quick):
    assert not committed["quick"]
    assert committed.keys() == quick[0].keys()
    assert_sound(committed)
    text = RESULTS.read_text()
    assert "/tmp" not in text and "/home" not in text and str(ROOT) not in text


def test_the_pages_show_the_committed_results(committed):
    written = report().tables(committed)
    assert (RESULTS.parent / "accuracy.md").read_text() == written
    shown = PAGE.read_text().split(report().BEGIN)[1].split(report().END)[0]
    assert shown.strip() == report().tables(committed, brief=True).strip()
    assert (PAGE.parent / "accuracy_optics.png").stat().st_size > 10_000


def test_committed_bars(committed):
    """The accuracy that the project promises, as it was measured."""
    rows = [row for row in committed["ladder"] if not row["refused"]]
    floor = {row["case"]: row for row in committed["floors"]}
    for row in rows:
        if row["solver"] == "adding-doubling" and row["setting"] in ("32 streams", "48 streams"):
            assert abs(row["Rd_error"]) < max(2e-3, 3 * floor[row["case"]]["Rd"]), row
        if row["solver"] == "auto" and row["setting"] == "tolerance 0.01":
            assert abs(row["Rd_error"]) < 0.01 + 3 * floor[row["case"]]["Rd"], row
            if row["group"] == "skin":
                assert row["bar_error"] < 0.04, row


def test_outside_a_checkout(tmp_path):
    shutil.copytree(ROOT / "addon", tmp_path / "sanguine", ignore=shutil.ignore_patterns("__pycache__"))
    result = run("bench", "accuracy", env=os.environ | {"PYTHONPATH": str(tmp_path)}, cwd=tmp_path)
    assert result.returncode == 2
    assert result.stdout == "" and len(result.stderr.strip().splitlines()) == 1
    assert "checkout" in result.stderr


def test_unknown_bench():
    result = run("bench", "speed")
    assert result.returncode == 2 and "accuracy" in result.stderr
