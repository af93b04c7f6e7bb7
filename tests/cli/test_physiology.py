"""`sanguine physiology`: report, profile and plots of a synthetic study, and one line for every kind of fault."""

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sanguine.app import physiology
from sanguine.domain.blood import ANATOMY
from sanguine.domain.errors import InputError
from sanguine.domain.profile import Calibration, read_profile
from support.sessions import INDEX, PERFUSION, PULSE, SPO2, Answer, Design, simulate, write_csv

H = "hemoglobin_index"
ANSWERS = {
    (H, "anger"): Answer(0.3, 0.3, 0.1, 0.1), (H, "fear"): Answer(0.0, 0.0, 0.1, 0.1),
    ("pulse", "anger"): Answer(10.0, 10.0, 4.0, 4.0), ("perfusion", "anger"): Answer(-0.4, -0.4, 0.1, 0.1),
    ("spo2", "fear"): Answer(-0.01, -0.01, 0.003, 0.003), ("spo2", "anger"): Answer(0.0, 0.0, 0.003, 0.003),
}  # fmt: skip
SIGNALS = {"spo2": SPO2, "pulse": dataclasses.replace(PULSE, lag_s=6.0, dropped=0.2), "perfusion": PERFUSION, H: INDEX}
DESIGN = Design(women=7, men=6, step_s=3.0, answers=ANSWERS, signals=SIGNALS)


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "sanguine.cli.main", "physiology", *map(str, arguments)], capture_output=True, text=True
    )


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "study.csv"
    write_csv(path, simulate(DESIGN, 11), "synthetic")
    return path


def test_report_profile_and_plots(recording, tmp_path):
    out, profile, plots = tmp_path / "r.json", tmp_path / "p.toml", tmp_path / "plots"
    result = run(recording, "--out", out, "--profile", profile, "--plots", plots)
    assert result.returncode == 0 and result.stdout == "", result.stderr
    report = json.loads(out.read_text())
    assert report["subjects"] == {"all": 13, "female": 7, "male": 6}
    changes = {(c["measure"], c["emotion"], c["sex"]): c for c in report["changes"]}
    anger = changes[H, "anger", "pooled"]
    # e^0.3 - 1 = 35 %; three standard errors of thirteen people who spread by 0.1.
    assert anger["change"] == pytest.approx(0.35, abs=0.12) and anger["low"] < anger["change"] < anger["high"]
    assert anger["supported"] and anger["region"] == "cheeks" and anger["subjects"] == 13
    assert anger["d_z"]["low"] > 0 and anger["hedges_g"]["value"] < anger["d_z"]["value"]
    assert not changes[H, "fear", "pooled"]["supported"]
    assert changes[H, "anger", "female"]["subjects"] == 7
    assert {d["sex"] for d in report["sex_differences"]} == {"female - male"}
    assert report["lag"]["pulse"]["used_s"] == pytest.approx(6.0, abs=3.0)
    for row in report["cleaning"]:
        assert row["samples"] == sum(value for key, value in row.items() if key not in ("measure", "samples"))
    assert "pulse" in result.stderr and "the sensor lost the signal" in result.stderr
    assert "anger cheeks hemoglobin index: +" in result.stderr and ": supported" in result.stderr
    read = read_profile(profile)
    assert read.rows["anger", "cheeks", "hemoglobin"].value == pytest.approx(
        anger["change"] * 0.014 * ANATOMY["cheeks"].hemoglobin, rel=1e-3
    )
    assert ("fear", "cheeks", "oxygenation") in read.rows and ("fear", "cheeks", "hemoglobin") not in read.rows
    assert any(row.measure == "perfusion" and "finger" in row.verdict for row in read.unsupported)
    for name in ("changes.png", "courses.png", "correlations.png"):
        assert (plots / name).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_the_example_says_what_docs_say():
    """docs/physiology.md quotes it."""
    root = Path(__file__).resolve().parents[2]
    options = physiology.Settings()
    done = physiology.study(physiology.read_recordings([root / "examples" / "recording.csv"], options), options)
    row = physiology.make_profile(done).rows["anger", "cheeks", "hemoglobin"]
    page = (root / "docs" / "physiology.md").read_text(encoding="utf-8")
    assert f"value = {row.value!r}, low = {row.low!r}, high = {row.high!r}" in page and row.note in page
    supported = {(f.measure, f.emotion) for f in done.findings if f.supported and f.group == "pooled"}
    assert {(H, "anger"), (H, "fear"), ("spo2", "sad")} <= supported and not {(H, "happy"), (H, "sad")} & supported


def test_json_on_standard_output_alone_and_progress_lines(recording):
    result = run(recording, "--json-progress", "--lag-s", "6")
    assert result.returncode == 0
    assert json.loads(result.stdout)["lag"]["pulse"] == {"used_s": 6.0, "estimated": None}
    progress = [json.loads(line) for line in result.stderr.splitlines() if line.startswith("{")]
    assert progress[-1] == {"stage": "estimate", "done": 1, "total": 1}


def test_a_study_in_two_files_is_the_study(recording, tmp_path):
    """Subjects in one file each: what comes out is the same, but for the lag, which sees the same tracks."""
    lines = recording.read_text().splitlines()
    for name, own in (("a.csv", ("s01", "s02", "s03", "s04", "s05")), ("b.csv", ())):
        rows = [
            line
            for line in lines[2:]
            if (line.split(",")[1] in own) == bool(own) and (own or line.split(",")[1] > "s05")
        ]
        (tmp_path / name).write_text("\n".join([lines[1], *rows]) + "\n")
    options = physiology.Settings(lag_s=6.0)
    whole, parts = (
        physiology.report(physiology.study(physiology.read_recordings(paths, options), options))
        for paths in ([recording], [tmp_path / "a.csv", tmp_path / "b.csv"])
    )
    assert parts["changes"] == whole["changes"] and len(parts["recordings"]) == 2


