"""The price of accuracy of the optics: error and time of every solver at every setting, in one run.

    .venv/bin/sanguine bench accuracy [--quick] [--out DIR]

Writes accuracy.json and accuracy.md into DIR (bench/results), and in full the plot and the tables of docs/accuracy.md.
What is measured against, and why it can be believed, is in accuracy_truth.py. Times are CPU seconds of one thread,
which on an idle machine are the seconds that pass and on a busy one do not count the others' work; the median of
several repeats, calls from Python included. Every ratio is of two times of the same run.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import re
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from statistics import median
from typing import Any

# One thread for NumPy, here and in what is started from here, before it is loaded.
os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")

import accuracy_report as report
import numpy as np
import sanguine_core
from accuracy_truth import Case, Colours, SkinTotals, reference_cases
from sanguine.domain.lut import entry_skins
from sanguine.domain.parameters import PARAMETERS, default_skin, skin_rows
from sanguine.domain.plan import Axis, spaced

ROOT = Path(__file__).resolve().parents[1]

# Fits to the mean faces of ISSA's six classes (docs/optics.md), the lightest of them flushed, a thin epidermis.
SKINS = {
    "very light": {"melanin": 0.0097, "hemoglobin": 0.0096},
    "light": {"melanin": 0.014, "hemoglobin": 0.011},
    "intermediate": {"melanin": 0.026, "hemoglobin": 0.0083},
    "tan": {"melanin": 0.033, "hemoglobin": 0.0123},
    "brown": {"melanin": 0.064, "hemoglobin": 0.0076},
    "dark": {"melanin": 0.134, "hemoglobin": 0.020},
    "flushed": {"melanin": 0.0097, "hemoglobin": 0.06, "oxygenation": 0.95},
    "thin": {"melanin": 0.019, "hemoglobin": 0.0077, "oxygenation": 0.9, "epidermis_thickness_mm": 0.05},
}
COMMON = {"melanin_blend": 0.74, "oxygenation": 0.72, "epidermis_thickness_mm": 0.1}

GROUPS = {"skin": "skin", "skin-diffuse": "skin", "skin-opaque": "opaque epidermis", "semi-infinite": "half-space",
          "low-albedo": "half-space"}  # every other class is a slab
G = 0.8  # skin's anisotropy, which the path tables fix
TEN_NM = np.arange(380.0, 781.0, 10.0)


def timed(work: Callable[[], Any], budget_s: float = 0.15, threads: int = 1) -> tuple[Any, float, int]:
    """What the work returns, its time in seconds, and the repeats: as many as the budget allows, 200 at most.

    The time is the median of CPU times: a virtual machine's clock now and then loses some, so the shortest may be
    wrong. Of several threads it is the shortest time that passed, which others' work disturbs least.
    """
    clock, choose = (time.process_time, median) if threads == 1 else (time.perf_counter, min)
    times: list[float] = []
    while not times or (sum(times) + times[-1] < budget_s and len(times) < 200):
        start = clock()
        answer = work()
        times.append(clock() - start)
    return answer, choose(times), len(times)


def rms(values: Iterable[float]) -> float:
    return float(np.sqrt(np.mean(np.square(list(values)))))


# --- the ladder over the reference cases ---


def ladder(cases: list[Case], quick: bool, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """One row per case, solver and setting. Errors are relative and signed, `profile_error` the L1 of R(r)."""
    rows = []
    for case in cases:
        say(f"ladder: {case.id} {case.kind}")
        rows += _by_solve(case, "skin", {}, quick)
        rows += _by_solve(case, "multipole", {}, quick)
        rows += [_multipole(case, terms) for terms in ((1, 20, -1) if quick else (1, 2, 3, 5, 10, 20, -1))]
        rows += [_adding_doubling(case, n) for n in ((8, 16) if quick else (4, 6, 8, 12, 16, 24, 32, 48))]
        rows += _monte_carlo(case, (1e3, 1e4) if quick else (1e3, 1e4, 1e5, 1e6, 1e7), budget_s=0.5 if quick else 12)
        for tolerance in (0.1, 0.01) if quick else (0.1, 0.03, 0.01, 0.003, 0.001):
            rows += _by_solve(case, "auto", {"tolerance": tolerance, "max_seconds": 0.5 if quick else 8}, quick)
    return rows


def _row(case: Case, solver: str, setting: str, **values: Any) -> dict[str, Any]:
    keys = (
        "Rd_error", "Tt_error", "against_second", "profile_error", "bar_error", "claimed_error",
        "profile_claimed_error", "seconds", "profile_seconds", "picked", "profile_picked", "refused", "warning",
    )  # fmt: skip
    group = GROUPS.get(case.kind, "slab")
    return {"case": case.id, "group": group, "solver": solver, "setting": setting} | dict.fromkeys(keys) | values


def _by_solve(case: Case, solver: str, effort: dict[str, float], quick: bool) -> list[dict[str, Any]]:
    """As a user would call it: totals alone, then totals with the profile."""
    setting = f"tolerance {effort['tolerance']:g}" if effort else "as it comes"

    def call(radii_mm: np.ndarray | None) -> tuple[dict[str, Any], float, int]:
        return timed(
            lambda: sanguine_core.solve(case.layers, case.incidence, radii_mm, solver=solver, threads=1, **effort)
        )

    values: dict[str, Any] = {}
    try:
        answer, values["seconds"], _ = call(None)
        values |= {"Rd_error": case.Rd_error(answer["Rd"]), "Tt_error": case.Tt_error(answer["Tt"]),
                   "claimed_error": answer["error_estimate"], "picked": answer["solver"]}  # fmt: skip
        if not (quick and solver == "auto"):
            answer, values["profile_seconds"], _ = call(case.radii_mm)
            values["profile_error"] = case.profile_error(answer["R_per_mm2"])
            values["bar_error"] = case.bar_error(answer["R_per_mm2"])
            values["profile_claimed_error"] = answer["error_estimate"]
            values["profile_picked"] = answer["solver"]
        values["warning"] = "; ".join(answer["warnings"]) or None
    except sanguine_core.SolverError as error:
        values["refused"] = str(error)
    return [_row(case, solver, setting, **values)]


def _multipole(case: Case, terms: int) -> dict[str, Any]:
    """As the papers have it, with nothing refused."""
    entering = 1 - case.specular
    total, seconds, _ = timed(lambda: sanguine_core.multipole(case.layers, None, terms))
    whole, profile_seconds, _ = timed(lambda: sanguine_core.multipole(case.layers, case.radii_mm, terms))
    profile = entering * whole["R_per_mm2"]
    negative = total["R"] < 0 or total["T"] < 0 or bool(np.any(profile < -1e-12 * np.abs(profile).max()))
    return _row(
        case, "multipole", f"N = {terms}" if terms >= 0 else "closed form", seconds=seconds,
        profile_seconds=profile_seconds, Rd_error=case.Rd_error(entering * total["R"]),
        Tt_error=case.Tt_error(entering * total["T"]), profile_error=case.profile_error(profile),
        warning="negative light" if negative else None,
    )  # fmt: skip


def _adding_doubling(case: Case, streams: int) -> dict[str, Any]:
    try:
        answer, seconds, _ = timed(lambda: sanguine_core.adding_doubling(case.layers, case.incidence, streams))
    except sanguine_core.SolverError as error:
        return _row(case, "adding-doubling", f"{streams} streams", refused=str(error))
    return _row(case, "adding-doubling", f"{streams} streams", seconds=seconds, Rd_error=case.Rd_error(answer["Rd"]),
                Tt_error=case.Tt_error(answer["Tt"]),
                against_second=(answer["Rd"] + answer["R_unscattered"]) / case.total - 1)  # fmt: skip


def photons_through(
    layers: np.ndarray, incidence: str, radii_mm: np.ndarray | None, photons: int, seed: int
) -> dict[str, Any]:
    """Monte Carlo with so many photons, whatever its error."""
    return sanguine_core.solve(layers, incidence, radii_mm, solver="monte-carlo", tolerance=1e-12, max_seconds=1e6,
                               max_photons=photons, seed=seed, threads=1)  # fmt: skip


def _monte_carlo(case: Case, counts: Iterable[float], budget_s: float) -> list[dict[str, Any]]:
    """Errors are root mean squares over seeds: one run's error says little. What would take too long is left out."""
    rows: list[dict[str, Any]] = []
    for photons in counts:
        if rows and 10 * rows[-1]["profile_seconds"] > budget_s:
            break
        times, Rd, Tt, profile, claimed = [], [], [], [], []
        for seed in range(1, max(1, min(16, int(2e5 / photons))) + 1):
            start = time.process_time()
            answer = photons_through(case.layers, case.incidence, case.radii_mm, int(photons), seed)
            times.append(time.process_time() - start)
            Rd.append(case.Rd_error(answer["Rd"]))
            Tt.append(case.Tt_error(answer["Tt"]))
            profile.append(case.profile_error(answer["R_per_mm2"]))
            claimed.append(answer["error_estimate"])
        rows.append(
            _row(case, "monte-carlo", f"{photons:.0e} photons".replace("e+0", "e"), seconds=median(times),
                 profile_seconds=median(times), Rd_error=rms(Rd), Tt_error=None if Tt[0] is None else rms(Tt),
                 profile_error=rms(profile), claimed_error=rms(claimed), seeds=len(times))  # fmt: skip
        )
    return rows


