"""The animator's buttons: emotions on demand, Bake Blood, poses, each with undo, each saying what is missing."""

import bpy
import numpy as np
import pytest

import sanguine
from sanguine.blender import controls, panels
from sanguine.blender.bake import RECORD
from sanguine.blender.curves import curves
from sanguine.blender.operators import emotion_bone, live_plan
from tests.blender.layouts import Layout, draw
from tests.blender.test_addon import grid


@pytest.fixture
def face():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    sanguine.register()
    made = grid()
    made.sanguine.quality = "draft"
    yield made
    sanguine.unregister()


def slider(face, name):
    return f'pose.bones["{controls.CONTROL_BONE}"]["{name}"]'


def key(face, name, **values):
    bone = emotion_bone(face)
    for frame, value in values.items():
        bone[name] = value
        bone.keyframe_insert(f'["{name}"]', frame=int(frame[1:]))


def test_nothing_can_be_done_before_the_skin(face):
    for operator in ("add_feeling", "remove_feeling", "bake_blood", "add_poses"):
        with pytest.raises(RuntimeError, match="no controls yet: apply the skin first"):
            getattr(bpy.ops.sanguine, operator)()
    with pytest.raises(RuntimeError, match="No blood is baked"):
        bpy.ops.sanguine.clear_blood()


def test_an_emotion_is_on_the_rig_when_asked_for_and_costs_nothing_before(face):
    bpy.ops.sanguine.apply_skin()
    rig, before = face.parent, dict(face.items())
    fragments = live_plan(face).fragments
    assert "shame" not in emotion_bone(face)
    assert bpy.ops.sanguine.add_feeling(feeling="hypoxia") == {"FINISHED"}
    assert "hypoxia" in emotion_bone(face)
    assert "blood_oxygenation_elsewhere" not in before
    assert bpy.ops.sanguine.apply_skin() == {"FINISHED"}
    assert "blood_oxygenation_elsewhere" in face.keys()
    controls.set_controls(rig, {"hypoxia": 1.0})
    bpy.context.view_layer.update()
    assert face["blood_oxygenation_elsewhere"] < -0.05
    assert live_plan(face).fragments != fragments
    assert '["hypoxia"]' in draw(panels.SANGUINE_PT_blood)
    assert bpy.ops.sanguine.remove_feeling(feeling="hypoxia") == {"FINISHED"}
    bpy.ops.sanguine.apply_skin()
    assert set(face.keys()) == set(before) and live_plan(face).fragments == fragments


def test_baking_shows_in_the_panel_whether_it_holds(face):
    bpy.ops.sanguine.apply_skin()
    bpy.context.scene.frame_end = 48
    key(face, "anger", f1=0.0, f12=1.0)
    assert any("settle" in line for line in draw(panels.SANGUINE_PT_time))
    assert bpy.ops.sanguine.bake_blood() == {"FINISHED"}
    assert RECORD in face and "Baked" in draw(panels.SANGUINE_PT_time)
    assert len(curves(face)) >= 6
    key(face, "anger", f30=0.0)
    assert any("Stale" in line for line in draw(panels.SANGUINE_PT_time))
    bpy.ops.sanguine.bake_blood()
    assert "Baked" in draw(panels.SANGUINE_PT_time)
    bpy.ops.sanguine.clear_blood()
    assert RECORD not in face and not curves(face)
    bpy.context.scene.frame_set(12)
    assert face["blood_hemoglobin_cheeks"] > 0.01


def test_a_skin_applied_anew_is_not_baked(face):
    bpy.ops.sanguine.apply_skin()
    key(face, "anger", f1=0.0, f12=1.0)
    bpy.ops.sanguine.bake_blood()
    bpy.ops.sanguine.apply_skin()
    assert RECORD not in face and face.animation_data.drivers and not any(d.mute for d in face.animation_data.drivers)


def test_exaggeration_is_called_so(face):
    bpy.ops.sanguine.apply_skin()

    def labels():
        found = []

        class Texts(Layout):
            def prop(self, data, name, text="", **_):
                found.append(text)

            def column(self, **_):
                return self

            row = column

        panels.SANGUINE_PT_blood.draw(type("Panel", (), {"layout": Texts()})(), bpy.context)
        return found

    assert "Blood" in labels()
    emotion_bone(face)["blood"] = 1.5
    assert "Blood (exaggerated)" in labels()


