"""What one frame costs in the viewport: our rig beside the same meshes with plain keyed shape keys, the table of
docs/emotion_in_time.md.

    python bench/scrubbing.py [--rounds 6] [--page docs/emotion_in_time.md]

Every rig is a file of its own; a round opens each in turn and plays the same performance, so that a busy machine
disturbs all alike. Told is the median over the frames of the least of the rounds.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np
from sanguine.blender.bake import bake_blood
from sanguine.blender.controls import CONTROL_BONE, remove_head_drivers, remove_shape_key_drivers
from sanguine.blender.curves import action_curve, ensure_action, set_keys
from sanguine.blender.face import Face, add_face
from sanguine.blender.render import quiet
from sanguine.blender.skin import apply_skin
from sanguine.blender.strain import remove_components
from sanguine.domain.blood import STATES
from sanguine.domain.effects import Frame, Scene
from sanguine.domain.effects.regions import FACE_REGIONS
from sanguine.domain.facs import DEFAULT_EMOTIONS, EMOTION_CONTROLS
from sanguine.domain.parameters import default_skin
from sanguine.domain.plan import Plan, check_strengths, make_plan

# What plays: (frame, sliders); on every rig that is compared.
PERFORMANCE = ((1, {}), (12, {"anger": 1.0}), (30, {"anger": 1.0}), (40, {"fear": 1.0}), (60, {"fear": 1.0}),
               (75, {"sad": 1.0}), (90, {"sad": 1.0}), (100, {}))
FRAMES = range(1, 101)
# The bar of the whole page: what our rig may cost beyond plain shape keys.
BAR_MS = 2.0
HEAD = "female"
EMOTION, STATE = "disgust", "blush"
# Twenty milliseconds of subdivision, alike on every rig, tell little: of these only.
SUBDIVIDED = ("plain", "default", "shape")


@dataclass
class Rig:
    """One file, what is counted in it, and the times of its frames by subdivision."""

    label: str
    path: Path
    counts: dict[str, int]
    times_ms: dict[bool, list[list[float]]] = field(default_factory=lambda: {False: [], True: []})

    def ms(self, subdivided: bool) -> float:
        return float(np.median(np.min(self.times_ms[subdivided], axis=0)))


def build(
    emotions: Iterable[str] = DEFAULT_EMOTIONS,
    states: Iterable[str] = (),
    skin: bool = True,
    strengths: dict[str, float] | None = None,
    held: dict[str, float] | None = None,
) -> tuple[Face, Plan | None]:
    """The head with its sliders keyed. held: sliders that stand at a value all the time."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    emotions, states = tuple(emotions), tuple(states)
    face, plan = add_face(HEAD, emotions, states), None
    if skin:
        shown = {**dict.fromkeys(emotions, 1.0), **dict.fromkeys(states, 1.0)}
        frames = (Frame("rest"), *(Frame(name, {name: value}) for name, value in shown.items()))
        plan = make_plan(Scene(default_skin(), frames, check_strengths(strengths or {}, "bench"), FACE_REGIONS))
        apply_skin(face.skin, face.rig, plan)
    ensure_action(face.rig, "performance")
    frames = [frame for frame, _ in PERFORMANCE]
    for name in dict.fromkeys(name for _, pose in PERFORMANCE for name in pose):
        set_keys(_curve(face, name), frames, [pose.get(name, 0.0) for _, pose in PERFORMANCE])
    for name, value in (held or {}).items():
        set_keys(_curve(face, name), frames, [value] * len(frames))
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = FRAMES[0], FRAMES[-1]
    return face, plan


def _curve(face: Face, name: str) -> bpy.types.FCurve:
    return action_curve(face.rig, f'pose.bones["{CONTROL_BONE}"]["{name}"]', group="Sanguine")


