"""Muscle and blood of one shot over time, as pictures and as curves: docs/emotion_in_time.png and the page's numbers.

    python bench/emotion_in_time.py [--every 6] [--size 200x250] [--samples 16] [--frames DIR] | --alone

Renders examples/emotion_in_time.toml twice through `render_batch`: as it is, and with `blood` at 0, so that what the
blood does can be told from what the muscles and the light do. Colours are measured in the linear EXR files, at places
of the skin that move with it. --every 1 renders all 144 frames; frames that are there already are kept (--frames).
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import bpy
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import sanguine_core
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
from PIL import Image
from sanguine.app.batch import blood_words, render_batch
from sanguine.blender.render import BlenderRenderer, quiet
from sanguine.domain.blood import ANATOMY, Rest
from sanguine.domain.facs import unit_values
from sanguine.domain.parameters import skin_rows
from sanguine.domain.shot import Performance, Shot, Timeline, performance, pose_at, read_shot
from sanguine.domain.vascular import Controls, blood_over_time

SHOT = Path(__file__).parents[1] / "examples/emotion_in_time.toml"
REGIONS = ("cheeks", "nose", "forehead", "lips")
COLOURS = {"cheeks": "#c8443c", "nose": "#2f6fb0", "forehead": "#c48a12", "lips": "#7d4a9e"}
UNITS = {
    "4": ("brow lowerer", "#333333"),
    "5": ("upper lid raiser", "#2f6fb0"),
    "20": ("lip stretcher", "#3a8f4d"),
    "24": ("lip pressor", "#b36a1c"),
    "64": ("eyes down", "#7d4a9e"),
}
NM = np.arange(380.0, 781.0, 5.0)
# Of the picture, from the left and from above: the head, for the strip.
HEAD = (0.205, 0.815, 0.13, 0.86)
STRIP_S = 0.5
# How long the muscles of the shot take; the same as in its file.
ONSETS_S = {"anger": 6 / 24, "fear": 5 / 24, "shame": 11 / 24}
# A vertex is measured where its region holds it almost alone and it is turned to the camera.
LEAST_WEIGHT, LEAST_FACING = 0.75, 0.5
AFTERWARDS_S = 180.0
# The scale of the pictures of what blood does: a* from -to to it.
SPAN = 6.0


@dataclass
class Curve:
    """a* of a region over the frames. weight: mean of its mask where it is measured.

    predicted: by the optics, of every frame of the timeline; measured and still: of the pictures, the latter without blood.
    """

    weight: float
    predicted: np.ndarray
    measured: np.ndarray
    still: np.ndarray


def with_blood(shot: Shot, last: int | None = None, **values: float) -> Shot:
    """The same shot with another `blood` or `blood_pace` all the time, or a later end."""
    keys = [key.model_copy(update=values) for key in shot.timeline.sorted_keys]
    timeline = Timeline.model_construct(**{**dict(shot.timeline), "key": keys, "last": last or shot.timeline.last})
    return shot.model_copy(update={"timeline": timeline})


def seconds(shot: Shot, frames: np.ndarray | list[int] | int) -> np.ndarray:
    return np.asarray(frames) / shot.timeline.fps


def predicted_lab(shot: Shot, played: Performance, region: str, weight: float) -> np.ndarray:
    """Lab of the skin of a region, frame by frame, where its mask is `weight`: by the optics alone."""
    rest, skin = ANATOMY.get(region, Rest()), shot.subjects[0].whole_skin()
    anatomy = weight * shot.subjects[0].strengths(shot.effects)["anatomy"]
    none = np.zeros(len(played.frames))
    more = {q: weight * played.changes.get((region, q), none) for q in ("hemoglobin", "oxygenation")}
    base = {
        **skin,
        "hemoglobin": skin["hemoglobin"] * (1.0 + anatomy * (rest.hemoglobin - 1.0)),
        "melanin": skin["melanin"] * (1.0 + anatomy * (rest.melanin - 1.0)),
        "oxygenation": skin["oxygenation"] + anatomy * rest.oxygenation,
    }
    rows = skin_rows([
        {**base, "hemoglobin": base["hemoglobin"] + h, "oxygenation": min(base["oxygenation"] + o, 1.0)}
        for h, o in zip(more["hemoglobin"], more["oxygenation"], strict=True)
    ])
    return sanguine_core.lab(sanguine_core.xyz(sanguine_core.reflectance(rows, NM), NM))


def pixels(path: Path) -> np.ndarray:
    """(H, W, 3) linear Rec.709, row 0 on top."""
    image = bpy.data.images.load(str(path))
    held = np.empty(image.size[0] * image.size[1] * 4, dtype=np.float32)
    image.pixels.foreach_get(held)
    width, height = image.size
    bpy.data.images.remove(image)
    return held.reshape(height, width, 4)[::-1, :, :3].astype(np.float64)


# Rows: XYZ (Y of white is 100) of linear Rec.709 red, green and blue.
_XYZ = np.linalg.inv(sanguine_core.linear_rgb(np.eye(3)))


def lab(rgb: np.ndarray) -> np.ndarray:
    return sanguine_core.lab(np.ascontiguousarray(rgb.reshape(-1, 3) @ _XYZ)).reshape(rgb.shape)


def linear(of_lab: np.ndarray) -> np.ndarray:
    """Linear Rec.709 of one Lab: by Newton, for the scale of the pictures."""
    rgb = np.full(3, 0.3)
    for _ in range(30):
        steps = np.eye(3) * 1e-5
        slope = np.stack([(lab(rgb + step) - lab(rgb - step)) / 2e-5 for step in steps], axis=1)
        rgb = np.maximum(rgb + np.linalg.solve(slope, of_lab - lab(rgb)), 1e-3)
    return rgb


class Places:
    """Where the camera sees the vertices of each region at a frame, in the scene that a batch kept."""

    def __init__(self, blend: Path) -> None:
        with quiet():
            bpy.ops.wm.open_mainfile(filepath=str(blend))
        self.scene = bpy.context.scene
        self.skin = next(o for o in bpy.data.objects if o.type == "MESH" and "sanguine_cheeks" in o.vertex_groups)
        for obj in bpy.data.objects:
            for modifier in obj.modifiers:
                if modifier.type == "SUBSURF":
                    modifier.show_viewport = False
        self.weights = {region: self._weights(region) for region in REGIONS}

    def _weights(self, region: str) -> np.ndarray:
        index = self.skin.vertex_groups[f"sanguine_{region}"].index
        return np.array([
            next((g.weight for g in vertex.groups if g.group == index), 0.0) for vertex in self.skin.data.vertices
        ])

    def weight(self, region: str) -> float:
        held = self.weights[region]
        return float(held[held > LEAST_WEIGHT].mean())

    def at(self, frame: int, region: str) -> np.ndarray:
        """(n, 2): x and y of pixels, from the left and from above, each once."""
        self.scene.frame_set(frame)
        graph = bpy.context.view_layer.depsgraph
        camera, face = self.scene.camera, self.skin.evaluated_get(graph)
        mesh, matrix, eye = face.data, face.matrix_world, self.scene.camera.matrix_world.translation
        render = self.scene.render
        seen = set()
        for i in np.nonzero(self.weights[region] > LEAST_WEIGHT)[0]:
            place = matrix @ mesh.vertices[i].co
            toward = (eye - place).normalized()
            if (matrix.to_3x3() @ mesh.vertices[i].normal).normalized().dot(toward) < LEAST_FACING:
                continue
            hit, where, *_ = self.scene.ray_cast(graph, eye, -toward)
            if hit and (where - place).length > 0.003:  # something of the face stands before it
                continue
            at = world_to_camera_view(self.scene, camera, Vector(place))
            seen.add((int(at.x * render.resolution_x), int((1.0 - at.y) * render.resolution_y)))
        return np.array(sorted(seen))


def measure(folder: Path, shot: Shot, frames: list[int]) -> dict[str, Curve]:
    """Every region over the rendered frames."""
    places, played = Places(folder / "asked/subject.blend"), performance(shot)
    curves = {}
    for region in REGIONS:
        weight = places.weight(region)
        predicted = predicted_lab(shot, played, region, weight)
        series = {"asked": [], "still": []}
        for frame in frames:
            x, y = places.at(frame, region).T
            for name, values in series.items():
                values.append(pixels(folder / name / f"{frame:06d}.exr")[y, x].mean(axis=0))
        # The light and the exposure are not in the optics: the first frame, at rest, is taken to be what they predict.
        scale = linear(predicted[0]) / series["asked"][0]
        asked, still = (lab(np.array(values) * scale)[:, 1] for values in series.values())
        curves[region] = Curve(weight, predicted[:, 1], asked, still)
    return curves


def blood_pictures(folder: Path, frames: list[int], scale: np.ndarray) -> list[np.ndarray]:
    """What blood does to a* of each pixel, in each frame: with blood less without, of the same muscles and noise."""
    made = []
    for frame in frames:
        one, other = (lab(pixels(folder / name / f"{frame:06d}.exr") * scale)[..., 1] for name in ("asked", "still"))
        made.append(one - other)
    return made


def half_times(shot: Shot) -> dict[tuple[str, str], float]:
    """(emotion, region) -> seconds from the muscles' half to the blood's, of an emotion that comes as in the shot and
    stays, at life's own pace."""
    found = {}
    for name, onset_s in ONSETS_S.items():
        t = np.arange(0.0, 120.0, 1.0 / shot.timeline.fps)
        changes = blood_over_time(Controls(t, {name: np.clip(t / onset_s, 0.0, 1.0)}), shot.blood_model)
        for region in REGIONS:
            series = changes.get((region, "hemoglobin"))
            if series is not None and np.any(series):
                found[name, region] = float(np.interp(0.5, series / series[-1], t)) - 0.5 * onset_s
    return found


