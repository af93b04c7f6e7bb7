"""Poses of the emotions as assets: actions of one frame, for the pose library."""

from __future__ import annotations

import bpy

from ..domain.facs import VARIANTS
from .controls import CONTROL_BONE, emotions_of, states_of
from .curves import action_curve, ensure_action, set_keys

CATALOG_TAG = "Sanguine"


def add_poses(armature: bpy.types.Object) -> list[bpy.types.Action]:
    """One pose asset for the neutral face and for each variant of each emotion on the rig. Those of that name are kept.

    A pose holds every emotion's slider, the others at 0: applied, it is that face and no mixture with what was before.
    """
    emotions = emotions_of(armature)
    wanted = {"neutral": {}}
    for emotion in emotions:
        for variant, level in VARIANTS.items():
            wanted[emotion if variant == "full" else f"{emotion}, {variant}"] = {emotion: level}
    made = []
    for label, levels in wanted.items():
        name = f"{armature.name}: {label}"
        if name not in bpy.data.actions:
            made.append(_pose(armature, name, {s: levels.get(s, 0.0) for s in (*emotions, *states_of(armature))}))
    return made


def _pose(armature: bpy.types.Object, name: str, values: dict[str, float]) -> bpy.types.Action:
    # The curves are made through the armature itself, whose own action is put back afterwards.
    animation = armature.animation_data or armature.animation_data_create()
    before, slot = animation.action, getattr(animation, "action_slot", None)
    animation.action = None
    try:
        action = ensure_action(armature, name)
        for slider, value in values.items():
            curve = action_curve(armature, f'pose.bones["{CONTROL_BONE}"]["{slider}"]', group=CONTROL_BONE)
            set_keys(curve, [1.0], [value], "CONSTANT")
    finally:
        animation.action = before
        if slot is not None:
            animation.action_slot = slot
    action.name = name
    action.use_fake_user = True
    action.asset_mark()
    action.asset_data.tags.new(CATALOG_TAG)
    action.asset_data.description = "Pose of the Sanguine controls: " + ", ".join(f"{s} {v:g}" for s, v in values.items() if v)
    return action