def make_plain(face: Face) -> None:
    """Leaves the meshes with ordinary keys, on every frame, on the shape keys (and the head bone) that move: the same
    motion, without sliders, drivers or blood."""
    scene, graph = bpy.context.scene, bpy.context.view_layer.depsgraph
    meshes = [obj for obj in bpy.data.objects if obj.type == "MESH" and obj.data.shape_keys]
    values = {(mesh, key.name): [] for mesh in meshes for key in mesh.data.shape_keys.key_blocks}
    head = {(path, i): [] for path in ("rotation_euler", "location") for i in range(3)}
    for frame in FRAMES:
        scene.frame_set(frame)
        for mesh in meshes:
            for key in mesh.evaluated_get(graph).data.shape_keys.key_blocks:
                values[mesh, key.name].append(key.value)
        bone = face.rig.evaluated_get(graph).pose.bones["head"]
        for (path, i), series in head.items():
            series.append(getattr(bone, path)[i])
    remove_components(face.skin)
    remove_shape_key_drivers(face.rig, meshes)
    remove_head_drivers(face.rig)
    for owner in (face.rig, face.skin):
        owner.animation_data_clear()
        for name in list(owner.keys()):
            del owner[name]
    del face.rig.pose.bones[CONTROL_BONE]["anger"]
    for mesh in meshes:
        keys = mesh.data.shape_keys
        moving = [name for (of, name), series in values.items() if of == mesh and np.ptp(series) > 0.0]
        if moving:
            ensure_action(keys, f"{mesh.name} keys")
        for name in moving:
            set_keys(action_curve(keys, f'key_blocks["{name}"].value'), list(FRAMES), values[mesh, name])
    if any(np.ptp(series) > 0.0 for series in head.values()):
        ensure_action(face.rig, "head")
    for (path, i), series in head.items():
        if np.ptp(series) > 0.0:
            set_keys(action_curve(face.rig, f'pose.bones["head"].{path}', i), list(FRAMES), series)


def counts(face: Face, plan: Plan | None) -> dict[str, int]:
    drivers = [
        curve
        for owner in (*bpy.data.objects, *bpy.data.shape_keys)
        if owner.animation_data
        for curve in owner.animation_data.drivers
        if not curve.mute
    ]
    bone = face.rig.pose.bones[CONTROL_BONE]
    return {
        "sliders": len(bone.keys()),
        "drivers": len(drivers),
        "variables": sum(len(curve.driver.variables) for curve in drivers),
        "properties": sum(name.startswith("blood_") for name in face.skin.keys()),
        "maps": len(plan.maps) if plan else 0,
        "fragments": len(plan.fragments) if plan else 0,
        "entries": plan.entries if plan else 0,
    }


def play(rig: Rig, subdivided: bool) -> None:
    """One round: the file opened, and its frames played twice, the second time with a watch."""
    bpy.ops.wm.open_mainfile(filepath=str(rig.path))
    # As without a graphics card: the processor subdivides, and does so when the mesh is drawn, here when it is asked for.
    bpy.context.preferences.system.use_gpu_subdivision = False
    for obj in bpy.data.objects:
        for modifier in obj.modifiers:
            if modifier.type == "SUBSURF":
                modifier.show_viewport = subdivided
    scene, graph = bpy.context.scene, bpy.context.view_layer.depsgraph
    meshes = [obj for obj in bpy.data.objects if obj.type == "MESH" and obj.data.shape_keys]
    for frame in FRAMES:
        scene.frame_set(frame)
    times = []
    for frame in FRAMES:
        start = time.perf_counter()
        scene.frame_set(frame)
        for mesh in meshes:
            len(mesh.evaluated_get(graph).data.vertices)
        times.append(1000.0 * (time.perf_counter() - start))
    rig.times_ms[subdivided].append(times)


