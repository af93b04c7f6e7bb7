"""Chromophores of pictures: noise, light, what is not skin, and the contract of the arrays.

The tables and the cutting of rows are tested in tests/native/test_inversion.cpp, the bars in tests/app/test_inverting.py.
"""

import threading
import time

import numpy as np
import pytest
import sanguine_core as core
from scipy.ndimage import gaussian_filter
from sanguine.domain.parameters import default_skin, skin_rows

SKIN = skin_rows([default_skin()])[0]
TABLES = core.SkinInverse(SKIN, nodes=17)
LIGHT = np.array([np.log(0.02), np.log(0.014), 0.75], dtype=np.float32)
N = 256


def smooth(seed, sigma, sd):
    field = gaussian_filter(np.random.default_rng(seed).normal(size=(N, N)), sigma, mode="wrap")
    return (sd * field / field.std()).astype(np.float32)


def face():
    """(N, N, 3) points: flushes and pigment that change slowly, and oxygenation a little."""
    return LIGHT + np.stack([smooth(1, 10, 0.2), smooth(2, 8, 0.3), smooth(3, 20, 0.03)], axis=-1)


def look(points):
    flat = np.ascontiguousarray(points.reshape(-1, 3), dtype=np.float32)
    return TABLES.rgb_of_lab(TABLES.lab(flat)).reshape(*points.shape[:2], 3)


def invert(rgb, **options):
    height, width = rgb.shape[:2]
    overview = core.PictureOverview(width, height)
    overview.add(rgb)
    model = core.picture_models(TABLES, [overview], **options)[0]
    wanted = ["skin_map", "residual", "mask", "error", "shading"]
    made = core.invert_rows(TABLES, model, rgb, 0, 0, height, wanted=wanted)
    made["points"] = np.stack(
        [np.log(made["skin_map"][..., 1]), np.log(made["skin_map"][..., 0]), made["skin_map"][..., 3]], axis=-1
    )
    return model, made


def test_a_clean_albedo_stays_as_it_is():
    points = face()
    model, made = invert(look(points))
    assert model.shading_kept == 0 and model.exposure == 0 and (made["shading"] == 1).all()
    assert model.noise_sd < 0.02  # single precision, nothing else
    assert made["mask"].min() > 0.99
    assert made["counts"].error_at(0.5) < 0.3 and made["error"].max() < 1
    for k, bar in enumerate((0.999, 0.99)):
        assert np.corrcoef(made["points"][..., k].ravel(), points[..., k].ravel())[0, 1] > bar


@pytest.mark.parametrize("sd", [0.005, 0.015])
def test_noise_is_found_and_taken_off_but_not_the_signal(sd):
    points = face()
    points[100:110, 60:70, 0] += 0.8  # a mole
    noise = np.random.default_rng(7).normal(0, sd, (N, N, 3)).astype(np.float32)
    noisy = np.cbrt(look(points)) + noise
    noisy = (noisy**3).astype(np.float32)
    model, made = invert(noisy)
    # Noise of the cube roots, whose L*a*b* is 116 dY, 500 (dX - dY), 200 (dY - dZ) of mixtures of them: its mean square
    # from the same matrix.
    truth = np.sqrt(np.mean((TABLES.lab_of_rgb(noisy.reshape(-1, 3)) - TABLES.lab_of_rgb(look(points).reshape(-1, 3))) ** 2))
    assert model.noise_sd == pytest.approx(truth, rel=0.15)
    _, raw = invert(noisy, noise=0.0)
    spots = np.zeros((N, N), bool)
    spots[96:114, 56:74] = True
    for k in range(3):
        before = np.std((raw["points"] - points)[~spots][:, k])
        after = np.std((made["points"] - points)[~spots][:, k])
        assert after < 0.5 * before
    core_of_mole = (made["points"] - points)[102:108, 62:68, 0].mean()
    assert abs(core_of_mole) < 0.08  # a tenth of it


def test_light_is_split_off_and_pigment_is_not():
    points = face()
    y, x = np.mgrid[0:N, 0:N] / N
    light = np.exp(-0.5 + 0.5 * np.sin(2.2 * x + 1.0) * np.cos(1.5 * y)).astype(np.float32)
    light /= np.median(light)
    lit = look(points) * light[..., None]
    model, made = invert(lit)
    assert model.shading_found > 3 * model.shading_pigment and model.shading_kept > 0.9
    found = np.log(made["shading"]) - np.log(light)
    assert np.std(found) < 0.25 * np.std(np.log(light))
    _, off = invert(lit, shading="off")
    assert (off["shading"] == 1).all()
    wrong = [np.std((m["points"] - points)[..., 0]) for m in (made, off)]
    assert wrong[0] < 0.5 * wrong[1]


def test_exposure_is_told_from_light_skin():
    bright = look(face()) * 1.6  # beyond what any skin reflects
    model, made = invert(bright)
    assert np.exp(model.exposure) == pytest.approx(1.6, rel=0.1)
    assert np.abs((made["points"] - face())[..., 0]).mean() < 0.25
    assert made["mask"].mean() > 0.95


