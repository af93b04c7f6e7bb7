"""What grows on skin: a picture of each feature alone, and what each costs.

    python bench/feature_pictures.py [--out docs] [--only freckles,times] [--samples 64]

Writes maps_features.jpg, a contact sheet of rendered heads, and the tables in docs/maps.md.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np
import sanguine_core
from sanguine.app.faces import example_head, head_surface
from sanguine.app.map_cache import MapCache
from sanguine.app.maps import Grown
from sanguine.blender.render import BlenderRenderer
from sanguine.domain.effects import Growth
from sanguine.domain.effects.grown import MAPS
from sanguine.domain.parameters import PARAMETERS, default_skin, skin_rows
from sanguine.domain.plan import make_plan
from sanguine.domain.shot import Shot, scene_of
from sanguine.domain.texel_density import mm_per_uv

PLACES = 20_000
WIDTH, HEIGHT, YAW = 640, 800, -22.0
# Of the picture, from the left and from below: the face, where skin is to be judged.
FACE = (0.18, 0.72, 0.27, 0.84)
BASE = {"epidermis_thickness_mm": 0.05, "melanin": 0.016, "hemoglobin": 0.012, "oxygenation": 0.8, "oil": 0.6, "roughness": 0.3}
# What one feature is shown on: even, bare skin with the relief that any skin has, of somebody in whom it has grown.
PLAIN = {"anatomy": 1.0, "relief": 1.0}
PERSON = {"tone": "light", "age": 58, "seed": 4, "sun": 1.0}


def shot_of(head: str, samples: int, **tables: object) -> Shot:
    image = {"width": WIDTH, "height": HEIGHT, "samples": samples}
    return Shot.model_validate(
        {"rig": {"head": head}, "expression": [{"id": "rest"}], "image": image, "camera": {"yaw_degrees": YAW}, **tables}
    )


def render(renderer: BlenderRenderer, shot: Shot, png: Path) -> Path:
    (subject,) = shot.subjects
    scene = scene_of(shot, subject, renderer.regions(subject))
    renderer.prepare(shot, subject, make_plan(scene, shot.chosen_quality.settings), {})
    border = bpy.context.scene.render
    border.use_border = border.use_crop_to_border = True
    border.border_min_x, border.border_max_x, border.border_min_y, border.border_max_y = FACE
    renderer.render(shot.expression[0], 1, png, png.with_suffix(".exr"))
    print(png.stem, file=sys.stderr, flush=True)
    return png


def times(size: int = 2048) -> dict[str, float]:
    """Seconds to grow and paint each feature on the example head, and "texels" for finding the places they share."""
    face = head_surface(example_head("female"))
    made = {}
    start = time.perf_counter()
    surface = sanguine_core.SkinSurface(
        face.position_mm, face.uv, face.triangles, face.corner_vertex, list(face.regions), face.region_weights
    )
    texels = surface.texels(size, size, 16)
    made["texels"] = time.perf_counter() - start
    for row in sanguine_core.features():
        start = time.perf_counter()
        sanguine_core.grow(row["id"], surface, texels, 0, 45.0, 0.7, 1.0)
        made[row["id"]] = time.perf_counter() - start
    return made


def sizes(of: tuple[int, ...] = (256, 512, 1024, 2048, 4096)) -> list[dict[str, float]]:
    """What a size costs and what it loses: all features at full strength, against the largest map at places of the face.

    Delta E 2000 of the colour of the skin there, seconds from nothing to the map, megabytes of the map.
    """
    face = head_surface(example_head("female"))
    growth = Growth(seed=1, age_years=45.0, sun=0.7, masculinity=0.0)
    strengths = dict.fromkeys((row["id"] for row in sanguine_core.features()), 1.0)
    mm = mm_per_uv(face.position_mm, face.uv, face.triangles, face.corner_vertex)
    found = []
    for size in of:
        start = time.perf_counter()
        image = Grown(face, growth, size, MapCache(None)).compose(strengths, MAPS["grown"])
        found.append({"size": size, "mm": mm / size, "seconds": time.perf_counter() - start, "image": image})
    skin = np.tile(skin_rows([default_skin()]), (PLACES, 1))
    visible = np.concatenate([face.regions[r][:, None] for r in ("cheeks", "nose", "forehead", "chin")], axis=1).sum(axis=1)
    triangles = face.triangles[visible[face.corner_vertex[face.triangles]].min(axis=1) > 0.5]
    random = np.random.default_rng(0)
    chosen = triangles[random.integers(len(triangles), size=PLACES)]
    weights = random.dirichlet((1, 1, 1), PLACES)
    uv = np.einsum("nk,nkc->nc", weights, face.uv[chosen])
    labs = []
    for row in found:
        change = look_up(row.pop("image"), uv)
        rows = skin.copy()
        for channel, value in zip(MAPS["grown"], change.T, strict=True):
            name = channel.removeprefix("log_")
            column = list(PARAMETERS).index(name)
            value = rows[:, column] * np.exp(value) if name != channel else rows[:, column] + value
            rows[:, column] = np.clip(value, PARAMETERS[name].hard_min, PARAMETERS[name].hard_max)
        nm = np.arange(400.0, 701.0, 10.0)
        labs.append(sanguine_core.lab(sanguine_core.xyz(sanguine_core.reflectance(rows, nm), nm)))
    for row, lab in zip(found, labs, strict=True):
        apart = sanguine_core.delta_e_2000(lab, labs[-1])
        row |= {"median": float(np.median(apart)), "p95": float(np.quantile(apart, 0.95))}
    return found


def look_up(image: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Bilinear, as a renderer reads it."""
    at = uv * image.shape[0] - 0.5
    x, y = np.clip(np.floor(at).astype(int).T, 0, image.shape[0] - 2)
    fx, fy = (at - np.stack([x, y], axis=1)).T[..., None]
    return (image[y, x] * (1 - fx) + image[y, x + 1] * fx) * (1 - fy) + (image[y + 1, x] * (1 - fx) + image[y + 1, x + 1] * fx) * fy


