"""Teeth and gums: crowns set along the dental arches that the base mesh's helper bands mark."""

from __future__ import annotations

import numpy as np

from .surface import unit

SLOTS = ("teeth", "gum")

# Mesiodistal crown widths from the midline to the second molar, mm (Wheeler's Dental Anatomy, rounded).
UPPER_WIDTHS_MM = (8.5, 6.5, 7.6, 7.1, 6.7, 10.2, 9.4)
LOWER_WIDTHS_MM = (5.2, 5.8, 6.9, 7.0, 7.1, 11.0, 10.5)
UPPER_HEIGHTS_MM = (10.4, 9.3, 10.2, 8.6, 8.2, 7.5, 7.0)
LOWER_HEIGHTS_MM = (8.8, 9.2, 10.4, 8.6, 8.0, 7.5, 7.0)
THICKNESS_MM = (4.6, 4.4, 5.6, 7.6, 7.8, 9.2, 9.0)
SHOW_MM = 4.0  # upper edges reach this far below the guide, to show between parted lips
OVERBITE_MM = 2.4  # and this far below the lower edges
OVERJET_MM = 2.4  # lower arch lies this far inside the upper one
FORWARD_MM = 2.2


def _crown(width: float, height: float, thickness: float, cut: float) -> tuple[np.ndarray, np.ndarray]:
    """A rounded box, x along the arch, y outward, z from gum (0) to edge (height); `cut` thins it to the edge."""
    lon = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    lat = np.linspace(-np.pi / 2 + 0.02, np.pi / 2 - 0.02, 11)

    def power(x: np.ndarray, e: float) -> np.ndarray:
        return np.sign(x) * np.abs(x) ** e

    round_ = power(np.cos(lat), 0.45)[:, None]
    z = power(np.sin(lat), 0.6)[:, None] * np.ones_like(lon)
    toward_edge = (z + 1) / 2
    x = round_ * power(np.cos(lon), 0.62) * (0.445 + 0.075 * np.sqrt(toward_edge))
    y = round_ * power(np.sin(lon), 0.70) * (0.5 - cut * toward_edge**1.5)
    # What thins is the tongue side: the lip side of a crown stays nearly straight.
    y = y + cut * toward_edge**1.5 * 0.7
    vertices = np.stack([x * width, y * thickness, toward_edge * height], axis=-1).reshape(-1, 3)
    here = np.arange(16)
    there = np.roll(here, -1)
    row = np.arange(10)[:, None] * 16
    return vertices, np.stack([row + here, row + there, row + 16 + there, row + 16 + here], axis=-1).reshape(-1, 4)


def _arch(half_width: float, front: float, back: float, samples: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Half an ellipse from the midline to the left: points (N, 2) in the occlusal plane and arc length."""
    t = np.linspace(0, np.pi / 2, samples)
    points = np.stack([half_width * np.sin(t), back + (front - back) * np.cos(t)], axis=-1)
    return points, np.r_[0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]


def dental_arch(band: np.ndarray, upper: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Teeth and gum of one jaw, from its helper band (G, 3): vertices, quads, material (0 tooth, 1 gum)."""
    mm = 1e-3
    widths, heights = (UPPER_WIDTHS_MM, UPPER_HEIGHTS_MM) if upper else (LOWER_WIDTHS_MM, LOWER_HEIGHTS_MM)
    # The bands are thin guides inside the mouth; the crowns' lip side stands a little in front, just behind the lips.
    inset = (-FORWARD_MM if upper else OVERJET_MM - FORWARD_MM) * mm
    front, back = band[:, 1].min() + inset, band[:, 1].max()
    half_width = np.abs(band[:, 0]).max() - inset
    # The bands rise to the back (curve of Spee); the slope is that of the band's middle line.
    slope = np.polyfit(band[:, 1], band[:, 2], 1)[0]
    incisal = band[np.abs(band[:, 0]) < 10 * mm, 2]
    edge = incisal.min() - SHOW_MM * mm if upper else incisal.max() + (OVERBITE_MM - SHOW_MM) * mm
    toward_gum = 1.0 if upper else -1.0
    arch, arc = _arch(half_width, front, back)

    def at(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Point and outward normal of the arch at signed arc length s (positive on the left)."""
        x = np.interp(np.abs(s), arc, arch[:, 0]) * np.sign(s)
        y = np.interp(np.abs(s), arc, arch[:, 1])
        normal = unit(np.stack([x / half_width**2, (y - back) / (front - back) ** 2, np.zeros_like(x)], axis=-1))
        z = edge + slope * (y - front)
        return np.stack([x, y, z], axis=-1), normal

    vertices, faces, material = [], [], []
    base = 0
    start = np.r_[0, np.cumsum(widths)] * mm
    for k, (width, height, thickness) in enumerate(zip(widths, heights, THICKNESS_MM)):
        crown, quads = _crown(width * mm, height * mm, thickness * mm, 0.36 if k < 2 else 0.3 if k == 2 else 0.12)
        for side in (1.0, -1.0):
            point, normal = at(np.array([side * (start[k] + start[k + 1]) / 2]))
            along = np.cross(normal[0], [0, 0, 1.0])
            local = crown - [0, thickness / 2 * mm, height * mm]  # origin at the lip side of the edge
            placed = point[0] + local[:, :1] * along + local[:, 1:2] * normal[0] + local[:, 2:] * [0, 0, -toward_gum]
            vertices.append(placed)
            faces.append((quads if upper else quads[:, ::-1]) + base)
            material.append(np.zeros(len(quads), np.int32))
            base += len(placed)

    # The gum: a ridge swept along the arch, scalloped round the necks of the crowns.
    s = np.linspace(-start[-1], start[-1], 161)
    point, normal = at(s)
    tooth = np.clip(np.searchsorted(start, np.abs(s), side="right") - 1, 0, len(widths) - 1)
    within = (np.abs(s) - start[tooth]) / (np.array(widths)[tooth] * mm)
    height = np.interp(np.abs(s), (start[:-1] + start[1:]) / 2, heights) * mm
    scallop = np.clip(np.sin(np.pi * within), 0, 1) ** 0.6 * 1.6 * mm
    neck = height * 0.80 - 1.4 * mm + scallop
    thick = np.interp(np.abs(s), (start[:-1] + start[1:]) / 2, THICKNESS_MM) * mm
    turn = np.linspace(0, 2 * np.pi, 14, endpoint=False)
    # The cross-section is an ellipse, flattened at the neck, standing behind the crowns' lip side.
    out = np.cos(turn) * (0.5 + 0.08 * np.sin(turn))
    up = np.sin(turn)
    depth = 5.5 * mm
    ring = (
        point[:, None]
        + normal[:, None] * ((out * (thick[:, None] + 1.2 * mm)) - thick[:, None] / 2 + 0.1 * mm)[..., None]
        + np.array([0, 0, toward_gum]) * (neck[:, None] + depth * (1 + up))[..., None]
    )
    here = np.arange(14)
    there = np.roll(here, -1)
    row = np.arange(len(s) - 1)[:, None] * 14
    quads = np.stack([row + here, row + 14 + here, row + 14 + there, row + there], axis=-1).reshape(-1, 4)
    vertices.append(ring.reshape(-1, 3))
    faces.append((quads if upper else quads[:, ::-1]) + base)
    material.append(np.ones(len(quads), np.int32))
    return np.concatenate(vertices).astype(np.float32), np.concatenate(faces), np.concatenate(material)
