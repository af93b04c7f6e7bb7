"""The `invert` use-case: melanin, hemoglobin and oxygenation of every texel of a colour map.

`invert_tiles` works on arrays in memory, `invert_file` on files of any size, a band of rows at a time.
"""

from __future__ import annotations

import contextlib
import functools
import os
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import sanguine_core

from ..domain.errors import InputError
from ..domain.files import check_folder
from ..domain.parameters import Skin, default_skin, skin_rows
from ..domain.udim import FIRST_TILE, find_tiles, pattern_of
from .map_files import MapHeader, header_attributes

SPACES: dict[str, tuple[str, bool]] = {
    "srgb": ("rec709", True),
    "linear": ("rec709", False),
    "rec709": ("rec709", False),
    "rec2020": ("rec2020", False),
    "acescg": ("acescg", False),
}
"""Name on the command line -> primaries of the working space, and whether the values are sRGB-encoded."""

SHADING = ("off", "auto", "on")

# Steps of the files that round; floats do not, within what a picture is worth.
_QUANTUM = {"uint8": 1 / 255, "uint16": 1 / 65535}
_BAND_TEXELS = 1 << 22  # about 200 MB with all that is made of them
_RANGE = 0.001  # of the skin on either side that a range leaves out: single texels would widen every table
_AXES = tuple(axis["id"] for axis in sanguine_core.inversion_axes())
# columns of skin_map -> channels of chromophores.exr
_CHANNELS = {"melanin": 1, "hemoglobin": 0, "oxygenation": 3}

Progress = Callable[[str, int, int], object]


@functools.lru_cache(maxsize=4)
def _inverse(skin: tuple[float, ...], working_space: str | bytes, nodes: int) -> sanguine_core.SkinInverse:
    space = working_space if isinstance(working_space, str) else np.frombuffer(working_space).reshape(3, 3)
    return sanguine_core.SkinInverse(np.array(skin), space, nodes=nodes)


def inverse_for(
    skin: Skin, working_space: str | np.ndarray = "rec709", nodes: int = sanguine_core.INVERSION_NODES
) -> sanguine_core.SkinInverse:
    """The tables of a skin, of which melanin, hemoglobin and oxygenation play no part; the last few are kept.

    working_space: a name that `sanguine_core` knows or a 3x3 matrix from XYZ (D65) to RGB.
    """
    mapped = {key: (default_skin()[key] if key in _AXES else value) for key, value in skin.items()}
    if not isinstance(working_space, str):
        working_space = np.ascontiguousarray(working_space, dtype=np.float64).tobytes()
    return _inverse(tuple(skin_rows([mapped])[0]), working_space, nodes)


