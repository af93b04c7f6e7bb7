"""The size of a head: from chin to crown where landmarks tell, and what it should be scaled by."""

import numpy as np
import pytest
from sanguine.domain.head_size import HEAD_MM, head_size

# Eyes 68 mm apart, mouth below them, a crown, a chin that the jaw moves, and a shoulder that is no head.
POINTS = np.array([[34, 0, 0], [-34, 0, 0], [0, -20, -66], [0, 60, 120], [0, -10, -110], [150, 50, -400]], float)
LANDMARKS = {"eye_left": POINTS[0], "eye_right": POINTS[1], "mouth": POINTS[2] * [0, 0, 1]}
JAW = np.array([0, 0, 0.3, 0, 1.0, 0])


def rotation(seed):
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.diag(r))


@pytest.mark.parametrize("seed", range(3))
def test_chin_to_crown_however_the_head_is_turned(seed):
    turn = rotation(seed)
    size = head_size(POINTS @ turn.T, {name: turn @ place for name, place in LANDMARKS.items()}, JAW)
    assert size.height_mm == pytest.approx(230.0) and size.factor == 1.0 and not size.whole_mesh
    assert size.line == "the head is 230 mm tall"


@pytest.mark.parametrize("off,factor", [(1e3, 1e-3), (100, 0.01), (39.37, 0.0254), (0.01, 100), (0.001, 1000), (1.0, 1.0)])
def test_a_wrong_unit_is_named_by_the_factor_that_mends_it(off, factor):
    size = head_size(POINTS * off, {name: place * off for name, place in LANDMARKS.items()}, JAW)
    assert size.factor == pytest.approx(factor, rel=1e-3)
    assert HEAD_MM[0] <= size.height_mm * size.factor <= HEAD_MM[1]
    assert (f"scale it by {factor:g}" in size.line) == (factor != 1.0)


def test_without_landmarks_it_is_the_mesh():
    size = head_size(POINTS[:5], {})
    assert size.whole_mesh and size.height_mm == pytest.approx(230.0) and "measures" in size.line
    assert head_size(np.zeros((0, 3)), {}).factor == 1.0
    assert head_size(np.zeros((4, 3)), {}).factor == 1.0
