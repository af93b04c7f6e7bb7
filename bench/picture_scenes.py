"""What both halves of the picture benchmark share: the scenes in numbers, the wavelengths, and the error of a picture.

Lengths are in mm; z points to the camera, which looks straight down without perspective; row 0 of every picture is
the lowest. A lamp has radiance 1 at every wavelength, so a perfect white patch under a whole white sky shows 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import colour
import numpy as np
import sanguine_core
from scipy.interpolate import PchipInterpolator
from sanguine.domain.parameters import Skin, default_skin

HERE = Path(__file__).resolve().parent
TRUTH = HERE / "reference" / "picture_truth.npz"
CACHE = HERE / "cache" / "picture"

# ISSA's mean "light" and "dark" face (docs/optics.md), and skin so deep that the epidermis hides the dermis, which is
# where one lobe is not enough. Without a film: its reflection is no part of the comparison.
SKINS: dict[str, Skin] = {
    name: default_skin() | {"melanin": melanin, "hemoglobin": hemoglobin, "oil": 0.0}
    for name, melanin, hemoglobin in (("light", 0.014, 0.011), ("dark", 0.134, 0.020), ("deep", 0.300, 0.020))
}
EPIDERMIS_MM = default_skin()["epidermis_thickness_mm"]
G, INDEX = 0.8, sanguine_core.SKIN_INDEX

# Where the spectrum is traced. From a 5 nm grid the least useful nodes were taken away one by one, judged on spectra of
# `sanguine_core` (four skins under diffuse light, at five depths in a shadow, and behind 1.5 mm);
# `wavelength_cost` says what is left of the error.
WAVELENGTHS_NM = np.array([425, 445, 455, 480, 510, 520, 540, 565, 575, 585, 600, 615, 650, 710], dtype=float)
_FINE_NM = np.arange(380.0, 781.0, 5.0)

SPHERE_RADIUS_MM = 12.0
SHEET_MM = 1.5
# A lamp this far above the skin ends so sharply on it that a pixel cannot tell.
LAMP_GAP_MM = 0.01
# The soft box of the sphere: a square of this half side, this far from the centre, this far round from the camera.
SOFTBOX_HALF_MM, SOFTBOX_DISTANCE_MM, SOFTBOX_ANGLE_RAD = 40.0, 40.0, np.radians(75.0)


@dataclass(frozen=True)
class PictureScene:
    """width_mm: what the camera sees across. columns, rows: of the truth; a picture repeats what is the same.

    block: pixels are averaged over squares of this side before they are compared, in truth and picture alike, so that
    the truth's noise stays below what is measured. skins: of `SKINS`. exposure: a factor on the picture, as a photographer would open up.
    """

    id: str
    title: str
    width_mm: float
    columns: int
    rows: int = 1
    repeat: int = 1
    block: int = 1
    exposure: float = 1.0
    skins: tuple[str, ...] = ("light", "dark", "deep")

    @property
    def picture_size(self) -> tuple[int, int]:
        """Columns and rows of the picture that is compared with the truth."""
        return (16, 16) if self.columns == 1 else (self.columns, self.rows * self.repeat)


SCENES = {
    scene.id: scene
    for scene in (
        PictureScene("patch", "Flat patch under a white sky", 4.0, 1),
        PictureScene("edge", "Edge of light", 16.0, 48, repeat=8),
        PictureScene("sphere", "Sphere of 12 mm, soft box at 75 degrees", 25.0, 40, 40, block=4, exposure=1.4,
                     skins=("light", "dark")),
        PictureScene("sheet", "Sheet of 1.5 mm, half lit from behind", 24.0, 48, repeat=8, exposure=4.0,
                     skins=("light", "dark")),
    )
}


def spectrum_to_xyz(values: np.ndarray, nodes_nm: np.ndarray = WAVELENGTHS_NM) -> np.ndarray:
    """XYZ (D65, Y = 1 for white) of spectra (..., W): monotone cubic between nodes, constant beyond them."""
    fine = PchipInterpolator(nodes_nm, values, axis=-1)(np.clip(_FINE_NM, nodes_nm[0], nodes_nm[-1]))
    flat = np.ascontiguousarray(fine.reshape(-1, len(_FINE_NM)))
    return sanguine_core.xyz(flat, _FINE_NM).reshape(*values.shape[:-1], 3) / 100.0


_XYZ_FROM_RGB = np.linalg.inv(sanguine_core.linear_rgb(np.eye(3) * 100.0, "rec709").T)


def rgb_to_xyz(rgb: np.ndarray) -> np.ndarray:
    """Linear Rec.709 (..., 3) to XYZ, by the inverse of the core's own matrix."""
    return rgb @ _XYZ_FROM_RGB.T


def xyz_to_rgb(xyz: np.ndarray) -> np.ndarray:
    return xyz @ np.linalg.inv(_XYZ_FROM_RGB).T


def blocks(pixels: np.ndarray, side: int) -> np.ndarray:
    """Means over squares of `side` pixels, (H, W, 3) -> (H / side, W / side, 3)."""
    height, width, channels = pixels.shape
    return pixels.reshape(height // side, side, width // side, side, channels).mean(axis=(1, 3))


def delta_e(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Delta E 2000 between XYZ arrays (..., 3) under the same exposure; light below zero counts as none."""
    lab = [sanguine_core.lab(np.ascontiguousarray(np.maximum(x, 0.0).reshape(-1, 3)) * 100.0) for x in (a, b)]
    return np.asarray(colour.delta_E(*lab, method="CIE 2000")).reshape(a.shape[:-1])


def wavelength_cost() -> dict[str, float]:
    """Delta E 2000 of the few wavelengths against every 5 nm, on the colours of both skins: lit, and in shadow."""
    from sanguine.domain.parameters import skin_rows

    radii_mm = np.geomspace(1e-4, 40.0, 2500)
    rows = skin_rows(list(SKINS.values()))
    rings = sanguine_core.radial_profile(rows, _FINE_NM, radii_mm) * (2.0 * np.pi * radii_mm * np.gradient(radii_mm))
    spectra = [sanguine_core.reflectance(rows, _FINE_NM)]
    for depth_mm in (0.2, 0.5, 1.0, 2.0, 4.0):
        spectra.append(rings @ (np.arccos(np.clip(depth_mm / radii_mm, -1.0, 1.0)) / np.pi))
    fine = np.concatenate(spectra)
    at = np.searchsorted(_FINE_NM, WAVELENGTHS_NM)
    errors = delta_e(spectrum_to_xyz(fine[:, at]), spectrum_to_xyz(fine, _FINE_NM))
    return {"median": float(np.median(errors)), "max": float(errors.max())}