def courses(shot: Shot) -> list[str]:
    """Per region: the most that the shot brings, and how it goes once the face is at rest."""
    end = seconds(shot, [shot.timeline.last])[0]
    long = performance(with_blood(shot, last=int((end + AFTERWARDS_S) * shot.timeline.fps)))
    t = seconds(shot, long.frames)
    rested = seconds(shot, [max(key.frame for key in shot.timeline.key)])[0]
    found = []
    for region in REGIONS:
        rest = shot.subjects[0].whole_skin()["hemoglobin"] * ANATOMY.get(region, Rest()).hemoglobin
        change = 100.0 * long.changes[region, "hemoglobin"] / rest
        low, high = (int(pick(np.where(t <= end, change, 0.0))) for pick in (np.argmin, np.argmax))
        # What the delays still hold back may come after the face is at rest: decay counts from its largest.
        after = np.where(t >= rested, np.abs(change), 0.0)
        top = int(np.argmax(after))
        below = np.nonzero(after[top:] < 0.5 * after[top])[0]
        half = f"{t[top + below[0]] - t[top]:.0f} s" if len(below) else f"more than {AFTERWARDS_S:.0f} s"
        found.append("| " + " | ".join([
            region,
            *(f"{change[i]:+.0f} % at {t[i]:.1f} s" if abs(change[i]) >= 0.5 else "none" for i in (high, low)),
            f"{np.interp(rested, t, change):+.0f} %", f"{change[top]:+.0f} % at {t[top]:.1f} s", half,
        ]) + " |")
    return found


