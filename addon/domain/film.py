"""The light that the oil film reflects, for each view of it."""

from __future__ import annotations

import functools

import numpy as np

ENTRIES = 16
"""Views and roughnesses of `film_table`; between them the linear value is within 0.002 of the true one where the
roughness is 0.1 or more and the view is not within 3 degrees of the surface."""

# Midpoints along each side of the disk over which `film_albedo` averages.
_STEPS = (np.arange(64) + 0.5) / 64


def film_albedo(cosine: float, roughness: float, index: float) -> float:
    """Share of the light that GGX facets reflect to a view at `cosine` (> 0) from the normal, after one bounce.

    The mean of Fresnel times G2 / G1 over the facets that the view sees (Heitz 2018, "Sampling the GGX
    distribution of visible normals", JCGT 7:4); G2 is Smith's, height-correlated, as Cycles has it.
    """
    alpha = roughness
    view = np.array([np.sqrt(max(0.0, 1.0 - cosine * cosine)), 0.0, cosine])
    stretched = view * (alpha, alpha, 1.0)
    stretched /= np.linalg.norm(stretched)
    # Evenly spread points of the disk that the view sees of the hemisphere of stretched normals.
    radius, turn = np.sqrt(_STEPS)[:, None], 2.0 * np.pi * _STEPS
    t1, t2 = radius * np.cos(turn), radius * np.sin(turn)
    lift = 0.5 * (1.0 + stretched[2])
    t2 = (1.0 - lift) * np.sqrt(np.maximum(0.0, 1.0 - t1 * t1)) + lift * t2
    across = np.array([0.0, 1.0, 0.0])
    along = np.cross(stretched, across)
    out = np.sqrt(np.maximum(0.0, 1.0 - t1 * t1 - t2 * t2))
    normals = t1[..., None] * across + t2[..., None] * along + out[..., None] * stretched
    normals *= (alpha, alpha, 1.0)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    facing = np.clip(normals @ view, 0.0, 1.0)
    leaves = 2.0 * facing * normals[..., 2] - cosine  # cosine of the mirrored direction

    def smith(c: np.ndarray | float) -> np.ndarray:
        return 0.5 * (np.sqrt(1.0 + alpha * alpha * (1.0 / np.square(c) - 1.0)) - 1.0)

    seen = smith(cosine)
    passed = (1.0 + seen) / (1.0 + seen + smith(np.maximum(leaves, 1e-6)))
    return float(np.mean(np.where(leaves > 0.0, passed * fresnel(facing, index), 0.0)))


def fresnel(cosine: np.ndarray, index: float) -> np.ndarray:
    """Unpolarised reflectance of a dielectric of relative index > 1."""
    g = np.sqrt(index * index - 1.0 + cosine * cosine)
    ratio = (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0)
    return 0.5 * np.square((g - cosine) / (g + cosine)) * (1.0 + ratio * ratio)


@functools.cache
def film_table(index: float) -> np.ndarray:
    """(ENTRIES, ENTRIES) albedo: rows by the root of the roughness, columns by the root of the cosine, each 0 to 1."""
    squares = np.linspace(0.0, 1.0, ENTRIES) ** 2
    # Not 0 itself: a grazing view and a mirror have their limits there.
    values = np.maximum(squares, 1e-4)
    return np.array([[film_albedo(cosine, roughness, index) for cosine in values] for roughness in values])
