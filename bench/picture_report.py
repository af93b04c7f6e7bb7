"""The page and the plots of the picture benchmark, written from its results alone."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

warnings.filterwarnings("ignore", message=".*Matplotlib.*")

import matplotlib  # noqa: E402

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
import sanguine_core  # noqa: E402
from picture import (  # noqa: E402
    JUDGED, LOBES, MEGAPIXELS, PRESET_RULE, RESULTS, SAMPLES, USUAL, WHOLE, Truth, choose, delta_e, kept, rgb_to_xyz,
    xyz_to_rgb,
)
from picture_scenes import SCENES, SKINS, TRUTH  # noqa: E402
from sanguine.domain.parameters import skin_rows  # noqa: E402

DOCS = Path(__file__).resolve().parents[1] / "docs"
_WALK = "random walk, matched"
_PLAIN = "Principled, plain values"
_TITLES = {**{s.id: s.title for s in SCENES.values()}, "mapped": "Patch with chromophore maps"}
_COLOURS = ("#9ecae1", "#6baed6", "#3182bd", "#08519c")


def write(results: dict[str, Any]) -> None:
    _plot_front(results, DOCS / "accuracy_picture.png")
    _plot_scenes(DOCS / "accuracy_picture_scenes.png")
    _plot_factors(results, DOCS / "accuracy_picture_factors.png")
    (DOCS / "accuracy_picture.md").write_text(_page(results), encoding="utf-8")


def _mean(rows: list[dict[str, Any]], value: str = "p95") -> float:
    return float(np.mean([row[value] for row in rows])) if rows else float("nan")


def _grid(results: dict[str, Any], **wanted: Any) -> list[dict[str, Any]]:
    return [row for row in results["grid"] if all(row[key] == value for key, value in wanted.items())]


def _others(results: dict[str, Any], **wanted: Any) -> list[dict[str, Any]]:
    return [row for row in results["alternatives"] if all(row[key] == value for key, value in wanted.items())]


def _judged(results: dict[str, Any], lobes: int, samples: int, denoise: bool) -> float:
    """Mean of the judged scenes at the planner's own table and maps of 1024."""
    errors = [_mean(_grid(results, scene=scene, lobes=lobes, samples=samples, denoise=denoise)) for scene in JUDGED[:-1]]
    return float(np.mean([*errors, next(r["p95"] for r in results["live table"] if r["table_step"] == USUAL.table_step)]))


def _seconds(results: dict[str, Any], name: str, samples: int, denoise: bool = True) -> float:
    each = results["core_seconds_per_megasample"][name]
    return MEGAPIXELS * (each * samples + (results["denoise_core_seconds_per_megapixel"] if denoise else 0.0))


# ---------------------------------------------------------------- plots


