"""Switches of effects: off means off, in the plan, in the shader, in what is painted, and in a SHOT.toml."""

import pytest

from sanguine.app.costs import effect_costs, map_costs
from sanguine.domain.effects import EFFECTS, Frame, Scene, grown
from sanguine.domain.effects.regions import FACE_REGIONS
from sanguine.domain.errors import InputError
from sanguine.domain.parameters import default_skin
from sanguine.domain.plan import check_strengths, default_strengths, make_plan
from sanguine.domain.shader import assemble
from sanguine.domain.shot import read_shot, scene_of
from sanguine.domain.texel_density import MapSizes

SHOT = '[rig]\nhead = "female"\n[[expression]]\nid = "anger"\nemotions = { anger = 1.0 }\n[effects]\n'
MAPS = {"skin_map": {"hemoglobin": (0.01, 0.03)}, "residual": {}}


def everything(**other):
    """A scene that calls for every effect, a rash that comes out by a state among them."""
    strengths = dict.fromkeys(default_strengths(), 1.0) | {"rash": 0.0}
    frames = (Frame("1", {"anger": 1.0, "rash": 1.0}),)
    return Scene(default_skin(), frames, strengths, FACE_REGIONS, maps=MAPS, pressure=True, **other)


SWITCHES = [effect.id for effect in EFFECTS if effect.switchable]


def test_the_scene_calls_for_every_effect():
    assert [e.id for e in EFFECTS if not make_plan(everything()).decisions[e.id].active] == []


@pytest.mark.parametrize("effect", SWITCHES)
def test_off_is_as_if_the_scene_did_not_call_for_it(effect):
    plan, off = make_plan(everything()), make_plan(everything(switched_off=frozenset({effect})))
    assert off.decisions[effect].because == "switched off" and not off.decisions[effect].active
    assert plan.fingerprint != off.fingerprint
    others = {name for name in SWITCHES if name != effect}
    assert {e.id for e in off.active} & others == {e.id for e in plan.active} & others, "the others run as before"
    # What it alone would bring is gone: its maps, its inputs.
    kept = {name for e in off.active for name in e.maps(off.scene)}
    assert set(off.maps) == kept
    assert off.entries <= plan.entries
    assert assemble(off)["surface"].source
    if effect in grown.ROWS:  # nothing of it is summed up in the maps that it shares
        assert off.scene.strengths[effect] == 0.0 and effect not in grown.keyed(off.scene)


def test_skin_has_no_switch_for_its_light():
    assert set(SWITCHES) == {e.id for e in EFFECTS} - {"scattering"}


def test_without_the_skin_map_the_slider_decides():
    off = make_plan(everything(switched_off=frozenset({"skin_map"})))
    assert "skin_map" not in off.maps and "hemoglobin" not in off.decisions["anatomy"].because


def read(tmp_path, effects):
    path = tmp_path / "shot.toml"
    path.write_text(SHOT + effects)
    return read_shot(path)


def test_false_in_a_shot_switches_off(tmp_path):
    shot = read(tmp_path, "perfusion = false\nmottle = 0.5\n")
    scene = scene_of(shot, shot.subjects[0], FACE_REGIONS)
    assert scene.switched_off == {"perfusion"} and scene.strengths["mottle"] == 0.5
    plan = make_plan(scene)
    assert plan.decisions["perfusion"].because == "switched off" and plan.decisions["oxygenation"].active
    before = read(tmp_path, "mottle = 0.5\n")
    assert "oil" in {e.id for e in make_plan(scene_of(before, before.subjects[0], FACE_REGIONS)).active}


def test_true_in_a_shot_is_on_as_it_was(tmp_path):
    shot = read(tmp_path, "strain = true\noil = true\n")
    assert not shot.switched_off and shot.subjects[0].strengths(shot.effects) == default_strengths() | {"strain": 1.0}


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ("perfusio = false", "perfusio: no effect that can be switched, did you mean 'perfusion'"),
        ("scattering = false", "scattering: no effect that can be switched"),
        ("freckels = 0.5", "freckels: no effect with a strength of its own, did you mean 'freckles'"),
        ("perfusion = 0.5", "perfusion: no effect with a strength of its own"),
        ("strain = nan", "strain: nan is outside 0 to 1"),
        ('strain = "off"', "effects.strain"),
    ],
)
def test_bad_switches_are_one_line(tmp_path, effects, message):
    with pytest.raises(InputError, match=message) as caught:
        read(tmp_path, effects)
    assert "\n" not in str(caught.value)