def write_tables(page: Path) -> None:
    """The features, and what a size costs, between the marks of docs/maps.md."""
    seconds = times()
    features = ["| feature | is | changes, at strength 1 | seconds at 2048 x 2048 |", "|---|---|---|---|"]
    for row in sanguine_core.features():
        changes = ", ".join(f"`{c['channel']}` {c['low']:.2g} to {c['high']:.2g}" for c in row["changes"])
        features.append(f"| `{row['id']}` | {row['help']} | {changes} | {seconds[row['id']]:.2f} |")
    features += [
        "",
        f"All of them: {sum(seconds.values()):.1f} s on {os.cpu_count()} cores, {seconds['texels']:.1f} s of it to find the "
        "places of the texels (45 years, sun 0.7, male). Sources of sizes and numbers: `sanguine maps female --out-dir . "
        "--features list`.",
    ]
    cost = ["| texels a side | mm per texel | seconds, all features | Delta E 2000 median | 95 % |", "|---|---|---|---|---|"]
    cost += [
        f"| {r['size']} | {r['mm']:.2f} | {r['seconds']:.1f} | {r['median']:.2f} | {r['p95']:.2f} |" for r in sizes()
    ]
    text = page.read_text(encoding="utf-8")
    for mark, lines in (("features", features), ("sizes", cost)):
        head, rest = text.split(f"<!-- {mark} -->")
        tail = rest.split(f"<!-- /{mark} -->")[1]
        text = head + f"<!-- {mark} -->\n" + "\n".join(lines) + f"\n<!-- /{mark} -->" + tail
    page.write_text(text, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs"))
    parser.add_argument("--only", default="", help="ids of features, 'none', 'all', 'times'")
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--keep", type=Path, help="folder for the single pictures")
    options = parser.parse_args()
    wanted = set(filter(None, options.only.split(",")))
    renderer = BlenderRenderer()
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        every = [row["id"] for row in sanguine_core.features()]
        sets = {"none": {}, **{name: {name: 1.0} for name in every}, "all": dict.fromkeys(every, 0.6)}
        made = []
        for name, features in sets.items():
            if wanted and name not in wanted:
                continue
            head = "male" if name == "beard" else "female"
            effects = {**dict.fromkeys(every, 0.0), **PLAIN, **features}
            shot = shot_of(head, options.samples, skin=BASE, effects=effects, person={**PERSON, "sex": head})
            made.append(render(renderer, shot, folder / f"{name}.png"))
        if made:
            sanguine_core.contact_sheet(made, [path.stem for path in made], options.out / "maps_features.jpg", columns=6)
        if not wanted or "times" in wanted:
            write_tables(options.out / "maps.md")


if __name__ == "__main__":
    main()
