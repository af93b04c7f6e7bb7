"""Intervals, effect sizes and correlations over subjects. SciPy is imported where it is used: Blender has none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist

import numpy as np

CONFIDENCE = 0.95
MIN_SUBJECTS = 6
"""Fewer decide nothing: even if all five of five changed alike, chance alone does that in 2 x 1/2^5 = 6 % of studies."""

_NORMAL_REACH = NormalDist().inv_cdf((1.0 + CONFIDENCE) / 2.0)


@dataclass(frozen=True)
class Estimate:
    """A mean or a difference of means with its two-sided 95 % interval. Where two subjects are not there, or all are
    equal, low, high, t and p are None: nothing is known of the spread."""

    n: int
    mean: float
    sd: float | None = None
    low: float | None = None
    high: float | None = None
    t: float | None = None
    df: float | None = None
    p: float | None = None


@dataclass(frozen=True)
class Effect:
    """A standardised size with its 95 % interval."""

    value: float
    low: float
    high: float


def mean_interval(values: Sequence[float] | np.ndarray) -> Estimate:
    """Student's t interval of the mean of subjects (N,), N > 0."""
    x = np.asarray(values, dtype=np.float64)
    n, mean = x.size, float(x.mean())
    if n < 2:
        return Estimate(n, mean)
    sd = float(x.std(ddof=1))
    return _from_error(n, mean, sd, sd / math.sqrt(n), n - 1.0)


def difference_interval(a: Sequence[float] | np.ndarray, b: Sequence[float] | np.ndarray) -> Estimate:
    """Welch's interval of mean(a) - mean(b), which lets the groups differ in spread and number."""
    x, y = (np.asarray(values, dtype=np.float64) for values in (a, b))
    n, mean = x.size + y.size, float(x.mean() - y.mean())
    if min(x.size, y.size) < 2:
        return Estimate(n, mean)
    u, v = float(x.var(ddof=1)) / x.size, float(y.var(ddof=1)) / y.size
    if u + v == 0.0:
        return Estimate(n, mean, 0.0)
    df = (u + v) ** 2 / (u**2 / (x.size - 1) + v**2 / (y.size - 1))
    return _from_error(n, mean, math.sqrt((x.var(ddof=1) + y.var(ddof=1)) / 2.0), math.sqrt(u + v), df)


def _from_error(n: int, mean: float, sd: float, error: float, df: float) -> Estimate:
    from scipy import special

    # All alike but for rounding: the sensor does not resolve what differs between people.
    if error <= 1e-12 * max(abs(mean), 1e-300):
        return Estimate(n, mean, sd)
    t = mean / error
    half = float(special.stdtrit(df, (1.0 + CONFIDENCE) / 2.0)) * error
    return Estimate(n, mean, sd, mean - half, mean + half, t, df, float(2.0 * special.stdtr(df, -abs(t))))


def paired_effect(estimate: Estimate) -> tuple[Effect, Effect] | None:
    """(Cohen's d_z, Hedges' g) of a mean of changes, None without a spread.

    d_z is the mean change over the standard deviation of the changes; its interval inverts the noncentral t distribution,
    exact for normal changes (Steiger and Fouladi 1997). g takes off the bias of small samples (Hedges 1981).
    """
    if estimate.t is None:
        return None
    from scipy import special

    root, df = math.sqrt(estimate.n), estimate.df
    low, high = noncentrality(estimate.t, df)
    d = Effect(estimate.t / root, low / root, high / root)
    less = math.exp(special.gammaln(df / 2) - special.gammaln((df - 1) / 2)) / math.sqrt(df / 2) if df > 1 else 1.0
    return d, Effect(less * d.value, less * d.low, less * d.high)


def noncentrality(t: float, df: float) -> tuple[float, float]:
    """95 % interval of the noncentrality of a t that was observed.

    The distribution of t is a mean of shifted normal ones over the chi distribution, here over its quantiles (SciPy's
    own gives NaN in the tails).
    """
    from scipy import optimize, special

    u, weight = _quadrature()
    scale = np.sqrt(special.gammaincinv(df / 2.0, u) / (df / 2.0))
    tail = (1.0 - CONFIDENCE) / 2.0
    reach = 10.0 + 4.0 * abs(t)

    def above(nc: float, q: float) -> float:
        return float(weight @ special.ndtr(t * scale - nc)) - q

    low, high = (optimize.brentq(above, t - reach, t + reach, args=(q,), xtol=1e-9 * reach) for q in (1.0 - tail, tail))
    return low, high


