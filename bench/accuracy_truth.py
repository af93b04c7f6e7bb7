"""What the solvers are measured against; none of it is Sanguine's code.

- `reference_cases`: stacks solved by an independent Monte Carlo, with its standard errors (tests/reference/README.md).
- `skin_reflectance`: totals of two-layer skin by the public adding-doubling `iadpython` (S. Prahl, MIT licence).
- `Colours`: CIE 1931 2 degree colours and CIEDE2000 by `colour-science`.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path

import colour
import iadpython
import numpy as np
from iadpython import combine, start
from scipy.interpolate import CubicSpline

REFERENCE = Path(__file__).resolve().parents[1] / "tests" / "reference" / "monte_carlo_cases.json"


@dataclass(frozen=True)
class Case:
    """One stack of the reference file. layers: (L, 5) mu_a, mu_s [1/mm], g, n, thickness [mm].

    `total` is the file's second number, by an adding-doubling that is not ours either: Rd and R_unscattered together,
    good to 1e-4 or better. It has no noise, and tells small errors apart that the Monte Carlo cannot.

    The file's profile is means over rings, `R_mean`. `R_per_mm2` is the profile at `radii_mm` that has those means: the
    two differ by 0.9 to 1.6 % in L1, which is more than the errors that are to be told apart.
    """

    id: str
    kind: str
    incidence: str
    layers: np.ndarray
    specular: float
    Rd: float
    Rd_se: float
    total: float
    Tt: float
    Tt_se: float
    radii_mm: np.ndarray
    area_mm2: np.ndarray
    R_mean: np.ndarray
    R_se: np.ndarray
    R_per_mm2: np.ndarray

    @property
    def Rd_floor(self) -> float:
        """Relative standard error of the reference's Rd: smaller errors cannot be told from none."""
        return self.Rd_se / self.Rd

    @property
    def profile_floor(self) -> float:
        """Expected L1 distance of the reference's profile from the true one: mean absolute deviation of its noise."""
        return float(math.sqrt(2 / math.pi) * (self.R_se @ self.area_mm2) / (self.R_mean @ self.area_mm2))

    def Rd_error(self, Rd: float) -> float:
        return Rd / self.Rd - 1

    def Tt_error(self, Tt: float) -> float | None:
        return Tt / self.Tt - 1 if self.Tt > 0 else None

    def profile_error(self, R_per_mm2: np.ndarray) -> float:
        """L1 over the 40 rings of R(r) at `radii_mm`."""
        return float(np.abs(R_per_mm2 - self.R_per_mm2) @ self.area_mm2 / (self.R_per_mm2 @ self.area_mm2))

    def bar_error(self, R_per_mm2: np.ndarray) -> float:
        """The same against the means of the rings as they stand: the measure of the project's bars."""
        return float(np.abs(R_per_mm2 - self.R_mean) @ self.area_mm2 / (self.R_mean @ self.area_mm2))


def _at_radii(rings: dict[str, np.ndarray]) -> np.ndarray:
    """R at `r` of the cubic spline in ln R over ln r that has the rings' means; noise-ridden tails stay as they are."""
    nodes, weights = np.polynomial.legendre.leggauss(4)
    lit = rings["value"] > 1e-6 * rings["value"].max()
    low, high, mean, log_r = (rings[key][lit] for key in ("r_lo", "r_hi", "value", "r"))
    log_r = np.log(log_r)
    inside = np.log(low)[:, None] + np.log(high / low)[:, None] * (nodes + 1) / 2
    weights = weights * np.exp(2 * inside)  # area
    weights /= weights.sum(1, keepdims=True)
    at_r = mean.copy()
    for _ in range(20):
        at_r *= mean / (np.exp(CubicSpline(log_r, np.log(at_r))(inside)) * weights).sum(1)
    out = rings["value"].copy()
    out[lit] = at_r
    return out


def reference_cases() -> list[Case]:
    cases = []
    for case in json.loads(REFERENCE.read_text())["cases"]:
        rings = {key: np.array(case["R"][key]) for key in ("r", "r_lo", "r_hi", "value", "se")}
        cases.append(
            Case(
                id=case["id"],
                kind=case["class"],
                incidence=case["incidence"],
                layers=np.array(
                    [
                        [x["mu_a"], x["mu_s"], x["g"], x["n"], math.inf if x["thickness"] is None else x["thickness"]]
                        for x in case["layers"]
                    ]
                ),
                specular=case["specular"],
                Rd=case["Rd"],
                Rd_se=case["Rd_se"],
                total=case["adding_doubling"]["Rd_plus_R_unscattered"],
                Tt=case["Tt"],
                Tt_se=case["Tt_se"],
                radii_mm=rings["r"],
                area_mm2=math.pi * (rings["r_hi"] ** 2 - rings["r_lo"] ** 2),
                R_mean=rings["value"],
                R_se=rings["se"],
                R_per_mm2=_at_radii(rings),
            )
        )
    return cases


