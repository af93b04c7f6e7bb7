"""Blood moves the way the evidence says, by amounts a body could make."""

import re
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sanguine.domain.blood import (
    ANATOMY,
    BLOOD,
    BLOOD_CONTROL_MAX,
    BLOOD_DRIVERS,
    MOOD_SUFFIX,
    ELSEWHERE,
    EVIDENCE,
    FEATURE,
    FEATURES,
    STATES,
    blood_change,
    read_anatomy,
    control_max,
    read_blood,
    settled,
)
from sanguine.domain.errors import InputError
from sanguine.domain.facs import EMOTION_CONTROLS
from sanguine.domain.head import load_regions
from sanguine.domain.resources import rigs_path

mixes = st.fixed_dictionaries({name: st.floats(0.0, control_max(name)) for name in BLOOD_DRIVERS})
CHANNELS = BLOOD.channels(BLOOD_DRIVERS)
LIGHT_SKIN_BLOOD = 0.014


@pytest.mark.parametrize(
    ("emotion", "regions", "sign"),
    [
        ("anger", ["cheeks", "forehead", "ears", "nose", "neck"], +1),
        ("happy", ["cheeks"], +1),
        ("happy", ["lips"], -1),
        ("fear", ["cheeks", "lips", "nose"], -1),
        ("sad", ["cheeks"], -1),
    ],
)
def test_blood_moves_in_the_direction_of_the_evidence(emotion, regions, sign):
    for region in regions:
        assert sign * blood_change({emotion: 1.0}, region)[0] > 0.0, region


def test_oxygen_reads_as_anger_and_its_lack_as_sadness():
    """Nakajima 2017, Alkawaz 2015, Wibawa 2016."""
    of = {emotion: blood_change({emotion: 1.0}, "cheeks")[1] for emotion in EMOTION_CONTROLS}
    assert of["anger"] > of["happy"] > 0.0 > of["fear"] > of["sad"]


def test_cheeks_change_enough_to_be_seen_on_light_skin():
    """Doubled blood is +2.9 a*, halved -2.8 a*: anger well above 2, fear well beyond -1."""
    at_rest = LIGHT_SKIN_BLOOD * ANATOMY["cheeks"].hemoglobin
    assert 1.8 < 1.0 + blood_change({"anger": 1.0}, "cheeks")[0] / at_rest < 2.5
    assert 0.5 < 1.0 + blood_change({"fear": 1.0}, "cheeks")[0] / at_rest < 0.65


@given(mixes, st.floats(0.0, BLOOD_CONTROL_MAX))
def test_any_mix_stays_within_what_skin_can_hold(emotions, amount):
    for region, rest in ANATOMY.items():
        hemoglobin, oxygenation = blood_change(emotions, region, amount)
        assert 0.001 - 1e-12 <= LIGHT_SKIN_BLOOD * rest.hemoglobin + hemoglobin <= 0.08
        # 0.02: a finger without flow still has 0.26 (Marcinkevics 2018), so only exaggeration comes near it.
        assert 0.02 - 1e-12 <= 0.72 + rest.oxygenation + oxygenation <= 0.98
        if amount <= 1.0:
            assert 0.33 <= 0.72 + rest.oxygenation + oxygenation


@given(mixes)
def test_a_mix_is_never_redder_or_paler_than_its_strongest_part(mix):
    for region in ANATOMY:
        alone = [blood_change({name: control_max(name)}, region)[0] for name in BLOOD_DRIVERS]
        assert min(0.0, *alone) - 1e-12 <= blood_change(mix, region)[0] <= max(0.0, *alone) + 1e-12


@given(mixes, st.floats(0.0, BLOOD_CONTROL_MAX))
def test_a_channel_reaches_as_far_as_any_mix(mix, amount):
    moved = settled(mix, amount)
    for key, channel in CHANNELS.items():
        low, high = channel.reach
        assert low - 1e-12 <= moved.get(key, 0.0) <= high + 1e-12


@given(st.dictionaries(st.sampled_from(BLOOD_DRIVERS), st.floats(0.0, 1.0), max_size=3), st.sets(st.sampled_from(BLOOD_DRIVERS)))
def test_what_else_is_on_the_rig_changes_nothing(mix, others):
    assert settled(mix) == settled({**dict.fromkeys(others - set(mix), 0.0), **mix})


def test_a_mood_is_the_blood_of_its_emotion_alone():
    assert settled({"anger" + MOOD_SUFFIX: 0.7}) == settled({"anger": 0.7})


