"""The `plan` use-case: what will be simulated for a shot and why, without doing the work."""

from __future__ import annotations

import time
from typing import Any

import sanguine_core

from ..domain.effects import EFFECTS
from ..domain.lut import entry_skins
from ..domain.plan import Plan, make_plan
from ..domain.quality import Choice
from ..domain.shot import Shot, scene_of
from .skin_maps import read_face_maps

_TIMED_ENTRIES = 4


def plan_report(shot: Shot, regions: tuple[str, ...], quality: Choice | None = None) -> dict[str, Any]:
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
    answer = {"sanguine": sanguine_core.__version__, "quality": _quality(shot, quality), **next(iter(reports.values()))}
    if len(reports) > 1:
        answer["subjects"] = reports
    return answer


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
