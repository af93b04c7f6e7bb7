"""What accuracy of the picture costs: our skin in Cycles against path-traced layered media, error and time.

    python bench/picture.py            everything: about 15 minutes on two idle cores (the truth is committed)
    python bench/picture.py --quick    fewer settings: about 3 minutes; presets and pages are left alone
    python bench/picture.py --report   presets, plots and page again from bench/results/picture.json

Needs tools/requirements-test.txt and tools/requirements-bench.txt; Mitsuba only where the truth is traced anew
(bench/picture_truth.py). Writes bench/results/picture.json, rigs/quality.toml, docs/accuracy_picture.md and its
pictures.

Times are seconds of processor time over all threads ("core seconds"), so other work on the machine is not in them;
two cores take half as long. Every ratio comes from one run.
"""

from __future__ import annotations

import argparse
import json
import platform
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

warnings.filterwarnings("ignore", message=".*Matplotlib.*")

import numpy as np  # noqa: E402
import sanguine_core  # noqa: E402
from picture_scenes import (  # noqa: E402
    CACHE, SCENES, SKINS, TRUTH, WAVELENGTHS_NM, blocks, delta_e, rgb_to_xyz, spectrum_to_xyz, wavelength_cost, xyz_to_rgb,
)
from sanguine.domain.effects import Frame, Scene  # noqa: E402
from sanguine.domain.effects.regions import FACE_REGIONS  # noqa: E402
from sanguine.domain.facs import EMOTION_CONTROLS  # noqa: E402
from sanguine.domain.lut import bake, layout  # noqa: E402
from sanguine.domain.parameters import skin_rows  # noqa: E402
from sanguine.domain.plan import check_strengths, make_plan  # noqa: E402
from sanguine.domain.quality import Settings  # noqa: E402
from scipy.interpolate import RegularGridInterpolator  # noqa: E402

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "bench" / "results"

LOBES = (1, 2, 3, 4)
SAMPLES = (4, 16, 64, 256, 1024)
TABLE_STEPS = (0.5, 1.0, 2.0, 4.0, 8.0)
MAP_SIZES = (256, 512, 1024, 2048)
# What shots were rendered with before there were presets.
USUAL = Settings(lobes=4, table_step=1.0, map_size=1024, samples=64)
# The skin whose table and maps are timed: what every face has. What grows on some costs more, see docs/maps.md.
PREPARED = {"anatomy": 1.0, "relief": 1.0}
# A picture for the time of a setting: the size of examples/five_expressions.toml.
MEGAPIXELS = 512 * 640 / 1e6
# Darker pixels are not compared: below L* = 2 nothing is seen, and the truth has little but noise there.
DARKEST_Y = 0.0022
# Scenes that a quality is judged by. The backlit sheet is not: no setting mends it, the effect `thin` does (docs/thin_parts.md).
JUDGED = ("patch", "edge", "sphere", "mapped", "live table")

# THE RULE. A preset is the cheapest measured setting whose error is at most this many times the least error reached
# (of the settings open to it).
# `final` and `reference` keep the whole material besides: what these scenes do not show is held by tests at those
# settings alone (the fall-off of very dark skin within 10 %, the planner's table within Delta E 0.3).
PRESET_RULE = {"draft": 3.0, "preview": 2.5, "final": 1.5, "reference": 1.05}
# Preset -> lobes at least. Two hold the fall-off (tests/render/test_falloff.py), and a lobe costs look-ups and sampling.
WHOLE = {"final": 2, "reference": 4}


def is_whole(s: Settings, lobes: int) -> bool:
    return s.lobes >= lobes and s.table_step <= USUAL.table_step and s.map_size >= USUAL.map_size


TIMES = ("core_seconds_per_megasample", "denoise_core_seconds_per_megapixel", "prepare_core_seconds")


