"""Analytic limits and symmetries, which no solver may miss."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from stability import extremes
from stability.extremes import INCIDENCES, ask, same_within

EXACT = ("adding-doubling", "monte-carlo", "auto")


def fresnel(n: float) -> float:
    return ((n - 1) / (n + 1)) ** 2


def fresnel_at(n: float, cosine: np.ndarray) -> np.ndarray:
    """Unpolarised light from air into index n (Born and Wolf, Principles of Optics, 1.5)."""
    inside = np.sqrt(1 - (1 - cosine**2) / n**2)
    s = (cosine - n * inside) / (cosine + n * inside)
    p = (n * cosine - inside) / (n * cosine + inside)
    return 0.5 * (s**2 + p**2)


def slab(n: float, depth: float, incidence: str) -> tuple[float, float, float]:
    """specular, R_unscattered, T of a slab that absorbs exp(-depth) along its normal and does not scatter."""
    n = max(n, 1 + 1e-13)  # at n = 1 Fresnel's formulas are 0 / 0 along the surface

    def along(cosine):
        r = fresnel_at(n, cosine)
        a = np.exp(-depth / np.sqrt(1 - (1 - cosine**2) / n**2))
        through = (1 - r) ** 2 * a / (1 - (r * a) ** 2)
        return r, through * r * a, through

    if incidence == "normal":
        return tuple(float(v) for v in along(np.array(1.0)))
    # Gauss and Legendre in t, mu = t^3: the integrands are steep near grazing incidence alone.
    t, w = np.polynomial.legendre.leggauss(400)
    t, w = (t + 1) / 2, w / 2
    weight = 2 * t**3 * 3 * t**2 * w
    return tuple(float((weight * v).sum()) for v in along(t**3))


@pytest.mark.parametrize("solver", EXACT)
@extremes.examples(40)
@given(st.floats(1, 3), extremes.thicknesses(), st.sampled_from(INCIDENCES))
def test_a_clear_slab_is_fresnel(solver, n, thickness, incidence):
    """No absorption, no scattering: both faces and all reflections between them, R + T = 1, within 1e-7 (quadrature over
    the angle); Monte Carlo within four standard errors of the photons it traced (512 and more; three are in its stated
    error, shares below 0.001 count as that)."""
    outcome = ask([(0.0, 0.0, 0.0, n, thickness)], solver, incidence)
    specular, back, through = slab(n, 0.0, incidence)
    margin = 1e-7 if solver != "monte-carlo" else 1e-7 + 4 / 3 * outcome.error
    assert same_within(outcome["specular"], specular, 0, 1e-7)
    assert outcome["Rd"] == 0
    assert same_within(outcome["R_unscattered"], back, 0, margin)
    assert same_within(outcome.Tt, through, 0, margin)


@pytest.mark.parametrize("solver", EXACT)
@extremes.examples(40)
@given(st.floats(1, 3), extremes.magnitudes(1e-12, 50), st.sampled_from(INCIDENCES))
def test_no_scattering_is_beer_and_lambert(solver, n, depth, incidence):
    """One absorbing slab of any optical depth, in closed form: within 1e-7 of the incident light, Monte Carlo within four
    standard errors."""
    outcome = ask([(depth / 0.5, 0.0, 0.3, n, 0.5)], solver, incidence)
    specular, back, through = slab(n, depth, incidence)
    margin = 1e-7 if solver != "monte-carlo" else 1e-7 + 4 / 3 * outcome.error * max(through, 1e-3)
    assert same_within(outcome["specular"], specular, 0, 1e-7)
    assert outcome["Rd"] == 0
    assert same_within(outcome["R_unscattered"], back, 0, margin)
    assert same_within(outcome.Tt, through, 0, margin)


@extremes.examples(60)
@given(extremes.stacks(half_spaces=False), st.sampled_from(INCIDENCES))
def test_without_absorption_all_light_leaves(stack, incidence):
    """mu_a = 0 in any stack with a bottom, by adding-doubling: R + T + specular = 1 within 1e-4, to which it works, or the
    error it states. (Its fluxes are conserved by construction to about 1e-9; the quadrature over the angle of diffuse
    light is not.)"""
    outcome = ask([(0.0, *layer[1:]) for layer in stack], "adding-doubling", incidence)
    assume(outcome)
    total = outcome.R + outcome.Tt + outcome["specular"]
    assert abs(total - 1) <= max(1e-4, outcome.error)


@extremes.examples(20)
@given(extremes.coefficients(), extremes.anisotropies(), extremes.indices(), st.sampled_from(INCIDENCES))
def test_a_white_half_space_returns_all(mu_s, g, n, incidence):
    """A half-space that scatters and does not absorb: Rd + specular = 1 within 1e-4 or the stated error."""
    assume(mu_s > 0)
    outcome = ask([(0.0, mu_s, g, n, math.inf)], "adding-doubling", incidence)
    assert outcome, outcome.reason
    assert abs(outcome.R + outcome["specular"] - 1) <= max(1e-4, outcome.error)


@extremes.examples(10)
@given(extremes.moderate_stacks(), st.sampled_from(INCIDENCES))
def test_without_absorption_all_photons_leave(stack, incidence):
    """The same by Monte Carlo on moderate stacks: within four standard errors of both totals."""
    outcome = ask([(0.0, *layer[1:]) for layer in stack], "monte-carlo", incidence, max_photons=8192)
    total = outcome.R + outcome.Tt + outcome["specular"]
    assert abs(total - 1) <= 4 / 3 * 2 * outcome.error + 1e-9


@extremes.examples(60)
@given(extremes.stacks(half_spaces=False))
def test_reciprocity(stack):
    """A stack upside down transmits the same share of Lambertian light (air on both sides; Chandrasekhar, Radiative
    Transfer, section 13): by adding-doubling within twice the larger of 1e-4 and the stated errors, and 1e-12."""
    down, up = (ask(s, "adding-doubling", "diffuse") for s in (stack, stack[::-1]))
    assume(down and up)
    assert same_within(down.Tt, up.Tt, 2 * max(1e-4, down.error, up.error), 1e-12)


@extremes.examples(10)
@given(extremes.moderate_stacks())
def test_reciprocity_of_photons(stack):
    """The same by Monte Carlo: within the sum of both stated errors (three standard errors each) and 1e-12 (rounding,
    where nothing scatters and nothing is random)."""
    down, up = (ask(s, "monte-carlo", "diffuse", max_photons=8192) for s in (stack, stack[::-1]))
    assert abs(down.Tt - up.Tt) <= (down.error + up.error) * max(down.Tt, up.Tt, 1e-3) + 1e-12


@extremes.examples(40)
@given(extremes.stacks(most=4), st.sampled_from(INCIDENCES), st.integers(-3, 3))
def test_only_ratios_of_lengths_count(stack, incidence, power):
    """All lengths times 4^power, all coefficients divided by it: the same totals within 1e-9 (the products are exact in
    binary; only denormals round)."""
    scale = 4.0**power
    scaled = [(mu_a / scale, mu_s / scale, g, n, d * scale) for mu_a, mu_s, g, n, d in stack]
    assume(all(mu_a <= 1e7 and mu_s <= 1e7 for mu_a, mu_s, *_ in scaled))
    assume(all(value == 0 or value > 1e-290 for layer in stack for value in layer[:2]))
    a, b = (ask(s, "adding-doubling", incidence) for s in (stack, scaled))
    assume(a and b)
    assert same_within(a.R, b.R, 1e-9, 1e-15) and same_within(a.Tt, b.Tt, 1e-9, 1e-15)


@extremes.examples(40)
@given(extremes.stacks(most=4), st.sampled_from(INCIDENCES), st.integers(0, 3), st.floats(0.01, 0.99))
def test_a_layer_cut_in_two_is_the_same_layer(stack, incidence, layer, share):
    """Cutting a layer anywhere into two of the same medium changes nothing: within twice the larger of 1e-4 and the
    stated errors, and 1e-12."""
    layer %= len(stack)
    medium, d = stack[layer][:4], stack[layer][4]
    first = d * share if math.isfinite(d) else share
    cut = (*stack[:layer], (*medium, first), (*medium, d - first), *stack[layer + 1 :])
    whole, parts = ask(stack, "adding-doubling", incidence), ask(cut, "adding-doubling", incidence)
    assume(whole and parts)
    tolerance = 2 * max(1e-4, whole.error, parts.error)
    assert same_within(whole.R, parts.R, tolerance, 1e-12) and same_within(whole.Tt, parts.Tt, tolerance, 1e-12)


@extremes.examples(30)
@given(extremes.stacks(most=4), st.sampled_from(INCIDENCES), st.integers(0, 4))
def test_a_nanometre_of_nothing_changes_nothing(stack, incidence, place):
    """A clear layer of 1 nm with its neighbour's index, anywhere: the same within 1e-9."""
    place %= len(stack)
    more = (*stack[:place], (0.0, 0.0, 0.0, stack[place][3], extremes.NANOMETRE), *stack[place:])
    without, within = ask(stack, "adding-doubling", incidence), ask(more, "adding-doubling", incidence)
    assume(without and within)
    assert same_within(without.R, within.R, 1e-9, 1e-15) and same_within(without.Tt, within.Tt, 1e-9, 1e-15)


