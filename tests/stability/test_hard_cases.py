"""The hard cases of docs/stability.md: what the classical method, its guarded rung, Monte Carlo and `auto` say."""

import math

import numpy as np
import pytest
from stability import classical
from stability.extremes import ask
from stability.hard_cases import CASES, REFUSED
from stability.page import SEEN, Row, share

RADII = np.geomspace(0.01, 10, 20)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_auto_is_right_where_others_break(case):
    """Each row of the table above: `auto` at a tolerance of 0.01 has an answer; it agrees with Monte Carlo of another seed
    within four standard errors and its own error, Rd and Tt (shares below 0.001 count as that); the multipole either
    refuses, or errs from `auto` by no more than it says and the 0.01 that `auto` may."""
    ours = ask(case.stack, "auto", case.incidence, max_seconds=5)
    assert ours, ours.reason

    photons = ask(case.stack, "monte-carlo", case.incidence, seed=7, tolerance=1e-9, max_photons=case.photons, max_seconds=5)
    if photons:
        for key in ("Rd", "Tt"):
            margin = 4 / 3 * photons.error * max(photons[key], 1e-3) + ours.error * max(ours[key], 1e-3) + 1e-9
            assert abs(ours[key] - photons[key]) <= margin, (key, ours.answer, photons.answer)

    multipole = ask(case.stack, "multipole", case.incidence)
    if multipole:
        assert abs(multipole["Rd"] - ours["Rd"]) <= (1.01 * multipole.error + 0.01) * max(ours["Rd"], 1e-9)

    R, T, negative = classical.solve(case.stack)
    half_space = math.isinf(case.stack[-1][4])
    SEEN.rows.append(
        Row(
            case.id,
            case.why,
            f"{share(R)}" + ("" if half_space else f" / {share(T)}")
            + (f", **{100 * negative:.0f} %**" if negative > 5e-3 else ""),
            pair(multipole, half_space) + f" ± {100 * multipole.error:.2g} %" if multipole
            else multipole.reason.removeprefix("multipole: ").split(";")[0],
            pair(photons, half_space) + f" ± {100 * photons.error:.2g} %" if photons else photons.reason,
            pair(ours, half_space),
            ours["solver"],
            f"{100 * ours.error:.1g} %",
            ours["elapsed_ms"],
        )
    )  # fmt: skip


def pair(outcome, half_space):
    return share(outcome["Rd"]) + ("" if half_space else f" / {share(outcome['Tt'])}")


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_profiles_of_the_hard_cases(case):
    """R(r) and T(r) of every hard case by every solver that has one: finite, not negative, and their light within the
    widest radius is no more than the total: the rings' sum at most 1.1 of it (a sum over 20 rings of a curve)."""
    area = 2 * math.pi * RADII**2 * math.log(RADII[1] / RADII[0])
    for solver in ("auto", "monte-carlo", "multipole"):
        outcome = ask(case.stack, solver, case.incidence, RADII, max_seconds=0.3, max_photons=4096)
        if outcome and outcome["R_per_mm2"] is not None:
            held = float((np.array(outcome["R_per_mm2"]) * area).sum())
            assert held <= 1.1 * outcome["Rd"] + 1e-9, (solver, held, outcome["Rd"])


@pytest.mark.parametrize(("name", "stack"), REFUSED, ids=[name for name, _ in REFUSED])
def test_what_is_no_stack_is_refused(name, stack):
    """With one line that names layer, key, value and what is allowed."""
    outcome = ask(stack)
    assert not outcome and outcome.reason.startswith("layers.0.") and " is not " in outcome.reason
    SEEN.refusals.append((name, outcome.reason))
