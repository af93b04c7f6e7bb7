"""From a preset to a head: shape the base mesh, cut the bust, dress it with eyes, teeth, lashes, brows and hair."""

from __future__ import annotations

import zlib

import numpy as np

from . import bust as bust_
from . import eyes as eyes_
from . import hair as hair_
from . import strands, teeth
from .model import Head, MeshPart, shape_keys
from .package import ARKIT_NAMES, LICENCE, BaseMesh, HeadPackage
from .presets import Preset
from .regions import ImageReader, Region, region_weights
from .surface import Binding, Subdivision, edges_of, unit, vertex_normals

NAMES = list(ARKIT_NAMES)
TEAR_RADIUS_M = 0.00035  # the meniscus of tears is 0.2 to 0.5 mm high

# Landmarks as points of the unshaped base mesh (metres, left side); the nearest skin vertex carries them.
LANDMARKS = {
    "nose_tip": (0.0, -0.1681, 0.6909),
    "chin": (0.0, -0.1516, 0.6327),
    "forehead": (0.0, -0.1531, 0.7800),
    "nasion": (0.0, -0.1507, 0.7351),
    "upper_lip": (0.0, -0.1601, 0.6671),
    "lower_lip": (0.0, -0.1566, 0.6556),
    "mouth_corner_left": (0.0240, -0.1400, 0.6600),
    "mouth_corner_right": (-0.0240, -0.1400, 0.6600),
    "cheek_left": (0.0450, -0.1350, 0.6950),
    "cheek_right": (-0.0450, -0.1350, 0.6950),
    "crown": (0.0, -0.0500, 0.8490),
}


def shaped(package: HeadPackage, base: BaseMesh, preset: Preset) -> tuple[np.ndarray, np.ndarray]:
    """The neutral face (19158, 3) of a preset and what each ARKit unit still moves from it (52, 19158, 3)."""
    vertices = base.vertices.copy()
    for name, weight in preset.morphs.items():
        index, delta = package.morph(name)
        vertices[index] += np.float32(weight) * delta
    units = package.face_units()
    for name, weight in preset.rest.items():
        unit_ = units[NAMES.index(name)]
        vertices += np.float32(weight) * unit_
        if name.startswith("eyeWide"):  # a lid that rests wide has farther to go to close
            units[NAMES.index(name.replace("Wide", "Blink"))] -= np.float32(weight) * unit_
        unit_ *= np.float32(1 - weight)
    return vertices, units


def _eyes_part(
    base: BaseMesh, vertices: np.ndarray, units: np.ndarray
) -> tuple[MeshPart, dict[str, tuple[np.ndarray, float]]]:
    pieces, moved, fits, offset = [], [], {}, 0
    for side, group in (("left", "helper-l-eye"), ("right", "helper-r-eye")):
        guide = base.vertices_of(group)
        ball = vertices[guide]
        # The helper's cornea bulges forward; its back half is the globe.
        fits[side] = guide, *eyes_.fit_sphere(ball[ball[:, 1] > np.quantile(ball[:, 1], 0.25)])
    middle = (fits["left"][1] + fits["right"][1]) / 2
    target = middle - np.array([0, eyes_.GAZE_M, 0], np.float32)
    for side, (guide, centre, radius) in fits.items():
        v, f, uv, material = eyes_.eyeball(centre, radius - eyes_.FILM_M, target)
        follow = eyes_.carried(v, vertices[guide], units[:, guide])
        follow[NAMES.index(f"eyeBlink{side.title()}")] += np.float32([0, eyes_.BLINK_RETRACTION_M, 0])
        moved.append(follow)
        pieces.append((v, f + offset, uv, material))
        offset += len(v)
    v, f, uv, material = (np.concatenate(column) for column in zip(*pieces))
    keys = shape_keys(NAMES, np.concatenate(moved, axis=1))
    part = MeshPart("eyes", v, f.astype(np.int32), uv.astype(np.float32), material, eyes_.SLOTS, keys)
    return part, {side: (centre, radius) for side, (_, centre, radius) in fits.items()}


