"""Slopes of painted heights on shapes whose slopes are known."""

import numpy as np
import pytest
import sanguine_core
from sanguine.domain.slopes import texel_axes

SIZE, PADDING = 256, 8
FACES = [[0, 1, 2], [0, 2, 3]]


def quads(shape, uv_of, cells=16):
    """A grid of quads over (0, 1) x (0, 1): shape and uv_of map (N, 2) to places in mm and to UV."""
    ticks = np.linspace(0.0, 1.0, cells + 1)
    grid = np.stack(np.meshgrid(ticks, ticks, indexing="xy"), axis=-1).reshape(-1, 2)
    low = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    quad = low[:, None] + [0, 1, cells + 2, cells + 1]
    vertex = quad.ravel().astype(np.int32)
    triangles = (4 * np.arange(len(quad))[:, None, None] + FACES).reshape(-1, 3).astype(np.int32)
    return shape(grid).astype(np.float32), uv_of(grid)[vertex].astype(np.float32), triangles, vertex


def plane(grid):
    return np.column_stack([80.0 * grid, np.zeros(len(grid))])


def upright(grid):
    return 0.1 + 0.8 * grid


def texels(mesh):
    surface = sanguine_core.SkinSurface(*mesh, [], np.zeros((len(mesh[0]), 0), dtype=np.float32))
    return surface.texels(SIZE, SIZE, PADDING)


def heights(shown, height):
    image = np.zeros(SIZE * SIZE, dtype=np.float32)
    image[shown.texel] = height(np.asarray(shown.place_mm).astype(float))
    return image.reshape(SIZE, SIZE, 1)


def found(mesh, height):
    """(N, 2) slopes of a function of places (N, 3) at the places of the texels within the mesh, and these places."""
    axes = texel_axes(*mesh, SIZE, PADDING)
    image = heights(texels(mesh), height)
    slopes = np.stack([axes.slopes(image, axis).ravel() for axis in (0, 1)], axis=1)
    surface = sanguine_core.SkinSurface(*mesh, [], np.zeros((len(mesh[0]), 0), dtype=np.float32))
    inside = surface.texels(SIZE, SIZE, 0)
    return slopes[inside.texel], np.asarray(inside.place_mm).astype(float)


def waves(place):
    return 0.4 * np.sin(place[:, 0] / 5.0) * np.cos(place[:, 1] / 7.0)


def gradient_of_waves(place):
    x, y = place[:, 0] / 5.0, place[:, 1] / 7.0
    return np.column_stack([0.08 * np.cos(x) * np.cos(y), -0.4 / 7.0 * np.sin(x) * np.sin(y)])


def close(slopes, expected):
    """Central differences of a wave of 31 mm are low by (2 pi texel / 31 mm)^2 / 6 of its steepest: 0.3 % for a texel of
    0.7 mm, 1 % for one of 1.2 mm, the longest here. At the rim, beyond which there is no skin, they lose up to the change
    within a texel, which the 95 % leave out."""
    off = np.linalg.norm(slopes - expected, axis=1) / 0.08
    assert np.median(off) < 0.01 and np.percentile(off, 95) < 0.02


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.5])
@pytest.mark.parametrize("skew", [0.0, 0.6])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_plane(turn, skew, mirrored):
    """Turned, skewed, stretched and mirrored layouts: T is where u rises, B at right angles to it where v rises."""
    layout = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ [[1.0, skew], [0.0, 0.7]]
    layout = layout @ np.diag([-0.45 if mirrored else 0.45, 0.45])
    mesh = quads(plane, lambda grid: 0.5 + (grid - 0.5) @ layout.T)
    slopes, place = found(mesh, waves)
    tangent = np.linalg.inv(layout)[:, 0]
    tangent /= np.linalg.norm(tangent)
    other = np.array([-tangent[1], tangent[0]]) * (-1.0 if mirrored else 1.0)
    assert other @ np.linalg.inv(layout)[:, 1] > 0.0
    close(slopes, gradient_of_waves(place) @ np.column_stack([tangent, other]))


