"""The skin model at and beyond the ends of every range: whatever columns `parameters()` has."""

import itertools
import math
import time

import numpy as np
import pytest
import sanguine_core as core
from hypothesis import given
from hypothesis import strategies as st
from stability import extremes

ROWS = core.parameters()
LOW = np.array([row["hard_min"] for row in ROWS])
HIGH = np.array([row["hard_max"] for row in ROWS])
DEFAULT = np.array([row["default"] for row in ROWS])
IDS = [row["id"] for row in ROWS]
NM = np.linspace(380.0, 780.0, extremes.finer(41))
FEW_NM = np.array([380.0, 415.0, 450.0, 550.0, 577.0, 650.0, 780.0])
RADII = core.default_radii_mm()

COEFFICIENTS = (
    "mu_a_epidermis_per_mm", "mu_a_dermis_per_mm", "mu_s_prime_epidermis_per_mm", "mu_s_prime_dermis_per_mm",
)  # fmt: skip


def columns_that_matter() -> list[int]:
    """Those whose value changes the reflectance of some skin; the others are of the surface."""
    return [
        i for i in range(len(IDS))
        if any(
            (core.reflectance(with_column(base, i, LOW[i]), FEW_NM)
             != core.reflectance(with_column(base, i, HIGH[i]), FEW_NM)).any()
            for base in (DEFAULT, LOW, HIGH, 0.5 * (LOW + HIGH))
        )
    ]  # fmt: skip


def with_column(base: np.ndarray, column: int, value: float) -> np.ndarray:
    row = base.copy()
    row[column] = value
    return row[None]


def corners(most: int) -> np.ndarray:
    """Every corner of the box of hard ranges, the columns that matter varying fastest; at most `most` of them, taken
    evenly."""
    order = sorted(range(len(IDS)), key=lambda i: i in columns_that_matter())
    chosen = [order.index(i) for i in range(len(IDS))]
    count = 2 ** len(IDS)
    take = range(count) if count <= most else np.unique(np.linspace(0, count - 1, most).astype(int))
    bits = np.array([[number >> (len(IDS) - 1 - k) & 1 for k in range(len(IDS))] for number in take])
    return np.where(bits[:, chosen] == 1, HIGH, LOW)


def any_skin() -> st.SearchStrategy[np.ndarray]:
    """Values inside the hard ranges; every third or so at an end."""
    return st.tuples(
        *(st.one_of(st.sampled_from([low, high]), st.floats(low, high), st.floats(low, high))
          for low, high in zip(LOW.tolist(), HIGH.tolist(), strict=True))
    ).map(np.array)  # fmt: skip


def test_every_corner_has_a_reflectance():
    """All 2^k corners of the hard ranges: finite, above 0, with the surface at most 1 + 1e-9 (rounding)."""
    rows = corners(2**14 if extremes.SOAK else 2**12)
    R = core.reflectance(rows, NM)
    surface = core.surface(rows)
    assert np.isfinite(R).all() and (R > 0).all()
    assert (R + surface[:, :1].clip(0, 0) + core.surface(with_column(DEFAULT, IDS.index("oil"), 0.0))[0, 1]
            <= 1 + extremes.ENERGY).all()  # fmt: skip
    # Under a film that reflects E, (1 - E) R leaves the skin: surface() gives E and the whole surface's share.
    film, whole = surface[:, :1], surface[:, 1:]
    assert ((film >= 0) & (whole >= film) & (whole <= 1)).all()
    assert ((1 - film) * R + whole <= 1 + extremes.ENERGY).all()