def test_the_same_input_gives_the_same_bytes(recording, tmp_path):
    for name in ("1", "2"):
        assert run(recording, "--out", tmp_path / name, "--plots", tmp_path / f"plots{name}").returncode == 0
    assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes()
    for name in ("changes.png", "courses.png", "correlations.png"):
        assert (tmp_path / "plots1" / name).read_bytes() == (tmp_path / "plots2" / name).read_bytes()


HEADER = "time_s,subject,sex,emotion,spo2_percent"


@pytest.mark.parametrize(
    ("text", "arguments", "words"),
    [
        (f"{HEADER}\n0,s,f,neutral,-3\n", [], ["line 2: spo2_percent", "negative"]),
        (f"{HEADER}\n0,s,f,neutral,98\n9,s,f,neutral,98\n", [], ["nothing to compare", "neutral"]),
        (f"{HEADER}\n0,s,f,neutral,\n", [], ["not one measured value"]),
        (None, ["--region", "cheek"], ["--region", "did you mean 'cheeks'"]),
        (None, ["--oximeter", "fingr"], ["--oximeter", "did you mean 'finger'"]),
        (None, ["--labels", "joy=hapy"], ["--labels", "did you mean 'happy'"]),
        (None, ["--labels", "joy"], ["--labels", "OWN=EMOTION"]),
        (None, ["--lag-s", "soon"], ["--lag-s", "soon"]),
        (None, ["--lag-s", "-3"], ["--lag-s", "-3"]),
        (None, ["--settle-s", "-3"], ["--settle-s", "-3"]),
        (None, ["--gain", "0"], ["--gain", "0"]),
        (None, ["--melanin", "18"], ["--melanin", "18", "fraction"]),
        (None, ["--window-s", "0.01"], ["--window-s", "0.01"]),
        (None, ["--settle-s", "3000"], ["nothing to compare", "--settle-s"]),
    ],
)
def test_bad_input_is_one_line_and_status_2(recording, tmp_path, text, arguments, words):
    path = recording
    if text is not None:
        path = tmp_path / "bad.csv"
        path.write_text(text)
    result = run(path, *arguments)
    assert result.returncode == 2 and result.stdout == "", result.stderr
    lines = [line for line in result.stderr.splitlines() if not line.startswith(("clean ", "estimate "))]
    assert len(lines) == 1, lines
    for word in words:
        assert word in lines[0]


def test_faults_between_files(recording, tmp_path):
    twin = tmp_path / "twin.csv"
    twin.write_bytes(recording.read_bytes())
    other = tmp_path / "other.csv"
    other.write_text(f"{HEADER}\n0,s01,m,neutral,98\n")
    options = physiology.Settings()
    with pytest.raises(InputError, match="the same samples as in study.csv"):
        physiology.read_recordings([recording, twin], options)
    with pytest.raises(InputError, match="sex of 's01' is male, in study.csv it is female"):
        physiology.read_recordings([recording, other], options)


def test_a_profile_needs_to_know_where_the_analyser_sat(tmp_path):
    path = tmp_path / "r.csv"
    write_csv(path, simulate(dataclasses.replace(DESIGN, region="", signals={H: INDEX}), 12))
    options = physiology.Settings()
    done = physiology.study(physiology.read_recordings([path], options), options)
    with pytest.raises(InputError, match="--profile: the hemoglobin index has no region: .*--region"):
        physiology.make_profile(done)
    there = dataclasses.replace(
        done, settings=physiology.Settings(calibration=Calibration(index_region=("cheeks", "nose")))
    )
    assert {region for _, region, _ in physiology.make_profile(there).rows} == {"cheeks", "nose"}


@pytest.mark.parametrize(("package", "plots"), [("scipy", False), ("matplotlib", True)])
def test_a_missing_package_is_named(monkeypatch, package, plots):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError, match=f"needs the Python package '{package}'"):
        physiology.check_packages(plots)


CELL = st.sampled_from(["", "0", "98", "50", "1e-300", "97.5", "100"])
ROW = st.tuples(
    st.sampled_from(["a", "b"]),
    st.sampled_from(["neutral", "anger", ""]),
    st.sampled_from([1.0, 30.0, 0.001, 3000.0]),
    CELL,
    CELL,
)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(ROW, max_size=60))
def test_whatever_is_recorded_gives_a_report_or_one_line(tmp_path, rows):
    path, time, lines = (
        tmp_path / "any.csv",
        {"a": 0.0, "b": 0.0},
        ["time_s,subject,sex,emotion,spo2_percent,hemoglobin_index"],
    )
    for subject, emotion, step, *cells in rows:
        time[subject] += step
        lines.append(",".join([repr(time[subject]), subject, "f", emotion, *cells]))
    path.write_text("\n".join(lines) + "\n")
    options = physiology.Settings()
    try:
        done = physiology.study(physiology.read_recordings([path], options), options)
        json.dumps(physiology.report(done), allow_nan=False)
        assert all("\n" not in line for line in (*done.warnings, *physiology.summary(done)))
    except InputError as error:
        assert "\n" not in str(error)