class Truth:
    """The truth of a scene and skin as it is compared: XYZ of blocks under the scene's exposure."""

    def __init__(self, stored: Any, scene: str, skin: str) -> None:
        self.scene = SCENES[scene]
        self.spectral = stored[f"{scene}_{skin}_mean"].astype(float)
        self.full_xyz = spectrum_to_xyz(self.spectral)
        self.xyz = self.prepared(self.full_xyz)
        self.noise = stored[f"{scene}_{skin}_noise"]
        self.passes = int(stored[f"{scene}_{skin}_passes"])
        self.sparks = int(stored[f"{scene}_{skin}_sparks"])
        self.used = self.xyz[..., 1] >= DARKEST_Y
        if scene == "sphere":  # squares whose middle is on the sphere
            n = self.xyz.shape[0]
            at = ((np.arange(n) + 0.5) / n - 0.5) * self.scene.width_mm
            self.used &= np.hypot(at[None, :], at[:, None]) < 12.0

    def prepared(self, xyz: np.ndarray) -> np.ndarray:
        return self.scene.exposure * blocks(xyz, self.scene.block)

    def errors(self, pixels: np.ndarray) -> np.ndarray:
        """Delta E 2000 of every compared pixel of a picture in linear Rec.709."""
        xyz = self.prepared(rgb_to_xyz(pixels))
        truth = np.broadcast_to(self.xyz, xyz.shape)
        return delta_e(xyz, truth)[np.broadcast_to(self.used, xyz.shape[:2])]


def summary(errors: np.ndarray) -> dict[str, float]:
    return {"median": round(float(np.median(errors)), 4), "p95": round(float(np.percentile(errors, 95)), 4)}


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


# ---------------------------------------------------------------- measuring


class Pictures:
    """Renders, or with `reuse` finds, our pictures: a better truth needs none of them anew."""

    def __init__(self, reuse: bool) -> None:
        self.path = CACHE / "ours.npz"
        self.stored = dict(np.load(self.path)) if reuse and self.path.exists() else {}
        self.built = None

    def take(self, key: str, build: Any, samples: int, denoise: bool) -> np.ndarray:
        """Pixels (H, W, 3) of the scene that `build` makes, which `key` names."""
        import picture_ours as ours

        name = f"{key}, {samples} samples{', denoised' if denoise else ''}"
        if name not in self.stored:
            if self.built != key:
                build()
                self.built = key
            self.stored[name] = ours.take(samples, denoise).pixels.astype(np.float32)
        return self.stored[name].astype(float)

    def save(self) -> None:
        CACHE.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(self.path, **self.stored)


def truth_against_skin(stored: Any) -> dict[str, Any]:
    """All that leaves the flat patch under diffuse light, traced, beside `sanguine skin`'s reflectance."""
    found = {}
    for skin in SKINS:
        row = skin_rows([SKINS[skin]])
        surface = float(sanguine_core.surface(row)[0, 1])
        traced = stored[f"exitance_{skin}_mean"][0, 0].astype(float) - surface
        error = stored[f"exitance_{skin}_error"][0, 0].astype(float)
        ours = sanguine_core.reflectance(row, WAVELENGTHS_NM)[0]
        found[skin] = {
            "traced": traced.round(5).tolist(),
            "standard_error": error.round(5).tolist(),
            "sanguine_skin": ours.round(5).tolist(),
            "chi2_per_wavelength": round(float(np.mean(((traced - ours) / error) ** 2)), 2),
            "mean_relative_difference": round(float(np.sum(traced - ours) / np.sum(ours)), 5),
            "delta_e": round(float(delta_e(spectrum_to_xyz(traced), spectrum_to_xyz(ours))), 3),
            # Seen straight from above instead: skin does not shine evenly in all directions, and lobes know no angle.
            "delta_e_from_above": round(float(delta_e(
                spectrum_to_xyz(stored[f"patch_{skin}_mean"][0, 0].astype(float)), spectrum_to_xyz(ours))), 3),
        }
    return found


