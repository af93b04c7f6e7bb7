"""A small scene to measure a material in: linear pixels of a flat patch under light that is known."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import bpy
import numpy as np
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
from sanguine.blender.render import quiet, save_render
from sanguine.domain.parameters import PARAMETERS, Skin


def empty_scene(width: int, height: int, samples: int) -> bpy.types.Scene:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.shading_system = True
    scene.cycles.samples = samples
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 64
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    return scene


def white_world(scene: bpy.types.Scene) -> None:
    world = bpy.data.worlds.new("white")
    scene.world = world
    if not world.node_tree:
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)


def plane(material: bpy.types.Material, half_mm: float = 100.0) -> bpy.types.Object:
    half = half_mm / 1000.0
    mesh = bpy.data.meshes.new("patch")
    mesh.from_pydata([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [], [(0, 1, 2, 3)])
    patch = bpy.data.objects.new("patch", mesh)
    bpy.context.scene.collection.objects.link(patch)
    mesh.materials.append(material)
    return patch


def set_sliders(material: bpy.types.Material, skin: Skin) -> None:
    """Move the sliders of a live skin material as an artist would: one table serves every skin."""
    (group,) = (node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup")
    for key, value in skin.items():
        if PARAMETERS[key].label in group.inputs:
            group.inputs[PARAMETERS[key].label].default_value = value


def camera_above(width_mm: float, tilt: float = 0.0) -> None:
    """An orthographic camera that sees `width_mm` across, tilted from straight down by `tilt` radians."""
    data = bpy.data.cameras.new("camera")
    data.type = "ORTHO"
    data.ortho_scale = width_mm / 1000.0
    camera = bpy.data.objects.new("camera", data)
    camera.location = (0.5 * math.sin(tilt), 0.0, 0.5 * math.cos(tilt))
    camera.rotation_euler = (0.0, tilt, 0.0)
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera


def render_linear() -> np.ndarray:
    """(H, W, 3) linear pixels of the scene, row 0 lowest."""
    scene = bpy.context.scene
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "pixels.exr"
        with quiet():
            bpy.ops.render.render()
        save_render(scene, path, "OPEN_EXR")
        return read_linear(path)


def read_linear(path: Path) -> np.ndarray:
    image = bpy.data.images.load(str(path))
    try:
        width, height = image.size
        pixels = np.empty(width * height * 4, dtype=np.float32)
        image.pixels.foreach_get(pixels)
    finally:
        bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)[..., :3].astype(np.float64)


def pixel_of(place: tuple[float, float, float]) -> tuple[int, int]:
    """(x, y) of the pixel of `render_linear` in which the scene's camera sees a place."""
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    at = world_to_camera_view(scene, scene.camera, Vector(place))
    return int(at.x * scene.render.resolution_x), int(at.y * scene.render.resolution_y)


def render_only(*seen: bpy.types.Object) -> None:
    """Leave every other mesh and hair out of the picture: what would only shade the place that is measured."""
    for thing in bpy.data.objects:
        if thing.type in {"MESH", "CURVES"}:
            thing.hide_render = thing not in seen


def render_around(places: list[tuple[float, float, float]], margin: int) -> None:
    """Render only the pixels within `margin` of the box around some places; the others stay black."""
    render = bpy.context.scene.render
    at = np.array([pixel_of(place) for place in places])
    size = np.array([render.resolution_x, render.resolution_y])
    low, high = (at.min(0) - margin) / size, (at.max(0) + margin + 1) / size
    assert np.all(low >= 0.0) and np.all(high <= 1.0), "a place is out of the picture"
    render.use_border, render.use_crop_to_border = True, False
    render.border_min_x, render.border_min_y = low.tolist()
    render.border_max_x, render.border_max_y = high.tolist()


def mean_around(pixels: np.ndarray, place: tuple[float, float, float], half: int) -> np.ndarray:
    """Mean colour of the square of 2 half + 1 pixels around a place."""
    x, y = pixel_of(place)
    return pixels[y - half : y + half + 1, x - half : x + half + 1].mean((0, 1))
