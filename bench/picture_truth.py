"""The truth of the picture benchmark: both layers path-traced as media by Mitsuba 3's own `volpath`, spectrally.

    python bench/picture_truth.py [--minutes 30]

Every pass traces each scene, skin and wavelength once more with a new seed; a pass is kept on disk under a hash of all
that went into it, so a run can be stopped at any time and goes on where it was. Nothing of Sanguine's solvers takes
part: only the coefficients of the two layers, mu_a and mu_s', come from `sanguine_core.optical_coefficients`.

Mitsuba's LLVM variants need a libLLVM of version 16 or later (Debian 12: `apt-get install libllvm19`); set
DRJIT_LIBLLVM_PATH if it is not found. The means are committed, so only who changes a scene needs Mitsuba.
"""

from __future__ import annotations

import argparse
import glob
import hashlib
import json
import math
import os
import sys
import time

import numpy as np
import sanguine_core
from picture_scenes import (
    CACHE, EPIDERMIS_MM, G, INDEX, LAMP_GAP_MM, SCENES, SHEET_MM, SKINS, SOFTBOX_ANGLE_RAD, SOFTBOX_DISTANCE_MM,
    SOFTBOX_HALF_MM, SPHERE_RADIUS_MM, TRUTH, WAVELENGTHS_NM, delta_e, blocks, spectrum_to_xyz,
)
from sanguine.domain.parameters import skin_rows

# Paths of one pass per wavelength, over all pixels of the scene.
_PATHS = {"patch": 30_000, "edge": 48 * 2_500, "sphere": 1600 * 150, "sheet": 48 * 2_500, "exitance": 60_000}
# Russian roulette begins where a path in the dermis carries this much. Measured on the patch: from 0.3 on the weights
# that its fixed 5 % a step builds up spoil the mean of red light; at 0.01 the same error costs half as much again.
_ROULETTE_BELOW = 0.1
# So wide and deep that no light finds an end (the widest profile here has lost all but 1e-4 after 40 mm).
_WIDE_MM = 100.0


def _load_mitsuba():
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        found = sorted(glob.glob("/usr/lib/*-linux-gnu/libLLVM.so.*"))  # so named from 18 on
        if not found:
            raise SystemExit("picture_truth: no libLLVM of version 16 or later: apt-get install libllvm19")
        os.environ["DRJIT_LIBLLVM_PATH"] = found[-1]
    import mitsuba

    mitsuba.set_variant("llvm_ad_mono")
    return mitsuba


def _shells(mi, shape: str) -> list[dict]:
    """The outer surface and the border between the layers, EPIDERMIS_MM below it everywhere."""
    at = mi.ScalarTransform4f()
    if shape == "sphere":
        return [{"type": "sphere", "radius": SPHERE_RADIUS_MM - depth} for depth in (0.0, EPIDERMIS_MM)]
    half = SHEET_MM / 2 if shape == "sheet" else _WIDE_MM / 2
    wide = _WIDE_MM
    return [
        {"type": "cube", "to_world": at.translate([0, 0, -half]).scale([wide - d, wide - d, half - d])}
        for d in (0.0, EPIDERMIS_MM)
    ]


def _lamp(mi, scene: str) -> dict:
    at = mi.ScalarTransform4f()
    area = {"type": "area", "radiance": 1.0}
    clear = {"type": "null"}  # from behind a lamp is not there: it shines one way and lets all light pass
    if scene in ("patch", "exitance"):
        return {"type": "constant", "radiance": 1.0}
    if scene == "edge":
        place = at.translate([_WIDE_MM / 2, 0, LAMP_GAP_MM]).rotate([1, 0, 0], 180).scale([_WIDE_MM / 2, _WIDE_MM, 1])
    elif scene == "sheet":
        place = at.translate([_WIDE_MM / 2, 0, -SHEET_MM - LAMP_GAP_MM]).scale([_WIDE_MM / 2, _WIDE_MM, 1])
    else:
        direction = np.array([math.sin(SOFTBOX_ANGLE_RAD), 0.0, math.cos(SOFTBOX_ANGLE_RAD)])
        place = at.look_at(origin=(SOFTBOX_DISTANCE_MM * direction).tolist(), target=[0, 0, 0], up=[0, 1, 0])
        place = place.scale([SOFTBOX_HALF_MM, SOFTBOX_HALF_MM, 1])
    return {"type": "rectangle", "to_world": place, "bsdf": clear, "emitter": area}


def _film(columns: int, rows: int) -> dict:
    return {"type": "hdrfilm", "width": columns, "height": rows, "rfilter": {"type": "box"},
            "pixel_format": "luminance", "component_format": "float32"}


def _sensor(mi, scene: str) -> dict:
    at = mi.ScalarTransform4f()
    if scene == "exitance":  # all that leaves a flat patch, over the whole hemisphere: a meter that looks down at it
        meter = {"type": "irradiancemeter", "film": _film(1, 1), "sampler": {"type": "independent"}}
        return {"type": "rectangle", "to_world": at.translate([0, 0, 1]).rotate([1, 0, 0], 180), "bsdf": {"type": "null"},
                "sensor": meter}
    it = SCENES[scene]
    look = at.look_at(origin=[0, 0, 60], target=[0, 0, 0], up=[0, 1, 0])
    return {"type": "orthographic", "to_world": look.scale([it.width_mm / 2, it.width_mm / 2, 1]),
            "film": _film(it.columns, it.rows), "sampler": {"type": "independent"}}


