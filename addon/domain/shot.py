"""SHOT.toml: who is seen, in which expressions or keyed timeline, under which light, as which images."""

from __future__ import annotations

import bisect
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pydantic

from . import people
from .blood import BLOOD, BLOOD_CONTROL, BLOOD_CONTROL_MAX, HEART_RATE_CONTROL, PACE, PACE_CONTROL, PULSE_CONTROL, STATES, Blood, Change, settled
from .effects import Frame, Growth, Scene
from .effects.effect import Interval
from .errors import InputError, nearest
from .facs import EMOTIONS, UNIT_CONTROLS, VARIANTS
from .files import read_toml, validate
from .head import load_presets
from .parameters import skin_from
from .plan import check_strengths, check_switches, default_strengths
from .profile import Profile, read_profile, with_profile
from .quality import DEFAULT, Choice, preset
from .resources import rigs_path
from .skin_preset import SkinPreset, read_preset
from .udim import find_tiles
from .vascular import HEART_RATE, HEART_RATE_AT_REST, Controls, blood_over_time

_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
_MAX_IMAGES = 100_000  # per shot; a study of thousands fits, a typing error in a frame range does not

Fraction = Annotated[float, pydantic.Field(ge=0.0, le=1.0, allow_inf_nan=False)]


def _level(value: Any) -> Any:
    """How far an emotion goes: a number from 0 to 1, or the name of a variant, of which the extreme one goes further."""
    if isinstance(value, str):
        if value not in VARIANTS:
            raise ValueError(f"no such variant '{value}', {nearest(value, VARIANTS)}; or give a number, 0 to 1")
        return VARIANTS[value]
    if isinstance(value, (int, float)) and not 0.0 <= value <= 1.0:
        raise ValueError(f"{value} is outside 0 to 1; what is more than full is 'extreme'")
    return value


Level = Annotated[float, pydantic.BeforeValidator(_level)]


class _Table(pydantic.BaseModel):
    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)


def _check_id(value: str) -> str:
    if not _ID.fullmatch(value):
        raise ValueError("an id names a file: letters, digits, '_', '-', '.', beginning with a letter or digit")
    return value


Id = Annotated[str, pydantic.AfterValidator(_check_id)]


class Rig(_Table):
    """The face: a head preset of `rigs/heads.toml`."""

    head: str

    @pydantic.field_validator("head")
    @classmethod
    def _known(cls, value: str) -> str:
        known = load_presets(rigs_path("heads.toml"))
        if value not in known:
            raise ValueError(f"no such head, {nearest(value, known)}")
        return value


class Individual(_Table):
    """Who somebody is: from this come skin, features and their strengths, where the file does not name them itself."""

    tone: Annotated[str, pydantic.AfterValidator(people.check_tone)]
    sex: Literal[tuple(people.SEXES)] = "female"
    age: Annotated[float, pydantic.Field(ge=people.AGES[0], le=people.AGES[1])] = 30.0
    seed: Annotated[int, pydantic.Field(ge=people.SEEDS[0], le=people.SEEDS[1])] = 0
    sun: Fraction = 0.5

    @property
    def person(self) -> people.Person:
        return people.person(self.tone, self.sex, self.age, self.seed, self.sun)


class Maps(_Table):
    """Maps that come with a face, as EXR files (`<UDIM>` for sets of tiles); paths are relative to the shot's.

    skin: channels hemoglobin, melanin, oil, oxygenation or some of them. residual: channels R, G, B.
    """

    skin: str | None = None
    residual: str | None = None