def measure(quick: bool, reuse: str | None) -> dict[str, Any]:
    import picture_ours as ours

    stored = np.load(TRUTH)
    truths = {(scene, skin): Truth(stored, scene, skin) for scene in SCENES for skin in SCENES[scene].skins}
    lobes_list = (1, 4) if quick else LOBES
    samples_list = SAMPLES[:3] if quick else SAMPLES
    skins = ("light",) if quick else tuple(SKINS)
    plain_samples = samples_list[-1]
    results: dict[str, Any] = {
        "sanguine": sanguine_core.__version__,
        "machine": f"{platform.machine()}, {_cpu()}",
        "wavelengths": {"count": len(WAVELENGTHS_NM), "delta_e": wavelength_cost()},
        "truth": {f"{scene} {skin}": {"passes": t.passes, "sparks": t.sparks, "pixels": int(t.used.sum()),
                                      "noise": summary(t.noise[np.broadcast_to(t.used, t.noise.shape)])}
                  for (scene, skin), t in truths.items()},
        "truth_against_skin": truth_against_skin(stored),
        "grid": [], "alternatives": [], "table": [], "maps": [],
    }
    pictures = Pictures(reuse is not None)
    shown: dict[str, np.ndarray] = {}

    # Lobes and samples, with the denoiser (as shots are rendered) and without.
    for scene in SCENES:
        for skin in (skin for skin in SCENES[scene].skins if skin in skins):
            for lobes in lobes_list:
                def build(scene: str = scene, skin: str = skin, lobes: int = lobes) -> None:
                    ours.build(scene, lambda: ours.skin_material(SKINS[skin], lobes), 1)

                for samples in samples_list:
                    for denoise in (True, False) if lobes == 4 or samples == plain_samples else (True,):
                        pixels = pictures.take(f"{scene}, {skin}, {lobes} lobes", build, samples, denoise)
                        error = summary(truths[scene, skin].errors(pixels))
                        results["grid"].append({"scene": scene, "skin": skin, "lobes": lobes, "samples": samples,
                                                "denoise": denoise, **error})
                if lobes == 4:
                    shown[f"{scene}_{skin}_ours"] = pixels
                say(f"{scene}, {skin}, {lobes} lobes: {error}")

    # The alternatives at as many samples as there are.
    for skin in skins:
        matched = {f"{scene}_rgb": xyz_to_rgb(truths[scene, skin].full_xyz)[0] for scene in ("patch", "edge")}
        matched["patch_rgb"] = matched["patch_rgb"][0]
        if f"{skin}, random walk" not in pictures.stored:
            pictures.stored[f"{skin}, random walk"] = np.stack(ours.matched_random_walk(matched, 64 if quick else 256))
        rgb, radius_mm = pictures.stored[f"{skin}, random walk"]
        row = skin_rows([SKINS[skin]])
        plain = sanguine_core.linear_rgb(sanguine_core.xyz(sanguine_core.reflectance(row, WAVELENGTHS_NM), WAVELENGTHS_NM))[0]
        kinds = {
            "random walk, matched": lambda: ours.random_walk(rgb, radius_mm),
            "Principled, plain values": lambda: ours.principled(plain),
        }
        results.setdefault("random_walk", {})[skin] = {"color": rgb.round(4).tolist(), "radius_mm": radius_mm.round(4).tolist()}
        for kind, material in kinds.items():
            for scene in (scene for scene in SCENES if skin in SCENES[scene].skins):
                def build(scene: str = scene, material: Any = material) -> None:
                    ours.build(scene, material, 1)

                key = f"{scene}, {skin}, {kind}, {rgb.round(4)}, {radius_mm.round(3)}"
                for samples in samples_list:
                    pixels = pictures.take(key, build, samples, True)
                    results["alternatives"].append({"kind": kind, "scene": scene, "skin": skin, "samples": samples,
                                                    **summary(truths[scene, skin].errors(pixels))})
                if kind.startswith("random walk"):
                    shown[f"{scene}_{skin}_walk"] = pictures.take(key, build, plain_samples, False)
            say(f"{kind}, {skin}")

    # Table and maps, one at a time, where chromophores vary.
    def mapped(skin: str, settings: Settings, samples: int, denoise: bool) -> dict[str, float]:
        def build() -> None:
            ours.build("mapped", lambda: ours.mapped_material(SKINS[skin], settings), 1)

        pixels = pictures.take(f"mapped, {skin}, {_key(settings)}", build, samples, denoise)
        return summary(delta_e(rgb_to_xyz(pixels), mapped_truths[skin]))

    mapped_truths = {skin: ours.mapped_truth_xyz(SKINS[skin]) for skin in skins}
    finest = Settings(lobes=4, table_step=TABLE_STEPS[0], map_size=MAP_SIZES[-1], samples=1)
    many = 64 if quick else 256
    for skin in skins:
        for step in TABLE_STEPS:
            settings = finest.model_copy(update={"table_step": step})
            results["table"].append({"skin": skin, "table_step": step,
                                     "entries": ours.mapped_plan(SKINS[skin], settings).entries,
                                     **mapped(skin, settings, many, False)})
        for size in MAP_SIZES:
            results["maps"].append({"skin": skin, "map_size": size, **mapped(
                skin, finest.model_copy(update={"map_size": size}), many, False)})
        for lobes in lobes_list:
            settings = USUAL.model_copy(update={"lobes": lobes})
            for samples in samples_list:
                for denoise in (True, False) if lobes == 4 or samples == plain_samples else (True,):
                    results["grid"].append({"scene": "mapped", "skin": skin, "lobes": lobes, "samples": samples,
                                            "denoise": denoise, **mapped(skin, settings, samples, denoise)})
        say(f"mapped, {skin}")

    results["live table"] = [live_table(step) for step in TABLE_STEPS]

    if reuse == "all":
        last = json.loads((RESULTS / "picture.json").read_text(encoding="utf-8"))
        results |= {key: last[key] for key in TIMES}
    else:
        results |= _times(results, lobes_list)
    say("times")

    if not quick:
        results["points"] = _points(results, lambda skin, settings: mapped(skin, settings, settings.samples, True))
        np.savez_compressed(RESULTS / "picture_images.npz", **{k: v.astype(np.float16) for k, v in shown.items()})
        pictures.save()
    return results