def _medium(mu_a: float, mu_s_prime: float) -> dict:
    mu_s = mu_s_prime / (1.0 - G)
    return {"type": "homogeneous", "sigma_t": mu_a + mu_s, "albedo": mu_s / (mu_a + mu_s), "sample_emitters": False,
            "phase": {"type": "hg", "g": G}}


class Tracer:
    """Renders passes, or finds them on disk."""

    def __init__(self, threads: int) -> None:
        import drjit

        self.mi = _load_mitsuba()
        drjit.set_thread_count(threads)

    def render(self, scene: str, skin: str, nm: float, seed: int) -> np.ndarray:
        """(rows, columns) radiance of one pass, row 0 lowest; for "exitance" the share of the light that comes back."""
        # Rounded, so that a new compiler's last bit is no new scene.
        c = {key: float(f"{value[0, 0]:.9g}") for key, value in
             sanguine_core.optical_coefficients(skin_rows([SKINS[skin]]), np.array([nm])).items()}
        what = self.recipe(scene, c, seed)
        path = CACHE / f"{hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()[:24]}.npy"
        if path.exists():
            return np.load(path)
        mi = self.mi
        outer, inner = _shells(mi, scene)
        loaded = mi.load_dict({
            "type": "scene",
            "lamp": _lamp(mi, scene),
            "epidermis": _medium(c["mu_a_epidermis_per_mm"], c["mu_s_prime_epidermis_per_mm"]),
            "dermis": _medium(c["mu_a_dermis_per_mm"], c["mu_s_prime_dermis_per_mm"]),
            "outer": outer | {"bsdf": {"type": "dielectric", "int_ior": INDEX, "ext_ior": 1.0},
                              "interior": {"type": "ref", "id": "epidermis"}},
            "inner": inner | {"bsdf": {"type": "null"}, "interior": {"type": "ref", "id": "dermis"},
                              "exterior": {"type": "ref", "id": "epidermis"}},
            "sensor": _sensor(mi, scene),
        })
        mu_s = c["mu_s_prime_dermis_per_mm"] / (1.0 - G)
        depth = math.ceil(math.log(_ROULETTE_BELOW) / -math.log1p(c["mu_a_dermis_per_mm"] / mu_s))
        integrator = mi.load_dict({"type": "volpath", "max_depth": -1, "rr_depth": depth})
        pixels = 1 if scene == "exitance" else SCENES[scene].columns * SCENES[scene].rows
        image = np.array(mi.render(loaded, integrator=integrator, spp=_PATHS[scene] // pixels, seed=seed))
        image = image.reshape(image.shape[0], image.shape[1])[::-1] / (math.pi if scene == "exitance" else 1.0)
        CACHE.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(".part.npy")
        np.save(part, image.astype(np.float32))
        part.rename(path)
        return image

    def recipe(self, scene: str, coefficients: dict[str, float], seed: int) -> dict:
        where = SCENES.get(scene)
        return {
            "scene": scene, "coefficients": coefficients, "seed": seed, "paths": _PATHS[scene], "g": G, "n": INDEX,
            "camera": [where.width_mm, where.columns, where.rows] if where else None,
            "lengths": [EPIDERMIS_MM, SPHERE_RADIUS_MM, SHEET_MM, LAMP_GAP_MM, SOFTBOX_HALF_MM, SOFTBOX_DISTANCE_MM,
                        SOFTBOX_ANGLE_RAD, _WIDE_MM],
            "roulette": _ROULETTE_BELOW, "mitsuba": self.mi.__version__,
        }


def fresnel(cosine: np.ndarray) -> np.ndarray:
    """Unpolarised reflectance of the skin's surface for light from outside."""
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / INDEX**2)
    s = (cosine - INDEX * inside) / (cosine + INDEX * inside)
    p = (INDEX * cosine - inside) / (INDEX * cosine + inside)
    return 0.5 * (s**2 + p**2)


def mirrored(scene: str, fine: int = 16) -> np.ndarray:
    """(rows, columns) light that the surface mirrors into the camera: no part of the skin, taken off the truth.

    Exact but for pixels that the mirror image of the soft box cuts; `fine`^2 points in each.
    """
    it = SCENES[scene]
    n = it.columns * fine
    x = ((np.arange(n) + 0.5) / n - 0.5) * it.width_mm
    if scene == "patch":
        return np.full((1, 1), fresnel(np.array(1.0)))
    if scene == "edge":
        return (fresnel(np.array(1.0)) * (x > 0)).reshape(1, it.columns, fine).mean(2)
    if scene == "sheet":
        return np.zeros((1, it.columns))
    rho2 = x[None, :] ** 2 + x[:, None] ** 2
    on = rho2 < SPHERE_RADIUS_MM**2
    z = np.sqrt(np.where(on, SPHERE_RADIUS_MM**2 - rho2, 0.0))
    place = np.stack(np.broadcast_arrays(x[None, :], x[:, None], z), -1)
    normal = place / SPHERE_RADIUS_MM
    cosine = normal[..., 2]
    away = 2.0 * cosine[..., None] * normal - np.array([0.0, 0.0, 1.0])
    towards = np.array([math.sin(SOFTBOX_ANGLE_RAD), 0.0, math.cos(SOFTBOX_ANGLE_RAD)])
    side = np.cross([0.0, 1.0, 0.0], towards)
    speed = away @ towards
    with np.errstate(divide="ignore", invalid="ignore"):
        length = (SOFTBOX_DISTANCE_MM - place @ towards) / speed
        hit = place + length[..., None] * away
        lit = on & (speed > 0) & (np.abs(hit @ side) < SOFTBOX_HALF_MM) & (np.abs(hit[..., 1]) < SOFTBOX_HALF_MM)
    return np.where(lit, fresnel(np.clip(cosine, 0.0, 1.0)), 0.0).reshape(
        it.rows, fine, it.columns, fine).mean((1, 3))


def without_sparks(stack: np.ndarray) -> tuple[np.ndarray, int]:
    """(passes, rows, columns, W) with each spark replaced by the mean of the other passes; how many there were.

    After its roulette begins, `volpath` lets a long path's weight grow by 5 % a step, so one path in millions outshines
    its pixel. A value is a spark when it exceeds three times the greatest of the other passes at that pixel and
    wavelength by more than a tenth of the brightest pixel: twenty standard errors and more of a pass.
    """
    if len(stack) < 3:
        return stack, 0
    ordered = np.sort(stack, axis=0)
    others = np.where(stack == ordered[-1], ordered[-2], ordered[-1])
    brightest = np.median(stack, axis=0).max(axis=(0, 1))
    spark = stack > 3.0 * others + 0.1 * brightest
    rest = (stack.sum(0) - stack) / (len(stack) - 1)
    return np.where(spark, rest, stack), int(spark.sum())


def trace(minutes: float, threads: int) -> dict[str, np.ndarray]:
    """Passes until the time is up (each of them at least twice, for an error), then means, errors and totals."""
    tracer = Tracer(threads)
    tasks = [(scene, skin) for scene in _PATHS for skin in (SCENES[scene].skins if scene in SCENES else SKINS)]
    passes: dict[tuple[str, str], list[np.ndarray]] = {task: [] for task in tasks}
    end = time.monotonic() + 60.0 * minutes
    rounds = 0
    while rounds < 2 or time.monotonic() < end:
        for task in tasks:
            # Deep skin sends back so little that the mirror's noise is as large: it gets more.
            for _ in range(3 if task[1] == "deep" else 1):
                # A seed of its own for each wavelength: their noise must not add up to a tint.
                seed = 1000 * len(passes[task])
                spectrum = [tracer.render(*task, nm, seed + k) for k, nm in enumerate(WAVELENGTHS_NM)]
                passes[task].append(np.stack(spectrum, -1))
        rounds += 1
        print(f"{time.strftime('%H:%M')} round {rounds}, {(end - time.monotonic()) / 60:.1f} minutes left", file=sys.stderr, flush=True)
        _write(passes)
    return passes


def _write(passes: dict[tuple[str, str], list[np.ndarray]]) -> None:
    """The committed file. <scene>_<skin>_mean: (rows, columns, W) radiance, _noise: its standard error in Delta E 2000."""
    out: dict[str, np.ndarray] = {"wavelengths_nm": WAVELENGTHS_NM}
    for (scene, skin), images in passes.items():
        stack, sparks = without_sparks(np.array(images))
        if scene == "sphere":  # it and its lamp are the same above and below
            stack = 0.5 * (stack + stack[:, ::-1])
        if scene in SCENES:
            stack = stack - mirrored(scene)[None, ..., None]
        name = f"{scene}_{skin}"
        out[f"{name}_mean"] = stack.mean(0).astype(np.float32)
        out[f"{name}_passes"] = np.array(len(stack))
        out[f"{name}_sparks"] = np.array(sparks)
        if len(stack) < 2:
            continue
        if scene in SCENES:  # half of the difference of two halves spreads like the mean of all
            it = SCENES[scene]
            halves = [it.exposure * blocks(spectrum_to_xyz(stack[k::2].mean(0)), it.block) for k in (0, 1)]
            out[f"{name}_noise"] = (0.5 * delta_e(*halves)).astype(np.float32)
        else:
            out[f"{name}_error"] = (stack.std(0, ddof=1) / math.sqrt(len(stack))).astype(np.float32)
    TRUTH.parent.mkdir(parents=True, exist_ok=True)
    part = TRUTH.with_name("part.npz")
    np.savez_compressed(part, **out)
    part.rename(TRUTH)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=30.0, help="how long to go on (default %(default)s)")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    options = parser.parse_args()
    trace(options.minutes, options.threads)


if __name__ == "__main__":
    main()
