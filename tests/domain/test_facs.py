"""The FACS tables are whole and symmetric, and no mix of controls overdrives a face."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sanguine.domain.errors import InputError
from sanguine.domain.facs import (
    ACTION_UNITS,
    ARKIT,
    EMOTION_CONTROLS,
    EMOTIONS,
    SHAPE_KEYS,
    read_action_units,
    read_emotions,
    shape_key_values,
)
from sanguine.domain.resources import rigs_path

CONTROLS = [*EMOTION_CONTROLS, *(unit.control for unit in ACTION_UNITS.values())]
mixes = st.dictionaries(st.sampled_from(CONTROLS), st.floats(0.0, 1.0))


def other_side(key: str) -> str:
    return re.sub("Left|Right", lambda side: "Right" if side[0] == "Left" else "Left", key)


def test_arkit_names_52_keys_once_and_in_pairs():
    assert len(ARKIT.keys) == len(set(ARKIT.keys)) == 52
    assert {other_side(key) for key in ARKIT.keys} == set(ARKIT.keys)


def test_every_arkit_key_is_driven_or_excused():
    assert set(SHAPE_KEYS) | set(ARKIT.unreached) == set(ARKIT.keys)
    assert not set(SHAPE_KEYS) & set(ARKIT.unreached)
    assert all(ARKIT.unreached.values())


def test_every_unit_has_its_mirror_image():
    """Each unit is its own mirror image, but for those with a side, which mirror each other."""
    sided = {"30L": "30R", "30R": "30L", "61": "62", "62": "61"}
    for unit in ACTION_UNITS.values():
        mirror = ACTION_UNITS[sided.get(unit.id, unit.id)]
        assert {other_side(key): weight for key, weight in unit.keys.items()} == mirror.keys, unit.id


@pytest.mark.parametrize(
    ("emotion", "prototype"),
    [("anger", {"4", "5", "7", "23"}), ("happy", {"6", "12"}), ("sad", {"1", "4", "15"}),
     ("fear", {"1", "2", "4", "5", "20", "25"}), ("neutral", set())],
)  # fmt: skip
def test_emotions_hold_their_facs_prototype(emotion, prototype):
    assert prototype <= set(EMOTIONS[emotion].units)


def test_every_emotion_alone_leaves_each_unit_within_its_intensity():
    for name in EMOTION_CONTROLS:
        values = shape_key_values({name: 1.0})
        by_units = shape_key_values({ACTION_UNITS[u].control: share for u, share in EMOTIONS[name].units.items()})
        assert values == pytest.approx(by_units)


@given(mixes)
def test_no_mix_overdrives_or_tilts_the_face(controls):
    values = shape_key_values(controls)
    assert all(0.0 <= value <= 1.0 for value in values.values())
    sideless = {name: v for name, v in controls.items() if name not in ("AU30L", "AU30R", "AU61", "AU62")}
    values = shape_key_values(sideless)
    assert all(values[key] == pytest.approx(values[other_side(key)]) for key in values)


def test_nothing_moves_at_rest():
    assert set(shape_key_values({}).values()) == {0.0}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("browInnerUp = 1.0", "browInerUp = 1.0", "unit 1: keys: browInerUp: no such shape key, did you mean 'browInnerUp'?"),
        ("browInnerUp = 1.0", "browInnerUp = 1.5", "unit.0.keys.browInnerUp: Input should be less than or equal to 1"),
        ('id = "2"', 'id = "1"', "unit 1: given twice, remove one"),
        ('fit = "same"', 'fitt = "same"', "unit.0.fit: missing"),
        ("keys = { browInnerUp", "keys = browInnerUp", "not valid TOML"),
    ],
)  # fmt: skip
def test_a_broken_unit_table_says_what_to_mend(tmp_path, old, new, message):
    broken = tmp_path / "action_units.toml"
    broken.write_text(rigs_path("action_units.toml").read_text().replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        read_action_units(broken, ARKIT.keys)
    assert str(caught.value).startswith(f"{broken}: ") and message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("{ 6 = 1.0", "{ 666 = 1.0", "emotion.happy.units: 666: no such action unit"),
        ('source = ["emfacs"]', 'source = ["emfac"]', "emotion.neutral.source: emfac: no such row of [sources], did you mean 'emfacs'?"),
    ],
)  # fmt: skip
def test_a_broken_emotion_table_says_what_to_mend(tmp_path, old, new, message):
    broken = tmp_path / "emotions.toml"
    broken.write_text(rigs_path("emotions.toml").read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=re.escape(message)):
        read_emotions(broken, ACTION_UNITS)
