"""The batch: whole files or none, a manifest that tells the truth, and resuming that redoes nothing."""

import hashlib
import json
from pathlib import Path

import pytest
import sanguine_core
from sanguine.app.batch import render_batch
from sanguine.domain.effects.regions import FACE_REGIONS
from sanguine.domain.errors import InputError
from sanguine.domain.quality import PRESETS, choice
from sanguine.domain.shot import jobs, pose_of, read_shot

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "five_expressions.toml"


class PaintRenderer:
    """Paints a flat image whose colour is the pose, in the place of Blender."""

    version = "none"

    def __init__(self, die_at=None):
        self.rendered, self.prepared, self.die_at = [], [], die_at

    def regions(self, subject):
        return FACE_REGIONS

    def prepare(self, shot, subject, plan, images):
        self.prepared.append((subject.id, plan))

    def save(self, blend):
        blend.write_bytes(b"scene")

    def render(self, pose, frame, png, exr):
        if len(self.rendered) == self.die_at:
            raise RuntimeError("killed")
        import numpy as np

        value = 0.1 + 0.8 * sum(pose.emotions.values())
        pixels = np.full((8, 8, 3), min(value, 1.0), dtype=np.float32)
        sanguine_core.write_image(str(png), pixels)
        sanguine_core.write_image(str(exr), pixels)
        self.rendered.append(pose)


@pytest.fixture
def shot():
    return read_shot(EXAMPLE)


def manifest(folder):
    return json.loads((folder / "manifest.json").read_text())


def test_five_images_their_linear_twins_and_the_sheet(shot, tmp_path):
    render_batch(shot, EXAMPLE, tmp_path, PaintRenderer())
    names = {path.name for path in tmp_path.iterdir()}
    expected = {f"{e}.{s}" for e in ("anger", "happy", "neutral", "sad", "fear") for s in ("png", "exr")}
    assert names == expected | {"manifest.json", "contact_sheet.png"}
    rows = {row["file"]: row for row in manifest(tmp_path)["files"]}
    assert set(rows) == names - {"manifest.json"}
    for name, row in rows.items():
        assert row["sha256"] == hashlib.sha256((tmp_path / name).read_bytes()).hexdigest()
    assert rows["anger.png"]["parameters"]["pose"]["emotions"] == {"anger": 1.0}
    assert "perfusion" in rows["anger.png"]["effects"] and "perfusion" not in rows["neutral.png"]["effects"]


def test_a_killed_run_resumes_and_redoes_nothing_that_is_whole(shot, tmp_path):
    first = PaintRenderer(die_at=2)
    with pytest.raises(RuntimeError):
        render_batch(shot, EXAMPLE, tmp_path, first)
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")], "temporary files are left"
    second = PaintRenderer()
    render_batch(shot, EXAMPLE, tmp_path, second, resume=True)
    assert len(second.rendered) == 3
    third = PaintRenderer()
    render_batch(shot, EXAMPLE, tmp_path, third, resume=True)
    assert third.rendered == [] and third.prepared == []


def test_resume_renders_again_what_was_damaged_or_has_changed(shot, tmp_path):
    render_batch(shot, EXAMPLE, tmp_path, PaintRenderer())
    (tmp_path / "sad.png").write_bytes(b"torn")
    again = PaintRenderer()
    render_batch(shot, EXAMPLE, tmp_path, again, resume=True)
    assert len(again.rendered) == 1 and again.rendered[0].emotions == {"sad": 1.0}
    redder = shot.model_copy(update={"skin": dict(shot.skin) | {"hemoglobin": 0.02}})
    everything = PaintRenderer()
    render_batch(redder, EXAMPLE, tmp_path, everything, resume=True)
    assert len(everything.rendered) == 5


