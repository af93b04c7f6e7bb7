"""Baked blood: the curves are the model's, any frame stands alone, and what they came from is known."""

import subprocess
import sys
import textwrap

import bpy
import numpy as np
import pytest

from sanguine.blender import bake, blood, controls
from sanguine.blender.curves import action_curve, curves, ensure_action, find_curve, set_keys
from sanguine.domain.blood import BLOOD, settled
from sanguine.domain.errors import InputError
from sanguine.domain.vascular import Controls, blood_over_time

CHEEKS = "blood_hemoglobin_cheeks"
PACKED = {"blood_packed_a": (CHEEKS, "", "blood_oxygenation_lips"), "blood_packed_b": ("pressure", "blood_oxygenation_elsewhere", "")}
KEYS = {"anger": ([1, 9, 40, 49], [0.0, 1.0, 1.0, 0.0]), "fear": ([40, 60, 80], [0.0, 0.8, 0.0])}


def path_of(name):
    return f'pose.bones["{controls.CONTROL_BONE}"]["{name}"]'


@pytest.fixture
def face():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.render.fps = 1, 120, 24
    armature = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    mesh = bpy.data.meshes.new("skin")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    skin = bpy.data.objects.new("skin", mesh)
    for obj in (armature, skin):
        bpy.context.collection.objects.link(obj)
    skin.parent = armature
    controls.add_controls(armature, states=("hypoxia", "pulse", "pressure"))
    sliders = blood.blood_sliders(armature)
    blood.drive_blood(armature, skin, BLOOD.channels(sliders).values())
    blood.drive_pressure(armature, skin)
    blood.drive_packed(skin, PACKED)
    ensure_action(armature, "shot")
    for name, (frames, values) in KEYS.items():
        set_keys(action_curve(armature, path_of(name)), frames, values)
    return armature, skin


def expected(frames, fps=24.0, **more):
    values = {name: np.interp(frames, *keys) for name, keys in KEYS.items()}
    values |= {name: np.full(len(frames), value) for name, value in more.items()}
    return blood_over_time(Controls(frames / fps, values))


def played(skin, frame):
    bpy.context.scene.frame_set(frame)
    result = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return {name: result[name] for name in blood.blood_properties(skin)}


def test_the_curves_are_the_model(face):
    armature, skin = face
    assert bake.bake_blood(skin, armature, bpy.context.scene) == (1, 120)
    frames = np.arange(1, 121)
    model = {f"blood_{quantity}_{region}": series for (region, quantity), series in expected(frames).items()}
    for frame in (1, 10, 60, 120):
        values = played(skin, frame)
        for name, value in values.items():
            # Blender stores keys in single precision: 6e-8 of values up to 0.1.
            assert value == pytest.approx(model[name][frame - 1] if name in model else 0.0, abs=2e-8), (name, frame)
    assert played(skin, 10)[CHEEKS] < 0.3 * settled({"anger": 1.0})["cheeks", "hemoglobin"]
    assert all(curve.mute != curve.data_path.startswith('["blood_packed') for curve in skin.animation_data.drivers)


def test_what_the_material_reads_follows_drivers_and_curves(face):
    """In the same evaluation, whatever moves what people see; it is none of what they key."""
    armature, skin = face
    assert not set(PACKED) & set(blood.blood_properties(skin))
    set_keys(action_curve(armature, path_of("pressure")), [1, 20, 21, 30, 31], [0, 0, 1, 1, 0])
    for baked in (False, True):
        if baked:
            bake.bake_blood(skin, armature, bpy.context.scene)
        for frame in (1, 25, 60, 25):
            values = played(skin, frame)
            held = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
            for name, parts in PACKED.items():
                np.testing.assert_array_equal(held[name], np.float32([values.get(part, 0.0) for part in parts]))
        assert played(skin, 60)[CHEEKS] and played(skin, 25)["pressure"] == pytest.approx(1.0, abs=1e-6)
    bake.clear_bake(skin)
    blood.redrive_blood(armature, skin)
    assert played(skin, 25)[CHEEKS] == pytest.approx(settled({"anger": 1.0})["cheeks", "hemoglobin"])
    held = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert held["blood_packed_a"][0] == pytest.approx(played(skin, 25)[CHEEKS]) and held["blood_packed_b"][0] == 1.0


def test_what_does_not_move_gets_no_curve(face):
    armature, skin = face
    bake.bake_blood(skin, armature, bpy.context.scene)
    moving = {f"blood_{q}_{r}" for r, q in expected(np.arange(1, 121))}
    assert {curve.data_path[2:-2] for curve in curves(skin)} == moving
    assert "blood_oxygenation_elsewhere" in skin.keys() and "blood_oxygenation_elsewhere" not in moving


def test_frames_before_the_scene_are_remembered(face):
    armature, skin = face
    bpy.context.scene.frame_start = 45
    assert bake.bake_blood(skin, armature, bpy.context.scene) == (1, 120)
    assert played(skin, 50)[CHEEKS] > 0.0


