"""F-curves through one door in every Blender: 4.2's flat actions, slots and channelbags since 4.4."""

import bpy
import numpy as np
import pytest

from sanguine.blender import curves


@pytest.fixture
def thing():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    thing = bpy.data.objects.new("thing", None)
    bpy.context.collection.objects.link(thing)
    thing["level"] = 0.0
    return thing


def test_keys_are_what_blender_evaluates(thing):
    action = curves.ensure_action(thing, "take")
    assert action.name == "take" and curves.ensure_action(thing, "other") == action
    curve = curves.action_curve(thing, '["level"]', group="sanguine")
    frames, values = np.array([1.0, 2.5, 7.0]), np.array([0.0, 0.9, 0.3])
    curves.set_keys(curve, frames, values)
    assert curve.group.name == "sanguine"
    assert curves.action_curve(thing, '["level"]') == curve == curves.find_curve(thing, '["level"]')
    for frame, subframe, expected in ((0, 0.0, 0.0), (1, 0.75, 0.45), (2, 0.5, 0.9), (7, 0.0, 0.3), (9, 0.0, 0.3)):
        bpy.context.scene.frame_set(frame, subframe=subframe)
        assert thing["level"] == pytest.approx(expected, abs=1e-6)


def test_other_animation_and_array_components_are_left_alone(thing):
    thing.keyframe_insert("location", index=2, frame=3)
    before = thing.animation_data.action
    assert curves.ensure_action(thing, "take") == before
    curves.set_keys(curves.action_curve(thing, "location", 0), [1, 2], [0, 1])
    assert {(c.data_path, c.array_index) for c in curves.curves(thing)} == {("location", 2), ("location", 0)}
    assert curves.remove_curve(thing, "location", 0) and not curves.remove_curve(thing, "location", 0)
    assert curves.find_curve(thing, "location", 2) is not None


def test_two_owners_of_one_action_keep_their_own_curves(thing):
    if "slots" not in bpy.types.Action.bl_rna.properties:
        pytest.skip("an action of this Blender has no slots: all its owners share all its curves")
    other = bpy.data.objects.new("other", None)
    action = curves.ensure_action(thing, "take")
    other.animation_data_create().action = action
    curves.ensure_action(other, "take")
    curves.set_keys(curves.action_curve(other, "location", 0), [1], [2])
    assert curves.curves(thing) == [] and len(curves.curves(other)) == 1


def test_setting_again_replaces_and_interpolation_is_kept(thing):
    curves.ensure_action(thing, "take")
    curve = curves.action_curve(thing, '["level"]')
    curves.set_keys(curve, range(50), np.linspace(0, 1, 50))
    curves.set_keys(curve, [0, 10, 20], [0, 1, 1], "BEZIER")
    assert [tuple(key.co) for key in curve.keyframe_points] == [(0, 0), (10, 1), (20, 1)]
    assert {key.interpolation for key in curve.keyframe_points} == {"BEZIER"}
    assert max(curve.evaluate(frame) for frame in np.linspace(0, 20, 201)) <= 1 + 1e-6  # clamped handles
    curves.set_keys(curve, [0, 10], [0, 1], "CONSTANT")
    assert curve.evaluate(9.9) == 0


def test_nothing_yet_is_nothing_and_needs_an_action(thing):
    assert curves.curves(thing) == [] and curves.find_curve(thing, '["level"]') is None
    assert not curves.remove_curve(thing, '["level"]')
    with pytest.raises(ValueError, match="thing: has no action"):
        curves.action_curve(thing, '["level"]')


@pytest.mark.parametrize(
    ("frames", "values"),
    [([1, 1], [0, 1]), ([2, 1], [0, 1]), ([1, 2], [0, np.nan]), ([1, 2], [0]), ([1e8, 1e8 + 1], [0, 1])],
)
def test_keys_that_are_none_are_refused(thing, frames, values):
    curves.ensure_action(thing, "take")
    curve = curves.action_curve(thing, '["level"]')
    curves.set_keys(curve, [1], [0.5])
    with pytest.raises(ValueError):
        curves.set_keys(curve, frames, values)
    assert len(curve.keyframe_points) == 1  # what was there stays