def test_every_corner_has_a_profile():
    """Finite, not negative, and its plane integral is the reflectance within 0.2 %: trapezoids over radii 1.5 % apart of
    curves that fall by a factor 100 in a factor 1.2 of r where pigment leaves light within micrometres alone."""
    rows = corners(4096 if extremes.SOAK else 128)
    radii = np.geomspace(1e-5, 60, 1000)
    for some in np.array_split(rows, max(1, len(rows) // 128)):
        profile = core.radial_profile(some, FEW_NM, radii)
        assert np.isfinite(profile).all() and (profile >= 0).all()
        energy = 2 * np.pi * radii**2 * profile
        inside = energy[..., 0]
        total = inside + ((energy[..., 1:] + energy[..., :-1]) / 2 * np.diff(np.log(radii))).sum(-1)
        np.testing.assert_allclose(total, core.reflectance(some, FEW_NM), rtol=2e-3)


@pytest.mark.parametrize("space", ["rec709", "acescg"])
def test_every_corner_has_lobes(space):
    """Weights not negative and adding up to the colour where that is positive (1e-9: rounding), widths above 0 and
    below the metre, clamped and fit_error finite."""
    lobes = core.burley_lobes(corners(4096 if extremes.SOAK else 128), space)
    for name, values in lobes.items():
        assert np.isfinite(values).all(), name
    assert (lobes["weights"] >= 0).all()
    assert (lobes["d_mm"] > 0).all() and (lobes["d_mm"] < extremes.METRE).all()
    assert (lobes["clamped"] >= 0).all() and (lobes["fit_error"] >= 0).all()
    np.testing.assert_allclose(lobes["weights"].sum(1), lobes["rgb"].clip(0), atol=1e-9)


@extremes.examples(60)
@given(any_skin(), st.integers(0, len(IDS) - 1), st.floats(0, 1), st.floats(0, 1))
def test_more_of_an_absorber_never_brightens(row, column, a, b):
    """Of every two skins of which one absorbs at least as much in both layers and scatters the same, it is not the
    brighter one, at any wavelength: within 1e-5 (relative), what sums of float32 may lose. Which parameters are
    absorbers is seen in the coefficients, so new ones are tested too."""
    low, high = sorted(LOW[column] + (HIGH[column] - LOW[column]) * np.array([a, b]))
    rows = np.concatenate([with_column(row, column, low), with_column(row, column, high)])
    c = core.optical_coefficients(rows, NM)
    R = core.reflectance(rows, NM)
    same = np.all([c[key][0] == c[key][1] for key in COEFFICIENTS[2:]], axis=0)
    if "thickness" in IDS[column]:
        return
    for darker, lighter in ((0, 1), (1, 0)):
        absorbs = same & np.all([c[key][darker] >= c[key][lighter] for key in COEFFICIENTS[:2]], axis=0)
        assert (R[darker] <= R[lighter] * (1 + 1e-5))[absorbs].all(), IDS[column]


def test_melanin_and_blood_darken_from_end_to_end():
    """The same on a grid over each whole range, from every corner of the other parameters."""
    for name in ("melanin", "hemoglobin"):
        column = IDS.index(name)
        base = corners(16)
        grid = np.linspace(LOW[column], HIGH[column], extremes.finer(60))
        rows = np.repeat(base, len(grid), axis=0)
        rows[:, column] = np.tile(grid, len(base))
        R = core.reflectance(rows, FEW_NM).reshape(len(base), len(grid), -1)
        assert (np.diff(R, axis=1) <= 1e-5 * R[:, 1:]).all(), name


@pytest.mark.parametrize("column", range(len(IDS)), ids=IDS)
def test_no_jump_along_any_parameter(column):
    """A step of 1e-7 of a parameter's range changes the reflectance by less than 1e-4 of itself, at 2,000 places (the
    ends and, for the thickness, all nodes of the path table lie among them). A smooth curve moves by 1e-6 at most; the
    rest is float32 in the table's sums. Where the table goes from one set of nodes to the next a jump would show."""
    base = corners(8)
    count = extremes.finer(2000) // len(base)
    span = HIGH[column] - LOW[column]
    # Thickness: nodes are evenly spaced in ln(1 + 10 tau); places evenly in the logarithm meet them all.
    places = (
        np.geomspace(LOW[column], HIGH[column], count) if LOW[column] > 0 else np.linspace(LOW[column], HIGH[column], count)
    )
    step = 1e-7 * span
    low = np.clip(places - step / 2, LOW[column], HIGH[column])
    high = np.clip(places + step / 2, LOW[column], HIGH[column])
    for row in base:
        rows = np.repeat(row[None], 2 * count, axis=0)
        rows[:, column] = np.concatenate([low, high])
        R = core.reflectance(rows, FEW_NM)
        np.testing.assert_allclose(R[:count], R[count:], rtol=1e-4)


def tau_nodes() -> np.ndarray:
    """Where the path table's sets of nodes change, evenly spaced in ln(1 + 10 tau), from its header: 22 of them up
    to 7.5."""
    return np.expm1(np.linspace(0, math.log1p(10 * 7.5), 22)) / 10


def test_no_jump_at_the_nodes_of_the_path_table():
    """Both sides of every tau node, 1e-9 apart: reflectance and profile agree within 1e-5 (float32)."""
    thickness = IDS.index("epidermis_thickness_mm")
    for nm in FEW_NM:
        wave = np.array([nm])
        mu_s = core.optical_coefficients(DEFAULT[None], wave)["mu_s_prime_epidermis_per_mm"][0, 0]
        at = tau_nodes() / mu_s
        at = at[(at > LOW[thickness] * 1.001) & (at < HIGH[thickness] * 0.999)]
        assert len(at) > 5
        rows = np.repeat(DEFAULT[None], 2 * len(at), axis=0)
        rows[:, thickness] = np.concatenate([at * (1 - 1e-9), at * (1 + 1e-9)])
        for values in (core.reflectance(rows, wave), core.radial_profile(rows, wave, RADII)[:, 0]):
            below, above = values[: len(at)], values[len(at) :]
            np.testing.assert_allclose(below, above, rtol=1e-5, atol=1e-5 * np.abs(above).max() * 1e-6)


@extremes.examples(15)
@given(st.lists(any_skin(), min_size=1, max_size=40))
def test_skins_do_not_know_each_other_nor_the_threads(rows):
    """A skin's numbers are the same on 1 and 2 threads, bit by bit; alone or among others within 1e-6 (sums in float32
    that are shared between skins of one dermis)."""
    rows = np.array(rows)
    assert (core.reflectance(rows, FEW_NM, threads=1) == core.reflectance(rows, FEW_NM, threads=2)).all()
    profile = core.radial_profile(rows, FEW_NM, RADII, threads=1)
    assert (profile == core.radial_profile(rows, FEW_NM, RADII, threads=2)).all()
    one, two = (core.burley_lobes(rows, threads=n) for n in (1, 2))
    assert all((one[key] == two[key]).all() for key in one)
    alone = core.reflectance(rows[-1:], FEW_NM)[0]
    np.testing.assert_allclose(alone, core.reflectance(rows, FEW_NM)[-1], rtol=1e-6)


NOT_NUMBERS = [math.nan, math.inf, -math.inf, 1e308, -1e308, -5e-324]


def skin_calls(rows):
    return {
        "reflectance": lambda: core.reflectance(rows, FEW_NM),
        "radial_profile": lambda: core.radial_profile(rows, FEW_NM, RADII),
        "burley_lobes": lambda: core.burley_lobes(rows),
        "surface": lambda: core.surface(rows),
        "optical_coefficients": lambda: core.optical_coefficients(rows, FEW_NM),
    }


@pytest.mark.parametrize("value", NOT_NUMBERS)
@pytest.mark.parametrize("column", range(len(IDS)), ids=IDS)
def test_no_skin_outside_the_ranges(column, value):
    """NaN, infinities and numbers beyond a range, in every column: a ValueError that names skin and parameter, from
    every function, before any work (0.1 s)."""
    rows = np.concatenate([DEFAULT[None], with_column(DEFAULT, column, value)])
    for name, call in skin_calls(rows).items():
        start = time.process_time()
        with pytest.raises(ValueError, match=IDS[column]) as caught:
            call()
        assert "skin 1" in str(caught.value) and "\n" not in str(caught.value), name
        assert time.process_time() - start < 0.1, name


@pytest.mark.parametrize("value", [*NOT_NUMBERS, 0.0, 379.999, 780.001])
def test_no_wavelength_outside_the_tables(value):
    """380 to 780 nm, else a ValueError that names the argument."""
    nm = np.array([value])
    for call in (
        lambda: core.reflectance(DEFAULT[None], nm),
        lambda: core.radial_profile(DEFAULT[None], nm, RADII),
        lambda: core.optical_coefficients(DEFAULT[None], nm),
        lambda: core.xyz(np.ones((1, 1)), nm),
    ):
        with pytest.raises(ValueError, match="nm"):
            call()


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 0.0, -1.0])
def test_no_radius_that_is_none(value):
    """Radii are above 0 and finite."""
    with pytest.raises(ValueError, match="radius_mm"):
        core.radial_profile(DEFAULT[None], FEW_NM, np.array([1.0, value]))