class Subject(_Table):
    """One person: a rig and a skin. A shot has several, or one by its top-level `rig`, `person` and `skin`."""

    id: Id
    rig: Rig
    person: Individual | None = None
    # A file of Export Skin, in the place of a person; its path is relative to the shot's. Its quality is not the shot's.
    skin_preset: str | None = None
    skin: dict[str, float] = {}
    maps: Maps = Maps()

    @cached_property
    def preset(self) -> SkinPreset | None:
        return read_preset(self.skin_preset) if self.skin_preset is not None else None

    def whole_skin(self, where: str = "skin") -> dict[str, float]:
        """Every parameter: what `skin` names, else the person's or the preset's, else the schema's default. Raises
        InputError."""
        base = self.person.person.skin if self.person else self.preset.skin if self.preset else None
        return skin_from(self.skin, where, base)

    def strengths(self, effects: Mapping[str, bool | float], where: str = "effects") -> dict[str, float]:
        """Of every effect: what the shot's `effects` names, else the person's or the preset's, else the default. Raises
        InputError."""
        known = default_strengths()
        given = {name: float(value) for name, value in effects.items() if not isinstance(value, bool) or value and name in known}
        base = self.person.person.strengths if self.person else self.preset.effects if self.preset else None
        return check_strengths(given, where, base)

    @property
    def growth(self) -> Growth:
        return self.person.person.growth if self.person else self.preset.grown if self.preset else Growth()


# Table of a pose -> what it names, for people, and the names that there are.
_NAMES = {
    "emotions": ("emotion", EMOTIONS),
    "action_units": ("action unit", UNIT_CONTROLS),
    "states": ("state of the body", STATES),
}


class Pose(_Table):
    """Emotions, action units and states of the body, the strength of the blood's answer (above 1: exaggerated) and
    its pace (above 1: hurried), the heart."""

    emotions: dict[str, Level] = {}
    action_units: dict[str, Fraction] = {}
    states: dict[str, Fraction] = {}
    blood: Annotated[float, pydantic.Field(ge=0.0, le=BLOOD_CONTROL_MAX, allow_inf_nan=False)] = 1.0
    blood_pace: Annotated[float, pydantic.Field(ge=PACE[0], le=PACE[1])] = 1.0
    pulse: Fraction = 0.0
    heart_rate: Annotated[float, pydantic.Field(ge=HEART_RATE[0], le=HEART_RATE[1])] = HEART_RATE_AT_REST

    @pydantic.field_validator("emotions", "action_units", "states")
    @classmethod
    def _known(cls, value: dict[str, float], info: pydantic.ValidationInfo) -> dict[str, float]:
        kind, known = _NAMES[info.field_name]
        for name in value:
            if name not in known:
                raise ValueError(f"no such {kind} '{name}', {nearest(name, known)}")
        return value

    @property
    def feelings(self) -> dict[str, float]:
        """Emotions and states, what moves blood."""
        return {**self.emotions, **self.states}

    @property
    def controls(self) -> dict[str, float]:
        """Slider -> value, of those that the pose names and those that every face has."""
        return {
            **self.feelings, **self.action_units,
            BLOOD_CONTROL: self.blood, PACE_CONTROL: self.blood_pace,
            PULSE_CONTROL: self.pulse, HEART_RATE_CONTROL: self.heart_rate,
        }


class Expression(Pose):
    """A still: one image per subject."""

    id: Id


class Key(Pose):
    """A pose at a frame of a timeline."""

    frame: Annotated[int, pydantic.Field(ge=0, le=1_048_574)]


class Timeline(_Table):
    """Keyed poses; frames first to last by step are rendered. Blood takes its time, `fps` frames a second."""

    fps: Annotated[float, pydantic.Field(ge=1.0, le=1000.0)] = 24.0
    first: Annotated[int, pydantic.Field(ge=0, le=1_048_574)] = 1
    last: Annotated[int, pydantic.Field(ge=0, le=1_048_574)]
    step: Annotated[int, pydantic.Field(ge=1)] = 1
    key: Annotated[list[Key], pydantic.Field(min_length=1)]

    @cached_property
    def sorted_keys(self) -> list[Key]:
        return sorted(self.key, key=lambda key: key.frame)


class Light(_Table):
    """The portrait light: `strength` scales all lamps."""

    rig: Literal["portrait"] = "portrait"
    strength: Annotated[float, pydantic.Field(ge=0.0, le=100.0)] = 1.0


