"""No map shows where the UV islands of a face meet: what issue 5 asks for, measured as a renderer looks maps up.

A seam is one line of the skin with two places in the image. Both are looked up bilinearly, and the two values may
differ by 2 % of the range of the map at most, nothing subtracted.
"""

import numpy as np
import pytest
import sanguine_core
from sanguine.app.faces import example_head, head_surface
from sanguine.app.growing import chromophore_maps, maps_plan
from sanguine.app.map_cache import MapCache
from sanguine.app.maps import Grown, Surface, _slopes, _strain, bake_maps, hide_seams
from sanguine.domain.effects import Growth
from sanguine.domain.effects.grown import MAPS, ROWS, height_of
from sanguine.domain.parameters import default_skin
from sanguine.domain.plan import check_strengths
from sanguine.domain.texel_density import MapSizes

AGREES = 0.02
GROWTH = Growth(seed=1, age_years=60.0, sun=0.8, masculinity=0.5)
SIZES = MapSizes(smooth=256, detail=1024)


def seam_uv(face: Surface, samples=17):
    """Places of the layout on both sides of all seams, those inside the mouth too: two arrays (N, 2)."""
    side = face.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    vertex = face.corner_vertex[side]
    side = np.where(vertex[:, :1] > vertex[:, 1:], side[:, ::-1], side)
    key = np.sort(vertex, axis=1) @ [len(face.position_mm), 1]
    order = np.argsort(key, kind="stable")
    twins = order[:-1][np.diff(key[order]) == 0], order[1:][np.diff(key[order]) == 0]
    a, b = (face.uv[side[t]].astype(float) for t in twins)
    seam = np.abs(a - b).max(axis=(1, 2)) > 1e-6
    t = np.linspace(0, 1, samples)[:, None, None]
    return tuple((uv[seam, 0] * (1 - t) + uv[seam, 1] * t).reshape(-1, 2) for uv in (a, b))


def look_up(image, uv):
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    at = uv * image.shape[0] + 0.5
    (x, y), (fx, fy) = np.floor(at).astype(int).T, (at - np.floor(at)).T[..., None]
    low = padded[y, x] * (1 - fx) + padded[y, x + 1] * fx
    high = padded[y + 1, x] * (1 - fx) + padded[y + 1, x + 1] * fx
    return low * (1 - fy) + high * fy


def difference(image, uv):
    return np.abs(look_up(image, uv[0]) - look_up(image, uv[1])).max(axis=0)


def wide(image):
    return np.maximum(np.ptp(image.reshape(-1, image.shape[2]), axis=0), 1e-6)


@pytest.fixture(scope="module", params=["female", "male"])
def face(request) -> Surface:
    return head_surface(example_head(request.param))


@pytest.fixture(scope="module")
def female() -> Surface:
    return head_surface(example_head("female"))


@pytest.fixture(scope="module")
def layers(female) -> Grown:
    return Grown(female, GROWTH, SIZES.detail, MapCache(None))


def test_no_map_of_a_face_shows_a_seam(face):
    strengths = dict.fromkeys(ROWS, 1.0) | {"anatomy": 1.0}
    plan = maps_plan(default_skin(), check_strengths(strengths, "test"), face, GROWTH)
    uv = seam_uv(face)
    assert len(uv[0]) > 3000
    maps = bake_maps(plan, face, SIZES, MapCache(None), names=[height_of(name) or name for name in plan.maps])
    assert {"anatomy", *MAPS} <= maps.keys()
    for name, tiles in maps.items():
        assert (difference(tiles[1001], uv) / wide(tiles[1001])).max() < AGREES, name


@pytest.mark.parametrize("feature", ROWS)
def test_nor_does_a_feature_alone(female, layers, feature):
    changes = ROWS[feature]["changes"]
    image = layers.compose({feature: 1.0}, tuple(change["channel"] for change in changes))
    hide_seams(female, {1001: image}, MapCache(None))
    declared = np.array([change["high"] - change["low"] for change in changes])
    assert (difference(image, seam_uv(female)) / declared).max() < AGREES


def test_nor_does_a_map_of_chromophores(female):
    strengths = dict.fromkeys(ROWS, 1.0) | {"anatomy": 1.0}
    plan = maps_plan(default_skin(), check_strengths(strengths, "test"), female, GROWTH)
    _, tiles = chromophore_maps(plan, female, 512, MapCache(None))
    assert (difference(tiles[1001], seam_uv(female)) / wide(tiles[1001])).max() < AGREES


