"""The plots of a study: boxes per emotion and sex, courses around the onset of a label, correlations.

They need matplotlib, which is imported where it is used.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from ..domain.files import atomic
from ..domain.physiology.cleaning import blocks
from ..domain.physiology.measures import MEASURES
from ..domain.physiology.recording import NEUTRAL
from ..domain.physiology.statistics import mean_interval
from .physiology import POOLED, Study, shown

COLOURS = {"female": "#b4464b", "male": "#33658a", "": "#6d6d6d"}
_BEFORE_S, _AFTER_S = 20.0, 90.0
_LEAST_SUBJECTS = 3


def write_plots(done: Study, folder: str | os.PathLike[str]) -> list[str]:
    """Writes changes.png, courses.png and correlations.png. Returns their names."""
    written = []
    figures = {"changes.png": _changes, "courses.png": _courses, "correlations.png": _correlations}
    for name, draw in figures.items():
        figure = draw(done)
        with atomic(Path(folder) / name) as temporary:
            figure.savefig(temporary, dpi=150, metadata={"Software": None})
        written.append(name)
    return written


def _figure(rows: int, columns: int, width: float, height: float) -> tuple[Any, np.ndarray]:
    """Axes (rows, columns) without pyplot, whose global state a library must not touch."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False)
    for ax in axes.flat:
        ax.spines[["top", "right"]].set_visible(False)
        ax.tick_params(labelsize=8, length=3)
    return figure, axes


def _series(done: Study) -> list[tuple[str, str]]:
    """(measure, region) in the order of the measures."""
    keys = {(change.measure, change.region) for change in done.changes}
    return sorted(keys, key=lambda key: (list(MEASURES).index(key[0]), key[1]))


def _emotions(done: Study) -> list[str]:
    return sorted({change.emotion for change in done.changes})


def _sexes(done: Study) -> list[str]:
    present = {change.sex for change in done.changes}
    return [sex for sex in COLOURS if sex in present]


def _label(key: tuple[str, str]) -> str:
    measure = MEASURES[key[0]]
    where = f", {key[1]}" if key[1] else ""
    unit = {"relative": "change in %", "fraction": "change in % points"}.get(
        "relative" if measure.relative else measure.unit, f"change {measure.unit}"
    )
    return f"{measure.name}{where}\n{unit}"


def _plotted(measure: str, value: Any) -> Any:
    """Percent for ratios and fractions, else the unit itself."""
    if MEASURES[measure].relative:
        return 100.0 * np.expm1(value)
    return 100.0 * np.asarray(value) if MEASURES[measure].unit == "fraction" else value


