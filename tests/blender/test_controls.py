"""In Blender: the drivers compute what the domain computes, survive saving and linking, and leave no trace."""

import math
import subprocess
import sys
import textwrap

import bpy
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mathutils import Vector

from sanguine.blender import blood, controls
from sanguine.domain.blood import BLOOD, BLOOD_CONTROL_MAX, MOOD_SUFFIX, STATES, blood_change, settled
from sanguine.domain.errors import InputError
from sanguine.domain.facs import (
    ACTION_UNITS,
    ARKIT,
    DEFAULT_EMOTIONS,
    EMOTION_CONTROLS,
    EMOTION_MAX,
    EMOTIONS,
    SHAPE_KEYS,
    UNIT_CONTROLS,
    formulas,
    shape_key_values,
)
from sanguine.domain.response import Response

FEELINGS = [*EMOTION_CONTROLS, *STATES]
CHANNELS = BLOOD.channels(FEELINGS)
MOODS = [name + MOOD_SUFFIX for name in EMOTION_CONTROLS]

# Few units at once: with all of them at random, what excludes each other leaves nothing to compare.
mixes = st.fixed_dictionaries(
    {"blood": st.floats(0.0, BLOOD_CONTROL_MAX)}
    | {name: st.floats(0.0, EMOTION_MAX) for name in (*EMOTION_CONTROLS, *MOODS)}
    | {name: st.floats(0.0, 1.0) for name in STATES}
).flatmap(
    lambda emotions: st.dictionaries(st.sampled_from(list(UNIT_CONTROLS)), st.floats(0.0, 1.0), max_size=8).map(
        lambda units: emotions | units
    )
)


def add_mesh(name, keys):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    mesh_object = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(mesh_object)
    for key in ("Basis", *keys):
        mesh_object.shape_key_add(name=key).value = 0.0
    return mesh_object


def add_armature():
    armature = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    bpy.context.collection.objects.link(armature)
    return armature


