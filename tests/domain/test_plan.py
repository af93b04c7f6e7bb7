"""The planner: only what the scene calls for, and the reason why."""

import math
import re

import pytest
from sanguine.domain.blood import ANATOMY
from sanguine.domain.effects import EFFECTS, Frame, Scene
from sanguine.domain.errors import InputError
from sanguine.domain.facs import EMOTION_CONTROLS
from sanguine.domain.parameters import PARAMETERS, default_skin
from sanguine.domain.plan import check_strengths, make_plan
from sanguine.domain.shader import assemble
from sanguine.domain.strain import HIGH, LOW

REGIONS = tuple(ANATOMY)


def scene(frames=({},), strengths=None, regions=REGIONS, live=False, **skin):
    return Scene(
        skin=default_skin() | skin,
        frames=tuple(Frame(str(i), emotions) for i, emotions in enumerate(frames)),
        strengths=check_strengths(strengths or {}, "test"),
        regions=regions,
        live=live,
    )


def active(plan):
    return {effect.id for effect in plan.active}


def test_bare_skin_runs_scattering_alone():
    plan = make_plan(scene(strengths={"anatomy": 0}, oil=0.0))
    assert active(plan) == {"scattering"}
    assert plan.axes == () and plan.entries == 1
    assert plan.fragments == () and plan.maps == ()


@pytest.mark.parametrize("live", [False, True])
def test_constants_of_the_skin_get_no_axis_and_no_instruction(live):
    emotions = ({}, {"anger": 1.0})
    plain = make_plan(scene(emotions, live=live))
    for change in ({"scatter_scale": 0.8}, {"scatter_power": 0.5}, {"vessel_radius_mm": 0.01}, {"bilirubin_umol_per_l": 40.0},
                   {"ink_per_mm": 3.0}):
        plan = make_plan(scene(emotions, live=live, **change))
        assert plan.axes == plain.axes and plan.maps == plain.maps
        assert {k: s.source for k, s in assemble(plan).items()} == {k: s.source for k, s in assemble(plain).items()}


def test_neutral_face_has_no_blood_effect_and_no_region_maps():
    plan = make_plan(scene())
    assert not active(plan) & {"perfusion", "oxygenation"}
    assert plan.maps == ("anatomy",)


def test_anger_needs_blood_and_says_in_which_frames():
    plan = make_plan(scene(frames=({}, {"anger": 0.3})))
    decision = plan.decisions["perfusion"]
    assert decision.active and decision.frames == ("1",) and "anger" in decision.because
    assert {axis.id for axis in plan.axes} >= {"hemoglobin", "oxygenation"}


def test_blood_of_zero_strength_is_no_blood():
    quiet = Scene(default_skin(), (Frame("0", {"anger": 1.0}, blood=0.0),), check_strengths({}, "test"), REGIONS)
    assert not active(make_plan(quiet)) & {"perfusion", "oxygenation"}


def test_face_without_masks_has_no_regional_effect():
    plan = make_plan(scene(frames=({"anger": 1.0},), regions=()))
    assert not active(plan) & {"anatomy", "perfusion", "oxygenation"}
    assert "no region masks" in plan.decisions["perfusion"].because


@pytest.mark.parametrize("effect", [e for e in EFFECTS if e.id != "scattering"], ids=lambda e: e.id)
def test_no_trace_of_an_inactive_effect(effect):
    """Neither its inputs nor its code are in the shader, whichever effect is off."""
    full = scene(frames=({"anger": 1.0},), strengths={"relief": 1, "anatomy": 1}, oil=0.5)
    plan = make_plan(full)
    files = {fragment.file for fragment in effect.fragments(full)}
    assert files
    mine = {item.name for fragment in effect.fragments(full) for item in fragment.inputs}
    others = {item.name for other in plan.fragments if other.file not in files for item in other.inputs}
    without = plan.without(effect.id)
    assert not files & {f.file for f in without.fragments}
    text = "".join(shader.source for shader in assemble(without).values())
    for name in mine - others:
        declared = re.search(rf"^ +(float|color|vector) {name} = ", text, re.MULTILINE)
        assert not declared, f"{name} is an input though {effect.id} is off"
    assert without.entries <= plan.entries


@pytest.mark.parametrize("emotion", EMOTION_CONTROLS)
def test_axes_hold_every_value_that_is_reached(emotion):
    from sanguine.domain.blood import blood_change

    plan = make_plan(scene(frames=({}, {emotion: 1.0})))
    skin = default_skin()
    ranges = {axis.id: axis for axis in plan.axes}
    for region in REGIONS:
        rest = ANATOMY[region]
        change = blood_change({emotion: 1.0}, region)
        reached = {
            "hemoglobin": skin["hemoglobin"] * rest.hemoglobin + change[0],
            "oxygenation": skin["oxygenation"] + rest.oxygenation + change[1],
            "melanin": skin["melanin"] * rest.melanin,
        }
        for name, value in reached.items():
            value = min(max(value, PARAMETERS[name].hard_min), PARAMETERS[name].hard_max)
            assert ranges[name].low <= value * (1 + 1e-9) and value <= ranges[name].high * (1 + 1e-9), (region, name)


def test_live_axes_reach_as_far_as_the_sliders():
    axes = {axis.id: axis for axis in make_plan(scene(live=True, frames=(dict.fromkeys(EMOTION_CONTROLS, 1.0),))).axes}
    assert axes["hemoglobin"].high >= PARAMETERS["hemoglobin"].soft_max
    assert axes["melanin"].high >= PARAMETERS["melanin"].soft_max


def test_unknown_strength_is_an_error_with_a_hint():
    with pytest.raises(InputError, match="relief"):
        check_strengths({"releif": 1.0}, "shot.toml: effects")


def test_strain_and_wrinkles_run_where_shape_keys_move():
    asked = {"strain": 1.0, "wrinkles": 1.0}
    still = dict(skin=default_skin(), strengths=check_strengths(asked, "test"), regions=REGIONS)
    happy, neutral = Frame("happy", {"happy": 1.0}), Frame("neutral", moves=False)
    plan = make_plan(Scene(frames=(neutral, happy), **still))
    assert {"strain", "wrinkles"} <= active(plan)
    assert plan.decisions["strain"].frames == ("happy",)
    assert not active(make_plan(Scene(frames=(neutral,), **still))) & set(asked)
    assert not active(make_plan(Scene(frames=(happy,), shape_keys=False, **still))) & set(asked)
    off = make_plan(scene(frames=({"happy": 1.0},)))
    assert not [name for name in off.maps if name.startswith(("strain", "wrinkles"))]
    assert off.decisions["strain"].because == "its strength is 0"


def test_strain_and_pressure_widen_the_axis_of_blood_and_nothing_else():
    def axes(**given):
        return {a.id: (a.low, a.high) for a in make_plan(Scene(default_skin(), (Frame("a"),), **given)).axes}

    assert axes() == {}
    blood = default_skin()["hemoglobin"]
    strained = axes(strengths=check_strengths({"strain": 1.0, "anatomy": 0.0}, "test"))
    assert strained == {"hemoglobin": pytest.approx((blood * math.exp(LOW), blood * math.exp(HIGH)))}
    pressed = axes(strengths=check_strengths({"anatomy": 0.0}, "test"), pressure=True)
    assert pressed == {"hemoglobin": pytest.approx((blood * 0.3, blood))}
    assert axes(strengths=check_strengths({"anatomy": 0.0}, "test"), pressure=False) == {}