def test_nor_does_a_map_of_a_moving_face(female):
    uv = seam_uv(female)
    image = _strain(female, 256, 0)
    range_of = wide(image)
    assert (difference(image, uv) / range_of).max() > 5 * AGREES  # there is something to hide
    hide_seams(female, {1001: image}, MapCache(None))
    assert (difference(image, uv) / range_of).max() < AGREES


def test_slopes_are_as_steep_on_both_sides(female, layers):
    """They are told along axes that differ from island to island. Of waves of 12 mm, whose slope changes by a sixth of the
    steepest within the 0.3 mm of a texel (more where the layout crams skin together). The median, because many seams run
    along folds, lips and lids, of which the sides differ in truth."""
    heights = np.zeros((SIZES.detail**2, 1), dtype=np.float32)
    heights[layers.places.texel, 0] = np.sin(layers.places.place_mm * (2.0 * np.pi / 12.0)).sum(axis=1)
    slopes = _slopes(layers, heights.reshape(SIZES.detail, SIZES.detail, 1))
    steep = np.hypot(slopes[..., 0], slopes[..., 1])[..., None]
    here, there = (look_up(steep, uv) for uv in seam_uv(female))
    assert np.median(np.abs(here - there)) < 0.06 * np.percentile(steep[steep > 0.0], 99)


def test_only_texels_at_seams_change_and_nothing_leaves_its_range(female, layers):
    plain = layers.compose({"freckles": 1.0, "beard": 1.0}, ("log_melanin", "ink_per_mm"))
    hidden = plain.copy()
    hide_seams(female, {1001: hidden}, MapCache(None))
    changed = (plain != hidden).any(axis=2)
    x, y = np.floor(np.concatenate(seam_uv(female, 65)) * 1024 - 0.5).astype(int).T
    near = np.zeros_like(changed)
    for j in (-1, 0, 1, 2):  # the four that a look-up reads, and those between two of our samples
        for i in (-1, 0, 1, 2):
            near[np.clip(y + j, 0, 1023), np.clip(x + i, 0, 1023)] = True
    assert changed.any() and not (changed & ~near).any()
    assert (hidden.min(axis=(0, 1)) >= plain.min(axis=(0, 1))).all() and (hidden.max(axis=(0, 1)) <= plain.max(axis=(0, 1))).all()
    assert hidden.min() >= 0.0  # neither melanin nor ink is taken from where none was added


def test_a_seam_between_two_tiles_is_one_too(female):
    uv = female.uv.copy()
    left = female.uv[female.triangles].mean(axis=1)[:, 0] < 0.6
    uv[np.unique(female.triangles[left])] += [0.0, 1.0]
    split = Surface(female.position_mm, uv, female.triangles, female.corner_vertex, female.regions)
    assert split.tiles == (1001, 1011)
    plan = maps_plan(default_skin(), check_strengths({"anatomy": 0.0, "lentigines": 1.0}, "test"), split, GROWTH)
    maps = bake_maps(plan, split, MapSizes(256, 512), MapCache(None))["grown"]
    here, there = seam_uv(split)
    across = np.floor(here[:, 1]) != np.floor(there[:, 1])
    assert across.sum() > 100

    def read(places):
        row = np.floor(places[:, 1:])
        inside = places - np.column_stack([0 * row, row])
        return np.where(row == 0, look_up(maps[1001], inside), look_up(maps[1011], inside))

    apart = np.abs(read(here) - read(there))[:, 1]
    assert apart.max() / 1.4 < AGREES  # of the range that lentigines declare


def test_a_second_look_computes_nothing_and_threads_change_nothing(female, tmp_path, monkeypatch):
    seams = sanguine_core.SeamTexels(female.native, 256, 256)
    values = np.random.default_rng(1).random((len(seams.texel), 3), dtype=np.float32)
    np.testing.assert_array_equal(seams.equalize(values, threads=1), seams.equalize(values, threads=3))
    image = np.random.default_rng(2).random((256, 256, 2), dtype=np.float32)
    first, second = image.copy(), image.copy()
    hide_seams(female, {1001: first}, MapCache(tmp_path))
    monkeypatch.setattr(sanguine_core, "SeamTexels", None)
    hide_seams(female, {1001: second}, MapCache(tmp_path))
    np.testing.assert_array_equal(first, second)