def test_any_radius_above_0_has_a_finite_density():
    """From the smallest number whose square is one to the largest: finite and not negative; beyond 1e-150 mm the
    density of 1/r is still below 1e308."""
    radii = np.geomspace(1e-150, 1e300, 400)
    for row in corners(16):
        profile = core.radial_profile(row[None], FEW_NM, radii)
        assert np.isfinite(profile).all() and (profile >= 0).all()
    try:
        tiniest = core.radial_profile(DEFAULT[None], FEW_NM, np.array([5e-324]))
    except ValueError as error:
        assert "radius_mm" in str(error)
    else:
        assert np.isfinite(tiniest).all()


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_colours_of_numbers_alone(value):
    """A spectrum, colour or matrix that is not finite is a ValueError that names the argument."""
    bad = np.array([[0.5, value, 0.5]])
    for call in (
        lambda: core.xyz(bad, np.array([450.0, 550.0, 650.0])),
        lambda: core.lab(bad),
        lambda: core.linear_rgb(bad),
        lambda: core.linear_rgb(np.ones((1, 3)), np.eye(3) + np.diag([0, value, 0])),
        lambda: core.burley_lobes(DEFAULT[None], np.diag([1.0, 1.0, value])),
    ):
        with pytest.raises(ValueError):
            call()


