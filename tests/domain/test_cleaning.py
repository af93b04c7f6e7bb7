"""Each fault of a sensor is found where it is, by its name, and what is sound stays."""

import dataclasses

import numpy as np
import pytest
from sanguine.domain.physiology.cleaning import REASONS, Block, Settling, blocks, clean, levels
from sanguine.domain.physiology.measures import MEASURES
from sanguine.domain.physiology.recording import Track


def track(measure, value, step_s=1.0, emotion=None):
    time = np.arange(len(value)) * step_s
    label = np.array(["neutral"] * len(value) if emotion is None else emotion, dtype=object)
    return Track(
        "a.csv", "s1", "female", MEASURES[measure], "", time, label, np.array(value, float), np.arange(len(value)) + 2
    )


def noisy(measure, n=300, seed=0):
    """Sound samples of a resting subject."""
    random = np.random.default_rng(seed)
    rest, sd = {
        "spo2": (0.975, 0.004),
        "pulse": (70.0, 1.5),
        "perfusion": (0.03, 0.002),
        "hemoglobin_index": (1.2, 0.02),
    }[measure]
    return rest + sd * random.standard_normal(n)


def counts(cleaned):
    return {reason: cleaned.counts[reason] for reason in REASONS if cleaned.counts[reason]}


@pytest.mark.parametrize("measure", ["spo2", "pulse", "perfusion", "hemoglobin_index"])
def test_sound_samples_stay(measure):
    cleaned = clean(track(measure, noisy(measure)))
    assert set(counts(cleaned)) <= {"outlier"}
    # Pearson's 3 sigma of normal noise is 0.3 %; a median of 15 samples knows its spread to some 25 %, which makes it 2 %.
    assert cleaned.counts["outlier"] <= 0.04 * 300
    expected = np.log(noisy(measure)) if MEASURES[measure].relative else noisy(measure)
    assert np.isin(cleaned.value, expected).all()


def test_a_drop_out_takes_its_edges_along():
    value = noisy("spo2")
    value[100:110] = 0.0
    value[5] = np.nan
    cleaned = clean(track("spo2", value))
    assert cleaned.counts["dropped_out"] == 14 and cleaned.counts["missing"] == 1  # two seconds on each side
    assert cleaned.first["dropped_out"] == 100 and cleaned.first["missing"] == 7  # lines: sample + 2, less the guard
    assert not ((cleaned.time_s >= 98) & (cleaned.time_s <= 111)).any()


def test_what_no_body_has_and_what_no_body_does():
    value = noisy("pulse")
    value[50] = 320.0
    value[200:212] = 110.0  # for 12 s, from one sample to the next and back: a 40/min jump in a second
    cleaned = clean(track("pulse", value))
    assert cleaned.counts["implausible"] == 1
    assert cleaned.counts["too_fast"] >= 2
    assert np.abs(cleaned.value - 70.0)[(cleaned.time_s < 200) | (cleaned.time_s > 215)].max() < 8.0


def test_an_answer_of_a_body_is_no_fault():
    """A pulse that rises by 25/min within ten seconds, SpO2 that falls by 10 % within 20."""
    for measure, top, seconds in (("pulse", 25.0, 10), ("spo2", -0.1, 20)):
        value = noisy(measure) + top * np.clip((np.arange(300) - 150) / seconds, 0.0, 1.0)
        cleaned = clean(track(measure, value))
        assert cleaned.counts["too_fast"] == 0 and cleaned.counts["outlier"] <= 12


def test_a_hanging_sensor_but_not_a_steady_one():
    value = noisy("pulse")
    value[100:160] = 71.3
    assert counts(clean(track("pulse", value)))["frozen"] == 60
    steady = np.full(200, 0.98)  # whole percents: a healthy reading does not move
    assert counts(clean(track("spo2", steady))) == {}
    assert counts(clean(track("spo2", np.full(400, 0.98))))["frozen"] == 400
    seldom = [1.2, 1.2, 1.3, 1.3]  # a probe put on by hand reads once a minute
    assert counts(clean(track("hemoglobin_index", seldom, step_s=60.0))) == {}