def test_only_renders_some_and_keeps_the_others_in_the_manifest(shot, tmp_path):
    render_batch(shot, EXAMPLE, tmp_path, PaintRenderer(), only=["anger"])
    some = PaintRenderer()
    render_batch(shot, EXAMPLE, tmp_path, some, only=["fear"])
    assert len(some.rendered) == 1
    assert {row["file"] for row in manifest(tmp_path)["files"]} == {"anger.png", "anger.exr", "fear.png", "fear.exr"}
    # The plan is the whole shot's: a frame rendered alone equals the same frame in sequence.
    whole = PaintRenderer()
    render_batch(shot, EXAMPLE, tmp_path / "whole", whole)
    assert some.prepared[0][1].axes == whole.prepared[0][1].axes


def test_a_foreign_manifest_is_refused(shot, tmp_path):
    (tmp_path / "manifest.json").write_text('{"files": 3}')
    with pytest.raises(InputError, match="manifest"):
        render_batch(shot, EXAMPLE, tmp_path, PaintRenderer(), resume=True)


def test_timeline_and_subjects(tmp_path):
    path = tmp_path / "shot.toml"
    path.write_text(
        """
        [[subject]]
        id = "ann"
        rig = { head = "female" }
        [[subject]]
        id = "bob"
        rig = { head = "male" }
        skin = { melanin = 0.1 }
        [timeline]
        fps = 1  # blood takes seconds
        first = 1
        last = 9
        step = 4
        [[timeline.key]]
        frame = 1
        [[timeline.key]]
        frame = 9
        emotions = { anger = 1.0 }
        """
    )
    shot = read_shot(path)
    assert [job.id for job in jobs(shot)] == [f"{s}_{f:06d}" for s in ("ann", "bob") for f in (1, 5, 9)]
    middle = next(job for job in jobs(shot) if job.frame == 5)
    assert pose_of(shot, middle).emotions == {"anger": pytest.approx(0.5)}
    renderer = PaintRenderer()
    render_batch(shot, path, tmp_path / "out", renderer)
    assert [name for name, _ in renderer.prepared] == ["ann", "bob"]
    assert renderer.prepared[0][1].decisions["perfusion"].frames == ("ann_000005", "ann_000009")


def test_quality_reaches_the_plan_and_the_manifest_and_another_one_renders_anew(shot, tmp_path):
    first = PaintRenderer()
    render_batch(shot, EXAMPLE, tmp_path, first, quality=choice("draft", None))
    assert first.prepared[0][1].settings == PRESETS["draft"].settings
    rows = [row for row in manifest(tmp_path)["files"] if row["file"] == "anger.png"]
    assert rows[0]["parameters"]["quality"] == PRESETS["draft"].settings.model_dump()
    again, other = PaintRenderer(), PaintRenderer()
    render_batch(shot, EXAMPLE, tmp_path, again, resume=True, quality=choice("draft", None))
    assert not again.rendered
    render_batch(shot, EXAMPLE, tmp_path, other, resume=True, quality=choice("reference", None))
    assert len(other.rendered) == 5


def test_thousands_of_images_survive_a_kill(tmp_path):
    """Rows go to a journal, not into the whole manifest each time, and a torn last line loses one image."""
    from sanguine.app.manifest import Manifest, finished

    names = [f"{i:06d}.png" for i in range(1000)]
    for name in names:
        (tmp_path / name).write_bytes(name.encode())
    rows = {name: {"file": name, "sha256": hashlib.sha256(name.encode()).hexdigest()} for name in names}
    run = Manifest(tmp_path, "shot.toml", {})
    run.__enter__()  # and never left: killed
    for name in names:
        run.add({name: rows[name]})
    assert len(manifest(tmp_path)["files"]) < 1000
    assert finished(tmp_path) == rows
    journal = tmp_path / "manifest.journal"
    journal.write_text(journal.read_text()[:-10])
    assert finished(tmp_path) == {name: rows[name] for name in names[:-1]}
    with Manifest(tmp_path, "shot.toml", finished(tmp_path)):
        pass
    assert not journal.exists() and len(manifest(tmp_path)["files"]) == 999