def report(shot: Shot, frames: list[int], curves: dict[str, Curve]) -> list[str]:
    told = blood_words(pose_at(shot.timeline, shot.timeline.last))
    natural = with_blood(shot, blood=1.0, blood_pace=1.0)
    lags = half_times(shot)
    lines = [
        "Half of the blood's settled answer, after half of the muscles', where the emotion stays, at life's pace:", "",
        "| region | " + " | ".join(ONSETS_S) + " |", "|---|" + "---|" * len(ONSETS_S),
    ]
    for region in REGIONS:
        cells = [f"{lags[name, region]:.1f} s" if (name, region) in lags else "no answer" for name in ONSETS_S]
        lines.append(f"| {region} | " + " | ".join(cells) + " |")
    for title, one in ((f"Hemoglobin in the shot ({told}), in percent of the region's at rest:", shot),
                       ("The same shot with blood as in life:", natural)):
        lines += ["", title, "",
                  "| region | most | least | when the muscles are at rest | most from then on | half of that gone after |",
                  "|---|---|---|---|---|---|", *courses(one)]
    lines += ["", "a* of the skin, from rest, as the optics predict it of the blood and as the pictures show it:", "",
              "| region | largest by blood, optics | pictures | correlation | root mean square of the difference | "
              "largest by muscles and light, pictures | largest by blood as in life, optics |", "|---|---|---|---|---|---|---|"]
    at = np.array(frames) - int(performance(shot).frames[0])
    for region, curve in curves.items():
        predicted = (curve.predicted - curve.predicted[0])[at]
        found = curve.measured - curve.still
        muscles = curve.still - curve.still[0]
        life = predicted_lab(shot, performance(natural), region, curve.weight)[:, 1]
        lines.append("| " + " | ".join([
            region, *(f"{_largest(series):+.2f}" for series in (predicted, found)),
            f"{np.corrcoef(predicted, found)[0, 1]:.3f}", f"{np.sqrt(np.mean((predicted - found) ** 2)):.2f}",
            *(f"{_largest(series):+.2f}" for series in (muscles, life - life[0])),
        ]) + " |")
    lines += ["", f"{len(frames)} frames of {shot.image.width} x {shot.image.height}, {shot.image.samples} samples, "
              f"Blender {bpy.app.version_string}."]
    return lines


