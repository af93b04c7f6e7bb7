"""`sanguine capture`: from a file to curves, and the answer it prints."""

import json
import subprocess
import sys

import numpy as np
import pytest
from support.captures import add, blinking, noisy, showing, talking, write_live_link, write_mediapipe, write_openface

from sanguine.app.capture import capture
from sanguine.domain.errors import InputError
from sanguine.domain.facs import ARKIT, UNIT_CONTROLS

SECONDS = np.arange(12 * 60) / 60


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "sanguine.cli.main", "capture", *map(str, arguments)], capture_output=True, text=True
    )


@pytest.fixture(scope="module")
def angry(tmp_path_factory):
    """An angry talking face of 12 s at 60 frames a second, some of them lost."""
    rng = np.random.default_rng(1)
    keys = noisy(add(showing("anger", 1.0, SECONDS, rng), talking(SECONDS, rng), blinking(SECONDS, rng)), SECONDS, rng)
    kept = np.delete(np.arange(len(SECONDS)), range(300, 318))
    path = tmp_path_factory.mktemp("take") / "angry.csv"
    return write_live_link(
        path, kept, {key: values[kept] for key, values in keys.items()}, rotations={"HeadYaw": 0.2 * np.sin(SECONDS)}
    ), keys


def test_a_take_becomes_curves_on_controls(angry):
    path, keys = angry
    performance = capture(path, 24.0)
    assert (performance.source_fps, performance.fps, performance.frames) == (
        60.0,
        24.0,
        289,
    )  # the last row is at 287.6
    units = set(performance.controls) - {"anger_blood"}
    assert units < set(UNIT_CONTROLS) and {"AU4L", "AU4R", "AU45L", "AU26"} <= units
    for frames, values in performance.controls.values():
        np.testing.assert_array_equal(frames, np.arange(289))
        assert values.min() >= 0 and values.max() <= 1.5
    assert performance.peak_error <= 0.02  # the number; nothing is lost without smoothing and reduction
    lids = keys["eyeBlinkLeft"]
    assert performance.controls["AU45L"][1].max() >= 0.98 * lids.max()
    assert performance.emotions().keys() == {"anger"}
    assert np.abs(performance.head_deg["yaw"][1]).max() == pytest.approx(np.degrees(0.2), abs=1.5)  # from the median
    assert set(performance.residual) == set(ARKIT.keys)


def test_options_do_what_they_say(angry):
    path, _ = angry
    plain, smooth = capture(path, 24.0, emotions=()), capture(path, 24.0, smooth_s=0.2, emotions=())
    rough = lambda p: np.abs(np.diff(p.controls["AU4L"][1], 2)).mean()  # noqa: E731
    assert rough(smooth) < 0.5 * rough(plain)
    assert not plain.emotions()
    reduced = capture(path, 24.0, emotions=(), reduce=0.03)  # twice the noise
    keys = sum(len(frames) for frames, _ in reduced.controls.values())
    assert keys < 0.5 * sum(len(frames) for frames, _ in plain.controls.values())
    for name, (frames, values) in reduced.controls.items():
        np.testing.assert_allclose(np.interp(np.arange(289), frames, values), plain.controls[name][1], atol=0.03 + 1e-9)
    assert "not inferred" in capture(path, emotions=("arousal",)).notes[-1]


def test_the_three_formats_tell_the_same_performance(tmp_path):
    seconds = np.arange(10 * 30) / 30
    rng = np.random.default_rng(2)
    keys = showing("happy", 1.0, seconds, rng, 2, 8) | {}
    keys = {key: keys.get(key, np.zeros(len(seconds))) for key in ARKIT.keys}
    live = capture(write_live_link(tmp_path / "l.csv", np.arange(len(seconds)), keys, rate=30), 25.0)
    media = capture(write_mediapipe(tmp_path / "m.csv", seconds, keys), 25.0)
    for name, (_, values) in live.controls.items():
        np.testing.assert_allclose(media.controls[name][1], values, atol=0.02)  # times to the millisecond
    smile = (live.controls["AU12L"][1] + live.controls["AU12R"][1]) / 2
    units = {"12": np.interp(seconds, np.arange(len(smile)) / 25, smile), "6": 0.8 * keys["cheekSquintLeft"]}
    face = capture(write_openface(tmp_path / "o.csv", seconds, units), 25.0)
    np.testing.assert_allclose(face.controls["AU12"][1], smile, atol=0.03)
    assert face.emotions().keys() == {"happy"} == media.emotions().keys()


def test_command(angry, tmp_path):
    path, _ = angry
    out = tmp_path / "curves.json"
    done = run(path, "--fps", "30", "--smooth", "0.1", "--out", out)
    assert done.returncode == 0 and done.stdout == "" and "18 frames lost in 1 gaps" in done.stderr
    answer = json.loads(out.read_text())
    assert answer["fps"] == 30 and answer["source_fps"] == 60 and answer["emotions"].keys() == {"anger"}
    curve = answer["controls"]["AU45L"]
    assert len(curve["frame"]) == len(curve["value"]) == answer["frames"]
    for wrong, message in (
        (["--fps", "0.5"], "--fps: 0.5 is outside 1 to 240"),
        (["--smooth", "3"], "--smooth: 3 is outside 0 to 2"),
        (["--emotions", "angr"], "--emotions: angr: no such emotion, did you mean 'anger'?"),
        (["--fps", "x"], "'x' is not a number"),
    ):
        done = run(path, *wrong)
        assert done.returncode == 2 and done.stdout == "" and message in done.stderr and done.stderr.count("\n") == 1


def test_one_frame_is_a_pose(tmp_path):
    keys = {key: np.full(1, 0.5 if key == "jawOpen" else 0.0) for key in ARKIT.keys}
    performance = capture(write_live_link(tmp_path / "a.csv", np.arange(1), keys))
    assert performance.frames == 1 and performance.controls["AU26"][1] == pytest.approx([1.0], abs=0.01)


@pytest.mark.parametrize(
    ("end", "message"), [(1e4, "are more than 500000 frames"), (1e6, "spans 278 hours"), (1e300, "1e\\+300 is no time")]
)
def test_a_take_without_end_is_refused_before_it_costs_memory(tmp_path, end, message):
    keys = {key: np.zeros(2) for key in ARKIT.keys}
    path = write_mediapipe(tmp_path / "a.csv", np.array([0.0, end]), keys, "seconds")
    with pytest.raises(InputError, match=message):
        capture(path, 120.0)