def live_table(table_step: float, count: int = 1000) -> dict[str, Any]:
    """Colours between the entries of the widest table, that of a face in the panel, against the solver's own.

    Skins anywhere in the table, hemoglobin and melanin spread by ratio; its weights are interpolated as an image is.
    """
    plan = make_plan(
        Scene(SKINS["light"], (Frame("live", dict.fromkeys(EMOTION_CONTROLS, 1.0)),), check_strengths({}, "bench"),
              FACE_REGIONS, live=True),
        USUAL.model_copy(update={"table_step": table_step}))
    table = bake(plan.axes, plan.scene.skin, "rec709")
    form = layout(plan.axes)
    colours = table.image.reshape(form.levels, form.rows, 2 * table.lobes, form.columns, 3)[:, :, : table.lobes].sum(2)
    t = np.random.default_rng(1).random((count, len(plan.axes)))
    rows = np.repeat(skin_rows([plan.scene.skin]), count, axis=0)
    for axis, x in zip(plan.axes, t.T, strict=True):
        rows[:, list(plan.scene.skin).index(axis.id)] = [axis.value(t) for t in x]
    t[:, 2] = np.round(t[:, 2] * (form.levels - 1)) / (form.levels - 1)  # the nearest level of oxygenation, as the shader reads
    grid = [np.linspace(0.0, 1.0, n) for n in (form.levels, form.rows, form.columns)]
    between = RegularGridInterpolator(grid, colours.astype(float))(t[:, ::-1])
    nm = np.arange(380.0, 781.0, 5.0)
    exact = sanguine_core.xyz(sanguine_core.reflectance(rows, nm), nm) / 100.0
    return {"table_step": table_step, "entries": plan.entries, **summary(delta_e(rgb_to_xyz(between), exact))}


