"""Features that grow on a face, through the module: every one in the list, whatever it is."""

import numpy as np
import pytest
import sanguine_core

REGIONS = ["lips", "ears", "eyelids", "nose", "cheeks", "forehead", "chin", "neck"]
FEATURES = {row["id"]: row for row in sanguine_core.features()}
CHANNELS = {"log_hemoglobin", "log_melanin", "log_oil", "oxygenation", "ink_per_mm", "height_mm"}


def ball(cells=40, radius_mm=85.0, regions=REGIONS, split=True):
    """A head that is a ball, with each region where a face has it. The seam runs down the back; `split` gives its two
    sides vertices of their own, as some file formats do."""
    u, v = (x.ravel() for x in np.meshgrid(np.linspace(0, 1, cells + 1), np.linspace(0, 1, cells + 1)))
    around, up = 2 * np.pi * np.where(u == 1, 0, u), np.pi * (v - 0.5)
    at = np.stack([-np.sin(around) * np.cos(up), np.cos(around) * np.cos(up), np.sin(up)], axis=1)
    middles = {
        "lips": ([0, -0.88, -0.47], 0.22),
        "ears": ([1, 0, 0], 0.3),
        "eyelids": ([0.35, -0.93, 0.1], 0.2),
        "nose": ([0, -0.99, -0.1], 0.25),
        "cheeks": ([0.5, -0.8, -0.25], 0.4),
        "forehead": ([0, -0.85, 0.5], 0.5),
        "chin": ([0, -0.7, -0.7], 0.2),
        "neck": ([0, 0, -1], 0.5),
    }
    weights = np.zeros((len(at), len(regions)))
    for column, name in enumerate(regions):
        middle, reach = middles[name]
        side = at if middle[0] == 0 else np.abs(at) * [1, 0, 0] + at * [0, 1, 1]
        weights[:, column] = np.clip(1 - (np.linalg.norm(side - middle, axis=1) / reach) ** 2, 0, 1)
    weights /= np.maximum(1, weights.sum(axis=1, keepdims=True))
    corner = np.arange(len(at)).reshape(cells + 1, cells + 1)
    a, b, c, d = (x.ravel() for x in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    vertex = np.arange(len(at)) if split else np.where(u == 1, np.arange(len(at)) - cells, np.arange(len(at)))
    return {
        "position_mm": (at * radius_mm).astype(np.float32),
        "uv": np.stack([u, v], axis=1).astype(np.float32),
        "triangles": triangles,
        "corner_vertex": vertex.astype(np.int32),
        "region_names": list(regions),
        "region_weights": weights.astype(np.float32),
    }


def grow(feature, surface, texels, seed=1, age_years=45.0, sun=0.7, masculinity=0.6, **more):
    return sanguine_core.grow(feature, surface, texels, seed, age_years, sun, masculinity, **more)


@pytest.fixture(scope="module")
def head():
    surface = sanguine_core.SkinSurface(**ball())
    return surface, surface.texels(256, 256, 2)


def test_rows_say_what_they_change():
    assert FEATURES
    for row in FEATURES.values():
        assert set(row) == {"id", "label", "help", "source", "changes"}
        assert all(row[key] for key in row)
        names = [change["channel"] for change in row["changes"]]
        assert set(names) <= CHANNELS and len(set(names)) == len(names)
        assert all(change["low"] <= 0 <= change["high"] and change["low"] < change["high"] for change in row["changes"])


def test_texels_are_where_the_layout_says(head):
    surface, texels = head
    assert (texels.width, texels.height) == (256, 256)
    assert texels.texel.dtype == np.uint32 and (np.diff(texels.texel.astype(np.int64)) > 0).all()
    assert texels.place_mm.shape == texels.barycentric.shape == (len(texels.texel), 3)
    np.testing.assert_allclose(texels.barycentric.sum(axis=1), 1, atol=1e-5)  # float32
    assert texels.triangle.max() < len(ball()["triangles"])
    # The middle of a facet of 9 by 4.5 degrees is 5.03 degrees from its corners.
    radius = np.linalg.norm(texels.place_mm, axis=1)
    assert radius.max() < 85.01 and radius.min() > 85 * np.cos(np.radians(5.1))
    # The texels' squares add up to the area: an equirectangular layout leaves the size of the poles' last texels open.
    assert (texels.size_mm.astype(float) ** 2).sum() == pytest.approx(surface.area_mm2, rel=0.03)


@pytest.mark.parametrize("feature", FEATURES)
def test_layers_stay_in_their_range(head, feature):
    surface, texels = head
    for age_years, sun, masculinity in [(0.0, 0.0, 0.0), (100.0, 1.0, 1.0), (45.0, 0.7, 0.6)]:
        layer = grow(feature, surface, texels, age_years=age_years, sun=sun, masculinity=masculinity)
        changes = FEATURES[feature]["changes"]
        assert layer.dtype == np.float32 and layer.shape == (len(texels.texel), len(changes))
        assert np.isfinite(layer).all()
        assert (layer >= np.float32([c["low"] for c in changes])).all()
        assert (layer <= np.float32([c["high"] for c in changes])).all()
    # Who is no longer young, has been in the sun and has some beard has something of everything.
    assert (layer != 0).any(axis=0).all()


@pytest.mark.parametrize("feature", FEATURES)
def test_same_seed_same_bytes_for_any_number_of_threads(head, feature):
    surface, texels = head
    one = grow(feature, surface, texels, seed=2**64 - 1, threads=1)
    surface = sanguine_core.SkinSurface(**ball())
    again = grow(feature, surface, surface.texels(256, 256, 2, threads=3), seed=2**64 - 1, threads=5)
    assert one.tobytes() == again.tobytes()


@pytest.mark.parametrize("feature", FEATURES)
def test_split_vertices_change_nothing(head, feature):
    surface, texels = head
    joined = sanguine_core.SkinSurface(**ball(split=False))
    np.testing.assert_array_equal(grow(feature, joined, joined.texels(256, 256, 2)), grow(feature, surface, texels))


@pytest.mark.parametrize("feature", FEATURES)
def test_seams_do_not_show(feature):
    """The layout is laid so that the first and the last column of texels show the same places, those of the seam."""
    side = 256
    mesh = ball()
    mesh["uv"][:, 0] = (0.5 + mesh["uv"][:, 0] * (side - 1)) / side
    surface = sanguine_core.SkinSurface(**mesh)
    texels = surface.texels(side, side, 1)
    assert len(texels.texel) == side * side
    place = texels.place_mm.reshape(side, side, 3)
    np.testing.assert_allclose(place[:, 0], place[:, -1], atol=1e-3)
    image = grow(feature, surface, texels).reshape(side, side, -1)
    wide = np.float32([c["high"] - c["low"] for c in FEATURES[feature]["changes"]])
    # 2 % of the range is what a seam may show; places differ by rounding, on a slope of at most the range in 0.1 mm.
    assert (np.abs(image[:, 0] - image[:, -1]) / wide).max() < 0.02


@pytest.mark.parametrize("feature", FEATURES)
@pytest.mark.parametrize("regions", [[], ["nose", "lips"]], ids=["none", "two"])
def test_a_face_without_masks_is_no_error(feature, regions):
    surface = sanguine_core.SkinSurface(**ball(cells=12, regions=regions))
    layer = grow(feature, surface, surface.texels(64, 64, 1))
    changes = FEATURES[feature]["changes"]
    assert np.isfinite(layer).all()
    assert (layer >= np.float32([c["low"] for c in changes])).all()
    assert (layer <= np.float32([c["high"] for c in changes])).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"position_mm": lambda a: np.where(np.arange(len(a))[:, None] == 5, np.nan, a)}, "position_mm of vertex 5"),
        ({"triangles": lambda a: a - 1}, "names a corner that does not exist"),
        ({"corner_vertex": lambda a: a + 1}, "names a vertex that does not exist"),
        ({"region_weights": lambda a: a + 1}, "is not within 0 to 1"),
        ({"region_weights": lambda a: a[:-1]}, "region_weights are not"),
        ({"region_names": lambda a: a[:-1]}, "region_weights are not"),
        ({"triangles": lambda a: a[:0]}, "has no triangles"),
        ({"position_mm": lambda a: a * 0}, "no triangle has an area"),
        ({"position_mm": lambda a: a * 1000}, "has to be in millimetres"),
    ],
)
def test_bad_meshes_give_one_line(change, message):
    mesh = ball(cells=8)
    for key, edit in change.items():
        value = edit(mesh[key])
        mesh[key] = value if isinstance(value, list) else value.astype(mesh[key].dtype)
    with pytest.raises(ValueError, match=message) as error:
        sanguine_core.SkinSurface(**mesh)
    assert "\n" not in str(error.value)


