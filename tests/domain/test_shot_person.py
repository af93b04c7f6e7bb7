"""[person] in a SHOT.toml: who is seen gives skin and features, and what the file names itself stands."""

import pytest

from sanguine.domain.errors import InputError
from sanguine.domain.people import person
from sanguine.domain.plan import default_strengths
from sanguine.domain.shot import read_shot, scene_of

ONE = """
[rig]
head = "female"
{person}
[skin]
{skin}
[effects]
mottle = 0.25
[[expression]]
id = "neutral"
"""
PERSON = '[person]\ntone = "monk-5"\nsex = "female"\nage = 34\nseed = 7\n'


def read(tmp_path, text):
    path = tmp_path / "shot.toml"
    path.write_text(text)
    return read_shot(path)


def test_a_person_gives_the_skin_and_the_file_overrides(tmp_path):
    shot = read(tmp_path, ONE.format(person=PERSON, skin="oil = 0.1"))
    scene = scene_of(shot, shot.subjects[0], ())
    one = person("monk-5", "female", 34, 7)
    assert scene.skin == {**one.skin, "oil": 0.1}
    assert scene.growth == one.growth and scene.growth.age_years == 34
    assert scene.strengths == {**default_strengths(), **one.strengths, "mottle": 0.25}


def test_blood_as_a_pair_overrides_too(tmp_path):
    shot = read(tmp_path, ONE.format(person=PERSON, skin="oxyhemoglobin = 0.015\ndeoxyhemoglobin = 0.005"))
    skin = shot.subjects[0].whole_skin()
    assert skin["hemoglobin"] == pytest.approx(0.02) and skin["oxygenation"] == pytest.approx(0.75)
    assert skin["melanin"] == person("monk-5", "female", 34, 7).skin["melanin"]


def test_without_a_person_all_is_as_before(tmp_path):
    shot = read(tmp_path, ONE.format(person="", skin="melanin = 0.05"))
    scene = scene_of(shot, shot.subjects[0], ())
    assert scene.skin["melanin"] == 0.05 and scene.strengths == {**default_strengths(), "mottle": 0.25}


def test_each_subject_is_somebody(tmp_path):
    text = "".join(
        f'[[subject]]\nid = "s{seed}"\nrig = {{ head = "male" }}\nperson = {{ tone = "dark", sex = "male", seed = {seed} }}\n'
        for seed in (1, 2)
    )
    shot = read(tmp_path, text + '[[expression]]\nid = "neutral"\n')
    a, b = (scene_of(shot, subject, ()) for subject in shot.subjects)
    assert a.skin != b.skin and (a.growth.seed, b.growth.seed) == (1, 2)
    with pytest.raises(InputError, match="person: give it to the"):
        read(tmp_path, PERSON + text + '[[expression]]\nid = "neutral"\n')


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ('tone = "monk-51"', "person.tone: no such tone 'monk-51', did you mean 'monk-5'?"),
        ('tone = "tan"\nagee = 3', "unknown key, did you mean 'age'?"),
        ('tone = "tan"\nage = 300', "person.age"),
        ('tone = "tan"\nsex = "x"', "person.sex"),
        ('tone = "tan"\nseed = 1.5', "person.seed"),
        ("age = 30", "person.tone: missing"),
    ],
)
def test_bad_persons_give_one_line(tmp_path, line, says):
    with pytest.raises(InputError) as error:
        read(tmp_path, ONE.format(person="[person]\n" + line, skin=""))
    assert says in str(error.value) and "\n" not in str(error.value)
