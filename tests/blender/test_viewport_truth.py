"""What a render reads of a face is what the viewport showed: the same values at the same frame, not those of the one before.

A viewport of Cycles cannot be had without a window. What can differ between it and a render is what they are given: the
properties, shape keys and places of the evaluated objects, which are compared here as a render engine gets them.
"""

import bpy
import numpy as np
import pytest
from sanguine.blender.operators import emotion_bone, live_plan
from support.patch import empty_scene
from tests.blender.test_adopt import make_face, registered, select, solved_once  # noqa: F401

FRAMES = (1, 2, 3, 7, 12, 7, 1, 3)
"""Forth, by leaps, and back."""


CHEEKS = 0
"""Where their blood stands in what is given; the shape keys follow."""


class Probe(bpy.types.RenderEngine):
    """A render engine that writes down what it is given."""

    bl_idname = "SANGUINE_TEST_PROBE"
    bl_label = "Probe"
    seen: list = []
    wanted: tuple = ()
    cheeks: tuple = ()  # which of these, and which of its numbers

    def update(self, _data, depsgraph):
        assert depsgraph.mode == "RENDER"
        scene = depsgraph.scene
        Probe.seen.append((scene.frame_current + scene.frame_subframe, given(depsgraph)))

    def render(self, depsgraph):
        pass


def given(depsgraph):
    """What a material reads of the face: every property that an Attribute node of it names, and where its vertices are."""
    face = next(i.object for i in depsgraph.object_instances if i.object.name == "face")
    values = [np.atleast_1d(np.array(face.get(name, 0.0), dtype=float)) for name in Probe.wanted]
    keys = [block.value for block in face.original.data.shape_keys.evaluated_get(depsgraph).key_blocks]
    positions = np.empty(3 * len(face.data.vertices), np.float32)
    face.data.vertices.foreach_get("co", positions)
    return np.concatenate([values[Probe.cheeks[0]][[Probe.cheeks[1]]], keys, *values, positions, np.array(face.matrix_world).ravel()])


def read_names(face):
    """Object properties by the names that the skin's material asks for."""
    groups = [node.node_tree for node in face.material_slots[0].material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup"]
    nodes = [node for group in groups for node in group.nodes if node.bl_idname == "ShaderNodeAttribute"]
    return tuple(sorted(node.attribute_name for node in nodes if node.attribute_type == "OBJECT"))


@pytest.fixture
def scene():
    """A face with keyed anger and smile: sliders -> intermediate properties -> shape keys and blood -> material."""
    scene = empty_scene(4, 4, 1)
    face = make_face(material=None)
    face.sanguine.strength_strain = 1.0
    select(face)
    bpy.ops.sanguine.apply_skin()
    bone = emotion_bone(face)
    for slider, keys in (("anger", ((1, 0.0), (4, 1.0), (9, 0.2), (12, 1.2))), ("AU12L", ((1, 0.3), (12, 1.0)))):
        for frame, value in keys:
            bone[slider] = value
            bone.keyframe_insert(f'["{slider}"]', frame=frame)
    face.parent.location.x = 0.0
    for frame in (1, 12):
        face.parent.location.x = 0.01 * frame
        face.parent.keyframe_insert("location", frame=frame)
    scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(scene.camera)
    scene.frame_start, scene.frame_end = 1, 12
    Probe.wanted, Probe.seen = read_names(face), []
    packed = next((name, parts) for name, parts in live_plan(face).packed.items() if "blood_hemoglobin_cheeks" in parts)
    Probe.cheeks = Probe.wanted.index(packed[0]), packed[1].index("blood_hemoglobin_cheeks")
    assert any(name.startswith("strain") for name in Probe.wanted), Probe.wanted
    bpy.utils.register_class(Probe)
    yield scene
    bpy.utils.unregister_class(Probe)


def viewport(scene, frame):
    scene.frame_set(int(frame), subframe=frame - int(frame))
    return given(bpy.context.evaluated_depsgraph_get())


@pytest.mark.parametrize("blood", ["settled", "baked"])
def test_a_render_of_the_animation_is_what_scrubbing_shows(scene, blood, tmp_path):
    if blood == "baked":
        scene.render.fps = 2  # long enough for blood to come and go
        bpy.ops.sanguine.bake_blood()
    shown = {frame: viewport(scene, frame) for frame in FRAMES}
    for frame in FRAMES:
        np.testing.assert_array_equal(viewport(scene, frame), shown[frame], f"frame {frame}: it matters from where one comes")
    blood_shown = [values[CHEEKS] for values in shown.values()]
    # Every frame has blood of its own, so that a lag would show; baked, it comes after a few seconds, and then is.
    assert len(set(blood_shown)) == (len(blood_shown) if blood == "settled" else 3), blood_shown
    scene.render.engine = Probe.bl_idname
    scene.frame_set(5)  # where the viewport stands is no matter
    scene.render.filepath = str(tmp_path / "f")
    bpy.ops.render.render(animation=True)
    rendered = dict(Probe.seen)
    assert sorted(rendered) == [float(frame) for frame in range(1, 13)]
    for frame, values in shown.items():
        np.testing.assert_array_equal(rendered[frame], values, f"frame {frame}")
    for frame in (3, 12, 1):  # single renders, as a farm makes them
        Probe.seen.clear()
        scene.frame_set(frame)
        bpy.ops.render.render()
        ((at, values),) = Probe.seen
        assert at == frame
        np.testing.assert_array_equal(values, shown[frame])


def test_blood_that_has_not_come_yet_is_none(scene):
    """Half a second of anger: baked, no region has changed, and what the driver showed before is gone."""
    assert viewport(scene, 12)[CHEEKS] > 0.005
    bpy.ops.sanguine.bake_blood()
    assert [viewport(scene, frame)[CHEEKS] for frame in (12, 1, 6)] == [0.0, 0.0, 0.0]
    bpy.ops.sanguine.clear_blood()
    assert viewport(scene, 12)[CHEEKS] > 0.005


def test_between_frames_blood_and_face_move_together(scene):
    """As motion blur asks for it: at a quarter frame all that is driven is of that quarter."""
    low, middle, high = (viewport(scene, frame) for frame in (2.0, 2.25, 3.0))
    assert low[CHEEKS] < middle[CHEEKS] < high[CHEEKS]
    key = 1 + list(bpy.data.shape_keys[0].key_blocks.keys()).index("browDown_L")
    anger = emotion_bone(bpy.data.objects["face"])
    scene.frame_set(2, subframe=0.25)
    at = anger["anger"]
    scene.frame_set(2)
    before = anger["anger"]
    scene.frame_set(3)
    span = anger["anger"] - before
    share = (at - before) / span
    for value in (CHEEKS, key):  # both follow anger, one linearly; neither is a frame late
        assert (middle[value] - low[value]) / (high[value] - low[value]) == pytest.approx(share, abs=0.05)
    np.testing.assert_array_equal(viewport(scene, 2.25), middle)
    scene.render.engine, scene.render.use_motion_blur = Probe.bl_idname, True
    scene.frame_set(3)
    bpy.ops.render.render()
    np.testing.assert_array_equal(Probe.seen[0][1], high)


def test_saved_and_opened_shows_the_same(scene, tmp_path):
    shown = {frame: viewport(scene, frame) for frame in (1, 3, 12)}
    path = str(tmp_path / "a.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    for frame, values in shown.items():
        np.testing.assert_array_equal(viewport(bpy.context.scene, frame), values)
