#!/usr/bin/env python3
"""The scene that `make window` opens: the example head with its skin, one slider keyed.

    make_scene.py OUT.blend

Runs where the skin can be made: in an environment with `bpy` and the head's data, which Debian's Blender has not.
"""

import sys
from pathlib import Path

import bpy

import sanguine
from sanguine.blender.face import add_face

KEYS = {1: 0.0, 6: 1.0, 24: 1.0, 30: 0.0}  # frame -> anger


def main(target: str) -> None:
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    sanguine.register()
    for obj in list(bpy.data.objects):
        if obj.type == "MESH":  # the cube
            bpy.data.objects.remove(obj)
    face = add_face("female")
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    bpy.context.view_layer.objects.active = face.skin
    face.skin.select_set(True)
    face.skin.sanguine.quality = "draft"
    assert bpy.ops.sanguine.apply_skin() == {"FINISHED"}
    bone = face.rig.pose.bones["sanguine"]
    for frame, value in KEYS.items():
        bone["anger"] = value
        bone.keyframe_insert('["anger"]', frame=frame)
    scene.frame_start, scene.frame_end = 1, 60
    scene.frame_set(1)
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(target).resolve()), compress=True)
    sanguine.unregister()  # left registered, its classes crash `bpy` on the way out


if __name__ == "__main__":
    main(sys.argv[1])
