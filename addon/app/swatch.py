"""What a skin looks like, quickly: its colour, its spectrum, and a picture of the spectrum, for the panel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import sanguine_core

from ..domain.parameters import Skin, skin_rows
from ..domain.people import face_ita

WAVELENGTH_NM = np.arange(380.0, 781.0, 5.0)
PLOT_NM = (400.0, 700.0)
PLOT_TOP = 0.8
"""Reflectance at the upper edge of the plot: the lightest skin has 0.7 in the red."""

_WIDTH, _HEIGHT = 192, 192
_SAMPLES = 2  # per pixel and axis: the curve is drawn without steps


@dataclass(frozen=True)
class Swatch:
    """rgb: linear, of the working space, not negative. lab: L*a*b* under D65. ita: of a face with this skin, degrees.

    reflectance: at WAVELENGTH_NM. Colour, Lab and spectrum are of light that went through the skin, as `sanguine skin`
    says them: what the film of oil reflects on average is off them, its highlights are not in them.
    """

    rgb: tuple[float, float, float]
    lab: tuple[float, float, float]
    ita: float
    reflectance: np.ndarray


def swatch(skin: Skin, working_space: str | np.ndarray) -> Swatch:
    """Of the skin itself at rest: what grows on it, its anatomy and its blood's answers apart."""
    rows = skin_rows([skin])
    under_film = 1.0 - sanguine_core.surface(rows)[:, :1]
    spectrum = under_film * sanguine_core.reflectance(rows, WAVELENGTH_NM, threads=1)
    xyz = sanguine_core.xyz(spectrum, WAVELENGTH_NM)
    rgb = np.maximum(sanguine_core.linear_rgb(xyz, working_space)[0], 0.0)
    return Swatch(tuple(rgb.tolist()), tuple(sanguine_core.lab(xyz)[0].tolist()), face_ita(skin), spectrum[0])


def plot(reflectance: np.ndarray) -> np.ndarray:
    """(H, W, 4) float32, row 0 lowest, straight alpha, encoded for display: the spectrum over the visible wavelengths,
    its area in their colours, a line at every fifth of the light and every 100 nm."""
    nm = PLOT_NM[0] + (np.arange(_WIDTH * _SAMPLES) + 0.5) / (_WIDTH * _SAMPLES) * (PLOT_NM[1] - PLOT_NM[0])
    top = np.interp(nm, WAVELENGTH_NM, reflectance) / PLOT_TOP
    height = (np.arange(_HEIGHT * _SAMPLES) + 0.5) / (_HEIGHT * _SAMPLES)
    slope = np.abs(np.gradient(top)) * _WIDTH * _SAMPLES  # a steep curve is as thick as a flat one
    half = 1.2 / _HEIGHT * np.sqrt(1.0 + slope**2)
    below = height[:, None] < top
    line = np.abs(height[:, None] - top) < half

    def mean(covered: np.ndarray) -> np.ndarray:
        return covered.reshape(_HEIGHT, _SAMPLES, _WIDTH, _SAMPLES).mean(axis=(1, 3))[..., None]

    image = np.zeros((_HEIGHT, _WIDTH, 4), dtype=np.float32)
    image[..., :3] = 0.5
    grid = np.zeros((_HEIGHT, _WIDTH), dtype=bool)
    grid[[round(_HEIGHT * k * 0.2 / PLOT_TOP) for k in range(1, round(PLOT_TOP / 0.2))]] = True
    grid[:, [_WIDTH // 3, 2 * _WIDTH // 3]] = True
    grid[[0, -1]], grid[:, [0, -1]] = True, True
    area, curve = mean(below), mean(line)
    colours = _colours(nm.reshape(_WIDTH, _SAMPLES).mean(axis=1))
    image[..., :3] = image[..., :3] * (1 - area) + colours * area
    image[..., 3:] = np.maximum(0.85 * area, 0.45 * grid[..., None])
    image[..., :3] = image[..., :3] * (1 - curve) + 0.95 * curve
    image[..., 3:] = np.maximum(image[..., 3:], curve)
    return image


def _colours(nm: np.ndarray) -> np.ndarray:
    """(N, 3) for display: the hue of each wavelength as far as a screen has it, muted, dimmed towards the ends."""
    band = np.exp(-0.5 * ((WAVELENGTH_NM - nm[:, None]) / 8.0) ** 2)  # 8 nm wide: a single one has no colour on the grid
    rgb = np.maximum(sanguine_core.linear_rgb(sanguine_core.xyz(band, WAVELENGTH_NM), "rec709"), 0.0)
    rgb /= rgb.max()
    bright = rgb.max(axis=1, keepdims=True)
    rgb *= np.clip(bright, 0.25, 1.0) ** -0.6  # or the violet end is black
    rgb = 0.06 + 0.7 * rgb
    return np.where(rgb < 0.0031308, 12.92 * rgb, 1.055 * np.clip(rgb, 0.0031308, 1.0) ** (1 / 2.4) - 0.055)
