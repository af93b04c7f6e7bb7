"""The plan with what comes in maps: features that grow, a skin map, a residual. What is off leaves no trace."""

import math
import re

import numpy as np
import pytest
import sanguine_core
from sanguine.app.maps import reached
from sanguine.domain.blood import ANATOMY
from sanguine.domain.effects import EFFECTS, Frame, Scene, grown
from sanguine.domain.lut import bake, layout
from sanguine.domain.parameters import PARAMETERS, default_skin
from sanguine.domain.plan import check_strengths, default_strengths, make_plan
from sanguine.domain.shader import assemble
from support.features import declare

REGIONS = tuple(ANATOMY)
WHOLE = {"hemoglobin": (0.004, 0.05), "melanin": (0.01, 0.08), "oil": (0.1, 0.6), "oxygenation": (0.5, 0.9)}


def scene(frames=({},), strengths=None, regions=REGIONS, live=False, maps=None, **skin):
    return Scene(
        skin=default_skin() | skin,
        frames=tuple(Frame(str(i), emotions) for i, emotions in enumerate(frames)),
        strengths=check_strengths(strengths or {}, "test"),
        regions=regions,
        live=live,
        maps=maps or {},
    )


def axes(plan):
    return {axis.id: axis for axis in plan.axes}


def sources(plan):
    return {stage: shader.source for stage, shader in assemble(plan).items()}


def test_every_native_feature_is_an_effect_that_is_off():
    ids = [effect.id for effect in EFFECTS]
    for row in sanguine_core.features():
        assert default_strengths()[row["id"]] == 0.0
        assert ids.index("skin_map") < ids.index(row["id"]) < ids.index("perfusion")
        effect = EFFECTS[ids.index(row["id"])]
        assert effect.label == row["label"] and row["help"].rstrip(".") in effect.help and "again" in effect.help
        assert row["source"].rstrip(".") in effect.help
    assert not [e for e in make_plan(scene(live=True)).active if e.id in grown.ROWS]


def test_a_feature_widens_what_it_changes(monkeypatch):
    declare(monkeypatch, "spotted", log_melanin=(-0.5, 1.0), log_hemoglobin=(0.0, 0.8), oxygenation=(-0.2, 0.0))
    plan = make_plan(scene(strengths={"spotted": 0.5, "anatomy": 0.0}, oil=0.0))
    skin, found = default_skin(), axes(plan)
    assert set(found) == {"hemoglobin", "melanin", "oxygenation"}
    assert (found["melanin"].low, found["melanin"].high) == pytest.approx(
        (skin["melanin"] * math.exp(-0.25), skin["melanin"] * math.exp(0.5)))
    assert (found["hemoglobin"].low, found["hemoglobin"].high) == pytest.approx(
        (skin["hemoglobin"], skin["hemoglobin"] * math.exp(0.4)))
    assert (found["oxygenation"].low, found["oxygenation"].high) == pytest.approx(
        (skin["oxygenation"] - 0.1, skin["oxygenation"]))
    assert plan.maps == ("grown",)
    text = sources(plan)["chromophores"]
    assert "#define GROWN_LOG_MELANIN 1\n" in text and "#define GROWN_LOG_OIL 0\n" in text
    assert "color grown = " in text and "float grown_oxygenation = " in text and "relief" not in sources(plan)


def brought_out(level, **strengths):
    """A still whose state of the body brings a rash out, as far as `level`."""
    return Scene(default_skin(), (Frame("still", {"rash": level}),), {"anatomy": 0.0, "oil": 0.0, **strengths}, ("cheeks",))


def test_a_state_brings_a_feature_out_by_a_strength_of_its_own():
    plan = make_plan(brought_out(0.5))
    rash = grown.ROWS["rash"]
    most = {change["channel"]: change["high"] for change in rash["changes"]}
    assert plan.maps == ("keyed_rash", "keyed_rash_slope")
    assert axes(plan)["hemoglobin"].high == pytest.approx(default_skin()["hemoglobin"] * math.exp(0.5 * most["log_hemoglobin"]))
    assert axes(plan)["oxygenation"].high == pytest.approx(default_skin()["oxygenation"] + 0.5 * most["oxygenation"])
    inputs = {item.name: item.source for fragment in plan.fragments for item in fragment.inputs}
    ((name, parts),) = plan.packed.items()
    number = f"{name}[{parts.index('blood_feature_rash')}]"
    assert inputs[name] == "object" and inputs["keyed_rash"] == "map" and [part for part in parts if part] == ["blood_feature_rash"]
    text = sources(plan)
    assert f"keyed_rash[0] * clamp({number}, 0.0, 1)" in text["chromophores"] and "grown" not in inputs
    assert f"vector(keyed_rash_slope) * clamp({number}, 0.0, 1)" in text["slopes"] and "relief" not in text
    assert "state of the body" in plan.decisions["rash"].because and plan.decisions["rash"].frames == ("still",)


