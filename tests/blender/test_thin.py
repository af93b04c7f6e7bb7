"""Where flesh is thin: measured in mm whatever the scale, painted by whoever likes, gone with Sanguine."""

import bpy
import numpy as np
import pytest
import sanguine
from sanguine.blender.face import add_face
from sanguine.blender.removal import all_or_nothing, remove_skin
from sanguine.blender.skin import apply_skin
from sanguine.blender.surface import store_weights
from sanguine.blender.thin import measure_flesh, store_thin
from sanguine.domain.effects import Frame, Scene
from sanguine.domain.effects.thin import ATTRIBUTE
from sanguine.domain.parameters import default_skin
from sanguine.domain.plan import make_plan
from support.inventory import inventory
from support.patch import empty_scene


@pytest.fixture(autouse=True)
def fresh():
    empty_scene(16, 16, 1)
    sanguine.register()
    yield
    sanguine.unregister()


def made(vertices, faces, name="thing"):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.update()
    return obj


def slab(thickness, half=0.05, n=9):
    """A closed plate in metres, its middle vertex 40 on top of vertex 121."""
    at = np.linspace(-half, half, n)
    top = [(x, y, 0.0) for y in at for x in at]
    vertices = top + [(x, y, -thickness) for x, y, _ in top]
    faces = []
    for j in range(n - 1):
        for i in range(n - 1):
            a = j * n + i
            faces += [(a, a + 1, a + n + 1, a + n), tuple(k + n * n for k in (a + n, a + n + 1, a + 1, a))]
    rim = [*range(n), *range(2 * n - 1, n * n, n), *range(n * n - 2, n * n - n - 1, -1), *range(n * n - 2 * n, 0, -n)]
    faces += [(b, a, a + n * n, b + n * n) for a, b in zip(rim, [*rim[1:], rim[0]], strict=True)]
    return made(vertices, faces)


@pytest.mark.parametrize(("scale", "unit"), [((1, 1, 1), 1.0), ((2, 2, 0.5), 1.0), ((-1, 1, 1), 1.0), ((100, 100, 100), 0.01)])
@pytest.mark.parametrize("thickness_mm", [1.0, 3.0, 12.0])
def test_a_slab_is_as_thick_as_it_is(thickness_mm, scale, unit):
    """1 %: single precision of Blender's rays."""
    plate = slab(thickness_mm / 1000.0)
    plate.scale = scale
    bpy.context.scene.unit_settings.scale_length = unit
    bpy.context.view_layer.update()
    expected = thickness_mm * abs(scale[2]) * unit
    found = measure_flesh(plate)
    middle = [40, 40 + 81]
    np.testing.assert_allclose(found.thickness_mm[middle], expected, rtol=0.01)
    if expected <= 6.0:
        np.testing.assert_allclose(found.thin[middle], 1.0, atol=1e-6)
    elif expected > 10.0:
        assert not found.thin[middle].any()


def test_thick_flesh_is_not_thin():
    assert not measure_flesh(slab(0.03)).thin[[40, 121]].any()