@pytest.fixture
def face():
    """An armature and a skin with all keys, driven by all emotions and states."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    armature, skin = add_armature(), add_mesh("skin", SHAPE_KEYS)
    controls.add_controls(armature, EMOTION_CONTROLS, (*STATES, *MOODS))
    controls.drive_shape_keys(armature, [skin])
    blood.drive_blood(armature, skin, BLOOD.channels([*FEELINGS, *MOODS]).values())
    return armature, skin


def evaluated(skin):
    """Shape key values and blood properties after evaluation."""
    result = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
    keys = {key.name: key.value for key in result.data.shape_keys.key_blocks}
    return keys, {c.property_name: result[c.property_name] for c in CHANNELS.values()}


def evaluated_keys(skin):
    result = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return {key.name: key.value for key in result.data.shape_keys.key_blocks if key.name in SHAPE_KEYS}


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(values=mixes)
def test_drivers_equal_the_domain_for_any_mix(face, values):
    armature, skin = face
    at_rest = {name: control.minimum for name, control in controls.CONTROLS.items()}
    controls.set_controls(armature, {n: v for n, v in at_rest.items() if n in armature.pose.bones["sanguine"]} | values)
    keys, changes = evaluated(skin)
    expected = shape_key_values(values)
    assert {name: keys[name] for name in expected} == pytest.approx(expected, abs=1e-6)
    moved = settled({name: values[name] for name in (*FEELINGS, *MOODS)}, values["blood"])
    for key, channel in CHANNELS.items():
        assert changes[channel.property_name] == pytest.approx(moved.get(key, 0.0), abs=1e-6)


def face_properties(emotions=EMOTION_CONTROLS):
    """All but those of units that turn the head."""
    rig = formulas(tuple(emotions))
    return rig.needed(unit for response in rig.keys.values() for unit in response.controls())


def drivers_of(*owners):
    return [curve for owner in owners if owner.animation_data for curve in owner.animation_data.drivers]


def test_every_driver_is_a_short_simple_expression(face):
    armature, skin = face
    whole = [curve for curve in drivers_of(skin, skin.data.shape_keys) if "_part" not in curve.data_path]
    assert len(whole) == len(SHAPE_KEYS) + len(CHANNELS)
    assert {curve.data_path[2:-2] for curve in drivers_of(armature)} == set(face_properties())
    for curve in drivers_of(armature, skin, skin.data.shape_keys):
        assert curve.driver.is_valid and curve.driver.is_simple_expression, curve.data_path
        assert len(curve.driver.expression) < 255


def texts(*owners):
    return {
        (owner.name, curve.data_path): (
            curve.driver.expression, [(v.name, v.targets[0].data_path) for v in curve.driver.variables]
        )
        for owner in owners
        for curve in drivers_of(owner)
    }  # fmt: skip


def test_an_emotion_costs_nothing_before_it_is_on_the_rig_and_leaves_nothing_behind():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    armature, skin = add_armature(), add_mesh("skin", SHAPE_KEYS)
    keys = skin.data.shape_keys
    bone = controls.add_controls(armature, ())
    controls.drive_shape_keys(armature, [skin])
    assert controls.emotions_of(armature) == () and "anger" not in bone
    bare = texts(armature, keys)
    assert len(bare) == len(SHAPE_KEYS) + len(face_properties(()))
    controls.set_controls(armature, {"AU12": 0.5})
    bone["AU4"] = 0.25
    bone.keyframe_insert('["AU4"]', frame=3)
    controls.add_controls(armature, ["fear"])
    controls.add_controls(armature, ["surprise"])
    assert controls.emotions_of(armature) == ("fear", "surprise") and bone["AU12"] == 0.5
    assert bone.id_data.animation_data.action is not None
    asked = {f"sum_{unit}" for name in ("fear", "surprise") for unit in EMOTIONS[name].units}
    both = texts(armature, keys)
    assert {path[2:-2] for _, path in set(both) - set(bare)} == asked
    controls.set_controls(armature, {"fear": 0.7})
    assert evaluated_keys(skin) == pytest.approx(shape_key_values({"AU12": 0.5, "AU4": 0.25, "fear": 0.7}), abs=1e-6)
    for name in ("fear", "surprise"):
        controls.remove_emotion(armature, name)
    assert texts(armature, keys) == bare and {key for key in armature.keys() if key.startswith("sum_")} == set()
    with pytest.raises(InputError, match="fear: not on this rig"):
        controls.remove_emotion(armature, "fear")
    with pytest.raises(InputError, match="fear: not on this rig"):
        controls.set_controls(armature, {"fear": 1.0})
    controls.set_controls(armature, {"fear": 0.0})
    with pytest.raises(InputError, match="fea: no such emotion or state, did you mean 'fear'"):
        controls.add_controls(armature, ["fea"])


def test_a_rig_without_sides_has_neither_their_sliders_nor_their_drivers():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    armature, skin = add_armature(), add_mesh("skin", SHAPE_KEYS)
    bone = controls.add_controls(armature, sides=False)
    controls.drive_shape_keys(armature, [skin])
    assert "AU12" in bone and "AU46L" in bone and "AU12L" not in bone
    heard = {v.targets[0].data_path for curve in drivers_of(armature) for v in curve.driver.variables}
    assert all(f'["AU{side}"]' not in path for path in heard for side in ACTION_UNITS["12"].sides)
    controls.set_controls(armature, {"happy": 1.0})
    assert evaluated_keys(skin) == pytest.approx(shape_key_values({"happy": 1.0}), abs=1e-6)
    assert "AU12L" in controls.add_controls(armature)
    controls.set_controls(armature, {"happy": 0.0, "AU12L": 1.0})
    assert evaluated_keys(skin) == pytest.approx(shape_key_values({"AU12L": 1.0}), abs=1e-6)


def test_a_driver_that_blender_would_cut_names_its_key(face):
    armature, skin = face
    too_long = Response(tuple((0.123456789, control) for control in list(controls.CONTROLS)[:20]))
    with pytest.raises(ValueError, match="jawOpen.*split it"):
        controls.drive(skin.data.shape_keys, 'key_blocks["jawOpen"].value', too_long, armature)


def test_controls_have_range_tooltip_and_default_and_can_be_overridden(face):
    controls.add_controls(face[0], (), controls.OPTIONAL)
    bone = face[0].pose.bones[controls.CONTROL_BONE]
    assert set(bone.keys()) >= set(controls.CONTROLS)
    others = {"blood": (0.0, 2.0, 1.0), "blood_pace": (0.1, 10.0, 1.0), "heart_rate": (20.0, 250.0, 70.0)}
    for name, control in controls.CONTROLS.items():
        ui = bone.id_properties_ui(name).as_dict()
        low, high, default = others.get(name, (0.0, EMOTION_MAX if name in (*EMOTION_CONTROLS, *MOODS) else 1.0, 0.0))
        assert (ui["min"], ui["max"], ui["soft_max"]) == (low, high, control.soft_maximum)
        assert ui["default"] == bone[name] == control.default == default
        assert len(ui["description"]) > 5
        assert bone.is_property_overridable_library(f'["{name}"]')


def test_blood_properties_hold_their_whole_range(face):
    _, skin = face
    for channel in BLOOD.channels([*FEELINGS, *MOODS]).values():
        ui = skin.id_properties_ui(channel.property_name).as_dict()
        assert (ui["min"], ui["max"]) == pytest.approx(channel.reach)


def test_missing_and_occupied_keys_are_reported_and_left_alone():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    armature, skin, teeth = add_armature(), add_mesh("skin", ["jawOpen", "browInnerUp"]), add_mesh("teeth", ["jawOpen"])
    bone = controls.add_controls(armature)
    assert controls.emotions_of(armature) == DEFAULT_EMOTIONS and not set(bone.keys()) & set(controls.STATES)
    skin.data.shape_keys.key_blocks["browInnerUp"].driver_add("value").driver.expression = "0.25"
    report = controls.drive_shape_keys(armature, [skin, teeth, armature])
    assert report.driven == ("jawOpen",)
    assert set(report.missing) == (set(SHAPE_KEYS) & set(ARKIT.keys)) - {"jawOpen"}
    assert report.occupied == ("skin: browInnerUp",)
    assert set(report.still) == {unit.id for unit in ACTION_UNITS.values() if unit.keys} - {"26", "27"}
    reads = formulas(DEFAULT_EMOTIONS).needed(formulas().keys["jawOpen"].controls())
    assert {key for key in armature.keys()} == set(reads), "no more than the keys that are there ask for"
    assert controls.drive_shape_keys(armature, [skin, teeth, armature]) == report
    assert skin.data.shape_keys.animation_data.drivers.find('key_blocks["browInnerUp"].value').driver.expression == "0.25"


def test_removal_leaves_no_trace(face):
    armature, skin = face
    controls.set_controls(armature, {"anger": 1.0})
    evaluated(skin)
    controls.remove_shape_key_drivers(armature, [skin, armature])
    blood.remove_blood(skin)
    controls.remove_controls(armature)
    assert skin.animation_data is None and skin.data.shape_keys.animation_data is None
    assert not skin.keys() and not armature.keys() and not armature.data.bones
    assert all(key.value == 0.0 for key in skin.data.shape_keys.key_blocks)
    controls.remove_controls(armature)


def test_a_hidden_armature_is_refused_with_what_to_do():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    armature = add_armature()
    armature.hide_viewport = True
    with pytest.raises(InputError, match="rig: hidden .* show it first"):
        controls.add_controls(armature)


def test_adding_twice_keeps_what_was_set(face):
    armature, _ = face
    controls.set_controls(armature, {"fear": 0.5, "neutral": 1.0})
    assert controls.add_controls(armature)["fear"] == 0.5


@pytest.mark.parametrize(("name", "value", "message"), [("angre", 1.0, "did you mean 'anger'"), ("AU4", 1.5, "outside 0 to 1")])
def test_a_wrong_control_is_refused(face, name, value, message):
    with pytest.raises(InputError, match=message):
        controls.set_controls(face[0], {name: value})


def head_rig():
    """An armature with a head bone that leans back by 10 degrees."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    armature = add_armature()
    bpy.context.view_layer.update()
    with controls._edit_bones(armature) as bones:
        bone = bones.new("head")
        bone.head, bone.tail = (0, 0, 1.5), (0, 0.2 * math.sin(math.radians(10)), 1.5 + 0.2 * math.cos(math.radians(10)))
    return armature


