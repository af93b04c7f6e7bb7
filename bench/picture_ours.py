"""Our half of the picture benchmark: the scenes in Cycles, with Sanguine's material and with its alternatives."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import sanguine_core
from picture_scenes import (
    LAMP_GAP_MM, SCENES, SHEET_MM, SKINS, SOFTBOX_ANGLE_RAD, SOFTBOX_DISTANCE_MM, SOFTBOX_HALF_MM, SPHERE_RADIUS_MM,
)
from sanguine.blender.material import build_skin_material
from sanguine.domain.blood import ANATOMY
from sanguine.domain.effects import Frame, Scene, anatomy
from sanguine.domain.effects.regions import FACE_REGIONS
from sanguine.domain.parameters import Skin, skin_rows
from sanguine.domain.plan import Plan, check_strengths, make_plan
from sanguine.domain.quality import Settings
from sanguine.domain.shading import NODES

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from support.patch import empty_scene, render_linear, white_world  # noqa: E402

_WIDE_MM = 100.0
# The patch with chromophore maps: millimetres along a side, and texels per mm of a map of 1024 on the example head.
MAPPED_MM, _TEXELS_PER_MM_AT_1024 = 51.2, 1.25
MAPPED_PIXELS = 32
Material = Callable[[], bpy.types.Material]


@dataclass(frozen=True)
class Shot:
    """One picture of a scene: pixels (H, W, 3) in linear Rec.709, row 0 lowest; core_seconds of processor time."""

    pixels: np.ndarray
    core_seconds: float


# ---------------------------------------------------------------- materials


def skin_material(skin: Skin, lobes: int) -> bpy.types.Material:
    """Sanguine's material of a skin without effects."""
    settings = Settings(lobes=lobes, table_step=1.0, map_size=1024, samples=1)
    return build_skin_material("skin", make_plan(Scene(skin, (Frame("0"),)), settings), {}, shading=NODES)


def mapped_plan(skin: Skin, settings: Settings) -> Plan:
    """The plan of a face with anatomy that goes through anger and fear: a table with three axes."""
    frames = (Frame("anger", {"anger": 1.0}), Frame("fear", {"fear": 1.0}))
    strengths = check_strengths({"anatomy": 1.0, "relief": 0.0}, "bench")
    return make_plan(Scene(skin, frames, strengths, FACE_REGIONS), settings)


def mapped_factors(x_mm: np.ndarray, y_mm: np.ndarray) -> np.ndarray:
    """(..., 4) anatomy at places of the mapped patch: hemoglobin, melanin, oil factors and the shift of oxygenation.

    A slow gradient from neck to nose, a lip with a border of 3 mm, and spots of pigment 3 mm wide.
    """
    def step(low, high, value):
        t = np.clip((value - low) / (high - low), 0.0, 1.0)
        return t * t * (3.0 - 2.0 * t)

    x_mm, y_mm = np.broadcast_arrays(x_mm, y_mm)
    u, v = x_mm / MAPPED_MM + 0.5, y_mm / MAPPED_MM + 0.5
    lips, neck, nose = ANATOMY["lips"], ANATOMY["neck"], ANATOMY["nose"]
    hemoglobin = neck.hemoglobin + (nose.hemoglobin - neck.hemoglobin) * u
    melanin = 1.0 + (nose.melanin - 1.0) * v
    for k in range(12):  # spots on a spiral: none lies on the grid of the texels
        cx, cy = 21.0 * math.sqrt((k + 0.5) / 12) * np.array([math.cos(2.4 * k), math.sin(2.4 * k)])
        melanin = melanin - 0.3 * np.exp(-((x_mm - cx) ** 2 + (y_mm - cy) ** 2) / (2 * 1.3**2))
    inside = 1.0 - step(-1.5, 1.5, np.hypot(x_mm / 1.6, y_mm) - 6.0)
    mix = lambda a, b: a + (b - a) * inside  # noqa: E731
    return np.stack([mix(hemoglobin, lips.hemoglobin), mix(melanin, lips.melanin), np.ones_like(u),
                     lips.oxygenation * inside], -1)


def mapped_material(skin: Skin, settings: Settings) -> bpy.types.Material:
    plan = mapped_plan(skin, settings)
    texels = round(MAPPED_MM * _TEXELS_PER_MM_AT_1024 * settings.map_size / 1024)
    at = ((np.arange(texels) + 0.5) / texels - 0.5) * MAPPED_MM
    maps = {name: np.zeros((4, 4, 3), dtype=np.float32) for name in plan.maps}  # blood stays at rest
    maps[anatomy.MAP] = mapped_factors(at[None, :], at[:, None]).astype(np.float32)
    return build_skin_material("mapped", plan, maps, shading=NODES)


