"""Maps are made once, and after a change only what depends on it."""


import numpy as np
import pytest
import sanguine_core
from sanguine.app.faces import example_head, head_surface
from sanguine.app.growing import chromophore_maps, maps_plan
from sanguine.app.map_cache import MapCache
from sanguine.app.maps import Surface, bake_maps
from sanguine.domain.effects import Growth
from sanguine.domain.effects.grown import ROWS
from sanguine.domain.parameters import default_skin
from sanguine.domain.plan import check_strengths
from sanguine.domain.texel_density import MapSizes

SIZE = 256
SIZES = MapSizes(SIZE, SIZE)


@pytest.fixture(scope="module")
def face() -> Surface:
    return head_surface(example_head("female"))


def plan_of(face, growth=Growth(), **strengths):
    return maps_plan(default_skin(), check_strengths({"anatomy": 0.0, **strengths}, "test"), face, growth)


def work(plan, face, cache, sizes=SIZES):
    """(texels painted, texels rasterised) by one bake, and its maps."""
    sanguine_core.reset_counters()
    maps = bake_maps(plan, face, sizes, cache)
    counts = sanguine_core.counters()
    return (counts["texels_painted"], counts["texels_rasterized"]), maps


def test_nothing_asked_for_is_nothing_done(face, tmp_path):
    cache = MapCache(tmp_path / "cache")
    assert work(plan_of(face), face, cache) == ((0, 0), {})
    assert not cache.folder.exists()


def test_a_second_run_computes_nothing_and_gives_the_same_bytes(face, tmp_path):
    plan = plan_of(face, freckles=1.0, moles=0.5, anatomy=1.0)
    (painted, rasterised), first = work(plan, face, MapCache(tmp_path))
    assert painted > 0 and rasterised > 0
    again, second = work(plan, face, MapCache(tmp_path))
    assert again == (0, 0)
    assert first.keys() == second.keys() and {"grown", "anatomy"} <= first.keys()
    for name in first:
        np.testing.assert_array_equal(first[name][1001], second[name][1001])


def test_a_strength_paints_nothing_anew(face, tmp_path):
    cache = MapCache(tmp_path)
    _, full = work(plan_of(face, freckles=1.0), face, cache)
    done, half = work(plan_of(face, freckles=0.5), face, cache)
    assert done == (0, 0)
    np.testing.assert_allclose(half["grown"][1001], 0.5 * full["grown"][1001], atol=1e-7)


def test_another_feature_paints_that_one_alone(face, tmp_path):
    cache = MapCache(tmp_path)
    (one, _), _ = work(plan_of(face, freckles=1.0), face, cache)
    (more, _), _ = work(plan_of(face, freckles=1.0, lentigines=1.0), face, cache)
    assert more == one  # as many texels as the first took, not twice as many


@pytest.mark.parametrize("growth", [Growth(seed=1), Growth(age_years=60.0), Growth(sun=1.0), Growth(masculinity=1.0)])
def test_another_person_is_another_picture(face, tmp_path, growth):
    cache = MapCache(tmp_path)
    work(plan_of(face, freckles=1.0), face, cache)
    (painted, _), _ = work(plan_of(face, growth, freckles=1.0), face, cache)
    assert painted > 0


def test_another_face_or_size_is_another_picture(face, tmp_path):
    cache = MapCache(tmp_path)
    plan = plan_of(face, freckles=1.0)
    work(plan, face, cache)
    moved = face.position_mm.copy()
    moved[0, 0] += 1.0
    other = Surface(moved, face.uv, face.triangles, face.corner_vertex, face.regions)
    assert work(plan, other, cache)[0][0] > 0
    assert work(plan, face, cache, MapSizes(SIZE, 128))[0][0] > 0


def test_the_skin_itself_plays_no_part(face, tmp_path):
    """Layers are changes: another skin under the same freckles is another material, not another map."""
    cache = MapCache(tmp_path)
    plan = plan_of(face, freckles=1.0)
    work(plan, face, cache)
    darker = maps_plan({**default_skin(), "melanin": 0.1}, plan.scene.strengths, face, Growth())
    assert work(darker, face, cache)[0] == (0, 0)


def test_only_tiles_that_the_layout_uses_are_made(face, tmp_path):
    """The left half of the head's layout moved one tile up: the two tiles hold what one held before."""
    uv = face.uv.copy()
    left = face.uv[face.triangles].mean(axis=1)[:, 0] < 0.6
    corners = np.unique(face.triangles[left])
    assert not set(corners) & set(np.unique(face.triangles[~left]))
    uv[corners] += [0.0, 1.0]
    split = Surface(face.position_mm, uv, face.triangles, face.corner_vertex, face.regions)
    plan = plan_of(face, freckles=1.0)
    _, whole = work(plan, face, MapCache(None))
    _, tiles = work(plan, split, MapCache(None))
    assert sorted(tiles["grown"]) == [1001, 1011]
    for tile, half in ((1001, split), (1011, split.at_tile(1011))):
        ones = np.ones((len(uv), 1), dtype=np.float32)
        skin = sanguine_core.rasterize_uv(half.uv, half.triangles, ones, SIZE, SIZE, 0, np.zeros(1, np.float32))[..., 0] > 0
        assert skin.sum() > 1000
        # Moved by one, a coordinate has three digits fewer: the same place to a hundredth of a texel.
        np.testing.assert_allclose(tiles["grown"][tile][skin], whole["grown"][1001][skin], atol=0.01)


def test_every_feature_together_stays_inside_the_schema(face):
    strengths = dict.fromkeys(ROWS, 1.0) | {"anatomy": 1.0}
    channels, tiles = chromophore_maps(plan_of(face, **strengths), face, SIZE, MapCache(None))
    values = dict(zip(channels, np.moveaxis(tiles[1001], 2, 0), strict=True))
    assert {"melanin", "hemoglobin", "oxygenation", "oil"} <= values.keys()
    for name, image in values.items():
        assert np.isfinite(image).all(), name
    for row in sanguine_core.parameters():
        if row["id"] in values:
            assert row["hard_min"] <= values[row["id"]].min() and values[row["id"]].max() <= row["hard_max"], row["id"]


def test_where_no_skin_is_the_maps_hold_the_skin_as_a_whole(face):
    channels, tiles = chromophore_maps(plan_of(face, freckles=1.0, anatomy=1.0), face, SIZE, MapCache(None))
    corner = dict(zip(channels, tiles[1001][0, 0], strict=True))
    skin = default_skin()
    assert {name: pytest.approx(skin[name], rel=1e-6) for name in channels} == corner


def test_progress_is_told_and_can_stop_it(face):
    said = []
    bake_maps(plan_of(face, freckles=1.0, lentigines=1.0), face, SIZES, MapCache(None), lambda *now: said.append(now) or True)
    assert said == sorted(said) and said[0] == (0, 2000) and said[-1][0] <= 2000
    with pytest.raises(sanguine_core.Cancelled):
        bake_maps(plan_of(face, freckles=1.0), face, SIZES, MapCache(None), lambda done, total: False)


def test_a_feature_that_writes_two_maps_is_painted_once(face):
    (one, _), maps = work(plan_of(face, freckles=1.0), face, MapCache(None))
    (two, _), more = work(plan_of(face, moles=1.0), face, MapCache(None))
    assert set(maps) == {"grown"} and set(more) == {"grown", "grown_slope"}
    assert two == one
