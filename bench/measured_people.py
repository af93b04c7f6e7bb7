"""How the skin of people differs, from measured faces: writes rigs/people_measured.toml.

    .venv/bin/python bench/measured_people.py

The International Skin Spectra Archive (see measured_skin.py) gives for most people several sites of the face, sex and an
age group. What is made of it, quantity by quantity, each on the scale on which `sanguine_core.fit` takes it as normal:

1. Every face spectrum is fitted. Dark skin hides its blood, so the fit is told what blood is like where skin shows it:
   the prior of hemoglobin and oxygenation is their mean in faces lighter than 10 degrees, with the spread between people
   there. (Without it the fit puts what the model of melanin misses into 6 % blood, docs/measured_skin.md.)
2. rigs/anatomy.toml says how a cheek, a nose differ from the skin as a whole. Fitted values are divided by these factors
   (oxygenation: the shift is taken off), so that cheeks rendered from a person's own value are again as measured. The
   mean over a person's sites is the person's value.
3. What sex and age change at the same tone is a regression with the tone and the study (instrument, place) beside it.
4. A class has the mean over its people, brought to age 30 and the middle between the sexes, and the covariance of what is
   left between people of one study and one tone: people differ by this; that studies differ too is the instruments.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import sanguine_core as core
from measured_skin import CLASSES, FACE, NAMES, ROOT, ROWS, Archive, fit_archive, lab, read_archive, skin_class
from sanguine.app.fitting import priors
from sanguine.domain.blood import ANATOMY, Rest

REGION = {"forehead": "forehead", "cheek": "cheeks", "cheek bone": "cheeks", "nose tip": "nose", "chin": "chin"}
# The melanin blend is not among them: a spectrum says nothing about it.
QUANTITIES = ("melanin", "hemoglobin", "oxygenation", "epidermis_thickness_mm", "scatter_scale", "scatter_power", "vessel_radius_mm")
HIDDEN = ("hemoglobin", "oxygenation")  # by melanin, where there is much of it
SHOWING_ITA = 10.0
AGES = {1: 17.0, 2: 24.5, 3: 34.5, 4: 44.5, 5: 54.5, 6: 66.0}  # middle of the group; the two open ones are a guess
REFERENCE_AGE = 30.0
FEWEST = 50  # people for a covariance of 7 quantities; a class with fewer takes that of the next one
TO_SCALE = {
    "logarithm": np.log,
    "logit": lambda x: np.log(x / (1 - x)),
    "root": np.sqrt,
    "linear": lambda x: x,
}


def own_values(site: np.ndarray, value: np.ndarray) -> np.ndarray:
    """(N, Q): the fitted values as the skin's own, freed of what the region does to them, on their scales."""
    rest = [ANATOMY.get(REGION[name], Rest()) for name in site]
    columns = []
    for name in QUANTITIES:
        column = value[:, NAMES.index(name)]
        if name in ("melanin", "hemoglobin"):
            column = column / [getattr(row, name) for row in rest]
        elif name == "oxygenation":
            column = np.clip(column - [row.oxygenation for row in rest], 0.01, 0.99)
        columns.append(TO_SCALE[ROWS[NAMES.index(name)]["scale"]](column))
    return np.stack(columns, axis=1)


