"""The classical two-step method as it is usually programmed, to show where it breaks. Not part of Sanguine.

Donner and Jensen 2005, "Light Diffusion in Multi-Layered Translucent Materials": R(r) and T(r) of each layer from
2 N + 1 dipoles, sampled on a pixel grid, transformed by FFT, combined layer by layer, transformed back. No guard of
any kind: what it says about a stack is what a renderer that trusts it would show.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

DIPOLES = 10  # on either side; public implementations take 10 to 20
PIXELS, PIXEL_MM = 256, 0.05  # 12.8 mm across


def internal_reflectance(eta: float) -> float:
    """Egan and Hilgeman's fit of the diffuse Fresnel reflectance, as printed."""
    if eta >= 1:
        return -1.4399 / eta**2 + 0.7099 / eta + 0.6681 + 0.0636 * eta
    return -0.4399 + 0.7099 / eta - 0.3319 / eta**2 + 0.0636 / eta**3


def _dipole(z: float, distance: np.ndarray, sigma_tr: float) -> np.ndarray:
    return z * (1 + sigma_tr * distance) * np.exp(-sigma_tr * distance) / distance**3


def _layer(layer: Sequence[float], above: float, below: float, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    mu_a, mu_s, g, n, d = layer
    scattering = np.float64(mu_s * (1 - g))
    extinction = mu_a + scattering
    depth = 1 / extinction
    sigma_tr = np.sqrt(3 * mu_a * extinction)
    zb = []
    for outside in (above, below):
        f = internal_reflectance(n / outside)
        zb.append(2 * (1 + f) / (1 - f) * depth / 3)
    reflected, transmitted = np.zeros_like(r), np.zeros_like(r)
    for i in range(-DIPOLES, DIPOLES + 1) if math.isfinite(d) else [0]:
        period = 2 * i * (d + zb[0] + zb[1]) if i else 0.0
        real, virtual = period + depth, period - depth - 2 * zb[0]
        reflected += _dipole(real, np.hypot(r, real), sigma_tr) - _dipole(virtual, np.hypot(r, virtual), sigma_tr)
        if math.isfinite(d):
            real, virtual = d - real, d - virtual
            transmitted += _dipole(real, np.hypot(r, real), sigma_tr) - _dipole(virtual, np.hypot(r, virtual), sigma_tr)
    scale = scattering / extinction / (4 * math.pi)
    return scale * reflected, scale * transmitted


def solve(stack: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    """R and T of the light that enters, and the share of R(x, y) that is negative."""
    with np.errstate(all="ignore"):
        axis = (np.arange(PIXELS) - PIXELS // 2) * PIXEL_MM
        x, y = np.meshgrid(axis, axis)
        r = np.hypot(x + PIXEL_MM / 2, y + PIXEL_MM / 2)
        indices = [1.0, *(layer[3] for layer in stack), 1.0]

        def transform(values: np.ndarray) -> np.ndarray:
            return np.fft.fft2(np.fft.ifftshift(values)) * PIXEL_MM**2

        whole = None
        for i in reversed(range(len(stack))):
            down = [transform(v) for v in _layer(stack[i], indices[i], indices[i + 2], r)]
            if whole is None:
                whole = down
                continue
            up = [transform(v) for v in _layer(stack[i], indices[i + 2], indices[i], r)]
            between = 1 / (1 - whole[0] * up[0])
            whole = [down[0] + down[1] * whole[0] * up[1] * between, down[1] * whole[1] * between]
        profile = np.real(np.fft.fftshift(np.fft.ifft2(whole[0])))
        negative = -profile[profile < 0].sum() / np.abs(profile).sum()
    return float(whole[0][0, 0].real), float(whole[1][0, 0].real), float(negative)