# --- the colour of skin ---


class SkinTruth:
    """Reflectance of the skins under diffuse light by iadpython, and their colours."""

    def __init__(self, names: list[str], totals: SkinTotals, step_nm: float):
        self.names = names
        self.rows = skin_rows([default_skin() | COMMON | SKINS[name] for name in names])
        self.colours = Colours(step_nm)
        both = np.array(
            [[totals.reflectance(x, "diffuse") for x in stacks] for stacks in self.stacks(self.colours.grid_nm)]
        )
        self.reflectance, self.steps = both[..., 0], both[..., 1]
        self.lab = self.colours.lab(self.reflectance, self.colours.grid_nm)

    def stacks(self, wavelengths_nm: np.ndarray) -> list[list[np.ndarray]]:
        """[skin][wavelength] layers as the general solvers take them."""
        c = sanguine_core.optical_coefficients(self.rows, wavelengths_nm)
        layers = np.empty((*c["mu_a_dermis_per_mm"].shape, 2, 5))
        for k, layer in enumerate(("epidermis", "dermis")):
            layers[..., k, 0] = c[f"mu_a_{layer}_per_mm"]
            layers[..., k, 1] = c[f"mu_s_prime_{layer}_per_mm"] / (1 - G)
        layers[..., 2], layers[..., 3] = G, sanguine_core.SKIN_INDEX
        thickness = self.rows[:, list(PARAMETERS).index("epidermis_thickness_mm")]
        layers[..., 0, 4], layers[..., 1, 4] = thickness[:, None], math.inf
        return [list(skin) for skin in layers]

    def floor(self) -> dict[str, float]:
        """What the truth's last step changed: smaller errors may be its own."""
        return self.errors(self.reflectance - self.steps, self.colours.grid_nm)

    def errors(self, spectra: np.ndarray, wavelengths_nm: np.ndarray) -> dict[str, float]:
        """Delta E 2000 under both lights, and |R - truth| / truth over the samples that are on the truth's grid."""
        lab = self.colours.lab(spectra, wavelengths_nm)
        out = {}
        for light in Colours.ILLUMINANTS:
            difference = Colours.difference(lab[light], self.lab[light])
            out[f"delta_e_{light}_median"] = float(np.median(difference))
            out[f"delta_e_{light}_worst"] = float(difference.max())
        shared, here, there = np.intersect1d(wavelengths_nm, self.colours.grid_nm, return_indices=True)
        if len(shared):
            relative = np.abs(spectra[:, here] / self.reflectance[:, there] - 1)
            out |= {"Rd_error_median": float(np.median(relative)), "Rd_error_worst": float(relative.max())}
        return out


