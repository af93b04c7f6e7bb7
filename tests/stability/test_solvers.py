"""Every rung of the ladder on stacks from nothing to a metre of the densest medium."""

import math
import re
import time

import numpy as np
import pytest
import sanguine_core as core
from hypothesis import assume, given
from hypothesis import strategies as st
from stability import extremes
from stability.extremes import INCIDENCES, ask, same_within
from stability.hard_cases import CASES
from stability.page import SEEN

SOLVERS = [row["id"] for row in core.solvers()]
RADII = np.geomspace(1e-3, 30, 12)


def counted(solver, outcome):
    """Keeps count of answers and of the reasons for refusals, for the page."""
    reason = re.sub(r"-?[0-9][0-9.]*(e[+-]?[0-9]+)?", "#", outcome.reason).split(": ", 1)[-1]
    words = re.split(r"[;,]| by itself| is ", reason)[0].split()
    SEEN.count(solver, "answers" if outcome else "refused (" + " ".join(words[:9]) + ")")
    return outcome


# --- any stack at all


@pytest.mark.parametrize("solver", SOLVERS)
@extremes.examples(60)
@given(extremes.stacks(), st.sampled_from(INCIDENCES))
def test_any_stack_has_an_answer_or_a_reason(solver, stack, incidence):
    """1 to 8 layers; thickness 1 nm to 1 m or none; mu_a and mu_s 0, denormal, up to 1e6 per mm; g -0.99 to 0.999; n 1 to
    3. Each share finite and not negative, all together at most 1 + 1e-9 (rounding in sums of thousands of terms), or an
    error that names the reason, within max_seconds and 3 s of CPU time."""
    counted(solver, ask(stack, solver, incidence))


@pytest.mark.parametrize("solver", SOLVERS)
@extremes.examples(25)
@given(extremes.stacks(most=4), st.sampled_from(INCIDENCES), st.lists(extremes.magnitudes(1e-9, 1e6), min_size=1, max_size=9))
def test_any_profile_is_finite_and_not_negative(solver, stack, incidence, radii):
    """The same with radii from 1e-9 to 1e6 mm: R(r) and T(r) finite and not negative."""
    radii = sorted(set(radii))
    counted(solver + ", profile", ask(stack, solver, incidence, radii, max_seconds=0.3))


@extremes.examples(80)
@given(extremes.stacks(), st.sampled_from(INCIDENCES))
def test_auto_and_adding_doubling_refuse_no_stack(stack, incidence):
    """Light in a stack has an answer: only the multipole may say that its method ends. `auto` and adding-doubling return
    totals for every stack of the domain."""
    for solver in ("adding-doubling", "auto"):
        outcome = ask(stack, solver, incidence)
        assert outcome, outcome.reason


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("incidence", INCIDENCES)
def test_grid_of_extremes(solver, incidence):
    """One layer, every combination of the ends of all ranges and some values between."""
    ends = extremes.finer(1) > 1
    thicknesses = [1e-6, 0.1, 1e3, math.inf] if not ends else [1e-6, 1e-3, 0.1, 1.0, 30.0, 1e3, math.inf]
    coefficients = [0.0, 5e-324, 1.0, 1e6] if not ends else [0.0, 5e-324, 1e-300, 1e-9, 0.01, 1.0, 1e3, 1e6]
    for thickness in thicknesses:
        for mu_a in coefficients:
            for mu_s in coefficients:
                for g in (-0.99, 0.0, 0.999):
                    for n in (1.0, 1.4, 3.0):
                        counted(
                            f"{solver}, grid",
                            ask([(mu_a, mu_s, g, n, thickness)], solver, incidence, max_seconds=0.03, max_photons=32),
                        )