class SkinTotals:
    """Reflectance of layers of one g and n over a half-space, by iadpython's layers and boundaries.

    Its `Sample.rt` takes arrays for a sweep, not for layers, and its own sum over layers expects a symmetric stack, so
    the layers are joined here with its `add_layers`. It stores how g scatters between its directions; that is made once
    per g. More than 48 directions (24 inside the cone that leaves the skin, 24 outside) break its quadrature, and with
    48 it is 0.02 % from its limit. Its error falls with the third power of their number (seen from 8 to 48 on the
    reference cases), so the answers of two numbers are carried on to infinitely many.
    """

    def __init__(self, directions: tuple[int, int]):
        self.directions = directions
        self._scattering: dict[tuple[int, float], tuple[np.ndarray, np.ndarray]] = {}

    def reflectance(self, layers: np.ndarray, incidence: str) -> tuple[float, float]:
        """Light that leaves the top after it entered, per unit that falls on it; and how far that was carried on."""
        coarse, fine = (self._with(layers, incidence, number) for number in self.directions)
        step = (fine - coarse) / ((self.directions[1] / self.directions[0]) ** 3 - 1)
        return fine + step, step

    def _with(self, layers: np.ndarray, incidence: str, directions: int) -> float:
        n = layers[0, 3]
        stack = None
        for mu_a, mu_s, g, _, thickness in layers:
            extinction = mu_a + mu_s
            sample = iadpython.Sample(a=mu_s / extinction, b=extinction * thickness, g=g, n=n, quad_pts=directions)
            key = directions, g
            if key in self._scattering:
                sample.update_quadrature()
                sample.hp, sample.hm = self._scattering[key]
            r, t = combine.simple_layer_matrices(sample)
            self._scattering[key] = sample.hp, sample.hm
            stack = (r, r, t, t) if stack is None else combine.add_layers(sample, *stack, r, r, t, t)
        R, _, T, _ = combine.add_slide_above(sample, *start.boundary_layer(sample, top=True), *stack)
        normal, _, diffuse, _ = sample.UX1_and_UXU(R, T)
        if incidence == "normal":
            return float(normal - ((n - 1) / (n + 1)) ** 2)
        return float(diffuse - iadpython.fresnel.R1(1.0, n))


class Colours:
    """CIELAB under D65 and A of reflectance spectra, each relative to the white of its light.

    Spectra sampled anywhere in 380 to 780 nm are brought to `grid_nm` by cubics through the nearest four samples and
    continued as constants beyond their ends, as CIE 015:2018 (7.2) allows and as the library does.
    """

    ILLUMINANTS = ("D65", "A")

    def __init__(self, step_nm: float):
        self.grid_nm = np.arange(380.0, 780.0 + step_nm / 2, step_nm)
        shape = colour.SpectralShape(380, 780, step_nm)
        observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values
        self._weights = {}
        for name in self.ILLUMINANTS:
            light = colour.SDS_ILLUMINANTS[name].copy().align(shape).values
            weights = light[:, None] * observer
            self._weights[name] = weights / weights[:, 1].sum()

    def lab(self, spectra: np.ndarray, wavelengths_nm: np.ndarray) -> dict[str, np.ndarray]:
        """(N, 3) per illuminant, of spectra (N, W)."""
        on_grid = spectra @ _interpolation(wavelengths_nm, self.grid_nm)
        out = {}
        for name, weights in self._weights.items():
            white = colour.XYZ_to_xy(weights.sum(0))
            out[name] = colour.XYZ_to_Lab(on_grid @ weights, white)
        return out

    @staticmethod
    def difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """CIEDE2000."""
        return np.asarray(colour.delta_E(a, b, method="CIE 2000"))


def _interpolation(samples: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """(W, G): cubics through the nearest four samples (fewer if there are fewer), constants outside."""
    matrix = np.zeros((len(samples), len(grid)))
    count = min(4, len(samples))
    for column, nm in enumerate(np.clip(grid, samples[0], samples[-1])):
        first = int(np.clip(np.searchsorted(samples, nm) - count // 2, 0, len(samples) - count))
        near = samples[first : first + count]
        for k in range(count):
            others = np.delete(near, k)
            matrix[first + k, column] = np.prod((nm - others) / (near[k] - others))
    return matrix
