"""sanguine_core's optics from Python: shapes, units, errors, cancelling, counters."""

import threading
import time

import numpy as np
import pytest

import sanguine_core as core

NM = np.arange(380.0, 781.0, 10.0)
IDS = [row["id"] for row in core.parameters()]


def skins(*changes: dict) -> np.ndarray:
    """Default skins with some parameters replaced."""
    defaults = {row["id"]: row["default"] for row in core.parameters()}
    return np.array([[*{**defaults, **change}.values()] for change in changes])


def test_parameters_have_every_field():
    fields = {"id", "label", "unit", "default", "hard_min", "hard_max", "soft_min", "soft_max", "group", "channel"}
    for row in core.parameters():
        assert set(row) == fields | {"help", "source"}
        assert row["hard_min"] <= row["soft_min"] <= row["default"] <= row["soft_max"] <= row["hard_max"]
    assert IDS == [
        "melanin", "melanin_blend", "hemoglobin", "oxygenation", "epidermis_thickness_mm", "oil", "roughness",
        "scatter_scale", "vessel_radius_mm", "bilirubin_umol_per_l", "scatter_power",
        "ink_per_mm",
    ]  # fmt: skip
    assert [row["id"] for row in core.derived_parameters()] == ["oxyhemoglobin", "deoxyhemoglobin"]


def test_optical_coefficients():
    result = core.optical_coefficients(skins({}, {"melanin": 0.2}), np.array([500.0, 550.0, 700.0]))
    assert set(result) == {
        "mu_a_epidermis_per_mm", "mu_a_dermis_per_mm", "mu_s_prime_epidermis_per_mm", "mu_s_prime_dermis_per_mm",
    }  # fmt: skip
    assert all(array.shape == (2, 3) for array in result.values())
    np.testing.assert_allclose(result["mu_s_prime_epidermis_per_mm"][0], [7.28, 6.08, 4.40], atol=0.01)
    np.testing.assert_array_equal(
        result["mu_s_prime_dermis_per_mm"] * 2, result["mu_s_prime_epidermis_per_mm"]
    )


def test_profile_integrates_to_reflectance_on_its_default_radii():
    rows = skins({}, {"melanin": 0.2}, {"epidermis_thickness_mm": 0.02, "hemoglobin": 0.05})
    nm = np.array([420.0, 550.0, 650.0])
    radii = core.default_radii_mm()
    assert radii[0] == pytest.approx(0.0003) and radii[-1] == pytest.approx(40)
    profile = core.radial_profile(rows, nm, radii)
    assert profile.shape == (3, 3, len(radii)) and (profile >= 0).all()
    energy = 2 * np.pi * radii**2 * profile
    inside = energy[..., :1]
    rings = (energy[..., 1:] + energy[..., :-1]) / 2 * np.diff(np.log(radii))
    total = np.concatenate([inside, rings], axis=-1).sum(axis=-1)
    # 0.2 % is the error of trapezoids a tenth apart.
    np.testing.assert_allclose(total, core.reflectance(rows, nm), rtol=0.002)


def test_lobes_hold_the_colour():
    rows = skins({}, {"melanin": 0.3}, {"hemoglobin": 0.1, "oxygenation": 0.2})
    for space in ("rec709", "rec2020", "acescg", np.eye(3)):
        lobes = core.burley_lobes(rows, space)
        assert lobes["weights"].shape == lobes["d_mm"].shape == (3, 4, 3)
        xyz = core.xyz(core.reflectance(rows, np.arange(380.0, 781.0, 5.0)), np.arange(380.0, 781.0, 5.0))
        rgb = core.linear_rgb(xyz, space)
        np.testing.assert_allclose(lobes["rgb"], rgb, atol=1e-6)
        np.testing.assert_allclose(lobes["weights"].sum(axis=1), np.maximum(rgb, 0), atol=1e-6)
        assert (lobes["d_mm"] > 0).all() and (lobes["weights"] >= 0).all()
    assert core.burley_lobes(rows, lobe_count=2)["weights"].shape == (3, 2, 3)


def test_white_is_one():
    white = core.xyz(np.ones((1, len(NM))), NM)
    assert white[0, 1] == pytest.approx(100)
    np.testing.assert_allclose(core.lab(white), [[100, 0, 0]], atol=1e-9)
    for space in ("rec709", "rec2020", "acescg"):
        np.testing.assert_allclose(core.linear_rgb(white, space), np.ones((1, 3)), atol=1e-12)