def test_a_window_needs_light_behind_it():
    """A shell of 2 mm around a hollow: its wall is thin, but nothing shines from within."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=16, radius=0.05)
    outer = bpy.context.object.data
    inner = outer.copy()
    n = len(outer.vertices)
    vertices = [v.co[:] for v in outer.vertices] + [tuple(0.96 * c for c in v.co) for v in inner.vertices]
    faces = [tuple(p.vertices) for p in outer.polygons] + [tuple(k + n for k in reversed(p.vertices)) for p in inner.polygons]
    closed = measure_flesh(made(vertices, faces, "shell"))
    assert np.median(closed.thickness_mm[:n]) == pytest.approx(2.0, rel=0.1)
    assert not closed.thin[:n].any()  # seen from inside, it may: behind it is the open
    # With its upper half gone it is a bowl, and light shines in.
    faces = [f for f in faces if all(vertices[k][2] < 1e-6 for k in f)]
    bowl = measure_flesh(made(vertices, faces, "bowl"))
    assert bowl.thin[n - 1] > 0.95 or bowl.thin[:n].max() > 0.95


@pytest.mark.parametrize("name", ["nothing", "points", "plane", "no thickness", "three sheets on an edge", "lost corner", "huge", "flipped"])
def test_hard_meshes_are_thick_or_thin_but_never_nan(name):
    square = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    meshes = {
        "nothing": ([], []),
        "points": ([(0, 0, 0), (1, 0, 0)], []),
        "plane": (square, [(0, 1, 2, 3)]),
        "no thickness": (square + square, [(0, 1, 2, 3), (7, 6, 5, 4)]),
        "three sheets on an edge": ([*square, (0, 0, 1), (1, 0, 1), (0, 0, -1), (1, 0, -1)], [(0, 1, 2, 3), (0, 1, 5, 4), (0, 1, 7, 6)]),
        "lost corner": ([*square, (float("nan"), 0, 0)], [(0, 1, 2, 3), (0, 1, 4)]),
        "huge": ([tuple(1e7 * c for c in v) for v in square], [(0, 1, 2, 3)]),
        "flipped": (square, [(3, 2, 1, 0)]),
    }
    obj = made(*meshes[name])
    found = measure_flesh(obj)
    assert found.thin.shape == found.thickness_mm.shape == (len(obj.data.vertices),)
    assert np.isfinite(found.thin).all() and not np.isnan(found.thickness_mm).any()
    assert np.all((found.thin >= 0.0) & (found.thin <= 1.0))
    if name in ("nothing", "points", "plane", "huge", "flipped"):
        assert not found.thin.any()
    store_thin(obj)
    assert ATTRIBUTE in obj.vertex_groups


def test_ears_and_nostrils_are_found_and_lips_and_lids_are_not():
    """Thin by half and more: the ear's rim (its region reaches into the cheek), the wings of the nose; hardly anything where
    the far side is dark: lips, cheeks, and lids but for their inside, which light reaches through them."""
    face = add_face("female").skin
    thin = measure_flesh(face).thin
    regions = {name: region_weights(face, "sanguine_" + name) > 0.5 for name in ("ears", "nose", "lips", "cheeks", "chin", "eyelids")}
    share = {name: (thin[inside] > 0.5).mean() for name, inside in regions.items()}
    assert share["ears"] > 0.15 and share["nose"] > 0.02
    assert max(share[name] for name in ("lips", "cheeks", "chin")) < 0.05 and share["eyelids"] < 0.2
    assert 0.01 < (thin > 0.5).mean() < 0.1


def region_weights(obj, name):
    index = obj.vertex_groups[name].index
    return np.array([next((g.weight for g in v.groups if g.group == index), 0.0) for v in obj.data.vertices])


def plan(strength):
    return make_plan(Scene(default_skin(), (Frame("0"),), {"thin": strength}))


def test_a_painted_group_wins():
    face = slab(0.002)
    store_weights(face, ATTRIBUTE, np.full(len(face.data.vertices), 0.5))
    apply_skin(face, None, plan(1.0))
    np.testing.assert_allclose(region_weights(face, ATTRIBUTE), 0.5, atol=0.003)


def test_measured_when_it_runs_and_gone_with_sanguine():
    face = slab(0.002)
    face.data.materials.append(bpy.data.materials.new("before"))
    before = inventory()
    with all_or_nothing(face, 0):
        apply_skin(face, None, plan(0.0))
    assert ATTRIBUTE not in face.vertex_groups
    with all_or_nothing(face, 0):
        apply_skin(face, None, plan(1.0))
    assert region_weights(face, ATTRIBUTE)[[40, 121]] == pytest.approx(1.0)
    remove_skin(face)
    assert ATTRIBUTE not in face.vertex_groups
    after = inventory()
    assert before["objects/thing"] == after["objects/thing"] and before["meshes/thing"] == after["meshes/thing"]
