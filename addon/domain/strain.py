"""Strain of a face that its shape keys move, compressed into few maps: where blood goes, where skin folds.

Of all keys of a face (68 on the example head) a few components are kept: a map each, and for every key and half of the
face the coefficient by which its value drives the map there. Coefficients are fitted to the exact strain of single keys,
action units and emotions, so that keys may simply add up; docs/strain.md has what that leaves out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sanguine_core

from .facs import ACTION_UNITS, DEFAULT_EMOTIONS, EMOTION_CONTROLS, shape_key_values

COMPONENTS = 8
"""Maps kept of each kind, four to an image. docs/strain.md has the error for other numbers."""

# What a change of area does to the blood of the skin, as changes of the logarithm of hemoglobin.
#
# Directions: stretched skin loses blood flow and regains more than it had when it is let go (Goding et al. 1988,
# tissue expanders in pigs); what presses on skin drives its blood out (Lim et al. 2011, J. Biomed. Opt. 16:011012;
# Popov et al. 2017, J. Biomed. Opt. 22:110504, in steps, bed by bed). No source gives the amount by strain on a face:
# all numbers are guesses.
STRETCH_PER_LOG_AREA = 1.0  # loss: that of blood which stays in its patch of skin
POOL_PER_LOG_AREA = 1.2  # gain, while skin gets denser in its plane
FOLD_FROM_LOG_AREA = -0.15  # from here on it folds, and folds press their own skin: the nasolabial fold of a smile,
FOLD_PER_LOG_AREA = 1.8  # the brow of a frown; loss
LOW, HIGH = -0.5, -POOL_PER_LOG_AREA * FOLD_FROM_LOG_AREA
"""The range of the change: blood left at 0.61 of what it was, or risen to 1.20 times."""

_MOST_LOG_AREA = 0.65  # beyond this, either way, blood_change has reached its end: components need not follow

# Strain of less is taken up in the plane of the skin, which is under tension at rest: a guess.
WRINKLE_FROM_STRAIN = 0.06

HALF_BLEND_MM = 8.0

_SMOOTHING = 2  # rounds over the neighbours: strain is constant on a triangle, skin is not
# A sculptor crowds into one row of faces what skin, sliding on the muscle, spreads: furrows reach farther than that.
_FOLD_SMOOTHING = 4
_FACTORED_VERTICES = 4000
# What counts when components are chosen, per row: emotions above action units above single keys.
_DEFAULT_EMOTION_WEIGHT, _EMOTION_WEIGHT, _UNIT_WEIGHT, _KEY_WEIGHT = 4.5, 3.0, 1.0, 0.3


@dataclass(frozen=True)
class ShapeKeys:
    """What each shape key moves. names: K of them. delta_mm: (K, V, 3) float32 at value 1, relative to the basis."""

    names: tuple[str, ...]
    delta_mm: np.ndarray


@dataclass(frozen=True)
class Components:
    """values: (C, V) float32, a map per component. coefficients: (2, C, K), how far each key's value drives it on the
    left half of the face and on the right one."""

    values: np.ndarray
    coefficients: np.ndarray

    def drive(self, key_values: np.ndarray) -> np.ndarray:
        """(..., K) values of the keys -> (..., 2, C), what drives the components in each half."""
        return np.einsum("...k,sck->...sc", key_values, self.coefficients)

    def at(self, key_values: np.ndarray, halves: np.ndarray) -> np.ndarray:
        """(..., K) -> (..., V): the sum of the driven components, `halves` (2, V) being `halves_of` the vertices."""
        return np.einsum("...sc,sv,cv->...v", self.drive(key_values), halves, self.values)


@dataclass(frozen=True)
class Folds(Components):
    """Components of folding: compression across the folds. Folding is one-sided: what drives below 0 counts as 0.

    across: (C, V, 3) unit, the direction of compression in the surface, its sign without meaning."""

    across: np.ndarray

    def drive(self, key_values: np.ndarray) -> np.ndarray:
        return np.maximum(super().drive(key_values), 0.0)


def halves_of(position_mm: np.ndarray) -> np.ndarray:
    """(V, 3) -> (2, V): the share of the left half (x > 0) and of the right one; they pass over within HALF_BLEND_MM of
    the middle. shaders_osl/effects/strain.osl has the same formula."""
    left = np.clip(0.5 + position_mm[:, 0] / (2.0 * HALF_BLEND_MM), 0.0, 1.0)
    return np.stack([left, 1.0 - left])


@dataclass(frozen=True)
class MovingSurface:
    """A face with shape keys. position_mm: (V, 3) float32. triangles: (T, 3) int32 of vertices."""

    position_mm: np.ndarray
    triangles: np.ndarray
    keys: ShapeKeys

    @cached_property
    def strains(self) -> np.ndarray:
        """(K, W, 6) logarithmic strain per key and welded vertex: xx, yy, zz, xy, xz, yz."""
        return self._strain(self.keys.delta_mm)

    @cached_property
    def area_mm2(self) -> np.ndarray:
        """(W,) per welded vertex."""
        return sanguine_core.vertex_areas(*self.rest).astype(np.float64)

    def pose_strain(self, key_values: np.ndarray, measure: str = "log") -> np.ndarray:
        """(P, W, 6): the exact strain of poses (P, K), or (measure "linear") the sum of the keys' linear ones."""
        moves = np.einsum("pk,kvx->pvx", key_values, self.keys.delta_mm, optimize=False)
        return self._strain(moves.astype(np.float32), measure)

    @cached_property
    def halves(self) -> np.ndarray:
        """(2, W) `halves_of` the welded vertices."""
        return halves_of(self.rest[0])

    @cached_property
    def welded(self) -> np.ndarray:
        """(V,) index of the welded vertex: what lies and moves together is one vertex, as along UV seams of some files.

        Lips that touch at rest and part in some key stay two.
        """
        mark = np.random.default_rng(0).standard_normal(self.keys.delta_mm.shape[0] * 3)
        moves = np.moveaxis(self.keys.delta_mm, 0, 1).reshape(len(self.position_mm), -1)
        return np.unique(
            np.column_stack([self.position_mm, np.einsum("vk,k->v", moves, mark)]), axis=0, return_inverse=True
        )[1].reshape(-1)

    @cached_property
    def _first(self) -> np.ndarray:
        return np.unique(self.welded, return_index=True)[1]

    @cached_property
    def rest(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions (W, 3) in mm and triangles (T, 3) of the welded vertices."""
        return np.ascontiguousarray(self.position_mm[self._first]), self.welded[self.triangles].astype(np.int32)

    def _strain(self, moves: np.ndarray, measure: str = "log") -> np.ndarray:
        raw = sanguine_core.surface_strain(*self.rest, np.ascontiguousarray(moves[:, self._first]), measure)
        return self.smooth(np.moveaxis(raw, 0, 1).reshape(len(self._first), -1), _SMOOTHING).reshape(
            len(self._first), -1, 6
        ).swapaxes(0, 1)

    def smooth(self, values: np.ndarray, rounds: int) -> np.ndarray:
        """(W, C) -> (W, C): each vertex half itself, half the mean of its neighbours, again and again."""
        start, end, first, count = self._edges
        for _ in range(rounds):
            around = np.zeros_like(values)
            if len(start):
                around[start[first]] = np.add.reduceat(values[end], first, axis=0) / count[:, None]
            alone = np.ones(len(values), dtype=bool)
            alone[start[first]] = False
            values = np.where(alone[:, None], values, 0.5 * values + 0.5 * around)
        return values

    @cached_property
    def _edges(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Start and end of every edge in both directions, by start; where each start begins, and how many it has."""
        t = self.rest[1]
        sides = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
        both = np.unique(np.concatenate([sides, sides[:, ::-1]]), axis=0)
        both = both[both[:, 0] != both[:, 1]]
        first = np.nonzero(np.diff(both[:, 0], prepend=-1))[0]
        return both[:, 0], both[:, 1], first, np.diff(first, append=len(both))

    @cached_property
    def area(self) -> Components:
        """The logarithm of the change of area, in COMPONENTS maps per vertex of the mesh."""
        return Components(self.welded_area.values[:, self.welded], self.welded_area.coefficients)

    @cached_property
    def welded_area(self) -> Components:
        return area_components(self, COMPONENTS)

    @cached_property
    def welded_folds(self) -> Folds:
        """Patterns of folding, COMPONENTS of them, per welded vertex."""
        return fold_components(self, COMPONENTS)


def log_area(strain: np.ndarray) -> np.ndarray:
    """(..., 6) -> (...): logarithm of the ratio of areas."""
    return strain[..., 0] + strain[..., 1] + strain[..., 2]


def compression(strain: np.ndarray) -> np.ndarray:
    """(..., 6) -> (...): the strongest compression, 0 or more."""
    xx, yy, zz, xy, xz, yz = np.moveaxis(strain.astype(np.float64), -1, 0)
    # The normal has the eigenvalue 0, so the other two have this sum and this product.
    half = 0.5 * (xx + yy + zz)
    product = xx * yy + yy * zz + zz * xx - xy**2 - xz**2 - yz**2
    return np.maximum(np.sqrt(np.maximum(half**2 - product, 0.0)) - half, 0.0)


def compression_across(strain: np.ndarray) -> np.ndarray:
    """(..., 6) -> (..., 3): the unit direction of the strongest compression."""
    xx, yy, zz, xy, xz, yz = np.moveaxis(strain.astype(np.float64), -1, 0)
    tensor = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=-1).reshape(*xx.shape, 3, 3)
    return np.linalg.eigh(tensor)[1][..., 0]


