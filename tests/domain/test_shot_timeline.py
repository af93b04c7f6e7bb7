"""A timeline: keyed feelings, and the blood that they bring in time, the same whichever frames are wanted."""

import numpy as np
import pytest

from sanguine.domain.errors import InputError
from sanguine.domain.shot import feelings_of, jobs, performance, pose_of, read_shot, scene_of
from sanguine.domain.vascular import Controls, blood_over_time

TIMELINE = """
rig = {{ head = "female" }}
{more}
[timeline]
fps = {fps}
first = {first}
last = 96
step = {step}
[[timeline.key]]
frame = 1
[[timeline.key]]
frame = 13
emotions = {{ anger = "extreme" }}
states = {{ exertion = 0.5 }}
[[timeline.key]]
frame = 48
blood = 1.5
pulse = 1.0
heart_rate = 120
[[timeline.key]]
frame = 60
"""
CHEEKS = ("cheeks", "hemoglobin")


def shot_of(tmp_path, fps=24, first=1, step=1, more=""):
    path = tmp_path / "shot.toml"
    path.write_text(TIMELINE.format(fps=fps, first=first, step=step, more=more).replace("exertion", "blush"))
    return read_shot(path)


def test_variants_are_levels_and_poses_between_are_mixtures(tmp_path):
    shot = shot_of(tmp_path)
    by_frame = {job.frame: pose_of(shot, job) for job in jobs(shot)}
    assert by_frame[13].emotions == {"anger": 1.5} and by_frame[7].emotions == {"anger": pytest.approx(0.75)}
    assert by_frame[7].states == {"blush": pytest.approx(0.25)}
    assert by_frame[54].heart_rate == pytest.approx(95.0) and by_frame[96].pulse == 0.0
    assert feelings_of(shot) == (("anger",), ("blush",))


def test_the_blood_is_that_of_the_model(tmp_path):
    shot = shot_of(tmp_path)
    played = performance(shot)
    assert played.frames[0] == 1 and played.frames[-1] == 96
    model = blood_over_time(Controls(played.frames / 24.0, played.controls))
    assert all((played.changes[key] == model[key]).all() for key in model)
    assert played.at(1) == {} and played.at(40)[CHEEKS][0] > 0.0
    assert "blood_change" not in played.controls and "anger" in played.controls


@pytest.mark.parametrize("given", [{"first": 50}, {"step": 7}, {"first": 30, "step": 10}])
def test_a_part_of_a_shot_has_the_blood_of_the_whole(tmp_path, given):
    """What was keyed before the first frame that is rendered has happened all the same."""
    whole = performance(shot_of(tmp_path))
    part = performance(shot_of(tmp_path, **given))
    for frame in range(given.get("first", 1), 97, given.get("step", 1)):
        assert part.at(frame) == whole.at(frame)


def test_half_the_frame_rate_is_twice_the_time(tmp_path):
    at_24, at_48 = performance(shot_of(tmp_path)), performance(shot_of(tmp_path, fps=48))
    assert at_24.at(40)[CHEEKS][0] > at_48.at(40)[CHEEKS][0] > 0.0


def test_the_plan_reaches_as_far_as_the_blood_does_and_no_further(tmp_path):
    shot = shot_of(tmp_path)
    scene = scene_of(shot, shot.subjects[0], ("cheeks", "lips"))
    reached = [frame.changes.get(CHEEKS, (0.0, 0.0)) for frame in scene.frames]
    played = performance(shot).changes[CHEEKS]
    assert max(high for _, high in reached) == played.max() and min(low for low, _ in reached) == played.min()
    assert np.ptp(played) > 0.0


def test_stills_are_settled(tmp_path):
    path = tmp_path / "stills.toml"
    path.write_text('rig = { head = "female" }\n[[expression]]\nid = "a"\nemotions = { anger = 1.0 }\n')
    shot = read_shot(path)
    assert performance(shot) is None
    assert scene_of(shot, shot.subjects[0], ("cheeks",)).frames[0].changes[CHEEKS][0] == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"extreme"', '"extrem"', "timeline.key.1.emotions.anger: no such variant 'extrem', did you mean 'extreme'?"),
        ('"extreme"', "1.2", "timeline.key.1.emotions.anger: 1.2 is outside 0 to 1; what is more than full is 'extreme'"),
        ("blush = 0.5", "blus = 0.5", "timeline.key.1.states: no such state of the body 'blus', did you mean 'blush'?"),
        ("heart_rate = 120", "heart_rate = 2", "timeline.key.2.heart_rate: Input should be greater than or equal to 20"),
        ("fps = 24", "fps = 0", "timeline.fps: Input should be greater than or equal to 1"),
        ("[timeline]", 'blood_profile = "none.toml"\n[timeline]', "none.toml"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path, old, new, words):
    path = tmp_path / "shot.toml"
    text = TIMELINE.format(fps=24, first=1, step=1, more="").replace("exertion", "blush")
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError) as caught:
        read_shot(path)
    assert words in str(caught.value) and "\n" not in str(caught.value)
