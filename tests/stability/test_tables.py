"""The add-on's table of lobes (addon/domain/lut.py) at its edges, corners and beyond, and in float32."""

import itertools

import numpy as np
import pytest
import sanguine_core as core
from hypothesis import given
from hypothesis import strategies as st
from sanguine.domain.lut import LOBES, bake, entry_skins, layout, table_image
from sanguine.domain.parameters import PARAMETERS, default_skin
from sanguine.domain.plan import AXIS_CHROMOPHORES, Axis
from stability import extremes

LOGARITHMIC = {"hemoglobin": True, "melanin": True, "oxygenation": False, "ink_per_mm": True}
OFFSET = {"ink_per_mm": 0.04}
FLOOR = 5e-4
"""A logarithmic axis without an offset begins no lower (plan.py)."""


def whole_axis(name: str, count: int, low: float | None = None, high: float | None = None) -> Axis:
    row = PARAMETERS[name]
    low = row.hard_min if low is None else low
    high = row.hard_max if high is None else high
    return made(name, max(low, FLOOR) if LOGARITHMIC[name] and name not in OFFSET else low, high, count)


def made(name: str, low: float, high: float, count: int) -> Axis:
    return Axis(name, low, high, count, LOGARITHMIC[name], OFFSET.get(name, 0.0))


def sound(table) -> None:
    assert table.image.dtype == np.float32 and np.isfinite(table.image).all()
    weights, widths = np.split(table.image, 2, axis=1)
    assert (weights >= 0).all() and (widths > 0).all()
    blocks = weights.reshape(len(weights), LOBES, -1, 3)
    assert (blocks.sum(1) <= 1 + 1e-6).all()  # float32
    assert np.isfinite(table.clamped).all() and np.isfinite(table.fit_error).all()


@pytest.mark.parametrize("names", [c for k in (1, 2, 3, 4) for c in itertools.combinations(AXIS_CHROMOPHORES, k)], ids="-".join)
def test_tables_over_whole_ranges(names):
    """Every set of axes over the whole hard ranges, every other parameter at both ends: finite, weights not negative and
    at most 1 + 1e-6 together (float32), widths above 0."""
    others = {name: (row.hard_min, row.hard_max) for name, row in PARAMETERS.items() if name not in names}
    for end in (0, 1):
        skin = default_skin() | {name: values[end] for name, values in others.items()}
        sound(bake(tuple(whole_axis(name, 3) for name in names), skin, "rec709"))


@pytest.mark.parametrize("name", AXIS_CHROMOPHORES)
def test_the_narrowest_axis(name):
    """Two entries 1e-9 apart: sound, and both the same within 1e-5 (a step of 1e-9 and float32)."""
    value = default_skin()[name]
    table = bake((whole_axis(name, 2, value, value + 1e-9),), default_skin(), "rec709")
    sound(table)
    np.testing.assert_allclose(*table.image.reshape(-1, 2, 3).transpose(1, 0, 2), rtol=1e-5)


def test_a_table_is_its_float64_rounded_once():
    """float32 tables are within 6e-8 (relative; half a unit in the last place) of the float64 lobes that they hold."""
    axes = tuple(whole_axis(name, 4) for name in AXIS_CHROMOPHORES)
    table = bake(axes, default_skin(), "acescg")
    lobes = core.burley_lobes(entry_skins(axes, default_skin()), "acescg", lobe_count=LOBES)
    exact = table_image(np.concatenate([lobes["weights"], lobes["d_mm"]], axis=1), axes)
    assert exact.shape == (*layout(axes).shape, 3)
    np.testing.assert_allclose(table.image, exact, rtol=6e-8, atol=np.finfo(np.float32).tiny)


def lookup(axis: Axis, table: np.ndarray, value: float) -> np.ndarray:
    """Linear between entries, the last entry beyond the ends: what an image node in EXTEND does with the coordinates of
    shaders_osl/chromophores.osl, whose own test renders them."""
    at = np.interp(value, axis.values(), np.arange(axis.count)) if not axis.logarithmic else np.interp(
        np.log(np.clip(value, axis.low, axis.high) + axis.offset), np.log(np.array(axis.values()) + axis.offset),
        np.arange(axis.count))
    first = min(int(at), axis.count - 2)
    return table[:, first] * (1 - (at - first)) + table[:, first + 1] * (at - first)


@pytest.mark.parametrize("name", AXIS_CHROMOPHORES)
def test_lookups_at_and_beyond_the_edges(name):
    """At the ends of an axis the table is the end entry, beyond them too (infinities included), and just inside it has
    not jumped: 1e-4 of the axis away the colour has moved by less than 1e-3 of itself."""
    axis = whole_axis(name, 12, PARAMETERS[name].soft_min, PARAMETERS[name].soft_max)
    image = bake((axis,), default_skin(), "rec709").image.reshape(2 * LOBES, axis.count, 3)
    for end, outward, column in ((axis.low, -1, 0), (axis.high, 1, -1)):
        for value in (end, end + outward * 1e-12, end + outward, outward * 1e300, outward * np.inf):
            np.testing.assert_allclose(lookup(axis, image, value), image[:, column], rtol=1e-6)
        inside = (end + axis.offset) * (1 - outward * 1e-4) - axis.offset if axis.logarithmic \
            else end - outward * 1e-4 * (axis.high - axis.low)
        colour = lookup(axis, image, inside)[:LOBES].sum(0)
        np.testing.assert_allclose(colour, image[:LOBES, column].sum(0), rtol=1e-3)


@extremes.examples(12)
@given(st.sampled_from(AXIS_CHROMOPHORES), st.floats(0, 1), st.floats(0, 1), st.integers(2, 30), st.data())
def test_any_axis_any_skin(name, a, b, count, data):
    """Axes of any place, length and count over any skin: sound; more of an absorber never brightens an entry's colour
    (luminance, within 1e-5)."""
    row = PARAMETERS[name]
    span = row.hard_max - row.hard_min
    low, high = sorted(max(row.hard_min + span * t, FLOOR) for t in (a, b))
    if high - low < 1e-9:
        high = low + 1e-9
    skin = {key: data.draw(st.floats(r.hard_min, r.hard_max), label=key) for key, r in PARAMETERS.items()}
    table = bake((made(name, low, min(high, row.hard_max), count),), skin, "rec709")
    sound(table)
    if name != "oxygenation":
        rows = entry_skins(table.axes, skin)
        Y = core.xyz(core.reflectance(rows, np.arange(380.0, 781.0, 10.0)), np.arange(380.0, 781.0, 10.0))[:, 1]
        assert (np.diff(Y) <= 1e-5 * Y[:-1]).all()
