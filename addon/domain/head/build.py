"""From a preset to a head: shape the base mesh, cut the bust, dress it with eyes, teeth, lashes, brows and hair."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

from . import eyes, hair, lips, strands, teeth
from .bust import SLOTS as SKIN_SLOTS
from .bust import Bust, cut_bust, round_edge
from .model import Head, MeshPart, shape_keys
from .package import KEY_NAMES, LICENCE, BaseMesh, HeadPackage
from .presets import Preset
from .regions import ImageReader, Region, region_weights
from .surface import Binding, Subdivision, edges_of, unit, vertex_normals
from .units import mend

TEAR_RADIUS_M = 0.00035  # the meniscus of tears is 0.2 to 0.5 mm high
UNDERCOAT_M = (0.0004, 0.0022)  # over the scalp: at the hairline, and where hair is dense
UPPER_LASHES = ("2", 130, 1.9)  # the card's name in hm08, lashes in each eye, length over the card's height
LOWER_LASHES = ("1", 60, 1.0)

# Landmarks as points of the unshaped base mesh (metres); the nearest skin vertex carries them.
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


@dataclass(frozen=True)
class Person:
    """The base mesh in the shape of a preset.

    vertices : (19158, 3) metres, neutral
    units    : (K, 19158, 3) what each key of KEY_NAMES moves from there
    """

    base: BaseMesh
    vertices: np.ndarray
    units: np.ndarray

    def base_eye(self, side: str) -> np.ndarray:
        """Middle of an eye ('l', 'r') on the unshaped mesh."""
        return self.base.vertices[self.base.vertices_of(f"helper-{side}-eye")].mean(axis=0)


@dataclass(frozen=True)
class FineSkin:
    """The skin as it is rendered, near enough: subdivided once. What grows on the skin is rooted here, not on the cage.

    base     : (W, 3) unshaped; vertices (W, 3) in the preset's shape; units (K, W, 3); faces (G, 4)
    """

    base: np.ndarray
    vertices: np.ndarray
    units: np.ndarray
    faces: np.ndarray


def shape(package: HeadPackage, preset: Preset) -> Person:
    base = package.base_mesh()
    units = package.face_units(base.vertices)
    mend(units, base.vertices)
    vertices = base.vertices.copy()
    for name, weight in preset.morphs.items():
        index, delta = package.morph(name)
        vertices[index] += np.float32(weight) * delta
    for name, weight in preset.rest.items():
        resting = units[KEY_NAMES.index(name)]
        vertices += np.float32(weight) * resting
        if name.startswith("eyeWide"):  # a lid that rests wide has farther to go to close
            units[KEY_NAMES.index(name.replace("Wide", "Blink"))] -= np.float32(weight) * resting
        resting *= np.float32(1 - weight)
    return Person(base, vertices, units)


def refine(person: Person, bust: Bust, skin: np.ndarray, subdivide: Subdivision) -> FineSkin:
    """All of the skin's data subdivided in one pass."""
    moves = np.moveaxis(person.units[:, bust.source], 0, 1).reshape(len(skin), -1)
    fine = subdivide(np.concatenate([person.base.vertices[bust.source], skin, moves], axis=1))
    units = np.moveaxis(fine[:, 6:].reshape(len(fine), -1, 3), 1, 0)
    return FineSkin(fine[:, :3], fine[:, 3:6], units, subdivide.faces)


def carry(binding: Binding, units: np.ndarray) -> np.ndarray:
    """Displacements (K, N, 3) at points bound to a mesh with displacements (K, V, 3)."""
    moves = np.moveaxis(units, 0, 1).reshape(units.shape[1], -1)
    return np.moveaxis(binding(moves).reshape(len(binding.index), len(units), 3), 0, 1)