def invert_tiles(
    tiles: Mapping[int, np.ndarray],
    working_space: str | np.ndarray = "rec709",
    skin: Skin | None = None,
    *,
    shading: str = "auto",
    noise: float | None = None,
    quantum: float = 0.0,
    threads: int = 0,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Chromophores of a picture in memory, which may be several tiles: noise, light and what is skin are found over all.

    Parameters
    ----------
    tiles : UDIM tile (1001 for an ordinary picture) -> (H, W, 3) or (H, W, 4) float32, scene linear in `working_space`;
        the fourth channel is alpha (straight). What is not finite or has alpha 0 is not there.
    skin : the other parameters of the skin, by default the schema's
    shading : "off", "auto" or "on": whether light in the picture is split off
    noise : standard deviation in L*a*b*; None estimates it
    quantum : step between two values of the source, 1/255 for an 8-bit file

    Returns
    -------
    dict of tile -> array: skin_map (H, W, 4) float32: hemoglobin, melanin, oil (the skin's own), oxygenation, absolute and
    filled in where there is no skin; residual (H, W, 3): picture / look of the skin_map, shading included; mask (H, W):
    probability of skin; error (H, W): Delta E 2000 of the look to the picture without its shading. And over all tiles
    ranges: id -> (low, high) of the skin; report: what `sanguine invert` says of one picture.

    Raises InputError for an array that is no picture.
    """
    start = time.perf_counter()
    skin = default_skin() if skin is None else skin
    inverse = inverse_for(skin, working_space)
    pictures, overviews = [], []
    for tile, rgb in tiles.items():
        if rgb.ndim != 3 or rgb.shape[2] not in (3, 4) or rgb.size == 0:
            raise InputError(f"picture {tile}: shape {rgb.shape}, needs rows x columns x 3 or 4 channels")
        pictures.append(np.ascontiguousarray(rgb, dtype=np.float32))
        overviews.append(sanguine_core.PictureOverview(rgb.shape[1], rgb.shape[0]))
        overviews[-1].add(pictures[-1], threads=threads)
    models = sanguine_core.picture_models(inverse, overviews, shading, noise, quantum, threads)
    watch = None if progress is None else lambda done, total: progress("invert", done, total) is not False
    counts = sanguine_core.InversionCounts()
    made: dict[str, Any] = {}
    for tile, rgb, model in zip(tiles, pictures, models, strict=True):
        maps = sanguine_core.invert_rows(
            inverse, model, rgb, 0, 0, rgb.shape[0], shaded_residual=True, threads=threads, progress=watch
        )
        counts += maps.pop("counts")
        for name, image in maps.items():
            made.setdefault(name, {})[tile] = image
    report = _numbers(counts) | _light(models[0]) | {"seconds": time.perf_counter() - start}
    ranges = {key: (row["low"], row["high"]) for key, row in report["ranges"].items()}
    return made | {"ranges": ranges, "report": report}


def invert_pixels(rgb: np.ndarray, *arguments: Any, **named: Any) -> dict[str, Any]:
    """`invert_tiles` of one array, with arrays instead of tiles in the answer."""
    made = invert_tiles({FIRST_TILE: rgb}, *arguments, **named)
    return {name: found if name in ("ranges", "report") else found[FIRST_TILE] for name, found in made.items()}


class _Picture:
    """One file: where its red, green, blue and alpha are, and its rows from the top down."""

    def __init__(self, path: Path, files: contextlib.ExitStack):
        self.path = path
        self.reader = files.enter_context(sanguine_core.RowReader(path))
        self.width, self.height = self.reader.width, self.reader.height
        names = list(self.reader.channels)
        lower = [name.lower() for name in names]
        alpha = self.reader.alpha_channel
        try:
            self.columns = [lower.index(name) for name in ("r", "g", "b")]
        except ValueError:
            raise InputError(
                f"{path}: channels {', '.join(names)}: R, G and B are needed, a grey picture does not tell blood from melanin"
            ) from None
        if alpha is not None:
            self.columns.append(alpha)
        self.pixel_type = self.reader.pixel_type

    def bands(self) -> Iterator[tuple[int, int]]:
        """(first, count), the top band first: files are decoded from there."""
        rows = max(64, _BAND_TEXELS // self.width)
        for last in range(self.height, 0, -rows):
            yield max(0, last - rows), min(rows, last)

    def rows(self, first: int, count: int) -> np.ndarray:
        rows = self.reader.read_rows(first, count)
        if self.columns == list(range(rows.shape[2])):
            return rows
        return np.ascontiguousarray(rows[..., self.columns])


def invert_file(
    path: str | os.PathLike[str],
    out_dir: str | os.PathLike[str],
    *,
    skin: Skin | None = None,
    space: str = "auto",
    shading: str = "auto",
    noise: float | None = None,
    nodes: int = sanguine_core.INVERSION_NODES,
    threads: int = 0,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Writes chromophores.exr, error.exr, mask.exr, shading.exr and residual.exr into `out_dir`; returns the report.

    path : a picture; one of a UDIM set or its pattern stands for the whole set, whose files are then written as
        `chromophores.1001.exr` and so on
    space : a key of SPACES; "auto" takes integers for sRGB-encoded and floats for linear Rec. 709

    A picture of any size takes the memory of some bands of rows. Raises InputError, one line that names the file.
    """
    start = time.perf_counter()
    tiles = find_tiles(path)
    check_folder(out_dir)
    skin = default_skin() if skin is None else skin
    halo = sanguine_core.INVERSION_HALO
    try:
        with contextlib.ExitStack() as files:
            pictures = {tile: _Picture(file, files) for tile, file in tiles.items()}
            chosen = _space(pictures, space)
            working_space, srgb = SPACES[chosen]
            inverse = inverse_for(skin, working_space, nodes)

            total = sum(picture.height for picture in pictures.values())
            done = 0
            overviews = []
            for picture in pictures.values():
                overview = sanguine_core.PictureOverview(picture.width, picture.height)
                for first, count in picture.bands():
                    overview.add(picture.rows(first, count), first, srgb, threads)
                    done += count
                    _say(progress, "overview", done, total)
                overviews.append(overview)
            quantum = max(_QUANTUM.get(picture.pixel_type, 0.0) for picture in pictures.values())
            models = sanguine_core.picture_models(inverse, overviews, shading, noise, quantum, threads)

            counts = sanguine_core.InversionCounts()
            done = 0
            several = pattern_of(path) is not None
            written = []
            for (tile, picture), model in zip(pictures.items(), models, strict=True):
                ending = f".{tile}.exr" if several else ".exr"
                with _Writers(Path(out_dir), ending, picture, working_space) as writers:
                    for first, count in picture.bands():
                        low, high = max(0, first - halo), min(picture.height, first + count + halo)
                        made = sanguine_core.invert_rows(
                            inverse, model, picture.rows(low, high - low), low, first, count, srgb,
                            wanted=["skin_map", "residual", "mask", "error", "shading"], threads=threads,
                        )
                        writers.write(made)
                        counts += made["counts"]
                        done += count
                        _say(progress, "invert", done, total)
                written.append(
                    {"tile": tile if several else None, "width": picture.width, "height": picture.height,
                     "files": [str(name) for name in writers.paths]}
                )
    except sanguine_core.ImageError as error:
        raise InputError(str(error)) from None

    report = {"sanguine": sanguine_core.__version__, "space": chosen, "tiles": written}
    report |= _numbers(counts) | _light(models[0])
    report["warnings"] = _warnings(report)
    report["seconds"] = time.perf_counter() - start
    return report


def _say(progress: Progress | None, what: str, done: int, total: int) -> None:
    if progress is not None:
        progress(what, done, total)


def _space(pictures: Mapping[int, _Picture], space: str) -> str:
    if space != "auto":
        return space
    kinds = {("srgb" if "int" in picture.pixel_type else "linear"): picture.path for picture in pictures.values()}
    if len(kinds) > 1:
        raise InputError(f"{kinds['srgb']}: holds integers, {kinds['linear']} floats: say what they are by --space")
    return next(iter(kinds))


class _Writers:
    """The maps of one picture: all of them appear, or none that was begun."""

    def __init__(self, folder: Path, ending: str, picture: _Picture, working_space: str):
        channels = {
            "chromophores": list(_CHANNELS), "error": ["error"], "mask": ["mask"], "shading": ["shading"],
            "residual": ["R", "G", "B"],
        }
        self.paths = [folder / (name + ending) for name in channels]
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: cannot be made: {error.strerror}") from None
        self._stack = contextlib.ExitStack()
        self._writers = {
            name: self._stack.enter_context(
                sanguine_core.MapWriter(
                    path, picture.width, picture.height, names,
                    header_attributes(names, MapHeader()) | {"sanguine:working_space": working_space}, True, True,
                )
            )
            for (name, names), path in zip(channels.items(), self.paths, strict=True)
        }

    def __enter__(self) -> _Writers:
        return self

    def __exit__(self, *error: Any) -> bool | None:
        return self._stack.__exit__(*error)

    def write(self, made: dict[str, Any]) -> None:
        self._writers["chromophores"].write_rows(np.ascontiguousarray(made["skin_map"][..., list(_CHANNELS.values())]))
        self._writers["residual"].write_rows(made["residual"])
        for name in ("error", "mask", "shading"):
            self._writers[name].write_rows(made[name][..., None])


def _numbers(counts: sanguine_core.InversionCounts) -> dict[str, Any]:
    """Errors and ranges. A range leaves out `_RANGE` of the skin on either side."""
    ranges = {}
    for k, name in enumerate(_AXES):
        values = np.array([counts.point_at(k, share) for share in (_RANGE, 0.5, 1 - _RANGE)])
        if name != "oxygenation":
            values = np.exp(values)
        ranges[name] = dict(zip(("low", "median", "high"), values.tolist(), strict=True)) if counts.skin else {
            key: default_skin()[name] for key in ("low", "median", "high")
        }
    return {
        "delta_e_2000": {"median": counts.error_at(0.5), "p95": counts.error_at(0.95)},
        "share_masked": 1 - counts.skin / counts.texels,
        "share_missing": 1 - counts.there / counts.texels,
        "ranges": ranges,
    }


def _light(model: sanguine_core.PictureModel) -> dict[str, Any]:
    return {
        "noise_lab": model.noise_sd,
        "shading": {
            "found": model.shading_found,
            "pigment_explains": model.shading_pigment,
            "kept": model.shading_kept,
            "exposure": float(np.exp(model.exposure)),
        },
    }


def _warnings(report: dict[str, Any]) -> list[str]:
    out = []
    if report["share_masked"] > 0.98:
        out.append("almost nothing in this picture has the colour of skin: is --space right?")
    return out
