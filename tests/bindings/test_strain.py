"""Contracts of the strain binding: shapes, types, errors, no leaks of wrong input into the library."""

import numpy as np
import pytest
import sanguine_core

POSITION = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float32)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)


def test_strain_of_several_keys_at_once():
    keys = np.stack([POSITION * 0.0, POSITION * np.float32([0.5, 0, 0])])
    log = sanguine_core.surface_strain(POSITION, TRIANGLES, keys)
    linear = sanguine_core.surface_strain(POSITION, TRIANGLES, keys, measure="linear")
    assert log.shape == linear.shape == (2, 4, 6) and log.dtype == np.float32
    assert log[0] == pytest.approx(0.0, abs=1e-12)
    assert log[1] == pytest.approx(np.tile([np.log(1.5), 0, 0, 0, 0, 0], (4, 1)), abs=1e-6)  # float32
    assert linear[1] == pytest.approx(np.tile([0.5, 0, 0, 0, 0, 0], (4, 1)), abs=1e-6)


def test_areas_sum_to_the_surface():
    assert sanguine_core.vertex_areas(POSITION, TRIANGLES).sum() == pytest.approx(1.0)


def test_stripes_have_one_value_per_vertex():
    across = np.tile(np.float32([0.25, 0, 0]), (4, 1))
    phase = sanguine_core.stripe_phase(POSITION, TRIANGLES, across, np.ones(4, np.float32))
    assert phase.shape == (4,) and abs(phase[1] - phase[0]) == pytest.approx(0.25, abs=1e-5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"triangles": np.array([[0, 1, -1]], np.int32)}, "triangle 0"),
        ({"position": np.full((4, 3), np.nan, np.float32)}, "vertex 0 is not finite"),
        ({"displacements": np.zeros((1, 3, 3), np.float32)}, "3 for 4 vertices"),
        ({"measure": "cubic"}, "linear, log"),
    ],
)
def test_wrong_input_is_one_line(change, message):
    given = {"position": POSITION, "triangles": TRIANGLES, "displacements": np.zeros((1, 4, 3), np.float32)} | change
    with pytest.raises(ValueError, match=message):
        sanguine_core.surface_strain(**given)