def per_group(group: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Means of rows (N, ...) that share an index 0..G-1."""
    total = np.zeros((group.max() + 1, *rows.shape[1:]))
    np.add.at(total, group, rows)
    return total / np.bincount(group).reshape(-1, *([1] * (rows.ndim - 1)))


def blood_prior(archive: Archive, faces: np.ndarray) -> np.ndarray:
    """Priors with hemoglobin and oxygenation as skin that shows them has them."""
    prior = priors(())
    first = fit_archive(archive, faces, prior)
    showing = first["ita"] > SHOWING_ITA
    _, person = np.unique(archive.person[faces][showing], return_inverse=True)
    study = archive.study[faces][showing]
    for name in HIDDEN:
        k = NAMES.index(name)
        values = first["value"][showing, k]
        scaled = TO_SCALE[ROWS[k]["scale"]](values)
        means = per_group(person, scaled)
        within = np.var(scaled - means[person]) * len(scaled) / (len(scaled) - len(means))
        study_of = per_group(person, study.astype(float)).astype(int)
        _, group = np.unique(study_of, return_inverse=True)
        between = np.var(means - per_group(group, means)[group])
        spread = np.sqrt(between - within * np.mean(1 / np.bincount(person)))
        middle = np.exp(scaled.mean()) if name == "hemoglobin" else 1 / (1 + np.exp(-scaled.mean()))
        prior[k] = middle, spread
    return prior


def hats(x: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """(N, K) weights of linear interpolation between ascending knots, held beyond the ends."""
    return np.stack([np.interp(x, knots, row) for row in np.eye(len(knots))], axis=1)


def table(archive: Archive) -> dict:
    faces = np.flatnonzero(np.isin(archive.site, FACE))
    prior = blood_prior(archive, faces)
    fit = fit_archive(archive, faces, prior)
    ids, first, person = np.unique(archive.person[faces], return_index=True, return_inverse=True)
    values = per_group(person, own_values(archive.site[faces], fit["value"]))
    surface = per_group(person, fit["value"][:, NAMES.index("surface_reflectance")])
    colour = per_group(person, measured_lab(archive, faces))
    ita = np.degrees(np.arctan2(colour[:, 0] - 50, colour[:, 2]))
    kind = skin_class(ita)
    study = archive.study[faces][first]
    sex, group = archive.sex[faces][first], archive.age_group[faces][first]
    masculinity = np.select([sex == "F", sex == "M"], [0.0, 1.0], np.nan) - 0.5
    decades = (np.array([AGES.get(code, np.nan) for code in group]) - REFERENCE_AGE) / 10

    names = list(CLASSES)
    knots = np.array([ita[kind == name].mean() for name in names])
    tone = hats(ita, knots[::-1])
    known = np.isfinite(masculinity) & np.isfinite(decades)
    studies = np.equal.outer(study, np.unique(study)[1:]).astype(float)
    design = np.column_stack([tone, studies, masculinity, decades])[known]
    by, *_ = np.linalg.lstsq(design, values[known], rcond=None)
    left = values[known] - design @ by
    spread = np.sqrt(np.diag(np.linalg.pinv(design.T @ design))[-2:, None] * left.var(0) * len(left) / (len(left) - design.shape[1]))
    common = values - np.outer(np.nan_to_num(masculinity), by[-2]) - np.outer(np.nan_to_num(decades), by[-1])

    means = np.stack([common[kind == name].mean(0) for name in names])
    left = common - tone @ means[::-1]
    classes, covariance = {}, {}
    for name in names:
        here = np.flatnonzero(kind == name)
        if len(here) >= FEWEST:
            _, group = np.unique(study[here], return_inverse=True)
            apart = left[here] - per_group(group, left[here])[group]
            covariance[name] = apart.T @ apart / (len(here) - group.max() - 1)
    for k, name in enumerate(names):
        here = kind == name
        source = next(n for n in names[k:] if n in covariance)
        sides = list(CLASSES.values())
        classes[name] = {
            "people": int(here.sum()),
            "spectra": int(here[person].sum()),
            "ita_low": float(max(sides[k], ita.min())),
            "ita_high": float(sides[k - 1] if k else ita.max()),
            "ita": float(knots[k]),
            "ita_sd": float(ita[here].std()),
            "mean": means[k],
            "surface_reflectance": float(surface[here].mean()),
            "covariance_of": source,
            "covariance": covariance[source],
            "lab": colour[here].mean(0),
            "lab_covariance": np.cov(colour[here].T),
        }
    regions = [REGION[site] for site in archive.site[faces]]
    return {
        "sites": {name: regions.count(name) / len(regions) for name in dict.fromkeys(REGION.values())},
        "prior": {name: prior[NAMES.index(name)] for name in HIDDEN},
        "masculinity": by[-2],
        "masculinity_error": spread[0],
        "decade": by[-1],
        "decade_error": spread[1],
        "class": classes,
        "people": len(ids),
        "known": int(known.sum()),
        "delta_e": float(np.median(fit["delta_e"])),
        "delta_e_dark": float(np.median(fit["delta_e"][skin_class(fit["ita"]) == "dark"])),
    }


def measured_lab(archive: Archive, records: np.ndarray) -> np.ndarray:
    out = np.empty((len(records), 3))
    for group, columns in archive.groups():
        group = np.intersect1d(group, records)
        if len(group):
            nm = np.ascontiguousarray(archive.nm[columns])
            out[np.searchsorted(records, group)] = lab(archive.reflectance[group][:, columns], nm, "D65")
    return out


def numbers(values: np.ndarray, digits: int = 5) -> str:
    return "[" + ", ".join(f"{v:.{digits}g}" for v in values) + "]"


def toml(of: dict) -> str:
    lines = [
        "# Written by bench/measured_people.py, which says how; nothing here is by hand.",
        "# Faces of the International Skin Spectra Archive (Lu et al. 2025, Sci. Data 12, doi 10.1038/s41597-025-04857-5),",
        f"# fitted by sanguine_core {core.__version__}: {of['people']} people, sex and age known of {of['known']}; Delta E 2000 of the fits",
        f"# {of['delta_e']:.2f} (median), of dark skin {of['delta_e_dark']:.2f}.",
        "#",
        "# Values are the skin's own (measured over the region's factor in anatomy.toml), each on the scale on which the fit",
        "# takes it as normal (sanguine_core.fit_parameters(): logarithm, logit, root or linear), in the order of `quantities`.",
        "",
        f"quantities = {list(QUANTITIES)}".replace("'", '"'),
        "# Share of each region in the measured faces: a person's ITA is that of the mean Lab over them, specular included.",
        "sites = { " + ", ".join(f"{name} = {share:.3f}" for name, share in of["sites"].items()) + " }",
        f"reference_age_years = {REFERENCE_AGE:g}",
        f"age_years = [{AGES[1]:g}, {AGES[6]:g}]  # beyond these nobody was measured",
        "# Men less women, and ten years, at the same tone; _error is the standard error.",
        f"masculinity = {numbers(of['masculinity'], 3)}",
        f"masculinity_error = {numbers(of['masculinity_error'], 2)}",
        f"decade = {numbers(of['decade'], 3)}",
        f"decade_error = {numbers(of['decade_error'], 2)}",
        "# Blood as skin lighter than 10 degrees shows it, by which dark skin was fitted too: mean, spread on the scale.",
        *(f"prior_{name} = {numbers(row, 3)}" for name, row in of["prior"].items()),
    ]
    for name, row in of["class"].items():
        lines += [
            "",
            f"[class.{name.replace(' ', '-')}]",
            f"people = {row['people']}",
            f"spectra = {row['spectra']}",
            *(f"{key} = {row[key]:.4g}" for key in ("ita_low", "ita_high", "ita", "ita_sd")),
            f"mean = {numbers(row['mean'])}",
            f"covariance_of = \"{row['covariance_of'].replace(' ', '-')}\"",
            "covariance = [",
            *(f"    {numbers(line, 4)}," for line in row["covariance"]),
            "]",
            f"surface_reflectance = {row['surface_reflectance']:.4f}",
            f"lab = {numbers(row['lab'], 4)}",
            "lab_covariance = [" + ", ".join(numbers(line, 4) for line in row["lab_covariance"]) + "]",
        ]
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "rigs/people_measured.toml")
    options = parser.parse_args()
    of = table(read_archive())
    options.out.write_text(toml(of), encoding="utf-8")
    print(f"{of['people']} people, Delta E 2000 {of['delta_e']:.2f}, dark {of['delta_e_dark']:.2f}: {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
