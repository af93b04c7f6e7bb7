"""The skin in OSL and its plain-node twin beside each other: what differs in the picture, and the seconds of each.

    .venv/bin/python bench/twins.py examples/five_expressions.toml [--out bench/results/twins.json]

The example head, light and dark, with the effects of the shot and with all there are, in three expressions. Same scene,
samples and seed; kinds take turns, and the least of the repeats counts. Seconds are those of the processor, over all
threads, which other work on the machine disturbs less than a clock.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import tempfile
import time
from pathlib import Path

import bpy
import colour
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.patch import read_linear  # noqa: E402

from beside_principled import stock_skin  # noqa: E402
from sanguine.blender.controls import CONTROL_BONE, CONTROLS, set_controls  # noqa: E402
from sanguine.blender.render import BlenderRenderer, quiet, save_render  # noqa: E402
from sanguine.blender.skin import apply_skin, our_slot  # noqa: E402
from sanguine.domain.plan import default_strengths, make_plan  # noqa: E402
from sanguine.domain.shot import Shot, jobs, pose_of, read_shot, scene_of  # noqa: E402

OSL, NODES, UNBENT = "OSL", "plain nodes", "plain nodes, relief on the film alone"
STOCK = "Principled, random walk"
TONES = {"light": 0.02, "dark": 0.25}
EXPRESSIONS = ("neutral", "anger", "fear")
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def lab(pixels: np.ndarray, exposure: float) -> np.ndarray:
    return colour.XYZ_to_Lab(np.clip(pixels * 2.0**exposure @ TO_XYZ.T, 0.0, None), np.array([0.3127, 0.3290]))


def differences(a: np.ndarray, b: np.ndarray, seen: np.ndarray, exposure: float) -> dict[str, float]:
    """CIE 2000 over the pixels in which a skin is seen."""
    found = colour.delta_E(lab(a, exposure)[seen], lab(b, exposure)[seen], method="CIE 2000")
    return {"median": float(np.median(found)), "p95": float(np.percentile(found, 95)), "most": float(found.max())}


def render(folder: Path) -> tuple[np.ndarray, float, float]:
    """Linear pixels, seconds of the processor, seconds of the clock."""
    def processor() -> float:
        return sum(resource.getrusage(resource.RUSAGE_SELF)[:2])

    start, clock = processor(), time.perf_counter()
    with quiet():
        bpy.ops.render.render()
    spent, waited = processor() - start, time.perf_counter() - clock
    save_render(bpy.context.scene, folder / "pixels.exr", "OPEN_EXR")
    return read_linear(folder / "pixels.exr"), spent, waited


def unbend(material: bpy.types.Material) -> None:
    """Takes the relief from the light under the skin, and leaves it to the film of oil."""
    def walk(tree: bpy.types.NodeTree) -> None:
        for node in list(tree.nodes):
            if node.bl_idname == "ShaderNodeGroup":
                walk(node.node_tree)
            elif node.bl_idname == "ShaderNodeSubsurfaceScattering":
                for link in node.inputs["Normal"].links:
                    tree.links.remove(link)

    walk(material.node_tree)


def measure(shot: Shot, options: argparse.Namespace, name: str) -> list[dict]:
    """One tone with one set of effects: every expression by every kind."""
    subject, renderer = shot.subjects[0], BlenderRenderer()
    plan = make_plan(scene_of(shot, subject, renderer.regions(subject)), shot.chosen_quality.settings)
    renderer.prepare(shot, subject, plan, {})
    scene = bpy.context.scene
    face = next(obj for obj in bpy.data.objects if obj.type == "MESH" and our_slot(obj) is not None)
    slot = our_slot(face)
    materials = {}
    for kind in (OSL, NODES, UNBENT):
        with quiet():
            materials[kind] = apply_skin(face, renderer._rig, plan, slot, shading="OSL" if kind == OSL else "NODES")
        materials[kind].use_fake_user = True  # the next one does not replace it
    unbend(materials[UNBENT])
    materials[STOCK] = stock_skin(subject.whole_skin())
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for job in (job for job in jobs(shot) if job.expression in options.expressions):
            bone, pose = renderer._rig.pose.bones[CONTROL_BONE], pose_of(shot, job)
            set_controls(renderer._rig, {key: pose.controls.get(key, 0.0) for key in CONTROLS if key in bone})
            pictures, spent, waited = {}, {}, {}
            for turn in range(options.repeats + 1):  # the first compiles and warms up
                for kind, material in materials.items():
                    face.material_slots[slot].material = material
                    scene.cycles.shading_system = kind == OSL
                    pictures[kind], processor, clock = render(Path(folder))
                    if turn:
                        spent[kind] = min(processor, spent.get(kind, np.inf))
                        waited[kind] = min(clock, waited.get(kind, np.inf))
            seen = np.abs(pictures[OSL] - pictures[OSL][0, 0]).max(-1) > 0.02  # not the backdrop
            exposure = scene.view_settings.exposure
            row = {
                "skin": name, "expression": job.expression, "seconds": {k: round(v, 2) for k, v in spent.items()},
                "clock_seconds": {k: round(v, 2) for k, v in waited.items()},
                "delta_e": {k: differences(pictures[OSL], pictures[k], seen, exposure) for k in (NODES, UNBENT)},
                "nodes": sum(len(tree.nodes) for tree in bpy.data.node_groups),
            }
            print(json.dumps(row), flush=True)
            rows.append(row)
    return rows


def table(rows: list[dict]) -> str:
    """Markdown: a row per skin and expression."""
    lines = ["| skin | expression | Delta E, nodes: median | 95 % | relief on the film alone: median | 95 % | seconds: OSL | nodes | "
             "relief on the film alone | Principled, random walk |", "|---|---|" + "---:|" * 8]
    for row in rows:
        numbers = [row["delta_e"][kind][key] for kind in (NODES, UNBENT) for key in ("median", "p95")]
        seconds = [row["seconds"][kind] for kind in (OSL, NODES, UNBENT, STOCK)]
        cells = [row["skin"], row["expression"], *(f"{n:.3f}" for n in numbers), *(f"{s:.1f}" for s in seconds)]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("shot", type=Path)
    parser.add_argument("--out", type=Path, default=Path("bench/results/twins.json"))
    parser.add_argument("--page", type=Path, default=Path("docs/twins.md"), help="where the table goes")
    parser.add_argument("--size", type=int, nargs=2, default=(256, 320))
    parser.add_argument("--samples", type=int, default=32)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--expressions", nargs="+", default=EXPRESSIONS)
    parser.add_argument("--only", help="one of light, dark, 'light, all effects', 'dark, all effects'")
    options = parser.parse_args()
    base = read_shot(options.shot)
    image = base.image.model_copy(update={
        "width": options.size[0], "height": options.size[1], "samples": options.samples, "denoise": False,
    })
    rows = []
    for effects, more in ((base.effects, ""), (dict.fromkeys(default_strengths(), 1.0), ", all effects")):
        for tone, melanin in TONES.items():
            if options.only in (None, tone + more):
                shot = base.model_copy(update={"image": image, "effects": effects, "skin": base.skin | {"melanin": melanin}})
                rows += measure(shot, options, tone + more)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps({
        "blender": bpy.app.version_string, "samples": options.samples, "size": list(options.size), "rows": rows,
    }, indent=1) + "\n")
    head, rest = options.page.read_text(encoding="utf-8").split("<!-- table -->")
    said = f"{options.size[0]} x {options.size[1]} pixels, {options.samples} samples, Blender {bpy.app.version_string}."
    options.page.write_text(
        f"{head}<!-- table -->\n{table(rows)}\n\n{said}\n<!-- end -->{rest.split('<!-- end -->')[1]}", encoding="utf-8"
    )


if __name__ == "__main__":
    main()
