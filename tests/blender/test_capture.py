"""Import Capture: the take plays on the rig as it was recorded, and what was there before plays on."""

import bpy
import numpy as np
import pytest
from support.captures import add, blinking, noisy, showing, talking, write_live_link

from sanguine.app.capture import capture
from sanguine.blender import capture as blender_capture
from sanguine.blender import controls, curves
from sanguine.blender.bake import bake_blood
from sanguine.blender.blood import blood_sliders, drive_blood
from sanguine.domain.blood import BLOOD
from sanguine.domain.errors import InputError
from sanguine.domain.facs import ARKIT, DEFAULT_EMOTIONS

PATH = 'pose.bones["sanguine"]["{}"]'
SECONDS = np.arange(6 * 60) / 60


@pytest.fixture(scope="module")
def take(tmp_path_factory):
    rng = np.random.default_rng(1)
    keys = add(showing("anger", 1.0, SECONDS, rng, 1, 5), talking(SECONDS, rng), blinking(SECONDS, rng))
    path = tmp_path_factory.mktemp("take") / "angry.csv"
    return write_live_link(
        path, np.arange(len(SECONDS)), noisy(keys, SECONDS, rng), rotations={"HeadYaw": 0.3 * np.sin(SECONDS)}
    )


@pytest.fixture
def rig():
    """An armature with a body animation of its own, and a face with all keys."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    rig = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    mesh = bpy.data.meshes.new("face")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    face = bpy.data.objects.new("face", mesh)
    for thing in (rig, face):
        bpy.context.collection.objects.link(thing)
    face.parent = rig
    for name in ("Basis", *ARKIT.keys):
        face.shape_key_add(name=name).value = 0.0
    controls.add_controls(rig)
    controls.drive_shape_keys(rig, [face])
    bpy.context.view_layer.objects.active = face
    face.vertex_groups.new(name="sanguine_cheeks")
    return rig


def value_at(rig, name, frame):
    whole = int(np.floor(frame))
    bpy.context.scene.frame_set(whole, subframe=frame - whole)
    return rig.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones["sanguine"][name]


def test_scrubbing_shows_the_recorded_values(rig, take):
    performance = capture(take, 24.0, emotions=DEFAULT_EMOTIONS)
    action, left_out = blender_capture.import_performance(rig, performance, start=11)
    assert left_out == () and action.name == "angry" and rig.animation_data.action == action
    for name in ("AU4L", "AU45R", "AU26", "AU51", "anger_blood"):
        frames, values = performance.controls[name]
        for i in range(0, len(frames), 13):
            assert value_at(rig, name, frames[i] + 11) == pytest.approx(values[i], abs=1e-6)
    # The face follows: the lid is shut where the blink is.
    frames, values = performance.controls["AU45L"]
    bpy.context.scene.frame_set(11 + int(frames[values.argmax()]))
    face = bpy.data.objects["face"].evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert face.data.shape_keys.key_blocks["eyeBlinkLeft"].value == pytest.approx(values.max(), abs=0.02)


def test_the_animation_before_it_plays_on_below(rig, take):
    rig.location.x = 1.0
    rig.keyframe_insert("location", index=0, frame=1)
    rig.location.x = 5.0
    rig.keyframe_insert("location", index=0, frame=101)
    bone = rig.pose.bones["sanguine"]
    bone["fear"] = 0.7
    bone.keyframe_insert('["fear"]', frame=1)
    before = rig.animation_data.action
    where = [rig.matrix_world.translation.x for frame in (1, 37, 101) if not bpy.context.scene.frame_set(frame)]
    performance = capture(take, 24.0, emotions=())
    blender_capture.import_performance(rig, performance, start=1)
    assert [strip.action for track in rig.animation_data.nla_tracks for strip in track.strips] == [before]
    after = [rig.matrix_world.translation.x for frame in (1, 37, 101) if not bpy.context.scene.frame_set(frame)]
    assert after == pytest.approx(where)
    assert value_at(rig, "fear", 30) == pytest.approx(0.7)  # not in the take's curves
    frames, values = performance.controls["AU4L"]
    assert value_at(rig, "AU4L", 61) == pytest.approx(values[60], abs=1e-6)
    # A second take goes on top of the first.
    blender_capture.import_performance(rig, performance, start=201)
    assert len(rig.animation_data.nla_tracks) == 2
    assert value_at(rig, "AU4L", 261) == pytest.approx(values[60], abs=1e-6)


def test_sliders_that_the_rig_lacks_are_added(rig, take):
    bone = rig.pose.bones["sanguine"]
    del bone["AU12L"], bone["AU4R"]
    blender_capture.import_performance(rig, capture(take, 24.0))
    assert {"AU12L", "AU4R", "anger_blood"} <= set(bone.keys())
    ui = bone.id_properties_ui("anger_blood").as_dict()
    assert ui["max"] == 1.5 and ui["description"]


def test_blood_follows_the_inferred_emotion_and_no_muscle_moves_twice(rig, take):
    face = bpy.data.objects["face"]
    drive_blood(rig, face, BLOOD.channels(blood_sliders(rig)).values())
    performance = capture(take, 24.0)
    blender_capture.import_performance(rig, performance, start=1)
    frame = 1 + 3 * 24
    level = value_at(rig, "anger_blood", frame)
    assert level > 0.7 and value_at(rig, "anger", frame) == 0.0
    shown = face.evaluated_get(bpy.context.evaluated_depsgraph_get())
    sliders = {"anger_blood": level, "blood": 1.0}
    for channel in BLOOD.channels(blood_sliders(rig)).values():
        assert shown[channel.property_name] == pytest.approx(channel.response.value(sliders), abs=1e-6)
    assert shown["blood_hemoglobin_cheeks"] > 0.005
    # In time: baked, the blood comes after the face and stays longer.
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 1 + performance.frames
    bake_blood(face, rig, scene)
    keys = np.array([key.co for key in curves.find_curve(face, '["blood_hemoglobin_cheeks"]').keyframe_points])
    anger = performance.controls["anger_blood"][1]
    assert keys[keys[:, 1].argmax(), 0] > 1 + np.flatnonzero(anger > 0.9 * anger.max())[0]
    assert keys[-1, 1] > 0.1 * keys[:, 1].max() and anger[-1] < 0.1 * anger.max()


def test_a_library_override_takes_a_capture_and_keeps_it(rig, take, tmp_path):
    """It cannot keep new sliders: the library's rig has the blood of anger, and not that of happiness."""
    controls.add_controls(rig, DEFAULT_EMOTIONS, ["anger_blood"])
    library, shot = str(tmp_path / "rig.blend"), str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library, check_existing=False)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(library, link=True) as (_, wanted):
        wanted.objects = ["rig", "face"]
    linked = bpy.data.objects["rig"]
    bpy.context.collection.objects.link(linked)
    performance = capture(take, 24.0)
    with pytest.raises(InputError, match="rig: linked from another file: make a library override"):
        blender_capture.import_performance(linked, performance)
    ours = linked.override_hierarchy_create(bpy.context.scene, bpy.context.view_layer)
    performance.controls["happy_blood"] = performance.controls["anger_blood"]
    _, left_out = blender_capture.import_performance(ours, performance)
    assert left_out == ("happy_blood",)
    name = ours.name
    bpy.ops.wm.save_as_mainfile(filepath=shot, check_existing=False)
    bpy.ops.wm.open_mainfile(filepath=shot)
    ours = next(thing for thing in bpy.data.objects if thing.name == name and thing.override_library)
    frames, values = performance.controls["AU4L"]
    assert value_at(ours, "AU4L", 61) == pytest.approx(values[60], abs=1e-6)
    assert value_at(ours, "anger_blood", 61) == pytest.approx(performance.controls["anger_blood"][1][60], abs=1e-6)


