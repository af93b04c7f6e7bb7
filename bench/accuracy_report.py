"""The results of accuracy.py as Markdown tables and as a plot."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from statistics import median
from typing import Any

BEGIN, END = "<!-- written by `sanguine bench accuracy` -->", "<!-- end -->"

COLOURS = {"skin": "#c0392b", "multipole": "#8e7cc3", "adding-doubling": "#2471a3", "monte-carlo": "#229954",
           "auto": "#222222"}  # fmt: skip
MARKERS = {"skin": "*", "multipole": "v", "adding-doubling": "o", "monte-carlo": "s", "auto": "x"}


def percent(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{100 * value:.0f} %" if value >= 0.1 else f"{100 * value:.2g} %"


def duration(seconds: float | None) -> str:
    if seconds is None:
        return "-"
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e6:.3g} us"


def rounded(value: float) -> str:
    """To two digits, which is what a factor read off two curves is worth."""
    return f"{float(f'{value:.2g}'):,.0f}"


def plain(value: float | None) -> str:
    return "-" if value is None else f"{value:.2g}"


def table(heads: list[str], rows: Iterable[Iterable[Any]]) -> str:
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


BRIEF = ("as it comes", "closed form", "8 streams", "16 streams", "32 streams", "1e4 photons", "1e6 photons",
         "tolerance 0.1", "tolerance 0.01", "tolerance 0.001")  # fmt: skip
"""Settings of the stacks that the page shows; the others stand in accuracy.md beside the results."""


def tables(results: dict[str, Any], brief: bool = False) -> str:
    machine = results["machine"]
    parts = [
        f"Sanguine {results['sanguine']}; {machine['processor']}, {machine['cores']} cores. "
        "Times: CPU seconds of one thread unless said, the median of several repeats. "
        f"One run of {results['minutes']:.1f} minutes; the machine's load at its start was {machine['load']:.1f}"
        + (", quick: few cases and settings.\n" if results["quick"] else ".\n")
    ]
    parts.append("### Speed and bars\n")
    parts.append(_speed(results))
    parts.append("### Colour of one skin, 41 wavelengths, diffuse light\n")
    parts.append(_colour(results))
    parts.append("### At equal error\n")
    parts.append(_equal(results))
    parts.append("### Stacks of the reference file\n")
    parts.append(_stacks(results, brief))
    parts.append("### Wavelengths, skin table\n")
    parts.append(
        table(
            ["wavelengths", "time", "Delta E D65, median", "worst", "Delta E A, median", "worst"],
            (
                [r["wavelengths"], duration(r["seconds"]), *(plain(r[k]) for k in (
                    "delta_e_D65_median", "delta_e_D65_worst", "delta_e_A_median", "delta_e_A_worst"))]
                for r in results["wavelengths"]
            ),
        )
    )  # fmt: skip
    parts.append("### Nodes of tau in the path table\n")
    parts.append(
        table(
            ["nodes", "Rd, median", "worst", "profile L1, median", "worst", "Delta E D65, worst", "Delta E A, worst"],
            (
                [r["nodes"], *(percent(r[k]) for k in ("Rd_change_median", "Rd_change_worst", "profile_change_median",
                 "profile_change_worst")), plain(r["delta_e_D65_worst"]), plain(r["delta_e_A_worst"])]
                for r in results["tau_nodes"]
            ),
        )
    )  # fmt: skip
    parts.append("### Entries of a material's table of lobes\n")
    parts.append(
        table(
            ["axis", "per octave", "entries", "baking", "bytes", "Rd, worst", "profile L1, median", "worst",
             "of the lobes themselves", "Delta E D65, median", "worst"],
            (
                [r["axis"], f"{r['entries_per_octave']:.2g}" + (" (table_step 1)" if r["planned"] else ""), r["entries"],
                 duration(r["seconds"]), r["bytes"], percent(r["Rd_change_worst"]), percent(r["profile_change_median"]),
                 percent(r["profile_change_worst"]), percent(r["lobes_profile_error"]), plain(r["delta_e_D65_median"]),
                 plain(r["delta_e_D65_worst"])]
                for r in results["lut"]
            ),
        )
    )  # fmt: skip
    parts.append("### The truth, checked\n")
    parts.append(
        "iadpython with {} and {} directions, carried on to infinitely many, against the reference file: its Monte "
        "Carlo and its own second number, an adding-doubling without noise.\n\n".format(*results["truth"]["directions"])
        + table(
            ["case", "off the Monte Carlo", "its standard error", "off the second number", "last step"],
            (
                [r["case"], f"{100 * r['error']:+.3f} %", f"{100 * r['floor']:.3f} %",
                 f"{100 * r['against_second']:+.4f} %", f"{100 * r['step']:+.4f} %"]
                for r in results["truth"]["against_reference"]
            ),
        )
        + "\nOn the skins the last step changes Rd by {} (median), the colour by Delta E {} (worst).\n".format(
            percent(results["truth"]["floor"]["Rd_error_median"]), plain(results["truth"]["floor"]["delta_e_D65_worst"])
        )
    )  # fmt: skip
    return "\n".join(parts)


def _speed(results: dict[str, Any]) -> str:
    speed, limit = results["speed"], results["speed"]["limit"]
    tables_ = speed["tables"]
    one, last = speed["threads"][0], speed["threads"][-1]
    rows = [
        ["one skin, 41 wavelengths, colour only", duration(speed["colour_41_wavelengths_s"]), "20 us"],
        ["the same, asked for alone from Python", duration(speed["colour_41_wavelengths_alone_s"]), "-"],
        ["radial RGB profile and lobes (81 wavelengths)", duration(speed["profile_and_lobes_s"]), "1 ms"],
        *(
            [f"{last['threads']} threads against 1, time that passes: {what}", f"x {last[key] / one[key]:.2f}", "-"]
            for what, key in (("colours", "skins_per_second"), ("lobes", "lobes_per_second"))
        ),
        ["tables, files", f"{sum(tables_['file_bytes'].values()) / 1e6:.2f} MB", "64 MB"],
        ["the table of diffuse light, in memory", f"{tables_['memory_bytes'] / 1e6:.1f} MB", "64 MB"],
        ["the same, loading, when first used", duration(tables_["load_s"]), "50 ms"],
        ["operations per wavelength (counted)", f"{limit['operations_per_wavelength']:,}", "-"],
        ["operations per second", f"{limit['operations_per_second'] / 1e9:.1f} G", "-"],
        ["the core's peak (matrix product, float)", f"{limit['peak_operations_per_second'] / 1e9:.1f} G", "-"],
        ["share of that peak", percent(limit["share_of_peak"]), "-"],
    ]  # fmt: skip
    return table(["what", "measured", "bar"], rows)


def _colour(results: dict[str, Any]) -> str:
    differences = ("delta_e_D65_median", "delta_e_D65_worst", "delta_e_A_median", "delta_e_A_worst")
    return table(
        ["solver", "setting", "time per skin", "Rd, median", "worst", "Delta E D65, median", "worst",
         "Delta E A, median", "worst"],
        (
            [r["solver"], r["setting"], duration(r["seconds"]), percent(r["Rd_error_median"]),
             percent(r["Rd_error_worst"]), *(plain(r[key]) for key in differences)]
            for r in results["colour"]
        ),
    )  # fmt: skip


_MEASURES = {"Rd_error_median": "Rd, median", "delta_e_D65_median": "Delta E D65, median",
             "delta_e_A_median": "Delta E A, median", "profile_median": "profile L1, median"}  # fmt: skip


def _equal(results: dict[str, Any]) -> str:
    def error(row: dict[str, Any]) -> str:
        return plain(row["error"]) if row["measure"].startswith("delta") else percent(row["error"])

    return table(
        ["measure", "error of the skin table", "its time", "solver", "its time at that error", "factor", "read off"],
        (
            [_MEASURES[r["measure"]], error(r), duration(r["skin_s"]), r["solver"], duration(r["seconds"]),
             rounded(r["factor"]), r["how"]]
            for r in results["equal_error"]
        ),
    )  # fmt: skip


def _stacks(results: dict[str, Any], brief: bool) -> str:
    rows = []
    sizes: dict[str, int] = {}
    for r in results["summary"]:
        sizes[r["group"]] = max(sizes.get(r["group"], 0), r["cases"])
    for r in results["summary"]:
        if brief and r["setting"] not in BRIEF:
            continue
        notes = [] if r["cases"] == sizes[r["group"]] else [f"{r['cases']} of {sizes[r['group']]} cases"]
        if r["answered"] < r["cases"]:
            notes.append(f"{r['cases'] - r['answered']} refused")
        if r["warned"]:
            notes.append(f"{r['warned']} warned")
        if r["solver"] == "auto":
            picks = (("totals", r["picked"]), ("profile", r["profile_picked"]))
            notes += [f"{what} by {', '.join(names)}" for what, names in picks if names]
        rows.append(
            [r["group"], r["solver"], r["setting"], duration(r["seconds_median"]), percent(r["Rd_median"]),
             percent(r["Rd_worst"]), percent(r["Tt_worst"]), percent(r["second_worst"]),
             duration(r["profile_seconds_median"]), percent(r["profile_median"]), percent(r["profile_worst"]),
             "; ".join(notes)]
        )  # fmt: skip
    heads = ["stacks", "solver", "setting", "time, totals", "Rd, median", "worst", "Tt, worst", "second number, worst",
             "time, profile", "profile L1, median", "worst", "notes"]  # fmt: skip
    floors = ", ".join(
        f"{group}: Rd {percent(floor['Rd'])}, profile {percent(floor['profile'])}"
        for group, floor in _floors(results).items()
    )
    return table(heads, rows) + f"\nThe file's own noise, below which no error can be seen (median): {floors}.\n"


def _floors(results: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Noise of the reference, the median of each group's cases."""
    rows = results["floors"]
    return {
        group: {key: median(row[key] for row in rows if row["group"] == group) for key in ("Rd", "profile")}
        for group in dict.fromkeys(row["group"] for row in rows)
    }