def _plot_front(results: dict[str, Any], path: Path) -> None:
    """Left: error against time of all settings, presets marked. Right: the scenes, against the alternatives."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(15, 5.2), layout="constrained")
    chosen = choose(results["points"])
    for lobes, colour in zip(LOBES, _COLOURS, strict=True):
        for denoise, style in ((True, "-o"), (False, ":"))[: 2 if lobes == 4 else 1]:
            curve = [(_seconds(results, f"{lobes} lobes", samples, denoise),
                      _judged(results, lobes, samples, denoise)) for samples in SAMPLES]
            label = f"{lobes} lobe{'s' if lobes > 1 else ''}{'' if denoise else ', not denoised'}"
            left.plot(*np.transpose(curve), style, color=colour, ms=4, lw=1.3, label=label)
    marks = {"draft": "v", "preview": "s", "final": "D", "reference": "*"}
    for name, point in chosen.items():
        left.plot(point["core_seconds"], point["delta_e"], marks[name], ms=13, mfc="none", mec="#d94801", mew=2,
                  label=f"{name}: {point['delta_e']:.1f} in {point['core_seconds']:.1f} s", zorder=5)
    left.set(xscale="log", yscale="log", xlabel=f"core seconds of a picture of {MEGAPIXELS:.2f} megapixels",
             ylabel="Delta E 2000, 95th percentile, mean of the scenes", title="Lobes, samples, presets")
    left.legend(fontsize=8)
    shades = {"patch": "#1b9e77", "edge": "#d95f02", "sphere": "#7570b3", "sheet": "#666666"}
    for scene, colour in shades.items():
        for kind, style in (("4 lobes, no table", "-o"), (_WALK, "--s"), (_PLAIN, ":^")):
            curve = []
            for samples in SAMPLES:
                rows = (_grid(results, scene=scene, lobes=4, samples=samples, denoise=True) if "lobes" in kind
                        else _others(results, kind=kind, scene=scene, samples=samples))
                curve.append((_seconds(results, kind, samples), _mean(rows)))
            right.plot(*np.transpose(curve), style, color=colour, ms=4, lw=1.2, alpha=0.9,
                       label=_TITLES[scene] if "lobes" in kind else None)
    for label, style in (("four Burley lobes", "-o"), (_WALK, "--s"), (_PLAIN, ":^")):
        right.plot([], [], style, color="black", ms=4, label=label)
    right.set(xscale="log", yscale="log", xlabel=left.get_xlabel(), ylabel="Delta E 2000, 95th percentile",
              title="By scene, and Cycles' own subsurface")
    right.legend(fontsize=7.5, loc="lower left", bbox_to_anchor=(1.0, 0.0))
    for axes in (left, right):
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter("")
        axes.set_yticks([y for y in (1, 2, 3, 5, 10, 20, 30, 50) if axes.get_ylim()[0] <= y <= axes.get_ylim()[1]])
        axes.grid(True, which="both", lw=0.3, alpha=0.6)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _plot_factors(results: dict[str, Any], path: Path) -> None:
    figure, axes = plt.subplots(1, 3, figsize=(13, 3.8), layout="constrained")
    for rows, key, at, label in ((results["table"], "table_step", axes[0], "distance of table entries (1: as planned)"),
                                 (results["maps"], "map_size", axes[1], "texels along a side of the maps")):
        for value, style in (("p95", "-o"), ("median", ":o")):
            steps = sorted({row[key] for row in rows})
            at.plot(steps, [_mean([r for r in rows if r[key] == x], value) for x in steps], style, color=_COLOURS[3],
                    label="95th percentile" if value == "p95" else "median")
        at.set(xscale="log", xlabel=label, ylabel="Delta E 2000")
        at.set_xticks(steps, [f"{x:g}" for x in steps])
        at.set_xticks([], minor=True)
        at.set_ylim(bottom=0.0)
        at.legend(fontsize=8)
    samples = SAMPLES[-1]
    for scene, style in zip(("patch", "edge", "sphere"), ("-o", "-s", "-^"), strict=True):
        axes[2].plot(LOBES, [_mean(_grid(results, scene=scene, lobes=n, samples=samples, denoise=False)) for n in LOBES],
                     style, label=_TITLES[scene])
    axes[2].set(xlabel="lobes", ylabel="Delta E 2000, 95th percentile", xticks=LOBES)
    axes[2].set_ylim(bottom=0.0)
    axes[2].legend(fontsize=8)
    for each in axes:
        each.grid(True, lw=0.3, alpha=0.6)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _shown(rgb: np.ndarray) -> np.ndarray:
    """sRGB 0-1 for the eye."""
    x = np.clip(rgb, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def _plot_scenes(path: Path) -> None:
    """Truth, ours, random walk, and their differences; the pictures are those of the benchmark, as they were compared."""
    stored, images = np.load(TRUTH), np.load(RESULTS / "picture_images.npz")
    scenes = ("edge", "sphere", "sheet")
    rows = [(scene, skin) for scene in scenes for skin in SCENES[scene].skins]
    figure, axes = plt.subplots(len(rows), 5, figsize=(12.5, 8.5), layout="constrained",
                                gridspec_kw={"height_ratios": [4.2 if scene == "sphere" else 1 for scene, _ in rows]})
    shown = None
    for i, (scene, skin) in enumerate(rows):
        truth = Truth(stored, scene, skin)
        exposure = SCENES[scene].exposure
        walk, ours = (images[f"{scene}_{skin}_{kind}"].astype(float) for kind in ("walk", "ours"))
        true = np.broadcast_to(xyz_to_rgb(truth.full_xyz), ours.shape)
        for k, (name, rgb) in enumerate((("path-traced media", true), ("ours, four lobes", ours), (_WALK, walk))):
            axes[i, k].imshow(_shown(rgb * exposure), origin="lower", interpolation="nearest")
            axes[i, k].set_title(name if i == 0 else "", fontsize=9)
        for k, rgb in ((3, ours), (4, walk)):
            xyz = truth.prepared(rgb_to_xyz(rgb))
            error = np.where(truth.used, delta_e(xyz, np.broadcast_to(truth.xyz, xyz.shape)), np.nan)
            shown = axes[i, k].imshow(error, origin="lower", cmap="magma", vmin=0, vmax=10, interpolation="nearest",
                                      extent=axes[i, 0].get_images()[0].get_extent())
            axes[i, k].set_title(("difference of ours", "difference of the walk")[k - 3] if i == 0 else "", fontsize=9)
        axes[i, 0].set_ylabel(f"{scene}\n{skin}", fontsize=9)
    for each in axes.ravel():
        each.set_xticks([])
        each.set_yticks([])
    figure.colorbar(shown, ax=axes[:, 3:], label="Delta E 2000 (10: 10 and more; white: not compared)", shrink=0.4)
    figure.savefig(path, dpi=100)
    plt.close(figure)


# ---------------------------------------------------------------- page


def _table(head: list[str], rows: list[list[str]]) -> str:
    return "\n".join(["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
                     + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def _page(results: dict[str, Any]) -> str:
    chosen = choose(results["points"])
    samples = SAMPLES[-1]
    proof = results["truth_against_skin"]

    def pair(rows: list[dict[str, Any]]) -> str:
        return f"{_mean(rows, 'median'):.2f} / {_mean(rows):.2f}"

    truth_rows = [[skin, f"{100 * row['mean_relative_difference']:+.2f} %", f"{row['chi2_per_wavelength']:.2f}",
                   f"{row['delta_e']:.2f}", f"{row['delta_e_from_above']:.2f}"] for skin, row in proof.items()]
    noise_rows = [[name, str(row["passes"]), str(row["sparks"]), str(row["pixels"]), f"{row['noise']['median']:.2f}", f"{row['noise']['p95']:.2f}"]
                  for name, row in results["truth"].items()]
    kinds = {f"{n} lobe{'s' if n > 1 else ''}": lambda scene, skin, n=n: _grid(
        results, scene=scene, skin=skin, lobes=n, samples=samples, denoise=False) for n in LOBES}
    kinds |= {kind: lambda scene, skin, kind=kind: _others(results, kind=kind, scene=scene, skin=skin, samples=samples)
              for kind in (_WALK, _PLAIN)}
    costs = results["core_seconds_per_megasample"]
    error_rows = []
    for kind, rows in kinds.items():
        cost = costs[f"{kind[0]} lobes, no table"] if "lobe" in kind else costs[kind]
        error_rows.append([kind, *(pair(rows(scene, skin)) for scene in SCENES for skin in SCENES[scene].skins), f"{cost:.2f}"])
    sample_rows = [[str(n), *(f"{_judged(results, 4, n, d):.2f}" for d in (True, False)), f"{_seconds(results, '4 lobes', n):.2f}"] for n in SAMPLES]

    def factor(rows: list[dict[str, Any]], key: str) -> list[list[str]]:
        return [[f"{value:g}", *([str(next(r["entries"] for r in rows if r[key] == value))] if key == "table_step" else []),
                 pair([r for r in rows if r[key] == value])] for value in sorted({r[key] for r in rows})]

    def point_row(name: str, p: dict[str, Any]) -> list[str]:
        return [name, str(p["lobes"]), f"{p['table_step']:g}", str(p["map_size"]), str(p["samples"]),
                f"{p['delta_e_median']:.2f} / {p['delta_e']:.2f}", f"{p['prepare_seconds']:.2f}",
                f"{p['seconds_per_megapixel']:.2f}", f"{p['core_seconds']:.2f}"]

    names = [(", ".join(n for n, p in chosen.items() if p is point), point)
             for point in kept(results["points"])]
    walk = results["random_walk"]
    surface = float(sanguine_core.surface(skin_rows([SKINS["light"]]))[0, 1])
    return f"""# The price of accuracy: the picture

