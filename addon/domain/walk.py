"""A homogeneous medium in place of layered skin, for Cycles' random walk where light comes through from behind.

Burley lobes know the skin from one side. Through a thin part the light takes both epidermises and the dermis between
them, which a walk through one medium follows if two things agree: what a thick piece sends back (`albedo_in_walk`, which
divides the closure's weight, so that this is exact), and what slabs of some millimetres let through. The second is fitted
here: the skin's slabs, epidermis on both sides, are solved by adding-doubling, and so is the medium of the walk.

The walk is Cycles' `random_walk_skin` (`intern/cycles/kernel/closure/bssrdf.h`, `integrator/subsurface_random_walk.h`):
isotropic scattering with mean free path l, single-scattering albedo `single_albedo(A)`, no interface; it enters half by a
cosine and half by a refraction at roughness 1, and leaves by a cosine. Of the two walks it is the one that all of Blender
4.2 to 5.2 do alike, and depends least on the view (tests/render/test_thin.py).
"""

from __future__ import annotations

from functools import cache

import numpy as np
import sanguine_core

from .parameters import PARAMETERS

INDEX = 1.4
"""Index of refraction, of the entry and of what Cycles makes of a radius."""

# Thicknesses at which the light through is fitted: ears are 1 to 4 mm thick at the rim and the lobe, 6 mm is where
# nothing but deep red comes through.
FIT_MM = (1.0, 2.0, 3.5, 6.0)
ALBEDO_RANGE = (0.08, 0.86)
"""Of the walk's colour: below, Cycles' single-scattering albedo is near its floor of 0.2, above, walks grow long."""

_MFP_RANGE_MM = (0.02, 20.0)
_NM = np.arange(400.0, 781.0, 10.0)
_STREAMS = 8  # 0.3 to 0.9 % of the totals of skin (docs/optics.md)
_NODES = 6
# Share of the walks that enter as if by a cosine; the others straight. Half do by design; of the refracted half a fifth
# goes as far aside: light through slabs in Cycles agrees within 3 % (tests/render/test_thin.py).
_COSINE_SHARE = 0.6
_UNSEEN = 0.003
"""Light through of this size no longer counts by ratio: next to a lit skin it is black."""

# What a thick medium of colour A sends back to a view with cosine mu, as a share of white light all round: the H function
# of isotropic scattering (Chandrasekhar 1960), averaged over the directions of entry, between the bounds of ALBEDO_RANGE
# and down to mu = 0.05, within 0.7 %. `bench/thin_parts.py --curve` derives it.
CURVE = (0.89194, 0.18106, -0.20146, 0.16967)
CURVE_SLANT = (0.2270, 0.1032, 0.1631, 0.1582, -0.3742)


def albedo_in_walk(albedo: np.ndarray, cosine: np.ndarray | float = 1.0) -> np.ndarray:
    """What the walk sends back, for its colour and the cosine of the view (1: from straight above)."""
    a, slant = albedo, 1.0 - np.asarray(cosine)
    s = CURVE_SLANT
    rise = slant * (s[0] + s[1] * slant + s[2] * slant**2 + a * (s[3] + s[4] * slant))
    return a * (CURVE[0] + a * (CURVE[1] + a * (CURVE[2] + a * CURVE[3]))) * (1.0 + (1.0 - a) * rise)


def single_albedo(albedo: np.ndarray) -> np.ndarray:
    """Cycles' single-scattering albedo for a colour, isotropic scattering (`subsurface_random_walk_remap`)."""
    blend = albedo**0.25
    alpha = (1.0 - blend) * 1.8260523782 * np.arctan(5.11246690381 * albedo) ** 1.09686102424
    return np.clip(alpha + blend * 0.496310210422 * np.arctan(4.2350089605 * albedo) ** 2.40602999408, 0.2, 0.999999)


def radius_per_mfp(albedo: np.ndarray) -> np.ndarray:
    """Cycles shortens the radius of this walk by its own idea of a diffusion length (`bssrdf_setup_radius`): undone here."""
    inverse = 1.0 / INDEX
    inside = inverse * (-1.440 * inverse + 0.710) + 0.668 + 0.0636 * INDEX
    boundary = 4.0 / 3.0 * (1.0 + inside) / (1.0 - inside)
    low, high = np.zeros_like(albedo), np.ones_like(albedo)
    for _ in range(30):
        middle = 0.5 * (low + high)
        s = np.sqrt(3.0 * (1.0 - middle))
        less = 0.5 * middle * (1.0 + np.exp(-boundary * s)) * np.exp(-s) < albedo
        low, high = np.where(less, middle, low), np.where(less, high, middle)
    return 1.0 / np.sqrt(3.0 * (1.0 - middle))


