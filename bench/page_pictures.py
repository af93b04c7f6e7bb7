"""Pictures of docs/ that no measurement makes: what the pages show of faces.

    .venv/bin/python bench/page_pictures.py five_expressions|beside_principled|people|strain|emotions [--out docs]

`make pictures` runs each; tools/pictures.toml lists all pictures and their makers.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bpy
import PIL.Image
import sanguine_core
from sanguine.app.batch import CONTACT_SHEET, render_batch
from sanguine.blender.controls import set_controls
from sanguine.blender.face import add_face
from sanguine.blender.render import BlenderRenderer, quiet, save_render, set_image
from sanguine.blender.stage import set_stage
from sanguine.domain.facs import EMOTION_CONTROLS, VARIANTS
from sanguine.domain.plan import make_plan
from sanguine.domain.shot import Image, Shot, read_shot, scene_of

ROOT = Path(__file__).resolve().parents[1]
EXAMPLE = ROOT / "examples/five_expressions.toml"

Border = tuple[float, float, float, float]
"""Of the frame, from the left and from below: left, right, bottom, top."""


def five_expressions(out: Path, work: Path) -> None:
    """What `make demo` renders."""
    render_batch(read_shot(EXAMPLE), EXAMPLE, work, BlenderRenderer(), progress=_say)
    (out / "five_expressions.png").write_bytes((work / CONTACT_SHEET).read_bytes())


def beside_principled(out: Path, work: Path) -> None:
    subprocess.run([sys.executable, ROOT / "bench/beside_principled.py", EXAMPLE, work], check=True)
    (out / "beside_principled.png").write_bytes((work / "sheet.png").read_bytes())


# tone, sex, age, seed: as docs/people.md tells them.
PEOPLE = (
    ("monk-2", "female", 24, 3), ("monk-4", "male", 48, 4), ("monk-5", "female", 58, 5),
    ("monk-6", "male", 30, 6), ("monk-8", "female", 41, 8), ("monk-9", "male", 67, 9),
)


def people(out: Path, work: Path) -> None:
    made = []
    for tone, sex, age, seed in PEOPLE:
        person = {"tone": tone, "sex": sex, "age": age, "seed": seed}
        shot = _shot(sex, (256, 320), person=person, quality="draft", expression=[{"id": "rest"}])
        made += _render(shot, work / tone)
    sanguine_core.contact_sheet(made, [], out / "people.png", len(made), 0)


def strain(out: Path, work: Path) -> None:
    """Three faces without and with what the shape does to blood and surface; emotional blood off."""
    poses = [
        {"id": "anger", "emotions": {"anger": 1.0}, "blood": 0.0},
        {"id": "smile", "emotions": {"happy": 1.0}, "blood": 0.0},
        {"id": "brows", "action_units": {"AU1": 1.0, "AU2": 1.0}, "blood": 0.0},
    ]
    made = []
    for strength in (0.0, 1.0):
        shot = _shot("female", (440, 550), expression=poses, effects={"anatomy": 1.0, "strain": strength, "wrinkles": strength})
        made += _render(shot, work / f"{strength:g}", (0.2, 0.8, 0.17, 0.82))
    sanguine_core.contact_sheet(made, [], out / "strain.png", len(poses), 0)


def emotions(out: Path, work: Path) -> None:
    """Every emotion, subtle, full and extreme, on both heads: the shapes alone, in a plain material."""
    made: dict[tuple[str, str, str], Path] = {}
    for head in ("female", "male"):
        with quiet():
            bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
            face = add_face(head, EMOTION_CONTROLS)
            scene = bpy.context.scene
            set_stage(scene, **face.stage_landmarks, size=(264, 330))
            set_image(scene, Image(width=264, height=330), 16)
        _crop((0.16, 0.84, 0.13, 0.81))
        face.skin.data.materials[0].diffuse_color = (0.62, 0.42, 0.33, 1.0)
        _plain(face.skin.data.materials[0])
        for emotion in EMOTION_CONTROLS:
            for variant, value in VARIANTS.items():
                set_controls(face.rig, {name: value if name == emotion else 0.0 for name in EMOTION_CONTROLS})
                made[emotion, head, variant] = work / f"{emotion}_{head}_{variant}.png"
                with quiet():
                    bpy.ops.render.render()
                    save_render(scene, made[emotion, head, variant], "PNG")
            print(f"{head}, {emotion}", file=sys.stderr, flush=True)
    order = [(emotion, head, variant) for emotion in EMOTION_CONTROLS for head in ("female", "male") for variant in VARIANTS]
    captions = [f"{emotion}, {variant}" for emotion, _head, variant in order]
    sanguine_core.contact_sheet([made[key] for key in order], captions, work / "sheet.png", 6, 2)
    PIL.Image.open(work / "sheet.png").convert("RGB").save(out / "emotions.jpg", quality=85)


def _plain(material: bpy.types.Material) -> None:
    if not material.node_tree:
        material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = material.diffuse_color
    shader.inputs["Roughness"].default_value = 0.6


def _shot(head: str, size: tuple[int, int], **tables: Any) -> Shot:
    return Shot.model_validate({"rig": {"head": head}, "image": {"width": size[0], "height": size[1]}, **tables})


def _render(shot: Shot, folder: Path, border: Border | None = None) -> list[Path]:
    """The expressions of a shot of one subject, or what is within `border` of them."""
    folder.mkdir(parents=True, exist_ok=True)
    (subject,) = shot.subjects
    renderer = BlenderRenderer()
    renderer.prepare(shot, subject, make_plan(scene_of(shot, subject, renderer.regions(subject)), shot.chosen_quality.settings), {})
    if border is not None:
        _crop(border)
    made = []
    for pose in shot.expression:
        made.append(folder / f"{pose.id}.png")
        renderer.render(pose, 1, made[-1], made[-1].with_suffix(".exr"))
        print(made[-1].relative_to(folder.parent), file=sys.stderr, flush=True)
    return made


def _crop(border: Border) -> None:
    render = bpy.context.scene.render
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = border


def _say(what: str, done: int, total: int) -> None:
    print(f"{what} {done}/{total}", file=sys.stderr, flush=True)


MAKERS: Mapping[str, Any] = {made.__name__: made for made in (five_expressions, beside_principled, people, strain, emotions)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("picture", choices=MAKERS)
    parser.add_argument("--out", type=Path, default=ROOT / "docs")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as work:
        MAKERS[options.picture](options.out, Path(work))


if __name__ == "__main__":
    main()