Written by `bench/picture.py` from `bench/results/picture.json`; not for editing by hand. Machine: {results['machine']}. Times are seconds of one core, from one run.

![error against time](accuracy_picture.png)

## Truth
The same two layers as participating media, path-traced by Mitsuba 3's own `volpath` (`bench/picture_truth.py`): an epidermis of 0.1 mm and a dermis below it, Henyey-Greenstein g = 0.8, n = 1.4 with a smooth surface in air, nothing between the layers but the change of mu_a and mu_s. It shares no code with our solver or with Cycles, only the coefficients. {results['wavelengths']['count']} wavelengths are traced and integrated to XYZ under D65; against every 5 nm that costs Delta E {results['wavelengths']['delta_e']['median']:.2f} in the median and at most {results['wavelengths']['delta_e']['max']:.2f} over the lit and shadowed colours of both skins. The mirror reflection of the surface is no part of the comparison and is taken off exactly.

**Truth against `sanguine skin`**: all light that leaves a flat patch under diffuse light (an irradiance meter over it), less the {100 * surface:.2f} % that the surface mirrors.

{_table(["skin", "traced less ours, over the spectrum", "chi^2 per wavelength (1: noise alone)", "Delta E 2000", "Delta E seen from straight above"], truth_rows)}
The last column is what a flat table of colours cannot know: skin under a white sky does not shine evenly in all directions, and Cycles' lobes do. It is part of every error below.