def walk_slab(albedo: np.ndarray, optical_thickness: np.ndarray) -> np.ndarray:
    """Share of the light that a slab of the walk's medium lets through, by its thickness over the mean free path."""
    albedos, logs, table = _walk_table()
    return np.exp(_bilinear(table, albedos, logs, albedo, np.log(np.maximum(optical_thickness, 1e-6))))


@cache
def _walk_table() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    albedos = np.linspace(*ALBEDO_RANGE, 14)
    logs = np.linspace(np.log(0.02), np.log(100.0), 50)
    table = np.empty((len(albedos), len(logs)))
    for i, alpha in enumerate(single_albedo(albedos)):
        for j, thickness in enumerate(np.exp(logs)):
            medium = np.array([[1.0 - alpha, alpha, 0.0, 1.0, thickness]])
            through = [sanguine_core.adding_doubling(medium, way, 12)["Tt"] for way in ("diffuse", "normal")]
            table[i, j] = _COSINE_SHARE * through[0] + (1.0 - _COSINE_SHARE) * through[1]
    return albedos, logs, np.log(np.maximum(table, 1e-30))


def _bilinear(table: np.ndarray, rows: np.ndarray, columns: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    y = np.clip((row - rows[0]) / (rows[1] - rows[0]), 0.0, len(rows) - 1.0)
    x = np.clip((column - columns[0]) / (columns[1] - columns[0]), 0.0, len(columns) - 1.0)
    i, j = np.minimum(y.astype(int), len(rows) - 2), np.minimum(x.astype(int), len(columns) - 2)
    y, x = y - i, x - j
    low = table[i, j] * (1 - x) + table[i, j + 1] * x
    return low * (1 - y) + (table[i + 1, j] * (1 - x) + table[i + 1, j + 1] * x) * y


def slab_rgb(skins: np.ndarray, working_space: str | np.ndarray, thicknesses_mm: tuple[float, ...] = FIT_MM) -> np.ndarray:
    """(N, thicknesses, 3) light through slabs of skins (N, P), epidermis on both sides, lit all round by white (D65).

    May be negative in a channel where the colour is out of the working space's gamut.
    """
    at = sanguine_core.optical_coefficients(np.ascontiguousarray(skins), _NM)
    epidermis_mm = skins[:, list(PARAMETERS).index("epidermis_thickness_mm")]
    scattering = np.concatenate(
        [at["mu_s_prime_epidermis_per_mm"], at["mu_s_prime_dermis_per_mm"], epidermis_mm[:, None]], axis=1
    )
    through = np.empty((len(skins), len(thicknesses_mm), len(_NM)))
    kinds, kind = np.unique(scattering, axis=0, return_inverse=True)  # one, unless somebody mixes people
    for k, (row, chosen) in enumerate((row, np.flatnonzero(kind.ravel() == k)) for k, row in enumerate(kinds)):
        for w in range(len(_NM)):
            through[chosen, :, w] = _slabs(
                at["mu_a_epidermis_per_mm"][chosen, w], at["mu_a_dermis_per_mm"][chosen, w],
                row[w], row[len(_NM) + w], row[-1], thicknesses_mm,
            )
    xyz = sanguine_core.xyz(np.ascontiguousarray(through.reshape(-1, len(_NM))), _NM)
    return sanguine_core.linear_rgb(xyz, working_space).reshape(len(skins), len(thicknesses_mm), 3)


def solved_slabs(varying: set[str]) -> int:
    """How many slabs `slab_rgb` solves for skins that differ in these parameters."""
    dermis = varying & {"hemoglobin", "oxygenation", "ink_per_mm"}
    return len(_NM) * len(FIT_MM) * (_NODES if "melanin" in varying else 1) * (_NODES if dermis else 1)


def _slabs(mu_a_epidermis, mu_a_dermis, mu_s_prime_epidermis, mu_s_prime_dermis, epidermis_mm, thicknesses_mm):
    """(N, thicknesses) light through at one wavelength.

    Its logarithm is nearly straight in the square root of either absorption, so a few solved slabs say all.
    """
    g = 0.8  # as in the path tables
    (s, at_s), (t, at_t) = _nodes(np.sqrt(mu_a_epidermis)), _nodes(np.sqrt(mu_a_dermis))
    logs = np.empty((len(s), len(t), len(thicknesses_mm)))
    for i, a in enumerate(s**2):
        outer = [a, mu_s_prime_epidermis / (1.0 - g), g, sanguine_core.SKIN_INDEX, epidermis_mm]
        for j, b in enumerate(t**2):
            for k, thickness_mm in enumerate(thicknesses_mm):
                inner = [b, mu_s_prime_dermis / (1.0 - g), g, sanguine_core.SKIN_INDEX, max(thickness_mm - 2.0 * epidermis_mm, 1e-3)]
                logs[i, j, k] = sanguine_core.adding_doubling(np.array([outer, inner, outer]), "diffuse", _STREAMS)["Tt"]
    logs = np.log(np.maximum(logs, 1e-30))
    return np.exp(np.einsum("ni,nj,ijk->nk", at_s, at_t, logs))


def _nodes(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Chebyshev nodes over the range of values (N,), and (N, nodes) what each node's value counts at each of them."""
    low, high = values.min(), values.max()
    if high - low < 1e-9:
        return np.array([low]), np.ones((len(values), 1))
    turn = np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES)
    x = 2.0 * (values - low) / (high - low) - 1.0
    powers = np.polynomial.chebyshev.chebvander(x, _NODES - 1)
    return low + 0.5 * (turn + 1.0) * (high - low), powers @ np.linalg.inv(np.polynomial.chebyshev.chebvander(turn, _NODES - 1))


def walk_of(skins: np.ndarray, reflectance_rgb: np.ndarray, working_space: str | np.ndarray) -> np.ndarray:
    """(N, 2, 3): colour and radius [mm] of Cycles' walk for skins (N, P) that send back `reflectance_rgb` (N, 3)."""
    albedo, mfp_mm = match_walk(reflectance_rgb, slab_rgb(skins, working_space))
    return np.stack([albedo, mfp_mm * radius_per_mfp(albedo)], axis=1)


def match_walk(reflectance_rgb: np.ndarray, through_rgb: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Colour and mean free path [mm], each (N, 3), of the walk of skins that send back `reflectance_rgb` (N, 3) and let
    `through_rgb` (N, thicknesses, 3) through slabs of FIT_MM.

    Least squares of cube roots, which is about how the eye judges light (CIE Lab's L*). The walk is weighted by the share
    of its own reflectance that the skin has: no more than 1, so it gains no energy.
    """
    back = np.clip(reflectance_rgb, 1e-4, 0.8).ravel()
    through = np.cbrt(_UNSEEN + np.maximum(through_rgb, 0.0)).transpose(0, 2, 1).reshape(-1, len(FIT_MM))
    # The darkest walk that may still be weighted by 1 or less.
    grid = np.linspace(*ALBEDO_RANGE, 200)
    least = np.interp(back, albedo_in_walk(grid), grid)

    def unpack(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        share = 1.0 / (1.0 + np.exp(-x[..., 0]))
        low, high = np.log(_MFP_RANGE_MM)
        return least + (ALBEDO_RANGE[1] - least) * share, np.exp(low + (high - low) / (1.0 + np.exp(-x[..., 1])))

    def residuals(x: np.ndarray) -> np.ndarray:
        albedo, mfp_mm = unpack(x)
        let = walk_slab(albedo[..., None], np.array(FIT_MM) / mfp_mm[..., None])
        weight = back / albedo_in_walk(albedo)
        # What hardly lets light through says little: it keeps near the middle then.
        return np.concatenate([np.cbrt(_UNSEEN + weight[..., None] * let) - through, 1e-3 * x], axis=-1)

    x = np.zeros((len(back), 2))
    best = residuals(x)
    damping = np.full(len(back), 1e-2)
    for _ in range(40):
        step = 1e-3
        slope = np.stack([(residuals(x + step * unit) - best) / step for unit in np.eye(2)], axis=-1)
        normal = np.einsum("nri,nrj->nij", slope, slope)
        normal = normal + damping[:, None, None] * np.eye(2) * (1e-3 + normal.diagonal(axis1=1, axis2=2).max(1))[:, None, None]
        move = -np.linalg.solve(normal, np.einsum("nri,nr->ni", slope, best)[..., None])[..., 0]
        tried = np.clip(x + move, -8.0, 8.0)
        found = residuals(tried)
        better = (found**2).sum(1) < (best**2).sum(1)
        x, best = np.where(better[:, None], tried, x), np.where(better[:, None], found, best)
        damping = np.where(better, damping * 0.3, damping * 5.0)
    albedo, mfp_mm = unpack(x)
    return albedo.reshape(-1, 3), mfp_mm.reshape(-1, 3)