def _teeth_part(base: BaseMesh, vertices: np.ndarray, units: np.ndarray) -> MeshPart:
    pieces, moved, offset = [], [], 0
    for upper, group in ((True, "helper-upper-teeth"), (False, "helper-lower-teeth")):
        guide = base.vertices_of(group)
        v, f, material = teeth.dental_arch(vertices[guide], upper)
        # The upper jaw is part of the skull; its helper only drifts by rounding.
        moved.append(np.zeros((len(units), *v.shape), np.float32) if upper else eyes_.carried(v, vertices[guide], units[:, guide]))
        pieces.append((v, f + offset, material))
        offset += len(v)
    v, f, material = (np.concatenate(column) for column in zip(*pieces))
    uv = np.zeros((*f.shape, 2), np.float32)
    return MeshPart("teeth", v, f.astype(np.int32), uv, material, teeth.SLOTS, shape_keys(NAMES, np.concatenate(moved, axis=1)))


def _tongue_part(base: BaseMesh, vertices: np.ndarray, units: np.ndarray) -> MeshPart:
    group = base.groups["helper-tongue"]
    source, faces = np.unique(group.faces, return_inverse=True)
    faces = faces.reshape(-1, 4).astype(np.int32)
    keys = shape_keys(NAMES, units[:, source])
    return MeshPart("tongue", vertices[source], faces, group.uv, np.zeros(len(faces), np.int32), ("tongue",), keys, subdivision=2)


def _hair_part(name: str, spine: np.ndarray, normal: np.ndarray, radius: np.ndarray, moved: np.ndarray) -> MeshPart:
    """Tubes from spines (N, K, 3) and the displacement of each spine point (units, N*K, 3)."""
    v, f, owner = strands.tubes(spine, normal, radius)
    along = np.tile(np.repeat(np.linspace(0, 1, spine.shape[1]), strands.SIDES), len(spine))
    uv = np.stack([np.full_like(along, 0.5), along], axis=-1)[f]
    keys = shape_keys(NAMES, moved[:, owner])
    return MeshPart(name, v, f, uv.astype(np.float32), np.zeros(len(f), np.int32), (name,), keys)


def _move(binding: Binding, units: np.ndarray) -> np.ndarray:
    """Displacements (units, N, 3) at bound points."""
    flat = np.moveaxis(units, 0, 1).reshape(units.shape[1], -1)
    return np.moveaxis(binding(flat).reshape(len(binding.index), len(units), 3), 0, 1)


def _lashes_part(preset: Preset, base: BaseMesh, vertices: np.ndarray, units: np.ndarray, rng: np.random.Generator) -> MeshPart:
    spines, moved, is_upper = [], [], []
    for side in "lr":
        eye = base.vertices[base.vertices_of(f"helper-{side}-eye")].mean(axis=0)
        for group, count, reach in ((2, 130, 1.9), (1, 60, 1.0)):
            card = base.groups[f"helper-{side}-eyelashes-{group}"].faces
            binding = strands.lash_binding(card, eye, base.vertices, count, reach, rng)
            spines.append(binding(vertices).reshape(count, -1, 3))
            moved.append(_move(binding, units))
            is_upper.append(np.full(count, group == 2))
    spine, upper = np.concatenate(spines), np.concatenate(is_upper)
    taper = np.interp(np.linspace(0, 1, spine.shape[1]), [0, 0.5, 1], [1, 0.8, 0.15])
    radius = rng.uniform(0.75, 1.15, (len(spine), 1)) * taper * preset.lash_radius_mm * 1e-3
    # The upper lashes curl up, the lower a little down.
    curl = np.linspace(0, 1, spine.shape[1]) ** 2 * 1.4e-3
    spine[:, :, 2] += np.where(upper, 1.0, -0.4)[:, None] * curl
    normal = np.broadcast_to(np.array([0, 0, 1.0]), spine.shape)
    return _hair_part("lashes", spine, normal, radius, np.concatenate(moved, axis=1))


def _brows_part(
    preset: Preset, base: BaseMesh, fine_base: np.ndarray, fine: np.ndarray, faces: np.ndarray, units: np.ndarray, rng: np.random.Generator
) -> MeshPart:
    normals = vertex_normals(fine, faces)
    spines, up, moved = [], [], []
    for side, sign in (("l", 1.0), ("r", -1.0)):
        eye = base.vertices[base.vertices_of(f"helper-{side}-eye")].mean(axis=0)
        binding, height = strands.brow_binding(preset.brows, sign, eye, fine_base, faces, rng)
        normal = unit(binding(normals))
        spines.append((binding(fine) + normal * height[:, None]).reshape(preset.brows.count, -1, 3))
        up.append(normal.reshape(preset.brows.count, -1, 3))
        moved.append(_move(binding, units))
    spine = np.concatenate(spines)
    taper = np.interp(np.linspace(0, 1, spine.shape[1]), [0, 0.6, 1], [0.9, 0.75, 0.12])
    radius = preset.brows.radius_mm * 1e-3 * taper * rng.uniform(0.75, 1.15, (len(spine), 1))
    return _hair_part("brows", spine, np.concatenate(up), radius, np.concatenate(moved, axis=1))


