"""In Blender: meshes whose keys have other names get drivers that do what the domain says."""

import bpy
import pytest

from sanguine.blender import controls
from sanguine.domain.facs import ARKIT, DEFAULT_EMOTIONS, SHAPE_KEYS, formulas
from sanguine.domain.naming import CONVENTIONS, conventions, mesh_responses, recognise

CORRUGATOR = {  # a key that anger moves, by convention
    "arkit": "browDownLeft", "ict": "browDown_L", "unified": "BrowDownLeft", "rpm": None, "metahuman": "CTRL_expressions_browDownL", "cc4": "Brow_Drop_L",
    "mpfb": "eyebrows-left-down", "vroid": "Fcl_ALL_Angry", "vrm": "angry", "mpeg4": "squeeze_l_eyebrow", "facs": "AU4L",
}  # fmt: skip


def add_mesh(name, keys):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    mesh_object = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(mesh_object)
    for key in ("Basis", *keys):
        mesh_object.shape_key_add(name=key).value = 0.0
    return mesh_object


@pytest.fixture
def rig():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    armature = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    bpy.context.collection.objects.link(armature)
    controls.add_controls(armature)
    return armature


def values(mesh):
    keys = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.shape_keys.key_blocks
    return {key.name: key.value for key in keys if key.name != "Basis"}


@pytest.mark.parametrize("name", CONVENTIONS)
def test_every_convention_is_driven_as_the_domain_says(rig, name):
    names = conventions()[name]
    keys = [prefix + key for prefix in names.prefixes or ("",) for key in names.rows()]
    mesh = add_mesh("head", [*keys, "somebody's own"])
    found = recognise([*keys, "somebody's own"])
    report = controls.drive_shape_keys(rig, [mesh])
    responses = mesh_responses(found, formulas(DEFAULT_EMOTIONS), DEFAULT_EMOTIONS)
    assert set(report.driven) == set(responses) and not report.occupied
    assert set(report.missing) == set(SHAPE_KEYS) & set(ARKIT.keys) - found.expressed(responses)
    drivers = mesh.data.shape_keys.animation_data.drivers
    assert len(drivers) == len(responses)
    assert all(curve.driver.is_valid and curve.driver.is_simple_expression for curve in drivers)
    for wanted in ({"anger": 1.0}, {"fear": 0.7, "AU12": 0.4, "AU46L": 0.5}, {"happy": 1.5, "AU4R": 0.3}, {}):
        controls.set_controls(rig, controls.AT_REST | wanted)
        expected = formulas(DEFAULT_EMOTIONS).values(responses, wanted)
        seen = values(mesh)
        assert {key: seen[key] for key in expected} == pytest.approx(expected, abs=1e-6)
        assert seen["somebody's own"] == 0.0
        if "anger" in wanted and CORRUGATOR[name]:
            assert seen[CORRUGATOR[name]] > 0.4
    assert controls.drive_shape_keys(rig, [mesh]) == report


def test_what_is_driven_or_not_understood_is_left_alone_and_said(rig):
    mesh = add_mesh("head", ["browDown_L", "browDown_R", "jaw_open", "JawOpen", "eyebrows-left-down", "twitch"])
    keys = mesh.data.shape_keys
    keys.key_blocks["browDown_L"].driver_add("value").driver.expression = "0.25"
    report = controls.drive_shape_keys(rig, [mesh])
    assert report.driven == ("browDown_R",)
    assert report.occupied == ("head: browDown_L",)
    assert report.notes == ("head: jaw_open, JawOpen: all of them could be jawOpen; none is used, rename one",)
    assert report.lines[0] == report.notes[0] and "head: browDown_L: driven by something else, left alone" in report.lines
    assert report.lines[-1].startswith("no shape key does the work of browDownLeft, browInnerUp, ")
    assert {"jawOpen", "browDownLeft"} <= set(report.missing) and "browDownRight" not in report.missing
    assert keys.animation_data.drivers.find('key_blocks["browDown_L"].value').driver.expression == "0.25"
    controls.remove_shape_key_drivers(rig, [mesh])
    assert [curve.data_path for curve in keys.animation_data.drivers] == ['key_blocks["browDown_L"].value']


def test_names_with_quotes_are_no_trouble(rig):
    mesh = add_mesh("head", ['face"x"_browDownLeft', "face\\jawOpen"])
    report = controls.drive_shape_keys(rig, [mesh])
    assert len(report.driven) == 2
    controls.set_controls(rig, {"AU4": 1.0})
    assert values(mesh)['face"x"_browDownLeft'] == pytest.approx(1.0)
    controls.remove_shape_key_drivers(rig, [mesh])
    assert mesh.data.shape_keys.animation_data is None and values(mesh)['face"x"_browDownLeft'] == 0.0


def test_an_emotion_put_on_the_rig_later_reaches_its_own_key(rig):
    mesh = add_mesh("head", ["happy", "angry", "sad", "surprised", "aa", "ih", "ou", "oh", "blinkLeft", "blinkRight"])
    assert "surprised" not in controls.drive_shape_keys(rig, [mesh]).driven
    controls.add_controls(rig, ("surprise",))
    assert "surprised" in controls.drive_shape_keys(rig, [mesh]).driven
    controls.set_controls(rig, {"surprise": 0.5})
    assert values(mesh)["surprised"] == pytest.approx(0.5) and values(mesh)["aa"] == 0.0
