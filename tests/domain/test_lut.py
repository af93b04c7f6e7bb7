"""The table of scattering: interpolation between entries is invisible, and only what is asked is solved."""

import colour
import numpy as np
import pytest
import sanguine_core
from sanguine.domain.effects import Frame, Scene
from sanguine.domain.lut import LEVEL_STEP, LOBES, QUANTITIES, bake, entry_skins, layout
from sanguine.domain.parameters import PARAMETERS, default_skin, skin_rows
from sanguine.domain.plan import Axis, check_strengths, make_plan, spaced

HEMOGLOBIN = Axis("hemoglobin", 0.002, 0.06, 15, True)
MELANIN = Axis("melanin", 0.01, 0.06, 10, True)
OXYGENATION = Axis("oxygenation", 0.5, 0.95, 4, False)
INK = Axis("ink_per_mm", 0.0, 5.0, 3, True, 0.04)


def lab(rgb):
    white = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    return colour.XYZ_to_Lab(colour.RGB_to_XYZ(np.maximum(rgb, 0.0), "sRGB"), white)


def test_layout_is_axis_0_along_x_then_levels_up_then_quantities_aside():
    axes = (HEMOGLOBIN, MELANIN, OXYGENATION)
    table = bake(axes, default_skin(), "rec709")
    form = layout(axes)
    assert table.image.shape == (*form.shape, 3) == (form.levels * MELANIN.count, QUANTITIES * HEMOGLOBIN.count, 3)
    i, j, quantity = 3, 5, 1
    for k, level in ((0, 0), (OXYGENATION.count - 1, form.levels - 1)):
        skin = default_skin() | {
            axis.id: axis.values()[n] for axis, n in zip(axes, (i, j, k), strict=True)
        }
        fit = sanguine_core.burley_lobes(skin_rows([skin]), "rec709", lobe_count=LOBES)
        at = level * MELANIN.count + j, quantity * HEMOGLOBIN.count + i
        np.testing.assert_allclose(table.image[at], fit["weights"][0, quantity], rtol=1e-5)
        at = at[0], at[1] + LOBES * HEMOGLOBIN.count
        np.testing.assert_allclose(table.image[at], fit["d_mm"][0, quantity], rtol=1e-5)


