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
import time
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from beside_principled import stock_skin
from sanguine.blender.controls import CONTROL_BONE, CONTROLS, set_controls
from sanguine.blender.material import MARK
from sanguine.blender.render import BlenderRenderer, quiet
from sanguine.blender.skin import apply_skin
from sanguine.domain.effects import EFFECTS
from sanguine.domain.parameters import skin_from
from sanguine.domain.plan import Plan, make_plan
from sanguine.domain.shading import NODES, OSL
from sanguine.domain.shot import Shot, jobs, pose_of, read_shot, scene_of

ROOT = Path(__file__).resolve().parents[1]
SHOT = ROOT / "examples/five_expressions.toml"
RESULTS = ROOT / "bench/results/cost.json"
POSE = "anger"
PIXELS = (128, 160)
SAMPLES = 32
FEW = 2
# Of the converged pictures; their own noise is then a sixteenth of a picture's that is judged.
CONVERGED = 4096
BAR = 0.7

STOCK, STOCK_MAPS = "Principled, one colour", "Principled, with maps"
SANGUINE = {OSL: "Sanguine, OSL", NODES: "Sanguine, plain nodes"}


class Stage:
    """The posed head of a shot, and materials to put on it by name."""

    def __init__(self, shot: Shot, plan: Plan) -> None:
        self.renderer = BlenderRenderer()
        self.renderer.prepare(shot, shot.subjects[0], plan, {})
        job = next(job for job in jobs(shot) if job.id == POSE)
        scene = bpy.context.scene
        scene.render.resolution_x, scene.render.resolution_y = PIXELS
        scene.render.threads_mode, scene.render.threads = "FIXED", 1
        scene.render.use_persistent_data = False
        scene.cycles.use_denoising = False
        self.face = next(obj for obj in bpy.data.objects if obj.type == "MESH" and any(MARK in m for m in obj.data.materials if m))
        self.rig = self.face.parent
        wanted, bone = pose_of(shot, job).controls, self.rig.pose.bones[CONTROL_BONE]
        set_controls(self.rig, {name: wanted.get(name, 0.0) for name in CONTROLS if name in bone})
        self.materials: dict[str, tuple[bpy.types.Material, bool]] = {}

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
        values = np.empty(4 * PIXELS[0] * PIXELS[1], np.float32)
        image.pixels.foreach_get(values)
        bpy.data.images.remove(image)
        return values.reshape(PIXELS[1], PIXELS[0], 4)


def timed(stage: Stage, names: list[str], rounds: int) -> dict[str, float]:
    """Seconds that SAMPLES more samples take: what comes before the first (the mesh, the maps read from the file) is the
    same however long the rendering is, and is taken off."""
    least = {name: [float("inf"), float("inf")] for name in names}
    for _ in range(rounds):
        for name in names:
            for i, samples in enumerate((FEW, FEW + SAMPLES)):
                least[name][i] = min(least[name][i], stage.render(name, samples))
    return {name: more - few for name, (few, more) in least.items()}


def noise(stage: Stage, name: str, folder: Path, converged: int) -> float:
    """Relative mean square error of a picture of SAMPLES against the material's converged one, over the skin's pixels.

    The thousandth of the pixels that is worst is left out: a single spark would be the whole number.
    """
    truth = stage.pixels(name, converged, 1, folder)
    errors = []
    for seed in (11, 12, 13):
        shown = stage.pixels(name, SAMPLES, seed, folder)
        errors.append((shown - truth)[..., :3] ** 2 / (truth[..., :3] ** 2 + 1e-3))
    skin = truth[..., 3] > 0.99
    each = np.sort(np.mean(errors, axis=(0, -1))[skin])
    return float(each[: int(0.999 * len(each))].mean())


def artists_skin(stage: Stage, skin: dict[str, float], plan: Plan) -> bpy.types.Material:
    """The stock skin with what an artist paints for it: the same skin's colours as a map, and its relief as a bump."""
    material = stock_skin(skin)
    tree = material.node_tree
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    colour = tree.nodes.new("ShaderNodeTexImage")
    colour.image = baked_colour(stage)
    tree.links.new(colour.outputs["Color"], shader.inputs["Base Color"])
    heights = next((node.image for node in _group(stage, NODES).nodes if node.label == "grown_height"), None)
    if heights is not None:
        height, bump = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeBump")
        height.image = heights
        bump.inputs["Distance"].default_value = 0.001
        tree.links.new(height.outputs["Color"], bump.inputs["Height"])
        tree.links.new(bump.outputs["Normal"], shader.inputs["Normal"])
    return material


def _group(stage: Stage, shading: str) -> bpy.types.NodeTree:
    material, _ = stage.materials[SANGUINE[shading]]
    return next(node.node_tree for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup")


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


def effects_alone(stage: Stage, shot: Shot, plan: Plan, shading: str) -> list[str]:
    """Materials of the bare skin and of it with one effect each; their names."""
    bare = frozenset(effect.id for effect in plan.active if effect.id != "scattering")
    names = [f"{shading}: scattering alone"]
    stage.add_sanguine(names[0], make_plan(replace(plan.scene, switched_off=bare), plan.settings), shading)
    for effect in EFFECTS:
        if effect.id in bare:
            names.append(f"{shading}: {effect.label}")
            off = bare - {effect.id}
            stage.add_sanguine(names[-1], make_plan(replace(plan.scene, switched_off=off), plan.settings), shading)
    return names


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
    for shading in (OSL, NODES):
        stage.add_sanguine(SANGUINE[shading], plan, shading)
    skin = skin_from(subject.skin, "skin")
    stage.add(STOCK, stock_skin(skin), False)
    stage.add(STOCK_MAPS, artists_skin(stage, skin, plan), False)
    names = [STOCK, STOCK_MAPS, *SANGUINE.values()]
    results = {"machine": platform.machine(), "blender": bpy.app.version_string, "samples": SAMPLES, "pixels": PIXELS,
               "quality": shot.chosen_quality.settings.model_dump(), "seconds": {}, "effects": {}, "noise": {}}
    results["seconds"]["portrait"] = timed(stage, names, options.rounds)
    stage.alone()
    results["seconds"]["skin alone"] = timed(stage, names, options.rounds)
    if not options.quick:
        for name in names:
            results["noise"][name] = noise(stage, name, RESULTS.parent, CONVERGED)
        for shading in (OSL, NODES):
            results["effects"] |= timed(stage, effects_alone(stage, shot, plan, shading), options.rounds)
    print(json.dumps(results, indent=1))
    if not options.quick:
        RESULTS.write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
