"""The little pictures of poses."""

import numpy as np
import pytest
from sanguine.domain.thumbnail import face_picture

SQUARE = np.array([[[0, 0, 0], [1, 0, 0], [1, 0, 1.0]], [[0, 0, 0], [1, 0, 1], [0, 0, 1.0]]])  # faces -Y


def test_a_square_fills_the_picture_but_for_its_margin():
    covered = face_picture(SQUARE, 64)[..., 3]
    assert covered.mean() == pytest.approx(1 / 1.05**2, abs=0.02)  # a texel's width at each border
    assert covered[4:-4, 4:-4].min() == 1.0  # no holes


def test_the_nearer_of_two_is_seen_and_backs_are_not():
    tilted = SQUARE.copy()
    tilted[..., 1] = 0.8 * tilted[..., 2] - 2.0  # nearer, and turned to the light
    near = face_picture(tilted, 32)[16, 16]
    assert face_picture(np.concatenate([SQUARE, tilted]), 32)[16, 16] == pytest.approx(near)
    assert face_picture(np.concatenate([tilted, SQUARE]), 32)[16, 16] == pytest.approx(near)
    assert near[0] != pytest.approx(face_picture(SQUARE, 32)[16, 16, 0])
    assert not face_picture(SQUARE[:, ::-1], 32).any()


@pytest.mark.parametrize("corners", [np.zeros((0, 3, 3)), np.zeros((5, 3, 3)), np.full((2, 3, 3), np.nan)])
def test_nothing_to_see_is_an_empty_picture(corners):
    assert not face_picture(corners, 16).any()
