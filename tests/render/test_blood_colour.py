"""Blood alone: shape frozen at neutral, what each emotion does to the colour of the cheeks."""

import bpy
import colour
import numpy as np
import pytest
from sanguine.blender.controls import AT_REST, remove_shape_key_drivers, set_controls
from sanguine.blender.face import add_face
from sanguine.blender.skin import apply_skin
from sanguine.blender.stage import set_stage
from sanguine.domain.blood import blood_change
from sanguine.domain.effects import Frame, Scene
from sanguine.domain.effects.regions import FACE_REGIONS
from sanguine.domain.parameters import default_skin
from sanguine.domain.plan import check_strengths, make_plan
from support.patch import empty_scene, mean_around, render_around, render_linear, render_only, white_world

D65 = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
WIDTH, HEIGHT = 160, 200
CHEEK_PX = 5  # half the side of the mask on each cheek
CARD_M = (0.055, 0.0, 0.0)  # from the left cheek to the white card
# The change of a* is then known to 0.04 (standard deviation over six seeds), a thirtieth of its distance to the bars.
SAMPLES = 32
EMOTIONS = ("anger", "happy", "sad", "fear")


def white_patch(beside):
    """A white Lambertian card next to the face, so that colours are relative to it."""
    mesh = bpy.data.meshes.new("white")
    x, y, z = beside
    corners = [(x - 0.02, z - 0.02), (x + 0.02, z - 0.02), (x + 0.02, z + 0.02), (x - 0.02, z + 0.02)]
    mesh.from_pydata([(cx, y, cz) for cx, cz in corners], [], [(0, 1, 2, 3)])
    card = bpy.data.objects.new("white", mesh)
    bpy.context.scene.collection.objects.link(card)
    material = bpy.data.materials.new("white")
    if not material.node_tree:
        material.use_nodes = True
    material.node_tree.nodes.clear()
    diffuse = material.node_tree.nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    output = material.node_tree.nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
    mesh.materials.append(material)
    return card


def cheeks_lab(melanin):
    """Lab of both cheeks relative to the white patch: neutral and each emotion, the head not moving."""
    scene = empty_scene(WIDTH, HEIGHT, SAMPLES)
    face = add_face("female")
    set_stage(scene, **face.stage_landmarks, size=(WIDTH, HEIGHT), lights=())
    white_world(scene)
    skin = default_skin() | {"melanin": melanin, "oil": 0.0}
    frames = (Frame("neutral"), *(Frame(name, {name: 1.0}) for name in EMOTIONS))
    plan = make_plan(Scene(skin, frames, check_strengths({}, "test"), FACE_REGIONS))
    apply_skin(face.skin, face.rig, plan)
    remove_shape_key_drivers(face.rig, bpy.data.objects)
    cheeks = [face.landmarks["cheek_left"], face.landmarks["cheek_right"]]
    card = tuple(np.add(cheeks[0], CARD_M))
    render_only(face.skin, white_patch(card))
    render_around([card, *cheeks], CHEEK_PX + 1)
    found = {}
    for name in ("neutral", *EMOTIONS):
        set_controls(face.rig, AT_REST | ({name: 1.0} if name in EMOTIONS else {}))
        image = render_linear()
        white = mean_around(image, card, 2)
        assert np.all(white > 0.5), "the white patch is not where it is looked for"
        rgb = np.mean([mean_around(image, cheek, CHEEK_PX) for cheek in cheeks], axis=0) / white
        found[name] = colour.XYZ_to_Lab(colour.RGB_to_XYZ(rgb, "sRGB"), D65)
    return found


@pytest.fixture(scope="module")
def light():
    return cheeks_lab(0.018)


@pytest.fixture(scope="module")
def dark():
    return cheeks_lab(0.25)


def test_light_skin(light):
    """The issue's bars: anger reddens the cheeks by 2 a* or more, fear pales them by 1 or more, joy reddens."""
    for name in EMOTIONS:
        change = light[name] - light["neutral"]
        hemoglobin, oxygenation = blood_change({name: 1.0}, "cheeks")
        print(f"{name}: hemoglobin {hemoglobin:+.4f}, oxygenation {oxygenation:+.3f} -> dL*a*b* {np.round(change, 2)}")
    redder = {name: light[name][1] - light["neutral"][1] for name in EMOTIONS}
    assert redder["anger"] >= 2.0
    assert redder["fear"] <= -1.0
    assert redder["happy"] > 0.5
    assert redder["sad"] < 0.0


def test_dark_skin_changes_less(light, dark):
    for name in ("anger", "fear"):
        assert abs(dark[name][1] - dark["neutral"][1]) < abs(light[name][1] - light["neutral"][1])
