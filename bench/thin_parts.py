"""Thin parts: what the walk reaches, what it costs, how thick the example heads are, and pictures of ears and nostrils.

    python bench/thin_parts.py [--only measure,pictures,curve] [--samples 24]

Writes bench/results/thin_parts.json, docs/thin_parts.jpg and, between its marks, docs/thin_parts.md. `curve` derives what a
walk sends back (`walk.CURVE`, `walk.CURVE_SLANT`) and prints it. About five minutes on two idle cores.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import sanguine_core
from sanguine.domain import walk

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "bench" / "results" / "thin_parts.json"
PAGE = ROOT / "docs" / "thin_parts.md"
HEADS = ("female", "male")
# Mean "light" and "dark" faces, as in bench/picture_scenes.py, with some oil: pictures have highlights.
PICTURED = {"light": {"melanin": 0.014, "hemoglobin": 0.011, "oil": 0.5}, "dark": {"melanin": 0.134, "hemoglobin": 0.020, "oil": 0.5}}


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


# ---------------------------------------------------------------- measuring


def sheet() -> list[dict]:
    """Delta E 2000 of the benchmark's sheet of 1.5 mm, seen from the dark side, against its path-traced truth."""
    import bpy
    import picture_ours as ours
    from picture import Truth, summary
    from picture_scenes import SKINS, TRUTH
    from sanguine.blender.material import build_skin_material
    from sanguine.domain.effects import Frame, Scene
    from sanguine.domain.effects.thin import ATTRIBUTE
    from sanguine.domain.plan import make_plan

    stored, found = np.load(TRUTH), []
    for skin in ("light", "dark"):
        truth = Truth(stored, "sheet", skin)
        for strength in (0.0, 1.0):
            plan = make_plan(Scene(SKINS[skin], (Frame("0"),), {"thin": strength}))
            ours.build("sheet", lambda plan=plan: build_skin_material("skin", plan, {}), 1)
            mesh = bpy.data.objects["skin"].data
            mesh.attributes.new(ATTRIBUTE, "FLOAT", "POINT").data.foreach_set("value", [1.0] * len(mesh.vertices))
            shot = ours.take(1024)
            lit = slice(28, 44)  # columns well inside the lit half
            colours = [pixels[..., lit, :].reshape(-1, 3).mean(0) for pixels in (shot.pixels, _rgb(truth))]
            found.append({"skin": skin, "thin": strength, **summary(truth.errors(shot.pixels)),
                          "rgb": colours[0].round(5).tolist(), "truth_rgb": colours[1].round(5).tolist()})
            say(f"sheet {found[-1]}")
    return found


def _rgb(truth) -> np.ndarray:
    from picture_scenes import xyz_to_rgb

    return xyz_to_rgb(truth.full_xyz)


def slabs() -> list[dict]:
    """Light through slabs of skin, by the solver and by the matched walk."""
    from sanguine.domain.parameters import default_skin, skin_rows

    nm, found = np.arange(380.0, 781.0, 10.0), []
    for name, values in PICTURED.items():
        rows = skin_rows([default_skin() | values])
        back = sanguine_core.linear_rgb(sanguine_core.xyz(sanguine_core.reflectance(rows, nm), nm))
        albedo, mfp_mm = walk.match_walk(back, walk.slab_rgb(rows, "rec709"))
        for thickness_mm in (1.0, 1.5, 2.0, 3.0, 4.0, 6.0):
            skin = walk.slab_rgb(rows, "rec709", (thickness_mm,))[0, 0]
            let = (back / walk.albedo_in_walk(albedo) * walk.walk_slab(albedo, thickness_mm / mfp_mm))[0]
            found.append({"skin": name, "thickness_mm": thickness_mm, "solver": skin.round(5).tolist(), "walk": let.round(5).tolist()})
    return found


def thickness() -> list[dict]:
    """What the measuring finds on the example heads, and how long it takes."""
    from sanguine.blender.face import add_face
    from sanguine.blender.thin import measure_flesh

    sys.path.insert(0, str(ROOT / "tests"))
    from support.patch import empty_scene

    found = []
    for head in HEADS:
        empty_scene(16, 16, 1)
        skin = add_face(head).skin
        start = time.process_time()
        flesh = measure_flesh(skin)
        seconds = time.process_time() - start
        places = np.array([v.co for v in skin.data.vertices]) * 1000.0
        ears = np.abs(places[:, 0]) > 55.0
        front = np.median(places[ears & (flesh.thin > 0.5), 1]) - 60.0
        nose = (np.abs(places[:, 0]) < 25.0) & (places[:, 1] < front)
        row = {"head": head, "vertices": len(places), "seconds": round(seconds, 2), "thin_share": round(float((flesh.thin > 0.5).mean()), 4)}
        for part, inside in (("ears", ears), ("nostrils", nose)):
            mm = flesh.thickness_mm[inside & (flesh.thin > 0.3) & np.isfinite(flesh.thickness_mm)]
            row[part] = {"vertices": len(mm), "mm_5_50_95": np.percentile(mm, (5, 50, 95)).round(1).tolist() if len(mm) else None}
        found.append(row)
        say(str(row))
    return found