def _tear_part(eyes: dict[str, tuple[np.ndarray, float]], fine: np.ndarray, edges: np.ndarray, units: np.ndarray) -> MeshPart:
    """The meniscus along both lids: a thread of water that closes the edge between lid and globe."""
    pieces, moved, offset = [], [], 0
    for centre, radius in eyes.values():
        binding = strands.tear_binding(fine, edges, centre, radius)
        spine = binding(fine)[None]
        v, f, owner = strands.tubes(spine, spine - centre, np.full(spine.shape[:2], TEAR_RADIUS_M), sides=8)
        pieces.append((v, f + offset))
        moved.append(_move(binding, units)[:, owner])
        offset += len(v)
    v, f = (np.concatenate(column) for column in zip(*pieces))
    uv = np.zeros((*f.shape, 2), np.float32)
    keys = shape_keys(NAMES, np.concatenate(moved, axis=1))
    return MeshPart("tears", v, f, uv, np.zeros(len(f), np.int32), ("cornea",), keys)


def build_head(preset: Preset, regions: tuple[Region, ...], read_image: ImageReader, package: HeadPackage | None = None) -> Head:
    """The head of a preset. `read_image` turns a path into an array (H, W[, C]) of 0..1, top row first."""
    package = package or HeadPackage()
    base = package.base_mesh()
    vertices, units = shaped(package, base, preset)
    bust = bust_.cut_bust(base)
    # The bust stands on the ground, its neck over the origin.
    neck = vertices[base.vertices_of("joint-neck")].mean(axis=0)
    stand = np.array([0, neck[1], vertices[bust.source, 2].min()], np.float32)
    vertices -= stand
    rng = np.random.default_rng(zlib.crc32(preset.id.encode()))  # the same head every time

    skin_vertices = vertices[bust.source] + bust_.round_edge(bust, base)
    skin_units = units[:, bust.source]
    skin = MeshPart(
        "skin", skin_vertices, bust.faces, bust.uv, bust.material, bust_.SLOTS, shape_keys(NAMES, skin_units), subdivision=2
    )
    weights = region_weights(regions, package, base, bust, read_image)

    # Hair is rooted on the surface as it will be rendered: once subdivided, the cage has nearly reached it.
    refine = Subdivision(bust.faces, len(skin_vertices))
    flat_units = np.moveaxis(skin_units, 0, 1).reshape(len(skin_vertices), -1)
    fine = refine(np.concatenate([base.vertices[bust.source], skin_vertices, flat_units], axis=1))
    fine_base, fine_skin = fine[:, :3], fine[:, 3:6]
    fine_units = np.moveaxis(fine[:, 6:].reshape(len(fine), len(NAMES), 3), 1, 0)

    eyes, globes = _eyes_part(base, vertices, units)
    landmarks = {f"eye_{side}": centre for side, (centre, _) in globes.items()}
    landmarks["eyes"] = (landmarks["eye_left"] + landmarks["eye_right"]) / 2
    eyes_base = np.concatenate([base.vertices[base.vertices_of(f"helper-{s}-eye")] for s in "lr"]).mean(axis=0)
    ears = weights.get("ears", np.zeros(len(skin_vertices), np.float32))
    scalp = hair_.scalp_mask(preset.hair, base.vertices[bust.source], ears, eyes_base).astype(np.float32)
    hair = hair_.grow(preset.hair, refine(scalp[:, None])[:, 0], fine_skin, refine.faces, landmarks["eyes"], rng)
    parts = (
        skin,
        eyes,
        _tear_part(globes, fine_skin, edges_of(refine.faces)[0], fine_units),
        _teeth_part(base, vertices, units),
        _tongue_part(base, vertices, units),
        _lashes_part(preset, base, vertices, units, rng),
        _brows_part(preset, base, fine_base, fine_skin, refine.faces, fine_units, rng),
    )
    landmarks["neck"] = neck - stand
    for name, place in LANDMARKS.items():
        nearest = np.linalg.norm(base.vertices[bust.source] - np.array(place), axis=1).argmin()
        landmarks[name] = skin_vertices[nearest]
    return Head(parts, hair, weights, scalp, landmarks, preset.id, LICENCE)
