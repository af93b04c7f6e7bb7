"""What a skin costs at render time, beside Blender's own: docs/cost.md.

    python bench/cost.py [--rounds 5] [--quick] [--page docs/cost.md]

The example head of a shot with its maps, one pose, the same samples and pixels for every material. Every round renders
each material once, in turn, so that a busy machine disturbs all alike; told is the least CPU time of the rounds, of one
thread. The noise of a material is measured against its own converged picture.
"""

from __future__ import annotations

import argparse
import json
import platform
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from beside_principled import stock_skin
from sanguine.app.maps import bake_maps
from sanguine.blender.controls import CONTROL_BONE, CONTROLS, set_controls
from sanguine.blender.images import data_image
from sanguine.blender.material import MARK
from sanguine.blender.render import BlenderRenderer, quiet
from sanguine.blender.skin import apply_skin, needed_sizes
from sanguine.blender.surface import read_surface
from sanguine.domain.effects import EFFECTS, grown
from sanguine.domain.parameters import skin_from
from sanguine.domain.plan import Plan, make_plan
from sanguine.domain.shading import NODES, OSL
from sanguine.domain.shot import Shot, jobs, pose_of, read_shot, scene_of
from sanguine.domain.udim import FIRST_TILE

ROOT = Path(__file__).resolve().parents[1]
SHOT = ROOT / "examples/five_expressions.toml"
RESULTS = ROOT / "bench/results/cost.json"
POSE = "anger"
# That of times: as many as a portrait has, so that neighbouring samples find the same texels; and few samples of it.
PIXELS = (512, 640)
SAMPLES = 3
FEW = 1
# That of noise.
NOISE_PIXELS = (128, 160)
NOISE_SAMPLES = 32
# Of the converged pictures: their own mean square error is 1/16 of that of the pictures that are judged.
CONVERGED = 512
BAR = 0.7

STOCK, STOCK_MAPS = "Principled, one colour", "Principled, its maps"
SANGUINE = {OSL: "Sanguine, OSL", NODES: "Sanguine, plain nodes"}
SAME = "Principled, a map for each emotion, our relief"
FLOOR = "One Burley lobe and a gloss, one colour"
BLOOD = "Sanguine, plain nodes, what every skin has"
PAINTED = "Sanguine, plain nodes, all but Relief's noise and diffuse relief"
SMOOTH = "Sanguine, plain nodes, all but diffuse relief"
# What a skin has when nobody asked for more.
DEFAULT = ("scattering", "anatomy", "perfusion", "oxygenation", "oil")


class Stage:
    """The posed head of a shot, and materials to put on it by name."""

    def __init__(self, shot: Shot, plan: Plan) -> None:
        self.renderer = BlenderRenderer()
        self.renderer.prepare(shot, shot.subjects[0], plan, {})
        scene = bpy.context.scene
        self.size(PIXELS)
        scene.render.threads_mode, scene.render.threads = "FIXED", 1
        scene.render.use_persistent_data = False
        scene.cycles.use_denoising = False
        self.face = next(obj for obj in bpy.data.objects if obj.type == "MESH" and any(MARK in m for m in obj.data.materials if m))
        self.rig = self.face.parent
        self.shot = shot
        self.pose(POSE)
        self.materials: dict[str, tuple[bpy.types.Material, bool]] = {}

    def pose(self, expression: str) -> None:
        job = next(job for job in jobs(self.shot) if job.id == expression)
        wanted, bone = pose_of(self.shot, job).controls, self.rig.pose.bones[CONTROL_BONE]
        set_controls(self.rig, {name: wanted.get(name, 0.0) for name in CONTROLS if name in bone})

    @staticmethod
    def size(pixels: tuple[int, int]) -> None:
        bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = pixels

    def add(self, name: str, material: bpy.types.Material, osl: bool) -> None:
        material.use_fake_user = True  # kept while another one is on the face
        self.materials[name] = material, osl

    def add_sanguine(self, name: str, plan: Plan, shading: str) -> None:
        self.add(name, apply_skin(self.face, self.rig, plan, shading=shading), shading == OSL)

    def alone(self) -> None:
        """Hides all but the skin: no hair, no eyes, no backdrop, whose time is the same under every material."""
        for obj in bpy.data.objects:
            obj.hide_render = obj.type not in ("LIGHT", "CAMERA", "ARMATURE") and obj is not self.face

    def render(self, name: str, samples: int, seed: int = 0) -> float:
        """CPU seconds of one picture."""
        scene = bpy.context.scene
        self.face.data.materials[0], scene.cycles.shading_system = self.materials[name]
        scene.cycles.samples, scene.cycles.seed = samples, seed
        start = time.process_time()
        with quiet():
            bpy.ops.render.render()
        return time.process_time() - start

    def pixels(self, name: str, samples: int, seed: int, folder: Path) -> np.ndarray:
        self.render(name, samples, seed)
        path = folder / "cost.exr"
        settings = bpy.context.scene.render.image_settings
        settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
        bpy.data.images["Render Result"].save_render(str(path))
        image = bpy.data.images.load(str(path))
        width, height = image.size
        values = np.empty(4 * width * height, np.float32)
        image.pixels.foreach_get(values)
        bpy.data.images.remove(image)
        return values.reshape(height, width, 4)


