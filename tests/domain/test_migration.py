"""What an older version wrote is read as it was meant."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sanguine.domain.errors import InputError
from sanguine.domain.migration import SCHEMA, STEPS, UNNUMBERED, Step, check_version, migrate, notes
from sanguine.domain.parameters import PARAMETERS

MADE_UP = (
    Step(2, renamed={"blood": "hemoglobin"}),
    Step(3, factors={"hemoglobin": 0.01}, untouched={"sheen": 0.5}, note="percent no more"),
    Step(4, renamed={"sheen": "oil"}, factors={"oil": 2.0}),
)


def test_steps_follow_each_other_to_ids_of_today():
    assert [step.to for step in STEPS] == list(range(UNNUMBERED + 1, SCHEMA + 1))
    for step in (*STEPS, *MADE_UP):
        assert not set(step.renamed) & set(step.renamed.values()), "a swap could not be told from a name set later"
    known = {*PARAMETERS}
    for step in STEPS:
        assert {name for name in step.renamed.values() if not name.startswith("strength_")} <= known


def test_names_factors_and_old_defaults():
    assert migrate({"blood": 3.0, "melanin": 0.1}, 1, MADE_UP) == pytest.approx({"hemoglobin": 0.03, "melanin": 0.1, "oil": 1.0})
    assert migrate({"hemoglobin": 3.0, "sheen": 0.2}, 2, MADE_UP) == pytest.approx({"hemoglobin": 0.03, "oil": 0.4})
    assert migrate({"sheen": 0.2}, 3, MADE_UP) == pytest.approx({"oil": 0.4})
    assert migrate({"sheen": 0.2, "oil": 0.7}, 3, MADE_UP) == {"oil": 0.7}, "the new name was set later"
    assert migrate({"oil": 0.7}, 4, MADE_UP) == {"oil": 0.7}
    assert notes(1, MADE_UP) == notes(2, MADE_UP) == ["percent no more"] and notes(3, MADE_UP) == []


@given(st.dictionaries(st.sampled_from(["blood", "hemoglobin", "oil", "sheen", "melanin"]), st.floats(0, 1)), st.integers(1, 4))
def test_what_is_migrated_is_of_today_and_the_rest_as_it_was(values, version):
    made = migrate(values, version, MADE_UP)
    assert migrate(made, 4, MADE_UP) == made
    assert made.get("melanin") == values.get("melanin")
    gone = {"blood"} if version < 2 else set()
    assert not made.keys() & (gone | ({"sheen"} if version < 4 else set()))
    assert values == dict(values)


@pytest.mark.parametrize("version", [SCHEMA + 1, 0, -1, True, "2", None])
def test_what_cannot_be_read_is_one_line(version):
    with pytest.raises(InputError, match="^face: ") as error:
        check_version(version, "face")
    assert "\n" not in str(error.value)
    assert check_version(SCHEMA, "face") == SCHEMA
