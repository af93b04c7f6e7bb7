"""A profile comes back as it was written, and one that no skin could follow is refused in one line."""

import re

import numpy as np
import pytest
import sanguine_core
from sanguine.domain.blood import ANATOMY, BLOOD, ELSEWHERE, settled
from sanguine.domain.errors import InputError
from sanguine.domain.parameters import default_skin, skin_rows
from sanguine.domain.profile import (
    Calibration,
    Measured,
    NamedRows,
    Profile,
    RecordingRow,
    blood_of_index,
    profile_rows,
    read_profile,
    with_profile,
    write_profile,
)

ANGER = Measured("anger", "hemoglobin_index", "cheeks", 12, 0.30, 0.20, 0.40)


def profile(rows, refused=(), file="a.csv"):
    return Profile(
        format=1, sanguine="0.1.0", sex="pooled", subjects=12, unsupported=tuple(refused),
        calibration=Calibration(index_region=("nose",)),
        recording=(RecordingRow(file=file, sha256="0" * 64, samples=9),),
        emotion=tuple(NamedRows(name=name, change=tuple(changes)) for name, changes in rows.items()),
    )  # fmt: skip


def test_a_profile_comes_back(tmp_path):
    file = 'odd "name" \\ é \x7f.csv'
    rows, refused = profile_rows([ANGER, Measured("sad", "spo2", "", 9, -0.01, -0.015, -0.005)], Calibration(), [file])
    written = profile(rows, refused, file)
    write_profile(tmp_path / "p.toml", written)
    assert read_profile(tmp_path / "p.toml") == written
    assert written.rows["anger", "cheeks", "hemoglobin"].value == pytest.approx(
        0.3 * 0.014 * ANATOMY["cheeks"].hemoglobin, rel=1e-3
    )
    assert {region for emotion, region, quantity in written.rows if emotion == "sad"} == {*ANATOMY, ELSEWHERE}
    assert written.rows["sad", "lips", "oxygenation"].low == -0.015


def test_states_have_rows_too(tmp_path, monkeypatch):
    monkeypatch.setattr("sanguine.domain.profile.STATES", {"exertion": "…"})
    rows, _ = profile_rows(
        [Measured("exertion", "hemoglobin_index", "nose", 9, 0.2, 0.1, 0.3)], Calibration(), ["a.csv"]
    )
    written = profile({}).model_copy(update={"state": (NamedRows(name="exertion", change=tuple(rows["exertion"])),)})
    write_profile(tmp_path / "p.toml", written)
    assert read_profile(tmp_path / "p.toml") == written and ("exertion", "nose", "hemoglobin") in written.rows
    monkeypatch.setattr("sanguine.domain.profile.STATES", {"exertions": "…"})
    with pytest.raises(InputError, match="state: exertion: no such state, did you mean 'exertions'"):
        read_profile(tmp_path / "p.toml")


def test_an_index_becomes_blood_by_its_gain_where_it_was_taken():
    nowhere = Measured("fear", "hemoglobin_index", "", 8, -0.1, -0.15, -0.05)
    rows, refused = profile_rows([nowhere], Calibration(index_gain=2.0, index_region=("cheeks", "lips")), ["a.csv"])
    assert not refused and [row.region for row in rows["fear"]] == ["cheeks", "lips"]
    for row in rows["fear"]:
        rest = BLOOD.at_rest(row.region, "hemoglobin")
        assert (row.value, row.low, row.high) == pytest.approx((-0.2 * rest, -0.3 * rest, -0.1 * rest), rel=1e-3)
    rows, refused = profile_rows([nowhere], Calibration(index_gain=2.0), ["a.csv"])
    assert not rows and "where" in refused[0].verdict


def test_a_finger_says_nothing_of_the_face():
    finger = Measured("anger", "perfusion", "", 12, -0.3, -0.4, -0.2)
    rows, refused = profile_rows([finger], Calibration(), ["a.csv"])
    assert not rows and "finger" in refused[0].verdict
    rows, refused = profile_rows([finger], Calibration(oximeter="forehead"), ["a.csv"])
    assert not refused and rows["anger"][0].region == "forehead" and rows["anger"][0].value < 0.0
    at_cheeks = [finger, ANGER]
    rows, refused = profile_rows(at_cheeks, Calibration(oximeter="cheeks"), ["a.csv"])
    assert [row.value > 0.0 for row in rows["anger"]] == [True] and "analyser" in refused[0].verdict


