"""Thin parts: the walk lets through what the skin's own layers do, and costs nothing where it does not run."""

import re

import numpy as np
import pytest
import sanguine_core
from sanguine.app.costs import effect_costs
from sanguine.domain import walk
from sanguine.domain.effects import Frame, Scene
from sanguine.domain.effects.thin import FULL_MM, GONE_MM, lit_share, thinness
from sanguine.domain.lut import LOBES, bake, entry_skins, layout, quantity_count
from sanguine.domain.parameters import default_skin, skin_rows
from sanguine.domain.plan import make_plan, spaced
from sanguine.domain.quality import DEFAULT, preset
from sanguine.domain.shader import assemble, lobe_sockets

NM = np.arange(380.0, 781.0, 10.0)
SKINS = {
    name: default_skin() | {"melanin": melanin, "hemoglobin": hemoglobin}
    for name, melanin, hemoglobin in (("light", 0.014, 0.011), ("dark", 0.134, 0.020), ("deep", 0.300, 0.020))
}


def plan(strength, skin=None, live=False):
    return make_plan(Scene(skin or default_skin(), (Frame("0"),), {"thin": strength}, live=live), preset(DEFAULT).settings)


def reflectance_rgb(rows):
    return sanguine_core.linear_rgb(sanguine_core.xyz(sanguine_core.reflectance(rows, NM), NM))


def test_what_is_off_is_in_neither_table_nor_shader():
    off, on = plan(0.0), plan(1.0)
    assert not off.decisions["thin"].active and on.decisions["thin"].active
    assert not re.search(r"walk|\bthin\b|sanguine_thin", assemble(off)["surface"].source)
    assert "random_walk_skin" in assemble(on)["surface"].source
    assert assemble(off)["chromophores"].source.replace(str(float(layout((), off.settings.lobes).shape[1])), "") == assemble(on)[
        "chromophores"
    ].source.replace(str(float(layout((), on.settings.lobes, True).shape[1])), "")
    assert quantity_count(LOBES, False) == len(lobe_sockets()) == 8
    assert quantity_count(LOBES, True) == len(lobe_sockets(walk=True)) == 10


def test_lobes_of_the_table_are_the_same_with_a_walk_beside_them():
    axes = (spaced("hemoglobin", 0.01, 0.03, 1.0), spaced("melanin", 0.01, 0.02, 1.0))
    without = bake(axes, default_skin(), "rec709")
    table = bake(axes, default_skin(), "rec709", walk=True)
    assert table.image.shape == (*layout(axes, LOBES, True).shape, 3)
    columns = without.image.shape[1]
    np.testing.assert_array_equal(table.image[:, :columns], without.image)
    assert table.quantity_offset(8) == columns / table.image.shape[1]
    beyond = table.image[:, columns:].reshape(axes[1].count, 2, axes[0].count, 3)
    rows = entry_skins(axes, default_skin())
    exact = walk.walk_of(rows, reflectance_rgb(rows), "rec709").reshape(axes[1].count, axes[0].count, 2, 3)
    # The lobes' sum stands for the reflectance there, which their fit follows within 1e-3.
    np.testing.assert_allclose(beyond.transpose(0, 2, 1, 3), exact, rtol=5e-3)


@pytest.mark.parametrize("space", ["rec709", "acescg"])
@pytest.mark.parametrize("name", SKINS)
def test_the_walk_lets_through_what_the_skin_does(name, space):
    """Cube roots, as the eye judges, of the light through 1 to 6 mm. 0.02 is two steps of L*, at the least light 0.003 that
    counts; measured at most 0.018, in the green of light skin at 1.5 to 2 mm."""
    rows = skin_rows([SKINS[name]])
    back = sanguine_core.linear_rgb(sanguine_core.xyz(sanguine_core.reflectance(rows, NM), NM), space)
    albedo, mfp_mm = walk.match_walk(back, walk.slab_rgb(rows, space))
    share = back / walk.albedo_in_walk(albedo)
    assert np.all(share > 0.0) and np.all(share <= 1.0 + 1e-6)
    thicknesses = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
    skin = np.maximum(walk.slab_rgb(rows, space, thicknesses)[0], 0.0)
    let = np.stack([share * walk.walk_slab(albedo, t / mfp_mm) for t in thicknesses])[:, 0]
    assert np.abs(np.cbrt(let + 0.003) - np.cbrt(skin + 0.003)).max() < 0.02
    # Red is what glows: within 6 % wherever more than a hundredth comes through.
    seen = skin[:, 0] > 0.01
    np.testing.assert_allclose(let[seen, 0], skin[seen, 0], rtol=0.06)