def write_into(page: Path, results: dict[str, Any]) -> None:
    """Replaces what stands between the marks of a page."""
    before, rest = page.read_text().split(BEGIN)
    after = rest.split(END)[1]
    page.write_text(f"{before}{BEGIN}\n\n{tables(results, brief=True)}\n{END}{after}")


# --- the plot ---


def plot(results: dict[str, Any], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    pyplot.rcParams.update({"font.size": 9, "axes.titlesize": 10, "axes.spines.top": False, "axes.spines.right": False})
    figure, axes = pyplot.subplots(2, 2, figsize=(12, 8.6), layout="constrained")

    def points(rows: list[dict[str, Any]], seconds: str, error: str) -> list[Point]:
        return [
            (r["solver"], _short(r["setting"]), r[seconds], r[error])
            for r in rows
            if r.get(seconds) and r.get(error) and (r["solver"], r["setting"]) != ("multipole", "as it comes")
        ]

    # The table's own row of 41 wavelengths is among these.
    colours = [
        ("skin", f"{r['wavelengths']} wavelengths", r["seconds"], r["delta_e_D65_median"])
        for r in results["wavelengths"]
    ]
    colours += [p for p in points(results["colour"], "seconds", "delta_e_D65_median") if p[0] != "skin"]
    skin, slab = ([r for r in results["summary"] if r["group"] == group] for group in ("skin", "slab"))
    floor = {group: _floors(results)[group] for group in ("skin", "slab")}
    _panel(axes[0, 0], colours, "Colour of one skin; 41 wavelengths unless said", "Delta E 2000, D65, median of skins",
           results["truth"]["floor"]["delta_e_D65_median"])  # fmt: skip
    _panel(axes[0, 1], points(skin, "profile_seconds_median", "profile_median"),
           "Profile R(r) of a skin stack", "L1 error, median of cases", floor["skin"]["profile"])  # fmt: skip
    _panel(axes[1, 0], points(skin, "seconds_median", "Rd_median"),
           "Total reflectance of a skin stack", "|error of Rd|, median of cases", floor["skin"]["Rd"])  # fmt: skip
    _panel(axes[1, 1], points(slab, "seconds_median", "Rd_median"),
           "Total reflectance of slabs", "|error of Rd|, median of cases", floor["slab"]["Rd"])  # fmt: skip
    handles: dict[str, Any] = {}
    for axis in axes.flat:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=len(handles), frameon=False)
    machine = results["machine"]
    figure.suptitle(f"Error against time, one thread ({machine['processor']}); one run", fontsize=11)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


