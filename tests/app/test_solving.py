"""The ladder of solvers against the independent Monte Carlo of tests/reference (its README says what the numbers are)."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import sanguine_core

from sanguine.app.solving import Case, answer, read_cases
from sanguine.domain.errors import InputError

FILE = Path(__file__).resolve().parents[1] / "reference" / "monte_carlo_cases.json"
REFERENCE = {case["id"]: case for case in json.loads(FILE.read_text())["cases"]}
TOTALS = ("Rd", "R_unscattered", "Tt", "specular")


def ask(cases, solver="auto", tolerance=0.01, radii_mm=()):
    return answer(cases, solver, tolerance, list(radii_mm), 60.0, lambda *_: None)["results"]


@pytest.fixture(scope="module")
def cases():
    return {case.id: case for case in read_cases(FILE)}


@pytest.fixture(scope="module")
def automatic(cases):
    """`auto` at tolerance 0.01 with the 40 radii of each case."""
    asked = [c.model_copy(update={"radii_mm": REFERENCE[c.id]["R"]["r"]}) for c in cases.values()]
    return {result["id"]: result for result in ask(asked)}


def off(value, reference, se):
    """Relative error beyond three standard errors of the reference."""
    return max(0.0, abs(value - reference) - 3 * se) / reference if reference > 0 else abs(value - reference)


@pytest.mark.parametrize("name", REFERENCE)
def test_adding_doubling_totals(cases, name):
    """0.2 % or three standard errors: the bar of the project for its exact rung."""
    (result,), truth = ask([cases[name]], "adding-doubling", 1e-4), REFERENCE[name]
    assert result["error"] is None
    for key in ("Rd", "Tt"):
        assert abs(result[key] - truth[key]) <= max(0.002 * truth[key], 3 * truth[f"{key}_se"])
    assert result["r_mm"] == []


@pytest.mark.parametrize("name", REFERENCE)
def test_auto_totals(automatic, name):
    """1 % of Rd at tolerance 0.01; three standard errors of the reference are at most 0.3 % of it."""
    result, truth = automatic[name], REFERENCE[name]
    assert result["error"] is None and result["because"] and result["solver"] != "auto"
    assert result["error_estimate"] <= 0.01 or result["warnings"]
    for key in TOTALS:
        assert off(result[key], truth[key], truth.get(f"{key}_se", 1e-8)) <= 0.01, key


@pytest.mark.parametrize("name", [name for name, case in REFERENCE.items() if case["class"].startswith("skin")])
def test_auto_profile_of_skin(automatic, name):
    """Sum of |R - reference| x ring area over that of the reference: 4 % is the bar of the project."""
    table = {key: np.array(values) for key, values in REFERENCE[name]["R"].items()}
    area = math.pi * (table["r_hi"] ** 2 - table["r_lo"] ** 2)
    found = np.array(automatic[name]["R_per_mm2"])
    assert np.sum(np.abs(found - table["value"]) * area) / np.sum(table["value"] * area) <= 0.04


def test_the_skin_table_is_taken_where_it_holds(automatic):
    """p04 and p07 have so much pigment that the table's profile is known to 2.3 and 2.7 % only: photons are traced."""
    assert {name for name, r in automatic.items() if r["solver"] == "skin"} == {"p02", "p13"}
    assert all("not the skin table" in r["because"] for r in automatic.values() if r["solver"] != "skin")
    assert all(automatic[name]["error_estimate"] <= 0.01 for name in automatic)


def test_totals_alone_trace_no_photon(cases):
    for result in ask(cases.values()):
        assert result["solver"] in ("skin", "adding-doubling")


def test_a_hopeless_case_leaves_the_others_answered(cases):
    bad = cases["p01"].model_copy(update={"layers": [cases["p01"].layers[0].model_copy(update={"mu_a": -1.0})]})
    first, second = ask([bad, cases["p10"]])
    assert "layers.0.mu_a" in first["error"] and first["Rd"] is None
    assert second["error"] is None


def test_auto_asks_no_photons_for_totals_that_are_known():
    """A millionth part of the light gets through: Monte Carlo's own totals would take a minute and miss the tolerance."""
    slab = np.array([[0.05, 30.0, 0.5, 1.4, 10.0]])
    found = sanguine_core.solve(slab, "normal", np.geomspace(0.02, 20, 20), tolerance=0.02, max_seconds=40.0)
    assert found["solver"] == "adding-doubling+monte-carlo"
    exact = sanguine_core.solve(slab, solver="adding-doubling", tolerance=1e-4)
    assert exact["Tt"] < 1e-5
    assert found["Tt"] == pytest.approx(exact["Tt"], rel=1e-3)  # ten times what adding-doubling is asked for
    assert found["error_estimate"] >= exact["error_estimate"]


