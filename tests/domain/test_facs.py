"""The FACS tables are whole and symmetric, and no mix of controls overdrives a face."""

import importlib.util
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sanguine.domain.errors import InputError
from sanguine.domain.facs import (
    ACTION_UNITS,
    ARKIT,
    DEFAULT_EMOTIONS,
    EMOTION_CONTROLS,
    EMOTION_MAX,
    EMOTIONS,
    INTENSITIES,
    KNOWN_KEYS,
    SHAPE_KEYS,
    UNIT_CONTROLS,
    UNIT_TABLE,
    VARIANTS,
    emotion_units,
    formulas,
    head_values,
    read_action_units,
    read_emotions,
    shape_key_values,
    unit_values,
)
from sanguine.domain.own_keys import OWN_KEY_NAMES, read_own_keys
from sanguine.domain.resources import rigs_path
from sanguine.domain.response import MAX_EXPRESSION, driver_text

ROUNDING = 1e-5
"""Slopes of the emotions' curves are kept to a millionth; a unit adds up few of them."""

mixes = st.dictionaries(st.sampled_from(EMOTION_CONTROLS), st.floats(0.0, EMOTION_MAX)).flatmap(
    lambda emotions: st.dictionaries(st.sampled_from(list(UNIT_CONTROLS)), st.floats(0.0, 1.0)).map(
        lambda units: {**emotions, **units}
    )
)


def other_side(name: str) -> str:
    return re.sub("Left|Right", lambda side: "Right" if side[0] == "Left" else "Left", name)


OPPOSITE = {"51": "52", "52": "51", "55": "56", "56": "55", "61": "62", "62": "61"}
"""Units that turn to a side mirror each other; all others are their own mirror image."""


def mirrored(controls):
    """The same controls of the mirror image."""
    swapped = {}
    for name, value in controls.items():
        unit = name.removeprefix("AU").rstrip("LR")
        side = {"L": "R", "R": "L"}.get(name[-1], "") if name.startswith("AU") else ""
        swapped[f"AU{OPPOSITE.get(unit, unit)}{side}" if name.startswith("AU") else name] = value
    return swapped


def test_arkit_names_52_keys_once_and_in_pairs():
    assert len(ARKIT.keys) == len(set(ARKIT.keys)) == 52
    assert {other_side(key) for key in ARKIT.keys} == set(ARKIT.keys)


def test_every_arkit_key_is_driven_or_excused():
    assert (set(SHAPE_KEYS) | set(ARKIT.unreached)) >= set(ARKIT.keys)
    assert not set(SHAPE_KEYS) & set(ARKIT.unreached)
    assert all(ARKIT.unreached.values())


FACS_2002 = """1 2 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32 33 34 35 36 37 38 39 40 43
45 46 50 51 52 53 54 55 56 57 58 61 62 63 64 65 66 69 80 81 82 84 85 91 92 M55 M56 M57 M59 M60 M61 M62 M68 M69 M83"""
"""The codes of the manual of 2002 but for those of visibility (70-74)."""


def test_every_code_of_the_manual_is_a_unit_or_excused():
    inexpressible = {row.id for row in UNIT_TABLE.inexpressible}
    assert set(ACTION_UNITS) | inexpressible == set(FACS_2002.split())
    assert not set(ACTION_UNITS) & inexpressible
    assert all(len(row.reason) > 10 for row in UNIT_TABLE.inexpressible)


def test_every_own_key_is_driven_and_its_unit_says_so():
    assert set(OWN_KEY_NAMES) <= set(SHAPE_KEYS) and not set(OWN_KEY_NAMES) & set(ARKIT.keys)
    assert {other_side(key) for key in OWN_KEY_NAMES} == set(OWN_KEY_NAMES)


def test_the_head_turns_as_its_units_say():
    assert head_values({"AU51": 0.5, "AU54": 1.0})["turn_degrees"] == pytest.approx(20.0)
    assert head_values({"AU51": 0.5, "AU54": 1.0})["nod_degrees"] == pytest.approx(25.0)
    assert head_values({"AU57": 1.0, "AU58": 1.0})["forward_mm"] == 0.0
    assert set(head_values({"anger": 1.0}).values()) == {0.0}


def test_every_unit_has_its_mirror_image():
    for unit in ACTION_UNITS.values():
        mirror = ACTION_UNITS[OPPOSITE.get(unit.id, unit.id)]
        assert {other_side(key): weight for key, weight in unit.keys.items()} == mirror.keys, unit.id
        if unit.head:
            there, back = unit.head, mirror.head
            assert (there.turn_degrees, there.tilt_degrees) == (-back.turn_degrees, -back.tilt_degrees)
            assert (there.nod_degrees, there.forward_mm) == (back.nod_degrees, back.forward_mm)


def test_interferences_have_their_mirror_image():
    def rows(rename):
        return {
            (rename(unit), rename(other), share, row.keys)
            for row in UNIT_TABLE.interference
            for unit in row.units
            for other, share in row.by.items()
        }

    assert rows(str) == rows(lambda unit: OPPOSITE.get(unit, unit))