def test_poses_are_assets_that_hold_one_face_each(face):
    bpy.ops.sanguine.apply_skin()
    key(face, "anger", f1=0.0, f12=1.0)
    action = face.parent.animation_data.action
    assert bpy.ops.sanguine.add_poses() == {"FINISHED"}
    assert face.parent.animation_data.action == action
    poses = {a.name.split(": ")[1]: a for a in bpy.data.actions if a.asset_data}
    assert {"neutral", "anger", "anger, subtle", "anger, extreme", "fear, extreme"} <= set(poses)
    assert len(poses) == 1 + 3 * 4
    bpy.ops.sanguine.add_poses()
    assert len([a for a in bpy.data.actions if a.asset_data]) == len(poses)
    assert not any(a.preview and a.preview.is_image_custom for a in poses.values())  # no shape keys: no face to show
    # Applied as the pose library does: the pose alone, at its frame.
    animation = face.parent.animation_data
    animation.action = poses["fear, extreme"]
    if hasattr(animation, "action_slot"):
        animation.action_slot = poses["fear, extreme"].slots[0]
    bpy.context.scene.frame_set(1)
    bone = emotion_bone(face)
    assert [bone[name] for name in ("anger", "happy", "sad", "fear")] == pytest.approx([0.0, 0.0, 0.0, 1.5])


def test_poses_show_the_face_that_they_make(face):
    for name in ("Basis", "mouthSmileLeft"):
        key_block = face.shape_key_add(name=name)
        key_block.value = 0.0
    # The grid lies flat: seen from the front it is a line. A smile lifts one end of it.
    face.data.shape_keys.key_blocks["mouthSmileLeft"].data[-1].co.z += 0.2
    bpy.ops.sanguine.apply_skin()
    key(face, "happy", f1=0.0, f12=1.0)
    bpy.context.scene.frame_set(1)
    emotion_bone(face)["fear"] = 0.4
    action = face.parent.animation_data.action
    bpy.ops.sanguine.add_poses()
    poses = {a.name.split(": ")[1]: a for a in bpy.data.actions if a.asset_data}

    def covered(pose):
        image = np.empty((*poses[pose].preview.image_size, 4), dtype=np.float32)
        poses[pose].preview.image_pixels_float.foreach_get(image.ravel())
        return (image[..., 3] > 0).sum()

    # Keyed or not, the smile shows in its pose alone; what was set is set again.
    assert covered("happy") > 0 and covered("neutral") == covered("sad") == 0
    bone = emotion_bone(face)
    assert (bone["happy"], bone["fear"]) == pytest.approx((0.0, 0.4)) and face.parent.animation_data.action == action


def test_every_step_can_be_undone(face):
    bpy.context.preferences.edit.use_global_undo = True
    bpy.ops.ed.undo_push(message="start")
    bpy.ops.sanguine.apply_skin()
    key(face, "anger", f1=0.0, f12=1.0)
    bpy.ops.ed.undo_push(message="keys")
    face_name, before = face.name, sorted(face.keys())
    bpy.ops.sanguine.bake_blood()
    bpy.ops.ed.undo_push(message="bake")
    bpy.ops.ed.undo()
    face = bpy.data.objects[face_name]
    assert sorted(face.keys()) == before and len(face.animation_data.drivers) >= 6
    bpy.ops.ed.redo()
    face = bpy.data.objects[face_name]
    assert RECORD in face and np.any([curve.evaluate(40) for curve in curves(face)])


PROFILE = """
format = 1
sanguine = "0.1.0"
sex = "pooled"
subjects = 12
[calibration]
[[recording]]
file = "study.csv"
sha256 = "{sha}"
samples = 100
[[emotion]]
name = "anger"
change = [{{ region = "cheeks", quantity = "hemoglobin", value = 0.005, low = 0.003, high = 0.007, magnitude = "measured", source = ["study.csv"] }}]
"""


def test_measured_blood_takes_the_place_of_the_tables(face, tmp_path):
    path = tmp_path / "profile.toml"
    path.write_text(PROFILE.format(sha="0" * 64))
    bpy.ops.sanguine.apply_skin()
    controls.set_controls(face.parent, {"anger": 1.0})
    bpy.context.view_layer.update()
    table = {name: face[name] for name in ("blood_hemoglobin_cheeks", "blood_hemoglobin_ears")}
    assert bpy.ops.sanguine.load_profile(filepath=str(path)) == {"FINISHED"}
    bpy.context.view_layer.update()
    assert face["blood_hemoglobin_cheeks"] == pytest.approx(0.005) != table["blood_hemoglobin_cheeks"]
    assert face["blood_hemoglobin_ears"] == table["blood_hemoglobin_ears"]
    key(face, "anger", f1=1.0, f2=1.0)
    bpy.ops.sanguine.bake_blood()
    bpy.context.scene.frame_set(100)
    assert face["blood_hemoglobin_cheeks"] == pytest.approx(0.005)
    assert bpy.ops.sanguine.load_profile(filepath="") == {"FINISHED"}
    assert any("Stale" in line for line in draw(panels.SANGUINE_PT_time))
    path.write_text(path.read_text().replace("cheeks", "cheek"))
    with pytest.raises(RuntimeError, match="did you mean 'cheeks'"):
        bpy.ops.sanguine.load_profile(filepath=str(path))