def _largest(series: np.ndarray) -> float:
    return float(series[np.argmax(np.abs(series))])


def draw(folder: Path, shot: Shot, frames: list[int], curves: dict[str, Curve], out: Path) -> None:
    """A strip of the faces, under it what blood does to them, and under each face the moment of the curves."""
    played, natural = performance(shot), performance(with_blood(shot, blood=1.0, blood_pace=1.0))
    t, all_t = seconds(shot, frames), seconds(shot, played.frames)
    end = seconds(shot, [shot.timeline.last])[0]
    told = blood_words(pose_at(shot.timeline, shot.timeline.last))
    strip = [frames[int(np.argmin(np.abs(t - s)))] for s in np.arange(0.0, end + 0.5 * STRIP_S, STRIP_S)]
    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    figure = plt.figure(figsize=(18.0, 10.6), dpi=100)
    left, right = 0.045, 0.875
    step = (right - left) / len(strip)
    _draw_strip(figure, folder, shot, strip, (left, right, step), told)
    panel = {}
    for name, bottom, height in (("muscle", 0.45, 0.14), ("blood", 0.255, 0.165), ("skin", 0.05, 0.175)):
        panel[name] = axes = figure.add_axes((left, bottom, right - left, height))
        # The middle of a picture of second s stands over s.
        axes.set_xlim(-0.5 * STRIP_S, STRIP_S * (len(strip) - 0.5))
        axes.set_xticks(np.arange(0.0, end + 0.1, STRIP_S))
        axes.grid(alpha=0.25, linewidth=0.5)
    poses = [unit_values({name: series[i] for name, series in played.controls.items()}) for i in range(len(all_t))]
    for (unit, (name, colour)) in UNITS.items():
        series = [max(pose.get(side, 0.0) for side in (unit, f"{unit}L", f"{unit}R")) for pose in poses]
        panel["muscle"].plot(all_t, series, color=colour, label=f"{unit} {name}")
    none = np.zeros_like(all_t)
    for region, curve in curves.items():
        colour = COLOURS[region]
        rest = shot.subjects[0].whole_skin()["hemoglobin"] * ANATOMY.get(region, Rest()).hemoglobin
        for one, style in ((natural, ":"), (played, "-")):
            change = 100.0 * one.changes.get((region, "hemoglobin"), none) / rest
            panel["blood"].plot(all_t, change, style, color=colour, label=region if style == "-" else None)
        panel["skin"].plot(all_t, curve.predicted - curve.predicted[0], color=colour, label=f"{region}, optics")
        panel["skin"].plot(t, curve.measured - curve.still, "o", color=colour, markersize=4, label=f"{region}, pictures")
    cheek = curves["cheeks"]
    life = predicted_lab(shot, natural, "cheeks", cheek.weight)[:, 1]
    panel["blood"].plot([], [], ":", color="black", label="as in life")
    panel["skin"].plot(all_t, life - life[0], ":", color=COLOURS["cheeks"], label="cheeks, optics, as in life")
    label = "cheeks, muscles and light"
    panel["skin"].plot(t, cheek.still - cheek.still[0], "x", color="#888888", markersize=4, label=label)
    for name, unit in (("muscle", "action units, 0 to 1"), ("blood", "hemoglobin, % from rest"), ("skin", "a* from rest")):
        panel[name].set_ylabel(f"{name}\n{unit}")
        panel[name].legend(loc="center left", bbox_to_anchor=(1.005, 0.5), frameon=False, fontsize=8)
    panel["skin"].set_xlabel("seconds")
    figure.savefig(out, facecolor="white")
    plt.close(figure)
    shrink(out)