def test_what_is_brought_out_comes_on_top_of_what_is_there():
    """Together never more than the whole layer; and a layer that is there in full leaves nothing to bring out."""
    plan, full = make_plan(brought_out(1.0, rash=0.3)), make_plan(brought_out(1.0, rash=1.0))
    assert set(plan.maps) == {"grown", "grown_slope", "keyed_rash", "keyed_rash_slope"}
    assert re.search(r"keyed_rash\[0\] \* clamp\(blood_packed_others_\d\[\d\], 0.0, 0.7\)", sources(plan)["chromophores"])
    assert axes(plan)["hemoglobin"].high == pytest.approx(axes(full)["hemoglobin"].high)
    assert set(full.maps) == {"grown", "grown_slope"}


def test_a_layer_that_is_painted_says_how_far_it_goes():
    before = make_plan(brought_out(0.5))
    layer = np.zeros((2, 2, 4), dtype=np.float32)
    layer[0, 0, 0] = 0.8
    after = reached(before, {"keyed_rash": {1001: layer}, "keyed_rash_slope": {1001: np.zeros((2, 2, 3), np.float32)}})
    assert axes(after)["hemoglobin"].high == pytest.approx(default_skin()["hemoglobin"] * math.exp(0.4))
    assert "oxygenation" not in axes(after) and after.maps == before.maps


def test_a_state_that_is_not_there_brings_nothing_out():
    plan = make_plan(brought_out(0.0))
    assert plan.maps == () and "keyed" not in "".join(sources(plan).values())


def test_painted_features_reach_as_far_as_their_sum(monkeypatch):
    """Two features that hardly meet: the table holds what the map holds, and the shader stays as it is."""
    declare(monkeypatch, "spotted", log_melanin=(0.0, 1.5))
    declare(monkeypatch, "inked", log_melanin=(-0.5, 1.0), ink_per_mm=(0.0, 6.0))
    before = make_plan(scene(strengths={"spotted": 1.0, "inked": 0.5, "anatomy": 0.0}))
    image = np.zeros((2, 2, 4), dtype=np.float32)
    image[0, 0, 1], image[1, 1, 1] = -0.2, 1.4
    ink = np.array([0.0, 0.0, 0.0, 2.0], dtype=np.float32).reshape(2, 2, 1)
    after = reached(before, {"grown": {1001: image, 1002: image * 0.5}, "grown_ink": ink, "anatomy": ink})
    melanin = default_skin()["melanin"]
    assert (axes(before)["melanin"].low, axes(before)["melanin"].high) == pytest.approx(
        (melanin * math.exp(-0.25), melanin * math.exp(2.0)))
    assert (axes(after)["melanin"].low, axes(after)["melanin"].high) == pytest.approx(
        (melanin * math.exp(-0.2), melanin * math.exp(1.4)))
    assert axes(after)["ink_per_mm"].high == 2.0 and after.entries < before.entries
    assert after.maps == before.maps and [f.file for f in after.fragments] == [f.file for f in before.fragments]
    assert reached(before, {"anatomy": ink}) is before


def test_features_share_maps_and_fragments(monkeypatch):
    declare(monkeypatch, "spotted", log_melanin=(0.0, 1.0))
    declare(monkeypatch, "bumpy", log_hemoglobin=(0.0, 1.0), height_mm=(0.0, 0.3))
    plan = make_plan(scene(strengths={"spotted": 1.0, "bumpy": 1.0}))
    assert [f.file for f in plan.fragments].count("grown.osl") == 1
    text = sources(plan)
    assert text["chromophores"].count("melanin *= exp(grown[1])") == 1
    assert "#define GROWN_LOG_HEMOGLOBIN 1\n" in text["chromophores"]
    assert "slope += vector(grown_slope)" in text["slopes"] and "relief" not in text
    assert set(plan.maps) == {"anatomy", "grown", "grown_slope"}
    # Each alone leaves nothing of the other.
    assert "slopes" not in sources(plan.without("bumpy"))
    assert "#define GROWN_LOG_HEMOGLOBIN 0\n" in sources(plan.without("bumpy"))["chromophores"]


@pytest.mark.parametrize("live", [False, True])
def test_ink_is_an_axis_only_where_a_tattoo_is(monkeypatch, live):
    declare(monkeypatch, "inked", ink_per_mm=(0.0, 6.0))
    frames = ({}, {"anger": 1.0})
    off = make_plan(scene(frames, live=live, ink_per_mm=0.5))
    assert "ink_per_mm" not in axes(off) and off.skin["ink_per_mm"] == 0.5
    assert "ink" not in "".join(sources(off).values())
    plan = make_plan(scene(frames, {"inked": 0.5}, live=live, ink_per_mm=0.5))
    assert [axis.id for axis in plan.axes] == ["hemoglobin", "melanin", "oxygenation", "ink_per_mm"]
    ink = axes(plan)["ink_per_mm"]
    if live:
        assert ink.low == 0.0 and ink.high == pytest.approx(PARAMETERS["ink_per_mm"].soft_max + 3.0)
    else:
        assert (ink.low, ink.high) == pytest.approx((0.5, 3.5))
    surface = sources(plan)["surface"]
    assert "#define SLICES 2\n" in surface
    assert "weight_0_next" in surface and "table_mix" in sources(plan)["chromophores"]