def test_operator_at_the_rate_of_the_scene(rig, take):
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = 30, 1.001
    assert bpy.ops.sanguine.import_capture(filepath=str(take), start=5) == {"FINISHED"}
    curve = curves.find_curve(rig, PATH.format("AU45L"))
    keys = np.array([key.co for key in curve.keyframe_points])
    expected = capture(take, 30 / 1.001).controls["AU45L"]
    np.testing.assert_allclose(keys[:, 0], expected[0] + 5)
    np.testing.assert_allclose(keys[:, 1], expected[1], atol=1e-4)  # Blender's base is a float32
    assert curve.group.name == "Capture" and keys[-1, 0] == pytest.approx(5 + SECONDS[-1] * 30 / 1.001, abs=0.5)


def test_a_wrong_file_is_one_line_and_changes_nothing(rig, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("a,b\n1,2\n")
    before = set(rig.pose.bones["sanguine"].keys())
    with pytest.raises(RuntimeError, match="no recording of a face that is known"):
        bpy.ops.sanguine.import_capture(filepath=str(path))
    assert not bpy.data.actions and set(rig.pose.bones["sanguine"].keys()) == before


def test_where_it_cannot_work_it_says_so(rig, take):
    bpy.context.view_layer.objects.active = None
    assert not bpy.ops.sanguine.import_capture.poll()
    bpy.context.view_layer.objects.active = bpy.data.objects["face"]
    assert bpy.ops.sanguine.import_capture.poll()
    performance = capture(take, 24.0)
    blender_capture.import_performance(rig, performance)
    blender_capture.import_performance(rig, performance)
    animation = rig.animation_data
    track = animation.nla_tracks[0]
    track.select = track.strips[0].select = True
    animation.nla_tracks.active = track
    animation.use_tweak_mode = True
    assert animation.use_tweak_mode
    assert not bpy.ops.sanguine.import_capture.poll()
    with pytest.raises(InputError, match="leave tweak mode first"):
        blender_capture.import_performance(rig, performance)


@pytest.fixture(autouse=True, scope="module")
def registered():
    from sanguine.blender import registration

    registration.register()
    yield
    registration.unregister()
