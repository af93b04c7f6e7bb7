"""People: a label of skin tone, a sex, an age and a seed become a skin and the strengths of what grows on it.

The label says how light the face is. What else differs between people of that tone is drawn from measured faces
(rigs/people_measured.toml, written by bench/measured_people.py), what no spectrum holds from rigs/people.toml.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from statistics import NormalDist
from typing import Annotated, Literal

import numpy as np
import sanguine_core
from pydantic import Field, model_validator

from .blood import ANATOMY
from .effects import EFFECTS, Growth
from .errors import InputError, nearest
from .parameters import PARAMETERS, Skin, default_skin, skin_rows
from .resources import Row, read_table, rigs_path

SEXES = {"female": 0.0, "male": 1.0}
AGES = (0.0, 120.0)
SEEDS = (0, 2**31 - 1)
FARTHEST = 2.5  # standard deviations: rarer people are left out, 1 of 80 on each scale
_FAINTEST = 0.05  # strengths below it do not show, and what is off costs nothing

Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
Points = Annotated[tuple[tuple[float, Annotated[float, Field(ge=0.0)]], ...], Field(min_length=1)]
Curve = Fraction | Points


class BySex(Row):
    female: Curve
    male: Curve


class ToneRow(Row):
    """One row of [tone] in rigs/people.toml."""

    label: str
    help: str
    class_: Annotated[str, Field(alias="class")] = ""
    ita: tuple[float, float] | None = None

    @model_validator(mode="after")
    def _one(self) -> ToneRow:
        if bool(self.class_) == (self.ita is not None):
            raise ValueError("give either class or ita")
        return self


class Trait(Row):
    """One [[trait]] of rigs/people.toml."""

    id: str
    strength: Curve | BySex
    spread: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    share: Curve | BySex = 1.0
    light: Points = ((0.0, 1.0),)
    magnitude: Literal["measured", "derived", "guess"]
    source: str


class _People(Row):
    tone: dict[str, ToneRow]
    trait: tuple[Trait, ...]


class SkinClass(Row):
    """Measured people of one class: see bench/measured_people.py. Angles in degrees, Lab under D65, specular included."""

    people: int
    spectra: int
    ita_low: float
    ita_high: float
    ita: float
    ita_sd: float
    mean: tuple[float, ...]
    covariance_of: str
    covariance: tuple[tuple[float, ...], ...]
    surface_reflectance: float
    lab: tuple[float, float, float]
    lab_covariance: tuple[tuple[float, float, float], ...]


class Measured(Row):
    """rigs/people_measured.toml: `mean` and all beside it are in the order of `quantities`, on the scales of the fit."""

    quantities: tuple[str, ...]
    sites: dict[str, float]
    reference_age_years: float
    age_years: tuple[float, float]
    masculinity: tuple[float, ...]
    masculinity_error: tuple[float, ...]
    decade: tuple[float, ...]
    decade_error: tuple[float, ...]
    prior_hemoglobin: tuple[float, float]
    prior_oxygenation: tuple[float, float]
    class_: Annotated[dict[str, SkinClass], Field(alias="class")]


MEASURED: Measured = read_table(rigs_path("people_measured.toml"), Measured)
CLASSES: dict[str, SkinClass] = MEASURED.class_
_PEOPLE: _People = read_table(rigs_path("people.toml"), _People)
TRAITS: dict[str, Trait] = {row.id: row for row in _PEOPLE.trait}
ITA_RANGE = (min(row.ita_low for row in CLASSES.values()), max(row.ita_high for row in CLASSES.values()))


@dataclass(frozen=True)
class Tone:
    """A label that `person` takes; ita is the range of the faces it stands for, degrees."""

    id: str
    label: str
    help: str
    ita: tuple[float, float]


def _tones() -> dict[str, Tone]:
    made = {}
    for name, row in CLASSES.items():
        text = f"{row.people} people measured, ITA {row.ita_low:.0f} to {row.ita_high:.0f} degrees"
        made[name] = Tone(name, name.replace("-", " ").capitalize(), text, (row.ita_low, row.ita_high))
    for name, row in _PEOPLE.tone.items():
        if row.class_ and row.class_ not in CLASSES:
            raise InputError(f"{rigs_path('people.toml')}: tone.{name}.class: {row.class_}: {nearest(row.class_, CLASSES)}")
        ita = (CLASSES[row.class_].ita_low, CLASSES[row.class_].ita_high) if row.class_ else row.ita
        if not ITA_RANGE[0] <= ita[0] < ita[1] <= ITA_RANGE[1]:
            raise InputError(f"{rigs_path('people.toml')}: tone.{name}.ita: beyond the measured {_degrees(ITA_RANGE)}")
        text = f"{row.help}. ITA {ita[0]:.0f} to {ita[1]:.0f} degrees"
        made[name] = Tone(name, row.label, text, ita)
    return made


def _degrees(ita: tuple[float, float]) -> str:
    return f"{math.ceil(ita[0])} to {math.floor(ita[1])} degrees"


TONES: dict[str, Tone] = _tones()
"""Every label, for panels and messages: classes of measured skin, Fitzpatrick, Monk. Besides: `ita:<degrees>`."""


@dataclass(frozen=True)
class Person:
    """One individual.

    ita: of the face, degrees. skin: every parameter of the schema. strengths: of effects, those that are not 0.
    """

    tone: str
    ita: float
    skin: Skin
    strengths: Mapping[str, float]
    growth: Growth


def check_tone(tone: str) -> str:
    """`tone` as `person` knows it. Raises ValueError with the nearest label."""
    name = tone.strip().lower().replace(" ", "-").replace("_", "-")
    if roman := re.fullmatch(r"fitzpatrick-(i{1,3}|iv|vi?)", name):
        name = f"fitzpatrick-{('i', 'ii', 'iii', 'iv', 'v', 'vi').index(roman[1]) + 1}"
    if name.startswith("ita:"):
        try:
            angle = float(name.removeprefix("ita:"))
        except ValueError:
            raise ValueError(f"'{tone}' is no angle: 'ita:35' is 35 degrees") from None
        if not ITA_RANGE[0] <= angle <= ITA_RANGE[1]:
            raise ValueError(f"'{tone}' was never measured on a face, which has {_degrees(ITA_RANGE)}")
    elif name not in TONES:
        raise ValueError(f"no such tone '{tone}', {nearest(name, [*TONES, 'ita:35'])}")
    return name


def person(tone: str, sex: str = "female", age_years: float = 30.0, seed: int = 0, sun: float = 0.5) -> Person:
    """The individual number `seed` of this description; the same on every machine.

    Parameters
    ----------
    tone : a key of TONES, or "ita:<degrees>", which fixes the angle that a label leaves to chance
    sex : "female" or "male"
    age_years : 0 to 120; skin changes as measured between 17 and 66 years and holds beyond
    sun : exposure of a life, 0 to 1. It lets spots grow; how light the face is the tone has said

    Raises InputError, one line, for what is none of these.
    """
    try:
        tone = check_tone(tone)
    except ValueError as error:
        raise InputError(f"tone: {error}") from None
    if sex not in SEXES:
        raise InputError(f"sex: '{sex}': {nearest(sex, SEXES)}")
    for name, value, (low, high) in (("age", age_years, AGES), ("seed", seed, SEEDS), ("sun", sun, (0.0, 1.0))):
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
            raise InputError(f"{name}: {value!r} is outside {low:g} to {high:g}")
    if seed != int(seed):
        raise InputError(f"seed: {seed!r} is not a whole number")
    growth = Growth(int(seed), float(age_years), float(sun), SEXES[sex])
    return _person(tone, growth)


def typical(tone: str) -> Person:
    """The middle of a measured class (a label of CLASSES): every quantity at its mean, neither female nor male, at the age
    to which the measurements were reduced, with what more than half of such women, and of such men, have: at its median
    strength in the sex that has less of it."""
    if tone not in CLASSES:
        raise InputError(f"tone: '{tone}': no class of measured skin, {nearest(tone, CLASSES)}")
    growth, ita = Growth(0, float(MEASURED.reference_age_years), 0.5, 0.5), CLASSES[tone].ita
    skin = default_skin() | _quantities(ita, growth, np.zeros(len(MEASURED.quantities)))
    strengths = {}
    for trait in TRAITS.values():
        both = [replace(growth, masculinity=masculinity) for masculinity in SEXES.values()]
        strength = min(_at(trait.strength, one) for one in both)
        if min(_share(trait, ita, one) for one in both) <= 0.5 or strength < _FAINTEST:
            continue
        if trait.id in PARAMETERS:
            skin[trait.id] = min(max(strength, PARAMETERS[trait.id].hard_min), PARAMETERS[trait.id].hard_max)
        else:
            strengths[trait.id] = round(min(strength, 1.0), 4)
    skin["melanin"] = melanin_for(skin, ita)
    return Person(tone, ita, {k: float(f"{v:.6g}") for k, v in skin.items()}, strengths, growth)


@lru_cache(maxsize=256)
def _person(tone: str, growth: Growth) -> Person:
    ita = _angle(tone, growth.seed)
    skin = default_skin() | _drawn(ita, growth)
    traits = traits_of(ita, growth)
    for name in traits.keys() & PARAMETERS.keys():
        skin[name] = min(max(traits[name], PARAMETERS[name].hard_min), PARAMETERS[name].hard_max)
    effects = {effect.id for effect in EFFECTS if effect.default_strength is not None}
    strengths = {name: value for name, value in traits.items() if name in effects and value > 0.0}
    skin["melanin"] = melanin_for(skin, ita)
    # Six digits hide the last bits, in which mathematical libraries differ.
    return Person(tone, ita, {k: float(f"{v:.6g}") for k, v in skin.items()}, strengths, growth)


def chance(seed: int, what: str) -> float:
    """A number between 0 and 1 that depends on its arguments alone, not on the order of asking or a library's version."""
    digest = hashlib.blake2b(f"{seed}:{what}".encode(), digest_size=8).digest()
    return (int.from_bytes(digest, "big") // 2**11 + 0.5) / 2**53


def _normal(seed: int, what: str) -> float:
    return min(max(NormalDist().inv_cdf(chance(seed, what)), -FARTHEST), FARTHEST)


def _angle(tone: str, seed: int) -> float:
    """The ITA of a person: within a class as measured, within a range anywhere."""
    if tone.startswith("ita:"):
        return float(tone.removeprefix("ita:"))
    low, high = TONES[tone].ita
    row = CLASSES.get(tone) or CLASSES.get(_PEOPLE.tone[tone].class_)
    angle = row.ita + row.ita_sd * _normal(seed, "ita") if row else low + (high - low) * chance(seed, "ita")
    return round(min(max(angle, low), high), 3)


def _drawn(ita: float, growth: Growth) -> dict[str, float]:
    """The measured quantities of an individual of this tone."""
    return _quantities(ita, growth, np.array([_normal(growth.seed, name) for name in MEASURED.quantities]))


def _quantities(ita: float, growth: Growth, draws: np.ndarray) -> dict[str, float]:
    """The same from `draws`, standard normal, in the order of MEASURED.quantities."""
    classes = sorted(CLASSES.values(), key=lambda row: row.ita)
    share = [float(np.interp(ita, [row.ita for row in classes], unit)) for unit in np.eye(len(classes))]
    mean = sum(s * np.array(row.mean) for s, row in zip(share, classes, strict=True))
    covariance = sum(s * np.array(row.covariance) for s, row in zip(share, classes, strict=True))
    age = min(max(growth.age_years, MEASURED.age_years[0]), MEASURED.age_years[1])
    mean = mean + np.array(MEASURED.masculinity) * (growth.masculinity - 0.5)
    mean = mean + np.array(MEASURED.decade) * (age - MEASURED.reference_age_years) / 10
    scaled = mean + np.linalg.cholesky(covariance) @ draws
    rows = {row["id"]: row for row in sanguine_core.fit_parameters()}
    return {
        name: min(max(_from_scale(rows[name]["scale"], value), rows[name]["lower"]), rows[name]["upper"])
        for name, value in zip(MEASURED.quantities, scaled.tolist(), strict=True)
    }


def _from_scale(scale: str, value: float) -> float:
    """The inverse of bench/measured_people.py's scales."""
    match scale:
        case "logarithm":
            return math.exp(value)
        case "logit":
            return 1.0 / (1.0 + math.exp(-value))
        case "root":
            return max(value, 0.0) ** 2
        case _:
            return value


def melanin_for(skin: Skin, ita: float) -> float:
    """The melanin with which the face, all else being as in `skin`, has this ITA; the nearest there is."""
    row = PARAMETERS["melanin"]
    low, high = math.log(5e-4), math.log(row.hard_max)
    for _ in range(30):  # darker with more melanin, without exception
        middle = (low + high) / 2
        if _ita(face_lab({**skin, "melanin": math.exp(middle)}, ita)) > ita:
            low = middle
        else:
            high = middle
    return math.exp(low)


def face_lab(skin: Skin, ita: float) -> np.ndarray:
    """L*a*b* (3,) under D65 of a face with this skin as a spectrophotometer sees it, specular included.

    The mean over the sites of the measured faces, each with what anatomy makes of the skin there. ita: by which the
    reflectance of the surface is taken, as fitted to faces of that tone.
    """
    sites = []
    for region in MEASURED.sites:
        rest = ANATOMY[region]
        site = {
            **skin,
            "hemoglobin": skin["hemoglobin"] * rest.hemoglobin,
            "melanin": skin["melanin"] * rest.melanin,
            "oxygenation": skin["oxygenation"] + rest.oxygenation,
            "oil": 0.0,
        }
        sites.append({key: min(max(value, PARAMETERS[key].hard_min), PARAMETERS[key].hard_max) for key, value in site.items()})
    rows = skin_rows(sites)
    classes = sorted(CLASSES.values(), key=lambda row: row.ita)
    surface = float(np.interp(ita, [row.ita for row in classes], [row.surface_reflectance for row in classes]))
    # The skin's reflectance is that under its own diffuse interface; an instrument sees through its specular one.
    entry = 1.0 - sanguine_core.surface(rows)[:1, 1]
    nm = np.arange(400.0, 701.0, 10.0)
    spectra = surface + (1.0 - surface) / entry * sanguine_core.reflectance(rows, nm, threads=1)
    lab = sanguine_core.lab(sanguine_core.xyz(spectra, nm))
    return np.array(list(MEASURED.sites.values())) @ lab / sum(MEASURED.sites.values())


def face_ita(skin: Skin) -> float:
    """The ITA of a face with this skin, degrees: the angle that `face_lab` has when it is told this very angle.

    How much the surface reflects depends on the tone, by a few percent of the light, so this settles at once.
    """
    ita = sum(ITA_RANGE) / 2
    for _ in range(8):
        before, ita = ita, _ita(face_lab(skin, ita))
        if abs(ita - before) < 0.01:
            break
    return ita


def class_at(ita: float) -> str:
    """The class of measured skin (a label of CLASSES) of an angle; the last one beyond what was measured."""
    return next((name for name, row in CLASSES.items() if ita >= row.ita_low), list(CLASSES)[-1])


def _ita(lab: np.ndarray) -> float:
    """Chardin et al. 1991, degrees; L* of 50 to 50 is where it turns from positive to negative."""
    return math.degrees(math.atan2(lab[0] - 50.0, lab[2]))


def traits_of(ita: float, growth: Growth) -> dict[str, float]:
    """The strength (0-1) of every trait in this individual; 0 is a trait that he does not have."""
    return {trait.id: _trait(trait, ita, growth) for trait in TRAITS.values()}


def _trait(trait: Trait, ita: float, growth: Growth) -> float:
    if chance(growth.seed, f"{trait.id} has") >= _share(trait, ita, growth):
        return 0.0
    strength = _at(trait.strength, growth) * math.exp(trait.spread * _normal(growth.seed, trait.id))
    return round(min(strength, 1.0), 4) if strength >= _FAINTEST else 0.0


def _share(trait: Trait, ita: float, growth: Growth) -> float:
    """How many of such people have the trait."""
    return _at(trait.share, growth) * float(np.interp(ita, *zip(*trait.light, strict=True)))


def _at(curve: Curve | BySex, growth: Growth) -> float:
    if isinstance(curve, BySex):
        return (1 - growth.masculinity) * _at(curve.female, growth) + growth.masculinity * _at(curve.male, growth)
    if isinstance(curve, float):
        return curve
    return float(np.interp(growth.age_years, *zip(*curve, strict=True)))