def _times(results: dict[str, Any], lobes_list: tuple[int, ...]) -> dict[str, Any]:
    """Core seconds of samples, denoising, tables and maps, taken in turn."""
    import picture_ours as ours
    from sanguine.domain.shot import read_shot, scene_of

    light = SKINS["light"]
    rgb, radius_mm = (np.array(results["random_walk"]["light"][key]) for key in ("color", "radius_mm"))
    costs = ours.sample_costs({
        **{f"{n} lobes": (lambda n=n: ours.mapped_material(light, USUAL.model_copy(update={"lobes": n}))) for n in lobes_list},
        **{f"{n} lobes, no table": (lambda n=n: ours.skin_material(light, n)) for n in lobes_list},
        "random walk, matched": lambda: ours.random_walk(rgb, radius_mm),
        "Principled, plain values": lambda: ours.principled(rgb),
    })
    denoise = ours.denoise_cost(lambda: ours.skin_material(light, 4))
    example = read_shot(ROOT / "examples" / "five_expressions.toml").model_copy(update={"effects": PREPARED})
    combos = [Settings(lobes=n, table_step=step, map_size=size, samples=1)
              for n in lobes_list for step in TABLE_STEPS for size in MAP_SIZES]
    # Table and maps do not touch each other: their times add up.
    edges = [c for c in combos if c.map_size == MAP_SIZES[0] or (c.table_step == TABLE_STEPS[-1] and c.lobes == 4)]
    times = dict(zip([_key(c) for c in edges], ours.face_costs(
        edges, lambda s: make_plan(scene_of(example, example.subjects[0], FACE_REGIONS), s)), strict=True))
    base = times[_key(Settings(lobes=4, table_step=TABLE_STEPS[-1], map_size=MAP_SIZES[0], samples=1))]
    prepare = {}
    for c in combos:
        table = times[_key(c.model_copy(update={"map_size": MAP_SIZES[0]}))]
        maps = times[_key(c.model_copy(update={"lobes": 4, "table_step": TABLE_STEPS[-1]}))]
        prepare[_key(c)] = round(table + maps - base, 4)
    return dict(zip(TIMES, ({name: round(value, 4) for name, value in costs.items()}, round(denoise, 4), prepare), strict=True))


def _key(s: Settings) -> str:
    return f"{s.lobes} lobes, step {s.table_step:g}, map {s.map_size}"


def _cpu() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else ():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor()


# ---------------------------------------------------------------- choosing


def seconds_of(results: dict[str, Any], s: Settings) -> float:
    """Core seconds of one picture of MEGAPIXELS, with its table and maps."""
    return results["prepare_core_seconds"][_key(s)] + MEGAPIXELS * _per_megapixel(results, s)


def _per_megapixel(results: dict[str, Any], s: Settings) -> float:
    cost = results["core_seconds_per_megasample"][f"{s.lobes} lobes"]
    return cost * s.samples + results["denoise_core_seconds_per_megapixel"]


def front(candidates: list[tuple[float, float, Any]]) -> list[Any]:
    """Those of (seconds, error, what) that nothing beats in both, the fastest first."""
    kept, best = [], float("inf")
    for seconds, error, what in sorted(candidates, key=lambda row: row[:2]):
        if error < best:
            kept.append(what)
            best = error
    return kept


