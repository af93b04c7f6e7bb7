"""sanguine_core.fit from Python: shapes, errors, cancelling, any input."""

import threading
import time

import colour
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import sanguine_core as core

NM = np.arange(400.0, 701.0, 10.0)
ROWS = core.fit_parameters()
IDS = [row["id"] for row in ROWS]
SCHEMA = {row["id"]: row for row in core.parameters()}


def spectra(count: int) -> np.ndarray:
    """Skins of all tones without their surface."""
    rows = np.array([[row["default"] for row in SCHEMA.values()]] * count)
    rows[:, 0] = np.geomspace(0.01, 0.3, count)
    return core.reflectance(rows, NM)


def test_shapes_and_counter():
    core.reset_counters()
    fit = core.fit(spectra(3), NM, specular_included=False)
    f = len(ROWS)
    assert {key: value.shape for key, value in fit.items()} == {
        "value": (3, f), "standard_error": (3, f), "informed": (3, f), "at_bound": (3, f), "correlation": (3, f, f),
        "reflectance": (3, len(NM)), "rmse": (3,), "noise": (3,), "iterations": (3,), "converged": (3,),
    }  # fmt: skip
    assert core.counters()["spectra_fitted"] == 3
    np.testing.assert_allclose(fit["reflectance"], spectra(3), atol=5e-4)
    melanin = fit["value"][:, IDS.index("melanin")]
    assert (np.diff(melanin) > 0).all()
    assert core.fit(np.empty((0, len(NM))), NM)["value"].shape == (0, f)


def test_a_prior_holds_and_frees():
    prior = np.array([(row["prior_mean"], row["prior_sd"]) for row in ROWS])
    k = IDS.index("melanin_blend")
    prior[k] = (0.5, 0.0)
    fit = core.fit(spectra(2), NM, specular_included=False, prior=prior)
    assert (fit["value"][:, k] == 0.5).all() and (fit["standard_error"][:, k] == 0).all()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: core.fit(np.full((1, 3), 0.3), NM), ["spectra", "3 columns", "31"]),
        (lambda: core.fit(np.full((1, 31), np.nan), NM), ["spectrum 0", "400 nm", "nan", "0 to 1"]),
        (lambda: core.fit(np.full((1, 31), 35.0), NM), ["spectrum 0", "35", "0 to 1"]),
        (lambda: core.fit(np.full((1, 31), 0.3), NM[::-1].copy()), ["wavelengths_nm", "increase"]),
        (lambda: core.fit(np.full((1, 31), 0.3), NM + 100), ["wavelengths_nm", "790", "380 to 780"]),
        (lambda: core.fit(np.full((1, 31), 0.3), NM, prior=np.zeros((2, 2))), ["prior", "2 means"]),
        (lambda: core.fit(np.full((1, 31), 0.3), NM, threads=-1), ["threads", "-1"]),
    ],
)
def test_errors_are_one_line(call, words):
    with pytest.raises(ValueError) as caught:
        call()
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


# No deadline: the machine may be busy, and a first call loads the table.
@settings(max_examples=25, deadline=None)
@given(arrays(np.float64, (2, 12), elements=st.floats(0, 1)), st.booleans())
def test_any_spectrum_gives_a_finite_fit_inside_the_bounds(values, included):
    nm = np.linspace(400.0, 700.0, 12)
    fit = core.fit(values, nm, specular_included=included)
    assert all(np.isfinite(array).all() for array in fit.values())
    for i, row in enumerate(ROWS):
        low = row["lower"] if row["held_at"] is None else min(row["lower"], row["held_at"])
        assert (fit["value"][:, i] >= low).all() and (fit["value"][:, i] <= row["upper"]).all()
    assert (fit["standard_error"] >= 0).all()
    assert (np.abs(fit["correlation"]) <= 1 + 1e-9).all()


def test_cancelling_and_progress():
    many = np.tile(spectra(40), (500, 1))
    asked = []

    def stop(done, total):
        asked.append((threading.current_thread(), done, total))
        return False

    start = time.perf_counter()
    with pytest.raises(core.Cancelled):
        core.fit(many, NM, threads=1, progress=stop)
    assert time.perf_counter() - start < 10  # all of it takes longer
    assert asked[0][0] is threading.current_thread() and asked[0][2] == len(many)
    seen = []
    core.fit(many[:5], NM, progress=lambda done, total: seen.append((done, total)) or True)
    assert seen[-1] == (5, 5)


def test_gil_is_released():
    worker = threading.Thread(target=core.fit, args=(np.tile(spectra(40), (5, 1)), NM), kwargs={"threads": 1})
    worker.start()
    turns = 0
    while worker.is_alive():
        turns += 1
        time.sleep(0.0005)
    assert turns > 20


def test_delta_e_2000_is_that_of_colour_science():
    # Over the whole of Lab, and near grey and across the turn of the hue, where implementations go wrong. Hues exactly
    # opposite are left out: there the formula jumps, and rounding decides to which side.
    random = np.random.default_rng(3)
    one = random.uniform((0, -100, -100), (100, 100, 100), (2000, 3))
    two = np.vstack([random.uniform((0, -100, -100), (100, 100, 100), (1000, 3)), one[1000:] * (1, 1, -1)])
    near = one + random.normal(0, 0.5, one.shape)
    grey = one * (1, 0, 0)
    for a, b in ((one, two), (one, near), (grey, near), (grey, grey[::-1].copy())):
        np.testing.assert_allclose(core.delta_e_2000(a, b), colour.delta_E(a, b, method="CIE 2000"), atol=1e-8)
    with pytest.raises(ValueError, match="as many as lab_1"):
        core.delta_e_2000(one, one[:2])