def test_the_frame_rate_is_the_scenes(face):
    armature, skin = face
    bpy.context.scene.render.fps, bpy.context.scene.render.fps_base = 30, 1.001
    bake.bake_blood(skin, armature, bpy.context.scene)
    model = expected(np.arange(1, 121), 30 / 1.001)["cheeks", "hemoglobin"]
    assert played(skin, 50)[CHEEKS] == pytest.approx(model[49], abs=2e-8)


def test_sliders_are_followed_whatever_moves_them(face):
    """An NLA strip, a driver and a plain value, sampled as they are evaluated."""
    armature, skin = face
    keyed = bake.sample(armature, bpy.context.scene, np.arange(1, 121))
    animation = armature.animation_data
    track = animation.nla_tracks.new()
    track.strips.new("shot", 1, animation.action)
    animation.action = None
    armature["amount"] = 0.25
    curve = armature.driver_add(path_of("happy"))
    variable = curve.driver.variables.new()
    variable.name, variable.targets[0].id, variable.targets[0].data_path = "x", armature, '["amount"]'
    curve.driver.expression = "2*x"
    controls.set_controls(armature, {"hypoxia": 0.75})
    moved = bake.sample(armature, bpy.context.scene, np.arange(1, 121))
    assert moved["anger"] == pytest.approx(keyed["anger"], abs=1e-6)
    assert moved["happy"] == pytest.approx(np.full(120, 0.5)) and moved["hypoxia"] == pytest.approx(np.full(120, 0.75))
    assert [scene.name for scene in bpy.data.scenes] == [bpy.context.scene.name]
    bake.bake_blood(skin, armature, bpy.context.scene)
    assert bake.bake_state(skin, armature, bpy.context.scene) == bake.BakeState(True, "", driven=True)


def test_pulse_and_pressure_are_baked(face):
    armature, skin = face
    controls.set_controls(armature, {"pulse": 1.0, "heart_rate": 120.0})
    set_keys(action_curve(armature, path_of("pressure")), [1, 20, 21, 30, 31], [0, 0, 1, 1, 0])
    assert played(skin, 25)["pressure"] == 1.0 and played(skin, 33)["pressure"] == 0.0
    bake.bake_blood(skin, armature, bpy.context.scene)
    assert played(skin, 25)["pressure"] == pytest.approx(1.0, abs=1e-6)
    assert 0.5 < played(skin, 33)["pressure"] < 1.0 and played(skin, 80)["pressure"] < 0.05
    beat = [played(skin, frame)["blood_hemoglobin_forehead"] for frame in range(100, 112)]
    assert max(beat) - min(beat) > 1e-4


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda rig, scene: set_keys(find_curve(rig, path_of("anger")), [1, 9], [0.0, 0.5]), "changed since"),
        (lambda rig, scene: controls.set_controls(rig, {"happy": 0.5}), "changed since"),
        (lambda rig, scene: controls.set_controls(rig, {"blood": 1.5}), "changed since"),
        (lambda rig, scene: setattr(scene.render, "fps", 25), "changed since"),
        (lambda rig, scene: setattr(scene, "frame_end", 200), "it covers frames 1 to 120, not 1 to 200"),
        (lambda rig, scene: find_curve(rig, path_of("anger")).modifiers.new("NOISE"), "changed since"),
        (lambda rig, scene: rig.animation_data.nla_tracks.new().strips.new("a", 1, rig.animation_data.action), "changed since"),
    ],
    ids=["keys", "value", "exaggeration", "rate", "range", "modifier", "strip"],
)
def test_a_change_makes_it_stale(face, change, words):
    armature, skin = face
    scene = bpy.context.scene
    assert not bake.bake_state(skin, armature, scene).baked
    bake.bake_blood(skin, armature, scene)
    assert bake.bake_state(skin, armature, scene) == bake.BakeState(True, "")
    scene.frame_set(77)  # scrubbing changes the sliders, and nothing that the bake depends on
    controls.set_controls(armature, {"AU12": 1.0})
    set_keys(action_curve(armature, path_of("AU12")), [1, 9], [0.0, 1.0])
    assert bake.bake_state(skin, armature, scene) == bake.BakeState(True, "")
    change(armature, scene)
    assert words in bake.bake_state(skin, armature, scene).stale
    bake.bake_blood(skin, armature, scene)
    assert bake.bake_state(skin, armature, scene) == bake.BakeState(True, "")


def test_clearing_gives_the_drivers_back(face):
    armature, skin = face
    before = {curve.data_path: curve.driver.expression for curve in skin.animation_data.drivers}
    bake.bake_blood(skin, armature, bpy.context.scene)
    bake.clear_bake(skin)
    assert {curve.data_path: curve.driver.expression for curve in skin.animation_data.drivers} == before
    assert not any(curve.mute for curve in skin.animation_data.drivers)
    assert bake.RECORD not in skin and not curves(skin) and not [a for a in bpy.data.actions if "blood" in a.name]
    bpy.context.scene.frame_set(20)
    assert skin[CHEEKS] == pytest.approx(settled({"anger": 1.0})["cheeks", "hemoglobin"])