@pytest.mark.parametrize(
    ("units", "moves"),
    [
        ({"AU51": 1.0}, lambda m: m["front"].x > 0.5),
        ({"AU52": 1.0}, lambda m: m["front"].x < -0.5),
        ({"AU53": 1.0}, lambda m: m["front"].z > 0.35),
        ({"AU54": 1.0}, lambda m: m["front"].z < -0.35),
        ({"AU55": 1.0}, lambda m: m["top"].x > 0.35),
        ({"AU56": 1.0}, lambda m: m["top"].x < -0.35),
        ({"AU57": 1.0}, lambda m: -0.026 < m["place"].y - m["rest"].y < -0.02),
        ({"AU58": 1.0}, lambda m: 0.016 < m["place"].y - m["rest"].y < 0.021),
        ({"AU51": 1.0, "AU52": 1.0}, lambda m: abs(m["front"].x) < 1e-5),
    ],
)
def test_the_head_goes_where_the_units_say(units, moves):
    """The subject looks along -Y: its left is +X."""
    armature = head_rig()
    controls.add_controls(armature)
    assert controls.drive_head(armature) == ""
    controls.set_controls(armature, units)
    pose = armature.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones["head"]
    rest = armature.data.bones["head"].matrix_local
    turn = (pose.matrix @ rest.inverted()).to_3x3()
    assert moves({"front": turn @ Vector((0, -1, 0)), "top": turn @ Vector((0, 0, 1)),
                  "place": pose.matrix.translation, "rest": rest.translation})  # fmt: skip
    controls.remove_head_drivers(armature)
    assert not armature.animation_data and not armature.keys()
    assert all(v == 0.0 for v in (*armature.pose.bones["head"].rotation_euler, *armature.pose.bones["head"].location))