def _join(pieces: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One mesh from several (vertices, faces, displacements)."""
    vertices, faces, moves = zip(*pieces)
    start = np.cumsum([0, *map(len, vertices[:-1])])
    faces = np.concatenate([f + s for f, s in zip(faces, start)]).astype(np.int32)
    return np.concatenate(vertices).astype(np.float32), faces, np.concatenate(moves, axis=1)


def _part(
    name: str,
    slots: tuple[str, ...],
    pieces: list[tuple[np.ndarray, np.ndarray, np.ndarray]],
    uv: np.ndarray | None = None,
    material: np.ndarray | None = None,
    subdivision: int = 0,
) -> MeshPart:
    vertices, faces, moves = _join(pieces)
    uv = np.zeros((*faces.shape, 2), np.float32) if uv is None else uv.astype(np.float32)
    material = np.zeros(len(faces), np.int32) if material is None else material
    return MeshPart(name, vertices, faces, uv, material, slots, shape_keys(KEY_NAMES, moves), subdivision)


def globes(person: Person) -> dict[str, tuple[np.ndarray, float]]:
    """Centre and radius of both eyeballs. The helper's cornea bulges forward; its back three quarters are the globe."""
    found = {}
    for side in "lr":
        ball = person.vertices[person.base.vertices_of(f"helper-{side}-eye")]
        found[side] = eyes.fit_sphere(ball[ball[:, 1] > np.quantile(ball[:, 1], 0.25)])
    return found


def _eyes(person: Person, balls: dict[str, tuple[np.ndarray, float]]) -> MeshPart:
    target = sum(centre for centre, _ in balls.values()) / 2 - np.float32([0, eyes.GAZE_M, 0])
    pieces, uvs, materials = [], [], []
    for (side, (centre, radius)), name in zip(balls.items(), ("Left", "Right")):
        vertices, faces, uv, material = eyes.eyeball(centre, radius - eyes.FILM_M, target)
        guide = person.base.vertices_of(f"helper-{side}-eye")
        moves = eyes.carried(vertices, person.vertices[guide], person.units[:, guide])
        moves[KEY_NAMES.index(f"eyeBlink{name}")] += np.float32([0, eyes.BLINK_RETRACTION_M, 0])
        pieces.append((vertices, faces, moves))
        uvs.append(uv)
        materials.append(material)
    return _part("eyes", eyes.SLOTS, pieces, np.concatenate(uvs), np.concatenate(materials))


def _tears(balls: dict[str, tuple[np.ndarray, float]], fine: FineSkin) -> MeshPart:
    """The meniscus along both lids: a thread of water that closes the edge between lid and globe."""
    edges, _, _ = edges_of(fine.faces)
    pieces = []
    for centre, radius in balls.values():
        binding = strands.tear_binding(fine.vertices, edges, centre, radius)
        spine = binding(fine.vertices)[None]
        thread = np.full(spine.shape[:2], TEAR_RADIUS_M)
        vertices, faces, owner = strands.tubes(spine, spine - centre, thread, sides=8)
        pieces.append((vertices, faces, carry(binding, fine.units)[:, owner]))
    return _part("tears", ("cornea",), pieces)


def _teeth(person: Person) -> MeshPart:
    pieces, materials = [], []
    for upper, group in ((True, "helper-upper-teeth"), (False, "helper-lower-teeth")):
        guide = person.base.vertices_of(group)
        vertices, faces, material = teeth.dental_arch(person.vertices[guide], upper)
        moves = eyes.carried(vertices, person.vertices[guide], person.units[:, guide])
        if upper:  # part of the skull; its helper only drifts by rounding
            moves[:] = 0
        pieces.append((vertices, faces, moves))
        materials.append(material)
    return _part("teeth", teeth.SLOTS, pieces, material=np.concatenate(materials))


def _tongue(person: Person) -> MeshPart:
    group = person.base.groups["helper-tongue"]
    source, faces = np.unique(group.faces, return_inverse=True)
    piece = (person.vertices[source], faces.reshape(-1, 4), person.units[:, source])
    return _part("tongue", ("tongue",), [piece], group.uv, subdivision=2)


def _hairs(name: str, spine: np.ndarray, up: np.ndarray, radius: np.ndarray, moves: list[np.ndarray]) -> MeshPart:
    """A tube around each spine (N, K, 3); `moves` are displacements of the spine points, (keys, N*K, 3) in pieces."""
    vertices, faces, owner = strands.tubes(spine, up, radius)
    return _part(name, (name,), [(vertices, faces, np.concatenate(moves, axis=1)[:, owner])])


def _lashes(person: Person, radius_mm: float, rng: np.random.Generator) -> MeshPart:
    spines, moves, curls = [], [], []
    for side in "lr":
        for (card, count, reach), curl_mm in ((UPPER_LASHES, 1.4), (LOWER_LASHES, -0.5)):
            faces = person.base.groups[f"helper-{side}-eyelashes-{card}"].faces
            eye = person.base_eye(side)
            binding = strands.lash_binding(faces, eye, person.base.vertices, count, reach, rng)
            spines.append(binding(person.vertices).reshape(count, -1, 3))
            moves.append(carry(binding, person.units))
            curls.append(np.full((count, 1), curl_mm * 1e-3))
    spine = np.concatenate(spines)
    along = np.linspace(0, 1, spine.shape[1])
    spine[..., 2] += np.concatenate(curls) * along**2
    taper = np.interp(along, [0, 0.5, 1], [1, 0.8, 0.15]) * radius_mm * 1e-3
    radius = taper * rng.uniform(0.75, 1.15, (len(spine), 1))
    return _hairs("lashes", spine, np.broadcast_to([0, 0, 1.0], spine.shape), radius, moves)


def _brows(person: Person, preset: Preset, fine: FineSkin, rng: np.random.Generator) -> MeshPart:
    normals = vertex_normals(fine.vertices, fine.faces)
    spines, ups, moves = [], [], []
    for side, sign in (("l", 1.0), ("r", -1.0)):
        eye = person.base_eye(side)
        binding, height = strands.brow_binding(preset.brows, sign, eye, fine.base, fine.faces, rng)
        up = unit(binding(normals))
        spines.append((binding(fine.vertices) + up * height[:, None]).reshape(preset.brows.count, -1, 3))
        ups.append(up.reshape(preset.brows.count, -1, 3))
        moves.append(carry(binding, fine.units))
    spine = np.concatenate(spines)
    taper = np.interp(np.linspace(0, 1, spine.shape[1]), [0, 0.6, 1], [0.9, 0.75, 0.12])
    radius = preset.brows.radius_mm * 1e-3 * taper * rng.uniform(0.75, 1.15, (len(spine), 1))
    return _hairs("brows", spine, np.concatenate(ups), radius, moves)


def _undercoat(fine: FineSkin, density: np.ndarray) -> MeshPart:
    """A shade just above the scalp, so that skin does not shine through between hairs that are fewer than in life."""
    haired = density[fine.faces].max(axis=1) > 0.02
    source, faces = np.unique(fine.faces[haired], return_inverse=True)
    faces = faces.reshape(-1, 4)
    thick = np.interp(density, [0, 1], UNDERCOAT_M)[:, None].astype(np.float32)
    above = fine.vertices + vertex_normals(fine.vertices, fine.faces) * thick
    uv = np.stack([density, np.full_like(density, 0.5)], axis=-1)[source][faces]
    piece = (above[source], faces, fine.units[:, source])
    return _part("undercoat", ("undercoat",), [piece], uv, subdivision=1)


def build_head(
    preset: Preset, regions: tuple[Region, ...], read_image: ImageReader, package: HeadPackage | None = None
) -> Head:
    """The head of a preset. `read_image` turns a path into an array (H, W[, C]) of 0..1, top row first."""
    package = package or HeadPackage()
    person = shape(package, preset)
    bust = cut_bust(person.base)
    # The bust stands on the ground, its neck over the origin.
    neck = person.vertices[person.base.vertices_of("joint-neck")].mean(axis=0)
    stand = np.float32([0, neck[1], person.vertices[bust.source, 2].min()])
    person.vertices[:] -= stand
    base_skin = person.base.vertices[bust.source]
    person.vertices[bust.source] += lips.seal(person.vertices[bust.source], base_skin, bust.faces)
    rng = np.random.default_rng(zlib.crc32(preset.id.encode()))  # the same head every time

    skin = person.vertices[bust.source] + round_edge(bust, person.base)
    subdivide = Subdivision(bust.faces, len(skin))
    fine = refine(person, bust, skin, subdivide)
    balls = globes(person)
    landmarks = {"eye_left": balls["l"][0], "eye_right": balls["r"][0], "neck": neck - stand}
    landmarks["eyes"] = (landmarks["eye_left"] + landmarks["eye_right"]) / 2
    for name, place in LANDMARKS.items():
        landmarks[name] = skin[np.linalg.norm(base_skin - np.float32(place), axis=1).argmin()]

    weights = region_weights(regions, package, person.base, bust, read_image)
    base_eyes = (person.base_eye("l") + person.base_eye("r")) / 2
    ears = weights.get("ears", np.zeros(len(skin), np.float32))
    scalp = hair.scalp_mask(preset.hair, base_skin, ears, base_eyes)
    density = subdivide(scalp[:, None].astype(np.float32))[:, 0]
    skin_moves = person.units[:, bust.source]
    parts = (
        _part("skin", SKIN_SLOTS, [(skin, bust.faces, skin_moves)], bust.uv, bust.material, subdivision=2),
        _eyes(person, balls),
        _tears(balls, fine),
        _teeth(person),
        _tongue(person),
        _lashes(person, preset.lash_radius_mm, rng),
        _brows(person, preset, fine, rng),
        _undercoat(fine, density),
    )
    strands_ = hair.grow(preset.hair, density, fine.vertices, fine.faces, landmarks["eyes"], rng)
    return Head(parts, strands_, weights, landmarks, preset.id, LICENCE)