def test_slabs_of_many_skins_are_those_of_each():
    """3 % in red (at most 2.6 % measured): a few nodes of absorption stand for all, from no melanin to the most."""
    random = np.random.default_rng(3)
    rows = np.repeat(skin_rows([default_skin()]), 200, axis=0)
    columns = list(default_skin())
    for key, low, high in (("melanin", 5e-4, 0.43), ("hemoglobin", 5e-4, 0.2)):
        rows[:, columns.index(key)] = np.exp(random.uniform(np.log(low), np.log(high), len(rows)))
    rows[:, columns.index("oxygenation")] = random.uniform(0.2, 1.0, len(rows))
    together = walk.slab_rgb(rows, "rec709", (2.0, 6.0))
    for k in range(0, len(rows), 25):
        alone = walk.slab_rgb(rows[k : k + 1], "rec709", (2.0, 6.0))[0]
        np.testing.assert_allclose(together[k][:, 0], alone[:, 0], rtol=0.03)


def test_between_entries_of_the_table_the_walk_is_the_skins():
    """Albedo and radius are interpolated as an image is; the light through 2 mm then stays within 3 % in red."""
    axis = spaced("melanin", 0.005, 0.3, 1.0)
    rows = entry_skins((axis,), default_skin())
    found = walk.walk_of(rows, reflectance_rgb(rows), "rec709")
    middle = [default_skin() | {"melanin": axis.value((k + 0.5) / (axis.count - 1))} for k in range(axis.count - 1)]
    rows = skin_rows(middle)
    albedo, radius_mm = (0.5 * (found[1:, k] + found[:-1, k]) for k in range(2))
    share = reflectance_rgb(rows) / walk.albedo_in_walk(albedo)
    let = share * walk.walk_slab(albedo, 2.0 / (radius_mm / walk.radius_per_mfp(albedo)))
    np.testing.assert_allclose(let[:, 0], walk.slab_rgb(rows, "rec709", (2.0,))[:, 0, 0], rtol=0.03)


def test_no_skin_of_the_schema_breaks_the_match():
    """Its corners, where channels are black, white or out of gamut: finite, in range, no energy gained."""
    corners = []
    for melanin in (0.0, 0.43):
        for hemoglobin in (0.0, 0.2):
            for ink in (0.0, 6.0):
                corners.append(default_skin() | {"melanin": melanin, "hemoglobin": hemoglobin, "ink_per_mm": ink, "oxygenation": 0.0})
    rows = skin_rows(corners)
    back = reflectance_rgb(rows)
    found = walk.walk_of(rows, back, "rec709")
    assert np.isfinite(found).all() and (found > 0.0).all()
    low, high = walk.ALBEDO_RANGE
    assert found[:, 0].min() >= low - 1e-9 and found[:, 0].max() <= high + 1e-9
    assert (back / walk.albedo_in_walk(found[:, 0])).max() <= 1.0 + 1e-3


def test_thickness_and_openness_fade():
    t = np.linspace(0.0, 12.0, 200)
    assert np.all(np.diff(thinness(t)) <= 0.0)
    assert thinness(FULL_MM) == 1.0 and thinness(GONE_MM) == 0.0 and thinness(np.inf) == 0.0 and thinness(0.0) == 1.0
    assert lit_share(0.0) == 0.0 and lit_share(1.0) == 1.0


def test_the_plan_knows_what_the_walk_costs_to_prepare():
    """By time here and now, so roughly: a table of some axes costs more than a single skin, and neither nothing."""
    one, many = (effect_costs(plan(1.0, live=live), {})["thin"].milliseconds for live in (False, True))
    assert 0.0 < one < many
    assert "thin" not in effect_costs(plan(0.0), {})