def folding(surface: MovingSurface, strain: np.ndarray) -> np.ndarray:
    """(P, W, 6) -> (P, W): compression that has to go into folds, 0 or more."""
    return surface.smooth(np.maximum(compression(strain) - WRINKLE_FROM_STRAIN, 0.0).T, _FOLD_SMOOTHING).T


def blood_change(log_area: np.ndarray) -> np.ndarray:
    """The change of the logarithm of hemoglobin, LOW to HIGH, where the area changes so. shaders_osl/effects/strain.osl
    is the same formula."""
    less = np.maximum(-log_area, 0.0)
    fold = np.maximum(less + FOLD_FROM_LOG_AREA, 0.0)
    change = POOL_PER_LOG_AREA * (less - fold) - FOLD_PER_LOG_AREA * fold
    return np.maximum(change - STRETCH_PER_LOG_AREA * np.maximum(log_area, 0.0), LOW)


def poses(names: Sequence[str], controls: Sequence[Mapping[str, float]]) -> np.ndarray:
    """(P, K): the keys' values for settings of emotions and action units; keys they do not know stay at 0."""
    rows = [shape_key_values(setting) for setting in controls]
    return np.array([[row.get(name, 0.0) for name in names] for row in rows]).reshape(len(controls), len(names))


def _on_both_sides(names: Sequence[str], rows: np.ndarray) -> np.ndarray:
    """Poses (P, K) with each key as high as its twin on the other side."""
    place = {name: i for i, name in enumerate(names)}
    twins = [
        place.get(name.replace("Left", "*").replace("Right", "Left").replace("*", "Right"), i)
        for i, name in enumerate(names)
    ]
    return np.maximum(rows, rows[:, twins])


