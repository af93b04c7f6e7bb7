"""The `solve` use-case: what becomes of light in a stack of layers."""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal

import numpy as np
import pydantic
import sanguine_core

from ..domain.errors import InputError, nearest
from ..domain.files import read_json, validate

# Where the profile is given if nobody says where: rings a factor 1.21 apart, from inside the nearest scattering to
# beyond where any skin sends light.
DEFAULT_RADII_MM = np.geomspace(0.011, 18.2, 40)

MAX_CASES = 100_000

# Radii of all cases together: the answer is held in memory until it is written, about 100 bytes for each.
MAX_RADII = 20_000_000


class _Layer(pydantic.BaseModel):
    model_config = pydantic.ConfigDict(extra="forbid", frozen=True, strict=True)

    mu_a: float
    mu_s: float
    g: float
    n: float
    thickness: float | None


class Case(pydantic.BaseModel):
    """One stack. Ranges are the core's to check: a case out of them gets an `error`, and the others an answer."""

    # Reference sets carry notes beside each case; `read_cases` says which keys it does not read.
    model_config = pydantic.ConfigDict(extra="allow", frozen=True, strict=True)

    id: str
    incidence: Literal["normal", "diffuse"] = "normal"
    layers: list[_Layer]
    radii_mm: list[float] | None = None

    @property
    def unread(self) -> list[str]:
        return list(self.model_extra or ())


class _Cases(pydantic.BaseModel):
    cases: Annotated[list[Case], pydantic.Field(max_length=MAX_CASES)]


def read_cases(path: str | os.PathLike[str]) -> list[Case]:
    """The cases of a CASES.json. Raises InputError for a file that is not one."""
    data = read_json(path)
    if isinstance(data, dict) and isinstance(data.get("cases"), list):
        for i, case in enumerate(data["cases"]):
            if isinstance(case, dict):
                case.setdefault("id", str(i))
    cases = validate(_Cases, data, path).cases
    known = list(Case.model_fields)
    for i, case in enumerate(cases):
        for key in case.unread:
            # A slip of the keyboard is an error; a note of somebody else's is not.
            if difflib.get_close_matches(key, known, cutoff=0.75):
                raise InputError(f"{path}: cases.{i}.{key}: unknown key, {nearest(key, known)}")
    return cases


def check_solver(name: str) -> None:
    """Raises InputError naming the nearest solver."""
    known = [row["id"] for row in sanguine_core.solvers()]
    if name not in known:
        raise InputError(f"--solver: no solver '{name}', {nearest(name, known)}")


def answer(
    cases: Sequence[Case],
    solver: str,
    tolerance: float,
    radii_mm: Sequence[float] | None,
    max_seconds: float,
    progress: Callable[[str, int, int], None],
) -> dict[str, Any]:
    """The answer of `sanguine solve`.

    `radii_mm` holds for the cases without radii of their own; None is DEFAULT_RADII_MM, an empty list totals alone.
    A case that cannot be solved has `error` set and no numbers, and the others are still answered.
    """
    if radii_mm is None:
        # Nobody asked: a solver without profiles is not blamed for it.
        radii_mm = [] if solver == "adding-doubling" else DEFAULT_RADII_MM
    asked_mm = [radii_mm if case.radii_mm is None else case.radii_mm for case in cases]
    if (total := sum(map(len, asked_mm))) > MAX_RADII:
        raise InputError(f"{total} radii in {len(cases)} cases, at most {MAX_RADII} are allowed: solve fewer at once")
    results = []
    for i, (case, asked) in enumerate(zip(cases, asked_mm)):
        progress(f"solve {case.id}", i, len(cases))
        results.append(_result(case, solver, tolerance, np.asarray(asked, dtype=np.float64), max_seconds))
    progress("solved", len(cases), len(cases))
    return {"sanguine": sanguine_core.__version__, "results": results}


def _result(case: Case, solver: str, tolerance: float, radii_mm: np.ndarray, max_seconds: float) -> dict[str, Any]:
    layers = np.array(
        [[x.mu_a, x.mu_s, x.g, x.n, math.inf if x.thickness is None else x.thickness] for x in case.layers],
        dtype=np.float64,
    ).reshape(-1, 5)
    unread = [f"{key}: not a key of a case, not read" for key in case.unread]
    try:
        s = sanguine_core.solve(
            layers, case.incidence, radii_mm, solver=solver, tolerance=tolerance, max_seconds=max_seconds
        )
    except (ValueError, sanguine_core.SolverError) as error:
        return {
            "id": case.id, "solver": solver, "Rd": None, "R_unscattered": None, "Tt": None, "specular": None,
            "r_mm": [], "R_per_mm2": [], "T_per_mm2": None, "error_estimate": None, "elapsed_ms": None,
            "because": "", "warnings": unread, "error": str(error),
        }  # fmt: skip
    profile, bottom = s["R_per_mm2"], s["T_per_mm2"]
    return {
        "id": case.id,
        "solver": s["solver"],
        "Rd": s["Rd"],
        "R_unscattered": s["R_unscattered"],
        "Tt": s["Tt"],
        "specular": s["specular"],
        "r_mm": [] if profile is None else radii_mm.tolist(),
        "R_per_mm2": [] if profile is None else profile.tolist(),
        "T_per_mm2": None if bottom is None else bottom.tolist(),
        "error_estimate": s["error_estimate"],
        "elapsed_ms": s["elapsed_ms"],
        "because": s["because"],
        "warnings": [*unread, *s["warnings"]],
        "error": None,
    }