def _draw_strip(
    figure: plt.Figure, folder: Path, shot: Shot, strip: list[int], across: tuple[float, float, float], told: str
) -> None:
    left, right, step = across
    x0, x1, y0, y1 = HEAD
    played = performance(shot)
    x, y = Places(folder / "asked/subject.blend").at(strip[0], "cheeks").T
    lit = pixels(folder / f"asked/{strip[0]:06d}.exr")[y, x].mean(axis=0)
    change = blood_pictures(folder, strip, linear(predicted_lab(shot, played, "cheeks", 1.0)[0]) / lit)
    for row, bottom in enumerate((0.805, 0.63)):
        for i, frame in enumerate(strip):
            axes = figure.add_axes((left + i * step, bottom, step * 0.985, 0.17))
            if row == 0:
                image = plt.imread(folder / f"asked/{frame:06d}.png")[..., :3]
                axes.set_title(f"{seconds(shot, frame):.1f} s  {_asked(shot, frame)}", fontsize=9, pad=3)
            else:
                image = change[i]
            h, w = image.shape[:2]
            image = image[int(y0 * h) : int(y1 * h), int(x0 * w) : int(x1 * w)]
            shown = axes.imshow(image, **({} if row == 0 else {"cmap": "RdBu_r", "vmin": -SPAN, "vmax": SPAN}))
            axes.set_axis_off()
    bar = figure.colorbar(shown, cax=figure.add_axes((right + 0.008, 0.645, 0.006, 0.14)))
    bar.set_label("a* by blood alone")
    figure.text(right + 0.008, 0.89, f"blood: {told}", va="center", weight="bold")


