#!/usr/bin/env python3
"""The scenes that `make window` and `make chroots` open, made outside by `bpy` 4.5.

    make_scene.py [--own] OUT.blend

Without --own: the example head with its skin, one slider keyed. With it: a character as its artist has it, before
Sanguine: ARKit keys, a painted colour map, a rig, lights and a camera.
"""

import argparse
from pathlib import Path

import bpy
import numpy as np
import sanguine_core

import sanguine
from sanguine.app.faces import example_head, head_surface
from sanguine.blender.controls import CONTROL_BONE
from sanguine.blender.face import add_face
from sanguine.blender.head import FaceObjects, build_face
from sanguine.blender.stage import set_stage
from sanguine.domain.facs import ARKIT
from sanguine.domain.head import Head, load_presets
from sanguine.domain.resources import rigs_path

KEYS = {1: 0.0, 6: 1.0, 24: 1.0, 30: 0.0}  # frame -> anger

NAME = "vera"
PICTURE = 1024
RENDER, SAMPLES = (320, 400), 32
# What a painter puts where, sRGB; by eye. Between the regions it is the first of them.
PAINT = {"skin": (0.83, 0.65, 0.55), "cheeks": (0.85, 0.60, 0.52), "nose": (0.83, 0.59, 0.51), "ears": (0.84, 0.58, 0.51), "lips": (0.74, 0.47, 0.45)}  # fmt: skip
BLOTCHES = ((6.0, 0.012), (48.0, 0.010))  # blotches across the picture, and how far they go, sRGB


def empty_scene() -> bpy.types.Scene:
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    for obj in list(bpy.data.objects):
        if obj.type == "MESH":  # the cube
            bpy.data.objects.remove(obj)
    bpy.context.scene.render.engine = "CYCLES"
    return bpy.context.scene


def save(target: str, face: bpy.types.Object) -> None:
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    face.select_set(True)
    bpy.context.view_layer.objects.active = face
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(target).resolve()), compress=True)


def with_skin(target: str) -> None:
    sanguine.register()
    scene = empty_scene()
    face = add_face("female")
    bpy.context.view_layer.objects.active = face.skin
    face.skin.select_set(True)
    face.skin.sanguine.quality = "draft"
    face.skin.sanguine.shading = "OSL"  # which the Blender of the window has not
    assert bpy.ops.sanguine.apply_skin() == {"FINISHED"}
    face.skin.sanguine.property_unset("shading")
    bone = face.rig.pose.bones["sanguine"]
    for frame, value in KEYS.items():
        bone["anger"] = value
        bone.keyframe_insert('["anger"]', frame=frame)
    scene.frame_start, scene.frame_end = 1, 60
    scene.frame_set(1)
    save(target, face.skin)
    sanguine.unregister()  # left registered, its classes crash `bpy` on the way out


def painted(head: Head) -> bpy.types.Image:
    """A colour map as somebody paints one, in the UVs of the head's skin."""
    surface = head_surface(head)
    colours = np.tile(np.float32(PAINT["skin"]), (len(surface.position_mm), 1))
    for region, colour in PAINT.items():
        if region != "skin":
            colours += surface.regions[region][:, None] * (np.float32(colour) - np.float32(PAINT["skin"]))
    background = np.float32(PAINT["skin"])
    size = PICTURE
    rgb = sanguine_core.rasterize_uv(
        surface.uv, surface.triangles, colours[surface.corner_vertex], size, size, 16, background
    )  # fmt: skip
    random, waves = np.random.default_rng(1), np.hypot(*np.meshgrid(np.fft.fftfreq(size, 1 / size), np.fft.fftfreq(size, 1 / size)))
    for blotches, strength in BLOTCHES:
        field = np.fft.ifft2(np.fft.fft2(random.normal(size=(size, size))) * np.exp(-((waves / blotches) ** 2))).real
        rgb = rgb + (strength * field / field.std())[..., None] * np.float32([0.4, 1.0, 1.0])  # redness more than shade
    image = bpy.data.images.new(f"{NAME}_albedo", size, size)
    rgba = np.concatenate([np.clip(rgb, 0, 1), np.ones((size, size, 1))], axis=-1)
    image.pixels.foreach_set(rgba.astype(np.float32).ravel())
    image.pack()
    return image


def without_controls(objects: FaceObjects) -> None:
    """Nothing on the character is Sanguine's: no bone for sliders, no key beyond ARKit's, names of its own."""
    rig = objects.rig
    shape = rig.pose.bones[CONTROL_BONE].custom_shape
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    rig.data.edit_bones.remove(rig.data.edit_bones[CONTROL_BONE])
    bpy.ops.object.mode_set(mode="OBJECT")
    outline = shape.data
    bpy.data.objects.remove(shape)
    bpy.data.meshes.remove(outline)
    for part, obj in [*objects.parts.items(), ("hair", objects.hair), ("rig", rig)]:
        obj.name = obj.data.name = f"{NAME}_{'face' if part == 'skin' else part}"
        for key in list(obj.data.shape_keys.key_blocks[1:]) if obj.type == "MESH" and obj.data.shape_keys else []:
            if key.name not in ARKIT.keys:
                obj.shape_key_remove(key)
    objects.collection.name = NAME


def own_character(target: str) -> None:
    scene = empty_scene()
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)  # lights and camera are the stage's
    head = example_head("female")
    material = bpy.data.materials.new(f"{NAME}_skin")
    material.use_nodes = True
    tree = material.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = painted(head)
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Roughness"].default_value = 0.5
    tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    objects = build_face(head, load_presets(rigs_path("heads.toml"))["female"], material)
    without_controls(objects)
    set_stage(scene, *(tuple(map(float, head.landmarks[name])) for name in ("eyes", "chin", "crown")), RENDER)
    scene.cycles.samples = SAMPLES
    scene.cycles.use_denoising = False  # Debian's Blender is built without the denoiser and then renders nothing
    for screen in bpy.data.screens:
        for area in screen.areas:
            if area.type == "VIEW_3D":
                area.spaces[0].region_3d.view_perspective = "CAMERA"
    save(target, objects.skin)
    left = [block.name for kind in ("objects", "materials", "texts", "images", "node_groups") for block in getattr(bpy.data, kind)]
    assert not any("sanguine" in name.lower() for name in left), left


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--own", action="store_true", help="a character that has nothing of Sanguine's")
    parser.add_argument("target")
    options = parser.parse_args()
    (own_character if options.own else with_skin)(options.target)
