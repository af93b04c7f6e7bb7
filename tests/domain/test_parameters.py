"""One declaration: what follows from the schema agrees with it."""

import importlib.util
import tomllib
from pathlib import Path

import pytest
import sanguine_core
from hypothesis import given
from hypothesis import strategies as st
from sanguine.domain.errors import InputError
from sanguine.domain.parameters import PARAMETERS, default_skin, skin_from, skin_rows

ROOT = Path(__file__).resolve().parents[2]
ROWS = tomllib.loads((ROOT / "native/schema/parameters.toml").read_text(encoding="utf-8"))["parameter"]


def test_parameters_are_the_rows_of_the_schema():
    assert [vars(parameter) for parameter in PARAMETERS.values()] == ROWS


def test_the_page_of_parameters_is_current():
    spec = importlib.util.spec_from_file_location("docs", ROOT / "tools/write_parameter_docs.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert (ROOT / "docs/parameters.md").read_text(encoding="utf-8") == module.page(), "run `make docs`"


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["id"])
def test_every_row_is_checked_by_python_and_by_the_core(row):
    for value in (row["hard_min"] - 0.01, row["hard_max"] + 0.01, float("nan"), float("inf")):
        with pytest.raises(InputError, match=row["id"]):
            skin_from({row["id"]: value}, "test")
        with pytest.raises(ValueError, match=row["id"]):
            sanguine_core.surface(skin_rows([default_skin() | {row["id"]: value}]))
    for value in (row["hard_min"], row["hard_max"]):
        sanguine_core.surface(skin_rows([skin_from({row["id"]: value}, "test")]))


@given(st.dictionaries(st.sampled_from([*PARAMETERS, "oxyhemoglobin", "deoxyhemoglobin", "x"]),
                       st.one_of(st.floats(), st.none(), st.text(max_size=3), st.booleans(), st.integers())))
def test_any_values_give_a_whole_skin_or_one_line(values):
    try:
        skin = skin_from(values, "test")
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert set(skin) == set(PARAMETERS)
        for key, value in skin.items():
            assert PARAMETERS[key].hard_min <= value <= PARAMETERS[key].hard_max
