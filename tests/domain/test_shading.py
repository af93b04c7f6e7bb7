"""What a skin is made of where: a rule of facts, with its reason."""

import pytest
from sanguine.app.planning import plan_report
from sanguine.domain.effects.regions import FACE_REGIONS
from sanguine.domain.errors import InputError
from sanguine.domain.shading import AUTO, NODES, OSL, Renderer, choose, not_shown
from sanguine.domain.shot import read_shot

DEBIAN = "the Cycles of this Blender was built without OSL"
SHOT = '[rig]\nhead = "female"\n[image]\n{}\n[[expression]]\nid = "a"\n'


@pytest.mark.parametrize("renderer", [
    Renderer(), Renderer(device="OPTIX"), Renderer(device="METAL"), Renderer("BLENDER_EEVEE_NEXT"), Renderer(no_osl=DEBIAN),
])
def test_automatic_renders_everywhere(renderer):
    choice = choose(AUTO, renderer)
    assert choice.shading == NODES and choice.because in choice.line
    assert not_shown(choice.shading, renderer) == "", "what it chooses is shown"


def test_asked_for_is_asked_for():
    assert choose(NODES, Renderer()).shading == NODES
    assert choose(OSL, Renderer("BLENDER_EEVEE")).shading == OSL, "an artist may look at it in Cycles later"
    with pytest.raises(InputError, match="material is OSL, but the Cycles of this Blender was built without OSL"):
        choose(OSL, Renderer(no_osl=DEBIAN))
    with pytest.raises(InputError, match="no such kind 'GLSL'"):
        choose("GLSL", Renderer())


@pytest.mark.parametrize(("shading", "renderer", "says"), [
    (OSL, Renderer("BLENDER_EEVEE"), "Only Cycles"),
    (OSL, Renderer(no_osl=DEBIAN), "apply it again"),
    (OSL, Renderer(device="HIP"), "No OSL on HIP"),
    (NODES, Renderer("BLENDER_WORKBENCH"), "Only Cycles and EEVEE"),
    (NODES, Renderer("BLENDER_EEVEE"), ""),
    (OSL, Renderer(), ""),
    (NODES, Renderer(no_osl=DEBIAN, device="HIP"), ""),
])
def test_the_panel_knows_what_is_not_shown(shading, renderer, says):
    said = not_shown(shading, renderer)
    assert says in said and bool(says) == bool(said)


def test_eevee_reads_eight_properties():
    assert not_shown(NODES, Renderer("BLENDER_EEVEE"), 8) == "" == not_shown(NODES, Renderer(), 30)
    assert "8 of 9" in not_shown(NODES, Renderer("BLENDER_EEVEE"), 9)


def test_a_shot_names_its_material_and_the_plan_says_why(tmp_path):
    path = tmp_path / "shot.toml"
    for text, expected in (("", "nodes"), ('material = "nodes"', "nodes"), ('material = "osl"', "osl")):
        path.write_text(SHOT.format(text))
        said = plan_report(read_shot(path), FACE_REGIONS)["material"]
        assert said["shading"] == expected and said["because"]
    path.write_text(SHOT.format('material = "osl"'))
    with pytest.raises(InputError, match="built without OSL"):
        plan_report(read_shot(path), FACE_REGIONS, renderer=Renderer(no_osl=DEBIAN))
    path.write_text(SHOT.format('material = "glsl"'))
    with pytest.raises(InputError, match="image.material"):
        read_shot(path)
