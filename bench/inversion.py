"""Inversion of colour maps: round trip, noise, and what a texel costs; writes docs/inversion.md.

    .venv/bin/python bench/inversion.py [--quick]

Colour maps are made from known chromophores of a head with all that grows on it, by a table of `reflectance()` of its
own (cubic splines through other nodes than the inversion's), inverted, and rendered again by the same table. Times are
those of one run, each beside a NumPy version of the same method and a copy of the same bytes. Exit status 1 if a bar is
missed.
"""

from __future__ import annotations

import argparse
import functools
import importlib.util
import io
import json
import os
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import sanguine_core as core
from PIL import Image
from sanguine.app.faces import example_head, head_surface
from sanguine.app.map_cache import MapCache
from sanguine.app.maps import Grown
from sanguine.domain.blood import ANATOMY, Rest
from sanguine.domain.effects import Growth
from sanguine.domain.parameters import PARAMETERS, default_skin, skin_rows
from scipy.ndimage import gaussian_filter, map_coordinates, spline_filter, uniform_filter

ROOT = Path(__file__).resolve().parents[1]
AXES = core.inversion_axes()
COLUMNS = [list(PARAMETERS).index(axis["id"]) for axis in AXES]

# Melanin of the epidermis at 0.1 mm, and blood: the help of `melanin` in the schema, docs/measured_skin.md.
SKINS = {
    "very light": (0.012, 0.012),
    "light": (0.02, 0.013),
    "intermediate": (0.03, 0.014),
    "tan": (0.045, 0.015),
    "dark": (0.13, 0.018),
}
KNOWN = SKINS | {"very dark": (0.3, 0.018)}
LIGHT_TO_TAN = ("very light", "light", "intermediate", "tan")
BARS = {"delta_e_median": 0.5, "delta_e_p95": 2.0, "melanin_correlation": 0.98, "hemoglobin_correlation": 0.9, "seconds_4k": 2.0}


class Optics:
    """Colours of the default skin over (ln melanin, ln hemoglobin, oxygenation), apart from the inversion's own tables."""

    counts = (48, 44, 13)

    def __init__(self) -> None:
        self.low = np.array([axis["lower"] for axis in AXES])
        self.high = np.array([axis["upper"] for axis in AXES])
        nodes = [np.linspace(lo, hi, n) for lo, hi, n in zip(self.low, self.high, self.counts, strict=True)]
        points = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1).reshape(-1, 3)
        self.roots = [
            spline_filter(np.cbrt(channel).reshape(self.counts)) for channel in self.solve(points).T
        ]

    @staticmethod
    def solve(points: np.ndarray) -> np.ndarray:
        """(N, 3) XYZ / 100 of points, without any table."""
        rows = np.repeat(skin_rows([default_skin()]), len(points), axis=0)
        rows[:, COLUMNS] = np.column_stack([np.exp(points[:, :2]), points[:, 2]])
        rows[:, COLUMNS] = np.clip(rows[:, COLUMNS], 0, [PARAMETERS[axis["id"]].hard_max for axis in AXES])
        nm = np.arange(380.0, 781.0, 5.0)
        return (1 - core.surface(rows)[:, :1]) * core.xyz(core.reflectance(rows, nm), nm) / 100

    def xyz(self, points: np.ndarray) -> np.ndarray:
        """(..., 3) XYZ / 100 of points (..., 3)."""
        flat = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        at = ((flat - self.low) / (self.high - self.low) * (np.array(self.counts) - 1)).T
        roots = [map_coordinates(table, at, order=3, mode="nearest", prefilter=False) for table in self.roots]
        return (np.stack(roots, axis=-1) ** 3).reshape(points.shape)


