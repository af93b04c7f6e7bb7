"""The five expressions beside the same head under Blender's stock skin: one picture, and the seconds of each.

    .venv/bin/python bench/beside_principled.py examples/five_expressions.toml out/beside_principled

The stock skin is what an artist sets up in a minute, at its best: a Principled BSDF with random-walk subsurface, its
base colour the one that `sanguine skin` gives for the same skin, radii in the usual proportions of skin and scale in
true millimetres, roughness and specular as the oil film. Same head, drivers, light, camera, samples.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import bpy
import numpy as np
import sanguine_core
from sanguine.app.skin_report import report
from sanguine.blender.render import BlenderRenderer
from sanguine.domain.parameters import skin_from
from sanguine.domain.plan import make_plan
from sanguine.domain.shot import jobs, pose_of, read_shot, scene_of


def stock_skin(skin: dict[str, float]) -> bpy.types.Material:
    """Principled BSDF with random walk, coloured like `skin`."""
    material = bpy.data.materials.new("stock skin")
    material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.subsurface_method = "RANDOM_WALK"
    rgb = report(["skin"], [skin], np.array([550.0]))["results"][0]["linear_rec709"]
    for socket, value in {
        "Base Color": (*rgb, 1.0),
        "Subsurface Weight": 1.0,
        "Subsurface Radius": (1.0, 0.36, 0.18),
        "Subsurface Scale": 0.002,
        "Roughness": skin["roughness"] ** 0.5,  # Principled squares it
        "Specular IOR Level": 0.5 * skin["oil"],
    }.items():
        shader.inputs[socket].default_value = value
    return material


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("shot", type=Path)
    parser.add_argument("out", type=Path)
    options = parser.parse_args()
    shot = read_shot(options.shot)
    subject = shot.subjects[0]
    options.out.mkdir(parents=True, exist_ok=True)
    renderer = BlenderRenderer()
    plan = make_plan(scene_of(shot, subject, renderer.regions(subject)), shot.chosen_quality.settings)
    pictures, seconds = {}, {}
    for kind in ("sanguine", "principled"):
        renderer.prepare(shot, subject, plan, {})
        if kind == "principled":
            face = next(obj for obj in bpy.data.objects if obj.name.endswith("_skin"))
            face.data.materials[0] = stock_skin(skin_from(subject.skin, "skin"))
        for job in jobs(shot):
            start = time.perf_counter()
            png = options.out / f"{kind}_{job.id}.png"
            renderer.render(pose_of(shot, job), 1, png, png.with_suffix(".exr"))
            pictures[f"{job.id}, {kind}"] = str(png)
            seconds[f"{job.id}, {kind}"] = round(time.perf_counter() - start, 1)
            print(f"{job.id}, {kind}: {seconds[f'{job.id}, {kind}']} s", flush=True)
    columns = len(jobs(shot))
    sanguine_core.contact_sheet(list(pictures.values()), list(pictures), str(options.out / "sheet.png"), columns)
    (options.out / "seconds.json").write_text(json.dumps(seconds, indent=1))


if __name__ == "__main__":
    main()
