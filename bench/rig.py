"""What a rig costs while an animator scrubs: evaluating a frame of the example head beside the same keys, keyed plainly.

    .venv/bin/python bench/rig.py [HEAD]

Milliseconds per frame, the least of several medians (other work on the machine only adds), subdivision and rendering
left out: the meshes with their keys, and whatever drives them. The skin has no material and no blood.
"""

from __future__ import annotations

import statistics
import sys
import time

import bpy

from sanguine.blender.controls import AT_REST, CONTROL_BONE, add_controls, emotions_of, remove_emotion, set_controls
from sanguine.blender.face import add_face
from sanguine.domain.facs import DEFAULT_EMOTIONS, EMOTION_CONTROLS, UNIT_CONTROLS

FRAMES = 50
REPEATS = 7


def key_sliders(rig: bpy.types.Object, values: dict[str, float]) -> None:
    """Sliders that swell and fade over the frames; all others rest, without keys."""
    bone = rig.pose.bones[CONTROL_BONE]
    if rig.animation_data and rig.animation_data.action:
        bpy.data.actions.remove(rig.animation_data.action)
    set_controls(rig, AT_REST)
    for name, value in values.items():
        for frame, share in ((1, 0.5), (FRAMES // 2, 1.0), (FRAMES, 0.5)):
            bone[name] = value * share
            bone.keyframe_insert(f'["{name}"]', frame=frame)


def milliseconds() -> float:
    scene = bpy.context.scene
    medians = []
    for _ in range(REPEATS):
        times = []
        for frame in range(1, FRAMES + 1):
            start = time.perf_counter()
            scene.frame_set(frame)
            times.append((time.perf_counter() - start) * 1e3)
        medians.append(statistics.median(times))
    return min(medians)


Poses = dict[tuple[str, str], list[float]]
KEYED = (1, FRAMES // 2, FRAMES)


def owners() -> list[bpy.types.Key]:
    return [obj.data.shape_keys for obj in bpy.context.scene.objects if getattr(obj.data, "shape_keys", None)]


def record() -> Poses:
    """What the drivers give every shape key in the keyed frames."""
    seen: Poses = {}
    for frame in KEYED:
        bpy.context.scene.frame_set(frame)
        for keys in owners():
            for block in keys.key_blocks[1:]:
                seen.setdefault((keys.name, block.name), []).append(block.value)
    return seen


def key_plainly(rig: bpy.types.Object, poses: Poses) -> None:
    """No driver and no slider: keyframes of the shape keys that move."""
    rig.animation_data_clear()
    for keys in owners():
        keys.animation_data_clear()
        for block in keys.key_blocks[1:]:
            block.value = 0.0
            if any(poses[keys.name, block.name]):
                for frame, value in zip(KEYED, poses[keys.name, block.name], strict=True):
                    block.value = value
                    block.keyframe_insert("value", frame=frame)


def main() -> None:
    head = sys.argv[1] if len(sys.argv) > 1 else "female"
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    face = add_face(head)
    for obj in bpy.context.scene.objects:
        for modifier in obj.modifiers:
            if modifier.type == "SUBSURF":
                modifier.show_viewport = False
    rig = face.rig
    rows: list[tuple[float, str]] = []
    recorded: dict[str, Poses] = {}

    def measure(what: str, values: dict[str, float], as_: str) -> None:
        key_sliders(rig, values)
        recorded[as_] = record()
        rows.append((milliseconds(), what))

    smile, anger = {"AU12": 1.0}, {"anger": 1.0}
    every_emotion = dict.fromkeys(EMOTION_CONTROLS, 0.5)
    everything = {name: 0.3 for name in (*EMOTION_CONTROLS, *UNIT_CONTROLS)}
    milliseconds()  # the first frames of a scene are slower
    for name in DEFAULT_EMOTIONS:
        remove_emotion(rig, name)
    measure("no emotion on the rig; AU12 moves", smile, "AU12")
    add_controls(rig, ["anger"])
    measure("anger on the rig, at 0; AU12 moves", smile, "AU12")
    measure("anger on the rig; it moves to 1", anger, "anger")
    add_controls(rig, DEFAULT_EMOTIONS)
    measure("four emotions (the default); anger moves to 1", anger, "anger")
    add_controls(rig, EMOTION_CONTROLS)
    assert emotions_of(rig) == EMOTION_CONTROLS
    measure("ten emotions; anger moves to 1", anger, "anger")
    measure("ten emotions; all of them move", every_emotion, "ten emotions")
    measure(f"ten emotions; all {len(everything)} sliders move", everything, "all")
    for name, poses in recorded.items():
        key_plainly(rig, poses)
        rows.append((milliseconds(), f"plain keyed shape keys: {name}"))
    for spent, what in rows:
        print(f"{spent:6.2f} ms  {what}")


if __name__ == "__main__":
    main()