def mapped_truth_xyz(skin: Skin, fine: int = 3) -> np.ndarray:
    """(H, W, 3) XYZ of the mapped patch under a white sky, each of `fine`^2 points of a pixel solved for itself."""
    n = MAPPED_PIXELS * fine
    at = ((np.arange(n) + 0.5) / n - 0.5) * MAPPED_MM
    factors = mapped_factors(at[None, :], at[:, None]).reshape(-1, 4)
    rows = np.repeat(skin_rows([skin]), len(factors), axis=0)
    columns = {name: k for k, name in enumerate(skin)}
    rows[:, columns["hemoglobin"]] *= factors[:, 0]
    rows[:, columns["melanin"]] *= factors[:, 1]
    rows[:, columns["oxygenation"]] += factors[:, 3]
    nm = np.arange(380.0, 781.0, 10.0)
    xyz = sanguine_core.xyz(sanguine_core.reflectance(rows, nm, 1), nm) / 100.0
    return xyz.reshape(MAPPED_PIXELS, fine, MAPPED_PIXELS, fine, 3).mean(axis=(1, 3))


def _nodes(name: str) -> tuple[bpy.types.Material, bpy.types.NodeTree, bpy.types.Node]:
    material = bpy.data.materials.new(name)
    if not material.node_tree:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    return material, tree, tree.nodes.new("ShaderNodeOutputMaterial")


def random_walk(rgb: np.ndarray, radius_mm: np.ndarray) -> bpy.types.Material:
    material, tree, output = _nodes("random walk")
    node = tree.nodes.new("ShaderNodeSubsurfaceScattering")
    node.falloff = "RANDOM_WALK"
    node.inputs["Color"].default_value = (*np.clip(rgb, 0.0, 1.0), 1.0)
    node.inputs["Scale"].default_value = 1.0  # the scene's unit is a millimetre
    node.inputs["Radius"].default_value = radius_mm
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def principled(rgb: np.ndarray) -> bpy.types.Material:
    """What is set up in a minute: the skin's colour, radii in the usual proportions, 2 mm; no reflection."""
    material, tree, output = _nodes("principled")
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    node.subsurface_method = "RANDOM_WALK"
    for socket, value in {
        "Base Color": (*np.clip(rgb, 0.0, 1.0), 1.0), "Subsurface Weight": 1.0, "Subsurface Radius": (1.0, 0.36, 0.18),
        "Subsurface Scale": 2.0, "Specular IOR Level": 0.0,
    }.items():
        node.inputs[socket].default_value = value
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


# ---------------------------------------------------------------- scenes


def _object(name: str, vertices, faces, material: bpy.types.Material) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    mesh.materials.append(material)
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def _lamp(corners, sampled: bool) -> None:
    """A square that shines with radiance 1 and that the camera does not see.

    sampled: aim rays at it. One that touches the skin is found better by the light that leaves the skin.
    """
    material, tree, output = _nodes("lamp")
    tree.links.new(tree.nodes.new("ShaderNodeEmission").outputs[0], output.inputs["Surface"])
    material.cycles.emission_sampling = "FRONT_BACK" if sampled else "NONE"
    _object("lamp", corners, [(0, 1, 2, 3)], material).visible_camera = False


def _square(x0: float, x1: float, y: float, z: float):
    return [(x0, -y, z), (x1, -y, z), (x1, y, z), (x0, y, z)]


def build(scene_id: str, material: Material, samples: int, width: int = 0, height: int = 0) -> None:
    """The scene in an empty file, one unit to the millimetre. width, height: pixels, if not those of the benchmark."""
    it = SCENES.get(scene_id)
    if it is None:  # the mapped patch
        columns, rows, width_mm = MAPPED_PIXELS, MAPPED_PIXELS, MAPPED_MM
    else:
        columns, rows, width_mm = *it.picture_size, it.width_mm
    scene = empty_scene(width or columns, height or rows, samples)
    scene.unit_settings.scale_length = 0.001
    scene.cycles.shading_system = False  # plain nodes, as skins are made unless OSL is asked for
    scene.render.threads_mode, scene.render.threads = "FIXED", 1  # processor time without waiting for each other
    scene.cycles.pixel_filter_type = "BOX"  # a pixel sees its own square alone
    world = bpy.data.worlds.new("black")
    scene.world = world
    if not world.node_tree:
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    data = bpy.data.cameras.new("camera")
    data.type, data.ortho_scale, data.clip_end = "ORTHO", width_mm, 1000.0
    camera = bpy.data.objects.new("camera", data)
    camera.location = (0.0, 0.0, 60.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    if scene_id == "mapped":
        # Twice as wide as is seen: light that leaves the skin beside the picture would be missing in it.
        patch = _object("skin", _square(-MAPPED_MM, MAPPED_MM, MAPPED_MM, 0.0), [(0, 1, 2, 3)], material())
        uv = patch.data.uv_layers.new(name="UVMap")
        uv.data.foreach_set("uv", [-0.5, -0.5, 1.5, -0.5, 1.5, 1.5, -0.5, 1.5])
        white_world(scene)
    elif scene_id == "patch":
        _object("skin", _square(-_WIDE_MM, _WIDE_MM, _WIDE_MM, 0.0), [(0, 1, 2, 3)], material())
        white_world(scene)
    elif scene_id == "edge":
        _object("skin", _square(-_WIDE_MM, _WIDE_MM, _WIDE_MM, 0.0), [(0, 1, 2, 3)], material())
        _lamp(_square(0.0, _WIDE_MM, _WIDE_MM, LAMP_GAP_MM), sampled=False)
    elif scene_id == "sheet":
        corners = _square(-_WIDE_MM, _WIDE_MM, _WIDE_MM, -SHEET_MM) + _square(-_WIDE_MM, _WIDE_MM, _WIDE_MM, 0.0)
        faces = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
        _object("skin", corners, faces, material())
        _lamp(_square(0.0, _WIDE_MM, _WIDE_MM, -SHEET_MM - LAMP_GAP_MM), sampled=False)
    else:
        bpy.ops.mesh.primitive_uv_sphere_add(segments=256, ring_count=128, radius=SPHERE_RADIUS_MM)
        bpy.ops.object.shade_smooth()
        bpy.context.object.data.materials.append(material())
        s, c = math.sin(SOFTBOX_ANGLE_RAD), math.cos(SOFTBOX_ANGLE_RAD)
        centre, side = np.array([s, 0.0, c]) * SOFTBOX_DISTANCE_MM, np.array([c, 0.0, -s]) * SOFTBOX_HALF_MM
        up = np.array([0.0, SOFTBOX_HALF_MM, 0.0])
        _lamp([(centre + a * side + b * up).tolist() for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))], sampled=True)


