"""`sanguine solve`: what others script against."""

import json
import subprocess
import sys

from sanguine.cli.progress import reporter

LAYER = {"mu_a": 0.5, "mu_s": 30.0, "g": 0.8, "n": 1.4, "thickness": None}


def run(tmp_path, cases, *flags):
    path = tmp_path / "cases.json"
    path.write_text(json.dumps({"cases": cases}))
    command = [sys.executable, "-m", "sanguine.cli.main", "solve", str(path), *flags]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_answer_has_the_agreed_keys(tmp_path):
    slab = {**LAYER, "thickness": 0.5}
    result = run(tmp_path, [{"id": "a", "incidence": "diffuse", "layers": [slab]}], "--radii", "0.1,1", "--tolerance", "0.1")
    assert result.returncode == 0, result.stderr
    report = json.loads(result.stdout)
    (case,) = report["results"]
    assert set(report) == {"sanguine", "results"} and case["id"] == "a" and case["error"] is None
    assert {"solver", "Rd", "R_unscattered", "Tt", "specular", "error_estimate", "elapsed_ms", "warnings"} < set(case)
    assert case["r_mm"] == [0.1, 1.0] and len(case["R_per_mm2"]) == len(case["T_per_mm2"]) == 2


def test_status_1_when_a_case_has_no_answer(tmp_path):
    out = tmp_path / "out.json"
    bad = {**LAYER, "n": 0.5}
    result = run(tmp_path, [{"id": "x", "layers": [bad]}, {"id": "y", "layers": [LAYER]}], "--radii", "none", "--out", str(out))
    assert result.returncode == 1
    assert "x: layers.0.n: 0.5" in result.stderr.splitlines()[-1]
    first, second = json.loads(out.read_text())["results"]
    assert first["error"] and second["error"] is None and second["T_per_mm2"] is None


def test_status_2_for_bad_input(tmp_path):
    case = {"id": "a", "layers": [LAYER]}
    for cases, flags, words in [
        ([case], ["--solver", "adding"], ["--solver", "adding-doubling"]),
        ([case], ["--tolerance", "0"], ["--tolerance", "0"]),
        ([case], ["--tolerance", "low"], ["--tolerance", "'low' is not a number"]),
        ([case], ["--out", str(tmp_path)], [str(tmp_path), "directory"]),  # before the work, not after
        ([case], ["--radii", "1,0.5"], ["--radii"]),
        ([case], ["--radii", "red"], ["--radii", "red"]),
        ([{"id": "a", "layers": "skin"}], [], ["cases.0.layers"]),
        ([3], [], ["cases.0"]),
    ]:
        result = run(tmp_path, cases, *flags)
        assert result.returncode == 2 and result.stdout == "", result.stderr
        (line,) = result.stderr.strip().splitlines()
        assert all(word in line for word in words), line


def test_ids_are_no_markup(monkeypatch):
    """A terminal's bar shows them as they are; "[/x]" would end a style that was never begun."""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with reporter(as_json=False) as progress:
        progress("solve [/x]", 0, 1)