def timed(stage: Stage, names: list[str], rounds: int) -> dict[str, float]:
    """Seconds that SAMPLES more samples take: what comes before the first (the mesh, the maps read from the file) is the
    same however long the rendering is, and is taken off."""
    least = {name: [float("inf"), float("inf")] for name in names}
    for _ in range(rounds):
        for name in names:
            for i, samples in enumerate((FEW, FEW + SAMPLES)):
                least[name][i] = min(least[name][i], stage.render(name, samples))
    return {name: more - few for name, (few, more) in least.items()}


def noise(stage: Stage, name: str, folder: Path) -> float:
    """Relative mean square error of a picture of NOISE_SAMPLES against the material's converged one, over the skin's pixels.

    The thousandth of the pixels that is worst is left out: a single spark would be the whole number.
    """
    truth = stage.pixels(name, CONVERGED, 1, folder)
    errors = []
    for seed in (11, 12, 13):
        shown = stage.pixels(name, NOISE_SAMPLES, seed, folder)
        errors.append((shown - truth)[..., :3] ** 2 / (truth[..., :3] ** 2 + 1e-3))
    skin = truth[..., 3] > 0.99
    each = np.sort(np.mean(errors, axis=(0, -1))[skin])
    return float(each[: int(0.999 * len(each))].mean())