def test_brows_and_the_rest_of_the_world_are_no_skin_but_freckles_and_lips_are():
    points = face()
    lips, freckles = np.s_[180:200, 90:160], np.s_[120:124, 40:44]
    points[lips] += np.array([np.log(0.5), np.log(4.5), 0.08], dtype=np.float32)
    points[freckles] += np.array([0.7, 0, 0], dtype=np.float32)
    rgb = look(points)
    brow, eye, wall, gone = np.s_[60:68, 60:120], np.s_[80:90, 80:100], np.s_[0:30, :], np.s_[230:, :40]
    rgb[brow] = (0.035, 0.022, 0.014)
    rgb[eye] = (0.75, 0.75, 0.78)
    rgb[wall] = (0.1, 0.4, 0.2)
    rgba = np.dstack([rgb, np.ones((N, N), np.float32)])
    rgba[gone] = 0
    _, made = invert(rgba)
    for place in (brow, eye, wall, gone):
        assert made["mask"][place].max() < 0.05
    for place in (lips, freckles):
        assert made["mask"][place].min() > 0.8
    # Under the brow there is the skin from around, and its look is in the residual.
    around = np.concatenate([made["points"][52:58, 60:120].reshape(-1, 3), made["points"][70:76, 60:120].reshape(-1, 3)])
    assert np.abs(made["points"][brow].reshape(-1, 3).mean(0) - around.mean(0)).max() < 0.2
    assert made["residual"][brow].max() < 0.4 and (made["residual"][gone] == 1).all()
    skin = made["mask"] == 1
    assert np.abs(made["residual"][skin] - 1).mean() < 0.02
    seen = look(made["points"]) * made["residual"] * made["shading"][..., None]
    there = rgba[..., 3] > 0
    np.testing.assert_allclose(seen[there], rgb[there], atol=2e-5)


def test_tiles_share_what_is_skin():
    points = face()
    one, two = look(points), look(points + np.array([0.1, 0.1, 0], dtype=np.float32))
    overviews = []
    for rgb in (one, two):
        overviews.append(core.PictureOverview(N, N))
        overviews[-1].add(rgb)
    a, b = core.picture_models(TABLES, overviews)
    assert a.centre == b.centre and a.noise_sd == b.noise_sd


def test_srgb_is_decoded():
    linear = look(face())
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055).astype(np.float32)
    overview, other = core.PictureOverview(N, N), core.PictureOverview(N, N)
    overview.add(linear)
    other.add(encoded, srgb=True)
    a, b = core.picture_models(TABLES, [overview])[0], core.picture_models(TABLES, [other])[0]
    one = core.invert_rows(TABLES, a, linear, 0, 0, N)
    two = core.invert_rows(TABLES, b, encoded, 0, 0, N, srgb=True)
    np.testing.assert_allclose(one["skin_map"], two["skin_map"], rtol=2e-3)


def test_wrong_arguments_are_named():
    rgb = look(face())
    overview = core.PictureOverview(N, N)
    with pytest.raises(ValueError, match="2 channels, 3 or 4"):
        overview.add(np.zeros((N, N, 2), np.float32))
    overview.add(rgb)
    for options, words in (
        ({"shading": "maybe"}, "off, auto, on"), ({"noise": -1.0}, "0 to 100"), ({"noise": np.nan}, "0 to 100"),
        ({"quantum": 2.0}, "0 to 1"),
    ):
        with pytest.raises(ValueError, match=words):
            core.picture_models(TABLES, [overview], **options)
    model = core.picture_models(TABLES, [overview])[0]
    with pytest.raises(ValueError, match="skin_map, residual"):
        core.invert_rows(TABLES, model, rgb, 0, 0, N, wanted=["blood"])
    with pytest.raises(ValueError, match="look at 3 more"):
        core.invert_rows(TABLES, model, rgb[:, :100].copy(), 0, 0, N)
    with pytest.raises(ValueError, match="finite"):
        TABLES.lab(np.full((1, 3), np.nan, np.float32))
    with pytest.raises(ValueError, match="melanin"):
        core.SkinInverse(np.full_like(SKIN, 2.0))


def test_work_is_counted_and_can_be_stopped():
    core.reset_counters()
    rgb = look(face())
    overview = core.PictureOverview(N, N)
    overview.add(rgb)
    model = core.picture_models(TABLES, [overview])[0]
    core.invert_rows(TABLES, model, rgb, 0, 10, 20, wanted=["mask"])
    assert core.counters()["texels_inverted"] == 20 * N
    with pytest.raises(core.Cancelled):
        core.SkinInverse(SKIN, nodes=129, threads=1, progress=lambda done, total: False)


def test_gil_is_released():
    worker = threading.Thread(target=core.SkinInverse, args=(SKIN,), kwargs={"nodes": 33, "threads": 1})
    worker.start()
    turns = 0
    while worker.is_alive():
        turns += 1
        time.sleep(0.0005)
    assert turns > 20
