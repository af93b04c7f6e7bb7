"""The `fit` use-case: what is in a skin, from its measured reflectance."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import sanguine_core

from ..domain.errors import InputError, nearest
from ..domain.files import read_text

SPECULAR = ("auto", "included", "excluded")
MIN_NM, MAX_NM, MIN_WAVELENGTHS = 380.0, 780.0, 8
SURFACE = "surface_reflectance"

# Where a result deserves a word. A misfit of 0.02 is twice that of one measured face in twenty (docs/measured_skin.md);
# below a tenth the prior's variance is untouched within what the estimate of the noise is worth.
_POOR_RMSE, _UNINFORMED, _ENTANGLED = 0.02, 0.1, 0.9
# Measured spectra leave 0.3 and more of the expected noise; only spectra made by a model are explained better.
_MODEL_NOISE = 0.2
_TRIAL_SPECTRA = 32


class Spectra:
    """The table of a SPECTRA.csv: `ids`, `wavelength_nm` (W,), `reflectance` (N, W), and the columns left out."""

    def __init__(self, ids: list[str], wavelength_nm: np.ndarray, reflectance: np.ndarray, ignored_nm: list[float]):
        self.ids, self.wavelength_nm, self.reflectance, self.ignored_nm = ids, wavelength_nm, reflectance, ignored_nm


def read_spectra(path: str | os.PathLike[str]) -> Spectra:
    """A header `id,380,390,…` (nm), then one spectrum a row, 0 to 1. Columns outside 380-780 nm are left out.

    Raises InputError, one line with file, line and column.
    """
    try:
        rows = [(n, row) for n, row in _numbered(io.StringIO(read_text(path).removeprefix("\ufeff"))) if row]
    except csv.Error as error:
        raise InputError(f"{path}: not valid CSV: {error}") from None
    if not rows:
        raise InputError(f"{path}: empty, needs a header 'id,380,390,…'")
    header = [cell.strip() for cell in rows[0][1]]
    nm = _header(path, header)

    ids: dict[str, int] = {}
    values = np.empty((len(rows) - 1, len(nm)))
    for k, (line, row) in enumerate(rows[1:]):
        where = f"{path}: line {line}"
        if len(row) != len(header):
            raise InputError(f"{where}: {len(row)} cells, the header has {len(header)}")
        name = row[0].strip()
        if not name:
            raise InputError(f"{where}: id: missing")
        if name in ids:
            raise InputError(f"{where}: id: {name!r} stands on line {ids[name]} already")
        ids[name] = line
        for w, cell in enumerate(row[1:]):
            values[k, w] = _reflectance(f"{where} ({name}): {header[w + 1]} nm", cell)
    inside = (nm >= MIN_NM) & (nm <= MAX_NM)
    if inside.sum() < MIN_WAVELENGTHS:
        raise InputError(
            f"{path}: {inside.sum()} wavelengths within {MIN_NM:g} to {MAX_NM:g} nm, a fit needs {MIN_WAVELENGTHS}"
        )
    return Spectra(list(ids), nm[inside], np.ascontiguousarray(values[:, inside]), nm[~inside].tolist())


def _numbered(text: io.StringIO) -> Any:
    reader = csv.reader(text, strict=True)
    for row in reader:
        yield reader.line_num, row


def _header(path: str | os.PathLike[str], header: Sequence[str]) -> np.ndarray:
    if header[0] != "id":
        raise InputError(f"{path}: line 1: the header begins with {header[0]!r}, needs 'id' and then wavelengths in nm")
    nm = np.empty(len(header) - 1)
    for k, cell in enumerate(header[1:]):
        try:
            nm[k] = float(cell)
        except ValueError:
            raise InputError(f"{path}: line 1: {cell!r} is not a wavelength in nm") from None
        if not (math.isfinite(nm[k]) and nm[k] > 0):
            raise InputError(f"{path}: line 1: {cell!r} is not a wavelength in nm")
        if k > 0 and nm[k] <= nm[k - 1]:
            raise InputError(f"{path}: line 1: {nm[k]:g} nm after {nm[k - 1]:g} nm: wavelengths must increase")
    return nm


def _reflectance(where: str, cell: str) -> float:
    if not cell.strip():
        raise InputError(f"{where}: missing")
    try:
        value = float(cell)
    except ValueError:
        raise InputError(f"{where}: {cell.strip()!r} is not a number") from None
    if not 0.0 <= value <= 1.0:  # also refuses a NaN
        hint = ", these look like percent" if 1.5 < value <= 100.0 else ""
        raise InputError(f"{where}: {value:g} is outside 0 to 1{hint}")
    return value


def priors(free: Sequence[str]) -> np.ndarray:
    """(F, 2) mean and standard deviation per row of `fit_parameters()`, wide for the names in `free`.

    Raises InputError for an unknown name.
    """
    rows = sanguine_core.fit_parameters()
    known = [row["id"] for row in rows]
    for name in free:
        if name not in known:
            raise InputError(f"--free: {name}: no parameter of a fit, {nearest(name, known)}")
    out = []
    for row in rows:
        if row["id"] in free:
            out.append((row["prior_mean"], row["freed_sd"]))
        elif row["held_at"] is not None:
            out.append((row["held_at"], 0.0))
        else:
            out.append((row["prior_mean"], row["prior_sd"]))
    return np.array(out)


def specular_included(spectra: Spectra, prior: np.ndarray, specular: str) -> bool:
    """Whether the spectra hold the surface's reflection.

    "auto" says yes, as instruments with a sphere do by default, unless the model explains them without it far better
    than any measured spectrum and clearly better than with it: then `sanguine skin` or its like has made them.
    """
    if specular != "auto" or not spectra.ids:
        return specular != "excluded"
    some = np.unique(np.linspace(0, len(spectra.ids) - 1, _TRIAL_SPECTRA).astype(int))
    sample = np.ascontiguousarray(spectra.reflectance[some])
    noise = [
        np.median(sanguine_core.fit(sample, spectra.wavelength_nm, specular_included=included, prior=prior)["noise"])
        for included in (False, True)
    ]
    return not (noise[0] < _MODEL_NOISE and noise[0] < 0.9 * noise[1])


def fit_report(
    spectra: Spectra,
    specular: str = "auto",
    free: Sequence[str] = (),
    progress: Callable[[int, int], bool] | None = None,
) -> dict[str, Any]:
    """The answer of `sanguine fit`."""
    prior = priors(free)
    included = specular_included(spectra, prior, specular)
    fit = sanguine_core.fit(
        spectra.reflectance, spectra.wavelength_nm, specular_included=included, prior=prior, progress=progress
    )
    difference = sanguine_core.delta_e_2000(
        _lab(spectra.reflectance, spectra.wavelength_nm), _lab(fit["reflectance"], spectra.wavelength_nm)
    )
    names = [row["id"] for row in sanguine_core.fit_parameters()]
    fitted = [i for i in range(len(names)) if prior[i, 1] > 0 and (included or names[i] != SURFACE)]
    results = [
        _result(k, name, fit, names, fitted) | {"delta_e_2000": float(difference[k])}
        for k, name in enumerate(spectra.ids)
    ]
    return {
        "sanguine": sanguine_core.__version__,
        "wavelength_nm": spectra.wavelength_nm.tolist(),
        "ignored_nm": spectra.ignored_nm,
        "specular": "included" if included else "excluded",
        "results": results,
    }


def _lab(reflectance: np.ndarray, wavelength_nm: np.ndarray) -> np.ndarray:
    return sanguine_core.lab(sanguine_core.xyz(reflectance, wavelength_nm))


def _result(k: int, name: str, fit: dict[str, np.ndarray], names: list[str], fitted: list[int]) -> dict[str, Any]:
    value, error, informed = fit["value"][k], fit["standard_error"][k], fit["informed"][k]
    at_bound = [names[i] for i in fitted if fit["at_bound"][k, i]]
    entangled = [
        {"parameters": [names[i], names[j]], "correlation": float(fit["correlation"][k, i, j])}
        for n, i in enumerate(fitted)
        for j in fitted[n + 1 :]
        if abs(fit["correlation"][k, i, j]) > _ENTANGLED
    ]
    warnings = []
    if fit["rmse"][k] > _POOR_RMSE:
        warnings.append(f"the model does not follow this spectrum: rmse {fit['rmse'][k]:.3f}")
    if not fit["converged"][k]:
        warnings.append("the search did not converge")
    if at_bound:
        warnings.append(f"at the end of the allowed range: {', '.join(at_bound)}")
    silent = [names[i] for i in fitted if informed[i] < _UNINFORMED]
    if silent:
        warnings.append(f"the spectrum says nothing about {', '.join(silent)}: the value is the prior's")
    return {
        "id": name,
        "parameters": {names[i]: float(value[i]) for i in fitted},
        "standard_errors": {names[i]: float(error[i]) for i in fitted},
        "identifiability": {names[i]: float(informed[i]) for i in fitted},
        "correlations": entangled,
        "at_bound": at_bound,
        "reflectance": fit["reflectance"][k].tolist(),
        "rmse": float(fit["rmse"][k]),
        "warnings": warnings,
    }