def _asked_for(names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Poses (P, K) that the components have to serve, and how much each counts (P,)."""
    # Patterns are found on the whole face and driven by halves: one-sided poses would split them.
    emotions = _on_both_sides(names, poses(names, [{name: 1.0} for name in EMOTION_CONTROLS]))
    units = poses(names, [{control: 1.0} for u in ACTION_UNITS.values() if u.keys and not u.one_sided for control in u.whole])
    weight = [_DEFAULT_EMOTION_WEIGHT if name in DEFAULT_EMOTIONS else _EMOTION_WEIGHT for name in EMOTION_CONTROLS]
    weights = (weight, np.full(len(units), _UNIT_WEIGHT), np.full(len(names), _KEY_WEIGHT))
    return np.concatenate((emotions, units, np.eye(len(names)))), np.concatenate(weights)


# Sums run through einsum, not through BLAS: the same bytes for any number of threads.
def _dot(subscripts: str, *operands: np.ndarray) -> np.ndarray:
    return np.einsum(subscripts, *operands, optimize=False)


def area_components(surface: MovingSurface, count: int) -> Components:
    """The best `count` components of the change of area, by area and over the poses a face is asked for: a singular
    value decomposition, turned (varimax) so that each component moves with few keys."""
    asked, weight = _asked_for(surface.keys.names)
    root = np.sqrt(surface.area_mm2)
    exact = np.clip(log_area(surface.pose_strain(asked)), -_MOST_LOG_AREA, _MOST_LOG_AREA) * root
    rows = weight[:, None] * exact
    power, left = np.linalg.eigh(_dot("pv,qv->pq", rows, rows))
    order = np.argsort(power)[::-1][:count]
    order = order[power[order] > 1e-12 * max(power.max(initial=0.0), 1e-300)]
    basis = _dot("pc,pv->cv", left[:, order] / np.sqrt(power[order]), rows)
    basis = _varimax(_dot("pv,cv->pc", rows[-len(surface.keys.names) :], basis)).T @ basis
    # Maps of a size that suits a texture: each component's largest change is 1.
    values = np.divide(basis, root, out=np.zeros_like(basis), where=root > 0.0)
    size = np.abs(values).max(axis=1, initial=1e-300, keepdims=True)
    values, basis = values / size, basis / size
    halved = _halved(basis, surface.halves)
    square = _dot("av,bv->ab", halved, halved)
    square += 1e-6 * np.trace(square) / max(len(square), 1) * np.eye(len(square))  # a component may miss one half
    weighted = weight[:, None] * asked
    right = np.linalg.solve(square, _dot("ap,pk->ak", _dot("av,pv->ap", halved, rows), weighted))
    coefficients = np.linalg.solve(_dot("pk,pl->kl", weighted, weighted), right.T).T
    coefficients = coefficients.reshape(2, len(basis), len(surface.keys.names))
    return Components(_padded(values, 0, count).astype(np.float32), _rounded(_padded(coefficients, 1, count)))


def _halved(basis: np.ndarray, halves: np.ndarray) -> np.ndarray:
    """(C, V) -> (2 C, V): each component in the left half, then each in the right one."""
    return (halves[:, None] * basis).reshape(-1, basis.shape[1])


def _rounded(coefficients: np.ndarray) -> np.ndarray:
    """Without the last digits, which differ between numbers of threads of LAPACK."""
    return np.round(coefficients, 6) + 0.0


def _padded(values: np.ndarray, axis: int, count: int) -> np.ndarray:
    width = [(0, count - values.shape[axis] if i == axis else 0) for i in range(values.ndim)]
    return np.pad(values, width)


def _varimax(loadings: np.ndarray, rounds: int = 60) -> np.ndarray:
    """The rotation (C, C) that makes the loadings (K, C) sparse (Kaiser 1958), by plane rotations."""
    count = loadings.shape[1]
    turn, turned = np.eye(count), loadings.copy()
    for _ in range(rounds):
        largest = 0.0
        for a in range(count):
            for b in range(a + 1, count):
                u = turned[:, a] ** 2 - turned[:, b] ** 2
                v = 2.0 * turned[:, a] * turned[:, b]
                rows = max(len(u), 1)
                top = 2.0 * (u @ v - u.sum() * v.sum() / rows)
                bottom = (u**2 - v**2).sum() - (u.sum() ** 2 - v.sum() ** 2) / rows
                angle = 0.25 * np.arctan2(top, bottom)
                largest = max(largest, abs(angle))
                c, s = np.cos(angle), np.sin(angle)
                plane = np.array([[c, -s], [s, c]])
                turned[:, [a, b]] = turned[:, [a, b]] @ plane
                turn[:, [a, b]] = turn[:, [a, b]] @ plane
        if largest < 1e-6:
            break
    return turn


def fold_components(surface: MovingSurface, count: int, rounds: int = 150) -> Folds:
    """`count` patterns of folding. Folding is one-sided, so the factors are non-negative (Lee & Seung 2001, weighted by
    area). A key that stretches across a pattern's folds takes them back."""
    asked, weight = _asked_for(surface.keys.names)
    root = np.sqrt(surface.area_mm2)
    pressed = folding(surface, surface.pose_strain(asked)) * root
    rows = weight[:, None] * pressed
    basis = _non_negative(rows, count, rounds)
    halved = _halved(basis, surface.halves)
    alone = pressed[-len(surface.keys.names) :]
    coefficients = _non_negative_keys(weight[:, None] * asked, rows, alone, halved, rounds)
    coefficients = coefficients.reshape(2, len(basis), len(surface.keys.names))
    # At 1 a pattern is as deep as a whole emotion or action unit makes it, whichever makes it deepest.
    deepest = _dot("pk,sck->psc", asked, coefficients).max(axis=(0, 1), initial=0.0)
    size = np.where(deepest > 1e-6, deepest, 1.0)
    coefficients /= size[:, None]
    values = np.divide(basis * size[:, None], root, out=np.zeros_like(basis), where=root > 0.0)
    across = np.zeros((len(values), values.shape[1], 3))
    for c in range(len(values)):
        mean = _dot("k,kvx->vx", coefficients[:, c].sum(axis=0), surface.strains)
        d = across[c] = compression_across(surface.smooth(mean, 2 * _SMOOTHING))
        # How far each key stretches across these folds, as a share of how far the pattern compresses.
        square = np.stack(
            [d[:, 0] ** 2, d[:, 1] ** 2, d[:, 2] ** 2,
             2 * d[:, 0] * d[:, 1], 2 * d[:, 0] * d[:, 2], 2 * d[:, 1] * d[:, 2]], axis=1
        )
        matter = surface.halves * values[c] * surface.area_mm2
        total = np.maximum(_dot("sv,v->s", matter, values[c]), 1e-9)
        stretch = _dot("kvx,vx,sv->sk", surface.strains, square, matter) / total[:, None]
        coefficients[:, c] = np.where(stretch > coefficients[:, c], -np.minimum(stretch, 1.0), coefficients[:, c])
    across = _padded(across, 0, count).astype(np.float32)
    return Folds(_padded(values, 0, count).astype(np.float32), _rounded(_padded(coefficients, 1, count)), across)


def _non_negative(rows: np.ndarray, count: int, rounds: int) -> np.ndarray:
    """The right factor (at most count, V) of rows (P, V) as a product of two non-negative ones, from a start by
    singular vectors."""
    power, vectors = np.linalg.eigh(_dot("pv,qv->pq", rows, rows))
    order = np.argsort(power)[::-1][:count]
    # What is no larger than a hundredth of the strongest would only split a pattern that is there into parts.
    order = order[power[order] > 1e-4 * max(power.max(initial=0.0), 1e-12)]
    left = np.zeros((len(rows), len(order)))
    for c, i in enumerate(order):
        u = vectors[:, i]
        up, down = np.maximum(u, 0.0), np.maximum(-u, 0.0)
        left[:, c] = up if (up**2).sum() >= (down**2).sum() else down
    left += 1e-3
    few = rows[:, :: max(1, rows.shape[1] // _FACTORED_VERTICES)]  # every so many vertices of a dense mesh tell enough
    right = _dot("pc,pv->cv", left, few)
    for _ in range(rounds):
        right *= _dot("pc,pv->cv", left, few) / np.maximum(_dot("cd,dv->cv", left.T @ left, right), 1e-12)
        left *= _dot("pv,cv->pc", few, right) / np.maximum(left @ _dot("cv,dv->cd", right, right), 1e-12)
        scale = np.maximum(np.sqrt(_dot("cv,cv->c", right, right)), 1e-12)
        right /= scale[:, None]
        left *= scale
    wanted, square = _dot("pc,pv->cv", left, rows), left.T @ left
    right = wanted / max(float(np.trace(square)), 1e-12)
    for _ in range(rounds):
        right *= wanted / np.maximum(_dot("cd,dv->cv", square, right), 1e-12)
    return right


def _non_negative_keys(
    poses: np.ndarray, rows: np.ndarray, alone: np.ndarray, basis: np.ndarray, rounds: int
) -> np.ndarray:
    """(A, K) >= 0 by which keys drive the basis (A, V): least squares of poses (P, K) times it against rows (P, V).

    alone: (K, V) what each key does by itself; where that is next to nothing (3 % of where it does most) a key drives
    nothing: half a smile does not fold the other cheek because smiles mostly come whole.
    """
    among, among_keys = _dot("av,bv->ab", basis, basis), _dot("pk,pl->kl", poses, poses)
    wanted = np.maximum(_dot("ap,pk->ak", _dot("av,pv->ap", basis, rows), poses), 0.0)
    own = _dot("av,kv->ak", basis, alone)
    found = own / np.maximum(np.diag(among), 1e-12)[:, None]
    found[own < 3e-2 * own.max(axis=0, initial=0.0)] = 0.0
    for _ in range(4 * rounds):
        found *= wanted / np.maximum(among @ found @ among_keys, 1e-12)
    return found
