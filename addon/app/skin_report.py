"""The `skin` use-case: what colour is this skin, and how far does light spread in it."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import sanguine_core

from ..domain.errors import InputError, nearest
from ..domain.files import read_json
from ..domain.lut import LOBES
from ..domain.parameters import skin_from, skin_rows

# Numbers of one answer: more would take gigabytes as JSON.
MAX_VALUES = 20_000_000

_WORKING_SPACE = "rec709"  # the contract names these outputs by it


def read_skins(path: str | os.PathLike[str]) -> tuple[list[str], list[dict[str, float]]]:
    """Ids and whole skins of a SKIN.json. Raises InputError."""
    data = read_json(path)
    if not isinstance(data, dict) or not isinstance(data.get("skins"), list):
        raise InputError(f'{path}: skins: missing, the file is {{"skins": [{{…}}, …]}}')
    for key in data:
        if key != "skins":
            raise InputError(f"{path}: {key}: unknown key, {nearest(key, ['skins'])}")
    ids, skins = [], []
    for i, item in enumerate(data["skins"]):
        if not isinstance(item, dict):
            raise InputError(f"{path}: skins.{i}: {item!r} is not an object")
        values = dict(item)
        name = values.pop("id", str(i))
        if not isinstance(name, str):
            raise InputError(f"{path}: skins.{i}.id: {name!r} is not a string")
        ids.append(name)
        skins.append(skin_from(values, f"{path}: skins.{i} ({name})"))
    return ids, skins


def report(ids: list[str], skins: list[dict[str, float]], wavelengths_nm: np.ndarray) -> dict[str, Any]:
    """The answer of `sanguine skin`.

    Everything but `surface_reflectance` is light that went through the skin: what the oil film reflects on
    average, E, is taken from it once, so `reflectance` is (1 - E) of the bare skin's.

    Raises InputError for more than MAX_VALUES numbers.
    """
    if not skins:
        return {"sanguine": sanguine_core.__version__, "results": []}
    if (total := len(skins) * len(wavelengths_nm)) > MAX_VALUES:
        raise InputError(
            f"--wavelengths: {len(wavelengths_nm)} of them for {len(skins)} skins are {total} numbers, at most"
            f" {MAX_VALUES} are allowed: ask for fewer at once"
        )
    rows = skin_rows(skins)
    film, surface = sanguine_core.surface(rows).T
    under_film = 1.0 - film
    reflectance = under_film[:, None] * sanguine_core.reflectance(rows, wavelengths_nm)
    # Colour is integrated on the tables' own grid, whatever wavelengths the caller wants to see.
    colour_nm = np.arange(380.0, 781.0, 5.0)
    xyz = sanguine_core.xyz(under_film[:, None] * sanguine_core.reflectance(rows, colour_nm), colour_nm)
    lab = sanguine_core.lab(xyz)
    rgb = sanguine_core.linear_rgb(xyz, _WORKING_SPACE)
    radii_mm = sanguine_core.default_radii_mm()
    fit = sanguine_core.burley_lobes(rows, _WORKING_SPACE, lobe_count=LOBES)
    results = []
    for i, name in enumerate(ids):
        spectral = sanguine_core.radial_profile(rows[i : i + 1], colour_nm, radii_mm)[0]  # (W, R) per mm^2
        profile = sanguine_core.linear_rgb(sanguine_core.xyz(np.ascontiguousarray(spectral.T), colour_nm), _WORKING_SPACE)
        results.append(
            {
                "id": name,
                "wavelength_nm": wavelengths_nm.tolist(),
                "reflectance": reflectance[i].tolist(),
                "surface_reflectance": float(surface[i]),
                "XYZ": xyz[i].tolist(),
                "Lab": lab[i].tolist(),
                "linear_rec709": rgb[i].tolist(),
                "profile": {
                    "radius_mm": radii_mm.tolist(),
                    "rec709_per_mm2": (under_film[i] * profile).tolist(),
                    "lobes": [
                        {"weight": (under_film[i] * fit["weights"][i, k]).tolist(), "d_mm": fit["d_mm"][i, k].tolist()}
                        for k in range(LOBES)
                    ],
                    "clamped": fit["clamped"][i].tolist(),
                },
            }
        )
    return {"sanguine": sanguine_core.__version__, "results": results}