def _changes(done: Study) -> Any:
    series, emotions, sexes = _series(done), _emotions(done), _sexes(done)
    columns = {1: 1, 2: 2, 4: 2}.get(len(series), 3)
    rows = -(-len(series) // columns)
    figure, axes = _figure(rows, columns, max(max(3.4, 1.1 + 0.95 * len(emotions)) * columns, 5.0), 2.9 * rows + 0.4)
    width = 0.7 / (len(sexes) + 1)
    for key, ax in zip(series, axes.flat, strict=False):
        own = [change for change in done.changes if (change.measure, change.region) == key]
        ax.axhline(0.0, color="0.7", lw=0.8, zorder=0)
        for i, emotion in enumerate(emotions):
            for j, sex in enumerate(sexes):
                values = _plotted(key[0], np.array([c.change for c in own if (c.emotion, c.sex) == (emotion, sex)]))
                if values.size:
                    _box(ax, i + (j - len(sexes) / 2.0) * width, values, width, COLOURS[sex])
            finding = next(
                (f for f in done.findings if (f.measure, f.region, f.emotion, f.group) == (*key, emotion, POOLED)), None
            )
            if finding is not None and finding.estimate.low is not None:
                e = finding.estimate
                middle, low, high = (float(_plotted(key[0], v)) for v in (e.mean, e.low, e.high))
                at = i + len(sexes) / 2.0 * width
                ax.plot([at, at], [low, high], color="k", lw=1.4, solid_capstyle="butt")
                ax.plot(at, middle, "D", color="k" if finding.supported else "w", mec="k", ms=4.5)
        ax.set_xticks(range(len(emotions)), emotions)
        ax.set_xlim(-0.6, len(emotions) - 0.4)
        ax.set_ylabel(_label(key), fontsize=8)
    for ax in list(axes.flat)[len(series) :]:
        ax.set_visible(False)
    _legend(figure, sexes, [("D", "k", "mean and 95 % interval, supported"), ("D", "w", "not supported")])
    return figure


def _box(ax: Any, at: float, values: np.ndarray, width: float, colour: str) -> None:
    ax.boxplot(
        values, positions=[at], widths=0.8 * width, showfliers=False, patch_artist=True, manage_ticks=False,
        boxprops={"facecolor": colour, "alpha": 0.25, "edgecolor": colour, "lw": 0.9},
        medianprops={"color": colour, "lw": 1.6}, whiskerprops={"color": colour, "lw": 0.9}, capprops={"color": colour, "lw": 0.9},
    )  # fmt: skip
    # Points side by side in the order of their size: the same picture every time.
    shift = (np.argsort(np.argsort(values)) * 0.618) % 1.0 - 0.5
    ax.plot(at + shift * 0.5 * width, values, ".", color=colour, ms=4.0, mew=0, alpha=0.8, zorder=3)


def _legend(figure: Any, sexes: list[str], marks: list[tuple[str, str, str]]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = [
        Patch(facecolor=COLOURS[sex], alpha=0.4, edgecolor=COLOURS[sex], label=sex or "sex not stated") for sex in sexes
    ]
    handles += [
        Line2D([], [], marker=m, color="k", mfc=face, mec="k", ms=4.5, lw=1.4, label=text) for m, face, text in marks
    ]
    _legend_above(figure, handles)


def _legend_above(figure: Any, handles: list[Any]) -> None:
    """As many columns as the figure is wide enough for."""
    columns = max(1, min(len(handles), int(figure.get_figwidth() / 2.3)))
    figure.legend(handles=handles, loc="outside upper center", ncols=columns, fontsize=8, frameon=False)


def _courses(done: Study) -> Any:
    series, emotions, sexes = _series(done), _emotions(done), _sexes(done)
    figure, axes = _figure(len(series), len(emotions), max(2.5 * len(emotions) + 0.9, 5.0), 1.9 * len(series) + 0.5)
    step = done.settings.settling.window_s
    edges = np.arange(-_BEFORE_S, _AFTER_S + step, step)
    middle = (edges[1:] + edges[:-1]) / 2.0
    for row, key in enumerate(series):
        courses = _course(done, key, edges)
        for column, emotion in enumerate(emotions):
            ax = axes[row, column]
            ax.sharey(axes[row, 0])
            ax.axhline(0.0, color="0.7", lw=0.8, zorder=0)
            long = [end for name, sex, _, end in courses if name == emotion]
            if long:
                ax.axvspan(0.0, min(float(np.median(long)), _AFTER_S), color="0.94", zorder=-1, lw=0)
            lag = done.used_lag_s.get(key[0], 0.0)
            if lag:
                ax.axvline(lag, color="0.4", lw=0.8, ls=":")
            for sex in sexes:
                own = np.array([values for name, s, values, _ in courses if (name, s) == (emotion, sex)])
                if own.size:
                    _band(ax, middle, own, key[0], COLOURS[sex])
            ax.set_xlim(-_BEFORE_S, _AFTER_S)
            if row == 0:
                ax.set_title(emotion, fontsize=9)
            if row == len(series) - 1:
                ax.set_xlabel("seconds from the label", fontsize=8)
            else:
                ax.tick_params(labelbottom=False)
            if column == 0:
                ax.set_ylabel(_label(key), fontsize=8)
            else:
                ax.tick_params(labelleft=False)
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = [
        Line2D([], [], color=COLOURS[sex], lw=1.6, label=f"{sex or 'sex not stated'}: mean of subjects")
        for sex in sexes
    ]
    handles += [
        Patch(facecolor="0.5", alpha=0.25, label="95 % interval of the mean"),
        Patch(facecolor="0.94", label="the label lasts"),
    ]
    if any(done.used_lag_s.get(measure) for measure, _ in series):
        handles.append(Line2D([], [], color="0.4", ls=":", lw=0.8, label="lag of the sensor"))
    _legend_above(figure, handles)
    return figure


def _band(ax: Any, middle: np.ndarray, own: np.ndarray, measure: str, colour: str) -> None:
    """Mean over subjects (S, T) and its t interval, where enough of them have samples."""
    there = np.isfinite(own).sum(axis=0)
    mean, low, high = (np.full(middle.size, np.nan) for _ in range(3))
    for k in np.flatnonzero(there >= _LEAST_SUBJECTS):
        estimate = mean_interval(own[np.isfinite(own[:, k]), k])
        mean[k] = estimate.mean
        if estimate.low is not None:
            low[k], high[k] = estimate.low, estimate.high
    ax.fill_between(middle, _plotted(measure, low), _plotted(measure, high), color=colour, alpha=0.22, lw=0)
    ax.plot(middle, _plotted(measure, mean), color=colour, lw=1.6)


def _course(done: Study, key: tuple[str, str], edges: np.ndarray) -> list[tuple[str, str, np.ndarray, float]]:
    """(emotion, sex, change in each bin, seconds the label lasts), averaged over each subject's episodes."""
    found: dict[tuple[str, str, str], list[tuple[np.ndarray, float]]] = {}
    for c, settled in zip(done.tracks, done.levels, strict=True):
        track = c.track
        if (track.measure.id, track.region) != key:
            continue
        rest = [level for level in settled if level.emotion == NEUTRAL]
        if not rest:
            continue
        for block in blocks(track):
            if block.emotion == NEUTRAL:
                continue
            base = np.interp((block.start_s + block.end_s) / 2.0, [r.middle_s for r in rest], [r.value for r in rest])
            place = np.digitize(c.time_s - block.start_s, edges) - 1
            inside = (place >= 0) & (place < edges.size - 1)
            count = np.bincount(place[inside], minlength=edges.size - 1)
            total = np.bincount(place[inside], weights=c.value[inside], minlength=edges.size - 1)
            with np.errstate(invalid="ignore"):
                course = total / count - base
            found.setdefault((track.subject, track.sex, block.emotion), []).append(
                (course, block.end_s - block.start_s)
            )
    out = []
    for (_, sex, emotion), episodes in found.items():
        stacked = np.array([course for course, _ in episodes])
        there = np.isfinite(stacked).sum(axis=0)
        mean = np.where(there > 0, np.nansum(stacked, axis=0) / np.maximum(there, 1), np.nan)
        out.append((emotion, sex, mean, float(np.mean([lasts for _, lasts in episodes]))))
    return out


def _correlations(done: Study) -> Any:
    """Each measure with each label, and each two measures, within people."""
    series, emotions = _series(done), _emotions(done)
    several = len(series) > 1
    width = 1.05 * (len(emotions) + several * (len(series) - 1)) + 3.0 + 1.2 * several
    figure, axes = _figure(1, 1 + several, width, 0.62 * len(series) + 1.6)
    names = [MEASURES[measure].name + (f",\n{region}" if region else "") for measure, region in series]
    found = {(f.measure, f.region, f.emotion): f for f in done.findings if f.group == POOLED}
    image = _matrix(
        axes[0, 0], [[_cell(found.get((*key, emotion))) for emotion in emotions] for key in series], names, emotions,
        "with the label",
    )  # fmt: skip
    if several:
        pairs = {}
        for pair in done.pairs:
            keys = [(m, pair.region if MEASURES[m].device == "analyser" else "") for m in pair.measures]
            pairs[frozenset(keys)] = pair
        between = [
            [_cell(pairs.get(frozenset((a, b)))) if j <= i else None for j, b in enumerate(series[:-1])]
            for i, a in enumerate(series[1:])
        ]
        _matrix(axes[0, 1], between, names[1:], names[:-1], "with each other")
    bar = figure.colorbar(image, ax=axes[0, -1], shrink=0.8)
    bar.set_label("correlation within people", fontsize=8)
    bar.ax.tick_params(labelsize=8)
    return figure


def _cell(finding: Any) -> tuple[float, float, float, bool] | None:
    """(r, low, high, supported)"""
    if finding is None or finding.correlation is None:
        return None
    r = finding.correlation
    return r.value, r.low, r.high, finding.verdict == "supported"


def _matrix(ax: Any, cells: list[list[Any]], rows: list[str], columns: list[str], title: str) -> Any:
    values = np.array([[np.nan if cell is None else cell[0] for cell in row] for row in cells])
    image = ax.imshow(values, cmap="RdBu_r", vmin=-1.0, vmax=1.0, aspect="auto")
    for i, row in enumerate(cells):
        for j, cell in enumerate(row):
            if cell is not None:
                value, low, high, supported = cell
                colour = "w" if abs(value) > 0.65 else "k"
                ax.text(j, i - 0.12, f"{value:+.2f}", ha="center", va="center", fontsize=8, color=colour,
                        weight="bold" if supported else "normal")  # fmt: skip
                ax.text(j, i + 0.22, f"{low:+.2f} to {high:+.2f}", ha="center", va="center", fontsize=6.2, color=colour)
    ax.set_xticks(range(len(columns)), columns, fontsize=7)
    ax.set_yticks(range(len(rows)), rows, fontsize=7)
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    ax.set_title(title + " (bold: supported)", fontsize=9)
    return image