def times(repeats: int = 3) -> dict[str, float]:
    """Core seconds of a portrait without and with the walk, the least of some, and of what is prepared for it."""
    from sanguine.domain.lut import bake
    from sanguine.domain.parameters import default_skin
    from sanguine.domain.plan import spaced

    axes = tuple(spaced(name, low, high, 1.0) for name, low, high in (("hemoglobin", 0.004, 0.08), ("melanin", 0.005, 0.3), ("oxygenation", 0.3, 0.98)))
    found = {"entries": math.prod(axis.count for axis in axes)}
    walk._walk_table()
    for name, on in (("table", False), ("table with walk", True)):
        taken = []
        for _ in range(repeats):
            start = time.process_time()
            bake(axes, default_skin(), "rec709", walk=on)
            taken.append(time.process_time() - start)
        found[name] = round(min(taken), 3)
    import bpy
    from sanguine.blender.render import quiet
    from sanguine.blender.stage import set_stage

    taken = {name: [] for name in ("portrait", "portrait with walk")}
    with tempfile.TemporaryDirectory() as folder:
        for name, strength in zip(taken, (0.0, 1.0), strict=True):
            scene, _ = head_scene("female", "light", strength, (120, 150), 42)
            set_stage(scene, *_landmarks("female"), size=(120, 150))
            scene.cycles.use_denoising = False
            scene.render.threads_mode, scene.render.threads = "FIXED", 1
            with quiet():
                bpy.ops.wm.save_as_mainfile(filepath=f"{folder}/{name}.blend")
        for _ in range(2 * repeats):
            for name in taken:  # in turn: what else the machine does hits both
                with quiet():
                    bpy.ops.wm.open_mainfile(filepath=f"{folder}/{name}.blend")
                    start = time.process_time()
                    bpy.ops.render.render()
                taken[name].append(time.process_time() - start)
    found |= {name: round(min(seconds), 2) for name, seconds in taken.items()}
    say(str(found))
    return found


def _landmarks(head: str) -> list[tuple[float, ...]]:
    from sanguine.app.faces import example_head

    marks = example_head(head).landmarks
    return [tuple(float(x) for x in marks[name]) for name in ("eyes", "chin", "crown")]


# ---------------------------------------------------------------- pictures


def head_scene(head: str, skin: str, strength: float, size: tuple[int, int], samples: int):
    """An example head with its skin, and the middle of its left ear and nostril."""
    import bpy
    from mathutils import Vector
    from sanguine.blender.face import add_face
    from sanguine.blender.skin import apply_skin
    from sanguine.blender.surface import face_regions
    from sanguine.blender.thin import measure_flesh
    from sanguine.domain.effects import Frame, Scene
    from sanguine.domain.parameters import default_skin
    from sanguine.domain.plan import make_plan

    sys.path.insert(0, str(ROOT / "tests"))
    from support.patch import empty_scene

    scene = empty_scene(*size, samples)
    face = add_face(head)
    strengths = {"thin": strength, "anatomy": 1.0, "mottle": 0.6, "relief": 1.0}
    plan = make_plan(Scene(default_skin() | PICTURED[skin], (Frame("0"),), strengths, regions=face_regions(face.skin)))
    apply_skin(face.skin, face.rig, plan)
    thin = measure_flesh(face.skin).thin
    places = np.array([face.skin.matrix_world @ v.co for v in face.skin.data.vertices])
    ear = places[(thin > 0.5) & (places[:, 0] > 0.06)].mean(0)
    index = face.skin.vertex_groups["sanguine_nose"].index
    nose = np.array([any(g.group == index and g.weight > 0.5 for g in v.groups) for v in face.skin.data.vertices])
    nostril = places[nose & (thin > 0.2) & (places[:, 0] > 0.0)].mean(0)
    bpy.context.view_layer.update()
    return scene, {"ear": Vector(ear), "nostril": Vector(nostril)}