@pytest.mark.parametrize(
    ("emotion", "prototype"),
    [("anger", {"4", "5", "7", "23"}), ("happy", {"6", "12"}), ("sad", {"1", "4", "15"}),
     ("fear", {"1", "2", "4", "5", "20", "25"}), ("surprise", {"1", "2", "5", "26"}), ("disgust", {"9", "10", "17"}),
     ("contempt", {"14R"}), ("pain", {"4", "6", "9", "43"}), ("neutral", set())],
)  # fmt: skip
def test_emotions_hold_their_facs_prototype(emotion, prototype):
    assert prototype <= set(EMOTIONS[emotion].units)
    assert all(EMOTIONS[emotion].units[unit][1] > 0.0 for unit in prototype)


def test_each_variant_has_the_shares_of_its_column_and_lines_join_them():
    for name in EMOTION_CONTROLS:
        for column, at in enumerate(VARIANTS.values()):
            shares = {unit: row[column] for unit, row in EMOTIONS[name].units.items() if row[column]}
            sides = {s: v for unit, v in shares.items() for s in (ACTION_UNITS[unit].sides if unit in ACTION_UNITS else (unit,))}
            found = emotion_units(name, at)
            assert {s: v for s, v in found.items() if v > ROUNDING} == pytest.approx(sides, abs=ROUNDING)
        half, full = emotion_units(name, 0.625), emotion_units(name, 1.0)
        for side, value in half.items():
            subtle = emotion_units(name, 0.25).get(side, 0.0)
            assert value == pytest.approx((subtle + full.get(side, 0.0)) / 2, abs=ROUNDING)
        assert emotion_units(name, 0.0) == {}


def test_emotions_grow_with_their_slider():
    """The sum over the units, as single ones may give way to others."""
    for name in EMOTION_CONTROLS:
        sums = [sum(emotion_units(name, at).values()) for at in (0.0, *VARIANTS.values())]
        assert all(lower < higher for lower, higher in zip(sums, sums[1:], strict=False)), name


def test_an_emotion_is_the_sum_of_its_units():
    for name in EMOTION_CONTROLS:
        for level in VARIANTS.values():
            by_units = shape_key_values({f"AU{side}": share for side, share in emotion_units(name, level).items()})
            assert shape_key_values({name: level}) == pytest.approx(by_units, abs=ROUNDING)


def test_intensities_are_five_equal_steps():
    assert list(INTENSITIES) == list("ABCDE")
    assert list(INTENSITIES.values()) == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])


@given(mixes)
def test_no_mix_overdrives_the_face(controls):
    values = shape_key_values(controls)
    assert all(0.0 <= value <= 1.0 for value in values.values())
    assert all(0.0 <= value <= 1.0 for value in unit_values(controls).values())


@given(mixes)
def test_the_mirror_image_of_the_controls_is_that_of_the_face(controls):
    symmetric = {name: value for name, value in controls.items() if name != "contempt"}
    values, mirror = shape_key_values(symmetric), shape_key_values(mirrored(symmetric))
    assert all(values[key] == pytest.approx(mirror[other_side(key)]) for key in values)


def test_one_side_of_a_unit_moves_one_side_of_the_face():
    for unit in ACTION_UNITS.values():
        for side in unit.sides if unit.sided else ():
            keys = {key for key, value in shape_key_values({f"AU{side}": 1.0}).items() if value}
            wrong = "Right" if side[-1] == "L" else "Left"
            assert not any(wrong in key for key in keys), side
            assert unit_values({f"AU{side}": 1.0})[side] > 0.0


def test_both_sides_together_are_the_whole_unit_and_add_to_it():
    for unit in ACTION_UNITS.values():
        if unit.sided and not unit.one_sided:
            both = shape_key_values({f"AU{side}": 0.6 for side in unit.sides})
            assert both == pytest.approx(shape_key_values({f"AU{unit.id}": 0.6}))
            left = unit_values({f"AU{unit.id}": 0.3, f"AU{unit.id}L": 0.2})
            assert (left[f"{unit.id}L"], left[f"{unit.id}R"]) == pytest.approx((0.5, 0.3))
            assert unit_values({f"AU{unit.id}": 0.8, f"AU{unit.id}L": 0.8})[f"{unit.id}L"] == 1.0


def test_contempt_is_on_one_side():
    values = shape_key_values({"contempt": 1.0})
    assert values["mouthDimpleRight"] > 0.5 and values["mouthDimpleLeft"] == 0.0


@pytest.mark.parametrize(
    ("controls", "unit", "expected"),
    [
        ({"AU5": 1.0, "AU43": 1.0}, "5L", 0.0),
        ({"AU5": 1.0, "AU43": 0.5}, "5L", 0.5),
        ({"AU5": 1.0, "AU46L": 1.0}, "5L", 0.0),
        ({"AU5": 1.0, "AU46L": 1.0}, "5R", 1.0),
        ({"AU61": 1.0, "AU62": 1.0}, "61L", 0.0),
        ({"AU8": 1.0}, "8", 0.0),
        ({"AU8": 1.0, "AU27": 0.5}, "8", 0.5),
        ({"AU25": 1.0, "AU24": 1.0}, "25R", 0.0),
        ({"AU26": 1.0, "AU27": 1.0}, "26", 0.0),
        ({"AU25L": 1.0, "AU34": 1.0}, "34", 0.5),
    ],
)
def test_units_that_exclude_each_other_fade(controls, unit, expected):
    assert unit_values(controls)[unit] == pytest.approx(expected)