@extremes.examples(15)
@given(extremes.moderate_stacks(half_spaces=True), st.sampled_from(INCIDENCES))
def test_two_unlike_methods_agree(stack, incidence):
    """Adding-doubling and Monte Carlo, which share no code but Fresnel's formulas, on moderate stacks: within four
    standard errors and the error that adding-doubling states."""
    exact, photons = ask(stack, "adding-doubling", incidence), ask(stack, "monte-carlo", incidence, max_photons=20000)
    for a, b in ((exact["Rd"], photons["Rd"]), (exact.Tt, photons.Tt)):
        assert abs(a - b) <= 4 / 3 * photons.error * max(b, 1e-3) + max(1e-4, exact.error) * a


@pytest.mark.parametrize("g", [5e-324, 2.3e-308, 1e-17, -1e-12, 1e-8, -1e-6, 9e-4])
def test_nearly_isotropic_is_isotropic(g):
    """Monte Carlo with a g that is next to nothing scatters as with g = 0, photon for photon: Rd within 3 g and 1e-9."""
    stack = [(0.0, 0.0, 0.0, 2.0, 1.0), (0.1, 1.0, g, 1.0, 0.1)]
    isotropic = [stack[0], (0.1, 1.0, 0.0, 1.0, 0.1)]
    a, b = (ask(s, "monte-carlo", max_photons=4096) for s in (stack, isotropic))
    assert same_within(a["Rd"], b["Rd"], 3 * abs(g), 1e-9)


def test_a_thick_slab_is_a_half_space():
    """A metre of absorbing medium reflects as one without a bottom, within 1e-9, and lets nothing through."""
    for mu_a, mu_s, g, n in ((0.1, 10.0, 0.8, 1.4), (1e-3, 1.0, 0.0, 1.0), (1e6, 1e6, 0.9, 3.0), (1.0, 1e-3, -0.9, 1.33)):
        for incidence in INCIDENCES:
            metre = ask([(mu_a, mu_s, g, n, extremes.METRE)], "adding-doubling", incidence)
            endless = ask([(mu_a, mu_s, g, n, math.inf)], "adding-doubling", incidence)
            assert same_within(metre.R, endless.R, 1e-9) and metre.Tt < 1e-9