def colour_ladder(truth: SkinTruth, quick: bool, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """One skin at 41 wavelengths: seconds per skin, and how far its colour is off."""
    stacks = truth.stacks(TEN_NM)
    rows = []

    def add(solver: str, setting: str, spectra: np.ndarray, seconds: float, **more: Any) -> None:
        rows.append({"solver": solver, "setting": setting, "seconds": seconds, **truth.errors(spectra, TEN_NM), **more})

    say("colour: skin")
    batch = np.tile(truth.rows, (64 // len(truth.rows), 1))
    _, seconds, _ = timed(lambda: sanguine_core.reflectance(batch, TEN_NM, threads=1), 1.0)
    add("skin", "table", sanguine_core.reflectance(truth.rows, TEN_NM, threads=1), seconds / len(batch))

    def each(solve: Callable[[np.ndarray], float]) -> tuple[np.ndarray, float]:
        start = time.process_time()
        spectra = np.array([[solve(x) for x in skin] for skin in stacks])
        return spectra, (time.process_time() - start) / len(stacks)

    say("colour: multipole")
    entering = 1 - sanguine_core.adding_doubling(stacks[0][0], "diffuse", 8)["specular"]
    spectra, seconds = each(lambda x: entering * sanguine_core.multipole(x)["R"])
    add("multipole", "closed form", spectra, seconds, negative_share=float(np.mean(spectra <= 0)))
    for streams in (8, 16) if quick else (4, 6, 8, 12, 16, 24, 32, 48):
        say(f"colour: adding-doubling, {streams} streams")
        spectra, seconds = each(lambda x, n=streams: sanguine_core.adding_doubling(x, "diffuse", n)["Rd"])
        add("adding-doubling", f"{streams} streams", spectra, seconds)
    for photons in (100,) if quick else (100, 1_000, 10_000):
        say(f"colour: Monte Carlo, {photons} photons")
        # Every wavelength has a seed of its own, or its errors would not be independent.
        seeds = iter(range(1, 1_000_000))
        spectra, seconds = each(
            lambda x, n=photons: photons_through(x, "diffuse", None, n, next(seeds))["Rd"]
        )
        add("monte-carlo", f"{photons:.0e} photons".replace("e+0", "e"), spectra, seconds)
    return rows


def wavelength_ladder(truth: SkinTruth) -> list[dict[str, Any]]:
    """The skin table at few and many wavelengths. Up to 16: the middles of equal bands of 400 to 700 nm."""
    rows = []
    batch = np.tile(truth.rows, (64 // len(truth.rows), 1))
    for count in (3, 8, 16, 41, 81):
        if count <= 16:
            nm = 400 + 300 * (np.arange(count) + 0.5) / count
        else:
            nm = np.linspace(380.0, 780.0, count)
        spectra, _, _ = timed(lambda nm=nm: sanguine_core.reflectance(truth.rows, nm, threads=1), 0)
        _, seconds, _ = timed(lambda nm=nm: sanguine_core.reflectance(batch, nm, threads=1), 0.5)
        errors = {k: v for k, v in truth.errors(spectra, nm).items() if k.startswith("delta")}
        rows.append({"wavelengths": count, "seconds": seconds / len(batch), **errors})
    return rows


# --- the resolution of the tables ---


def tau_ladder(truth: SkinTruth, quick: bool) -> list[dict[str, Any]]:
    """The path table with every node of tau, every second, …: its cubic in ln R done again over fewer nodes.

    The values at a node do not depend on its neighbours, so a coarser table is the same table with nodes left out.
    """
    recipe = next((ROOT / "native" / "data").glob("path_table*diffuse.recipe.txt")).read_text()
    nodes = int(re.search(r"nodes: (\d+)", recipe).group(1))
    last = float(re.search(r"thickness up to: ([\d.]+)", recipe).group(1))
    scale = (nodes - 1) / math.log1p(10 * last)
    stacks = truth.stacks(TEN_NM)[:: 4 if quick else 1]
    radii = np.geomspace(0.01, 20, 41)
    middle, area = np.sqrt(radii[1:] * radii[:-1]), math.pi * np.diff(radii**2)

    def at_node(layers: np.ndarray, node: float) -> tuple[float, np.ndarray]:
        # In units of 1/mu_s' of the epidermis, of which the thickness is tau and the radii are the same for all nodes.
        tau = max(math.expm1(node / scale) / 10, 1e-9)  # no epidermis at all would be another stack
        scaled = layers.copy()
        scaled[:, :2] *= 1 / (layers[0, 1] * (1 - G))
        scaled[0, 4] = tau
        s = sanguine_core.solve(scaled, "diffuse", middle, solver="skin", threads=1)
        return s["Rd"], s["R_per_mm2"]

    cache: dict[tuple[int, int, int], tuple[float, np.ndarray]] = {}
    rows = []
    for stride in (1, 2, 4) if quick else (1, 2, 3, 4, 6, 8):
        count = (nodes - 1) // stride + 1
        if count < 4:
            continue
        spectra = np.zeros((len(stacks), len(TEN_NM)))
        profile_errors = []
        for i, skin in enumerate(stacks):
            for w, layers in enumerate(skin):
                position = math.log1p(10 * layers[0, 1] * (1 - G) * layers[0, 4]) * scale / stride
                first = min(max(int(position) - 1, 0), count - 4)
                x = position - first
                cubic = (-(x - 1) * (x - 2) * (x - 3) / 6, x * (x - 2) * (x - 3) / 2, -x * (x - 1) * (x - 3) / 2,
                         x * (x - 1) * (x - 2) / 6)  # fmt: skip
                log_R, log_profile = 0.0, np.zeros(len(middle))
                for k, c in enumerate(cubic):
                    key = (i, w, (first + k) * stride)
                    if key not in cache:
                        cache[key] = at_node(layers, key[2])
                    log_R += c * math.log(cache[key][0])
                    log_profile += c * np.log(np.maximum(cache[key][1], 1e-30))
                spectra[i, w] = math.exp(log_R)
                if w % 8 == 0:
                    exact = at_node(layers, position * stride)[1] @ area, at_node(layers, position * stride)[1]
                    profile_errors.append(float(np.abs(np.exp(log_profile) - exact[1]) @ area / exact[0]))
        exact_spectra = sanguine_core.reflectance(truth.rows, TEN_NM, threads=1)[:: 4 if quick else 1]
        lab, exact_lab = (truth.colours.lab(s, TEN_NM) for s in (spectra, exact_spectra))
        relative = np.abs(spectra / exact_spectra - 1)
        rows.append(
            {"nodes": count, "Rd_change_median": float(np.median(relative)), "Rd_change_worst": float(relative.max()),
             "profile_change_median": float(np.median(profile_errors)), "profile_change_worst": max(profile_errors)}
            | {f"delta_e_{light}_worst": float(Colours.difference(lab[light], exact_lab[light]).max())
               for light in Colours.ILLUMINANTS}  # fmt: skip
        )
    return rows


def lut_ladder(quick: bool) -> list[dict[str, Any]]:
    """Lobes read linearly between the entries of a material's table, against lobes solved on the spot.

    The table is made in linear Rec.709 under D65, so its colour has no meaning under A.
    """
    skin = default_skin() | COMMON | SKINS["light"]
    rows = []
    # Kronecker's sequence: as evenly spread as random numbers are not, and on no grid's entries.
    places = (np.arange(1, 13 if quick else 49) * (math.sqrt(5) - 1) / 2) % 1
    for name, low, high in (("hemoglobin", 0.002, 0.128), ("melanin", 0.005, 0.32)):
        octaves = math.log2(high / low)
        exact = _lobes(Axis(name, low, high, 2, True), skin, values=low * (high / low) ** places)
        floor = np.median(exact["fit_error"].max(1))
        planned = spaced(name, low, high, table_step=1.0).count
        for count in sorted({*(int(octaves * per) + 1 for per in ((1, 4) if quick else (0.5, 1, 2, 4, 8))), planned}):
            axis = Axis(name, low, high, count, True)
            entries, seconds, _ = timed(lambda axis=axis: _lobes(axis, skin), 0)
            position = places * (count - 1)
            lower = np.minimum(position.astype(int), count - 2)
            t = (position - lower)[:, None, None]
            read = {k: (1 - t) * entries[k][lower] + t * entries[k][lower + 1] for k in ("weights", "d_mm")}
            rgb, exact_rgb = read["weights"].sum(1), exact["weights"].sum(1)
            difference = Colours.difference(_lab_of_rec709(rgb), _lab_of_rec709(exact_rgb))
            profile = np.abs(_rings(read) - _rings(exact)).sum(1) / exact_rgb
            relative = np.abs(rgb / exact_rgb - 1)
            rows.append(
                {"axis": name, "low": low, "high": high, "entries": count, "entries_per_octave": (count - 1) / octaves,
                 "planned": count == planned, "seconds": seconds, "bytes": count * 8 * 3 * 4,
                 "Rd_change_median": float(np.median(relative)), "Rd_change_worst": float(relative.max()),
                 "profile_change_median": float(np.median(profile)), "profile_change_worst": float(profile.max()),
                 "lobes_profile_error": float(floor), "delta_e_D65_median": float(np.median(difference)),
                 "delta_e_D65_worst": float(difference.max())}  # fmt: skip
            )
    return rows


def _lobes(axis: Axis, skin: dict[str, float], values: np.ndarray | None = None) -> dict[str, np.ndarray]:
    if values is None:
        rows = entry_skins((axis,), skin)
    else:
        rows = skin_rows([skin | {axis.id: float(value)} for value in values])
    return sanguine_core.burley_lobes(rows, "rec709", threads=1)


def _rings(lobes: dict[str, np.ndarray]) -> np.ndarray:
    """Energy (N, rings, 3) of lobes (N, K, 3) in 80 logarithmic rings (Burley 2015, the integral of Eq. 3)."""
    r = np.concatenate([[0.0], np.geomspace(1e-4, 60, 80)])[None, :, None, None]
    d = np.maximum(lobes["d_mm"], 1e-9)[:, None]
    within = 1 - (np.exp(-r / d) + 3 * np.exp(-r / (3 * d))) / 4
    return np.diff((lobes["weights"][:, None] * within).sum(2), axis=1)


def _lab_of_rec709(rgb: np.ndarray) -> np.ndarray:
    to_rgb = sanguine_core.linear_rgb(np.eye(3) * 100, "rec709").T
    return sanguine_core.lab(np.ascontiguousarray(100 * rgb @ np.linalg.inv(to_rgb).T))


# --- speed ---


def speed(truth: SkinTruth, quick: bool, say: Callable[[str], None]) -> dict[str, Any]:
    """The bars: one skin of 41 wavelengths in 20 us, its profile and lobes in 1 ms, on one core."""
    say("speed")
    count = 64 if quick else 256
    spread = np.linspace(0, 1, count)
    skins = skin_rows(  # no two share a dermis or a thickness, so nothing is computed once for several
        [default_skin() | COMMON | {"melanin": 0.01 + 0.2 * t, "hemoglobin": 0.005 + 0.05 * ((37 * t) % 1),
                                    "epidermis_thickness_mm": 0.05 + 0.1 * ((13 * t) % 1)} for t in spread]  # fmt: skip
    )
    _, colour, n = timed(lambda: sanguine_core.reflectance(skins, TEN_NM, threads=1), 1)
    one = np.ascontiguousarray(skins[:1])
    _, alone, _ = timed(lambda: sanguine_core.reflectance(one, TEN_NM, threads=1), 0.1)
    few = np.ascontiguousarray(skins[:: max(1, count // 64)])
    _, lobes, _ = timed(lambda: sanguine_core.burley_lobes(few, "rec709", threads=1), 1)
    threads = []
    for number in range(1, (os.cpu_count() or 1) + 1):
        _, seconds, _ = timed(lambda n=number: sanguine_core.reflectance(skins, TEN_NM, threads=n), 1, number)
        _, lobe_seconds, _ = timed(lambda n=number: sanguine_core.burley_lobes(few, "rec709", threads=n), 1, number)
        threads.append(
            {"threads": number, "skins_per_second": count / seconds, "lobes_per_second": len(few) / lobe_seconds}
        )
    return {
        "colour_41_wavelengths_s": colour / count,
        "colour_41_wavelengths_alone_s": alone,
        "profile_and_lobes_s": lobes / len(few),
        "repeats": n,
        "threads": threads,
        "tables": _tables(),
        "limit": _limit(colour / count / len(TEN_NM)),
    }


def _python(code: str) -> Any:
    """Runs code in a fresh interpreter and reads the JSON that it prints."""
    return json.loads(subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout)


def _tables() -> dict[str, Any]:
    """Bytes on disk and in memory, and the time of the first call, less that of the second: what loading takes."""
    files = {path.name: path.stat().st_size for path in sorted((ROOT / "native" / "data").glob("path_table*.bin"))}
    fresh = """
import json, time, numpy as np
t0 = time.perf_counter()
import sanguine_core as core
imported = time.perf_counter() - t0
rows = np.array([[p["default"] for p in core.parameters()]])
nm = np.array([550.0])
pages = lambda: int(open("/proc/self/statm").read().split()[1]) * 4096
before = pages()
times = []
for _ in range(3):
    t0 = time.process_time(); core.reflectance(rows, nm, threads=1); times.append(time.process_time() - t0)
print(json.dumps({"import_s": imported, "load_s": times[0] - times[1], "memory_bytes": pages() - before}))
"""
    runs = [_python(fresh) for _ in range(3)]
    return {
        "file_bytes": files,
        "load_s": median(run["load_s"] for run in runs),
        "memory_bytes": median(run["memory_bytes"] for run in runs),
        "import_s": median(run["import_s"] for run in runs),
    }


def _filled_rows() -> tuple[int, float]:
    """Bins of path length, and how many of them hold light at a node of the diffuse table, in the mean.

    The file is read as bake_path_table.cpp writes it: a header, and per node the photons, the bins of two layers, and
    counts as numbers of seven bits a byte, in which 0 begins a run of zeros of the length that follows.
    """
    data = next((ROOT / "native" / "data").glob("path_table*diffuse.bin")).read_bytes()
    _, _, nodes, rings, bins = struct.unpack_from("<QIIII", data)
    at = struct.calcsize("<QIIII") + 6 * 8

    def number() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte = data[at]
            at += 1
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value
            shift += 7

    filled = 0
    for _ in range(nodes):
        at += 8 + 2 * bins * 8
        rows, i = set(), 0
        while i < rings * bins * bins:
            if number():
                rows.add(i // bins % bins)
                i += 1
            else:
                i += number()
        filled += len(rows)
    return bins, filled / nodes


def _limit(seconds_per_wavelength: float) -> dict[str, Any]:
    """How far one reflectance is from what the core can do.

    Operations are counted in the source (path_table.cpp). Per node of the four around tau: the attenuation of two
    layers in every bin of path length (two exponentials of 22 operations, 22 for the mean of the bin), the sum over
    the filled L1 of all L2, the sum over L2. The peak is what a matrix product reaches in single precision, which the
    lanes of a processor with AVX-512 may exceed: the share of it is an upper bound.
    """
    bins, rows = _filled_rows()
    operations = 4 * (2 * bins * (2 * 22 + 22) + 2 * rows * bins + 2 * bins)
    peak = _python("""
import json, time, numpy as np
a = np.random.default_rng(1).random((512, 512), dtype=np.float32)
times = []
for _ in range(300):
    t0 = time.process_time(); a @ a; times.append(time.process_time() - t0)
print(json.dumps(2 * 512**3 / np.median(times)))
""")
    rate = operations / seconds_per_wavelength
    return {
        "operations_per_wavelength": round(operations),
        "operations_per_second": rate,
        "peak_operations_per_second": peak,
        "share_of_peak": rate / peak,
        "table_bytes_per_wavelength": round(4 * rows * bins * 4),
    }


# --- what follows ---


def equal_error(rows: list[dict[str, Any]], skin: dict[str, Any], error: str, seconds: str) -> list[dict[str, Any]]:
    """How much longer adding-doubling and Monte Carlo take to reach the skin table's error.

    Their curves (error and time at each setting, those that no cheaper setting beats) are followed linearly in the
    logarithms of both. Beyond its last point Monte Carlo goes on with time ~ error^-2; adding-doubling is said to take
    "at least" its last time.
    """
    out = []
    for solver in ("adding-doubling", "monte-carlo"):  # the former has no profiles
        points = sorted((r[seconds], r[error]) for r in rows if r["solver"] == solver and r.get(error))
        curve = [p for i, p in enumerate(points) if all(p[1] < q[1] for q in points[:i])]
        if not curve:
            continue
        target, needed, how = skin[error], None, "between two settings"
        times, errors = np.log([p[0] for p in curve]), np.log([p[1] for p in curve])
        if target >= curve[0][1]:
            needed, how = curve[0][0], "at its cheapest setting"
        elif target >= curve[-1][1]:
            needed = math.exp(np.interp(-math.log(target), -errors, times))
        elif solver == "monte-carlo":
            needed, how = curve[-1][0] * (curve[-1][1] / target) ** 2, "beyond its last setting, time ~ error^-2"
        else:
            needed, how = curve[-1][0], "its last setting does not reach it: at least"
        out.append({"solver": solver, "measure": error, "error": target, "skin_s": skin[seconds], "seconds": needed,
                    "factor": needed / skin[seconds], "how": how})  # fmt: skip
    return out


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Median and worst per group, solver and setting, over the cases that were answered."""
    out = []
    keys = dict.fromkeys((r["group"], r["solver"], r["setting"]) for r in rows)
    order = [list(dict.fromkeys(key[k] for key in keys)) for k in (0, 1)]
    for key in sorted(keys, key=lambda key: (order[0].index(key[0]), order[1].index(key[1]))):
        mine = [r for r in rows if (r["group"], r["solver"], r["setting"]) == key]
        answered = [r for r in mine if r["refused"] is None]
        entry = dict(zip(("group", "solver", "setting"), key, strict=True)) | {
            "cases": len(mine),
            "answered": len(answered),
            "warned": sum(r["warning"] is not None for r in answered),
        }
        for name, value in (("Rd", "Rd_error"), ("Tt", "Tt_error"), ("second", "against_second"),
                            ("profile", "profile_error"), ("seconds", "seconds"),
                            ("profile_seconds", "profile_seconds")):  # fmt: skip
            numbers = [abs(r[value]) for r in answered if r[value] is not None]
            entry[f"{name}_median"] = float(np.median(numbers)) if numbers else None
            entry[f"{name}_worst"] = max(numbers) if numbers else None
        for name in ("picked", "profile_picked"):
            entry[name] = sorted({r[name] for r in answered if r[name]})
        out.append(entry)
    return out


def machine() -> dict[str, Any]:
    model = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())
    return {"processor": model.group(1) if model else "unknown", "cores": os.cpu_count(), "load": os.getloadavg()[0]}


def measure(quick: bool, say: Callable[[str], None]) -> dict[str, Any]:
    start = time.perf_counter()
    cases = reference_cases()
    directions = (16, 32) if quick else (32, 48)
    say(f"truth: iadpython with {directions[0]} and {directions[1]} directions")
    totals = SkinTotals(directions)
    check = []
    for case in cases:
        if math.isinf(case.layers[-1, 4]):
            total, step = totals.reflectance(case.layers, case.incidence)
            check.append({"case": case.id, "error": case.Rd_error(total), "floor": case.Rd_floor,
                          "against_second": total / case.total - 1, "step": step / total})  # fmt: skip
    truth = SkinTruth(["light", "dark"] if quick else list(SKINS), totals, 10.0 if quick else 2.0)
    results: dict[str, Any] = {
        "sanguine": sanguine_core.__version__,
        "schema": 1,
        "quick": quick,
        "machine": machine(),
        "truth": {"directions": directions, "step_nm": 10.0 if quick else 2.0, "floor": truth.floor(),
                  "against_reference": check},  # fmt: skip
        "floors": [
            {"case": c.id, "group": GROUPS.get(c.kind, "slab"), "Rd": c.Rd_floor, "profile": c.profile_floor}
            for c in cases
        ],
    }
    results["ladder"] = ladder(cases[:: 4 if quick else 1], quick, say)
    results["summary"] = summary(results["ladder"])
    results["colour"] = colour_ladder(truth, quick, say)
    say("resolution")
    results["wavelengths"] = wavelength_ladder(truth)
    results["tau_nodes"] = tau_ladder(truth, quick)
    results["lut"] = lut_ladder(quick)
    results["speed"] = speed(truth, quick, say)
    table = next(r for r in results["colour"] if r["solver"] == "skin")
    results["equal_error"] = [
        *equal_error(results["colour"], table, "Rd_error_median", "seconds"),
        *equal_error(results["colour"], table, "delta_e_D65_median", "seconds"),
        *equal_error(results["colour"], table, "delta_e_A_median", "seconds"),
    ]
    # Profiles: over the skins that the table answers, for every solver.
    answered = {r["case"] for r in results["ladder"] if r["solver"] == "skin" and r["profile_error"] is not None}
    shared = [r for r in summary([r for r in results["ladder"] if r["case"] in answered]) if r["group"] == "skin"]
    for table in (r for r in shared if r["solver"] == "skin"):
        results["equal_error"] += equal_error(shared, table, "profile_median", "profile_seconds_median")
    results["minutes"] = (time.perf_counter() - start) / 60
    return results


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="sanguine bench accuracy", description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a few cases and settings, seconds instead of minutes")
    parser.add_argument("--out", type=Path, help="folder for accuracy.json and accuracy.md (default bench/results; "
                        "with --quick out/bench)")
    options = parser.parse_args(arguments)
    start = time.perf_counter()

    def say(text: str) -> None:
        print(f"{time.perf_counter() - start:5.0f} s  {text}", file=sys.stderr)

    results = measure(options.quick, say)
    out = options.out or (ROOT / "out" / "bench" if options.quick else ROOT / "bench" / "results")
    out.mkdir(parents=True, exist_ok=True)
    (out / "accuracy.json").write_text(json.dumps(results, indent=1, allow_nan=False) + "\n")
    (out / "accuracy.md").write_text(report.tables(results))
    if options.out is None and not options.quick:
        report.plot(results, ROOT / "docs" / "accuracy_optics.png")
        report.write_into(ROOT / "docs" / "accuracy.md", results)
    print(f"{results['minutes']:.1f} minutes; wrote {out}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