def take(samples: int, denoise: bool = False) -> Shot:
    """The picture of the scene that is built. Processor time of all threads: the machine's other work is not in it."""
    scene = bpy.context.scene
    scene.cycles.samples, scene.cycles.use_denoising = samples, denoise
    start = time.process_time()
    pixels = render_linear()
    return Shot(pixels, time.process_time() - start)


def sample_costs(
    materials: dict[str, Material], few: int = 4, many: int = 36, pixels: int = 160, repeats: int = 4
) -> dict[str, float]:
    """Core seconds per million samples of each material on the sphere, taken in turn, the least of `repeats`.

    The difference of two renders that differ in their samples alone: what a render costs before its first sample is
    not in it.
    """
    seconds: dict[str, dict[int, list[float]]] = {name: {few: [], many: []} for name in materials}
    for _ in range(repeats):
        for name, material in materials.items():
            build("sphere", material, few, pixels, pixels)
            take(1)
            for samples, taken in seconds[name].items():
                taken.append(take(samples).core_seconds)
    return {name: (min(taken[many]) - min(taken[few])) / (many - few) / pixels**2 * 1e6
            for name, taken in seconds.items()}


def denoise_cost(material: Material, pixels: int = 320, repeats: int = 3) -> float:
    """Core seconds per megapixel that denoising adds."""
    build("sphere", material, 1, pixels, pixels)
    take(1, denoise=True)
    seconds = {False: [], True: []}
    for _ in range(repeats):
        for denoise in seconds:
            seconds[denoise].append(take(1, denoise).core_seconds)
    return (min(seconds[True]) - min(seconds[False])) / pixels**2 * 1e6


def face_costs(settings: list[Settings], plan_of: Callable[[Settings], Plan], repeats: int = 2) -> list[float]:
    """Core seconds for table and maps of a plan on the example head, per settings, the least of `repeats`."""
    from sanguine.app.map_cache import MapCache
    from sanguine.app.maps import bake_maps
    from sanguine.blender.face import add_face
    from sanguine.blender.surface import read_surface
    from sanguine.domain.lut import bake
    from sanguine.domain.texel_density import MapSizes

    empty_scene(16, 16, 1)
    surface = read_surface(add_face("female").skin)
    found = [math.inf] * len(settings)
    for _ in range(repeats):
        for k, each in enumerate(settings):
            plan = plan_of(each)
            start = time.process_time()
            bake(plan.axes, plan.scene.skin, "rec709", lobes=each.lobes)
            bake_maps(plan, surface, MapSizes(each.map_size, each.map_size), MapCache(None))
            found[k] = min(found[k], time.process_time() - start)
    return found


def matched_random_walk(truth: dict[str, np.ndarray], samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Colour and radius [mm] of the random walk that shows the skin's colour and spreads its light as far as the truth.

    Cycles' walk comes out darker than the colour it is given, so that is corrected on the patch until it agrees.
    Its profile scales with the radius; across an edge of light, what falls into the shadow is A <r> / pi, which gives
    the mean distance <r> of each channel, here and in the truth.
    """
    wanted = truth["patch_rgb"]
    rgb = wanted.copy()
    for _ in range(4):
        build("patch", lambda: random_walk(rgb, np.ones(3)), samples)
        rgb = np.clip(rgb * wanted / take(samples).pixels.mean((0, 1)), 0.0, 1.0)
    build("edge", lambda: random_walk(rgb, np.ones(3)), samples)
    shadow = slice(0, SCENES["edge"].columns // 2)
    spread = take(samples).pixels.mean(0)[shadow].sum(0)
    return rgb, np.maximum(truth["edge_rgb"][shadow].sum(0) / spread, 0.01)
