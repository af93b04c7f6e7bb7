"""Solvers with their settings in the caller's hand: the same numbers as solve(), and clear refusals."""

import math

import numpy as np
import pytest

import sanguine_core as core

SKIN = np.array([[2.67507, 31.4012, 0.8, 1.4, 0.1], [0.600805, 15.7006, 0.8, 1.4, math.inf]])
SLAB = np.array([[1.0, 20.0, 0.8, 1.4, 0.5]])
RADII_MM = np.geomspace(0.1, 5, 12)


@pytest.mark.parametrize("incidence", ["normal", "diffuse"])
def test_adding_doubling_is_the_solver_s(incidence):
    asked = core.solve(SKIN, incidence, solver="adding-doubling", tolerance=1e-4)
    given = core.adding_doubling(SKIN, incidence, 32)
    assert given["specular"] == pytest.approx(asked["specular"], rel=1e-12)
    # 1e-4 is the tolerance of the one, and 32 streams are better than that.
    assert given["Rd"] == pytest.approx(asked["Rd"], rel=1e-4)
    assert core.adding_doubling(SKIN, incidence, 4)["Rd"] != pytest.approx(asked["Rd"], rel=1e-3)


def test_multipole_is_the_solver_s():
    asked = core.solve(SLAB, "normal", RADII_MM, solver="multipole")
    given = core.multipole(SLAB, RADII_MM)
    entering = 1 - asked["specular"]
    assert entering * given["R"] == pytest.approx(asked["Rd"], rel=1e-12)
    assert entering * given["T"] == pytest.approx(asked["Tt"], rel=1e-12)
    np.testing.assert_allclose(entering * given["R_per_mm2"], asked["R_per_mm2"], rtol=1e-9)
    # Dipoles die away as exp(-2 i sigma_tr (d + zb + zb)): with sigma_tr = 3.9 / mm and 0.9 mm, all within 20.
    assert core.multipole(SLAB, terms=20)["R"] == pytest.approx(given["R"], rel=1e-9)
    assert core.multipole(SLAB, terms=0)["R"] != pytest.approx(given["R"], rel=1e-3)
    assert core.multipole(SLAB)["R_per_mm2"] is None


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda: core.adding_doubling(SKIN, "normal", 3), "streams"),
        (lambda: core.adding_doubling(SKIN, "normal", 100_000), "streams"),
        (lambda: core.adding_doubling(SKIN, "sideways", 8), "sideways"),
        (lambda: core.adding_doubling(SKIN * -1, "normal", 8), "layers.0"),
        (lambda: core.multipole(SLAB, terms=-2), "terms"),
        (lambda: core.multipole(SLAB, terms=10_000), "terms"),
        (lambda: core.multipole(SLAB, np.array([1.0, 0.5])), "radii_mm"),
        (lambda: core.multipole(SLAB, np.array([np.nan])), "radii_mm"),
    ],
)
def test_refusals(call, word):
    with pytest.raises(ValueError, match=word):
        call()