# Of a view: camera and sun as seen from the part, metres to the camera, where it looks beside the part, sun, sky.
VIEWS = {
    "ear": ((0.8, -1.0, 0.05), (0.15, 1.0, 0.25), 0.27, (-0.006, 0.0, -0.008), 22.0, 0.16),
    "nostril": ((-0.35, -1.0, -1.0), (1.0, 0.45, 0.1), 0.14, (-0.006, 0.0, 0.0), 24.0, 0.05),
}


def picture(view: str, skin: str, strength: float, samples: int, png: Path) -> Path:
    import bpy
    from mathutils import Vector
    from sanguine.blender.render import quiet

    scene, parts = head_scene("female", skin, strength, (256, 320), samples)
    camera_from, sun_from, distance, beside, sun, sky = VIEWS[view]
    target = parts[view] + Vector(beside)
    scene.view_settings.view_transform = "Standard"
    scene.cycles.use_denoising = True
    world = bpy.data.worlds.new("sky")
    scene.world = world
    if not world.node_tree:
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (sky, 1.02 * sky, 1.06 * sky, 1.0)
    light = bpy.data.lights.new("sun", "SUN")
    light.energy, light.angle = sun, math.radians(3.0)
    lamp = bpy.data.objects.new("sun", light)
    lamp.rotation_euler = Vector(sun_from).to_track_quat("Z", "Y").to_euler()
    data = bpy.data.cameras.new("camera")
    data.lens = 100.0
    camera = bpy.data.objects.new("camera", data)
    camera.location = target + distance * Vector(camera_from).normalized()
    camera.rotation_euler = (target - camera.location).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(lamp)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.filepath = str(png)
    with quiet():
        bpy.ops.render.render(write_still=True)
    say(png.stem)
    return png


def pictures(samples: int, views: tuple[str, ...], keep: Path | None) -> None:
    with tempfile.TemporaryDirectory() as scratch:
        folder = keep or Path(scratch)
        made, titles = [], []
        for view in views:
            for skin in PICTURED:
                for strength in (0.0, 1.0):
                    png = folder / f"{view}_{skin}_{strength:.0f}.png"
                    made.append(png if png.exists() else picture(view, skin, strength, samples, png))
                    titles.append(f"{skin}, {'walk' if strength else 'lobes'}")
        sanguine_core.contact_sheet(made, titles, ROOT / "docs" / "thin_parts.jpg", columns=4)


# ---------------------------------------------------------------- the curve


def curve() -> None:
    """What a thick walk sends back: isotropic scattering's H function (Chandrasekhar 1960, Radiative Transfer, V), averaged
    over Cycles' directions of entry: half by a cosine, half refracted by GGX facets of roughness 1 seen from the view."""
    x, w = np.polynomial.legendre.leggauss(64)
    mu, w = 0.5 * (x + 1.0), 0.5 * w

    def sent(alpha: float):
        h = np.ones_like(mu)
        for _ in range(400):
            h = 1.0 / (np.sqrt(1.0 - alpha) + 0.5 * alpha * ((w * mu * h) / (mu[:, None] + mu)).sum(1))
        return lambda m: 1.0 - np.sqrt(1.0 - alpha) / (
            np.sqrt(1.0 - alpha) + 0.5 * alpha * ((w * mu * h) / (np.atleast_1d(m)[:, None] + mu)).sum(1))

    def refracted(view: float, count: int = 100_000) -> np.ndarray:
        """Cosines into the medium of facets that the view sees (Heitz 2018, visible normals), not above 0: lost."""
        u, v = (np.arange(count) + 0.5) / count, (np.arange(count) * 0.6180339887498949) % 1.0
        away = np.array([math.sqrt(1.0 - view * view), 0.0, view])
        across = np.array([0.0, 1.0, 0.0])
        along = np.cross(away, across)
        r, turn, s = np.sqrt(u), 2.0 * np.pi * v, 0.5 * (1.0 + view)
        a, b = r * np.cos(turn), r * np.sin(turn)
        b = (1.0 - s) * np.sqrt(np.maximum(1.0 - a * a, 0.0)) + s * b
        facet = a[:, None] * across + b[:, None] * along + np.sqrt(np.maximum(1.0 - a * a - b * b, 0.0))[:, None] * away
        facet[:, 2] = np.maximum(facet[:, 2], 0.0)
        facet /= np.linalg.norm(facet, axis=1, keepdims=True)
        c, eta = facet @ away, 1.0 / walk.INDEX
        inward = -eta * away + (eta * c - np.sqrt(1.0 - eta**2 * (1.0 - c * c)))[:, None] * facet
        return -inward[:, 2]

    albedo = np.linspace(*walk.ALBEDO_RANGE, 27)
    views = np.array([1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.05])
    fine, entries = np.linspace(1e-3, 1.0, 400), [refracted(view) for view in views]
    exact = np.empty((len(albedo), len(views)))
    for i, alpha in enumerate(walk.single_albedo(albedo)):
        back = sent(float(alpha))
        by_cosine, table = (2.0 * mu * w * back(mu)).sum(), back(fine)
        exact[i] = [0.5 * by_cosine + 0.5 * np.where(e > 0, np.interp(e, fine, table), 0.0).mean() for e in entries]
    straight = exact[:, 0] / albedo
    flat = np.linalg.lstsq(albedo[:, None] ** np.arange(4) / straight[:, None], np.ones(len(albedo)), rcond=None)[0]
    a, d = np.meshgrid(albedo, 1.0 - views, indexing="ij")
    rise = exact / exact[:, :1]
    terms = np.stack([d, d**2, d**3, a * d, a * d**2], -1) * ((1.0 - a) / rise)[..., None]
    slant = np.linalg.lstsq(terms.reshape(-1, 5), ((rise - 1.0) / rise).ravel(), rcond=None)[0]
    print("CURVE =", flat.round(5).tolist(), "CURVE_SLANT =", slant.round(4).tolist())
    error = np.abs(walk.albedo_in_walk(a, 1.0 - d) / exact - 1.0)
    print(f"as in walk.py: within {error.max():.2%}, down to a view of mu = 0.1 {error[:, :-1].max():.2%}")