def shrink(path: Path) -> None:
    """256 colours, which a page's picture may weigh; they are chosen by the faces, whose colour is what it shows."""
    image = Image.open(path).convert("RGB")
    width, height = image.size
    faces = image.crop((0, 0, width, height // 5))
    chosen = Image.new("RGB", (width, height // 5 + height // 8))
    chosen.paste(faces)
    chosen.paste(image.resize((width, height // 8)), (0, height // 5))
    palette = chosen.quantize(255, method=Image.Quantize.MAXCOVERAGE)
    palette.putpalette([*palette.getpalette()[: 3 * 255], 255, 255, 255])  # the paper
    image.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG).save(path, optimize=True)


def _asked(shot: Shot, frame: int) -> str:
    """What the sliders say at a frame, in a word."""
    now = pose_at(shot.timeline, frame).emotions
    strong = [name for name, value in now.items() if value > 0.15]
    return " to ".join(strong) or "neutral"


def write(page: Path, mark: str, lines: list[str]) -> None:
    head, rest = page.read_text(encoding="utf-8").split(f"<!-- {mark} -->")
    tail = rest.split(f"<!-- /{mark} -->")[1]
    page.write_text(f"{head}<!-- {mark} -->\n" + "\n".join(lines) + f"\n<!-- /{mark} -->{tail}", encoding="utf-8")


def render(shot: Shot, frames: list[int], folder: Path) -> None:
    def progress(what: str, done: int, total: int) -> None:
        print(folder.name, what, f"{done}/{total}", file=sys.stderr, flush=True)

    ids = [f"{frame:06d}" for frame in frames]
    render_batch(shot, SHOT, folder, BlenderRenderer(), only=ids, resume=True, progress=progress, keep_blend=True)


# In a process of their own: a frame through us, and one of a file through Blender alone.
_BY_US = """
import sys
sys.path.insert(0, sys.argv[1])
import emotion_in_time as bench
bench.render(bench.read_shot(bench.SHOT), [int(sys.argv[3])], bench.Path(sys.argv[2]))
"""
_BY_BLENDER = """
import sys
sys.modules["sanguine"] = sys.modules["sanguine_core"] = None
import bpy
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
scene = bpy.context.scene
scene.frame_set(int(sys.argv[3]))
bpy.ops.render.render()
settings = scene.render.image_settings
settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
bpy.data.images["Render Result"].save_render(sys.argv[2], scene=scene)
"""


def alone(folder: Path, frame: int = 120) -> list[str]:
    """The same frame of the example as it is: at the end of four in a row, alone, and by Blender without us."""
    shot = read_shot(SHOT)
    row = list(range(frame - 18, frame + 1, 6))
    render(shot, row, folder / "row")
    plain = folder / "plain.exr"
    for script, *paths in ((_BY_US, Path(__file__).parent, folder / "one"), (_BY_BLENDER, folder / "row/subject.blend", plain)):
        command = [sys.executable, "-c", script, *map(str, paths), str(frame)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    wanted = pixels(folder / f"row/{frame:06d}.exr")
    before = ", ".join(map(str, row[:-1]))
    lines = [f"| beside frame {frame} rendered after {before} in one process | pixels that differ | of |", "|---|---|---|"]
    for label, path in (("alone, in a process of its own", folder / f"one/{frame:06d}.exr"),
                        ("by plain Blender from the .blend, our modules blocked", plain)):
        differ = (pixels(path) != wanted).any(axis=-1)
        lines.append(f"| {label} | {differ.sum()} | {differ.size} |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--every", type=int, default=6, help="render every n-th frame, the first and the last")
    parser.add_argument("--size", default="200x250")
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--frames", type=Path, help="folder of the frames, which are kept and not rendered twice")
    parser.add_argument("--alone", action="store_true", help="only render frame 120 in three ways, and compare")
    parser.add_argument("--out", type=Path, default=Path("docs"))
    options = parser.parse_args()
    page = options.out / "emotion_in_time.md"
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.frames or Path(scratch)
        if options.alone:
            mark, lines = "alone", alone(folder)
        else:
            mark, lines = "numbers", pictures(folder, options)
    print("\n".join(lines))
    if page.exists():
        write(page, mark, lines)


def pictures(folder: Path, options: argparse.Namespace) -> list[str]:
    """Renders, measures and draws. Returns the page's tables."""
    shot = read_shot(SHOT)
    width, height = map(int, options.size.split("x"))
    image = shot.image.model_copy(update={"width": width, "height": height, "samples": options.samples})
    shot = shot.model_copy(update={"image": image})
    first, last = shot.timeline.first, shot.timeline.last
    frames = sorted({first, *(f for f in range(first, last + 1) if f % options.every == 0), last})
    render(shot, frames, folder / "asked")
    render(with_blood(shot, blood=0.0), frames, folder / "still")
    curves = measure(folder, shot, frames)
    draw(folder, shot, frames, curves, options.out / "emotion_in_time.png")
    return report(shot, frames, curves)


if __name__ == "__main__":
    main()