@functools.lru_cache(maxsize=1)
def grown_head(size: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Changes by region and layers of all features for `points_of`, and where there is skin, of the example head."""
    surface = head_surface(example_head("female"))
    rest = [ANATOMY.get(region, Rest()) for region in surface.regions]
    change = np.array([[r.melanin - 1, r.hemoglobin - 1, r.oxygenation] for r in rest], dtype=np.float32)
    values = np.column_stack([surface.region_weights @ change, np.ones(len(surface.region_weights), np.float32)])
    drawn = core.rasterize_uv(
        surface.uv, surface.triangles, values[surface.corner_vertex].astype(np.float32), size, size, 16, np.zeros(4, np.float32)
    )
    grown = Grown(surface, Growth(seed=seed, age_years=35.0, sun=0.6), size, MapCache(None))
    everything = {row["id"]: 1.0 for row in core.features()}
    layers = grown.compose(everything, ("log_melanin", "log_hemoglobin", "oxygenation"))
    return drawn[..., :3], layers, drawn[..., 3] > 0.5


def truth_points(size: int, name: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """((size, size, 3) points, (size, size) where there is skin) of a head with all that grows on it."""
    change, layers, there = grown_head(size, seed)
    return points_of(name, change, layers, seed), there


def noise_points(size: int, name: str, seed: int) -> np.ndarray:
    """The same ranges without a head: broad regions and small spots."""
    random = np.random.default_rng(seed)

    def field(sigma: float) -> np.ndarray:
        values = gaussian_filter(random.normal(size=(size, size)), sigma * size, mode="wrap")
        return (values / values.std()).astype(np.float32)

    change = np.stack([0.1 * field(0.08), 0.3 * field(0.06), 0.04 * field(0.1)], axis=-1)
    spots = np.clip(field(0.006) - 1.5, 0, 1)
    layers = np.stack([0.9 * spots, 0.6 * np.clip(field(0.01) - 1.5, 0, 1), np.zeros_like(spots)], axis=-1)
    return points_of(name, change, layers, seed)


def points_of(name: str, change: np.ndarray, layers: np.ndarray, seed: int) -> np.ndarray:
    """Points of a skin whose chromophores are changed by region (factors less 1) and by layers (ln), and a little mottled."""
    random = np.random.default_rng(seed)
    size = change.shape[0]
    mottle = [gaussian_filter(random.normal(size=(size, size)), s * size / 1024, mode="wrap") for s in (2.0, 5.0)]
    melanin, hemoglobin = SKINS[name]
    points = np.empty((size, size, 3), dtype=np.float32)
    points[..., 0] = np.log(melanin * (1 + change[..., 0])) + layers[..., 0] + 0.05 * mottle[0] / mottle[0].std()
    points[..., 1] = np.log(hemoglobin * (1 + change[..., 1])) + layers[..., 1] + 0.1 * mottle[1] / mottle[1].std()
    points[..., 2] = 0.75 + change[..., 2] + layers[..., 2]
    low, high = (np.array([axis[end] for axis in AXES], dtype=np.float32) for end in ("lower", "upper"))
    return np.clip(points, low, high)


def srgb(linear: np.ndarray) -> np.ndarray:
    linear = np.clip(linear, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def degraded(linear: np.ndarray, how: str) -> tuple[np.ndarray, bool, float]:
    """(pixels, whether sRGB-encoded, quantum) of a linear picture."""
    if how == "float":
        return linear.astype(np.float32), False, 0.0
    encoded = srgb(linear)
    if how.startswith("noise"):
        encoded = encoded + np.random.default_rng(11).normal(0, float(how.split()[1]) / 255, encoded.shape)
    eight = np.round(np.clip(encoded, 0, 1) * 255).astype(np.uint8)
    if how == "jpeg":
        file = io.BytesIO()
        Image.fromarray(eight).save(file, "JPEG", quality=85)
        eight = np.array(Image.open(file))
    return (eight / 255).astype(np.float32), True, 1 / 255


def invert(tables: core.SkinInverse, pixels: np.ndarray, encoded: bool, quantum: float, noise: float | None = None,
           shading: str = "auto") -> tuple[core.PictureModel, dict]:
    height, width = pixels.shape[:2]
    overview = core.PictureOverview(width, height)
    overview.add(pixels, 0, encoded)
    model = core.picture_models(tables, [overview], shading, noise, quantum)[0]
    wanted = ["skin_map", "residual", "mask", "error", "shading"]
    return model, core.invert_rows(tables, model, pixels, 0, 0, height, encoded, wanted=wanted)


def found_points(made: dict) -> np.ndarray:
    skin = made["skin_map"]
    return np.stack([np.log(skin[..., 1]), np.log(skin[..., 0]), skin[..., 3]], axis=-1)


def round_trip(optics: Optics, tables: core.SkinInverse, points: np.ndarray, there: np.ndarray, how: str = "float",
               noise: float | None = None) -> dict[str, float]:
    """What an inversion makes of a picture of `points`, and what of it is true."""
    xyz = optics.xyz(points)
    flat = np.ascontiguousarray(xyz.reshape(-1, 3))
    linear = np.where(there[..., None], core.linear_rgb(100 * flat).reshape(xyz.shape), 0.2)
    pixels, encoded, quantum = degraded(linear, how)
    pixels = np.dstack([pixels, there.astype(np.float32)])
    model, made = invert(tables, pixels, encoded, quantum, noise)
    found = found_points(made)
    seen = core.delta_e_2000(
        core.lab(np.ascontiguousarray(100 * xyz[there])), core.lab(np.ascontiguousarray(100 * optics.xyz(found[there])))
    )
    corr = [float(np.corrcoef(found[there][:, k], points[there][:, k])[0, 1]) for k in range(3)]
    off = found[there] - points[there]
    return {
        "delta_e_median": float(np.median(seen)),
        "delta_e_p95": float(np.percentile(seen, 95)),
        "melanin_correlation": corr[0],
        "hemoglobin_correlation": corr[1],
        "oxygenation_correlation": corr[2],
        "melanin_rms": float(np.sqrt(np.mean(off[:, 0] ** 2))),
        "hemoglobin_rms": float(np.sqrt(np.mean(off[:, 1] ** 2))),
        "oxygenation_rms": float(np.sqrt(np.mean(off[:, 2] ** 2))),
        "noise_lab": model.noise_sd,
        "masked": float((made["mask"][there] < 0.5).mean()),
        "shading_kept": model.shading_kept,
        "exposure": float(np.exp(model.exposure)),
    }


def blood_under_melanin(optics: Optics) -> list[dict[str, float]]:
    """What halving the blood does to the colour, and how far the colour alone knows the blood."""
    rows = []
    for name, (melanin, hemoglobin) in KNOWN.items():
        point = np.array([[np.log(melanin), np.log(hemoglobin), 0.75]])
        half = point - [[0, np.log(2), 0]]
        lab = [core.lab(100 * optics.solve(p)) for p in (point, half)]
        step = 0.02
        by = np.stack([
            (core.lab(100 * optics.solve(point + step * np.eye(3)[k])) - core.lab(100 * optics.solve(point - step * np.eye(3)[k])))[0]
            / (2 * step) for k in range(3)
        ], axis=1)
        prior = np.diag([1 / axis["sd"] ** 2 for axis in AXES])
        for label, sd in (("lab_1", 1.0), ("lab_03", 0.3)):
            covariance = np.linalg.inv(by.T @ by / sd**2 + prior)
            rows.append({"skin": name, "noise": sd, "halved": float(core.delta_e_2000(*lab)[0]),
                         **{axis["id"]: float(np.sqrt(covariance[k, k])) for k, axis in enumerate(AXES)}})
    return rows


# ---- the same method in NumPy


class NumpyInversion:
    """Tables by `map_coordinates`, everything else whole arrays in single precision, in bands that stay in the cache."""

    def __init__(self, tables: core.SkinInverse):
        low, high = (np.array(v, dtype=np.float32) for v in tables.lab_range)
        n = tables.nodes
        axes = [np.linspace(low[k], high[k], n, dtype=np.float32) for k in range(3)]
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        points = tables.point(np.ascontiguousarray(nodes))
        self.inverse = [np.ascontiguousarray(points[:, k].reshape(n, n, n)) for k in range(3)]
        self.lab_low, self.lab_scale = low, (n - 1) / (high - low)
        shape = (65, 57, 9)
        self.low = np.array([axis["lower"] for axis in AXES], dtype=np.float32)
        self.scale = np.array([(m - 1) / (axis["upper"] - axis["lower"]) for m, axis in zip(shape, AXES, strict=True)], np.float32)
        axes = [np.linspace(axis["lower"], axis["upper"], m, dtype=np.float32) for m, axis in zip(shape, AXES, strict=True)]
        lab = tables.lab(np.ascontiguousarray(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)))
        self.forward = [np.ascontiguousarray(lab[:, k].reshape(shape)) for k in range(3)]
        eye = np.eye(3)
        white = core.xyz(np.ones((1, 81)), np.arange(380.0, 781.0, 5.0))
        self.rgb_from_xyz = (core.linear_rgb(eye * 100).T * (white / 100)).astype(np.float32)  # of XYZ per white
        self.xyz_from_rgb = np.linalg.inv(self.rgb_from_xyz).astype(np.float32)

    def __call__(self, rgb: np.ndarray, model: core.PictureModel, band: int = 64) -> dict[str, np.ndarray]:
        height, width = rgb.shape[:2]
        out = {
            "skin_map": np.empty((height, width, 4), np.float32), "residual": np.empty((height, width, 3), np.float32),
            "mask": np.empty((height, width), np.float32), "error": np.empty((height, width), np.float32),
        }
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(lambda first: self._band(rgb, model, first, min(band, height - first), out), range(0, height, band)))
        return out

    def _lab(self, rgb: np.ndarray) -> np.ndarray:
        f = np.cbrt(np.maximum(rgb, 0) @ self.xyz_from_rgb.T)
        return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])])

    def _band(self, rgb: np.ndarray, model: core.PictureModel, first: int, count: int, out: dict[str, np.ndarray]) -> None:
        halo = core.INVERSION_HALO if model.noise_sd > 0 else 0
        low, high = max(0, first - halo), min(len(rgb), first + count + halo)
        lab = self._lab(rgb[low:high])
        at = (lab - self.lab_low[:, None, None]) * self.lab_scale[:, None, None]
        points = [map_coordinates(table, at, order=1, mode="nearest", output=np.float32) for table in self.inverse]
        if halo:
            noise = 1e-4  # its size does not matter for the time
            for k in range(3):
                mean = uniform_filter(points[k], 2 * halo + 1, mode="nearest")
                spread = uniform_filter((points[k] - model.centre[k]) ** 2, 2 * halo + 1, mode="nearest") - (mean - model.centre[k]) ** 2
                share = np.maximum(spread - noise, 0) / np.maximum(spread, 1e-12)
                points[k] = mean + share * (points[k] - mean)
        inner = slice(first - low, first - low + count)
        lab = lab[:, inner]
        point = np.stack([p[inner] for p in points])
        at = (point - self.low[:, None, None]) * self.scale[:, None, None]
        back = np.stack([map_coordinates(table, at, order=1, mode="nearest", output=np.float32) for table in self.forward])
        far = np.maximum(np.sqrt(((lab - back) ** 2).sum(0)) - 3, 0) / 3
        for k, (above, below) in enumerate(((1.6, 1.6), (2.5, 1.8))):
            d = point[k] - model.centre[k]
            far = far + np.maximum(d - above, 0) + np.maximum(-d - below, 0)
        rows = slice(first, first + count)
        out["mask"][rows] = np.exp(-0.5 * far * far)
        out["error"][rows] = numpy_delta_e(lab, back)
        y = (back[0] + 16) / 116
        xyz = np.stack([y + back[1] / 500, y, y - back[2] / 200], axis=-1) ** 3
        out["residual"][rows] = rgb[rows] / np.maximum(xyz @ self.rgb_from_xyz.T, 1e-4)
        skin = out["skin_map"][rows]
        skin[..., 0], skin[..., 1], skin[..., 2], skin[..., 3] = np.exp(point[1]), np.exp(point[0]), 0.3, point[2]


def numpy_delta_e(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """CIEDE2000 of (3, H, W) arrays; equation numbers of Sharma et al. 2005 in colour.cpp."""
    (l1, a1, b1), (l2, a2, b2) = one, two
    chroma = 0.5 * (np.hypot(a1, b1) + np.hypot(a2, b2))
    c7 = chroma**7
    g = 1.5 - 0.5 * np.sqrt(c7 / (c7 + 25.0**7))
    p1, p2 = g * a1, g * a2
    c1, c2 = np.hypot(p1, b1), np.hypot(p2, b2)
    h1, h2 = np.arctan2(b1, p1), np.arctan2(b2, p2)
    turn = np.remainder(h2 - h1 + np.pi, 2 * np.pi) - np.pi
    h = h1 + 0.5 * turn
    dh = 2 * np.sqrt(c1 * c2) * np.sin(0.5 * turn)
    t = (1 - 0.17 * np.cos(h - np.pi / 6) + 0.24 * np.cos(2 * h) + 0.32 * np.cos(3 * h + np.pi / 30)
         - 0.20 * np.cos(4 * h - 63 * np.pi / 180))
    c = 0.5 * (c1 + c2)
    l50 = (0.5 * (l1 + l2) - 50) ** 2
    c7 = c**7
    turned = np.exp(-(((np.degrees(np.remainder(h, 2 * np.pi)) - 275) / 25) ** 2)) * (np.pi / 3)
    rt = -2 * np.sqrt(c7 / (c7 + 25.0**7)) * np.sin(turned)
    x = (l2 - l1) / (1 + 0.015 * l50 / np.sqrt(20 + l50))
    y, z = (c2 - c1) / (1 + 0.045 * c), dh / (1 + 0.015 * c * t)
    return np.sqrt(np.maximum(x * x + y * y + z * z + rt * y * z, 0))


# ---- times


def fastest(work: Callable[[], object], repeats: int, clock: Callable[[], float] = time.perf_counter) -> float:
    """Seconds of the fastest of some runs: what else the machine does only adds."""
    best = np.inf
    for _ in range(repeats):
        start = clock()
        made = work()
        best = min(best, clock() - start)
        del made
    return float(best)


def picture(tables: core.SkinInverse, size: int) -> np.ndarray:
    points = np.ascontiguousarray(noise_points(min(size, 1024), "light", 3))
    times = size // points.shape[0]
    linear = tables.rgb_of_lab(tables.lab(points.reshape(-1, 3))).reshape(points.shape)
    return np.ascontiguousarray(np.tile(linear, (times, times, 1)))


def times(tables: core.SkinInverse, sizes: list[int], repeats: int) -> list[dict[str, float]]:
    by_numpy = NumpyInversion(tables)
    rows = []
    for size in sizes:
        rgb = picture(tables, size)
        overview = core.PictureOverview(size, size)
        overview.add(rgb)
        seen = [None, None]
        for k, noise in enumerate((0.0, 0.3)):
            seen[k] = core.picture_models(tables, [overview], "auto", noise)[0]

        def bare(noise: float) -> dict:
            o = core.PictureOverview(size, size)
            o.add(rgb)
            m = core.picture_models(tables, [o], "auto", noise)[0]
            return core.invert_rows(tables, m, rgb, 0, 0, size)

        source = np.ones((size, size, 12), np.float32)

        def copy() -> np.ndarray:
            # As many bytes as are read (3 floats a texel) and written (9 floats a texel), half of them each way.
            return source[: size // 2].copy()

        row = {
            "size": size,
            "seconds": fastest(lambda: bare(0.3), repeats),
            "seconds_without_noise": fastest(lambda: bare(0.0), repeats),
            "seconds_rows_1_thread": fastest(lambda: core.invert_rows(tables, seen[1], rgb, 0, 0, size, threads=1), 1),
            "numpy": fastest(lambda: by_numpy(rgb, seen[1]), 1 if size > 2048 else 2),
            "numpy_without_noise": fastest(lambda: by_numpy(rgb, seen[0]), 1 if size > 2048 else 2),
            "copy": fastest(copy, repeats),
            # Of all threads together: what a busy machine does not change.
            "cpu_seconds": fastest(lambda: bare(0.3), repeats, time.process_time),
            "cpu_numpy": fastest(lambda: by_numpy(rgb, seen[1]), 1, time.process_time),
            "cpu_copy": fastest(copy, repeats, time.process_time),
        }
        ours, theirs = core.invert_rows(tables, seen[0], rgb[:256], 0, 0, 253), by_numpy(rgb[:256], seen[0])
        inside = np.s_[:253]
        row["differs_from_numpy"] = float(np.abs(np.log(ours["skin_map"][..., :2] / theirs["skin_map"][inside][..., :2])).max())
        rows.append(row)
        print(json.dumps(row), file=sys.stderr)
    return rows


def lut_sizes(optics: Optics, sizes: list[int], points: np.ndarray, repeats: int) -> list[dict[str, float]]:
    skin = skin_rows([default_skin()])[0]
    rows = []
    there = np.ones(points.shape[:2], bool)
    for nodes in sizes:
        build = fastest(lambda: core.SkinInverse(skin, nodes=nodes), 2)
        tables = core.SkinInverse(skin, nodes=nodes)
        rgb = picture(tables, 2048)
        row = {"nodes": nodes, "megabytes": tables.bytes / 1e6, "build_seconds": build,
               "seconds_2k": fastest(lambda: invert(tables, rgb, False, 0.0, 0.3), repeats)}
        row |= round_trip(optics, tables, points, there, noise=0.0)
        rows.append(row)
        print(json.dumps(row), file=sys.stderr)
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="small pictures, nothing is written")
    parser.add_argument("--page", action="store_true", help="write the page and the portrait anew, from the last results")
    options = parser.parse_args()
    results = ROOT / "bench/results/inversion.json"
    if options.page:
        write_page(json.loads(results.read_text(encoding="utf-8")))
        return 0
    quick = options.quick
    size, repeats = (384, 1) if quick else (1024, 3)

    optics = Optics()
    random = np.random.default_rng(0)
    some = np.stack([random.uniform(axis["lower"], axis["upper"], 2000) for axis in AXES], axis=1)
    own = core.delta_e_2000(core.lab(100 * optics.solve(some)), core.lab(np.ascontiguousarray(100 * optics.xyz(some))))
    result: dict = {"sanguine": core.__version__, "load": os.getloadavg()[0], "size": size,
                    "features": [row["id"] for row in core.features()],
                    "truth_table_delta_e": {"median": float(np.median(own)), "max": float(own.max())}}
    tables = core.SkinInverse(skin_rows([default_skin()])[0])
    result["round_trip"], result["degraded"] = {}, {}
    for name in SKINS:
        points, there = truth_points(size, name, 1)
        result["round_trip"][name] = round_trip(optics, tables, points, there)
        print(name, json.dumps(result["round_trip"][name]), file=sys.stderr)
        if name in ("light", "dark"):
            for how in ("float", "8 bits", "noise 1", "noise 3", "jpeg"):
                for label, noise in (("", None), (" raw", 0.0)):
                    result["degraded"][f"{name}|{how}{label}"] = row = round_trip(optics, tables, points, there, how, noise)
                    print(name, how + label, json.dumps(row), file=sys.stderr)
    result["blood_under_melanin"] = blood_under_melanin(optics)
    result["lut"] = lut_sizes(optics, [9, 17, 33] if quick else [9, 17, 25, 33, 49, 65], noise_points(512, "light", 5), repeats)
    result["times"] = times(tables, [1024] if quick else [1024, 2048, 4096], repeats)

    missed = bars(result)
    if not quick:
        results.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        write_page(result)
    for line in missed:
        print(f"missed: {line}", file=sys.stderr)
    return 1 if missed else 0


def write_page(result: dict) -> None:
    portrait(ROOT / "docs/inversion_astronaut.png")
    (ROOT / "docs/inversion.md").write_text(page(result), encoding="utf-8")


def bars(result: dict) -> list[str]:
    missed = []
    for name in SKINS:
        row = result["round_trip"][name]
        for key in ("delta_e_median", "delta_e_p95"):
            if row[key] > BARS[key]:
                missed.append(f"{name}: {key} {row[key]:.3f}, at most {BARS[key]}")
        if name in LIGHT_TO_TAN:
            for key in ("melanin_correlation", "hemoglobin_correlation"):
                if row[key] < BARS[key]:
                    missed.append(f"{name}: {key} {row[key]:.4f}, at least {BARS[key]}")
    for row in result["times"]:
        # The clock of a busy machine says how busy it is; then processor time over two cores stands for it.
        seconds = row["seconds"] if result["load"] < 1.5 else row["cpu_seconds"] / 2
        if row["size"] == 4096 and seconds > BARS["seconds_4k"]:
            missed.append(f"4096: {seconds:.2f} s, at most {BARS['seconds_4k']}")
    return missed


# Near the measured faces of docs/measured_skin.md.
MEASURED = {"scatter_scale": 1.3, "scatter_power": 0.6, "vessel_radius_mm": 0.008, "epidermis_thickness_mm": 0.08}


def portrait(path: Path) -> None:
    """The face of Eileen Collins (NASA, public domain; inside scikit-image, of which only the picture is read)."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    package = importlib.util.find_spec("skimage")  # found, not imported
    if package is None:
        sys.exit("inversion: pip install --no-deps -r tools/requirements-bench.txt")
    picture = np.array(Image.open(Path(package.origin).parent / "data/astronaut.png").convert("RGB"))[55:190, 165:290]
    encoded = np.ascontiguousarray(picture[::-1] / np.float32(255))
    tables = core.SkinInverse(skin_rows([default_skin() | MEASURED])[0])
    _, made = invert(tables, encoded, True, 1 / 255)
    points = found_points(made)

    def look(points: np.ndarray) -> np.ndarray:
        flat = np.ascontiguousarray(points.reshape(-1, 3), dtype=np.float32)
        return tables.rgb_of_lab(tables.lab(flat)).reshape(points.shape)

    light = made["shading"][..., None]
    flushed = points + made["mask"][..., None] * np.array([0, np.log(2.5), 0.04], dtype=np.float32)
    panels = (
        ("picture", encoded, {}),
        ("melanin, %", 100 * made["skin_map"][..., 1], {"cmap": "YlOrBr", "norm": "log", "vmin": 0.5, "vmax": 10}),
        ("hemoglobin, % of the dermis", 100 * made["skin_map"][..., 0], {"cmap": "inferno", "norm": "log", "vmin": 0.1, "vmax": 4}),
        ("mask", made["mask"], {"cmap": "gray", "vmin": 0, "vmax": 1}),
        ("light", made["shading"], {"cmap": "viridis"}),
        ("the estimate alone", srgb(look(points)), {}),
        ("residual", srgb(0.5 * made["residual"]), {}),
        ("2.5 times the blood", srgb(look(flushed) * made["residual"] * light), {}),
    )
    figure, axes = plt.subplots(2, 4, figsize=(12, 6.9), layout="constrained")
    for axis, (title, image, how) in zip(axes.flat, panels, strict=True):
        shown = axis.imshow(image[::-1], interpolation="nearest", **how)
        axis.set_title(title, fontsize=10)
        axis.set_axis_off()
        if how and title != "mask":
            figure.colorbar(shown, ax=axis, shrink=0.6)
    figure.savefig(path, dpi=75)
    plt.close(figure)


def page(result: dict) -> str:
    """docs/inversion.md: the prose stands here, the numbers come from the run."""

    def table(head: str, rows: list[str]) -> str:
        return "\n".join([f"| {head} |", "|" + "---|" * (head.count("|") + 1), *(f"| {row} |" for row in rows)])

    trip = table(
        "skin | Delta E median | 95 % | melanin r | hemoglobin r | oxygenation r | rms ln melanin | rms ln hemoglobin | masked",
        [f"{name} | {r['delta_e_median']:.2f} | {r['delta_e_p95']:.2f} | {r['melanin_correlation']:.3f} | "
         f"{r['hemoglobin_correlation']:.3f} | {r['oxygenation_correlation']:.2f} | {r['melanin_rms']:.3f} | "
         f"{r['hemoglobin_rms']:.3f} | {100 * r['masked']:.2f} %" for name, r in result["round_trip"].items()],
    )
    words = {"float": "32-bit floats", "8 bits": "8 bits", "noise 1": "noise of 1/255 in sRGB, 8 bits",
             "noise 3": "noise of 3/255 in sRGB, 8 bits", "jpeg": "JPEG, quality 85"}
    rows = []
    for key, r in result["degraded"].items():
        if key.endswith(" raw"):
            continue
        raw = result["degraded"][key + " raw"]
        name, how = key.split("|")
        rows.append(
            f"{name} | {words[how]} | {r['noise_lab']:.2f} | {r['delta_e_median']:.2f} ({raw['delta_e_median']:.2f}) | "
            f"{r['delta_e_p95']:.2f} ({raw['delta_e_p95']:.2f}) | {r['melanin_correlation']:.2f} ({raw['melanin_correlation']:.2f}) | "
            f"{r['hemoglobin_correlation']:.2f} ({raw['hemoglobin_correlation']:.2f}) | {r['hemoglobin_rms']:.2f} ({raw['hemoglobin_rms']:.2f})"
        )
    degraded_table = table(
        "skin | picture | noise found | Delta E median | 95 % | melanin r | hemoglobin r | rms ln hemoglobin", rows
    )
    knows = table(
        "skin | half of the blood is Delta E | ln hemoglobin at L\\*a\\*b\\* noise 1 | at 0.3 | oxygenation at 1 | at 0.3",
        [f"{name} | {a['halved']:.2f} | {a['hemoglobin']:.2f} | {b['hemoglobin']:.2f} | {a['oxygenation']:.3f} | {b['oxygenation']:.3f}"
         for name in KNOWN for a, b in [[r for r in result["blood_under_melanin"] if r["skin"] == name]]],
    )
    clock = table(
        "side | Sanguine s | without noise | 1 thread, rows alone | NumPy s | copy s | CPU s | NumPy's CPU s | NumPy / Sanguine | Sanguine / copy",
        [f"{r['size']} | {r['seconds']:.2f} | {r['seconds_without_noise']:.2f} | {r['seconds_rows_1_thread']:.2f} | {r['numpy']:.2f} | "
         f"{r['copy']:.3f} | {r['cpu_seconds']:.2f} | {r['cpu_numpy']:.2f} | {r['cpu_numpy'] / r['cpu_seconds']:.1f} | "
         f"{r['cpu_seconds'] / r['cpu_copy']:.0f}" for r in result["times"]],
    )
    sizes = table(
        "nodes per axis | MB | build s | 2K s | Delta E median | 95 % | rms ln melanin | rms ln hemoglobin",
        [f"{r['nodes']} | {r['megabytes']:.1f} | {r['build_seconds']:.2f} | {r['seconds_2k']:.2f} | {r['delta_e_median']:.3f} | "
         f"{r['delta_e_p95']:.3f} | {r['melanin_rms']:.4f} | {r['hemoglobin_rms']:.4f}" for r in result["lut"]],
    )
    fields = {
        "trip": trip, "degraded": degraded_table, "knows": knows, "clock": clock, "sizes": sizes,
        "size": result["size"], "features": ", ".join(result["features"]), "load": result["load"],
        "nodes": core.INVERSION_NODES, "own": result["truth_table_delta_e"]["median"],
        "bars": BARS,
    }
    return (ROOT / "bench/inversion_page.md").read_text(encoding="utf-8").format(**fields)


if __name__ == "__main__":
    sys.exit(main())
