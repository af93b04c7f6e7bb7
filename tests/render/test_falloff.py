"""Across a sharp light edge the rendered fall-off is the solver's own profile."""

import math

import bpy
import numpy as np
import pytest
import sanguine_core
from support.patch import camera_above, empty_scene, plane, render_linear
from sanguine.blender.material import build_skin_material
from sanguine.domain.effects import Frame, Scene
from sanguine.domain.parameters import default_skin, skin_rows
from sanguine.domain.plan import make_plan

WIDTH_MM = 16.0
COLUMNS = 256


def edge_light():
    """Parallel light straight down on x > 0 only: a blade, high above, holds it off x < 0."""
    sun = bpy.data.lights.new("sun", "SUN")
    sun.angle = 0.0
    sun.energy = math.pi  # a white Lambertian patch would show 1
    lamp = bpy.data.objects.new("sun", sun)
    bpy.context.scene.collection.objects.link(lamp)
    mesh = bpy.data.meshes.new("blade")
    mesh.from_pydata([(-1, -1, 0.2), (0, -1, 0.2), (0, 1, 0.2), (-1, 1, 0.2)], [], [(0, 1, 2, 3)])
    blade = bpy.data.objects.new("blade", mesh)
    blade.visible_camera = False
    black = bpy.data.materials.new("black")
    black.use_nodes = True
    black.node_tree.nodes.clear()  # no surface: it only stops light
    emit = black.node_tree.nodes.new("ShaderNodeEmission")
    emit.inputs["Strength"].default_value = 0.0
    output = black.node_tree.nodes.new("ShaderNodeOutputMaterial")
    black.node_tree.links.new(emit.outputs[0], output.inputs["Surface"])
    mesh.materials.append(black)
    bpy.context.scene.collection.objects.link(blade)


def predicted(skin, depth_mm):
    """Light at `depth_mm` (> 0) inside the shadow: all of the profile that reaches beyond the edge, (D, 3)."""
    radii_mm = sanguine_core.default_radii_mm()
    nm = np.arange(380.0, 781.0, 5.0)
    spectral = sanguine_core.radial_profile(skin_rows([skin]), nm, radii_mm)[0]
    rgb = sanguine_core.linear_rgb(sanguine_core.xyz(np.ascontiguousarray(spectral.T), nm), "rec709")
    fine = np.geomspace(radii_mm[0], radii_mm[-1], 4000)
    profile = np.stack([np.interp(np.log(fine), np.log(radii_mm), rgb[:, c]) for c in range(3)], axis=1)
    light = []
    for depth in depth_mm:
        # A ring of radius r > depth has the share acos(depth / r) / pi of its length beyond the edge.
        share = np.arccos(np.clip(depth / fine, 0.0, 1.0)) / math.pi
        light.append(np.trapezoid(profile * (share * 2.0 * math.pi * fine)[:, None], fine, axis=0)
                     if hasattr(np, "trapezoid") else
                     np.trapz(profile * (share * 2.0 * math.pi * fine)[:, None], fine, axis=0))
    return np.array(light)


@pytest.mark.parametrize("skin", [
    {"melanin": 0.012, "hemoglobin": 0.010},
    {"melanin": 0.018, "hemoglobin": 0.030, "oxygenation": 0.85},
    {"melanin": 0.070, "hemoglobin": 0.015},
    {"melanin": 0.250, "hemoglobin": 0.015},
], ids=lambda s: f"melanin {s['melanin']}")
@pytest.mark.parametrize("live", [False, True], ids=["constant", "table"])
def test_shadow_side_agrees_with_the_profile(skin, live):
    """L1 difference over the shadow within 10 % of the light there, per channel (the issue's bar)."""
    skin = default_skin() | skin | {"oil": 0.0}
    empty_scene(COLUMNS, 32, 256)
    plan = make_plan(Scene(skin, (Frame("0"),), live=live))
    plane(build_skin_material("patch", plan, {}))
    edge_light()
    camera_above(WIDTH_MM)
    rows = render_linear()
    x_mm = (np.arange(COLUMNS) + 0.5) / COLUMNS * WIDTH_MM - WIDTH_MM / 2.0
    shadow = x_mm < 0.0
    rendered = rows.mean(axis=0)[shadow]
    expected = predicted(skin, -x_mm[shadow])
    difference = np.abs(rendered - expected).sum(axis=0) / np.abs(expected).sum(axis=0)
    assert np.all(difference < 0.10), difference