def test_an_interference_may_reach_only_some_keys():
    open_, shut = shape_key_values({"AU6": 1.0}), shape_key_values({"AU6": 1.0, "AU43": 1.0})
    assert shut["eyeSquintLeft"] < 0.5 * open_["eyeSquintLeft"]
    assert shut["cheekSquintLeft"] == open_["cheekSquintLeft"] > 0.0


def test_every_text_fits_a_driver():
    for emotions in (EMOTION_CONTROLS, DEFAULT_EMOTIONS, ()):
        rig = formulas(emotions)
        for name, formula in (rig.properties | rig.keys | rig.head).items():
            text, variables = driver_text(formula)
            assert len(text) < MAX_EXPRESSION, name
            assert set(variables.values()) <= {*rig.properties, *UNIT_CONTROLS, *emotions}


def test_an_emotion_that_is_not_on_the_rig_is_not_in_its_formulas():
    without, with_fear = formulas(()), formulas(("fear",))
    assert not any("fear" in formula.controls() for formula in without.properties.values())
    assert without.keys == with_fear.keys, "what drives the meshes does not depend on the emotions"
    assert set(with_fear.properties) - set(without.properties) == {f"sum_{u}" for u in EMOTIONS["fear"].units}


@given(mixes)
def test_a_rig_with_fewer_emotions_has_the_same_face_where_the_others_are_at_rest(controls):
    few = {name: v for name, v in controls.items() if name not in EMOTION_CONTROLS or name in DEFAULT_EMOTIONS}
    rig = formulas(DEFAULT_EMOTIONS)
    assert rig.values(rig.keys, few) == pytest.approx(shape_key_values(few))
    whole = {name: v for name, v in few.items() if name[-1] not in "LR" or ACTION_UNITS.get(name[2:-1], ACTION_UNITS["30"]).one_sided}
    rig = formulas(DEFAULT_EMOTIONS, sided=False)
    assert rig.values(rig.keys, whole) == pytest.approx(shape_key_values(whole))


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
        ("browOuterUpLeft = 1.0, ", "", "unit 2: keys: has those of one side only"),
        ('units = ["5"]', 'units = ["3"]', "interference of 3: 3: no such action unit"),
        ('keys = ["eyeSquint"]', 'keys = ["eyeWide"]', "eyeWide: no such key of these units"),
        ("of = { 26 = 0.4", "of = { 3 = 0.4", "need of 8: 3: no such action unit"),
    ],
)  # fmt: skip
def test_a_broken_unit_table_says_what_to_mend(tmp_path, old, new, message):
    broken = tmp_path / "action_units.toml"
    broken.write_text(rigs_path("action_units.toml").read_text().replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        read_action_units(broken, KNOWN_KEYS)
    assert str(caught.value).startswith(f"{broken}: ") and message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("6 = [0.35", "666 = [0.35", "emotion.happy.units: 666: no such action unit"),
        ("6 = [0.35", "6 = [1.35", "emotion.happy.units.6.0: Input should be less than or equal to 1"),
        ("14R = [0.5", "12 = [0.5", "emotion.contempt.units: 12R: 12 has it already, remove one"),
        ('source = ["emfacs"]', 'source = ["emfac"]', "emotion.neutral.source: emfac: no such row of [sources], did you mean 'emfacs'?"),
    ],
)  # fmt: skip
def test_a_broken_emotion_table_says_what_to_mend(tmp_path, old, new, message):
    broken = tmp_path / "emotions.toml"
    broken.write_text(rigs_path("emotions.toml").read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=re.escape(message)):
        read_emotions(broken, ACTION_UNITS)


def test_the_page_of_the_face_is_current():
    root = Path(__file__).resolve().parents[2]
    spec = importlib.util.spec_from_file_location("docs", root / "tools/write_facs_docs.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert (root / "docs/facs.md").read_text(encoding="utf-8") == module.page(), "run `make docs`"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"sanguine_nostrilDilate"', '"sanguine_nostrilCompress"', "sanguine_nostrilCompress: given twice, remove one"),
        ('"sanguine_nostrilDilate"', '"nostrilDilate"', "key.6.name"),
        ("bump = { center = [58, -95, 652], radius_mm = 15, move_mm = [3.0, -1.0, 0.0] }", "", "has neither targets nor a bump"),
    ],
)  # fmt: skip
def test_a_broken_table_of_own_keys_says_what_to_mend(tmp_path, old, new, message):
    broken = tmp_path / "own_keys.toml"
    text = rigs_path("own_keys.toml").read_text()
    assert old in text
    broken.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        read_own_keys(broken)
    assert str(caught.value).startswith(f"{broken}: ") and message in str(caught.value)
