"""The emotion of a recorded face: right on faces made from the table, nothing where nothing is felt."""

import numpy as np
import pytest
from support.captures import OPENFACE_UNITS, add, blinking, noisy, rise_and_fall, showing, talking

from sanguine.domain.capture_emotion import UNREADABLE, infer_emotions
from sanguine.domain.capture_units import units_of_keys
from sanguine.domain.facs import DEFAULT_EMOTIONS, EMOTION_CONTROLS, emotion_units, shape_key_values

SECONDS = np.arange(12 * 25) / 25
HOLD = (SECONDS > 4) & (SECONDS < 8.5)
READABLE = tuple(name for name in EMOTION_CONTROLS if name not in UNREADABLE)


def inferred(keys, rng, emotions=DEFAULT_EMOTIONS):
    units = units_of_keys(noisy(keys, SECONDS, rng)).shown
    return infer_emotions(SECONDS, units, emotions)


def confusion(level, missing, people=5, emotions=DEFAULT_EMOTIONS):
    """(E, E + 1) counts, shown by inferred; the last column is 'none' (mean level below 0.1). And mean levels (E,)."""
    counts, levels = np.zeros((len(emotions), len(emotions) + 1), int), np.zeros(len(emotions))
    for row, name in enumerate(emotions):
        for person in range(people):
            rng = np.random.default_rng([row, person, missing])
            keys = add(
                showing(name, level, SECONDS, rng, missing=missing), talking(SECONDS, rng), blinking(SECONDS, rng)
            )
            found = [values[HOLD].mean() for values in inferred(keys, rng, emotions).values()]
            levels[row] += found[row] / people
            counts[row, int(np.argmax(found)) if max(found) >= 0.1 else -1] += 1
    return counts, levels


def test_the_right_emotion_is_found_in_a_face_that_talks_and_blinks():
    counts, levels = confusion(1.0, 0)
    assert np.all(np.diag(counts) == 5)
    assert np.all((levels > 0.7) & (levels < 1.1))  # individuals differ from the table by a quarter


def test_a_subtle_face_is_found_too():
    counts, levels = confusion(0.3, 0)
    assert np.trace(counts) >= 18 and np.all(counts.sum(axis=1) - np.diag(counts) - counts[:, -1] == 0)  # never another
    assert np.all((levels > 0.15) & (levels < 0.4))


def test_a_face_that_lacks_a_unit_is_found_weaker():
    counts, levels = confusion(1.0, 1)
    assert np.trace(counts) >= 18
    assert np.all((levels > 0.25) & (levels < 1.0))  # a smile that lacks 6 or 12 is half of one


def test_all_readable_emotions_at_once():
    counts, _ = confusion(1.0, 0, people=2, emotions=READABLE)
    assert np.all(np.diag(counts) == 2)


def test_talking_and_blinking_are_no_emotion():
    for person in range(6):
        rng = np.random.default_rng(100 + person)
        found = inferred(add(talking(SECONDS, rng), blinking(SECONDS, rng)), rng)
        assert max(values.max() for values in found.values()) < 0.05


@pytest.mark.parametrize(
    "units",
    [{"1": 1.0, "2": 1.0}, {"4": 1.0}, {"7": 1.0}, {"12": 1.0}, {"5": 1.0}, {"17": 1.0}, {"25": 1.0, "26": 1.0}],
)
def test_one_movement_alone_is_no_emotion(units):
    rng = np.random.default_rng(7)
    face = shape_key_values({f"AU{unit}": value for unit, value in units.items()})
    course = rise_and_fall(SECONDS, 3, 9)
    found = inferred({key: value * course for key, value in face.items()}, rng)
    assert max(values.max() for values in found.values()) < 0.2


def test_levels_rise_and_fall_once_with_the_face():
    """No flicker: from nothing to the level and back, on time within half a second."""
    rng = np.random.default_rng(8)
    keys = add(showing("anger", 1.0, SECONDS, rng), talking(SECONDS, rng), blinking(SECONDS, rng))
    anger = inferred(keys, rng)["anger"]
    half = anger > 0.5 * anger.max()
    assert np.sum(np.diff(half.astype(int)) != 0) == 2
    assert SECONDS[half][0] == pytest.approx(3.25, abs=0.5) and SECONDS[half][-1] == pytest.approx(8.6, abs=0.5)
    assert anger[SECONDS < 2].max() == 0 and anger[SECONDS > 10.5].max() < 0.05
    assert np.abs(np.diff(anger)).max() * 25 < 3.0  # nothing jumps: at most three sliders a second


@pytest.mark.parametrize("emotion", DEFAULT_EMOTIONS)
def test_levels_are_those_of_the_slider(emotion):
    rng = np.random.default_rng(9)
    for level in (0.5, 1.0):
        face = shape_key_values({emotion: level})
        course = rise_and_fall(SECONDS, 3, 9)
        still = {key: np.full(len(SECONDS), 0.0) + value * course for key, value in face.items()}
        assert inferred(still, rng)[emotion][HOLD].mean() == pytest.approx(level, abs=0.15)


@pytest.mark.parametrize("emotion", DEFAULT_EMOTIONS)
def test_openface_units_tell_it_as_well(emotion):
    """Its 17 units, both sides as one."""
    course = rise_and_fall(SECONDS, 3, 9)
    asked = emotion_units(emotion, 1.0)
    units = {
        f"AU{int(u)}": course * max(asked.get(str(int(u)), 0.0), asked.get(f"{int(u)}L", 0.0)) for u in OPENFACE_UNITS
    }
    found = infer_emotions(SECONDS, units)
    means = {name: values[HOLD].mean() for name, values in found.items()}
    assert max(means, key=means.get) == emotion and means[emotion] > 0.7


@pytest.mark.parametrize("units", [["AU45"], ["AU12"], ["AU45", "AU9", "AU61"]])
def test_recordings_of_a_few_units_invent_nothing(units):
    """A file with one unit: what cannot be seen is 0, never the most."""
    course = rise_and_fall(SECONDS, 3, 9)
    for level in (0.0, 0.05, 1.0):
        found = infer_emotions(SECONDS, {name: level * course for name in units}, READABLE)
        assert all(np.isfinite(values).all() for values in found.values())
        if level < 0.1 or units == ["AU45"]:
            assert max(values.max() for values in found.values()) == 0.0


def test_nothing_asked_is_nothing_done():
    assert infer_emotions(SECONDS, {"AU12L": np.zeros(len(SECONDS))}, ()) == {}
    assert infer_emotions(SECONDS, {"AU12L": np.zeros(len(SECONDS))}, ("arousal",)) == {}
    assert infer_emotions(np.zeros(1), {"AU12L": np.zeros(1)})["happy"] == pytest.approx([0.0])