class Camera(_Table):
    focal_mm: Annotated[float, pydantic.Field(ge=20.0, le=300.0)] = 85.0
    yaw_degrees: Annotated[float, pydantic.Field(ge=-180.0, le=180.0)] = 0.0


class Image(_Table):
    width: Annotated[int, pydantic.Field(ge=16, le=16384)] = 640
    height: Annotated[int, pydantic.Field(ge=16, le=16384)] = 800
    # Left out, the shot's quality decides.
    samples: Annotated[int, pydantic.Field(ge=1, le=65536)] | None = None
    denoise: bool = True
    view_transform: str = ""
    # What the skins are made of; "auto": plain nodes.
    material: Literal["auto", "osl", "nodes"] = "auto"
    seed: Annotated[int, pydantic.Field(ge=0, le=2_147_483_647)] = 0


class Shot(_Table):
    """A whole SHOT.toml."""

    rig: Rig | None = None
    person: Individual | None = None
    skin_preset: str | None = None
    skin: dict[str, float] = {}
    maps: Maps = Maps()
    # Effect -> its strength, or false: switched off (true: as without this line, at full strength if it has one).
    effects: dict[str, pydantic.StrictBool | float] = {}
    subject: list[Subject] = []
    expression: list[Expression] = []
    timeline: Timeline | None = None
    quality: str = DEFAULT
    # A file of `sanguine physiology`: measured changes of blood in the place of the table's. Its path is relative to the
    # shot's.
    blood_profile: str | None = None
    light: Light = Light()
    camera: Camera = Camera()
    image: Image = Image()

    @pydantic.field_validator("quality")
    @classmethod
    def _known_quality(cls, value: str) -> str:
        return preset(value).preset

    @property
    def switched_off(self) -> frozenset[str]:
        return frozenset(name for name, value in self.effects.items() if value is False)

    @property
    def chosen_quality(self) -> Choice:
        """The preset the file names, with the samples it names besides."""
        point, samples = preset(self.quality), self.image.samples
        if samples is None or samples == point.samples:
            return Choice(point.settings, point, f"quality is '{self.quality}'")
        because = f"quality is '{self.quality}', but image.samples is {samples} instead of {point.samples}"
        return Choice(point.settings.model_copy(update={"samples": samples}), None, because)

    @cached_property
    def profile(self) -> Profile | None:
        return read_profile(self.blood_profile) if self.blood_profile is not None else None

    @cached_property
    def blood_model(self) -> Blood:
        return with_profile(BLOOD, self.profile) if self.profile else BLOOD

    @property
    def subjects(self) -> list[Subject]:
        if self.subject:
            return self.subject
        assert self.rig is not None  # read_shot saw to it
        shared = {name: getattr(self, name) for name in ("rig", "person", "skin_preset", "skin", "maps")}
        return [Subject(id="subject", **shared)]


class Job(_Table):
    """One image: whose, in which pose, at which frame."""

    id: str
    subject: str
    expression: str | None
    frame: int | None


