"""Blood follows by its own time, exactly: at any frame rate, in any step, at any length."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sanguine.domain.blood import (
    ANATOMY,
    BLOOD,
    BLOOD_DRIVERS,
    ELSEWHERE,
    EVIDENCE,
    MOOD_SUFFIX,
    PULSE_CONTROL,
    control_max,
    settled,
)
from sanguine.domain.errors import InputError
from sanguine.domain.resources import rigs_path
from sanguine.domain.vascular import VASCULAR, Controls, blood_over_time, follow, pressure_over_time, read_vascular

seconds = st.floats(0.0, 100.0)
targets = hnp.arrays(float, st.integers(2, 30), elements=st.floats(0.0, 2.0))
CHEEKS = ("cheeks", "hemoglobin")


def by_small_steps(target, time_s, delay_s, attack_s, decay_s, steps=4000):
    """The same equation by the classical Runge-Kutta method, which knows no closed form."""

    def rate(t, y):
        u = np.interp(t - delay_s, time_s, target)
        return (u - y) / (attack_s if u > y else decay_s)

    y, found = float(target[0]), [float(target[0])]
    for a, b in zip(time_s[:-1], time_s[1:], strict=True):
        h = (b - a) / steps
        for i in range(steps):
            t = a + i * h
            k1 = rate(t, y)
            k2 = rate(t + h / 2, y + h / 2 * k1)
            k3 = rate(t + h / 2, y + h / 2 * k2)
            k4 = rate(t + h, y + h * k3)
            y += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        found.append(y)
    return np.array(found)


def test_it_is_the_solution_of_its_equation():
    time_s = np.array([0.0, 1.0, 2.5, 3.0, 7.0, 7.5, 12.0])
    target = np.array([0.2, 1.0, 1.0, 0.1, 0.9, 0.0, 0.3])
    reference = by_small_steps(target, time_s, 0.7, 2.0, 9.0)
    # Runge-Kutta loses its order where attack turns into decay: one step of 1e-3 s there leaves about 1e-7.
    assert follow(target, time_s, 0.7, 2.0, 9.0) == pytest.approx(reference, abs=1e-6)


def test_one_time_constant_is_63_percent():
    time_s = np.array([0.0, 1e-9, 5.0, 5.0 + 1e-9, 45.0])
    answer = follow(np.array([0.0, 1.0, 1.0, 0.0, 0.0]), time_s, 0.0, 5.0, 40.0)
    assert answer[2] == pytest.approx(1.0 - math.exp(-1.0), abs=1e-6)
    assert answer[4] == pytest.approx(answer[2] * math.exp(-1.0), abs=1e-6)


@given(targets, seconds, seconds, seconds, st.integers(2, 9))
def test_any_substep_gives_the_same_blood(target, delay_s, attack_s, decay_s, parts):
    """24, 48 or 30 frames a second, subframes: as long as the animation is the same, so is the blood."""
    time_s = np.arange(len(target)) / 24.0
    fine = np.linspace(0.0, time_s[-1], parts * (len(target) - 1) + 1)
    coarse = follow(target, time_s, delay_s, attack_s, decay_s)
    finer = follow(np.interp(fine, time_s, target), fine, delay_s, attack_s, decay_s)[::parts]
    # Rounding alone; a time constant near 0 divides slopes' rounding by it.
    assert finer == pytest.approx(coarse, abs=1e-7)


@given(targets, seconds, seconds, seconds)
def test_blood_is_never_outside_of_what_was_asked_for(target, delay_s, attack_s, decay_s):
    answer = follow(target, np.arange(len(target)) / 24.0, delay_s, attack_s, decay_s)
    assert np.isfinite(answer).all()
    assert answer.min() >= target.min() - 1e-9 and answer.max() <= target.max() + 1e-9


@given(targets, seconds, seconds, seconds)
def test_the_past_does_not_know_the_future(target, delay_s, attack_s, decay_s):
    """A frame alone equals the frame in sequence: what comes later changes nothing."""
    time_s = np.arange(len(target)) / 24.0
    whole = follow(target, time_s, delay_s, attack_s, decay_s)
    half = len(target) // 2 + 1
    assert follow(target[:half], time_s[:half], delay_s, attack_s, decay_s) == pytest.approx(whole[:half], abs=1e-14)


def test_frame_100000_is_as_stable_as_frame_1():
    """A period repeated for more than an hour: its last answer is that of the period it has settled into."""
    frames = np.arange(100_000)
    wave = (frames % 240 < 60).astype(float)
    answer = follow(wave, frames / 24.0, 0.8, 5.0, 40.0)
    assert answer[-240:] == pytest.approx(answer[48_000 - 240 + (100_000 - 48_000) % 240 :][:240], abs=1e-12)


def test_many_targets_at_once_are_each_alone():
    time_s = np.arange(50) / 24.0
    target = np.abs(np.random.default_rng(1).normal(size=(50, 3)))
    times = np.array([[0.1, 2.0, 0.0], [1.0, 0.0, 5.0], [3.0, 9.0, 0.5]])
    together = follow(target, time_s, *times)
    for i in range(3):
        # The last bit of exp differs with the length of the array that it is taken of.
        assert together[:, i] == pytest.approx(follow(target[:, i], time_s, *times[:, i]), abs=1e-14)


def held(seconds, **sliders):
    time_s = np.arange(0.0, seconds, 0.25)
    return Controls(time_s, {name: np.where(time_s > 0.0, value, 0.0) for name, value in sliders.items()})


@pytest.mark.parametrize("name", BLOOD_DRIVERS)
def test_what_is_held_settles_where_the_drivers_say(name):
    level = control_max(name)
    answer = blood_over_time(held(7200.0, **{name: level}))
    expected = settled({name: level})
    assert set(answer) >= set(expected)
    for key, value in expected.items():
        slowest = max(VASCULAR.times(d.kinetics, key[0])[1] for d in BLOOD.drives[key])
        if slowest < 600.0:
            assert answer[key][-1] == pytest.approx(value, rel=1e-4), key


@given(st.dictionaries(st.sampled_from(BLOOD_DRIVERS), st.floats(0.0, 1.0), min_size=1, max_size=4))
def test_what_has_always_been_is_settled_at_the_first_frame(mix):
    answer = blood_over_time(Controls(np.arange(3.0), {name: np.full(3, value) for name, value in mix.items()}))
    expected = settled(mix)
    for key, series in answer.items():
        assert series == pytest.approx(np.full(3, expected.get(key, 0.0)), abs=1e-12), key


def test_blood_lags_the_muscle_and_leaves_late():
    """The shape of an outburst: brows are down at once, the cheeks redden over seconds and pale over a minute."""
    time_s = np.arange(0.0, 120.0, 1 / 24)
    anger = np.interp(time_s, [1.0, 1.3, 6.0, 6.5], [0.0, 1.0, 1.0, 0.0])
    cheeks = blood_over_time(Controls(time_s, {"anger": anger}))[CHEEKS]
    peak = time_s[cheeks.argmax()]
    assert 6.0 < peak < 9.0
    assert cheeks[time_s.searchsorted(1.5)] < 0.05 * cheeks.max()
    gone = time_s[np.nonzero(cheeks > 0.1 * cheeks.max())[0].max()]
    assert gone > peak + 20.0


def test_regions_differ():
    """The forehead fills at the onset, the cheeks late; the nose closes early and stays so."""
    fill = blood_over_time(held(60.0, anger=1.0))
    half = {r: np.argmax(fill[r, "hemoglobin"] > 0.5 * fill[r, "hemoglobin"][-1]) for r in ("cheeks", "forehead")}
    assert half["forehead"] < half["cheeks"]
    time_s = np.arange(0.0, 60.0, 0.25)
    close = blood_over_time(Controls(time_s, {"fear": ((time_s > 0) & (time_s < 10)).astype(float)}))
    left = {r: close[r, "hemoglobin"][-1] / close[r, "hemoglobin"].min() for r in ("cheeks", "nose")}
    assert left["nose"] > left["cheeks"] + 0.1


def test_a_mood_moves_the_blood_of_its_emotion():
    time_s = np.arange(0.0, 20.0, 0.25)
    level = np.clip(time_s / 5.0, 0.0, 1.0)
    emotion = blood_over_time(Controls(time_s, {"anger": level}))
    mood = blood_over_time(Controls(time_s, {"anger" + MOOD_SUFFIX: level}))
    assert set(emotion) == set(mood)
    assert all((emotion[key] == mood[key]).all() for key in emotion)


def test_exaggeration_is_a_factor_at_once():
    plain, twice = (blood_over_time(held(20.0, anger=1.0, blood=b))[CHEEKS] for b in (1.0, 2.0))
    assert twice[1:] == pytest.approx(2.0 * plain[1:])


def test_a_pace_is_a_clock_of_the_bloods_own():
    """Twice the pace is the answer of twice the time; a pace that changes leaves the past as it was."""
    time_s = np.arange(0.0, 40.0, 1 / 24)
    anger = np.interp(time_s, [1.0, 2.0, 9.0, 10.0], [0.0, 1.0, 1.0, 0.0])
    hurried = blood_over_time(Controls(time_s, {"anger": anger, "blood_pace": np.full_like(time_s, 2.0)}))[CHEEKS]
    slow_motion = blood_over_time(Controls(2.0 * time_s, {"anger": anger}))[CHEEKS]
    assert hurried == pytest.approx(slow_motion, abs=1e-12)
    plain = blood_over_time(Controls(time_s, {"anger": anger}))[CHEEKS]
    late = blood_over_time(Controls(time_s, {"anger": anger, "blood_pace": np.where(time_s < 20.0, 1.0, 4.0)}))[CHEEKS]
    half = time_s.searchsorted(19.9)
    assert late[:half] == pytest.approx(plain[:half], abs=1e-12) and late[-1] < 0.5 * plain[-1]


def test_the_heart_beats_at_its_rate_and_late_where_it_is_far():
    time_s = np.arange(0.0, 60.0, 1 / 48)
    rate = np.full_like(time_s, 90.0)
    beat = blood_over_time(Controls(time_s, {PULSE_CONTROL: np.ones_like(time_s), "heart_rate": rate}))
    series = beat["forehead", "hemoglobin"]
    rises = np.count_nonzero((series[:-1] < 0.0) & (series[1:] >= 0.0))
    assert rises == pytest.approx(90, abs=1)
    depth = VASCULAR.pulse.depth * BLOOD.at_rest("forehead", "hemoglobin")
    assert np.ptp(series) == pytest.approx(depth, rel=0.02)
    assert series.mean() == pytest.approx(0.0, abs=0.01 * depth)
    delay = VASCULAR.pulse.delay_s
    lag = delay["cheeks"] - delay["forehead"]
    other = beat[CHEEKS] / BLOOD.at_rest("cheeks", "hemoglobin") * BLOOD.at_rest("forehead", "hemoglobin")
    assert other[48:] == pytest.approx(np.interp(time_s[48:] - lag, time_s, series), abs=0.02 * depth)


def test_a_changing_heart_rate_has_no_jumps():
    time_s = np.arange(0.0, 30.0, 1 / 24)
    rate = np.interp(time_s, [0, 30], [60.0, 180.0])
    series = blood_over_time(Controls(time_s, {PULSE_CONTROL: np.ones_like(time_s), "heart_rate": rate}))[CHEEKS]
    rises = np.count_nonzero((series[:-1] < 0.0) & (series[1:] >= 0.0))
    assert rises == pytest.approx(60, abs=1)  # 30 s at 120 per minute in the mean


def test_no_slider_no_blood():
    assert blood_over_time(Controls(np.arange(10.0), {"anger": np.zeros(10), "blood": np.ones(10)})) == {}


def test_pressed_skin_is_white_at_once_and_fills_like_a_capillary():
    time_s = np.arange(0.0, 5.0, 0.05)
    pressed = ((time_s >= 1.0) & (time_s < 2.0)).astype(float)
    away = pressure_over_time(Controls(time_s, {}), pressed)
    assert away[time_s.searchsorted(1.0)] == pytest.approx(1.0, abs=1e-6)
    refilled = time_s[np.nonzero(away > 0.1)[0].max()] - 2.0
    assert 0.7 < refilled < 1.5  # Schriger & Baraff 1988, medians of the young and the adult


@given(st.sampled_from([*ANATOMY, ELSEWHERE]), st.sampled_from([row.id for row in VASCULAR.kinetics]))
def test_every_region_has_every_time_course(region, kinetics):
    delay_s, attack_s, decay_s = VASCULAR.times(kinetics, region)
    assert 0.0 <= delay_s < 3600.0 and 0.0 <= attack_s and 0.0 < decay_s


def test_every_constant_says_where_it_comes_from():
    for row in (*VASCULAR.kinetics, *VASCULAR.region, VASCULAR.pulse):
        assert row.basis == "default" or row.source
        assert "default" in row.told_by or row.source[0] in row.told_by


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("attack_s = 5.0", "attack_s = -5.0", "kinetics.0.attack_s: Input should be greater than or equal to 0"),
        ('id = "constriction"', 'id = "dilation"', "kinetics dilation: given twice, remove one"),
        ('id = "oxygenation"', 'id = "oxigenation"', "blood.toml names it and it is not here, did you mean 'oxigenation'?"),
        ('"schriger1988_refill"', '"schriger"', "no such row in evidence.csv, did you mean 'schriger1988_refill'?"),
        ('region = "cheeks"', 'region = "cheek"', "no such region, did you mean 'cheeks'?"),
        ('basis = "derived"\nsource = ["schriger1988_refill"]', 'basis = "derived"\nsource = []', "name its source, or make it 'default'"),
    ],
)  # fmt: skip
def test_a_broken_table_says_what_to_mend(tmp_path, old, new, message):
    text = rigs_path("vascular.toml").read_text()
    assert old in text
    broken = tmp_path / "vascular.toml"
    broken.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=re.escape(message)):
        read_vascular(broken, BLOOD, EVIDENCE)