# ---------------------------------------------------------------- the page


def write_page(results: dict) -> None:
    lines = ["| skin | lobes alone | with the walk | lit half, truth | lobes | walk |", "|---|---|---|---|---|---|"]
    colour = lambda rgb: ", ".join(f"{x:.4f}" for x in rgb)  # noqa: E731
    for off, on in zip(results["sheet"][::2], results["sheet"][1::2], strict=True):
        lines.append(f"| {off['skin']} | {off['median']:.1f} / {off['p95']:.1f} | {on['median']:.1f} / {on['p95']:.1f} | "
                     f"{colour(off['truth_rgb'])} | {colour(off['rgb'])} | {colour(on['rgb'])} |")
    parts = {"sheet": lines}
    lines = ["| skin | mm | solver | walk |", "|---|---|---|---|"]
    lines += [f"| {r['skin']} | {r['thickness_mm']:g} | {colour(r['solver'])} | {colour(r['walk'])} |" for r in results["slabs"]]
    parts["slabs"] = lines
    lines = ["| head | vertices | seconds | ears, mm (5, 50, 95 %) | nostrils, mm | vertices thin by half or more |", "|---|---|---|---|---|---|"]
    span = lambda part: ", ".join(f"{x:g}" for x in part["mm_5_50_95"] or ())  # noqa: E731
    lines += [f"| {r['head']} | {r['vertices']} | {r['seconds']} | {span(r['ears'])} | {span(r['nostrils'])} | {r['thin_share']:.1%} |"
              for r in results["thickness"]]
    parts["thickness"] = lines
    t = results["times"]
    parts["times"] = [
        "| | without | with | |", "|---|---|---|---|",
        f"| table of {t['entries']} skins, core seconds | {t['table']} | {t['table with walk']} | once, when the skin is applied |",
        f"| portrait of 120 x 150, 42 samples, core seconds, the least of some renders | {t['portrait']} | {t['portrait with walk']} | "
        f"{t['portrait with walk'] / t['portrait'] - 1:+.0%} |",
    ]
    text = PAGE.read_text(encoding="utf-8")
    for mark, rows in parts.items():
        head, rest = text.split(f"<!-- {mark} -->\n")
        text = head + f"<!-- {mark} -->\n" + "\n".join(rows) + f"\n<!-- /{mark} -->" + rest.split(f"<!-- /{mark} -->")[1]
    PAGE.write_text(text, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="measure,pictures", help="measure, sheet, slabs, thickness, times, pictures, curve")
    parser.add_argument("--views", default=",".join(VIEWS))
    parser.add_argument("--samples", type=int, default=24)
    parser.add_argument("--keep", type=Path, help="folder for the single pictures; those that are there stay")
    options = parser.parse_args()
    wanted = set(options.only.split(","))
    if "curve" in wanted:
        curve()
    steps = {"sheet": sheet, "slabs": slabs, "thickness": thickness, "times": times}
    chosen = [name for name in steps if name in wanted or "measure" in wanted]
    if chosen:
        results = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {}
        results |= {name: steps[name]() for name in chosen}
        RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
        if PAGE.exists() and set(steps) <= set(results):
            write_page(results)
    if "pictures" in wanted:
        pictures(options.samples, tuple(options.views.split(",")), options.keep)


if __name__ == "__main__":
    main()