@lru_cache(maxsize=1)
def _quadrature() -> tuple[np.ndarray, np.ndarray]:
    """Places and weights of a mean over 0 to 1."""
    x, w = np.polynomial.legendre.leggauss(400)
    return (x + 1.0) / 2.0, w / 2.0


def difference_effect(a: Sequence[float] | np.ndarray, b: Sequence[float] | np.ndarray) -> Effect | None:
    """Difference of means over the root of the mean variance, with the interval of Bonett (2008, Psychol Methods 13:99),
    which does not take the two spreads for equal. None without a spread or with fewer than two subjects in a group."""
    x, y = (np.asarray(values, dtype=np.float64) for values in (a, b))
    if min(x.size, y.size) < 2:
        return None
    u, v = float(x.var(ddof=1)), float(y.var(ddof=1))
    both = (u + v) / 2.0
    if both == 0.0:
        return None
    d = float(x.mean() - y.mean()) / math.sqrt(both)
    m, n = x.size - 1, y.size - 1
    variance = d**2 * (u**2 / m + v**2 / n) / (8.0 * both**2) + (u / m + v / n) / both
    half = _NORMAL_REACH * math.sqrt(variance)
    return Effect(d, d - half, d + half)


def label_correlation(estimate: Estimate) -> Effect | None:
    """Point-biserial correlation of a measure with the label (neutral 0, the emotion 1) within subjects.

    The repeated-measures correlation (Bakdash and Marusich 2017) of two levels per subject, t / sqrt(t^2 + n - 1); its
    interval follows from that of d_z, d / sqrt(d^2 + 1).
    """
    if estimate.t is None:
        return None
    low, high = (bound / math.sqrt(bound**2 + estimate.n) for bound in noncentrality(estimate.t, estimate.df))
    return Effect(estimate.t / math.hypot(estimate.t, math.sqrt(estimate.df)), low, high)


def common_correlation(subject: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[Effect, int, float] | None:
    """Repeated-measures correlation of two measures: (r with its interval, degrees of freedom, p).

    subject, x, y (N,). Each subject's own means are taken off, so that people who differ at rest do not correlate;
    the interval is Fisher's, with the degrees of freedom that are left (Bakdash and Marusich 2017). None if fewer than
    three are, or one of the two does not vary.
    """
    from scipy import special

    _, who = np.unique(subject, return_inverse=True)
    count = np.bincount(who)
    df = int(x.size - count.size - 1)
    if df < 3:
        return None
    dx, dy = (v - (np.bincount(who, weights=v) / count)[who] for v in (x, y))
    u, v = float(dx @ dx), float(dy @ dy)
    if u <= 1e-20 * float(x @ x) or v <= 1e-20 * float(y @ y):
        return None
    r = min(max(float(dx @ dy) / math.sqrt(u * v), -1.0), 1.0)
    if abs(r) > 1.0 - 1e-12:
        return Effect(r, r, r), df, 0.0
    half = _NORMAL_REACH / math.sqrt(df - 1.0)
    t = r * math.sqrt(df / (1.0 - r * r))
    return (
        Effect(r, math.tanh(math.atanh(r) - half), math.tanh(math.atanh(r) + half)),
        df,
        float(2.0 * special.stdtr(df, -abs(t))),
    )


def holm(p: Sequence[float | None]) -> list[float | None]:
    """Holm's (1979) adjusted p: below 0.05 each, the chance of one false among all is at most 5 %, whatever their
    dependence. None, a test that could not be made, counts for nothing."""
    asked = sorted((value, k) for k, value in enumerate(p) if value is not None)
    adjusted: list[float | None] = [None] * len(p)
    worst = 0.0
    for rank, (value, k) in enumerate(asked):
        worst = max(worst, min(1.0, (len(asked) - rank) * value))
        adjusted[k] = worst
    return adjusted