@pytest.mark.parametrize("step_s", [0.25, 1.0, 5.0, 10.0])
def test_hampel_finds_spikes(step_s):
    value = noisy("hemoglobin_index")
    value[[40, 90, 91, 200]] *= 1.25
    cleaned = clean(track("hemoglobin_index", value, step_s))
    assert not np.isin(np.array([40, 90, 91, 200]) * step_s, cleaned.time_s).any()


def test_nothing_left_is_nothing():
    cleaned = clean(track("spo2", [0.0] * 20))
    assert cleaned.time_s.size == 0 and levels(cleaned, 0.0, Settling()) == []
    assert counts(clean(track("perfusion", [np.nan] * 5))) == {"missing": 5}


def test_blocks_last_until_the_next_label():
    t = track("pulse", [70.0] * 6, 10.0, ["neutral", "neutral", "anger", "", "anger", "anger"])
    assert blocks(t) == [
        Block("neutral", 0.0, 20.0, -np.inf), Block("anger", 20.0, 30.0, -np.inf), Block("anger", 40.0, 60.0, 30.0),
    ]  # fmt: skip


def test_rest_counts_once_the_last_emotion_is_over_whatever_lies_between():
    settling = Settling(settle_s=15.0, recover_s=60.0)
    assert settling.begin_s(Block("neutral", 100.0, 200.0, -np.inf)) == 115.0
    assert settling.begin_s(Block("neutral", 100.0, 200.0, 100.0)) == 160.0
    assert settling.begin_s(Block("neutral", 100.0, 200.0, 80.0)) == 140.0  # 20 s without a label before
    assert settling.begin_s(Block("neutral", 100.0, 200.0, 10.0)) == 115.0
    assert settling.begin_s(Block("anger", 100.0, 200.0, 80.0)) == 115.0


def test_levels_leave_out_what_settles_and_follow_the_lag():
    label = ["neutral"] * 60 + ["anger"] * 60 + ["neutral"] * 120
    value = np.concatenate([np.full(75, 70.0), np.full(60, 80.0), np.full(105, 70.0)])  # the sensor is 15 s late
    value += 0.01 * (np.arange(240) % 2)  # or it would hang
    t = track("pulse", value, 1.0, label)
    exact = levels(clean(t), 15.0, Settling(settle_s=0.0, recover_s=0.0, window_s=5.0))
    assert [level.emotion for level in exact] == ["neutral", "anger", "neutral"]
    np.testing.assert_allclose([level.value for level in exact], [70.0, 80.0, 70.0], atol=0.2)
    rough = levels(clean(t), 0.0, Settling(settle_s=0.0, recover_s=0.0, window_s=5.0))
    assert rough[1].value == pytest.approx(77.5, abs=0.3)  # three quarters of the label are right
    settled = levels(clean(t), 0.0, Settling(settle_s=15.0, recover_s=60.0, window_s=5.0))
    np.testing.assert_allclose([level.value for level in settled], [70.0, 80.0, 70.0], atol=0.2)
    assert [level.samples for level in settled] == [45, 45, 60]


def test_windows_count_alike_however_many_samples_they_have():
    """Ten samples in the first window, two in the second: the level is the mean of the windows."""
    time = np.concatenate([np.arange(10) * 0.5, [5.0, 7.5]])
    value = np.concatenate([np.full(10, 70.0), [76.0, 76.0]])
    t = dataclasses.replace(track("pulse", value), time_s=time, emotion=np.array(["anger"] * 12, dtype=object))
    (level,) = levels(clean(t), 0.0, Settling(0.0, 0.0, 5.0))
    assert level.value == pytest.approx(73.0)


def test_a_window_with_less_than_half_of_its_samples_is_none():
    value = noisy("pulse", 20)
    value[0:3] = np.nan
    cleaned = clean(track("pulse", value))
    (level,) = levels(cleaned, 0.0, Settling(0.0, 0.0, 5.0))
    assert level.samples == 15