def test_levels_lie_on_the_line_between_entries():
    axes = (HEMOGLOBIN, MELANIN, OXYGENATION)
    form = layout(axes)
    image = bake(axes, default_skin(), "rec709").image.reshape(form.levels, MELANIN.count, -1, 3)
    assert (OXYGENATION.high - OXYGENATION.low) / (form.levels - 1) <= LEVEL_STEP
    per_entry = (form.levels - 1) / (OXYGENATION.count - 1)
    middle = np.interp(0.5 * per_entry, [0, per_entry], [0, 1])
    inner = [k for k in range(form.levels) if k < per_entry]
    first, last = image[0], bake((*axes[:2], Axis("oxygenation", *OXYGENATION.values()[:2], 2, False)), default_skin(), "rec709")
    last = last.image.reshape(-1, MELANIN.count, first.shape[1], 3)[-1]
    assert middle == 0.5
    for k in inner:
        np.testing.assert_allclose(image[k], first + (last - first) * k / per_entry, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("melanin", [0.002, 0.02, 0.1])
@pytest.mark.parametrize("hemoglobin", [0.005, 0.05, 0.19])
def test_half_a_level_of_oxygenation_is_invisible(melanin, hemoglobin):
    """Delta E 2000 below 0.15 everywhere: a seventh of what an observer sees side by side."""
    base = default_skin() | {"melanin": melanin, "hemoglobin": hemoglobin}
    rows = skin_rows([base | {"oxygenation": o} for o in np.arange(0.0, 1.0 + 1e-9, 0.5 * LEVEL_STEP)])
    seen = lab(sanguine_core.burley_lobes(rows, "rec709", lobe_count=LOBES)["rgb"])
    assert colour.delta_E(seen[:-1], seen[1:], method="CIE 2000").max() < 0.15


def test_ink_stands_side_by_side():
    axes = (Axis("hemoglobin", 0.002, 0.06, 4, True), Axis("melanin", 0.01, 0.06, 3, True),
            Axis("oxygenation", 0.5, 0.95, 2, False), INK)
    table = bake(axes, default_skin(), "rec709")
    form = layout(axes)
    assert table.image.shape == (*form.shape, 3) == (form.levels * 3, QUANTITIES * 3 * 4, 3)
    at = (1, 2, 1, 2)
    skin = default_skin() | {axis.id: axis.values()[n] for axis, n in zip(axes, at, strict=True)}
    fit = sanguine_core.burley_lobes(skin_rows([skin]), "rec709", lobe_count=LOBES)
    for quantity in range(LOBES):
        place = (form.levels - 1) * 3 + at[1], (quantity * 3 + at[3]) * 4 + at[0]
        np.testing.assert_allclose(table.image[place], fit["weights"][0, quantity], rtol=1e-5)


def test_values_run_from_end_to_end():
    for axis in (HEMOGLOBIN, OXYGENATION, INK):
        values = axis.values()
        assert (values[0], values[-1]) == (axis.low, axis.high) and len(values) == axis.count
        assert np.all(np.diff(values) > 0.0)
    assert np.ptp(np.diff(np.log(np.array(INK.values()) + INK.offset))) < 1e-12


def test_a_constant_skin_is_one_entry():
    table = bake((), default_skin(), "rec709")
    assert table.image.shape == (1, QUANTITIES, 3)


def test_only_the_entries_of_the_plan_are_solved():
    scene = Scene(default_skin() | {"oil": 0.0}, (Frame("0"),), check_strengths({"anatomy": 0}, "t"), ())
    sanguine_core.reset_counters()
    bake(make_plan(scene).axes, scene.skin, "rec709")
    assert sanguine_core.counters()["lobe_fits"] == 3  # one fit per colour channel


@pytest.mark.parametrize("melanin", [0.013, 0.05, 0.2])
def test_interpolated_colour_is_the_solved_colour(melanin):
    """Half-way between entries of the planner's own spacing, Delta E 2000 stays below 0.3.

    0.3 is a third of the smallest difference an observer sees side by side (1.0).
    """
    regions = ("cheeks", "lips", "neck", "forehead", "nose", "ears", "chin", "eyelids")
    scene = Scene(default_skin() | {"melanin": melanin}, (Frame("a", {"anger": 1.0}), Frame("b", {"sad": 1.0})),
                  check_strengths({"mottle": 1.0}, "t"), regions)
    axes = make_plan(scene).axes
    for axis in axes:
        values = axis.values()
        for low, high in zip(values[:-1], values[1:], strict=True):
            middle = np.sqrt(low * high) if axis.logarithmic else 0.5 * (low + high)
            skins = skin_rows([dict(scene.skin) | {axis.id: value} for value in (low, high, middle)])
            rgb = sanguine_core.burley_lobes(skins, "rec709", lobe_count=LOBES)["rgb"]
            seen = lab(0.5 * (rgb[0] + rgb[1])), lab(rgb[2])
            assert colour.delta_E(*seen, method="CIE 2000") < 0.3, (axis.id, low, high)


@pytest.mark.parametrize("melanin", [0.005, 0.05, 0.2])
@pytest.mark.parametrize("hemoglobin", [5e-4, 0.014, 0.1])
@pytest.mark.parametrize("most", [0.5, 20.0])
def test_interpolated_ink_is_the_solved_ink(melanin, hemoglobin, most):
    """The same bar for tattoos, faint and opaque, over little and much blood."""
    axis = spaced("ink_per_mm", 0.0, most, 1.0)
    values = np.array(axis.values())
    steps = np.linspace(0.0, 1.0, 2 * axis.count - 1)
    assert [axis.value(t) for t in steps[::2]] == pytest.approx(values)
    skin = default_skin() | {"melanin": melanin, "hemoglobin": hemoglobin}
    rows = skin_rows([skin | {"ink_per_mm": axis.value(t)} for t in steps])
    rgb = sanguine_core.burley_lobes(rows, "rec709", lobe_count=LOBES)["rgb"]
    differences = colour.delta_E(lab(0.5 * (rgb[:-2:2] + rgb[2::2])), lab(rgb[1::2]), method="CIE 2000")
    assert differences.max() < 0.3, differences


def test_entries_cover_the_grid():
    rows = entry_skins((HEMOGLOBIN, MELANIN), default_skin())
    columns = list(PARAMETERS)
    assert rows.shape == (150, len(columns))
    assert rows[1, columns.index("hemoglobin")] == pytest.approx(HEMOGLOBIN.values()[1])
    assert rows[15, columns.index("melanin")] == pytest.approx(MELANIN.values()[1])