def test_surface():
    dry, oily = core.surface(skins({"oil": 0.0}, {"oil": 1.0}))
    assert dry[0] == 0 and dry[1] == pytest.approx(0.0768, abs=1e-4)
    assert oily[1] == pytest.approx(oily[0] + (1 - oily[0]) * dry[1])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: core.reflectance(skins({"melanin": 0.6}), NM), ["skin 0", "melanin", "0.6", "0 to 0.5"]),
        (lambda: core.reflectance(skins({}, {"oxygenation": np.nan}), NM), ["skin 1", "oxygenation", "nan", "0 to 1"]),
        (lambda: core.reflectance(skins({})[:, :3], NM), ["3 values", "needs 12"]),
        (lambda: core.reflectance(skins({}), np.array([800.0])), ["wavelengths_nm", "800", "380 to 780 nm"]),
        (lambda: core.reflectance(skins({}), NM, threads=-1), ["threads", "-1"]),
        (lambda: core.radial_profile(skins({}), NM, np.array([0.0])), ["radius_mm", "above 0"]),
        (lambda: core.burley_lobes(skins({}), "srgb"), ["working_space", "srgb", "rec709, rec2020, acescg"]),
        (lambda: core.burley_lobes(skins({}), lobe_count=9), ["lobe_count", "9", "1 to 4"]),
        (lambda: core.xyz(np.ones((1, 3)), NM), ["spectra", "3 columns", "41"]),
        (lambda: core.xyz(np.ones((1, 2)), np.array([500.0, 400.0])), ["wavelengths_nm", "400", "increase"]),
    ],
)
def test_errors_are_one_line_that_names_key_value_and_range(call, words):
    with pytest.raises(ValueError) as caught:
        call()
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


def test_wrong_arrays_are_refused_not_read():
    with pytest.raises(TypeError):
        core.reflectance(np.zeros(7), NM)  # one dimension
    with pytest.raises(TypeError):
        core.lab(np.zeros((4, 2)))


def test_counters_tell_what_was_done():
    core.reset_counters()
    assert set(core.counters().values()) == {0}
    core.optical_coefficients(skins({}), NM)
    core.surface(skins({}))
    assert set(core.counters().values()) == {0}  # neither solves anything
    core.reflectance(skins({}, {}), NM)
    assert {name: count for name, count in core.counters().items() if count} == {"spectral_solves": 2 * len(NM)}
    core.burley_lobes(skins({}, {}, {}))
    assert core.counters()["lobe_fits"] == 9
    core.reset_counters()
    assert set(core.counters().values()) == {0}


def many_skins(count: int) -> np.ndarray:
    """Skins that share no dermis: as slow as it gets."""
    return skins(*({"hemoglobin": 0.001 + 0.2 * i / count} for i in range(count)))


def test_cancelling():
    asked = []

    def stop(done, total):
        asked.append((threading.current_thread(), done, total))
        return False

    start = time.perf_counter()
    with pytest.raises(core.Cancelled):
        core.burley_lobes(many_skins(20000), threads=1, progress=stop)
    assert time.perf_counter() - start < 10  # all of it takes a minute
    assert asked[0][0] is threading.current_thread() and asked[0][2] > 0


def test_progress_ends_at_the_total_and_its_errors_pass():
    seen = []
    core.burley_lobes(skins({}), progress=lambda done, total: seen.append((done, total)) or True)
    assert seen[-1][0] == seen[-1][1]

    def broken(done, total):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        core.reflectance(skins({}), NM, progress=broken)


def test_gil_is_released():
    # While one thread solves, this one must be able to run Python.
    worker = threading.Thread(target=core.burley_lobes, args=(many_skins(300),), kwargs={"threads": 1})
    worker.start()
    turns = 0
    while worker.is_alive():
        turns += 1
        time.sleep(0.001)
    assert turns > 20


def test_threads_do_not_change_the_result():
    rows = many_skins(40)
    one, many = core.burley_lobes(rows, threads=1), core.burley_lobes(rows, threads=4)
    for key in one:
        np.testing.assert_array_equal(one[key], many[key])


def test_empty_input_gives_empty_output():
    none = np.empty((0, len(IDS)))
    assert core.reflectance(none, NM).shape == (0, len(NM))
    assert core.burley_lobes(none)["weights"].shape == (0, 4, 3)
