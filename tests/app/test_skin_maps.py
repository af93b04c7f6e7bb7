"""[maps] in a SHOT.toml: read, checked, in the plan and in what a batch calls the same picture."""

import json
import subprocess
import sys

import numpy as np
import pytest
import sanguine_core
from sanguine.app.batch import render_batch
from sanguine.app.map_files import MapHeader, header_attributes
from sanguine.app.planning import plan_report
from sanguine.app.skin_maps import read_face_maps
from sanguine.domain.effects.regions import FACE_REGIONS
from sanguine.domain.errors import InputError
from sanguine.domain.shot import read_shot

SHOT = """
[rig]
head = "female"
[maps]
{maps}
[[expression]]
id = "neutral"
"""
BOTH = 'skin = "maps/chromophores.exr"\nresidual = "maps/residual.exr"'


def write(path, half=True, **channels):
    """An EXR of constant channels, but for `range`s, which run from left to right."""
    columns = [np.broadcast_to(np.linspace(*np.atleast_1d(v)[[0, -1]], 8), (4, 8)) for v in channels.values()]
    path.parent.mkdir(exist_ok=True)
    sanguine_core.write_exr_map(path, np.stack(columns, -1).astype(np.float32), list(channels), {}, half=half)


@pytest.fixture
def folder(tmp_path):
    write(tmp_path / "maps" / "chromophores.exr", hemoglobin=(0.004, 0.05), melanin=(0.01, 0.08), oxygenation=0.7)
    write(tmp_path / "maps" / "residual.exr", R=(0.2, 1.0), G=1.0, B=1.0)
    return tmp_path


def shot(folder, maps=BOTH):
    path = folder / "shot.toml"
    path.write_text(SHOT.format(maps=maps))
    return read_shot(path)


def test_channels_go_to_their_places_with_their_ranges(folder):
    face = read_face_maps(shot(folder).subjects[0].maps)
    image = face.images["skin_map"][1001]
    assert image.shape == (4, 8, 4) and image.dtype == np.float32
    np.testing.assert_allclose(image[0, :, 0], np.linspace(0.004, 0.05, 8), rtol=1e-3)  # hemoglobin, half floats
    np.testing.assert_allclose(image[0, :, 1], np.linspace(0.01, 0.08, 8), rtol=1e-3)
    assert (image[..., 2] == 0.0).all() and np.allclose(image[..., 3], 0.7, rtol=1e-3)
    assert set(face.ranges["skin_map"]) == {"hemoglobin", "melanin", "oxygenation"}
    assert face.ranges["skin_map"]["melanin"] == pytest.approx((0.01, 0.08), rel=1e-3)
    assert face.images["residual"][1001].shape == (4, 8, 3) and face.ranges["residual"] == {}
    assert face.digest and not read_face_maps(shot(folder, "").subjects[0].maps).digest


def test_tiles_of_a_set_share_one_range(folder):
    for tile, melanin in ((1001, 0.02), (1012, 0.3)):
        write(folder / "maps" / f"face.{tile}.exr", melanin=melanin)
    face = read_face_maps(shot(folder, 'skin = "maps/face.<UDIM>.exr"').subjects[0].maps)
    assert sorted(face.images["skin_map"]) == [1001, 1012]
    assert face.ranges["skin_map"]["melanin"] == pytest.approx((0.02, 0.3), rel=1e-3)
    write(folder / "maps" / "face.1013.exr", hemoglobin=0.01)
    with pytest.raises(InputError, match="tiles hold different"):
        read_face_maps(shot(folder, 'skin = "maps/face.<UDIM>.exr"').subjects[0].maps)


def test_the_plan_says_so(folder):
    report = plan_report(shot(folder), FACE_REGIONS)
    effects = {row["id"]: row for row in report["effects"]}
    assert effects["skin_map"]["active"] and "hemoglobin, melanin, oxygenation" in effects["skin_map"]["because"]
    assert effects["residual"]["active"] and effects["residual"]["maps"] == ["residual"]
    assert "oil alone" in effects["anatomy"]["because"]
    melanin = next(axis for axis in report["lut"]["axes"] if axis["id"] == "melanin")
    assert (melanin["low"], melanin["high"]) == pytest.approx((0.01, 0.08), rel=1e-3)
    assert report["shader"]["fragments"].index("skin_map") > report["shader"]["fragments"].index("anatomy")
    off = plan_report(shot(folder, ""), FACE_REGIONS)
    assert {"skin_map", "residual"} <= set(off["skipped"])


