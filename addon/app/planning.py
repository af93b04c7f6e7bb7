"""The `plan` use-case: what will be simulated for a shot and why, without doing the work."""

from __future__ import annotations

from typing import Any, Protocol

import sanguine_core

from ..domain.effects import EFFECTS
from ..domain.framing import Framing, portrait
from ..domain.plan import Plan, make_plan
from ..domain.quality import Choice
from ..domain.shading import Renderer, choose
from ..domain.shot import Shot, Subject, scene_of
from ..domain.texel_density import map_sizes, mm_per_uv
from .costs import effect_costs, map_costs
from .faces import example_head, head_surface
from .maps import Surface
from .skin_maps import read_face_maps


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
    shot: Shot,
    regions: tuple[str, ...],
    quality: Choice | None = None,
    face_of: FaceOf | None = None,
    renderer: Renderer = Renderer(),
) -> dict[str, Any]:
    """The answer of `sanguine plan`: one plan per subject, the first one's at the top level too. renderer: what will render.

    `costs_ms` is what an effect adds to the preparation of this shot on this machine: the table entries that
    would not be there without it, at the time that an entry takes.
    """
    quality = quality or shot.chosen_quality
    plans = {
        subject.id: make_plan(scene_of(shot, subject, regions, read_face_maps(subject.maps).ranges), quality.settings)
        for subject in shot.subjects
    }
    reports = {name: _report(plan) for name, plan in plans.items()}
    for subject in shot.subjects if face_of else ():
        reports[subject.id]["maps"] = _maps(plans[subject.id], shot, *face_of(subject))
    material = choose(shot.image.material.upper(), renderer)
    answer = {
        "sanguine": sanguine_core.__version__,
        "quality": _quality(shot, quality),
        "material": {"shading": material.shading.lower(), "because": material.because},
        **next(iter(reports.values())),
    }
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
    for name, cost in map_costs(plan, sizes, len(surface.tiles)).items():
        bound = "" if cost.detail else f"; at most {plan.settings.map_size} by quality"
        rows.append({
            "id": name,
            "size": cost.size,
            "texel_mm": round(span_mm / cost.size, 3),
            "tiles": list(surface.tiles),
            "megabytes": round(cost.megabytes, 1),
            "because": f"{seen}, a tile {span_mm:.0f} mm{bound}",
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


def _report(plan: Plan) -> dict[str, Any]:
    effects, costs = [], effect_costs(plan, {})
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
            row["costs_ms"] = round(costs[effect.id].milliseconds, 3)
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
