"""The `plan` use-case: what will be simulated for a shot and why, without doing the work."""

from __future__ import annotations

import time
from typing import Any, Protocol

import sanguine_core

from ..domain.effects import EFFECTS, grown, wrinkles
from ..domain.framing import Framing, portrait
from ..domain.lut import entry_skins
from ..domain.plan import Plan, make_plan
from ..domain.quality import Choice
from ..domain.shot import Shot, Subject, scene_of
from ..domain.texel_density import map_sizes, mm_per_uv
from .faces import example_head, head_surface
from .maps import LARGEST_WRINKLES, Surface
from .skin_maps import read_face_maps

_TIMED_ENTRIES = 4


class FaceOf(Protocol):
    """What the maps of a subject depend on, without building its scene."""

    def __call__(self, subject: Subject) -> tuple[Surface, Framing]: ...


def example_face(shot: Shot) -> FaceOf:
    """The subjects of a shot are heads of ours, framed as a portrait."""

    def face_of(subject: Subject) -> tuple[Surface, Framing]:
        head = example_head(subject.rig.head)
        eyes, chin, crown = (head.landmarks[name] for name in ("eyes", "chin", "crown"))
        return head_surface(head), portrait(eyes, chin, crown, shot.camera.focal_mm, shot.camera.yaw_degrees)

    return face_of


def plan_report(
    shot: Shot, regions: tuple[str, ...], quality: Choice | None = None, face_of: FaceOf | None = None
) -> dict[str, Any]:
    """The answer of `sanguine plan`: one plan per subject, the first one's at the top level too.

    `costs_ms` is what an effect adds to the preparation of this shot on this machine: the table entries that
    would not be there without it, at the time a few entries took just now.
    """
    quality = quality or shot.chosen_quality
    plans = {
        subject.id: make_plan(scene_of(shot, subject, regions, read_face_maps(subject.maps).ranges), quality.settings)
        for subject in shot.subjects
    }
    entry_ms = _entry_ms(next(iter(plans.values())))
    reports = {name: _report(plan, entry_ms) for name, plan in plans.items()}
    for subject in shot.subjects if face_of else ():
        reports[subject.id]["maps"] = _maps(plans[subject.id], shot, *face_of(subject))
    answer = {"sanguine": sanguine_core.__version__, "quality": _quality(shot, quality), **next(iter(reports.values()))}
    if len(reports) > 1:
        answer["subjects"] = reports
    return answer


def _maps(plan: Plan, shot: Shot, surface: Surface, framing: Framing) -> list[dict[str, Any]]:
    """Size and memory of each map that the face itself gives, and why."""
    pixel_mm = framing.pixel_mm(surface.position_mm, shot.image.height)
    span_mm = mm_per_uv(surface.position_mm, surface.uv, surface.triangles, surface.corner_vertex)
    sizes = map_sizes(span_mm, pixel_mm, plan.settings)
    seen = f"a pixel covers {pixel_mm:.2g} mm" if pixel_mm else "the camera is inside the face"
    rows = []
    for name in [name for name in plan.maps if name not in plan.scene.maps]:
        detail = grown.channels_of(name) is not None or name in wrinkles.IMAGES
        size = sizes.detail if detail else sizes.smooth
        if name in wrinkles.IMAGES:
            size = min(size, LARGEST_WRINKLES)
        rows.append({
            "id": name,
            "size": size,
            "texel_mm": round(span_mm / size, 3),
            "tiles": list(surface.tiles),
            "megabytes": round(len(surface.tiles) * size * size * 16 / 1e6, 1),  # four floats, as Blender holds them
            "because": f"{seen}, a tile {span_mm:.0f} mm" + ("" if detail else f"; at most {plan.settings.map_size} by quality"),
        })
    return rows


def _quality(shot: Shot, quality: Choice) -> dict[str, Any]:
    """The settings and, if exactly these were measured, their error and the core seconds of the shot's pictures."""
    point = quality.point
    report: dict[str, Any] = {
        "preset": point.preset if point else None,
        "because": quality.because,
        **quality.settings.model_dump(),
        "measured": None,
    }
    if point:
        megapixels = shot.image.width * shot.image.height / 1e6
        report["measured"] = {
            "delta_e": point.delta_e,
            "delta_e_median": point.delta_e_median,
            "prepare_seconds": point.prepare_seconds,
            "seconds_per_image": round(point.seconds_per_megapixel * megapixels, 3),
        }
    return report


def _entry_ms(plan: Plan) -> float:
    skins = entry_skins(plan.axes, plan.skin)[:_TIMED_ENTRIES]
    start = time.perf_counter()
    sanguine_core.burley_lobes(skins, "rec709", lobe_count=plan.settings.lobes)
    return (time.perf_counter() - start) * 1000.0 / len(skins)


def _report(plan: Plan, entry_ms: float) -> dict[str, Any]:
    effects = []
    for effect in EFFECTS:
        decision = plan.decisions[effect.id]
        row: dict[str, Any] = {
            "id": effect.id,
            "active": decision.active,
            "because": decision.because,
            "frames": list(decision.frames),
            "costs_ms": 0.0,
        }
        if decision.active:
            entries = plan.entries - plan.without(effect.id).entries
            row["costs_ms"] = round(entries * entry_ms, 3)
            row["maps"] = list(effect.maps(plan.scene))
        effects.append(row)
    return {
        "effects": effects,
        "lut": {
            "axes": [
                {"id": a.id, "low": a.low, "high": a.high, "count": a.count,
                 "spacing": "logarithmic" if a.logarithmic else "linear"}
                for a in plan.axes
            ],
            "entries": plan.entries,
        },
        "shader": {
            "fragments": [fragment.file.removesuffix(".osl") for fragment in plan.fragments],
            "maps": list(plan.maps),
        },
        "skipped": [effect.id for effect in EFFECTS if not plan.decisions[effect.id].active],
    }