def test_a_head_bone_that_is_animated_is_left_alone():
    armature = head_rig()
    controls.add_controls(armature)
    armature.pose.bones["head"].keyframe_insert("rotation_quaternion", frame=1)
    assert "animated already" in controls.drive_head(armature)
    assert "no bone 'skull'" in controls.drive_head(armature, "skull")
    assert armature.pose.bones["head"].rotation_mode == "QUATERNION" and not armature.animation_data.drivers


KEYED_ELSEWHERE = """
    import sys
    import bpy

    class Refuse:
        def find_spec(self, name, path=None, target=None):
            assert not name.startswith("sanguine"), name

    sys.meta_path.insert(0, Refuse())
    {open}
    armature, skin = (next(o for o in bpy.context.scene.objects if o.type == kind) for kind in ("ARMATURE", "MESH"))
    bone = armature.pose.bones["sanguine"]
    for frame, value in ((1, 0.0), (11, 1.0)):
        bone["anger"] = value
        bone.keyframe_insert('["anger"]', frame=frame)
    for frame in (1, 11):
        bpy.context.scene.frame_set(frame)
        result = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
        print("VALUES", frame, result.data.shape_keys.key_blocks["browDownLeft"].value, result["blood_hemoglobin_cheeks"])
"""

OPEN = "bpy.ops.wm.open_mainfile(filepath={path!r}, use_scripts=False)"
LINK = """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load({path!r}, link=True) as (found, wanted):
        wanted.collections = ["face"]
    scene = bpy.context.scene
    override = wanted.collections[0].override_hierarchy_create(scene, bpy.context.view_layer, do_fully_editable=True)
    assert override.override_library and all(o.override_library for o in override.all_objects)
"""


@pytest.mark.parametrize("how", [OPEN, LINK], ids=["opened", "linked with an override"])
def test_a_saved_face_answers_to_keys_without_the_add_on(face, tmp_path, how):
    collection = bpy.data.collections.new("face")
    bpy.context.scene.collection.children.link(collection)
    for member in face:
        bpy.context.scene.collection.objects.unlink(member)
        collection.objects.link(member)
    path = str(tmp_path / "face.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    script = textwrap.dedent(KEYED_ELSEWHERE).format(open=textwrap.dedent(how).strip().format(path=path))
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stderr
    values = [list(map(float, line.split()[1:])) for line in run.stdout.splitlines() if line.startswith("VALUES")]
    change = blood_change({"anger": 1.0}, "cheeks")[0]
    assert values == [pytest.approx([1.0, 0.0, 0.0]), pytest.approx([11.0, 1.0, change])]


def test_drivers_work_on_a_face_that_was_seen_before_its_armature():
    """The scene was evaluated with the face in it, as it always is for an artist, before the controls came."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    skin = add_mesh("skin", ["browDownLeft"])
    bpy.context.view_layer.update()
    armature = add_armature()
    controls.add_controls(armature)
    controls.drive_shape_keys(armature, [skin])
    blood.drive_blood(armature, skin, [BLOOD.channels(DEFAULT_EMOTIONS)["cheeks", "hemoglobin"]])
    bpy.context.view_layer.update()
    controls.set_controls(armature, {"anger": 1.0})
    bpy.context.view_layer.update()
    assert skin["blood_hemoglobin_cheeks"] > 0.0
    assert skin.data.shape_keys.key_blocks["browDownLeft"].value > 0.5