Noise of the truth (standard error of a compared pixel, Delta E 2000). Sparks are values of one pass, pixel and wavelength that stand so far above the other passes that they were replaced by their mean (`without_sparks`):

{_table(["scene, skin", "passes", "sparks", "pixels compared", "median", "95th percentile"], noise_rows)}
## Scenes and error
Linear Rec.709 pixels go to XYZ and Lab (D65) under the same exposure as the truth. Compared are all pixels of the picture with L* of 2 and more in the truth (the sphere: squares of 4 x 4 pixels whose middle is on it). Numbers are median / 95th percentile of Delta E 2000.

- **patch**: {_TITLES['patch'].lower()}, from above. **edge**: light on one half alone, pixels of 0.33 mm. **sphere**: {_TITLES['sphere'].lower()}. **sheet**: epidermis all round, 1.5 mm in all, seen from the dark side.
- **mapped**: a patch of 51 mm under a white sky whose hemoglobin, melanin and oxygenation vary as in a face (gradient, a lip, spots); there the truth is the solver itself, point by point, so it shows table and maps alone. **live table**: colours between the entries of the widest table, that of a face in the panel, against the solver's own (no picture).

![truth, ours, random walk](accuracy_picture_scenes.png)

At {samples} samples, lobes not denoised, the others denoised; the last column is core seconds per million samples.

{_table(["", *(f"{scene}, {skin}" for scene in SCENES for skin in SCENES[scene].skins), "s / 10^6"], error_rows)}
The walk is Cycles' `random_walk` at its best: its colour corrected until the patch agrees, its radius such that the light in the shadow of the edge is as far from it as in the truth (light skin: colour {walk['light']['color']}, radius {walk['light']['radius_mm']} mm). Principled has the skin's colour and the usual radii.

More lobes show more noise at equal samples, because each sample takes one of them, and they differ in colour; light skin at 0.1 mm is fitted by one lobe alone. Burley lobes were not made for light from behind: the sheet's colour is far off with every material here. The effect *Thin parts* puts a walk in their place ([thin parts](thin_parts.md) has its error on this sheet).

## One setting at a time
![one setting at a time](accuracy_picture_factors.png)

Samples, four lobes with a table, mean of {", ".join(JUDGED)} (95th percentile), and seconds of a picture of {MEGAPIXELS:.2f} megapixels:

{_table(["samples", "denoised", "not denoised", "core seconds"], sample_rows)}
Distance of the table's entries (1 is the planner's own), on the mapped patch, and in the live table:

{_table(["step", "entries", "Delta E", "entries, live", "Delta E, live"], [row + [str(r["entries"]), pair([r])] for row, r in zip(factor(results["table"], "table_step"), results["live table"], strict=True)])}
Size of the maps (a texel of 1024 is 0.8 mm on the example head):

{_table(["texels", "Delta E"], factor(results["maps"], "map_size"))}
## Presets
The error of a setting is the 95th percentile of Delta E 2000, denoised, mean of {", ".join(JUDGED)} and of their skins. Not the sheet, lit from behind: no setting of a quality mends it; the effect *Thin parts* does ([thin parts](thin_parts.md)), which was off. **The rule**: a preset is the cheapest measured setting whose error is at most {", ".join(f"{x:g} ({n})" for n, x in PRESET_RULE.items())} times the least that the settings open to it reached; {" and ".join(WHOLE)} keep the whole material ({" and ".join(map(str, WHOLE.values()))} lobes or more, table step {USUAL.table_step:g} or finer, maps of {USUAL.map_size} or more), because tests hold at those settings alone what these scenes do not show: the fall-off of very dark skin, the table while sliders move. A shot without `quality` is `final`. `sanguine render --delta-e X` takes the cheapest of these points with an error of X or less.

{_table(["preset", "lobes", "step", "map", "samples", "Delta E", "prepare s", "s per megapixel", f"s of {MEGAPIXELS:.2f} megapixels with preparation"], [point_row(n, p) for n, p in names])}
The table holds the presets and the front of {len(LOBES)} x {len(SAMPLES)} lobes and samples with all tables and maps, but for points that gain less than 1 % on a faster one.
"""
