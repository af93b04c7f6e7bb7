"""The skin in OSL and its plain twin are one skin: numbers of every stage, and pictures."""

import bpy
import colour
import numpy as np
import pytest
from sanguine.blender.images import data_image
from sanguine.blender.material import build_skin_material
from sanguine.blender.osl import script_node
from sanguine.blender.plain_nodes import plain_node
from sanguine.domain.effects import Frame, Scene
from sanguine.domain.effects.regions import FACE_REGIONS
from sanguine.domain.lut import bake
from sanguine.domain.osl_graph import compile_stage
from sanguine.domain.parameters import default_skin
from sanguine.domain.plan import default_strengths, make_plan
from sanguine.domain.quality import preset
from sanguine.domain.shader import assemble
from support.patch import camera_above, empty_scene, plane, render_linear, set_sliders, white_world

ALL_ON = {name: 1.0 for name in default_strengths()}
GIVEN = {"skin_map": {"oil": (0.1, 0.9)}, "residual": {}}
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def plan_of(settings=None):
    """Everything there is, live."""
    frames = (Frame("a", {"anger": 1.0, "fear": 1.0}, moves=True),)
    return make_plan(Scene(
        default_skin() | {"oil": 0.7}, frames, ALL_ON, FACE_REGIONS, True, maps=GIVEN, shape_keys=True, pressure=True,
        presses=True,
    ), settings)


@pytest.fixture(scope="module")
def coarse():
    """A plan whose table is solved in a moment, and that table."""
    plan = plan_of(preset("draft").settings.model_copy(update={"table_step": 6.0}))
    return plan, bake(plan.axes, plan.skin, "rec709", lobes=plan.settings.lobes, walk=plan.walk)


def delta_e(a, b):
    """CIE 2000, per pixel, of linear Rec.709 under a white of 1."""
    lab = [colour.XYZ_to_Lab(np.clip(pixels @ TO_XYZ.T, 0.0, None), np.array([0.3127, 0.3290])) for pixels in (a, b)]
    return colour.delta_E(*lab, method="CIE 2000")


