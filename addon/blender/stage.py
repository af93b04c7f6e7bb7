"""A portrait studio: camera, three soft lights, a backdrop. The only place that sets film and view transform."""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy
from mathutils import Vector

from ..domain.framing import SENSOR_MM, portrait

BACKDROP_M = 1.3  # behind the head


@dataclass(frozen=True)
class Light:
    """An area light: degrees to the side (+ toward the subject's left) and up, as seen from the head; metres; watts."""

    name: str
    azimuth: float
    elevation: float
    distance: float
    size: float
    power: float
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    mirrored: bool = True  # seen in the eyes and in highlights


# Key from the side and above, so that cheekbone, nose and lips turn in the light; a broad weak fill that leaves
# one catchlight in the eye; rims that part the head from the dark. Neutral white: the skin's colour is its own.
LIGHTS = (
    Light("key", -42, 32, 1.1, 0.45, 19.0),
    Light("fill", 55, 5, 1.4, 1.0, 3.2, mirrored=False),
    Light("rim", 140, 30, 1.2, 0.5, 3.0),
    Light("rim_low", -150, 25, 1.2, 0.5, 2.0),
)


def _aim(obj: bpy.types.Object, target: Vector) -> None:
    obj.rotation_euler = (target - obj.location).to_track_quat("-Z", "Y").to_euler()


def _grey(name: str, value: float) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    if not material.node_tree:
        material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (value, value, value, 1)
    shader.inputs["Roughness"].default_value = 0.9
    shader.inputs["Specular IOR Level"].default_value = 0.0
    return material


def set_stage(
    scene: bpy.types.Scene,
    eyes: tuple[float, float, float],
    chin: tuple[float, float, float],
    crown: tuple[float, float, float],
    size: tuple[int, int] = (512, 640),
    lens_mm: float = 85.0,
    turn_deg: float = 0.0,
    exposure: float = 0.3,
    lights: tuple[Light, ...] = LIGHTS,
    ambient: float = 0.045,
    backdrop: float = 0.16,
) -> bpy.types.Object:
    """Light and frame a head whose landmarks are given (metres); returns the camera.

    size      : pixels; the frame's height holds the head and neck, its width follows
    turn_deg  : the camera walks round the head, + toward the subject's left
    ambient   : radiance of the world, backdrop: its albedo
    """
    framing = portrait(eyes, chin, crown, lens_mm, turn_deg)
    middle, toward, eyes_ = Vector(framing.middle), Vector(framing.toward), Vector(eyes)

    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.film_transparent = False
    try:
        # Colours as they are: a film look would take from skin the very saturation that blood gives it.
        scene.view_settings.view_transform = "Standard"
    except TypeError:
        pass  # a custom OCIO config without it: its own default view shows the picture
    scene.view_settings.exposure = exposure

    camera = bpy.data.objects.new("portrait_camera", bpy.data.cameras.new("portrait_camera"))
    camera.data.sensor_fit, camera.data.sensor_height, camera.data.lens = "VERTICAL", SENSOR_MM, lens_mm
    turn = math.radians(turn_deg)
    camera.location = middle + toward * framing.distance_m
    camera.rotation_euler = (math.pi / 2, 0, turn)
    scene.collection.objects.link(camera)
    scene.camera = camera

    for light in lights:
        data = bpy.data.lights.new(light.name, "AREA")
        data.shape, data.size, data.energy, data.color = "DISK", light.size, light.power, light.color
        obj = bpy.data.objects.new(light.name, data)
        a, e = math.radians(light.azimuth), math.radians(light.elevation)
        obj.visible_glossy = light.mirrored
        direction = Vector((math.sin(a) * math.cos(e), -math.cos(a) * math.cos(e), math.sin(e)))
        obj.location = middle + light.distance * direction
        _aim(obj, Vector((0, eyes_.y, eyes_.z - 0.03)))
        scene.collection.objects.link(obj)

    world = bpy.data.worlds.new("studio")
    if not world.node_tree:
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (ambient, ambient, ambient, 1)
    scene.world = world

    mesh = bpy.data.meshes.new("backdrop")
    mesh.from_pydata([(-3, 0, -2), (3, 0, -2), (3, 0, 2), (-3, 0, 2)], [], [(0, 1, 2, 3)])
    mesh.materials.append(_grey("backdrop", backdrop))
    wall = bpy.data.objects.new("backdrop", mesh)
    wall.location = middle - toward * BACKDROP_M
    wall.rotation_euler = (0, 0, turn)
    scene.collection.objects.link(wall)
    return camera