def rigs(folder: Path) -> dict[str, Rig]:
    """Every rig of the page, saved."""

    def saved(
        name: str, label: str, made: tuple[Face, Plan | None], change: Callable[[Face], object] | None = None
    ) -> Rig:
        face, plan = made
        if change:
            change(face)
        path = folder / f"{name}.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
        print(name, file=sys.stderr, flush=True)
        return Rig(label, path, counts(face, plan))

    def bake(face: Face) -> None:
        bake_blood(face.skin, face.rig, bpy.context.scene)

    shape = {"strain": 1.0, "wrinkles": 1.0}
    some = (*DEFAULT_EMOTIONS, EMOTION)
    made = {}
    for name, label, arguments, change in (
        ("plain", "plain keyed shape keys, the same motion", {"skin": False}, make_plain),
        ("muscles", "our rig, the four default emotions, no skin applied", {"skin": False}, None),
        ("default", "the same with the skin: muscles and blood", {}, None),
        ("baked", "the same, blood baked", {}, bake),
        ("shape", "muscles, blood, and strain and wrinkles, which follow the keys", {"strengths": shape}, None),
        ("all", "all emotions and all states", {"emotions": EMOTION_CONTROLS, "states": STATES}, None),
        ("all_baked", "all emotions and all states, blood baked", {"emotions": EMOTION_CONTROLS, "states": STATES}, bake),
        ("emotion_0", f"default and {EMOTION} at 0", {"emotions": some}, None),
        ("emotion_1", f"default and {EMOTION} at 1", {"emotions": some, "held": {EMOTION: 1.0}}, None),
        ("emotion_plain", f"plain keyed shape keys, with {EMOTION} at 1",
         {"emotions": some, "held": {EMOTION: 1.0}, "skin": False}, make_plain),
        ("state_0", f"default and {STATE} at 0", {"states": (STATE,)}, None),
        ("state_1", f"default and {STATE} at 1", {"states": (STATE,), "held": {STATE: 1.0}}, None),
    ):
        with quiet():
            made[name] = saved(name, label, build(**arguments), change)
    return made


def tables(made: dict[str, Rig], rounds: int) -> list[str]:
    plain = made["plain"]
    lines = [
        "| rig | ms per frame | beyond plain | subdivided: ms | beyond plain | drivers | their variables | blood properties |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in ("plain", "muscles", "default", "baked", "shape", "all", "all_baked"):
        rig = made[name]
        cells = [rig.label]
        for subdivided in (False, True):
            if not rig.times_ms[subdivided]:
                cells += ["", ""]
                continue
            ms = rig.ms(subdivided)
            cells += [f"{ms:.2f}", f"{ms - plain.ms(subdivided):+.2f}" if rig is not plain else ""]
        cells += [str(rig.counts[key]) for key in ("drivers", "variables", "properties")]
        lines.append("| " + " | ".join(cells) + " |")
    lines += [
        "",
        "| one more on the rig | ms per frame | more than without it | drivers | variables | blood properties | maps | "
        "fragments | table entries |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name in ("default", "emotion_0", "emotion_1", "state_0", "state_1"):
        rig, base = made[name], made["default"]
        more = f"{rig.ms(False) - base.ms(False):+.2f}" if rig is not base else ""
        numbers = [str(rig.counts[key]) for key in ("drivers", "variables", "properties", "maps", "fragments", "entries")]
        lines.append("| " + " | ".join([rig.label, f"{rig.ms(False):.2f}", more, *numbers]) + " |")
    geometry = made["emotion_plain"].ms(False) - plain.ms(False)
    lines += [
        "",
        f"Of what {EMOTION} at 1 costs, {geometry:.2f} ms is the geometry of the keys that it moves: plain keys pay that too. "
        f"Head `{HEAD}`, {len(FRAMES)} frames, {rounds} rounds, Blender {bpy.app.version_string}.",
    ]
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=6)
    parser.add_argument("--page", type=Path, default=Path("docs/emotion_in_time.md"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        made = rigs(Path(scratch))
        for _ in range(options.rounds):
            for subdivided in (False, True):
                for name, rig in made.items():
                    if name in SUBDIVIDED or not subdivided:
                        with quiet():
                            play(rig, subdivided)
    lines = tables(made, options.rounds)
    print("\n".join(lines))
    if options.page.exists():
        head, rest = options.page.read_text(encoding="utf-8").split("<!-- scrubbing -->")
        tail = rest.split("<!-- /scrubbing -->")[1]
        text = f"{head}<!-- scrubbing -->\n" + "\n".join(lines) + f"\n<!-- /scrubbing -->{tail}"
        options.page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