def test_other_animation_of_the_skin_is_left_alone(face):
    armature, skin = face
    skin.keyframe_insert("location", frame=1)
    bake.bake_blood(skin, armature, bpy.context.scene)
    bake.clear_bake(skin)
    assert {curve.data_path for curve in curves(skin)} == {"location"}


def test_esc_leaves_the_face_as_it_was(face):
    armature, skin = face
    with pytest.raises(KeyboardInterrupt):
        bake.bake_blood(skin, armature, bpy.context.scene, lambda done, total: False)
    assert skin.animation_data.drivers and bake.RECORD not in skin and len(bpy.data.scenes) == 1


def test_a_face_without_blood_says_what_to_do(face):
    armature, skin = face
    blood.remove_blood(skin)
    with pytest.raises(InputError, match="apply the skin with an emotion"):
        bake.bake_blood(skin, armature, bpy.context.scene)


def test_a_baked_file_plays_any_frame_without_the_add_on(face, tmp_path):
    armature, skin = face
    bake.bake_blood(skin, armature, bpy.context.scene)
    in_sequence = [played(skin, frame)[CHEEKS] for frame in range(1, 121)]
    path = str(tmp_path / "face.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    script = f"""
        import sys, bpy
        sys.modules["sanguine"] = None
        bpy.ops.wm.open_mainfile(filepath={path!r}, use_scripts=False)
        bpy.context.scene.frame_set(60)
        skin = bpy.data.objects["skin"]
        skin = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
        assert abs(skin["blood_packed_a"][0] - skin["{CHEEKS}"]) < 1e-8
        print("VALUE", repr(skin["{CHEEKS}"]))
    """
    run = subprocess.run([sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stderr
    alone = float(next(line.split()[1] for line in run.stdout.splitlines() if line.startswith("VALUE")))
    assert alone == in_sequence[59]


OVERRIDDEN = """
    import bpy
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load({path!r}, link=True) as (found, wanted):
        wanted.collections = ["face"]
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 60
    override = wanted.collections[0].override_hierarchy_create(scene, bpy.context.view_layer, do_fully_editable=True)
    skin, armature = (next(o for o in override.all_objects if o.type == kind) for kind in ("MESH", "ARMATURE"))
    from sanguine.blender import bake, curves
    armature.animation_data.action = None  # of the library
    curves.ensure_action(armature, "scene")
    curves.set_keys(curves.action_curve(armature, 'pose.bones["sanguine"]["happy"]'), [1, 12], [0.0, 1.0])
    bake.bake_blood(skin, armature, scene)
    assert bake.bake_state(skin, armature, scene) == bake.BakeState(True, "")
    bpy.ops.wm.save_as_mainfile(filepath={shot!r})
    bpy.ops.wm.open_mainfile(filepath={shot!r})
    bpy.context.scene.frame_set(60)
    skin = next(o for o in bpy.data.objects if o.type == "MESH" and o.override_library)
    assert abs(skin.evaluated_get(bpy.context.evaluated_depsgraph_get())["blood_packed_a"][0] - skin["{name}"]) < 1e-8
    print("VALUE", repr(skin["{name}"]))
"""


def test_a_linked_face_is_baked_on_its_override(face, tmp_path):
    armature, skin = face
    collection = bpy.data.collections.new("face")
    bpy.context.scene.collection.children.link(collection)
    for member in face:
        bpy.context.scene.collection.objects.unlink(member)
        collection.objects.link(member)
    path = str(tmp_path / "face.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    script = textwrap.dedent(OVERRIDDEN).format(path=path, shot=str(tmp_path / "shot.blend"), name=CHEEKS)
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stderr
    value = float(next(line.split()[1] for line in run.stdout.splitlines() if line.startswith("VALUE")))
    happy = np.interp(np.arange(1, 61), [1, 12], [0.0, 1.0])
    model = blood_over_time(Controls(np.arange(1, 61) / 24.0, {"happy": happy}))
    assert value == pytest.approx(model["cheeks", "hemoglobin"][-1], abs=2e-8)


def test_a_rash_is_baked_by_its_own_slow_time(face):
    armature, skin = face
    controls.add_controls(armature, states=("rash",))
    blood.drive_blood(armature, skin, BLOOD.channels(blood.blood_sliders(armature)).values())
    keys = np.array([1.0, 2.0, 120.0]), np.array([0.0, 1.0, 1.0])
    set_keys(action_curve(armature, path_of("rash")), *keys)
    assert played(skin, 60)["blood_feature_rash"] == pytest.approx(1.0)  # live, settled
    bake.bake_blood(skin, armature, bpy.context.scene)
    frames = np.arange(1, 121)
    course = blood_over_time(Controls(frames / 24.0, {"rash": np.interp(frames, *keys)}))["rash", "feature"]
    found = [played(skin, frame)["blood_feature_rash"] for frame in (1, 60, 120)]
    assert found == pytest.approx([course[0], course[59], course[119]], abs=1e-6)
    assert 0.0 < found[2] < 0.1  # five seconds of some minutes