def test_a_skin_preset_is_the_base_of_a_shot(tmp_path):
    (tmp_path / "skin.json").write_text(
        '{"sanguine_skin": 1, "skin": {"melanin": 0.2, "oil": 0.5}, "effects": {"freckles": 0.3}, "growth": {"seed": 7}}'
    )
    path = tmp_path / "shot.toml"
    path.write_text('skin_preset = "skin.json"\n' + SHOT + "moles = 0.1\n[skin]\noil = 0.9\n")
    subject = read_shot(path).subjects[0]
    assert (subject.whole_skin()["melanin"], subject.whole_skin()["oil"], subject.growth.seed) == (0.2, 0.9, 7)
    assert {k: v for k, v in subject.strengths({"moles": 0.1}).items() if k in ("moles", "freckles")} == {"moles": 0.1, "freckles": 0.3}
    several = "\n".join(SHOT.splitlines()[2:]) + '\n[[subject]]\nid = "a"\nskin_preset = "skin.json"\nrig.head = "female"\n'
    path.write_text(several.replace("[effects]", ""))
    assert read_shot(path).subjects[0].whole_skin()["melanin"] == 0.2
    for text, message in (
        ('skin_preset = "none.json"\n' + SHOT, "none.json: no such file"),
        ('skin_preset = "skin.json"\n' + SHOT + '[person]\ntone = "light"\n', "a person or a preset, not both"),
        ('skin_preset = "skin.json"\n' + several.replace("[effects]", ""), "each its own"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=message):
            read_shot(path)


def test_costs_are_of_what_runs_and_sum_over_maps():
    plan = make_plan(everything())
    sizes = MapSizes(smooth=256, detail=512)
    megabytes = {name: cost.megabytes for name, cost in map_costs(plan, sizes, tiles=2).items()}
    assert set(megabytes) == set(plan.maps) - set(MAPS)
    assert megabytes["anatomy"] == pytest.approx(2 * 256 * 256 * 16 / 1e6)
    assert megabytes["grown"] == pytest.approx(2 * 512 * 512 * 16 / 1e6)
    costs = effect_costs(plan, megabytes)
    assert set(costs) == {e.id for e in plan.active}
    assert costs["scattering"].milliseconds > 0.0, "all entries of the table"
    assert costs["relief"].milliseconds == 0.0 and costs["relief"].megabytes == 0.0
    assert costs["freckles"].megabytes == pytest.approx(megabytes["grown"]) and costs["freckles"].shared == ("grown",)
    quiet = make_plan(Scene(default_skin(), (Frame("0"),), check_strengths({"anatomy": 0.0}, "test"), FACE_REGIONS))
    assert set(effect_costs(quiet, {})) == {e.id for e in quiet.active}


def test_the_fingerprint_follows_what_a_material_holds():
    from dataclasses import replace

    from sanguine.domain.quality import PRESETS

    scene = everything()
    plan = make_plan(scene)
    assert plan.fingerprint == make_plan(scene).fingerprint
    assert plan.fingerprint != make_plan(replace(scene, skin={**scene.skin, "melanin": 0.1})).fingerprint
    assert plan.fingerprint != make_plan(scene, PRESETS["draft"].settings).fingerprint
    more = plan.settings.model_copy(update={"samples": 7})
    assert plan.fingerprint == make_plan(scene, more).fingerprint, "samples are the scene's"
    painted = make_plan(replace(scene, maps={**scene.maps, "grown": {"log_melanin": (0.0, 0.4)}}))
    assert painted.entries < plan.entries and painted.fingerprint == plan.fingerprint, "painted: the same wishes"
