"""The `render` use-case: every image of a shot, a manifest that grows with them, and a contact sheet."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

import sanguine_core

from ..domain.errors import InputError
from ..domain.files import atomic
from ..domain.plan import Plan, make_plan
from ..domain.quality import Choice, Settings
from ..domain.shot import Job, Pose, Shot, Subject, jobs, pose_of, scene_of
from .manifest import Manifest, finished, sha256
from .map_cache import key_of
from .skin_maps import Tiles, read_face_maps

CONTACT_SHEET = "contact_sheet.png"
# Beyond this a contact sheet shows nothing any more.
_CONTACT_SHEET_IMAGES = 100
IMAGE_SUFFIXES = (".png", ".exr")


class Renderer(Protocol):
    """What the batch needs of Blender."""

    version: str
    """Of Blender: another one may render another picture."""

    def regions(self, subject: Subject) -> tuple[str, ...]:
        """Regions whose masks the subject's face has."""

    def prepare(self, shot: Shot, subject: Subject, plan: Plan, images: Mapping[str, Tiles]) -> None:
        """Builds the subject's scene in an empty file; a timeline is keyed, its blood baked. images: the maps that came
        with the face."""

    def render(self, pose: Pose, frame: int, png: Path, exr: Path) -> None:
        """Renders one pose, or frame of the timeline, of the prepared subject: display-referred PNG and linear EXR of the
        same render."""

    def save(self, blend: Path) -> None:
        """Keeps the prepared scene as a file that needs nothing of ours."""


def render_batch(
    shot: Shot,
    shot_path: str | os.PathLike[str],
    out: str | os.PathLike[str],
    renderer: Renderer,
    only: list[str] | None = None,
    resume: bool = False,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
    quality: Choice | None = None,
    keep_blend: bool = False,
) -> dict[str, Any]:
    """Renders `shot` into the folder `out` and returns the manifest. keep_blend: writes `<subject>.blend` beside it.

    Each image and the manifest are written whole or not at all, so a run can be killed at any moment; with
    `resume` an image is kept when its parameters and its checksum still agree with the manifest.
    `quality` stands in the place of the shot's own.
    The plan is that of the whole shot even with `only`: one frame alone equals the same frame in sequence.
    """
    settings = (quality or shot.chosen_quality).settings
    folder = Path(out)
    wanted = [job for job in jobs(shot) if only is None or job.id in only]
    whole = finished(folder) if resume or only is not None else {}
    kept = whole if resume else {}
    # With `only`, what an earlier run made of the other images stays in the manifest.
    files = {name: row for name, row in whole.items() if resume or Path(name).stem not in {job.id for job in wanted}}
    done = 0
    with Manifest(folder, shot_path, files) as manifest:
        for subject in shot.subjects:
            mine = [job for job in wanted if job.subject == subject.id]
            face = read_face_maps(subject.maps)
            plan = make_plan(scene_of(shot, subject, renderer.regions(subject), face.ranges), settings)
            missing = []
            poses = [pose_of(shot, job).model_dump(exclude={"id", "frame"}) for job in jobs(shot) if job.subject == subject.id]
            measured = shot.profile.model_dump_json() if shot.profile else ""
            whole_shot = key_of(renderer.version, measured, shot.timeline.fps if shot.timeline else 0.0, poses)
            for job in mine:
                prints = key_of(whole_shot, _parameters(shot, subject, job, settings, face.digest))
                if all(kept.get(job.id + suffix, {}).get("fingerprint") == prints for suffix in IMAGE_SUFFIXES):
                    done += 1
                else:
                    missing.append((job, prints))
            if missing or keep_blend:
                progress(f"preparing {subject.id}", done, len(wanted))
                renderer.prepare(shot, subject, plan, face.images)
            if keep_blend:
                with atomic(folder / f"{subject.id}.blend") as blend:
                    renderer.save(blend)
            for job, prints in missing:
                progress(f"rendering {job.id}", done, len(wanted))
                manifest.add(_render(shot, subject, plan, job, face.digest, prints, folder, renderer))
                done += 1
        manifest.add(_contact_sheet(shot, folder, manifest.files))
    progress("rendered", done, len(wanted))
    return manifest.content


def _render(
    shot: Shot, subject: Subject, plan: Plan, job: Job, maps: str, fingerprint: str, folder: Path, renderer: Renderer
) -> dict[str, dict[str, Any]]:
    pose = pose_of(shot, job)
    start = time.perf_counter()
    with atomic(folder / f"{job.id}.png") as png, atomic(folder / f"{job.id}.exr") as exr:
        renderer.render(pose, job.frame or 1, png, exr)
        sums = {".png": sha256(png), ".exr": sha256(exr)}
    row = {
        "subject": subject.id,
        "expression": job.expression,
        "frame": job.frame,
        "parameters": _parameters(shot, subject, job, plan.settings, maps),
        "effects": [e.id for e in plan.active if job.id in plan.decisions[e.id].frames],
        "seconds": round(time.perf_counter() - start, 3),
        "fingerprint": fingerprint,
    }
    return {job.id + suffix: {"file": job.id + suffix, "sha256": sums[suffix], **row} for suffix in IMAGE_SUFFIXES}


def _parameters(shot: Shot, subject: Subject, job: Job, settings: Settings, maps: str) -> dict[str, Any]:
    """maps: the hash of the files that hold the maps of the face, "" without any."""
    return {
        "head": subject.rig.head,
        "skin": subject.whole_skin(),
        "effects": {**subject.strengths(shot.effects), **dict.fromkeys(sorted(shot.switched_off), False)},
        "growth": asdict(subject.growth),
        "maps": maps,
        "pose": (pose := pose_of(shot, job)).model_dump(exclude={"id", "frame"}),
        "blood": blood_words(pose),
        "light": shot.light.model_dump(),
        "camera": shot.camera.model_dump(),
        "image": shot.image.model_dump(exclude={"samples"}),
        "quality": settings.model_dump(),
    }


def blood_words(pose: Pose) -> str:
    """What was made more of than in life, for whoever looks at the picture."""
    more = [
        *([f"exaggerated {pose.blood:g} times"] if pose.blood > 1.0 else []),
        *([f"hurried {pose.blood_pace:g} times"] if pose.blood_pace > 1.0 else []),
    ]
    return ", ".join(more) or "as in life"


def _contact_sheet(shot: Shot, folder: Path, files: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """All images of the shot side by side, once they are all there."""
    every = [job.id for job in jobs(shot)]
    if len(every) > _CONTACT_SHEET_IMAGES or any(f"{name}.png" not in files for name in every):
        return {}
    with atomic(folder / CONTACT_SHEET) as path:
        sanguine_core.contact_sheet([str(folder / f"{name}.png") for name in every], every, str(path))
    return {CONTACT_SHEET: {"file": CONTACT_SHEET, "sha256": sha256(folder / CONTACT_SHEET), "of": every}}
