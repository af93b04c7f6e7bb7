"""Stacks and skins at the edge of what is allowed, and what every answer about them has to be."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import sanguine_core as core
from hypothesis import HealthCheck, assume, settings
from hypothesis import strategies as st

SOAK = 0
"""How many times the quick run's examples, 0 for the quick run. Set by conftest.py before a test module is imported."""

Layer = tuple[float, float, float, float, float]
"""mu_a [1/mm], mu_s [1/mm], g, n, thickness [mm]"""

NANOMETRE, METRE = 1e-6, 1e3
"""in mm"""

ENERGY = 1e-9
"""By how much the shares of an answer may add up to more than 1: rounding in sums of some thousand terms."""


def examples(quick: int) -> settings:
    """Hypothesis' effort: the same `quick` examples every time, or many times as many new ones."""
    return settings(
        max_examples=quick * max(1, SOAK),
        derandomize=not SOAK,
        database=None,
        deadline=None,  # the tests state and assert their own
        print_blob=True,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much],
    )


def finer(quick: int) -> int:
    """Points of a grid's axis."""
    return 3 * quick if SOAK else quick


# --- what is asked


def magnitudes(low: float, high: float) -> st.SearchStrategy[float]:
    """Evenly in the logarithm, as physical scales are."""
    return st.floats(math.log10(low), math.log10(high)).map(lambda x: min(max(10.0**x, low), high))


def coefficients() -> st.SearchStrategy[float]:
    """mu_a or mu_s: exactly 0, denormal, ordinary, extreme."""
    return st.one_of(
        st.sampled_from([0.0, 5e-324, 1e-310, 2.3e-308, 1e-200, 1e-30, 1.0, 1e6]),
        magnitudes(1e-12, 1e6),
        magnitudes(1e-3, 1e3),
    )


def anisotropies() -> st.SearchStrategy[float]:
    return st.one_of(st.sampled_from([-0.99, -1e-300, 0.0, 1e-9, 0.8, 0.999]), st.floats(-0.99, 0.999))


def indices() -> st.SearchStrategy[float]:
    return st.one_of(
        st.sampled_from([1.0, 1 + 2**-52, 1 + 1e-9, 1.0001, 1.33, 1.4, 1.4 + 1e-12, 3.0]), st.floats(1.0, 3.0)
    )


def thicknesses() -> st.SearchStrategy[float]:
    return st.one_of(st.sampled_from([NANOMETRE, 0.1, METRE]), magnitudes(NANOMETRE, METRE))


def layers(thickness: st.SearchStrategy[float] | None = None) -> st.SearchStrategy[Layer]:
    return st.tuples(
        coefficients(), coefficients(), anisotropies(), indices(), thicknesses() if thickness is None else thickness
    )


@st.composite
def stacks(draw, most: int = 8, half_spaces: bool = True) -> tuple[Layer, ...]:
    """1 to `most` layers; the last may have no bottom."""
    above = draw(st.lists(layers(), max_size=most - 1))
    last = draw(layers(st.one_of(thicknesses(), st.just(math.inf)) if half_spaces else None))
    return (*above, last)


def moderate_stacks(most: int = 3, half_spaces: bool = False) -> st.SearchStrategy[tuple[Layer, ...]]:
    """Stacks that some light gets through: where a wrong digit would show."""
    layer = st.tuples(
        st.one_of(st.just(0.0), magnitudes(1e-3, 3)), st.one_of(st.just(0.0), magnitudes(1e-2, 30)),
        st.floats(-0.9, 0.95), st.floats(1.0, 2.0), magnitudes(1e-2, 3),
    )  # fmt: skip
    finite = st.lists(layer, min_size=1, max_size=most)
    if not half_spaces:
        return finite.map(tuple)
    return st.tuples(finite, st.booleans()).map(
        lambda pair: (*pair[0][:-1], (*pair[0][-1][:4], math.inf if pair[1] else pair[0][-1][4]))
    )


