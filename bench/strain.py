"""What few components of strain leave out, and what their drivers cost: the tables of docs/strain.md.

Run with the project's environment; prints Markdown. Times are the shortest of several, on one machine.
"""

from __future__ import annotations

import time

import bpy
import numpy as np
from sanguine.app.faces import example_head, head_surface
from sanguine.blender.face import add_face
from sanguine.blender.render import quiet
from sanguine.blender.skin import apply_skin
from sanguine.domain import strain
from sanguine.domain.effects import Frame, Scene
from sanguine.domain.effects.regions import FACE_REGIONS
from sanguine.domain.facs import ACTION_UNITS, EMOTION_CONTROLS
from sanguine.domain.parameters import default_skin
from sanguine.domain.plan import check_strengths, make_plan

COUNTS = (4, 8, 12, 16, 24)


def rms(moving: strain.MovingSurface, values: np.ndarray) -> np.ndarray:
    """(P, W) -> (P,): root mean square over the surface."""
    share = moving.area_mm2 / moving.area_mm2.sum()
    return np.sqrt((values**2 * share).sum(axis=1))


def poses(moving: strain.MovingSurface) -> dict[str, np.ndarray]:
    names = moving.keys.names
    random = np.random.default_rng(7)
    units = [unit for unit in ACTION_UNITS.values() if unit.keys]
    mixes = [
        dict(zip(random.choice(len(units), 4, replace=False), random.uniform(0.2, 1.0, 4), strict=True))
        for _ in range(40)
    ]
    return {
        "emotions": strain.poses(names, [{name: 1.0} for name in EMOTION_CONTROLS]),
        "half emotions": strain.poses(names, [{name: 0.5} for name in EMOTION_CONTROLS]),
        "action units": strain.poses(names, [dict.fromkeys(unit.whole, 1.0) for unit in units]),
        "mixes of four units": strain.poses(
            names, [{control: value for i, value in mix.items() for control in units[i].whole} for mix in mixes]
        ),
        "single keys": np.eye(len(names)),
    }


def linearisation(moving: strain.MovingSurface) -> None:
    print("| emotion | log area, rms | sum of linear strains, error | sum of logarithmic ones, error |\n|---|---|---|---|")
    each = np.eye(len(moving.keys.names))
    for name in EMOTION_CONTROLS:
        pose = strain.poses(moving.keys.names, [{name: 1.0}])
        exact = strain.log_area(moving.pose_strain(pose))
        linear = strain.log_area(moving.pose_strain(pose, "linear"))
        summed = pose @ strain.log_area(moving.pose_strain(each))
        errors = (rms(moving, found - exact)[0] for found in (linear, summed))
        print(f"| {name} | {rms(moving, exact)[0]:.4f} | " + " | ".join(f"{e:.4f}" for e in errors) + " |")


def table(moving: strain.MovingSurface, what: str) -> None:
    asked = poses(moving)
    if what == "blood":
        exact = {k: strain.blood_change(strain.log_area(moving.pose_strain(p))) for k, p in asked.items()}
    else:
        exact = {k: strain.folding(moving, moving.pose_strain(p)) for k, p in asked.items()}
    print("| components | images | " + " | ".join(asked) + " |\n|---|---|" + "---|" * len(asked))
    print("| none | 0 | " + " | ".join(f"{rms(moving, e).mean():.4f}" for e in exact.values()) + " |")
    for count in COUNTS:
        made = (strain.area_components if what == "blood" else strain.fold_components)(moving, count)
        cells = []
        for name, pose in asked.items():
            found = made.at(pose, moving.halves)
            found = strain.blood_change(found) if what == "blood" else found
            error = rms(moving, found - exact[name])
            cells.append(f"{error.mean():.4f} ({error.max():.4f})")
        print(f"| {count} | {count // 4} | " + " | ".join(cells) + " |")


def drivers() -> None:
    print("| on | drivers | ms per frame |\n|---|---|---|")
    for strengths in ({}, {"strain": 1.0}, {"strain": 1.0, "wrinkles": 1.0}):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        with quiet():
            face = add_face("female")
            for obj in bpy.data.objects:  # what is measured is the drivers, not the geometry
                for modifier in obj.modifiers:
                    modifier.show_viewport = False
            plan = make_plan(
                Scene(
                    default_skin(), (Frame("a", {"happy": 1.0}),), check_strengths(strengths, "bench"), FACE_REGIONS
                )
            )
            apply_skin(face.skin, face.rig, plan)
        bone = face.rig.pose.bones["sanguine"]
        for frame, value in ((1, 0.0), (100, 1.0)):
            bone["happy"] = value
            bone.keyframe_insert('["happy"]', frame=frame)
        times = []
        for frame in range(1, 80):
            start = time.perf_counter()
            bpy.context.scene.frame_set(frame)
            times.append(1000.0 * (time.perf_counter() - start))
        count = len(face.skin.animation_data.drivers)
        print(f"| {', '.join(strengths) or 'neither'} | {count} | {np.percentile(times[5:], 10):.2f} |")


def main() -> None:
    face = head_surface(example_head("female"))
    moving = face.moving
    start = time.perf_counter()
    moving.welded_area, moving.welded_folds  # noqa: B018 - computed here
    print(f"{len(moving.keys.names)} keys, {len(moving.area_mm2)} vertices: {time.perf_counter() - start:.1f} s\n")
    linearisation(moving)
    for what in ("blood", "folds"):
        print(f"\n{what}: mean (worst) of the poses\n")
        table(moving, what)
    print()
    drivers()


if __name__ == "__main__":
    main()
