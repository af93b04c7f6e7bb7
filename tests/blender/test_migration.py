"""A file of an older Sanguine opens, renders, is brought up to date and taken off; one of a newer is left alone."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from sanguine.blender import migration
from sanguine.blender.skin import VERSION
from sanguine.domain.errors import InputError
from sanguine.domain.migration import SCHEMA, Step
from support.inventory import inventory
from support.patch import render_linear
from tests.blender.test_addon import draw, grid

OLD = Path(__file__).resolve().parents[1] / "data" / "version_1.blend"
SINGLE = OLD.with_name("version_2.blend")


pytestmark = pytest.mark.usefixtures("addon")


@pytest.fixture
def old():
    bpy.ops.wm.open_mainfile(filepath=str(OLD))
    face = bpy.data.objects["face"]
    bpy.context.view_layer.objects.active = face
    return face


def test_an_old_file_keeps_its_settings_its_look_and_its_animation(old):
    scene = bpy.context.scene
    assert VERSION not in old and old.sanguine.melanin == pytest.approx(0.1) and old.sanguine.quality == "draft"
    scene.frame_set(10)
    before = render_linear()
    assert before.std() > 0.001
    assert bpy.ops.sanguine.apply_skin() == {"FINISHED"}
    assert old[VERSION] == SCHEMA
    settings = old.sanguine
    assert [settings.melanin, settings.oil, settings.strength_anatomy] == pytest.approx([0.1, 0.2, 0.5])
    bpy.context.view_layer.update()
    assert old["blood_hemoglobin_cheeks"] > 0.001, "anger is keyed at frame 10"
    after = render_linear()
    # 4 samples of a sampler that sees another shader: the same colour, not the same noise. Draft quality has since got
    # more lobes and smaller maps, which moves light about, not its sum.
    np.testing.assert_allclose(after.mean((0, 1)), before.mean((0, 1)), rtol=0.03)
    scene.frame_set(1)
    assert np.abs(render_linear().mean((0, 1)) - after.mean((0, 1))).max() > 0.001


def test_an_old_skin_comes_off_with_its_rig(old):
    for again in (False, True):
        if again:
            bpy.ops.wm.open_mainfile(filepath=str(OLD))
            bpy.context.view_layer.objects.active = bpy.data.objects["face"]
            bpy.ops.sanguine.apply_skin()
        assert bpy.ops.sanguine.remove_skin() == {"FINISHED"}
        face = bpy.data.objects["face"]
        assert set(face.keys()) <= {"sanguine"}  # Blender's own place of the settings
        assert not bpy.data.armatures and not bpy.data.materials and not bpy.data.images and not bpy.data.texts
        assert face.data.shape_keys.animation_data is None and face.sanguine.melanin == pytest.approx(0.1)


def test_a_skin_that_reads_every_number_by_itself_does_so_until_it_is_applied_again():
    """Whatever is done to the face meanwhile: bring it up to date, bake, drive its blood anew."""
    bpy.ops.wm.open_mainfile(filepath=str(SINGLE))
    scene, face = bpy.context.scene, bpy.data.objects["face"]
    bpy.context.view_layer.objects.active = face
    rest, angry = shown(1), shown(10)
    assert face["blood_hemoglobin_cheeks"] > 0.001 and np.abs(np.array(face["strain_0_left"])).max() > 0.01
    assert len(face["strain_0_left"]) == 4 and np.abs(angry - rest).max() > 0.005, "anger shows"
    assert "three numbers" in " ".join(migration.bring_up_to_date(face))
    assert bpy.ops.sanguine.add_feeling(feeling="shame") == bpy.ops.sanguine.remove_feeling(feeling="shame") == {"FINISHED"}
    scene.frame_end = 10
    assert bpy.ops.sanguine.bake_blood() == bpy.ops.sanguine.clear_blood() == {"FINISHED"}
    np.testing.assert_allclose(shown(10), angry, atol=1e-6)  # rounding alone
    names = set(face.keys())
    assert not [name for name in names if "packed" in name]
    assert bpy.ops.sanguine.apply_skin() == {"FINISHED"}
    assert len(face["strain_0_left"]) == 3 and names < set(face.keys())
    # Another order of sums; the maps are drawn anew.
    np.testing.assert_allclose(shown(10).mean((0, 1)), angry.mean((0, 1)), rtol=0.01)
    np.testing.assert_allclose(shown(1).mean((0, 1)), rest.mean((0, 1)), rtol=0.01)
    assert bpy.ops.sanguine.remove_skin() == {"FINISHED"}
    assert not [name for name in face.keys() if name.startswith(("blood_", "strain_"))] and face.animation_data is None


def shown(frame):
    bpy.context.scene.frame_set(frame)
    return render_linear()


def test_names_and_units_of_settings_that_are_no_more(old, monkeypatch):
    """As if today's melanin had been called eumelanin, in percent, and the default of oil had been another."""
    raw = migration._raw_settings(old)
    raw["eumelanin"] = 12.0
    del raw["melanin"], raw["oil"]
    steps = (Step(2, renamed={"eumelanin": "melanin"}, factors={"melanin": 0.01}, untouched={"oil": 0.45}, note="in fractions"),)
    true = migration.migrate
    monkeypatch.setattr(migration, "migrate", lambda values, version: true(values, version, steps))
    assert migration.bring_up_to_date(old)[0].startswith("face comes from an older Sanguine")
    assert old.sanguine.melanin == pytest.approx(0.12) and old.sanguine.oil == pytest.approx(0.45)
    assert old.sanguine.quality == "draft" and "eumelanin" not in dict(migration._raw_settings(old))
    assert migration.bring_up_to_date(old) == []


def test_a_face_of_today_and_one_without_skin_are_left_alone():
    face = grid()
    face.sanguine.quality = "draft"
    assert migration.bring_up_to_date(face) == [] and VERSION not in face
    bpy.ops.sanguine.apply_skin()
    assert face[VERSION] == SCHEMA and migration.bring_up_to_date(face) == []
    bpy.ops.sanguine.remove_skin()
    assert VERSION not in face


def test_a_newer_file_is_left_alone(tmp_path):
    from sanguine.blender.panels import SANGUINE_PT_main
    from sanguine.blender.scene_file import SceneFile
    from sanguine.blender.skin import apply_skin

    face = grid()
    face.sanguine.quality = "draft"
    bpy.ops.sanguine.apply_skin()
    face[VERSION] = SCHEMA + 1
    before = inventory()
    for name in ("apply_skin", "remove_skin", "add_feeling", "bake_blood", "read_picture", "draw_person", "add_poses"):
        with pytest.raises(RuntimeError, match="newer Sanguine") as error:
            getattr(bpy.ops.sanguine, name)()
        assert "Traceback" not in str(error.value)
    with pytest.raises(InputError, match="newer Sanguine"):
        apply_skin(face, face.parent, None)
    assert inventory() == before
    assert any("newer Sanguine" in line for line in draw(SANGUINE_PT_main))
    path = str(tmp_path / "newer.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    for act in (SceneFile.stale, SceneFile.bake):
        with pytest.raises(InputError, match="newer.blend: Grid: made by a newer Sanguine"):
            act(SceneFile(path))
