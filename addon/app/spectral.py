"""Reflectance of a face per wavelength as a spectral EXR, in the layout of Fichet, Pacanowski and Wilkie 2021
("An OpenEXR Layout for Spectral Images", JCGT 10(3)): channels `T.550,000000nm` for a reflective image, R, G, B beside
them for programs that know nothing of spectra, `spectralLayoutVersion` in the header.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sanguine_core

from ..domain.errors import InputError, nearest
from ..domain.files import check_folder
from ..domain.parameters import PARAMETERS, Skin, skin_rows
from .map_files import MapHeader, check_channel, header_attributes

LAYOUT_VERSION = "1.0"
MAX_WAVELENGTHS = 61
"""64 channels in a file, less R, G and B."""

TOLERANCE = 0.001
"""Of the reflectance that is looked up against the one that is solved: a tenth of a percent of the light, a third of
what the reproducibility of a good spectrophotometer on skin is thought to be (a guess)."""

# Entries of a table: about four seconds of solving on two cores.
_MAX_ENTRIES = 100_000
_MAX_AXES = 5
# Texels at once: 11 MiB per corner of a table of 44 channels.
_CHUNK = 65_536

Progress = Callable[[int, int], bool]


@dataclass(frozen=True)
class SpectralReport:
    """table_error: the largest difference from the solver that was met, in reflectance, over `checked` places between the
    table's entries. nodes: parameter -> entries along it. wavelength_nm: those written.
    """

    table_error: float
    checked: int
    nodes: dict[str, int]
    wavelength_nm: tuple[float, ...]


def channel_name(wavelength_nm: float) -> str:
    """Of the reflective channel: six decimals, a comma for the point, since points divide layers in EXR."""
    return "T." + f"{wavelength_nm:.6f}".replace(".", ",") + "nm"


def write_spectral(
    path: str | os.PathLike[str],
    maps: Mapping[str, np.ndarray] | str | os.PathLike[str],
    skin: Skin,
    wavelengths_nm: Sequence[float] | np.ndarray,
    header: MapHeader | None = None,
    half: bool = True,
    tolerance: float = TOLERANCE,
    progress: Progress | None = None,
) -> SpectralReport:
    """Writes the reflectance of every texel: what `sanguine skin` calls so, under diffuse light, the film of oil taken off.

    maps: channel of the schema -> (H, W) float32, row 0 at the bottom, all of one size; or the path of a map file, which
    is then read in bands. What is not in them is taken from `skin`. wavelengths_nm: increasing, within 380 to 780, at
    most 61. Texels are looked up in a table over the channels that vary, refined until its error against the solver is
    within `tolerance`; the error is in the report and in the header. R, G, B are linear Rec.709 under D65 from the whole
    spectrum, whatever wavelengths are written. Memory does not depend on the height of the maps.
    progress(done, total) in rows; False stops with nothing written, as `sanguine_core.Cancelled`.

    Raises InputError.
    """
    wavelength_nm = _wavelengths(wavelengths_nm)
    if Path(path).suffix.lower() != ".exr":
        raise InputError(f"{path}: cannot be written: the extension .exr is allowed")
    with _Source(maps) as source:
        low, high = source.ranges()
        optical = _Table(skin, _optical_axes(low, high), lambda rows: _spectra(rows, wavelength_nm), tolerance)
        # What the oil's film reflects is a factor on all wavelengths, hence no axis of the large table.
        film = _Table(skin, _film_axes(low, high), lambda rows: sanguine_core.surface(rows)[:, :1], tolerance)
        names = [channel_name(nm) for nm in wavelength_nm] + ["R", "G", "B"]
        attributes = header_attributes(source.channels, header or MapHeader()) | {
            "spectralLayoutVersion": LAYOUT_VERSION,
            "sanguine:table_error": f"{optical.error:.2g}",
        }
        check_folder(Path(path).absolute().parent)
        Path(path).absolute().parent.mkdir(parents=True, exist_ok=True)
        try:
            with sanguine_core.MapWriter(path, source.width, source.height, names, attributes, half, True) as writer:
                for rows in source.bands():
                    texels = {name: values.reshape(-1) for name, values in rows.items()}
                    band = optical.look_up(texels) * (1.0 - film.look_up(texels))  # (N or 1, C)
                    band = np.broadcast_to(band, (next(iter(texels.values())).size, len(names)))
                    writer.write_rows(np.ascontiguousarray(band).reshape(-1, source.width, len(names)))
                    if progress and not progress(source.height - writer.rows_left, source.height):
                        raise sanguine_core.Cancelled("cancelled")
        except OSError as error:
            raise InputError(str(error)) from None
    return SpectralReport(optical.error, optical.checked, optical.nodes, tuple(map(float, wavelength_nm)))


def _wavelengths(wavelengths_nm: Sequence[float] | np.ndarray) -> np.ndarray:
    nm = np.atleast_1d(np.asarray(wavelengths_nm, dtype=np.float64))
    if not 1 <= nm.size <= MAX_WAVELENGTHS or nm.ndim != 1:
        raise InputError(f"wavelengths: {nm.size} of them, 1 to {MAX_WAVELENGTHS} are allowed")
    if not np.isfinite(nm).all() or (np.diff(nm) <= 0).any() or nm[0] < 380 or nm[-1] > 780:
        raise InputError("wavelengths: increasing values from 380 to 780 nm are allowed")
    return nm


def _spectra(rows: np.ndarray, wavelength_nm: np.ndarray) -> np.ndarray:
    """(N, W + 3): reflectance of bare skin, and its linear Rec.709."""
    colour_nm = np.arange(380.0, 781.0, 5.0)
    all_nm = np.union1d(colour_nm, wavelength_nm)
    spectra = sanguine_core.reflectance(rows, all_nm)
    colour = np.ascontiguousarray(spectra[:, np.isin(all_nm, colour_nm)])
    rgb = sanguine_core.linear_rgb(sanguine_core.xyz(colour, colour_nm), "rec709")
    return np.concatenate([spectra[:, np.isin(all_nm, wavelength_nm)], rgb], axis=1)


def _film_axes(low: Mapping[str, float], high: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    return {name: (low[name], high[name]) for name in ("oil", "roughness") if name in low}


def _optical_axes(low: Mapping[str, float], high: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Ranges of the channels that the light inside the skin depends on."""
    return {name: (low[name], high[name]) for name in low if name not in ("oil", "roughness")}