def test_a_declared_feature_that_is_off_changes_nothing(monkeypatch):
    frames = ({}, {"anger": 1.0})
    plain = make_plan(scene(frames, {"anatomy": 0.5, "relief": 0.5}))
    declare(monkeypatch, "inked", ink_per_mm=(0.0, 6.0), height_mm=(0.0, 0.1), log_oil=(0.0, 1.0))
    plan = make_plan(scene(frames, {"anatomy": 0.5, "relief": 0.5}))
    assert sources(plan) == sources(plain) and plan.axes == plain.axes and plan.maps == plain.maps
    assert not {"grown", "skin_map", "residual"} & set(plan.maps)
    for text in sources(plan).values():
        assert "grown" not in text and "skin_map" not in text and "residual" not in text


def test_a_skin_map_stands_in_the_skins_place():
    plan = make_plan(scene(maps={"skin_map": WHOLE}))
    found = axes(plan)
    for name in ("hemoglobin", "melanin", "oxygenation"):
        assert (found[name].low, found[name].high) == WHOLE[name]
    assert plan.decisions["skin_map"].active
    assert not plan.decisions["anatomy"].active and "skin map" in plan.decisions["anatomy"].because
    assert "skin map" in plan.decisions["oil"].because
    assert plan.maps == ("skin_map",)
    text = sources(plan)["chromophores"]
    assert "oil = skin_map[2]" in text and "#define SKIN_MAP_OIL 1\n" in text


def test_anatomy_keeps_what_the_map_does_not_hold():
    held = {name: WHOLE[name] for name in ("hemoglobin", "melanin")}
    plan = make_plan(scene(maps={"skin_map": held}))
    decision = plan.decisions["anatomy"]
    assert decision.active and "oil, oxygenation alone" in decision.because
    assert (axes(plan)["melanin"].low, axes(plan)["melanin"].high) == WHOLE["melanin"]
    rest = [ANATOMY[region].oxygenation for region in REGIONS]
    assert axes(plan)["oxygenation"].high == pytest.approx(default_skin()["oxygenation"] + max(0.0, *rest))
    text = sources(plan)["chromophores"]
    # The map comes after and stands: no density is multiplied into it.
    assert text.index("hemoglobin *= mix") < text.index("hemoglobin = skin_map[0]")
    assert "#define SKIN_MAP_OIL 0\n" in text and "skin_map_oxygenation" not in text.split("shader sanguine")[1].split("{")[0]


def test_blood_and_features_come_on_top_of_the_map(monkeypatch):
    declare(monkeypatch, "spotted", log_melanin=(0.0, 1.0))
    plan = make_plan(scene(frames=({}, {"anger": 1.0}), strengths={"spotted": 1.0}, maps={"skin_map": WHOLE}))
    found = axes(plan)
    assert found["melanin"].high == pytest.approx(WHOLE["melanin"][1] * math.e)
    assert found["hemoglobin"].high > WHOLE["hemoglobin"][1]
    text = sources(plan)["chromophores"]
    places = [text.index(line) for line in ("melanin = skin_map[1]", "melanin *= exp(grown[1])", "hemoglobin += HEMOGLOBIN")]
    assert places == sorted(places)


def test_a_map_of_one_value_needs_no_axis_and_is_the_value():
    held = {"hemoglobin": (0.03, 0.03), "melanin": (0.06, 0.06), "oxygenation": (0.5, 0.5)}
    plan = make_plan(scene(strengths={"anatomy": 0.0}, maps={"skin_map": held}, oil=0.0))
    assert plan.axes == () and plan.skin == default_skin() | {"oil": 0.0, "hemoglobin": 0.03, "melanin": 0.06, "oxygenation": 0.5}
    assert bake(plan.axes, plan.skin, "rec709").image.shape[:2] == layout(()).shape


def test_a_map_that_holds_nothing_known_is_inactive():
    plan = make_plan(scene(maps={"skin_map": {"melanine": (0.0, 1.0)}}))
    assert not plan.decisions["skin_map"].active and "none of" in plan.decisions["skin_map"].because
    assert plan.decisions["anatomy"].active


def test_a_residual_costs_a_map_and_one_fragment():
    plain, plan = make_plan(scene()), make_plan(scene(maps={"residual": {}}))
    assert plan.axes == plain.axes and plan.entries == plain.entries
    assert plan.maps == (*plain.maps, "residual")
    assert sources(plan)["chromophores"] == sources(plain)["chromophores"]
    surface = sources(plan)["surface"]
    assert surface.index("residual") < surface.index("film * dielectric_bsdf")
    assert not plain.decisions["residual"].active and "no residual" in plain.decisions["residual"].because