def read_shot(path: str | os.PathLike[str]) -> Shot:
    """A checked shot. Raises InputError, one line that names the file, the key and the mend."""
    shot = validate(Shot, read_toml(path), path)
    if bool(shot.subject) == (shot.rig is not None):
        raise InputError(f"{path}: rig: give one [rig] with its [skin], or [[subject]] tables, not "
                         + ("both" if shot.subject else "neither"))
    if shot.subject and shot.person:
        raise InputError(f"{path}: person: give it to the [[subject]] tables, each its own")
    if shot.subject and shot.skin_preset is not None:
        raise InputError(f"{path}: skin_preset: give it to the [[subject]] tables, each its own")
    if shot.subject and shot.maps != Maps():
        raise InputError(f"{path}: maps: give them to the [[subject]] tables, each its own")
    folder = Path(path).resolve().parent
    shot = shot.model_copy(update={
        "skin_preset": _beside(folder, shot.skin_preset),
        "subject": [s.model_copy(update={"skin_preset": _beside(folder, s.skin_preset)}) for s in shot.subject],
    })
    for subject in shot.subjects:
        if subject.person and subject.skin_preset is not None:
            raise InputError(f"{path}: skin_preset: give a person or a preset, not both")
    if bool(shot.expression) == (shot.timeline is not None):
        raise InputError(f"{path}: expression: give [[expression]] tables or one [timeline], not "
                         + ("both" if shot.expression else "neither"))
    for key, ids in (("subject", shot.subject), ("expression", shot.expression)):
        seen: set[str] = set()
        for item in ids:
            if item.id in seen:
                raise InputError(f"{path}: {key}: two have the id '{item.id}'")
            seen.add(item.id)
    for subject in shot.subjects:
        subject.whole_skin(f"{path}: skin" if not shot.subject else f"{path}: subject {subject.id}: skin")
    shot.subjects[0].strengths(shot.effects, f"{path}: effects")
    check_switches({name: on for name, on in shot.effects.items() if isinstance(on, bool)}, f"{path}: effects")
    if shot.timeline and shot.timeline.last < shot.timeline.first:
        raise InputError(f"{path}: timeline.last: {shot.timeline.last} is before the first frame, {shot.timeline.first}")
    if (count := _count(shot)) > _MAX_IMAGES:
        raise InputError(f"{path}: {count} images are more than the {_MAX_IMAGES} of one shot: split it")
    taken = {"contact_sheet"}
    for job in jobs(shot):
        if job.id in taken:
            raise InputError(f"{path}: expression: two pictures would be named '{job.id}': change an id")
        taken.add(job.id)
    found = {
        "maps": _found(shot.maps, path, "maps"),
        "subject": [
            item.model_copy(update={"maps": _found(item.maps, path, f"subject {item.id}: maps")}) for item in shot.subject
        ],
    }
    if shot.blood_profile is not None:
        found["blood_profile"] = _beside(folder, shot.blood_profile)
    shot = shot.model_copy(update=found)
    shot.profile  # read now: what is wrong with it is said before any work
    return shot


def _beside(folder: Path, name: str | None) -> str | None:
    return None if name is None else str(folder / name)


def _found(maps: Maps, shot_path: str | os.PathLike[str], where: str) -> Maps:
    """`maps` with whole paths. Raises InputError for files that are not there."""
    found = {}
    for key, name in maps.model_dump(exclude_none=True).items():
        file = Path(shot_path).resolve().parent / name
        try:
            find_tiles(file)
        except InputError as error:
            raise InputError(f"{shot_path}: {where}.{key}: {error}") from None
        found[key] = str(file)
    return Maps(**found)


def _count(shot: Shot) -> int:
    poses = len(shot.expression) if not shot.timeline else len(_frames(shot.timeline))
    return poses * len(shot.subjects)


def _frames(timeline: Timeline) -> range:
    return range(timeline.first, timeline.last + 1, timeline.step)


def jobs(shot: Shot) -> list[Job]:
    """Every image of the shot in the order of rendering. Ids are file names without their suffix."""
    several = len(shot.subjects) > 1
    made = []
    for subject in shot.subjects:
        prefix = f"{subject.id}_" if several else ""
        if shot.timeline:
            made += [
                Job(id=f"{prefix}{frame:06d}", subject=subject.id, expression=None, frame=frame)
                for frame in _frames(shot.timeline)
            ]
        else:
            made += [
                Job(id=f"{prefix}{item.id}", subject=subject.id, expression=item.id, frame=None)
                for item in shot.expression
            ]
    return made


def pose_of(shot: Shot, job: Job) -> Pose:
    """The pose of a job; between keys of a timeline it is linear, outside them it holds."""
    if shot.timeline is None:
        return next(item for item in shot.expression if item.id == job.expression)
    return pose_at(shot.timeline, job.frame)


