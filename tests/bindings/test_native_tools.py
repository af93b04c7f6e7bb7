"""The two generators that run while the library is built: they must stop the build, not pass a slip on."""

import copy
import runpy
import shutil
import tomllib
from pathlib import Path

import pytest

NATIVE = Path(__file__).parents[2] / "native"
SCHEMA = runpy.run_path(str(NATIVE / "tools/generate_schema.py"))
DATA = runpy.run_path(str(NATIVE / "tools/embed_data.py"))


@pytest.fixture
def schema():
    return tomllib.loads((NATIVE / "schema/parameters.toml").read_text(encoding="utf-8"))


def test_schema_is_accepted(schema):
    SCHEMA["check"](schema)
    header = SCHEMA["header"](schema)
    for row in schema["parameter"]:
        assert f"double {row['id']} = " in header


@pytest.mark.parametrize(
    "change",
    [
        {"default": 2.0},  # outside its range
        {"soft_max": float("nan")},
        {"id": "two words"},
        {"id": "hemoglobin"},  # there twice
        {"surplus": 1},
    ],
)
def test_slips_in_the_schema_stop_the_build(schema, change):
    broken = copy.deepcopy(schema)
    broken["parameter"][0].update(change)
    with pytest.raises(ValueError, match="parameter"):
        SCHEMA["check"](broken)


def test_every_data_file_is_under_its_checksum():
    listed = set(DATA["read_checked"](NATIVE / "data"))
    assert listed == {path.name for path in (NATIVE / "data").iterdir() if path.suffix in (".csv", ".bin")}


def test_a_changed_digit_stops_the_build(tmp_path):
    folder = tmp_path / "data"
    shutil.copytree(NATIVE / "data", folder)
    table = folder / "hemoglobin.csv"
    table.write_text(table.read_text().replace("276", "277", 1))
    with pytest.raises(ValueError, match="hemoglobin.csv"):
        DATA["read_checked"](folder)


def test_spectra_name_their_source():
    for path in (NATIVE / "data").glob("*.csv"):
        assert "# Source:" in path.read_text(), path.name