@pytest.mark.parametrize("solver", SOLVERS)
@extremes.examples(60)
@given(extremes.skin_stacks(), st.sampled_from(INCIDENCES))
def test_any_skin_as_a_stack(solver, stack, incidence):
    """The same in and around the domain of the skin table: n 1.4, g 0.8, an epidermis on a dermis without end, the
    absorption of each from 1e-5 to 1e5 of its scattering, thickness from 1e-6 to 1e3 mean free paths; with and without
    radii. The skin table answers or says what it does not hold; with all others it agrees within both stated errors."""
    exact = ask(stack, "adding-doubling", incidence)
    outcome = counted(solver + ", skins", ask(stack, solver, incidence))
    if outcome and solver != "multipole":
        margin = outcome.error * max(outcome["Rd"], 1e-3 if solver == "monte-carlo" else 0) * (4 / 3 if solver == "monte-carlo" else 1)
        assert abs(outcome["Rd"] - exact["Rd"]) <= margin + max(1e-4, exact.error) * exact["Rd"] + 1e-12
    ask(stack, solver, incidence, RADII, max_photons=1024)


@pytest.mark.parametrize("incidence", INCIDENCES)
def test_the_skin_table_knows_its_error(incidence):
    """On a grid over all that the table holds, and beyond (mu_s' d from 1e-4 to 20, mu_a / mu_s' of both layers from
    1e-3 to 100): wherever it answers, adding-doubling lies within the error that it states, and 1e-4."""
    count = extremes.finer(5)
    answers = 0
    for tau in np.geomspace(1e-4, 20, 2 * count):
        for a1 in np.geomspace(1e-3, 100, 2 * count):
            for a2 in np.geomspace(1e-3, 100, count):
                stack = [(10 * a1, 50.0, 0.8, 1.4, tau / 10), (5 * a2, 25.0, 0.8, 1.4, math.inf)]
                table = ask(stack, "skin", incidence)
                if table:
                    answers += 1
                    exact = ask(stack, "adding-doubling", incidence)
                    assert same_within(table["Rd"], exact["Rd"], table.error + 1e-4), (stack, table.answer, exact.answer)
    assert answers > count**3


# --- what cannot be


BAD = [math.nan, math.inf, -math.inf, -1e-300, 1e308]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("value", BAD)
@pytest.mark.parametrize(("column", "key"), list(enumerate(["mu_a", "mu_s", "g", "n", "thickness"])))
def test_no_layer_that_cannot_be(solver, value, column, key):
    """NaN, infinities, negative and absurd numbers in every column of every layer: a ValueError that names layer and
    key, whatever the solver, in 0.1 s. A thickness of 1e308 mm is a number like others."""
    if key == "thickness" and value == 1e308 or key == "g" and value == -1e-300:
        return
    for layer in (0, 1, 7):
        stack = np.array([(1.0, 10.0, 0.5, 1.4, 1.0)] * 8)
        stack[layer, column] = value
        if key == "thickness" and value == math.inf and layer == 7:
            continue  # a half-space
        start = time.process_time()
        with pytest.raises(ValueError, match=rf"layers\.{layer}\.{key}") as caught:
            core.solve(stack, solver=solver)
        assert "\n" not in str(caught.value)
        assert time.process_time() - start < 0.1