def pose_at(timeline: Timeline, frame: int) -> Pose:
    keys = timeline.sorted_keys
    i = bisect.bisect_right(keys, frame, key=lambda key: key.frame)
    before, after = keys[max(i - 1, 0)], keys[min(i, len(keys) - 1)]
    if frame <= before.frame or before.frame >= after.frame:
        return before
    t = (frame - before.frame) / (after.frame - before.frame)

    def mix(a: float, b: float) -> float:
        return (1 - t) * a + t * b

    def blend(a: dict[str, float], b: dict[str, float]) -> dict[str, float]:
        return {name: mix(a.get(name, 0.0), b.get(name, 0.0)) for name in {**a, **b}}

    return Pose.model_construct(  # of checked keys; an emotion on its way to the extreme may be above 1
        emotions=blend(before.emotions, after.emotions),
        action_units=blend(before.action_units, after.action_units),
        states=blend(before.states, after.states),
        blood=mix(before.blood, after.blood),
        blood_pace=mix(before.blood_pace, after.blood_pace),
        pulse=mix(before.pulse, after.pulse),
        heart_rate=mix(before.heart_rate, after.heart_rate),
    )


@dataclass(frozen=True)
class Performance:
    """A timeline frame by frame, from the first that it keys or renders to the last that it renders.

    controls: slider -> its values, of sliders that are not 0 all the time (blood and the heart are always there).
    changes: (region, quantity) -> the blood's change. Arrays have the shape of `frames`.
    """

    frames: np.ndarray
    controls: Mapping[str, np.ndarray]
    changes: Mapping[tuple[str, str], np.ndarray]

    def at(self, frame: int) -> dict[tuple[str, str], Change]:
        """What has moved at a frame."""
        i = frame - int(self.frames[0])
        return {key: (float(change[i]),) * 2 for key, change in self.changes.items() if change[i]}


def performance(shot: Shot) -> Performance | None:
    """The timeline of a shot with the blood that it brings; None of a shot of stills, whose blood is settled.

    It is that of the whole timeline, whichever frames are wanted: one frame alone is the same as in sequence.
    """
    if shot.timeline is None:
        return None
    first = min(shot.timeline.first, *(key.frame for key in shot.timeline.key))
    frames = np.arange(first, shot.timeline.last + 1)
    poses = [pose_at(shot.timeline, int(frame)).controls for frame in frames]
    names = dict.fromkeys(name for pose in poses for name in pose)
    every = {name: np.array([pose.get(name, 0.0) for pose in poses]) for name in names}
    kept = {name: series for name, series in every.items() if series.any() or name == BLOOD_CONTROL}
    return Performance(frames, kept, blood_over_time(Controls(frames / shot.timeline.fps, kept), shot.blood_model))


def feelings_of(shot: Shot) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The emotions and the states that some moment of the shot shows."""
    poses = shot.timeline.key if shot.timeline else shot.expression
    emotions = dict.fromkeys(name for pose in poses for name, value in pose.emotions.items() if value > 0.0)
    states = dict.fromkeys(name for pose in poses for name, value in pose.states.items() if value > 0.0)
    return tuple(emotions), tuple(states)


def scene_of(
    shot: Shot, subject: Subject, regions: tuple[str, ...], maps: Mapping[str, Mapping[str, Interval]] | None = None
) -> Scene:
    """What the planner may know of one subject of a shot. maps: ranges of those that came with the face (`Scene.maps`)."""
    frames = []
    timeline = performance(shot)
    for job in jobs(shot):
        if job.subject != subject.id:
            continue
        pose = pose_of(shot, job)
        feelings = {name: value for name, value in pose.feelings.items() if value > 0.0}
        moves = any(value > 0.0 for value in (*pose.emotions.values(), *pose.action_units.values()))
        if timeline:
            changes = timeline.at(job.frame)
        else:
            changes = {key: (value, value) for key, value in settled(feelings, pose.blood, shot.blood_model).items()}
        frames.append(Frame(job.id, feelings, pose.blood, changes, moves))
    return Scene(
        skin=subject.whole_skin(),
        frames=tuple(frames),
        strengths=subject.strengths(shot.effects),
        switched_off=shot.switched_off,
        regions=regions,
        growth=subject.growth,
        maps=maps or {},
    )
