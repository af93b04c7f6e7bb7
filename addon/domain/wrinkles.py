"""Wrinkles: furrows across the compression of each fold component, as heights in mm at places of the surface."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import sanguine_core

from .strain import MovingSurface

# Distance from furrow to furrow by region, in mm. Guesses by eye: the papers on wrinkles measure their depth (Lemperle
# et al. 2001, Plast. Reconstr. Surg. 108:1735), not their distance.
SPACING_MM = {
    "forehead": 9.0, "nose": 3.5, "eyelids": 3.0, "cheeks": 6.0, "lips": 3.0, "chin": 4.5, "neck": 14.0, "ears": 6.0,
}
SPACING_ELSEWHERE_MM = 5.0

# How readily skin folds, by region: thick fat under the cheeks and the stiff ears bulge instead. Guesses by eye.
READINESS = {
    "forehead": 1.0, "nose": 0.8, "eyelids": 1.0, "cheeks": 0.2, "lips": 0.5, "chin": 0.6, "neck": 0.5, "ears": 0.0,
}
READINESS_ELSEWHERE = 0.7

# A sheet that keeps its length while its ends approach by the share c throws sine waves of half height
# L sqrt(c) / pi; most of the way is taken up below the surface, though. The share is a guess by eye: it gives some
# 0.2-0.9 mm for a whole expression.
DEPTH_SHARE = 0.24
DEPTH_MAX_MM = 0.9
_COMPRESSION_MAX = 0.5

_VALLEY = 0.2  # how sharp the bottom of a furrow is: 0 a crease
_SINE_MEAN = 0.66  # of the profile below, so that wrinkles neither raise nor sink the skin


def by_region(
    surface: MovingSurface, regions: Mapping[str, np.ndarray], values: Mapping[str, float], elsewhere: float
) -> np.ndarray:
    """(W,) per welded vertex: a value that passes smoothly from region to region."""
    mixed = np.full(len(surface.position_mm), elsewhere)
    for region, weights in regions.items():
        mixed += weights * (values.get(region, elsewhere) - elsewhere)
    welded = np.zeros(len(surface.area_mm2))
    welded[surface.welded] = mixed
    return surface.smooth(welded[:, None], 4)[:, 0]


def furrow_fields(surface: MovingSurface, regions: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Depth of the furrows in mm and phase in cycles, each (C, V) float32 per vertex of the mesh."""
    spacing = by_region(surface, regions, SPACING_MM, SPACING_ELSEWHERE_MM)
    share = DEPTH_SHARE * by_region(surface, regions, READINESS, READINESS_ELSEWHERE)
    folds = surface.welded_folds
    depths, phases = [], []
    position, triangles = surface.rest
    for values, across in zip(folds.values, folds.across, strict=True):
        depth = share * 2.0 * spacing * np.sqrt(np.minimum(values, _COMPRESSION_MAX)) / np.pi
        # A root rises steeply from 0: little compression makes no wrinkle at all.
        depth *= np.clip(values / 0.1, 0.0, 1.0)
        depths.append(np.minimum(depth, DEPTH_MAX_MM))
        wanted = across / spacing[:, None]
        phases.append(sanguine_core.stripe_phase(position, triangles, wanted.astype(np.float32), values))
    index = surface.welded
    return np.float32(depths)[:, index], np.float32(phases)[:, index]


def steepening(surface: MovingSurface) -> np.ndarray:
    """(C, V) float32 per vertex of the mesh: how many times steeper than on the face at rest a furrow is once its pattern is
    driven in full: the skin across it is then shorter, by the exponential of its compression, a logarithmic strain. (Driven
    by half, a furrow is told up to a quarter too steep.)"""
    return np.exp(np.float32(np.minimum(surface.welded_folds.values, _COMPRESSION_MAX)))[:, surface.welded]


def furrow_height_mm(depth_mm: np.ndarray, phase: np.ndarray, position_mm: np.ndarray, seed: int) -> np.ndarray:
    """Height (N,) at places (N, 3) whose furrows are `depth_mm` deep and lie at whole numbers of `phase` (N,).

    A function of the place in mm alone, so that UV seams do not show. Furrows wander, part and end: their phase is
    warped and their depth varies along them.
    """
    wander = _waves(position_mm, 22.0, seed) * 0.22 + _waves(position_mm, 7.0, seed + 1) * 0.07
    angle = np.pi * (phase + wander)
    profile = np.sqrt(np.sin(angle) ** 2 * (1.0 - _VALLEY**2) + _VALLEY**2) - _SINE_MEAN
    along = np.clip(0.75 + 0.3 * _waves(position_mm, 16.0, seed + 2), 0.1, 1.0)
    return (depth_mm * along * profile).astype(np.float32)


def _waves(position_mm: np.ndarray, length_mm: float, seed: int, count: int = 12) -> np.ndarray:
    """A smooth random function of the place (N, 3), about -1 to 1, of waves around `length_mm`."""
    random = np.random.default_rng(seed)
    direction = random.standard_normal((count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    number = (2.0 * np.pi / length_mm * random.uniform(0.7, 1.3, (count, 1)) * direction).astype(np.float32)
    start = random.uniform(0.0, 2.0 * np.pi, count).astype(np.float32)
    total = np.zeros(len(position_mm), dtype=np.float32)
    for k, s in zip(number, start, strict=True):
        # Written out rather than as a matrix product: the same bytes for any number of threads.
        total += np.cos(position_mm[:, 0] * k[0] + position_mm[:, 1] * k[1] + position_mm[:, 2] * k[2] + s)
    return np.clip(total / np.sqrt(2.0 * count) / 0.7, -1.0, 1.0)