STACK = np.array([(0.1, 10.0, 0.5, 1.4, 1.0)])


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        *(({"tolerance": v}, "tolerance") for v in (math.nan, math.inf, -math.inf, 0.0, -1.0, 2.0)),
        *(({"max_seconds": v}, "max_seconds") for v in (math.nan, -math.inf, 0.0, -1.0)),
        ({"max_photons": 0}, "max_photons"),
        ({"threads": -1}, "threads"),
        *(({"radii_mm": np.array(v)}, "radii_mm") for v in (
            [math.nan], [math.inf], [-1.0], [0.0], [2.0, 1.0], [1.0, 1.0], [1.0, math.nan], [1.0, math.inf])),
        ({"radii_mm": np.linspace(1, 2, 100_001)}, "radii_mm"),
        ({"incidence": "sideways"}, "incidence"),
        ({"solver": "guess"}, "solver"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("solver", SOLVERS)
def test_no_argument_that_cannot_be(solver, arguments, name):
    """NaN, infinities and nonsense in every other argument: a ValueError that names the argument."""
    with pytest.raises(ValueError, match=name):
        core.solve(STACK, **({"solver": solver} | arguments))


@pytest.mark.parametrize("count", [0, 9, 1000])
def test_no_stack_without_layers_or_with_too_many(count):
    """1 to 8 layers."""
    with pytest.raises(ValueError, match="layers"):
        core.solve(np.repeat(STACK, count, axis=0))


@pytest.mark.parametrize("solver", SOLVERS)
def test_effort_beyond_reason(solver):
    """The largest numbers that the other arguments take do not overflow anything: a stack is solved in a second."""
    for effort in ({"max_seconds": math.inf}, {"max_seconds": 1e308}, {"max_photons": 2**64 - 1}, {"seed": 2**64 - 1},
                   {"threads": 2**31 - 1}):
        ask(STACK, solver, **({"tolerance": 0.05} | effort)) if "threads" not in effort else core.solve(
            STACK, solver="auto", tolerance=0.05, **effort
        )


@pytest.mark.parametrize("solver", SOLVERS)
def test_smallest_effort(solver):
    """One photon, a nanosecond, a tolerance of 1e-300: an answer with its error, or a reason."""
    for effort in ({"max_photons": 1}, {"max_seconds": 1e-9}, {"max_seconds": 5e-324}, {"tolerance": 1e-300}):
        for radii in (None, RADII):
            outcome = ask(STACK, solver, radii_mm=radii, **effort)
            if outcome and outcome["solver"] == "monte-carlo" and outcome.error > 0.01:
                assert outcome.warnings


@pytest.mark.parametrize("solver", SOLVERS)
def test_radii_at_the_ends_of_the_numbers(solver):
    """From the smallest to the largest double, and as many as are allowed."""
    for stack in (STACK, [(0.1, 10.0, 0.5, 1.4, math.inf)], [(0.01, 0.0, 0.0, 1.5, 1.0)]):
        for radii in ([5e-324], [1e-300, 1e300], [1.7e308], [1.0, 1.0 + 2**-52], [1e-3, 1.0, 1e3]):
            ask(stack, solver, radii_mm=radii, max_photons=1024)
    many = np.geomspace(1e-3, 1e3, 100_000)
    start = time.process_time()
    ask(STACK, solver, radii_mm=many, max_photons=1024)
    assert time.process_time() - start < 10


# --- time


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_time_is_bounded(case):
    """Every hard case: `auto` at 0.01 without radii in 3 s of CPU; Monte Carlo within 2 s of the 0.3 s that it may take
    on two threads."""
    start = time.process_time()
    ask(case.stack, "auto", case.incidence)
    assert time.process_time() - start < 3
    start = time.process_time()
    ask(case.stack, "monte-carlo", case.incidence, RADII, tolerance=1e-6, max_seconds=0.3, max_photons=2**62, threads=2)
    assert time.process_time() - start < 2 * 0.3 + 2


def test_cancelling_stops_every_solver():
    """A progress that says no ends Monte Carlo on a stack that would take hours, within 2 s."""
    start = time.process_time()
    with pytest.raises(core.Cancelled):
        core.solve(
            np.array([(0.0, 1e4, 0.0, 1.4, 100.0)]), solver="monte-carlo", tolerance=1e-9, threads=1,
            progress=lambda done, total: False,
        )  # fmt: skip
    assert time.process_time() - start < 2


# --- threads, seeds


@extremes.examples(15)
@given(extremes.stacks(most=4), st.sampled_from(INCIDENCES), st.integers(0, 2**64 - 1))
def test_the_same_on_one_and_two_threads(stack, incidence, seed):
    """Monte Carlo and `auto`, totals and profiles, bit by bit, unless the clock stopped them, which they say."""
    for solver in ("monte-carlo", "auto"):
        one, two = (
            ask(stack, solver, incidence, RADII, seed=seed, max_photons=1024, max_seconds=2, threads=n) for n in (1, 2)
        )
        if any("clock" in w for w in (*one.warnings, *two.warnings)):
            continue
        assert bool(one) == bool(two) and one.reason == two.reason
        if one:
            for key, value in one.answer.items():
                if key != "elapsed_ms":
                    assert np.array_equal(value, two[key]), key


# --- more absorption, less light


@extremes.examples(60)
@given(extremes.stacks(), st.sampled_from(INCIDENCES), st.integers(0, 7), extremes.coefficients())
def test_more_absorption_less_light(stack, incidence, layer, more):
    """Adding mu_a to any layer of any stack does not raise what comes back or goes through: within twice the larger of
    1e-4, to which adding-doubling works, and the error that it states, and 1e-12 (rounding of shares next to 1)."""
    layer %= len(stack)
    darker = list(stack)
    darker[layer] = (min(stack[layer][0] + more, 1e7), *stack[layer][1:])
    bright, dark = ask(stack, "adding-doubling", incidence), ask(darker, "adding-doubling", incidence)
    assume(bright and dark)
    tolerance = 2 * max(1e-4, bright.error, dark.error)
    assert dark.R <= bright.R * (1 + tolerance) + 1e-12
    assert dark.Tt <= bright.Tt * (1 + tolerance) + 1e-12


@extremes.examples(12)
@given(extremes.moderate_stacks(half_spaces=True), st.sampled_from(INCIDENCES), st.floats(1.01, 3))
def test_more_absorption_less_light_by_monte_carlo(stack, incidence, factor):
    """The same by Monte Carlo on moderate stacks, within the sum of both runs' stated errors, three standard errors."""
    darker = [(mu_a * factor + 0.01, *rest) for mu_a, *rest in stack]
    bright, dark = (ask(s, "monte-carlo", incidence, max_photons=20000) for s in (stack, darker))
    margin = (bright.error + dark.error) * max(bright.R, 1e-3)
    assert dark.R <= bright.R + margin
    assert dark.Tt <= bright.Tt + (bright.error + dark.error) * max(bright.Tt, 1e-3)


@pytest.mark.parametrize("solver", SOLVERS)
def test_darkening_from_nothing_to_all(solver):
    """mu_a from 0 over denormals to 1e6 per mm in each layer of a skin: R never grows by more than twice the larger of
    1e-4 of itself and the error stated on either side (Monte Carlo: three standard errors; the multipole, whose own mistakes are not
    monotone where its source lies below the epidermis: its measured error)."""
    grid = [0.0, 5e-324, 1e-300, *np.geomspace(1e-12, 1e6, extremes.finer(19))]
    for changed in (0, 1):
        last, last_error = math.inf, 0.0
        for mu_a in grid:
            stack = [(0.5, 30.0, 0.8, 1.4, 0.1), (0.05, 15.0, 0.8, 1.4, math.inf)]
            stack[changed] = (mu_a, *stack[changed][1:])
            outcome = ask(stack, solver, "diffuse", max_photons=2048)
            if not outcome:
                continue
            margin = 2 * max(1e-4 * outcome.R, max(outcome.error, last_error) * max(outcome.R, 1e-3))
            assert outcome.R <= last + margin, (changed, mu_a)
            last, last_error = outcome.R, outcome.error


# --- borders: where auto changes its mind


def chosen(stack, incidence, **effort):
    outcome = ask(stack, "auto", incidence, **effort)
    return outcome, outcome["solver"]


def path(name):
    """A walk through the space of stacks, 0 to 1, that leaves the domain of the skin table (g 0.8, n 1.4, dermis
    scattering half as much) or passes the ends of its ranges."""
    epidermis, dermis = (1.0, 30.0, 0.8, 1.4, 0.1), (0.15, 15.0, 0.8, 1.4, math.inf)

    def stack(t):
        a, b = list(epidermis), list(dermis)
        scale = 10 ** (8 * t - 4)
        if name == "epidermis absorption":
            a[0] *= scale
        elif name == "dermis absorption":
            b[0] *= scale
        elif name == "both absorptions":
            a[0], b[0] = a[0] * scale, b[0] * scale
        elif name == "thickness":
            a[4] *= scale
        elif name == "scattering":
            a[1], b[1] = a[1] * scale, b[1] * scale
        elif name == "ratio of scattering":
            b[1] *= 10 ** (t - 0.5)
        elif name == "g":
            a[2] = b[2] = 0.8 + 0.02 * (t - 0.5)
        elif name == "n":
            a[3] = b[3] = 1.4 + 0.02 * (t - 0.5)
        elif name == "depth of the dermis":
            b[4] = 10 ** (8 * t - 3)
        return [tuple(a), tuple(b)]

    return stack


PATHS = ["epidermis absorption", "dermis absorption", "both absorptions", "thickness", "scattering",
         "ratio of scattering", "g", "n", "depth of the dermis"]  # fmt: skip


@pytest.mark.parametrize("incidence", INCIDENCES)
@pytest.mark.parametrize("name", PATHS)
def test_no_jump_where_auto_changes_its_mind(name, incidence):
    """Walks out of the skin table's domain, along nine paths; every border between solvers is found by bisection to
    1e-12 of the walk, and the answers on its two sides differ by no more than the tolerance asked for, 0.01 (each side is
    within it of the truth by its own error; both errors together bound the step more tightly, and that is asserted)."""
    stack = path(name)
    places = np.linspace(0, 1, extremes.finer(60))
    previous = None
    for t in places:
        outcome, solver = chosen(stack(t), incidence)
        if previous and previous[1] != solver:
            low, high, low_solver = previous[0], t, previous[1]
            while high - low > 1e-12 and 0.5 * (low + high) not in (low, high):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if chosen(stack(middle), incidence)[1] == low_solver else (low, middle)
            a, b = chosen(stack(low), incidence)[0], chosen(stack(high), incidence)[0]
            margin = min(0.01, a.error + b.error)
            assert same_within(a["Rd"], b["Rd"], margin, 1e-6), (name, low, a.answer, b.answer)
            assert same_within(a.Tt, b.Tt, margin, 1e-6), (name, low, a.answer, b.answer)
        previous = (t, solver)


@pytest.mark.parametrize("name", PATHS)
def test_a_smooth_walk_is_smooth(name):
    """Along the same paths no two neighbouring steps of a fine walk bend by more than 0.01 of R, the tolerance: the
    middle one of three answers lies within it of the line between the others, wherever the steps are small enough that
    R itself moves by less than 2 % from one to the next."""
    stack = path(name)
    R = np.array([ask(stack(t), "auto", "diffuse").R for t in np.linspace(0, 1, extremes.finer(300))])
    slow = (np.abs(np.diff(R)) < 0.02 * R[1:])[1:] & (np.abs(np.diff(R)) < 0.02 * R[1:])[:-1]
    bend = np.abs(R[1:-1] - 0.5 * (R[:-2] + R[2:]))
    assert (bend <= 0.01 * R[1:-1] + 1e-6)[slow].all()


@pytest.mark.parametrize("incidence", INCIDENCES)
def test_profiles_agree_across_the_border_of_the_skin_table(incidence):
    """R(r) just inside and just outside of the table's domain (g moved by 1e-3): the light in rings differs by less than
    4 % in the L1 norm, what the issue asks of `auto` on skin, counted from both sides as 0.06 with Monte Carlo's noise."""
    radii = np.geomspace(0.01, 10, 40)
    area = np.pi * radii**2 * 2 * math.log(radii[1] / radii[0])
    inside = [(1.0, 30.0, 0.8, 1.4, 0.1), (0.15, 15.0, 0.8, 1.4, math.inf)]
    outside = [(mu_a, mu_s * 0.2 / 0.201, 0.799, n, d) for mu_a, mu_s, _, n, d in inside]
    a, b = (ask(s, "auto", incidence, radii, max_seconds=5, max_photons=2**22, tolerance=0.01) for s in (inside, outside))
    profile_a, profile_b = np.array(a["R_per_mm2"]), np.array(b["R_per_mm2"])
    assert (np.abs(profile_a - profile_b) * area).sum() <= 0.06 * (profile_a * area).sum()
    assert same_within(a["Rd"], b["Rd"], 0.02)