class _Source:
    """Maps in bands from the top down, each value within the range that the schema allows."""

    def __init__(self, maps: Mapping[str, np.ndarray] | str | os.PathLike[str]):
        self._reader: sanguine_core.RowReader | None = None
        self._maps: Mapping[str, np.ndarray] = {}
        if isinstance(maps, Mapping):
            self.where = "maps"
            self._maps = maps
            self.channels = tuple(maps)
            shapes = {name: np.shape(values) for name, values in maps.items()}
            if not shapes:
                raise InputError("maps: there is none")
            for name, shape in shapes.items():
                if len(shape) != 2 or 0 in shape or shape != shapes[self.channels[0]]:
                    raise InputError(f"maps: {name} has the shape {shape}, all need one and the same (H, W)")
            self.height, self.width = shapes[self.channels[0]]
        else:
            self.where = str(maps)
            try:
                self._reader = sanguine_core.RowReader(maps)
            except OSError as error:
                raise InputError(str(error)) from None
            self.channels = tuple(self._reader.channels)
            self.height, self.width = self._reader.height, self._reader.width
        allowed = [p.channel for p in PARAMETERS.values() if p.channel]
        for name in self.channels:
            if name not in allowed:
                raise InputError(f"{self.where}: channel {name[:80]!r} is no amount of a skin, {nearest(name[:80], allowed)}")

    def __enter__(self) -> _Source:
        return self

    def __exit__(self, *exception: object) -> None:
        if self._reader is not None:
            self._reader.close()

    def bands(self) -> Iterator[dict[str, np.ndarray]]:
        """channel -> (rows, W) float32, at most _CHUNK texels, the lowest row first."""
        rows = max(1, _CHUNK // self.width)
        for end in range(self.height, 0, -rows):
            first = max(end - rows, 0)
            if self._reader is None:
                band = {name: np.asarray(values[first:end], np.float32) for name, values in self._maps.items()}
            else:
                try:
                    pixels = self._reader.read_rows(first, end - first)
                except OSError as error:
                    raise InputError(str(error)) from None
                band = {name: pixels[..., i] for i, name in enumerate(self.channels)}
            yield band

    def ranges(self) -> tuple[dict[str, float], dict[str, float]]:
        """Least and greatest value of each channel, all of them checked."""
        low = dict.fromkeys(self.channels, math.inf)
        high = dict.fromkeys(self.channels, -math.inf)
        for band in self.bands():
            for name, values in band.items():
                check_channel(values, name, self.where)
                low[name] = min(low[name], float(values.min()))
                high[name] = max(high[name], float(values.max()))
        for name in self.channels:  # half may round a bound upward
            bounds = next(p for p in PARAMETERS.values() if p.channel == name)
            low[name] = min(max(low[name], bounds.hard_min), bounds.hard_max)
            high[name] = min(max(high[name], bounds.hard_min), bounds.hard_max)
        return low, high


class _Table:
    """Values of a function of skins on a grid, between which they are linear in each axis.

    The nodes stand evenly in the fourth root of an amount that absorbs, where reflectance bends least (tried: powers 1 to
    1/4, on reflectance, its logarithm and its inverse), and evenly in a share.
    """

    _POWER = {"hemoglobin": 0.25, "melanin": 0.25, "ink_per_mm": 0.25, "epidermis_thickness_mm": 0.25}

    def __init__(
        self,
        skin: Skin,
        ranges: Mapping[str, tuple[float, float]],
        solve: Callable[[np.ndarray], np.ndarray],
        tolerance: float,
    ):
        """ranges: channel -> least and greatest; those without a width are constants, and so is what is not in them."""
        ids = {p.channel: p.id for p in PARAMETERS.values() if p.channel}
        self._skin = dict(skin) | {ids[name]: low for name, (low, high) in ranges.items() if not high > low}
        self._axes = {name: (low, high) for name, (low, high) in ranges.items() if high > low}
        if len(self._axes) > _MAX_AXES:
            raise InputError(f"maps: {', '.join(self._axes)} all vary, {_MAX_AXES} of them may")
        powers = [self._POWER.get(name, 1.0) for name in self._axes]
        self._warped = [
            ((low**power, high**power), power) for (low, high), power in zip(self._axes.values(), powers, strict=True)
        ]
        self._columns = [list(PARAMETERS).index(ids[name]) for name in self._axes]
        self._solve = solve
        self._counts = [3] * len(self._axes)
        self._values = self._solve_grid()
        self.error, self.checked = self._refine(tolerance)
        self.nodes = dict(zip(self._axes, self._counts, strict=True))

    def look_up(self, texels: Mapping[str, np.ndarray]) -> np.ndarray:
        """(N, C) float32, of (N,) values per channel."""
        if not self._axes:
            return self._values  # one row for all
        return self._interpolate(
            np.stack([self._to_grid(k, np.asarray(texels[name], np.float64)) for k, name in enumerate(self._axes)])
        )

    def _to_grid(self, k: int, amount: np.ndarray) -> np.ndarray:
        """Amounts along axis k as places on 0 to count - 1."""
        (low, high), power = self._warped[k]
        place = (np.maximum(amount, 0.0) ** power - low) / (high - low)
        return np.clip(place, 0.0, 1.0) * (self._counts[k] - 1)

    def _amounts(self, places: np.ndarray) -> np.ndarray:
        """(N, P) skins at (A, N) places, each 0 to 1 along its axis."""
        rows = np.repeat(skin_rows([self._skin]), places.shape[1] if len(places) else 1, axis=0)
        for column, place, ((low, high), power), bounds in zip(
            self._columns, places, self._warped, self._axes.values(), strict=True
        ):
            rows[:, column] = np.clip((low + place * (high - low)) ** (1.0 / power), *bounds)
        return rows

    def _solve_grid(self) -> np.ndarray:
        """(entries, C) float32, the last axis fastest."""
        places = np.meshgrid(*(np.linspace(0.0, 1.0, count) for count in self._counts), indexing="ij")
        return self._solve(self._amounts(np.array([p.ravel() for p in places]))).astype(np.float32)

    def _interpolate(self, grid: np.ndarray) -> np.ndarray:
        """At (A, N) places on the grid."""
        cell = [np.minimum(g.astype(np.int64), count - 2) for g, count in zip(grid, self._counts, strict=True)]
        above = [(g - c).astype(np.float32) for g, c in zip(grid, cell, strict=True)]
        strides = [math.prod(self._counts[k + 1 :]) for k in range(len(self._counts))]
        base = sum(c * stride for c, stride in zip(cell, strides, strict=True))
        total = np.zeros((grid.shape[1], self._values.shape[1]), np.float32)
        part = np.empty_like(total)
        for corner in itertools.product((0, 1), repeat=len(strides)):
            weight = np.ones(grid.shape[1], np.float32)
            for up, share in zip(corner, above, strict=True):
                weight *= share if up else 1.0 - share
            np.take(self._values, base + sum(u * s for u, s in zip(corner, strides, strict=True)), axis=0, out=part, mode="clip")
            part *= weight[:, None]
            total += part
        return total

    def _refine(self, tolerance: float) -> tuple[float, int]:
        """Doubles the axis with the largest error until all is within the tolerance. Returns the error and the places met."""
        if not self._axes:
            return 0.0, 0
        places = np.random.default_rng(0).random((len(self._axes), 2048))  # the same ones every time
        solved = self._solve(self._amounts(places))
        while True:
            # Beside them, places in the middle of a cell along one axis and on nodes along the others: what this axis costs.
            along = [self._error(middles, self._solve(self._amounts(middles))) for middles in self._middles(places[:, :256])]
            error = max([self._error(places, solved), *along])
            worst = int(np.argmax(along))
            doubled = [2 * count - 1 if k == worst else count for k, count in enumerate(self._counts)]
            if error <= tolerance or math.prod(doubled) > _MAX_ENTRIES:
                return error, places.shape[1] + 256 * len(along)
            self._counts = doubled
            self._values = self._solve_grid()

    def _middles(self, places: np.ndarray) -> list[np.ndarray]:
        """Per axis, places moved to the middle of their cell along it and to the nearest nodes along the others."""
        cells = np.array(self._counts)[:, None] - 1
        nodes, middles = np.rint(places * cells) / cells, (np.floor(places * cells) + 0.5) / cells
        axes = np.arange(len(places))[:, None]
        return [np.where(axes == k, middles, nodes) for k in range(len(places))]

    def _error(self, places: np.ndarray, solved: np.ndarray) -> float:
        return float(np.abs(self._interpolate(places * (np.array(self._counts)[:, None] - 1)) - solved).max())