def test_no_emotion_no_change_and_no_channel_without_a_change():
    assert settled({}) == {} and BLOOD.channels([]) == {}
    assert all(c.low < 0.0 or c.high > 0.0 for c in CHANNELS.values())
    assert ("eyelids", "oxygenation") not in BLOOD.channels(["anger"])


SYSTEMIC = ("pallor", "hypoxia", "exertion", "fever", "cold", "alcohol", "held_breath")


@pytest.mark.parametrize("state", SYSTEMIC)
def test_a_systemic_state_reaches_all_skin(state):
    moved = {region for region, _ in settled({state: 1.0})}
    assert moved == {*ANATOMY, ELSEWHERE}


def test_every_state_and_every_emotion_moves_blood():
    assert set(STATES) == {"blush", "rash", *SYSTEMIC}
    assert all(settled({name: 1.0}) for name in BLOOD_DRIVERS)


@pytest.mark.parametrize(
    ("state", "regions", "sign"),
    [
        ("blush", ["cheeks", "ears", "forehead", "neck"], +1),
        ("pallor", [*ANATOMY, ELSEWHERE], -1),
        ("exertion", [*ANATOMY, ELSEWHERE], +1),
        ("fever", [*ANATOMY, ELSEWHERE], +1),
        ("alcohol", [*ANATOMY, ELSEWHERE], +1),
        ("held_breath", [*ANATOMY, ELSEWHERE], +1),
        ("cold", ["nose", "lips"], -1),
        ("shame", ["cheeks", "ears", "forehead"], +1),
        ("pain", ["cheeks", "forehead", "eyelids", "lips"], +1),
        ("pain", ["nose"], -1),
        ("arousal", ["cheeks", "lips", "eyelids"], +1),
        ("disgust", ["nose", "cheeks", "forehead"], -1),
        ("surprise", ["cheeks", "forehead"], +1),
    ],
)
def test_states_and_other_emotions_move_blood_as_told(state, regions, sign):
    for region in regions:
        assert sign * blood_change({state: 1.0}, region)[0] > 0.0, region


def test_oxygen_goes_where_breath_fails_and_flow_fails_and_comes_with_flow():
    oxygen = {state: blood_change({state: 1.0}, "cheeks")[1] for state in STATES}
    assert oxygen["hypoxia"] < oxygen["held_breath"] < oxygen["pallor"] < 0.0 < oxygen["blush"]
    assert min(oxygen["exertion"], oxygen["fever"], oxygen["alcohol"]) > 0.0
    assert blood_change({"hypoxia": 1.0}, "lips")[1] < oxygen["hypoxia"]


TUNED_EARLIER = ("anger", "happy", "sad", "fear")  # by abstracts that tell of a colour in words
REGION_WORDS = {
    "cheeks": r"cheek", "forehead": r"forehead", "nose": r"nose", "ears": r"\bears?\b", "lips": r"\blips?\b|mouth",
    "chin": r"\bchin\b", "eyelids": r"eyelid|periorbital|\beyes?\b", "neck": r"\bneck\b", ELSEWHERE: r"(?!)",
}  # fmt: skip
WHOLE_FACE = re.compile(r"^face$|forehead/face|^all |all skin|face; neck", re.IGNORECASE)
BLOOD_WORDS = re.compile(r"flow|conductance|colo[u]?r|redness|erythema|pulse amplitude|temperature|venous return|velocimetry|blood conc")
OXYGEN_WORDS = re.compile(r"oxy|SO2|SpO2|SaO2", re.IGNORECASE)


def evidence_sign(source, quantity):
    """+1 or -1 where the evidence tells one direction of this quantity, else 0."""
    row = EVIDENCE[source]
    words = OXYGEN_WORDS if quantity == "oxygenation" else BLOOD_WORDS
    if not words.search(row.measure) or (quantity == "hemoglobin" and OXYGEN_WORDS.search(row.measure)):
        return 0
    told = row.direction.split(" against ")[0]
    up, down = re.search(r"increase|more oxygen", told), re.search(r"decrease|less oxygen", told)
    return 0 if bool(up) == bool(down) else 1 if up else -1


def evidence_is_of(source, region):
    """Whether it was seen at this region, or in the whole face."""
    where = EVIDENCE[source].region.lower()
    return bool(re.search(REGION_WORDS[region], where) or WHOLE_FACE.search(where))


def change_rows():
    table = tomllib.loads(rigs_path("blood.toml").read_text())
    return [(group["name"], row) for kind in ("emotion", "state") for group in table[kind] for row in group.get("change", ())]