def drawn(stage, source, output, shading):
    """One output of a stage over 32 x 32 places, its other inputs at numbers of their own: (H, W, 3)."""
    scene = empty_scene(32, 32, 1)
    scene.cycles.shading_system = shading == "OSL"
    scene.cycles.pixel_filter_type = "BOX"
    material = bpy.data.materials.new("stage")
    if not material.node_tree:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    node = script_node(tree, stage, source) if shading == "OSL" else plain_node(tree, stage, compile_stage(stage, source), data_image)
    numbers = np.random.default_rng(5)
    for socket in node.inputs:
        if socket.name == "rest_mm":
            place = tree.nodes.new("ShaderNodeVectorMath")
            place.operation = "MULTIPLY_ADD"
            place.inputs[1].default_value, place.inputs[2].default_value = (900.0, 700.0, 0.0), (3.0, -2.0, 1.5)
            tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Position"], place.inputs[0])
            tree.links.new(place.outputs[0], socket)
        elif socket.type == "RGBA":
            socket.default_value = (*numbers.uniform(0.02, 0.3, 3), 1.0)
        else:
            socket.default_value = numbers.uniform(0.02, 0.1)
    emission = tree.nodes.new("ShaderNodeEmission")
    shown = node.outputs[output]
    if shown.type == "VALUE":
        three = tree.nodes.new("ShaderNodeCombineXYZ")
        for target in three.inputs:
            tree.links.new(shown, target)
        shown = three.outputs[0]
    tree.links.new(shown, emission.inputs["Color"])
    tree.links.new(emission.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    plane(material)
    camera_above(20.0)
    return render_linear()


@pytest.mark.parametrize("stage", ["chromophores", "slopes", "relief"])
def test_every_number_of_a_stage_is_the_same(stage):
    """All effects on. Within the rounding of a chain of some 200 single-precision operations, exponentials among them."""
    source = assemble(plan_of())[stage].source
    varied = 0
    for port in compile_stage(stage, source).outputs:
        osl, nodes = (drawn(stage, source, port.name, shading) for shading in ("OSL", "NODES"))
        varied += osl.std() > 1e-3
        np.testing.assert_allclose(nodes, osl, rtol=3e-5, atol=1e-6, err_msg=port.name)
    assert varied, "noise, at least, makes places differ"


def ball(shading, plan, table, melanin):
    """All effects, maps of soft numbers: a ball of 8 cm, half in the light of one lamp."""
    scene = empty_scene(48, 48, 16)
    white_world(scene)
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.3
    scene.cycles.shading_system = shading == "OSL"
    scene.cycles.max_bounces = 4
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.04, segments=48, ring_count=24)
    skin = bpy.context.object
    bpy.ops.object.shade_smooth()
    rest = skin.data.attributes.new("rest_mm", "FLOAT_VECTOR", "POINT")
    rest.data.foreach_set("vector", np.ravel([1000.0 * vertex.co for vertex in skin.data.vertices]))
    pressed = skin.data.attributes.new("sanguine_pressure", "FLOAT", "POINT")
    pressed.data.foreach_set("value", [float(vertex.co.z > 0.02) for vertex in skin.data.vertices])
    thin = skin.data.attributes.new("sanguine_thin", "FLOAT", "POINT")
    thin.data.foreach_set("value", [0.7 * (vertex.co.y < 0.0) for vertex in skin.data.vertices])
    numbers = np.random.default_rng(2)
    maps = {key: numbers.uniform(0.0, 0.4, (6, 6, 4)).astype(np.float32) for key in plan.maps}
    maps["anatomy"] += (0.8, 0.8, 0.8, -0.2)
    maps["residual"] += 0.7
    for name in [name for name in maps if "_slope" in name]:
        maps[name] -= 0.2  # up and down, as relief is: sums of them tilt by some tens of degrees
    inputs = {item.key for fragment in plan.fragments for item in fragment.inputs if item.source == "object"}
    for name in inputs:
        skin[name] = [0.3, 0.2, 0.1] if name.startswith(("strain_", "wrinkles_")) else [0.01, 0.005, 0.002]
    material = build_skin_material("twin", plan, maps, table, shading)
    set_sliders(material, {"melanin": melanin})
    skin.data.materials.append(material)
    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "AREA"))
    lamp.data.energy, lamp.data.size, lamp.location = 1.5, 0.05, (0.25, 0.0, 0.25)
    lamp.rotation_euler = (0.0, 0.7854, 0.0)
    scene.collection.objects.link(lamp)
    camera_above(90.0)
    return render_linear()


@pytest.mark.parametrize("melanin", [0.015, 0.3])
def test_a_picture_is_the_same(coarse, melanin):
    """The issue's bar is a median of 1. Twins that take the same random numbers differ by rounding alone, of which a
    sample here and there makes another path: so the median is nothing and only the last few pixels may differ."""
    osl, nodes = (ball(shading, *coarse, melanin) for shading in ("OSL", "NODES"))
    assert osl.std() > 0.05, "there is a ball in the picture"
    thick, thin = slice(26, None), slice(0, 22)  # rows above the middle, and below it
    difference = delta_e(osl[thick], nodes[thick])
    print(f"median {np.median(difference):.4f}, 95 % {np.percentile(difference, 95):.4f}, most {difference.max():.2f}")
    if bpy.app.version >= (4, 3):
        assert np.median(difference) < 0.01
        assert np.percentile(difference, 95) < 0.2
    else:  # 4.2 weighs the film of the two otherwise when it picks a path: 256 samples agree within 0.0007, 16 are noise
        assert np.median(difference) < 0.3
        np.testing.assert_allclose(nodes[thick].mean((0, 1)), osl[thick].mean((0, 1)), rtol=0.01)
    # There a walk of three channels is three walks of one: the same light by other paths, and their noise between them
    # (some 16,000 paths of a spread about their mean: 1 % and its threefold).
    print("thin parts", nodes[thin].mean((0, 1)) / osl[thin].mean((0, 1)))
    assert np.abs(nodes[thin] - osl[thin]).max() > 0.01, "there is a walk"
    np.testing.assert_allclose(nodes[thin].mean((0, 1)), osl[thin].mean((0, 1)), rtol=0.03)