def test_bad_arguments_give_one_line(head):
    surface, texels = head
    some = next(iter(FEATURES))
    for arguments, message in [
        ({"feature": "warts"}, f"'warts' is not one of {some}"),
        ({"age_years": 200.0}, "age_years"),
        ({"sun": float("nan")}, "sun"),
        ({"masculinity": -1.0}, "masculinity"),
        ({"threads": -1}, "threads"),
    ]:
        with pytest.raises(ValueError, match=message):
            grow(**{"feature": some, "surface": surface, "texels": texels, **arguments})
    other = sanguine_core.SkinSurface(**ball(cells=8))
    with pytest.raises(ValueError, match="another surface"):
        grow(some, other, texels)
    for width, padding_px in [(0, 1), (20000, 1), (8, -1)]:
        with pytest.raises(ValueError, match=r"texels"):
            surface.texels(width, 8, padding_px)


def test_work_is_counted_and_can_be_stopped(head):
    surface, texels = head
    some = next(iter(FEATURES))
    before = sanguine_core.counters()["texels_painted"]
    seen = []
    grow(some, surface, texels, progress=lambda done, total: seen.append((done, total)) or True)
    assert sanguine_core.counters()["texels_painted"] == before + len(texels.texel)
    assert seen[-1][0] == seen[-1][1]
    large = surface.texels(2048, 2048, 0)
    with pytest.raises(sanguine_core.Cancelled):
        for feature in FEATURES:  # one of them takes longer than it takes to ask
            grow(feature, surface, large, threads=1, progress=lambda done, total: False)


def test_views_outlive_the_map():
    surface = sanguine_core.SkinSurface(**ball(cells=8))
    place = surface.texels(32, 32, 0).place_mm
    assert np.isfinite(place).all()
    assert not place.flags.writeable