def floor_skin(skin: dict[str, float]) -> bpy.types.Material:
    """The least that our skin could be: what Cycles takes for one Burley lobe and a gloss over it, without a map."""
    material = stock_skin(skin)
    tree = material.node_tree
    principled = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    lobe, gloss, both = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("SubsurfaceScattering", "BsdfAnisotropic", "AddShader"))
    lobe.falloff, gloss.distribution = "BURLEY", "GGX"
    lobe.inputs["Color"].default_value = principled.inputs["Base Color"].default_value
    lobe.inputs["Scale"].default_value = 0.006  # 4 pi of d = 0.5 mm in red, as the lobe of this skin has
    gloss.inputs["Color"].default_value = (0.03, 0.03, 0.03, 1.0)
    gloss.inputs["Roughness"].default_value = principled.inputs["Roughness"].default_value
    tree.links.new(lobe.outputs[0], both.inputs[0])
    tree.links.new(gloss.outputs[0], both.inputs[1])
    tree.links.new(both.outputs[0], next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL").inputs["Surface"])
    tree.nodes.remove(principled)
    return material


def artists_skin(stage: Stage, skin: dict[str, float], plan: Plan) -> bpy.types.Material:
    """The stock skin with what an artist paints for it: the same skin's colours as a map, and its relief as a bump."""
    material = stock_skin(skin)
    tree = material.node_tree
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    colour = tree.nodes.new("ShaderNodeTexImage")
    colour.image = baked_colour(stage)
    tree.links.new(colour.outputs["Color"], shader.inputs["Base Color"])
    names = [height for name in plan.maps if (height := grown.height_of(name)) == "grown_height"]
    surface = read_surface(stage.face)
    for name, tiles in bake_maps(plan, surface, needed_sizes(stage.face, surface, plan), names=names).items():
        height, bump = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeBump")
        height.image = data_image(name, tiles[FIRST_TILE], half=True)
        bump.inputs["Distance"].default_value = 0.001
        tree.links.new(height.outputs["Color"], bump.inputs["Height"])
        tree.links.new(bump.outputs["Normal"], shader.inputs["Normal"])
    return material


def same_content_skin(stage: Stage, skin: dict[str, float]) -> bpy.types.Material:
    """What Principled takes to show what the whole skin shows: a map of the colours of each emotion, mixed by properties of
    the face as far as the emotions are on, and the same relief, wrinkles that form too."""
    images = {}
    for job in jobs(stage.shot):
        stage.pose(job.id)
        images[job.id] = baked_colour(stage)
    stage.pose(POSE)
    material = stage.materials[SANGUINE[NODES]][0].copy()
    node = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup")
    tree = node.node_tree = node.node_tree.copy()
    normal = next(
        link.from_socket for link in tree.links if link.to_socket.name == "Normal" and link.to_node.bl_idname == "ShaderNodeGroup"
    )
    stock = next(node for node in stock_skin(skin).node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
    shader.subsurface_method = stock.subsurface_method
    for socket in stock.inputs:
        if not socket.is_linked and socket.name in shader.inputs and hasattr(socket, "default_value"):
            shader.inputs[socket.name].default_value = socket.default_value
    colour, attribute = None, None
    for i, image in enumerate([images.pop("neutral"), *images.values()]):
        texture = tree.nodes.new("ShaderNodeTexImage")
        texture.image = image
        if colour is None:
            colour = texture.outputs["Color"]
            continue
        if i % 3 == 1:  # three numbers a property, as ours
            attribute, parts = tree.nodes.new("ShaderNodeAttribute"), tree.nodes.new("ShaderNodeSeparateXYZ")
            attribute.attribute_type, attribute.attribute_name = "OBJECT", f"emotions_{i // 3}"
            stage.face[attribute.attribute_name] = [float(name == POSE) for name in [*images][i - 1 : i + 2]]
            tree.links.new(attribute.outputs["Vector"], parts.inputs[0])
        mix = tree.nodes.new("ShaderNodeMixRGB")
        tree.links.new(parts.outputs[(i - 1) % 3], mix.inputs["Fac"])
        tree.links.new(colour, mix.inputs["Color1"])
        tree.links.new(texture.outputs["Color"], mix.inputs["Color2"])
        colour = mix.outputs["Color"]
    tree.links.new(colour, shader.inputs["Base Color"])
    tree.links.new(normal, shader.inputs["Normal"])
    tree.links.new(shader.outputs["BSDF"], next(node for node in tree.nodes if node.bl_idname == "NodeGroupOutput").inputs["BSDF"])
    return material


def baked_colour(stage: Stage, size: int = 1024) -> bpy.types.Image:
    """Our skin's colour as a map: the sum of its lobes' weights, baked by Cycles."""
    material = stage.materials[SANGUINE[NODES]][0].copy()
    group_node = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup")
    tree = group_node.node_tree = group_node.node_tree.copy()
    total = None
    for node in [node for node in tree.nodes if node.label.startswith("weight_")]:
        if total is None:
            total = node.outputs["Color"]
            continue
        both = tree.nodes.new("ShaderNodeVectorMath")
        tree.links.new(total, both.inputs[0])
        tree.links.new(node.outputs["Color"], both.inputs[1])
        total = both.outputs[0]
    emission = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(total, emission.inputs["Color"])
    end = next(node for node in tree.nodes if node.bl_idname == "NodeGroupOutput")
    tree.links.new(emission.outputs[0], end.inputs["BSDF"])
    target = material.node_tree.nodes.new("ShaderNodeTexImage")
    image = target.image = bpy.data.images.new("baked colour", size, size, float_buffer=True, is_data=True)
    material.node_tree.nodes.active = target
    stage.face.data.materials[0] = material
    bpy.context.scene.cycles.shading_system = False
    bpy.context.scene.cycles.samples = 1
    bpy.context.view_layer.objects.active = stage.face
    stage.face.select_set(True)
    with quiet():
        bpy.ops.object.bake(type="EMIT")
    image.pack()
    return image


def effects_alone(stage: Stage, plan: Plan, shading: str) -> dict[str, str]:
    """Materials of the skin that every face has and of it with one effect more each: their names, by effect."""
    more = frozenset(effect.id for effect in plan.active if effect.id not in DEFAULT)
    names = {}
    for effect in (None, *(effect for effect in EFFECTS if effect.id in more)):
        name = names[effect.label if effect else ""] = f"{shading}: {effect.label if effect else 'what every skin has'}"
        off = more - ({effect.id} if effect else set())
        stage.add_sanguine(name, make_plan(replace(plan.scene, switched_off=off), plan.settings), shading)
    return names


def with_strengths(plan: Plan, **strengths: float) -> Plan:
    return make_plan(replace(plan.scene, strengths={**plan.scene.strengths, **strengths}), plan.settings)


def verdict(results: dict[str, Any]) -> str:
    """How far the bar is met, in words: of the skin alone, where what is beside it on the picture does not count."""
    alone = results["seconds"]["skin alone"]
    ours = {name: alone[name] / alone[STOCK_MAPS] for name in alone if name.startswith("Sanguine, plain nodes")}
    whole = ours[SANGUINE[NODES]]
    if whole <= BAR:
        return "which the whole skin meets."
    within = [name.removeprefix("Sanguine, plain nodes, ") for name, ratio in ours.items() if ratio <= BAR]
    return (
        f"and **the whole skin does not meet it** ({whole:.2f}); {', '.join(within) or 'none of its parts'} "
        f"{'do' if len(within) > 1 else 'does'}. {FLOOR} takes {alone[FLOOR] / alone[STOCK_MAPS]:.2f}, so that Cycles leaves "
        f"{max(0.0, BAR - alone[FLOOR] / alone[STOCK_MAPS]):.2f} for all that is in a skin. Beside a Principled that shows the "
        f"same ({SAME}) the whole skin takes {alone[SANGUINE[NODES]] / alone[SAME]:.2f}."
    )


def page(results: dict[str, Any]) -> str:
    seconds, noise_of, effects = results["seconds"], results["noise"], results["effects"]
    alone = seconds["skin alone"]
    rows = []
    for name, time_alone in alone.items():
        cells = [name]
        for place in seconds.values():
            cells += [f"{place[name]:.2f}", f"{place[name] / place[STOCK]:.2f}", f"{place[name] / place[STOCK_MAPS]:.2f}"]
        ours, stock = (noise_of[n] * alone[n] for n in (name, STOCK_MAPS))
        rows.append([*cells, f"{noise_of[name] ** 0.5:.4f}", f"{(ours / stock) ** 0.5:.2f}"])
    effect_rows = []
    for label in effects[NODES]:
        cells = []
        for shading in (NODES, OSL):
            bare, with_it = effects[shading][""], effects[shading][label]
            cells += [f"{with_it:.2f}", f"{with_it - bare:+.2f}" if label else ""]
        effect_rows.append([label or "what every skin has: scattering, anatomy, blood, oil", *cells])
    quality = results["quality"]
    return f"""# What a skin costs at render time

Written by `bench/cost.py`; not for editing by hand. Blender {results["blender"]}, Cycles on the CPU ({results["machine"]}), one thread.

The head of `examples/five_expressions.toml` with all its maps, in anger, {PIXELS[0]} x {PIXELS[1]} pixels, quality *final* ({quality["lobes"]} lobes, table step {quality["table_step"]:g}). Seconds of the processor for {SAMPLES} samples more than {FEW}: what comes before the first sample is taken off. Every material is rendered in turn, {results["rounds"]} rounds, and the least counts, so that the machine's other work disturbs all alike.

**Principled, one colour** is a Principled BSDF with random walk in the skin's colour, nothing else. **Principled, its maps** is what an artist makes of it: the same skin's colours as a baked map, pores as a bump. **{SAME}** shows what our whole skin shows: colours baked for each of the five expressions and mixed by properties of the face, and the relief of our own nodes. **{FLOOR}** is the least that a skin of ours could take. **What every skin has** is ours without features, strain and relief; the whole has all that the shot asks for: blood by region and by strain, wrinkles that form, fine lines.

The bar is {BAR} of Principled with its maps, {verdict(results)}

{table(["material", "portrait", "/ one colour", "/ maps", "skin alone", "/ one colour", "/ maps", "relative noise", "noise at equal time"], rows)}

*Portrait* has hair, eyes and backdrop, which cost the same under every skin; *skin alone* has none of it. *Relative noise* is the root of the mean square error of a picture of {NOISE_SAMPLES} samples ({NOISE_PIXELS[0]} x {NOISE_PIXELS[1]} pixels) against the same material's picture of {CONVERGED} (per pixel and channel, relative; the worst thousandth of the pixels left out). *Noise at equal time* is noise times the root of the seconds, as a share of *Principled, its maps*: below 1, the picture is smoother after the same time.

## Each effect
Seconds of the skin alone with one effect more than what every skin has, and the difference.

{table(["effect", "plain nodes", "", "OSL", ""], effect_rows)}

An effect that is off has no node and no line: its row is then the first one's. Differences under a tenth of a second are noise.

With *Diffuse relief* (on unless switched off) Cycles runs the relief of the material a second time where light leaves the skin: that is the difference of the first table's rows with and without it. The effects above are without. *Relief* is noise in space, which no map of a face is fine enough for: it stays sharp in a close-up, and is computed at every sample.
"""


def table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="the ratios alone: no effects, no noise; nothing is written")
    parser.add_argument("--page", type=Path, default=ROOT / "docs/cost.md")
    options = parser.parse_args()
    shot = read_shot(SHOT)
    subject = shot.subjects[0]
    plan = make_plan(scene_of(shot, subject, BlenderRenderer().regions(subject)), shot.chosen_quality.settings)
    stage = Stage(shot, plan)
    # The whole skin is the last that is applied: the blood's properties are of the last one.
    stage.add_sanguine(BLOOD, make_plan(replace(plan.scene, switched_off=frozenset(
        effect.id for effect in plan.active if effect.id not in DEFAULT)), plan.settings), NODES)
    stage.add_sanguine(PAINTED, with_strengths(plan, relief=0.0, diffuse_relief=0.0), NODES)
    stage.add_sanguine(SMOOTH, with_strengths(plan, diffuse_relief=0.0), NODES)
    for shading in (OSL, NODES):
        stage.add_sanguine(SANGUINE[shading], plan, shading)
    skin = skin_from(subject.skin, "skin")
    stage.add(STOCK, stock_skin(skin), False)
    stage.add(STOCK_MAPS, artists_skin(stage, skin, plan), False)
    stage.add(SAME, same_content_skin(stage, skin), False)
    stage.add(FLOOR, floor_skin(skin), False)
    names = [STOCK, STOCK_MAPS, SAME, FLOOR, BLOOD, PAINTED, SMOOTH, SANGUINE[NODES], SANGUINE[OSL]]
    results: dict[str, Any] = {
        "machine": platform.machine(), "blender": bpy.app.version_string, "rounds": options.rounds,
        "quality": plan.settings.model_dump(), "seconds": {}, "noise": {}, "effects": {},
    }
    results["seconds"]["portrait"] = timed(stage, names, options.rounds)
    stage.alone()
    results["seconds"]["skin alone"] = timed(stage, names, options.rounds)
    if options.quick:
        print(json.dumps(results["seconds"], indent=1))
        return
    stage.size(NOISE_PIXELS)
    with tempfile.TemporaryDirectory() as folder:
        results["noise"] = {name: noise(stage, name, Path(folder)) for name in names}
    stage.size(PIXELS)
    richer = with_strengths(plan, diffuse_relief=0.0)
    for shading in (NODES, OSL):
        of = effects_alone(stage, richer, shading)
        taken = timed(stage, list(of.values()), options.rounds)
        results["effects"][shading] = {label: taken[name] for label, name in of.items()}
    RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    options.page.write_text(page(results), encoding="utf-8")


if __name__ == "__main__":
    main()