class Painter:
    """Renders nothing: a grey picture, and what it was given."""

    version = "none"

    def __init__(self):
        self.given = []

    def regions(self, subject):
        return FACE_REGIONS

    def prepare(self, shot, subject, plan, images):
        self.given.append((plan, images))

    def render(self, pose, frame, png, exr):
        for path in (png, exr):
            sanguine_core.write_image(str(path), np.full((8, 8, 3), 0.5, dtype=np.float32))


def test_a_batch_gives_the_maps_on_and_renders_anew_when_they_change(folder):
    first, second, third = Painter(), Painter(), Painter()
    render_batch(shot(folder), folder / "shot.toml", folder / "out", first)
    plan, images = first.given[0]
    assert set(images) == {"skin_map", "residual"} <= set(plan.maps)
    render_batch(shot(folder), folder / "shot.toml", folder / "out", second, resume=True)
    assert not second.given
    write(folder / "maps" / "residual.exr", R=0.5, G=1.0, B=1.0)
    render_batch(shot(folder), folder / "shot.toml", folder / "out", third, resume=True)
    assert third.given
    row = json.loads((folder / "out" / "manifest.json").read_text())["files"][0]
    assert str(folder) not in json.dumps(row)


@pytest.mark.parametrize(
    ("maps", "words"),
    [
        ('skin = "maps/gone.exr"', ["shot.toml", "maps.skin", "gone.exr", "no such file"]),
        ('residual = "maps/gone.<UDIM>.exr"', ["shot.toml", "maps.residual", "gone.<UDIM>.exr"]),
        ('skinn = "a.exr"', ["shot.toml", "maps.skinn", "did you mean 'skin'"]),
        ("skin = 3", ["shot.toml", "maps.skin"]),
        ('skin = "maps/text.exr"', ["text.exr"]),
        ('skin = "maps/residual.exr"', ["residual.exr", "channels: B, G, R", "hemoglobin"]),
        ('skin = "maps/percent.exr"', ["percent.exr", "melanin", "unit"]),
        ('residual = "maps/chromophores.exr"', ["chromophores.exr", "channel R", "missing"]),
        ('skin = "maps/much.exr"', ["much.exr", "melanin", "0.89", "0 to 0.5"]),
        ('residual = "maps/negative.exr"', ["negative.exr", "-1", "0 to"]),
    ],
    ids=lambda v: None if isinstance(v, list) else v,
)
def test_bad_maps_are_one_line(folder, maps, words):
    (folder / "maps" / "text.exr").write_text("no picture")
    write(folder / "maps" / "much.exr", melanin=0.9)
    write(folder / "maps" / "negative.exr", R=-1.0, G=1.0, B=1.0)
    attributes = header_attributes(["melanin"], MapHeader()) | {"sanguine:units": '{"melanin": "percent"}'}
    sanguine_core.write_exr_map(folder / "maps" / "percent.exr", np.full((2, 2, 1), 0.02, np.float32), ["melanin"], attributes)
    with pytest.raises(InputError) as caught:
        read_face_maps(shot(folder, maps).subjects[0].maps)
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


def test_several_subjects_have_maps_of_their_own(folder):
    subjects = '[[subject]]\nid = "a"\nrig = { head = "female" }\nmaps = { skin = "maps/chromophores.exr" }\n'
    tail = '[[expression]]\nid = "neutral"\n'
    (folder / "shot.toml").write_text(subjects + tail)
    assert read_shot(folder / "shot.toml").subjects[0].maps.skin.endswith("chromophores.exr")
    (folder / "shot.toml").write_text(f'[maps]\nskin = "maps/chromophores.exr"\n{subjects}{tail}')
    with pytest.raises(InputError, match="maps: give them to the"):
        read_shot(folder / "shot.toml")


def test_the_command_line_answers_in_one_line(folder):
    (folder / "shot.toml").write_text(SHOT.format(maps='skin = "maps/gone.exr"'))
    run = subprocess.run([sys.executable, "-m", "sanguine.cli.main", "plan", str(folder / "shot.toml")],
                         capture_output=True, text=True)
    assert run.returncode == 2 and not run.stdout and len(run.stderr.strip().splitlines()) == 1