def test_a_cylinder():
    """Round an axis of 40 mm: millimetres are those of the skin, not of the layout."""
    def shape(grid):
        angle = 2.0 * (grid[:, 0] - 0.5)
        return np.column_stack([40.0 * np.sin(angle), -40.0 * np.cos(angle), 60.0 * grid[:, 1]])

    mesh = quads(shape, upright, cells=32)
    slopes, place = found(mesh, lambda p: 0.3 * np.sin(40.0 * np.arctan2(p[:, 0], -p[:, 1]) / 6.0) + 0.05 * p[:, 2])
    along = 0.05 * np.cos(40.0 * np.arctan2(place[:, 0], -place[:, 1]) / 6.0)
    # A facet of 2.5 mm is flat: the angle on it is off its tangent's by up to 1/32, the slope by as much of its change.
    off = np.abs(slopes - np.column_stack([along, np.full(len(along), 0.05)])) / 0.05
    assert np.median(off, axis=0) == pytest.approx(0.0, abs=0.01) and np.percentile(off, 95, axis=0).max() < 0.03


def test_beside_an_edge_are_the_axes_of_the_island_that_is_read_there():
    """Two halves of a plane, one mirrored and turned in the layout: at the texels inside, and at the next one beyond the
    edge, which shows the other half's skin, the slope is told in the axes of the island that reads it."""
    position, uv, triangles, vertex = quads(plane, lambda grid: 0.05 + grid * [0.45, 0.9])
    right = np.repeat(position[vertex].reshape(-1, 4, 3)[..., 0].mean(axis=1) > 40.0, 4)
    grid = position[vertex][:, :2] / 80.0
    uv[right] = ([0.55, 0.05] + (grid[:, ::-1] - [0.0, 0.5]) * [0.42, 0.9])[right]
    mesh = position, uv, triangles, vertex
    axes = texel_axes(*mesh, SIZE, PADDING)
    image = heights(texels(mesh), lambda p: 0.3 * p[:, 0] - 0.1 * p[:, 1])
    slopes = np.stack([axes.slopes(image, axis)[..., 0] for axis in (0, 1)], axis=-1)
    edge = int(0.275 * SIZE)  # the texel that the left half's right edge crosses
    # Places of floats in millimetres tell steps of 0.3 mm to 1e-5.
    np.testing.assert_allclose(slopes[100, edge - 4 : edge + 2], [[0.3, -0.1]] * 6, atol=1e-4)
    low = int(0.05 * SIZE)  # and the right half's lower one, where the left half lies
    np.testing.assert_allclose(slopes[low - 1 : low + 4, 200], [[-0.1, 0.3]] * 5, atol=1e-4)


def test_islands_do_not_reach_into_each_other():
    """Flat halves of unlike height, four texels apart: no slope anywhere."""
    position, uv, triangles, vertex = quads(plane, upright)
    right = np.repeat(position[vertex].reshape(-1, 4, 3)[..., 0].mean(axis=1) > 40.0, 4)
    uv[right, 0] += 4.0 / SIZE
    image = np.zeros((SIZE, SIZE, 1), dtype=np.float32)
    image[:, SIZE // 2 + 2 :] = 1.0
    assert not texel_axes(position, uv, triangles, vertex, SIZE, PADDING).slopes(image, 0).any()


def test_triangles_without_area_have_no_slope_and_break_nothing():
    position, uv, triangles, vertex = quads(plane, upright, cells=2)
    uv[triangles[0]] = uv[triangles[0][0]]
    position[vertex[triangles[3]]] = position[vertex[triangles[3][0]]]
    axes = texel_axes(position, uv, triangles, vertex, 64, PADDING)
    image = np.random.default_rng(0).random((64, 64, 2), dtype=np.float32)
    for axis in (0, 1):
        slopes = axes.slopes(image, axis)
        assert np.isfinite(slopes).all() and slopes.any()


@pytest.mark.parametrize("size", [1, 2])
def test_a_map_of_a_texel_or_two(size):
    axes = texel_axes(*quads(plane, upright), size, PADDING)
    assert np.isfinite(axes.slopes(np.ones((size, size, 1), np.float32), 0)).all()