def test_no_change_goes_against_its_own_sources():
    """What a row cites about its own region and quantity points the way the row goes."""
    checked = 0
    for name, row in change_rows():
        for source in row["source"]:
            sign = evidence_sign(source, row["quantity"]) if evidence_is_of(source, row["region"]) else 0
            if sign:
                checked += 1
                assert sign * row["value"] > 0.0, (name, row["region"], row["quantity"], source)
    assert checked > 80  # the table has some 220 rows: the words above still fit it


def test_what_no_source_tells_of_its_region_has_a_note():
    """Where no cited evidence tells the direction there, a note says why the row goes that way."""
    for name, row in change_rows():
        signs = [evidence_sign(s, row["quantity"]) for s in row["source"] if evidence_is_of(s, row["region"])]
        if name not in TUNED_EARLIER and not any(signs):
            assert row.get("note"), (name, row["region"], row["quantity"])


def test_a_size_without_a_source_is_called_a_guess():
    for name, row in change_rows():
        assert row["magnitude"] == "guess" or re.search(r"\d", " ".join(EVIDENCE[s].magnitude for s in row["source"])), (name, row)


def test_a_rash_is_the_strength_of_what_comes_out():
    assert settled({"rash": 0.5}) == {("rash", FEATURE): 0.5}
    (channel,) = BLOOD.channels(["rash"]).values()
    assert channel.property_name == "blood_feature_rash" and (channel.low, channel.high) == (0.0, 1.0)
    assert "tattoo" not in FEATURES  # ink does not come and go


@pytest.mark.parametrize(
    ("feature", "message"),
    [('"rsh"', "rash: feature: rsh: no such feature, did you mean 'rash'?"), ('""', "rash: change: it changes nothing")],
)
def test_a_state_without_anything_says_so(tmp_path, feature, message):
    broken = tmp_path / "blood.toml"
    broken.write_text(rigs_path("blood.toml").read_text().replace('feature = "rash"', f"feature = {feature}"))
    with pytest.raises(InputError, match=re.escape(message)):
        read_blood(broken, ANATOMY, EVIDENCE, STATES)


def test_what_is_systemic_reaches_the_skin_between_the_regions():
    assert settled({"hypoxia": 1.0})[ELSEWHERE, "oxygenation"] < -0.05


def test_every_region_of_the_head_has_its_anatomy():
    assert {region.id for region in load_regions(rigs_path("regions.toml"))} == set(ANATOMY)


def test_the_resting_face_follows_anatomy():
    assert ANATOMY["lips"].hemoglobin > 2.0 and ANATOMY["lips"].melanin < 1.0
    assert min(ANATOMY[r].hemoglobin for r in ("cheeks", "nose", "ears")) > 1.0 > ANATOMY["forehead"].hemoglobin
    assert ANATOMY["neck"].hemoglobin < ANATOMY["forehead"].hemoglobin
    assert ANATOMY["eyelids"].oxygenation < 0.0
    assert min(ANATOMY[r].oil for r in ("forehead", "nose", "chin")) > 1.0 > ANATOMY["cheeks"].oil


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("value = 0.020,", "value = 0.20,", "anger cheeks hemoglobin: 0.2 would take the reference skin beyond 0.001 to 0.08"),
        ('region = "cheeks"', 'region = "cheek"', "no such region, did you mean 'cheeks'?"),
        ('"drummond1999_anger"', '"drummond1999"', "no such row in evidence.csv, did you mean 'drummond1999_anger'?"),
        ('name = "anger"', 'name = "angry"', "emotion: angry: no such emotion, did you mean 'anger'?"),
        ('region = "forehead"', 'region = "cheeks"', "anger cheeks hemoglobin: given twice, remove one"),
        ('magnitude = "guess"', 'magnitude = "sure"', "emotion.0.change.0.magnitude: Input should be 'measured' or 'guess'"),
    ],
)  # fmt: skip
def test_a_broken_blood_table_says_what_to_mend(tmp_path, old, new, message):
    broken = tmp_path / "blood.toml"
    broken.write_text(rigs_path("blood.toml").read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        read_blood(broken, ANATOMY, EVIDENCE)
    assert str(caught.value).startswith(f"{broken}: ") and "\n" not in str(caught.value)


def test_a_broken_anatomy_table_says_what_to_mend(tmp_path):
    broken = tmp_path / "anatomy.toml"
    broken.write_text(rigs_path("anatomy.toml").read_text().replace('"hemoglobin"', '"haemoglobin"', 1))
    with pytest.raises(InputError, match="baseline.0.quantity: Input should be 'hemoglobin'"):
        read_anatomy(broken, EVIDENCE)