def _points(results: dict[str, Any], mapped: Any) -> list[dict[str, Any]]:
    """The measured front of all settings.

    All combinations are judged by a sum (what a coarser table or map adds to the mapped patch on its own); those on
    the front of that, and of the whole material alone, are then rendered as they are, so that what is stated is measured.
    """
    def mean(rows: list[dict[str, Any]], value: str) -> float:
        return float(np.mean([row[value] for row in rows]))

    def judged(s: Settings, value: str) -> float:
        rows = [r for r in results["grid"] if r["denoise"] and (r["lobes"], r["samples"]) == (s.lobes, s.samples)]
        errors = [mean([r for r in rows if r["scene"] == scene], value) for scene in JUDGED[:-1]]
        return float(np.mean([*errors, mean([r for r in results["live table"] if r["table_step"] == s.table_step], value)]))

    def added(table: str, key: str, at: Any) -> float:
        def error(value: Any) -> float:
            return mean([r for r in results[table] if r[key] == value], "p95")
        return (error(at) - min(error(r[key]) for r in results[table])) / len(JUDGED)

    candidates = []
    for lobes in LOBES:
        for samples in SAMPLES:
            for step in TABLE_STEPS:
                for size in MAP_SIZES:
                    s = Settings(lobes=lobes, table_step=step, map_size=size, samples=samples)
                    error = judged(s, "p95") + added("table", "table_step", step) + added("maps", "map_size", size)
                    candidates.append((seconds_of(results, s), error, s))
    chosen = front(candidates)
    for lobes in WHOLE.values():
        chosen += [s for s in front([c for c in candidates if is_whole(c[2], lobes)]) if s not in chosen]
    measured = []
    for s in chosen:
        rows = [mapped(skin, s) for skin in SKINS]
        point = {**s.model_dump(), "core_seconds": round(seconds_of(results, s), 3),
                 "prepare_seconds": round(results["prepare_core_seconds"][_key(s)], 3),
                 "seconds_per_megapixel": round(_per_megapixel(results, s), 3)}
        for name, value in (("delta_e", "p95"), ("delta_e_median", "median")):
            others = len(JUDGED) * judged(s, value) - mean(
                [r for r in results["grid"] if r["denoise"] and r["scene"] == "mapped"
                 and (r["lobes"], r["samples"]) == (s.lobes, s.samples)], value)
            point[name] = round((others + mean(rows, value)) / len(JUDGED), 3)
        measured.append(point)
        say(f"point {point}")
    return sorted(measured, key=lambda p: p["core_seconds"])


def choose(points: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """THE RULE applied: preset -> point."""
    settings = [Settings(**{key: p[key] for key in Settings.model_fields}) for p in points]
    chosen = {}
    for name, times in PRESET_RULE.items():
        open_to = [p for p, s in zip(points, settings, strict=True) if name not in WHOLE or is_whole(s, WHOLE[name])]
        least = min(p["delta_e"] for p in open_to)
        chosen[name] = min((p for p in open_to if p["delta_e"] <= times * least), key=lambda p: p["core_seconds"])
    return chosen


def kept(points: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The presets, and the points that are better than every faster one by 1 % or more."""
    presets = list(choose(points).values())
    found, best = [], float("inf")
    for point in points:
        if point["delta_e"] < 0.99 * best:
            found.append(point)
            best = point["delta_e"]
        elif point in presets:
            found.append(point)
    return found


def write_quality(results: dict[str, Any], path: Path) -> None:
    chosen = choose(results["points"])
    lines = [
        "# Settings on the measured front of error and time, the fastest first, and the presets among them. Written by",
        "# bench/picture.py, which has the rule; docs/accuracy_picture.md has the scenes. Not for editing by hand.",
        "#",
        "# delta_e: Delta E 2000 against path-traced layered media, 95th percentile of the pixels, mean of the scenes.",
        "# Seconds are those of one core; prepare_seconds: table and maps of five expressions on plain skin (PREPARED).",
        "",
        f'machine = "{results["machine"]}"',
    ]
    for point in kept(results["points"]):
        names = [name for name, p in chosen.items() if p is point]
        for name in names or [None]:
            lines += ["", "[[point]]"]
            lines += [f'preset = "{name}"'] if name else []
            lines += [f"{key} = {point[key]}" for key in ("lobes", "table_step", "map_size", "samples", "delta_e",
                                                           "delta_e_median", "prepare_seconds", "seconds_per_megapixel")]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer settings; presets and pages are left alone")
    parser.add_argument("--report", action="store_true", help="presets, plots and page from the stored results")
    parser.add_argument("--reuse", choices=("pictures", "all"), help="our pictures from the last run on this machine, or its times too")
    options = parser.parse_args()
    path = RESULTS / ("picture_quick.json" if options.quick else "picture.json")
    if not options.report:
        if not TRUTH.exists():
            subprocess.run([sys.executable, str(Path(__file__).with_name("picture_truth.py"))], check=True)
        RESULTS.mkdir(parents=True, exist_ok=True)
        results = measure(options.quick, options.reuse)
        path.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    if not options.quick:
        import picture_report

        results = json.loads(path.read_text(encoding="utf-8"))
        write_quality(results, ROOT / "rigs" / "quality.toml")
        picture_report.write(results)


if __name__ == "__main__":
    main()