Point = tuple[str, str, float, float]
"""Solver, setting, seconds, error."""


def _short(setting: str) -> str:
    for word in (" streams", " photons", "tolerance ", "as it comes", "table"):
        setting = setting.replace(word, "")
    return setting.replace("N = ", "N=").replace("closed form", "closed")


def _labels(points: list[tuple[float, float, str]], decades: tuple[float, float]) -> list[tuple[float, float, str]]:
    """One label for points that lie so near in time and error: the settings of the first and the last."""
    out: list[list[tuple[float, float, str]]] = []
    for point in points:
        near = (abs(math.log10(point[k] / group[0][k])) < decades[k] for group in out[-1:] for k in (0, 1))
        if out and all(near):
            out[-1].append(point)
        else:
            out.append([point])
    return [(g[0][0], g[0][1], g[0][2] if len(g) == 1 else f"{g[0][2]} to {g[-1][2]}") for g in out]


def _panel(axis: Any, points: list[Point], title: str, error: str, floor: float) -> None:
    axis.set(title=title, xlabel="CPU seconds, one thread", ylabel=error, xscale="log", yscale="log")
    axis.grid(True, which="major", color="#dddddd", linewidth=0.6)
    for solver in dict.fromkeys(p[0] for p in points):
        mine = [(p[2], p[3], p[1]) for p in points if p[0] == solver]
        axis.plot([p[0] for p in mine], [p[1] for p in mine], color=COLOURS[solver], marker=MARKERS[solver],
                  markersize=11 if solver == "skin" else 5, linewidth=1, label=solver, zorder=3)  # fmt: skip
        near = {"multipole": (1.2, 0.35), "auto": (0.15, 0.15)}.get(solver, (0.06, 0.06))
        below = solver == "auto"
        for seconds, value, setting in _labels(mine, near):
            axis.annotate(setting, (seconds, value), textcoords="offset points", xytext=(-4, -10) if below else (5, 4),
                          ha="right" if below else "left", fontsize=7, color=COLOURS[solver])  # fmt: skip
    front: list[tuple[float, float]] = []
    for seconds, value in sorted((p[2], p[3]) for p in points):
        if not front or value < front[-1][1]:
            front.append((seconds, value))
    xs, ys = zip(*front, strict=True)
    axis.step([*xs, axis.get_xlim()[1]], [*ys, ys[-1]], where="post", color="#f1c40f", linewidth=5, alpha=0.35,
              zorder=1, label="Pareto front")  # fmt: skip
    axis.set_ylim(min(axis.get_ylim()[0], floor / 2), 2 * axis.get_ylim()[1])
    axis.axhspan(axis.get_ylim()[0], floor, color="#999999", alpha=0.25, linewidth=0, zorder=0,
                 label="uncertainty of the truth")  # fmt: skip
