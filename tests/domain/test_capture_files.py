"""Recordings of faces: true times in every format, and one clear line for every fault."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.captures import (
    LIVE_LINK_NAMES,
    ROTATIONS,
    add,
    blinks,
    noisy,
    talking,
    timecode,
    write_live_link,
    write_mediapipe,
    write_openface,
)

from sanguine.domain.capture_files import _arkit_key, detected_rate, read_take
from sanguine.domain.errors import InputError
from sanguine.domain.facs import ARKIT


def face(seconds, seed=1):
    rng = np.random.default_rng(seed)
    return noisy(add({"eyeBlinkLeft": blinks(seconds, rng)}, talking(seconds, rng)), seconds, rng)


@pytest.fixture
def keys():
    return face(np.arange(600) / 60)


def test_live_link_face_is_read_as_it_was_recorded(tmp_path, keys):
    yaw = np.linspace(-0.3, 0.3, 600)
    path = write_live_link(
        tmp_path / "take_7_iPhone.csv",
        np.arange(600),
        keys,
        rotations={"HeadYaw": yaw, "HeadPitch": yaw},
        start=5e6 + 0.207,
    )
    take = read_take(path)
    assert (take.name, take.kind, take.fps, take.units) == ("take_7_iPhone", "live_link_face", 60.0, {})
    np.testing.assert_allclose(take.seconds, np.arange(600) / 60, atol=2e-5)  # thousandths of a frame
    assert set(take.keys) == set(ARKIT.keys)
    for key in ARKIT.keys:
        np.testing.assert_allclose(take.keys[key], keys[key], atol=1e-9)
    np.testing.assert_allclose(take.head["yaw"], yaw, atol=1e-9)
    np.testing.assert_allclose(take.head["pitch"], -yaw, atol=1e-9)
    assert take.notes == []


@pytest.mark.parametrize(("rate", "fps"), [(24, 24), (25, 25), (30, 30), (60, 60), (30, 29.97), (60, 59.94)])
def test_a_timecode_counts_in_the_rate_it_shows(tmp_path, keys, rate, fps):
    frames = np.arange(600)
    take = read_take(write_live_link(tmp_path / "a.csv", frames, keys, rate), None if rate == fps else fps)
    assert take.fps == fps
    np.testing.assert_allclose(take.seconds, frames / fps, atol=1e-9)


@pytest.mark.parametrize("rate", [30, 60])
@pytest.mark.parametrize("marked", [True, False])
def test_drop_frame_timecode_keeps_true_time(tmp_path, keys, rate, marked):
    """Ten seconds over a full minute, where two (four) counts are left out: `;` says so, or the counts do."""
    start = 55 * rate
    path = write_live_link(tmp_path / "a.csv", np.arange(600), keys, rate, drop=True, start=start)
    if not marked:
        path.write_text(path.read_text().replace(";", ":"))
    take = read_take(path)
    assert take.fps == pytest.approx(rate / 1.001)
    np.testing.assert_allclose(take.seconds, np.arange(600) * 1.001 / rate, atol=1e-9)
    assert any("drop-frame" in note for note in take.notes)


@given(frame=st.integers(0, 24 * 3600 * 60 - 600))
@settings(max_examples=30)
def test_the_helper_writes_smpte_drop_frame(frame):
    """The writer the tests rest on: consecutive frames, no count of 0 or 1 in minutes that are not tens."""
    text = timecode(frame, 30, drop=True)
    h, m, s, f = (int(part) for part in re.split("[:;]", text.split(".")[0]))
    assert not (m % 10 and s == 0 and f < 2)
    count = ((h * 60 + m) * 60 + s) * 30 + f - 2 * (h * 60 + m - (h * 60 + m) // 10)
    assert count == frame % (24 * 6 * 17982)


def test_lost_frames_are_gaps_and_nothing_bunches(tmp_path, keys):
    kept = np.delete(np.arange(600), [*range(100, 130), 200, 301])
    take = read_take(write_live_link(tmp_path / "a.csv", kept, {k: v[kept] for k, v in keys.items()}))
    np.testing.assert_allclose(take.seconds, kept / 60, atol=1e-9)
    assert take.fps == 60.0
    assert any(note.startswith("32 frames lost in 3 gaps, the longest 0.52 s") for note in take.notes)


def test_doubled_timecodes_are_merged_where_few_and_spread_where_all(tmp_path, keys):
    frames = np.arange(600)
    few = frames.copy()
    few[[50, 120]] = few[[49, 119]]
    take = read_take(write_live_link(tmp_path / "few.csv", few, keys))
    assert len(take.seconds) == 598 and any(note.startswith("2 rows at a time") for note in take.notes)
    assert np.diff(take.seconds).min() > 0.9 / 60
    # 60 rows a second under a timecode that counts 30.
    take = read_take(write_live_link(tmp_path / "all.csv", frames // 2, keys, rate=30))
    assert take.fps == 60.0
    np.testing.assert_allclose(take.seconds, frames / 60, atol=1e-9)


def test_a_slow_recording_under_a_fast_timecode_has_no_losses(tmp_path, keys):
    take = read_take(write_live_link(tmp_path / "a.csv", 2 * np.arange(600), keys, rate=60))
    assert take.fps == 30.0 and take.notes == []
    np.testing.assert_allclose(take.seconds, np.arange(600) / 30, atol=1e-9)


def test_midnight_and_rows_a_little_out_of_order(tmp_path, keys):
    frames = np.arange(600)
    take = read_take(write_live_link(tmp_path / "a.csv", frames, keys, start=24 * 3600 * 60 - 200))
    np.testing.assert_allclose(take.seconds, frames / 60, atol=1e-9)
    frames[[10, 11]] = frames[[11, 10]]
    take = read_take(write_live_link(tmp_path / "b.csv", frames, keys))
    np.testing.assert_allclose(take.seconds, np.arange(600) / 60, atol=1e-9)
    assert take.keys["jawOpen"][11] == pytest.approx(keys["jawOpen"][10], abs=1e-9)


def test_rows_without_a_face_are_gaps(tmp_path, keys):
    path = write_live_link(tmp_path / "a.csv", np.arange(600), keys)
    lines = path.read_text().splitlines()
    for i in range(101, 111):
        lines[i] = lines[i].split(",")[0] + ",0"
    path.write_text("\n".join(lines))
    take = read_take(path)
    assert len(take.seconds) == 590 and any(note.startswith("10 frames without a face") for note in take.notes)


@pytest.mark.parametrize("clock", ["timestamp_ms", "time_ms", "timestamp", "time", "seconds", "t"])
def test_mediapipe_with_any_usual_clock(tmp_path, keys, clock):
    seconds = np.arange(600) / 29.97 + 3.0
    take = read_take(write_mediapipe(tmp_path / "a.csv", seconds, keys, clock))
    assert take.kind == "mediapipe" and take.fps == 29.97
    np.testing.assert_allclose(take.seconds, seconds - 3.0, atol=1e-3)
    assert set(take.keys) == set(ARKIT.keys) - {"tongueOut"}  # MediaPipe has none
    np.testing.assert_allclose(take.keys["jawOpen"], keys["jawOpen"], atol=1e-6)


def test_mediapipe_with_frames_alone_needs_a_rate(tmp_path, keys):
    path = write_mediapipe(tmp_path / "a.csv", np.arange(600) / 30, keys, "frame")
    with pytest.raises(InputError, match=r"line 1: no column tells the time: needs timestamp .*or --source-fps"):
        read_take(path)
    assert read_take(path, 25.0).seconds[-1] == pytest.approx(599 / 25)


@pytest.mark.parametrize("key", ARKIT.keys)
def test_usual_spellings_of_a_key(key):
    short = re.sub("(Left|Right)$", lambda side: f"_{side[0][0]}", key)
    snake = re.sub("([A-Z])", r"_\1", key).lower()
    for name in (key, key[0].upper() + key[1:], short, short.replace("_", "."), snake, key.lower()):
        assert _arkit_key(name) == key


@pytest.mark.parametrize("blanks", [True, False])
def test_openface(tmp_path, blanks):
    seconds = np.arange(300) / 30
    smile = np.clip(np.sin(seconds), 0, 1)
    turn = np.linspace(-0.2, 0.2, 300)
    pose = {"pose_Ry": turn, "gaze_angle_x": 0.1 - turn}  # the head turns, the eyes stay 0.1 rad to the left in it
    path = write_openface(tmp_path / "a.csv", seconds, {"12": smile}, lost=range(100, 110), pose=pose, blanks=blanks)
    take = read_take(path)
    assert take.kind == "openface" and take.fps == 30.0 and take.keys == {}
    assert len(take.seconds) == 290 and any(note.startswith("10 frames that the tracker lost") for note in take.notes)
    kept = np.delete(np.arange(300), range(100, 110))
    np.testing.assert_allclose(take.units["12"], smile[kept], atol=1.1e-3)  # two decimals of five
    assert set(take.units) >= {"1", "45", "28"}
    np.testing.assert_allclose(take.gaze["yaw"], 0.1, atol=2e-3)
    np.testing.assert_allclose(take.head["yaw"], -turn[kept], atol=1e-3)


@pytest.mark.parametrize("fps", [23.976, 24.0, 25.0, 29.97, 30.0, 50.0, 59.94, 60.0, 120.0])
def test_rates_are_told_apart_by_clocks_of_milliseconds_with_losses(fps):
    kept = np.flatnonzero(np.random.default_rng(2).uniform(size=900) > 0.1)
    assert detected_rate(np.round(kept / fps, 3)) == fps


def broken(path, keys, change):
    lines = write_live_link(path, np.arange(20), {k: v[:20] for k, v in keys.items()}).read_text().splitlines()
    path.write_text("\n".join(change(lines)) + "\n")
    return path


def cell(line, column, text):
    def change(lines):
        cells = lines[line - 1].split(",")
        cells[lines[0].split(",").index(column)] = text
        return [*lines[: line - 1], ",".join(cells), *lines[line:]]

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (cell(7, "JawOpen", "nan"), r"line 7: JawOpen: nan is not a finite number"),
        (cell(7, "JawOpen", "1e999"), r"line 7: JawOpen: 1e999 is not a finite number"),
        (cell(7, "JawOpen", "wide"), r"line 7: JawOpen: 'wide' is not a number"),
        (cell(7, "JawOpen", ""), r"line 7: JawOpen: missing"),
        (cell(7, "JawOpen", "43"), r"line 7: JawOpen: 43 is outside 0 to 1, these look like percent"),
        (cell(7, "JawOpen", "-0.5"), r"line 7: JawOpen: -0.5 is outside 0 to 1"),
        (cell(7, "BlendshapeCount", "52"), r"line 7: BlendshapeCount: 52, but the header names 61 values"),
        (cell(7, "Timecode", "00:00:01"), r"line 7: Timecode: '00:00:01' is not HH:MM:SS:FF"),
        (cell(7, "Timecode", "00:00:01.250"), r"line 7: Timecode: '00:00:01.250' is not HH:MM:SS:FF"),
        (cell(7, "Timecode", "00:61:01:02"), r"line 7: Timecode: '00:61:01:02': hours go to 23"),
        (cell(7, "Timecode", "00:10:01:02"), r"line 8: time runs back .* split the takes"),
        (cell(1, "JawOpen", "JawAjar"), r"line 1: jawOpen: missing, all 52 blend shapes"),
        (cell(1, "JawOpen", "JawLeft"), r"line 1: JawLeft: the same blend shape as|line 1: JawLeft: stands twice"),
        (
            lambda lines: [*lines[:-1], lines[-1][:200]],
            r"line 21: \d+ cells, the header has 63: the file ends in the middle",
        ),
        (lambda lines: [*lines[:5], lines[5] + ",0.1", *lines[6:]], r"line 6: 64 cells, the header has 63$"),
        (lambda lines: lines[:1], r"holds a header and no frames"),
        (lambda lines: ["a,b,c", "1,2,3"], r"line 1: no recording of a face that is known"),
        (
            lambda lines: [line.split(",")[0] + ",0" if i else line for i, line in enumerate(lines)],
            r"no row holds a face",
        ),
        (lambda lines: ['"' + lines[0], *lines[1:]], r"not valid CSV|no recording|line 1"),
        (lambda lines: [lines[0].replace("Timecode", "Timecode\0"), *lines[1:]], r"zero bytes"),
    ],
)
def test_every_fault_is_one_clear_line(tmp_path, keys, change, message):
    path = broken(tmp_path / "a.csv", keys, change)
    with pytest.raises(InputError, match=message) as error:
        read_take(path)
    assert str(error.value).startswith(f"{path}: ") and "\n" not in str(error.value)


def test_faults_of_the_other_formats(tmp_path, keys):
    seconds = np.arange(20) / 30
    path = write_openface(tmp_path / "o.csv", seconds, {"12": np.full(20, 1.4)})
    with pytest.raises(InputError, match=r"line 2: AU12_r: 7 is outside 0 to 5"):
        read_take(path)
    path = write_openface(tmp_path / "o.csv", seconds, {}, lost=range(20))
    with pytest.raises(InputError, match=r"no row holds a face: success is 0"):
        read_take(path)
    path = write_openface(tmp_path / "o.csv", np.zeros(20), {})
    with pytest.raises(InputError, match=r"timestamp never advances: needs timestamp \(seconds\), or --source-fps"):
        read_take(path)
    with pytest.raises(InputError, match=r"no such file"):
        read_take(tmp_path / "none.csv")
    with pytest.raises(InputError, match=r"--source-fps: 0 is outside"):
        read_take(path, 0.0)


@settings(max_examples=150)
@given(
    st.lists(st.text(alphabet='0123456789:;.,-eEnaif \tAU_rc"\r', max_size=40), max_size=6),
    st.sampled_from(
        [
            ",".join(("Timecode", "BlendshapeCount", *LIVE_LINK_NAMES, *ROTATIONS)),
            "frame, timestamp, confidence, success, AU01_r, AU12_r",
            "timestamp_ms,_neutral," + ",".join(ARKIT.keys),
            "a,b",
        ]
    ),
)
def test_no_file_of_any_kind_is_met_with_a_traceback(tmp_path_factory, rows, header):
    path = tmp_path_factory.mktemp("fuzz") / "a.csv"
    path.write_text("\n".join([header, *rows]), encoding="utf-8")
    try:
        take = read_take(path)
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert np.isfinite(take.seconds).all() and np.all(np.diff(take.seconds) > 0) and take.fps > 0