def test_an_erythema_index_is_turned_by_the_optics():
    """The index of the model's own skin gives back its blood; its relative change is a third of the blood's or less."""
    for melanin in (0.018, 0.1):
        calibration = Calibration(index="erythema", melanin=melanin)
        rest = BLOOD.at_rest("cheeks", "hemoglobin")
        skins = [
            default_skin()
            | {"melanin": melanin * ANATOMY["cheeks"].melanin, "hemoglobin": f, "oxygenation": 0.72, "oil": 0.0}
            for f in (rest, 1.5 * rest, 0.7 * rest)
        ]
        green, red = sanguine_core.reflectance(skin_rows(skins), np.array([568.0, 660.0])).T
        index = np.log10(red / green)
        for k, factor in ((1, 1.5), (2, 0.7)):
            relative = index[k] / index[0] - 1.0
            # Linear between 200 blood contents 4 % apart, of a curve that bends by less than that: a part in a thousand.
            assert blood_of_index(calibration, "hemoglobin_index", "cheeks", relative) == pytest.approx(
                (factor - 1.0) * rest, rel=5e-3
            )
            assert abs(relative) < abs(factor - 1.0) / 2.0
        assert blood_of_index(calibration, "perfusion", "cheeks", 0.1) == pytest.approx(0.1 * rest)
        assert blood_of_index(calibration, "hemoglobin_index", "cheeks", -0.99) == -np.inf


def test_more_than_skin_can_change_is_left_out():
    rows, refused = profile_rows(
        [Measured("anger", "hemoglobin_index", "cheeks", 9, 6.0, 5.0, 7.0)], Calibration(), ["a.csv"]
    )
    assert not rows and "more than skin can change" in refused[0].verdict
    for region in ANATOMY:
        for quantity in ("hemoglobin", "oxygenation"):
            low, high = BLOOD.room(region, quantity)
            assert low < 0.0 < high and BLOOD.at_rest(region, quantity) + low > 0.0


def test_blood_with_a_profile():
    """Hemoglobin is the measured one, oxygenation the table's and the arterial part, all else as it was."""
    sad = Measured("sad", "spo2", "", 9, -0.01, -0.015, -0.005)
    pale = Measured("happy", "hemoglobin_index", "cheeks", 9, -0.2, -0.3, -0.1)
    measured = with_profile(BLOOD, profile(profile_rows([ANGER, sad, pale], Calibration(), ["a.csv"])[0]))
    for controls in ({"anger": 1.0}, {"sad": 1.0}, {"happy": 0.5}, {"fear": 1.0}):
        before, after = settled(controls), settled(controls, blood=measured)
        for key in before.keys() | after.keys():
            expected = before.get(key, 0.0)
            if controls == {"anger": 1.0} and key == ("cheeks", "hemoglobin"):
                expected = 0.3 * BLOOD.at_rest(*key)
            elif controls == {"happy": 0.5} and key == ("cheeks", "hemoglobin"):
                expected = -0.1 * BLOOD.at_rest(*key)
            elif controls == {"sad": 1.0} and key[1] == "oxygenation":
                expected -= 0.01
            assert after.get(key, 0.0) == pytest.approx(expected, rel=1e-3), (controls, key)
    table, drives = ({d.control: d for d in blood.drives["cheeks", "hemoglobin"]} for blood in (BLOOD, measured))
    assert drives["anger"].kinetics == table["anger"].kinetics  # still a flush
    assert table["happy"].kinetics != drives["happy"].kinetics == "constriction"
    assert with_profile(BLOOD, profile({})) == BLOOD


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "anger"', 'name = "angry"', "emotion: angry: no such emotion, did you mean 'anger'?"),
        ('region = "cheeks"', 'region = "cheek"', "anger cheek hemoglobin: no such region, did you mean 'cheeks'?"),
        ("value = 0.00546", "value = 0.5", "anger cheeks hemoglobin: value 0.5 is not between low 0.00364 and high 0.00728"),
        ("value = 0.00546, low = 0.00364, high = 0.00728", "value = 0.5, low = 0.4, high = 0.6", "0.5 is more than skin can change"),
        ("value = 0.00546", "value = nan", "emotion.0.change.0.value: Input should be a finite number"),
        ('source = ["a.csv"]', 'source = ["b.csv"]', "source: b.csv: not among the recordings, did you mean 'a.csv'?"),
        ('magnitude = "measured"', 'magnitude = "guess"', "emotion.0.change.0.magnitude: Input should be 'measured'"),
        ("format = 1", "format = 2", "format: Input should be 1"),
        ("format = 1", "formt = 1", "format: missing"),
        ("subjects = 12", "subjects = 12\nsubject = 1", "subject: unknown key, did you mean 'subjects'?"),
        ("0" * 64, "0" * 63, "recording.0.sha256"),
    ],
)  # fmt: skip
def test_a_broken_profile_says_what_to_mend(tmp_path, old, new, message):
    path = tmp_path / "p.toml"
    write_profile(path, profile(profile_rows([ANGER], Calibration(), ["a.csv"])[0]))
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        read_profile(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


def test_a_row_given_twice(tmp_path):
    rows, _ = profile_rows([ANGER], Calibration(), ["a.csv"])
    write_profile(tmp_path / "p.toml", profile({"anger": rows["anger"] * 2}))
    with pytest.raises(InputError, match="anger cheeks hemoglobin: given twice, remove one"):
        read_profile(tmp_path / "p.toml")