@pytest.mark.parametrize("scale", [0.0, 5e-324, 1e-300, 1e-20, 1e20, 1e100, 1e300])
def test_any_finite_working_space(scale):
    """Lobes in a space whose numbers are a scale away from ours (0 is black): finite, or a ValueError."""
    try:
        lobes = core.burley_lobes(corners(8), scale * np.eye(3))
    except ValueError as error:
        assert "working_space" in str(error)
        return
    assert all(np.isfinite(values).all() for values in lobes.values())
    assert (lobes["weights"] >= 0).all() and (lobes["d_mm"] > 0).all()
    np.testing.assert_allclose(lobes["weights"].sum(1), lobes["rgb"].clip(0), rtol=1e-9, atol=1e-300)


@extremes.examples(200)
@given(st.tuples(*[st.floats(-1e6, 1e6)] * 3))
def test_lab_of_any_colour(xyz):
    """Finite, also of colours that no light has; black is black."""
    assert np.isfinite(core.lab(np.array([xyz]))).all()
    np.testing.assert_allclose(core.lab(np.zeros((1, 3))), 0, atol=1e-12)


def test_no_skins_no_work():
    """Empty arrays give empty arrays or say that they may not be."""
    none = np.empty((0, len(IDS)))
    assert core.reflectance(none, FEW_NM).shape == (0, len(FEW_NM))
    assert core.radial_profile(none, FEW_NM, RADII).shape == (0, len(FEW_NM), len(RADII))
    assert core.burley_lobes(none)["weights"].shape == (0, 4, 3)
    assert core.surface(none).shape == (0, 2)


@pytest.mark.parametrize("threads", [-1, -(2**31)])
def test_threads_below_0(threads):
    """Are refused by name."""
    with pytest.raises(ValueError, match="threads"):
        core.reflectance(DEFAULT[None], FEW_NM, threads=threads)


def test_threads_beyond_reason():
    """Two thousand million threads give the same numbers as one, and do not start two thousand million."""
    rows = np.repeat(DEFAULT[None], 3000, axis=0)
    assert (core.reflectance(rows, FEW_NM, threads=2**31 - 1) == core.reflectance(rows, FEW_NM, threads=1)).all()


def test_neighbouring_corners_do_not_share_memory():
    """The order of skins does not matter: every permutation of the corners gives the permuted result, bit by bit."""
    rows = corners(64)
    order = np.random.default_rng(1).permutation(len(rows))
    assert (core.reflectance(rows[order], FEW_NM) == core.reflectance(rows, FEW_NM)[order]).all()


def test_combinations_of_non_numbers():
    """NaN in every pair of columns at once is still one line about the first."""
    for i, j in itertools.combinations(range(len(IDS)), 2):
        row = DEFAULT.copy()
        row[[i, j]] = math.nan
        with pytest.raises(ValueError, match=IDS[i]):
            core.reflectance(row[None], FEW_NM)