@st.composite
def skin_stacks(draw) -> tuple[Layer, ...]:
    """What the skin table holds, and a little beyond: two layers of n 1.4 and g 0.8 (sometimes nearly), or the dermis
    alone."""
    mu_s = draw(magnitudes(1.0, 200.0))
    g = draw(st.sampled_from([0.8, 0.8, 0.8, 0.799, 0.8019]))
    n = draw(st.sampled_from([1.4, 1.4, 1.4, 1.3995, 1.4009]))
    scattering = mu_s * (1 - g)
    ratio = draw(st.sampled_from([0.5, 0.5, 0.495, 0.2, 1.0, 3.0]))
    epidermis = (draw(magnitudes(1e-5, 1e5)) * scattering, mu_s, g, n, draw(magnitudes(1e-6, 1e3)) / scattering)
    dermis = (draw(magnitudes(1e-5, 1e5)) * scattering * ratio, mu_s * ratio, g, n, math.inf)
    assume(epidermis[0] <= 1e6 and dermis[0] <= 1e6)
    return (dermis,) if draw(st.integers(0, 4)) == 0 else (epidermis, dermis)


INCIDENCES = ("normal", "diffuse")


# --- what comes back


@dataclass
class Outcome:
    """An answer, or the reason why there is none."""

    answer: dict | None
    reason: str
    cpu_seconds: float
    warnings: list[str] = field(default_factory=list)

    def __bool__(self) -> bool:
        return self.answer is not None

    def __getitem__(self, key: str):
        return self.answer[key]

    @property
    def R(self) -> float:
        """All that comes back but the first surface's reflection."""
        return self.answer["Rd"] + self.answer["R_unscattered"]

    @property
    def Tt(self) -> float:
        return self.answer["Tt"]

    @property
    def error(self) -> float:
        return self.answer["error_estimate"]


def ask(
    stack: Sequence[Layer],
    solver: str = "auto",
    incidence: str = "normal",
    radii_mm: Sequence[float] | None = None,
    **effort,
) -> Outcome:
    """Solves and checks what every answer has to be: finite, not negative, no energy from nothing, or a reason."""
    effort = {"tolerance": 0.01, "max_seconds": 0.5, "max_photons": 4096, "threads": 1} | effort
    radii = None if radii_mm is None else np.asarray(radii_mm, dtype=float)
    start = time.process_time()
    try:
        answer = core.solve(np.array(stack, dtype=float).reshape(-1, 5), incidence, radii, solver, **effort)
    except (core.SolverError, ValueError) as error:
        seconds = time.process_time() - start
        check_reason(str(error))
        check_time(seconds, effort)
        return Outcome(None, str(error), seconds)
    seconds = time.process_time() - start
    check_answer(answer, radii_mm, math.isinf(stack[-1][4]))
    check_time(seconds, effort)
    return Outcome(answer, "", seconds, answer["warnings"])


def check_reason(text: str) -> None:
    assert "\n" not in text and len(text) > 15, f"not a reason: {text!r}"
    assert ":" in text, f"names neither key nor solver: {text!r}"


def check_time(seconds: float, effort: dict) -> None:
    """A solver stops soon after `max_seconds`; those that cannot stop take some seconds at most.

    CPU time, which a busy machine does not change. 3 s: adding-doubling with 64 streams in eight layers that double
    forty times each is some 10 GFLOP.
    """
    assert seconds <= effort["max_seconds"] * effort["threads"] + 3, f"took {seconds:.1f} s of CPU"


def check_answer(answer: dict, radii_mm: Sequence[float] | None, half_space: bool) -> None:
    shares = [answer[key] for key in ("Rd", "R_unscattered", "Tt", "specular")]
    assert all(math.isfinite(s) and s >= 0 for s in shares), answer
    assert sum(shares) <= 1 + ENERGY, answer
    assert answer["error_estimate"] >= 0 and math.isfinite(answer["error_estimate"]), answer
    if half_space:
        assert answer["Tt"] == 0, answer
    if radii_mm is None:
        return
    for key, total in (("R_per_mm2", answer["Rd"]), ("T_per_mm2", answer["Tt"])):
        profile = answer[key]
        if profile is None:  # adding-doubling knows none, a half-space has no bottom
            continue
        assert profile.shape == (len(radii_mm),), key
        assert np.isfinite(profile).all() and (profile >= 0).all(), (key, profile)


def refused_by_design(outcome: Outcome) -> bool:
    """The multipole says where diffusion ends; no other solver may."""
    return not outcome and outcome.reason.startswith("multipole")


def same_within(a: float, b: float, relative: float, absolute: float = 0.0) -> bool:
    return abs(a - b) <= relative * max(abs(a), abs(b)) + absolute