@pytest.mark.parametrize("radius_mm", [1e13, 1e300])
def test_radii_beyond_all_light_hold_none(radius_mm):
    layers = np.array([[0.1, 10.0, 0.5, 1.4, math.inf]])
    for solver in ("monte-carlo", "multipole"):
        found = sanguine_core.solve(layers, "normal", np.array([radius_mm, 2 * radius_mm]), solver, tolerance=0.1)
        assert np.all(found["R_per_mm2"] < 1e-20), solver


def test_an_answer_beyond_memory_is_refused_before_work():
    layer = {"mu_a": 1.0, "mu_s": 10.0, "g": 0.8, "n": 1.4, "thickness": None}
    many = [Case.model_validate({"id": "a", "layers": [layer]})] * 1000
    with pytest.raises(InputError, match="radii in 1000 cases"):
        ask(many, radii_mm=np.linspace(1, 2, 100_000))


def test_cancel_and_progress():
    slow = np.array([[1e-6, 100.0, 0.9, 1.4, math.inf]])
    with pytest.raises(sanguine_core.Cancelled):
        sanguine_core.solve(slow, solver="monte-carlo", tolerance=1e-6, progress=lambda done, total: False)
    with pytest.raises(TypeError, match="progress"):
        sanguine_core.solve(slow, solver="monte-carlo", tolerance=1e-6, progress=lambda done, total: None)


def test_same_answer_on_any_number_of_threads():
    layers = np.array([[0.5, 30.0, 0.8, 1.4, 0.1], [0.2, 15.0, 0.8, 1.38, 2.0]])
    radii = np.geomspace(0.02, 5, 20)
    one, three = (
        sanguine_core.solve(layers, "normal", radii, "monte-carlo", tolerance=0.05, threads=threads) for threads in (1, 3)
    )
    assert one["Rd"] == three["Rd"] and np.array_equal(one["R_per_mm2"], three["R_per_mm2"])


def test_what_cannot_be_is_refused():
    good = [0.1, 1.0, 0.0, 1.4, math.inf]
    for column, value in [(0, math.nan), (1, -1.0), (1, math.inf), (2, 1.0), (3, 0.5), (4, 0.0), (4, math.nan), (4, 1e300)]:
        layers = np.array([good])
        layers[0, column] = value
        with pytest.raises(ValueError, match="layers.0"):
            sanguine_core.solve(layers)
    for arguments in [
        {"radii_mm": np.array([1.0, 0.5])}, {"radii_mm": np.array([0.0])}, {"tolerance": 0.0}, {"solver": "magic"},
        {"incidence": "slanted"}, {"max_seconds": -1.0}, {"max_photons": 0},
    ]:  # fmt: skip
        with pytest.raises(ValueError, match=next(iter(arguments))):
            sanguine_core.solve(np.array([good]), **arguments)
    with pytest.raises(ValueError, match="layers"):
        sanguine_core.solve(np.array([good] * 9))


def test_typing_errors_in_a_file_are_named(tmp_path):
    path = tmp_path / "cases.json"
    layer = {"mu_a": 1.0, "mu_s": 10.0, "g": 0.8, "n": 1.4, "thickness": None}
    for case, words in [
        ({"layers": [layer], "radi_mm": [1.0]}, "cases.0.radi_mm: unknown key, did you mean 'radii_mm'"),
        ({"layers": [{**layer, "mus": 1.0}]}, "cases.0.layers.0.mus: unknown key"),
        ({"layers": [{k: v for k, v in layer.items() if k != "g"}]}, "cases.0.layers.0.g: missing"),
        ({"layers": [{**layer, "mu_a": "1"}]}, "cases.0.layers.0.mu_a"),
        ({"layers": [layer], "incidence": "slanted"}, "cases.0.incidence"),
        ({}, "cases.0.layers: missing"),
    ]:
        path.write_text(json.dumps({"cases": [case]}))
        with pytest.raises(InputError) as caught:
            read_cases(path)
        assert words in str(caught.value) and "cases.json" in str(caught.value)
