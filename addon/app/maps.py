"""Maps of a face: where blood may move, how the skin differs by anatomy, and what grows on it.

Only what a plan asks for is made, at the size asked for, for the UV tiles that the face has; and of that only what no
cache holds: a layer is kept by the face, the feature and the person, so a change of one strength paints nothing anew.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property

import numpy as np
import sanguine_core

from ..domain import strain, wrinkles
from ..domain.blood import ANATOMY, Rest
from ..domain.effects import Growth, anatomy, grown
from ..domain.effects import strain as strain_effect
from ..domain.effects import wrinkles as wrinkles_effect
from ..domain.effects.regions import region_images
from ..domain.errors import InputError
from ..domain.plan import Plan, make_plan
from ..domain.slopes import TexelAxes, texel_axes
from ..domain.texel_density import MapSizes
from ..domain.udim import FIRST_TILE, tile_offset, tiles_of
from .map_cache import MapCache, key_of

# Texels that repeat a UV island's edge outward, so that filtering never meets the background.
_PADDING = 16

# Texels along a side beyond which furrows some millimetres apart gain nothing.
LARGEST_WRINKLES = 2048

Progress = Callable[[int, int], bool]


@dataclass(frozen=True)
class Surface:
    """A face as the maps need it.

    position_mm: (V, 3) float32, of the neutral face. uv: (L, 2) float32 per face corner. triangles: (T, 3) int32 into
    corners. corner_vertex: (L,) int32. regions: region id -> (V,) float32 mask, 0-1, in the order of the vertices.
    keys: what its shape keys move, if it has any.
    """

    position_mm: np.ndarray
    uv: np.ndarray
    triangles: np.ndarray
    corner_vertex: np.ndarray
    regions: Mapping[str, np.ndarray]
    keys: strain.ShapeKeys | None = None

    @cached_property
    def moving(self) -> strain.MovingSurface:
        """The face as its shape keys move it. Raises InputError when it has none."""
        if self.keys is None or not self.keys.names:
            raise InputError("the face has no shape keys, from which strain and wrinkles come: switch these effects off")
        triangles = np.ascontiguousarray(self.corner_vertex[self.triangles], dtype=np.int32)
        return strain.MovingSurface(self.position_mm, triangles, self.keys)

    @cached_property
    def furrows(self) -> tuple[np.ndarray, np.ndarray]:
        """Depth in mm and phase of the furrows of every fold pattern, each (C, V)."""
        return wrinkles.furrow_fields(self.moving, self.regions)

    @cached_property
    def motion_digest(self) -> str:
        """`digest` and the shape keys."""
        return key_of(self.digest, list(self.moving.keys.names), self.moving.keys.delta_mm)

    @cached_property
    def region_weights(self) -> np.ndarray:
        """(V, R) float32, columns in the order of `regions`."""
        columns = [np.asarray(mask, dtype=np.float32) for mask in self.regions.values()]
        return np.stack(columns, axis=1) if columns else np.zeros((len(self.position_mm), 0), dtype=np.float32)

    @cached_property
    def native(self) -> sanguine_core.SkinSurface:
        """The face as the core walks on it."""
        return sanguine_core.SkinSurface(
            self.position_mm, self.uv, self.triangles, self.corner_vertex, list(self.regions), self.region_weights
        )

    @cached_property
    def digest(self) -> str:
        return key_of(
            self.position_mm, self.uv, self.triangles, self.corner_vertex, list(self.regions), self.region_weights
        )

    @cached_property
    def tiles(self) -> tuple[int, ...]:
        """Numbers of the UDIM tiles that the layout uses, (1001,) for an ordinary one."""
        return tiles_of(self.uv[self.triangles])

    def at_tile(self, tile: int) -> Surface:
        """The same face with `tile` moved into the unit square."""
        if tile == FIRST_TILE:
            return self
        offset = np.array(tile_offset(tile), dtype=np.float32)
        return replace(self, uv=self.uv - offset)


class Grown:
    """Layers of features on one UV tile of a face; what no cache holds is grown and painted when asked for."""

    def __init__(self, surface: Surface, growth: Growth, size: int, cache: MapCache, progress: Progress | None = None):
        self.surface, self.growth, self.size, self.cache, self.progress = surface, growth, size, cache, progress
        self.key = key_of(surface.digest, asdict(growth), size, _PADDING)
        self._layers: dict[str, np.ndarray] = {}  # a feature may write to several maps
        self._furrows: dict[int, tuple[np.ndarray, np.ndarray]] = {}  # of the last image: both axes want them

    @cached_property
    def texel(self) -> np.ndarray:
        """(N,) uint32: row * size + column of the texels that the layers have values for."""
        return self.cache.get(key_of(self.key, "texel"), lambda: np.asarray(self.places.texel))

    @cached_property
    def places(self) -> sanguine_core.TexelMap:
        """What the texels show."""
        return self.surface.native.texels(self.size, self.size, _PADDING)

    @cached_property
    def axes(self) -> TexelAxes:
        face = self.surface
        return texel_axes(face.position_mm, face.uv, face.triangles, face.corner_vertex, self.size, _PADDING)

    @cached_property
    def for_wrinkles(self) -> Grown:
        """The same at the size of wrinkles."""
        if self.size <= LARGEST_WRINKLES:
            return self
        return Grown(self.surface, self.growth, LARGEST_WRINKLES, self.cache)

    def furrows(self, image: int) -> tuple[np.ndarray, np.ndarray]:
        """Heights in mm of four fold patterns and how many times steeper each gets, (size, size, 4); beyond the edge of a UV
        island those of the skin there, for the slopes at the edge."""
        if image not in self._furrows:
            face, shown = self.surface, self.places
            vertex, share = face.corner_vertex[face.triangles[shown.triangle]], np.asarray(shown.barycentric)
            fields = (*face.furrows, wrinkles.steepening(face.moving))
            heights, steeper = (np.zeros((self.size * self.size, 4), dtype=np.float32) for _ in range(2))
            for i in range(4):
                depth, phase, factor = ((field[4 * image + i][vertex] * share).sum(axis=1) for field in fields)
                at = depth > 0.0
                heights[shown.texel[at], i] = wrinkles.furrow_height_mm(
                    depth[at], phase[at], shown.place_mm[at], seed=4 * image + i
                )
                steeper[shown.texel, i] = factor
            form = (self.size, self.size, 4)
            self._furrows = {image: (heights.reshape(form), steeper.reshape(form))}
        return self._furrows[image]

    def layer(self, feature: str, progress: Progress | None = None) -> np.ndarray:
        """(N, C) float16, channels in the order of the feature's row. Half is what the material's maps hold too."""

        def paint() -> np.ndarray:
            growth = self.growth
            return sanguine_core.grow(
                feature, self.surface.native, self.places, growth.seed, growth.age_years, growth.sun, growth.masculinity,
                progress=progress,
            ).astype(np.float16)

        if feature not in self._layers:
            self._layers[feature] = self.cache.get(key_of(self.key, feature), paint)
        return self._layers[feature]

    def _part(self, done: int, total: int) -> Progress | None:
        """The progress of one feature as part of all, in thousandths; asked before each, however quick it is."""
        if self.progress is None:
            return None

        def part(texels: int, of: int) -> bool:
            return self.progress(1000 * done + 1000 * texels // max(of, 1), 1000 * total)

        if not part(0, 1):
            raise sanguine_core.Cancelled("cancelled")
        return part

    def compose(self, strengths: Mapping[str, float], channels: tuple[str, ...]) -> np.ndarray:
        """(size, size, C) float32: the sum of strength x layer; 0 where there is no skin."""
        total = np.zeros((len(self.texel), len(channels)), dtype=np.float32)
        held_by = {row["id"]: [change["channel"] for change in row["changes"]] for row in sanguine_core.features()}
        wanted = [name for name, held in held_by.items() if strengths.get(name, 0.0) > 0.0 and set(held) & set(channels)]
        for done, name in enumerate(wanted):
            layer = self.layer(name, self._part(done, len(wanted)))
            held = held_by[name]
            for i, channel in enumerate(held):
                if channel in channels:
                    total[:, channels.index(channel)] += np.float32(strengths[name]) * layer[:, i]
        image = np.zeros((self.size * self.size, len(channels)), dtype=np.float32)
        image[self.texel] = total
        return image.reshape(self.size, self.size, len(channels))


def bake_maps(
    plan: Plan,
    surface: Surface,
    sizes: MapSizes,
    cache: MapCache | None = None,
    progress: Progress | None = None,
    names: Sequence[str] | None = None,
) -> dict[str, dict[int, np.ndarray]]:
    """The maps that a plan makes from the face itself, alike on both sides of its UV seams; nothing unasked for.

    names: those that are wanted, `plan.maps` if left out; heights have a name too (`grown.height_of`). Returns map id ->
    UDIM tile -> square (H, W, 1, 3 or 4) float32, row 0 lowest. Raises Cancelled when `progress`, called with what is done
    and what there is to do, answers False.
    """
    cache = cache or MapCache()
    made: dict[str, dict[int, np.ndarray]] = {}
    for tile in surface.tiles if plan.maps else ():
        layers = Grown(surface.at_tile(tile), plan.scene.growth, sizes.detail, cache, progress)
        for name in plan.maps if names is None else names:
            if (image := _bake(name, plan, layers, sizes.smooth)) is not None:
                made.setdefault(name, {})[tile] = image
    for name, images in made.items():
        if not _is_slope(name):  # whose numbers differ on the sides of a seam as the axes do
            hide_seams(surface, images, cache)
    return made


def _is_slope(name: str) -> bool:
    return grown.height_of(name) is not None or name in wrinkles_effect.IMAGES


def hide_seams(surface: Surface, images: Mapping[int, np.ndarray], cache: MapCache) -> None:
    """Changes the texels of one map that look-ups on UV seams read until both sides are read alike, in place.

    images: UDIM tile -> square (H, W, C) float32, of every tile of the face. A value that is exactly right at each texel
    is not enough: where it changes within the width of a texel, look-ups between two grids of texels differ.
    """
    size = next(iter(images.values())).shape[0]

    @functools.cache
    def seams() -> sanguine_core.SeamTexels:
        return sanguine_core.SeamTexels(surface.native, size, size, [tile_offset(tile) for tile in images])

    key = key_of(surface.digest, "seams", size, list(images))
    where = cache.get(key, lambda: np.stack([seams().tile, seams().texel], axis=1))
    texels = [where[where[:, 0] == i, 1] for i in range(len(images))]
    flat = [image.reshape(size * size, -1) for image in images.values()]
    read = np.concatenate([values[texel] for values, texel in zip(flat, texels, strict=True)])
    alike = cache.get(key_of(key, read), lambda: seams().equalize(read))
    for i, (values, texel) in enumerate(zip(flat, texels, strict=True)):
        values[texel] = alike[where[:, 0] == i]


def reached(plan: Plan, images: Mapping[str, np.ndarray | Mapping[int, np.ndarray]]) -> Plan:
    """The plan once its features are painted: its table goes as far as their sums do, not as far as they might."""
    found = {}
    for name in [name for name in images if grown.channels_of(name)]:
        tiles = list(images[name].values()) if isinstance(images[name], Mapping) else [images[name]]
        found[name] = {
            channel: (min(float(tile[..., i].min()) for tile in tiles), max(float(tile[..., i].max()) for tile in tiles))
            for i, channel in enumerate(grown.channels_of(name))
        }
    return make_plan(replace(plan.scene, maps={**plan.scene.maps, **found}), plan.settings) if found else plan


def _bake(name: str, plan: Plan, layers: Grown, size: int) -> np.ndarray | None:
    face, cache = layers.surface, layers.cache
    images = region_images(tuple(face.regions))
    if name in images:
        return cache.get(key_of(face.digest, name, size, _PADDING), lambda: _masks(face, size, images[name]))
    if name == anatomy.MAP:
        rest = {region: asdict(ANATOMY[region]) for region in face.regions if region in ANATOMY}
        return cache.get(key_of(face.digest, name, size, _PADDING, rest), lambda: _anatomy(face, size))
    if (height := grown.height_of(name)) is not None:
        key = key_of(layers.key, name, _strengths(height, plan))
        return cache.get(key, lambda: _slopes(layers, _bake(height, plan, layers, size)))
    if (channels := grown.channels_of(name)) is not None:
        strengths = _strengths(name, plan)
        return cache.get(key_of(layers.key, name, strengths), lambda: layers.compose(strengths, channels))
    if name in strain_effect.IMAGES:
        key = key_of(face.motion_digest, name, size, _PADDING)
        return cache.get(key, lambda: _strain(face, size, strain_effect.IMAGES.index(name)))
    if name in wrinkles_effect.IMAGES:
        layers = layers.for_wrinkles
        axis = next(axis for axis, images in enumerate(wrinkles_effect.SLOPES) if name in images)
        key = key_of(face.motion_digest, name, layers.size, _PADDING)
        return cache.get(key, lambda: _wrinkles(layers, wrinkles_effect.SLOPES[axis].index(name), axis))
    return None


def _strengths(name: str, plan: Plan) -> dict[str, float]:
    """How strong each feature is in a painted map."""
    if (feature := grown.feature_of(name)) is not None:
        return {feature: 1.0}
    return {row["id"]: plan.scene.strengths.get(row["id"], 0.0) for row in sanguine_core.features()}


def strain_coefficients(face: Surface, cache: MapCache | None = None) -> np.ndarray:
    """(2, C, K) by which keys drive the maps of strain in the left and the right half of the face."""
    key = key_of(face.motion_digest, "strain coefficients")
    return (cache or MapCache()).get(key, lambda: face.moving.area.coefficients)


def wrinkle_coefficients(face: Surface, cache: MapCache | None = None) -> np.ndarray:
    """(2, C, K) by which keys drive the maps of wrinkles, below 0 counting as 0."""
    key = key_of(face.motion_digest, "wrinkle coefficients")
    return (cache or MapCache()).get(key, lambda: face.moving.welded_folds.coefficients)


def _strain(face: Surface, size: int, image: int) -> np.ndarray:
    """Four components of the change of area, (size, size, 4)."""
    return _draw(face, size, face.moving.area.values[4 * image : 4 * image + 4].T, np.zeros(4, dtype=np.float32))


def _slopes(layers: Grown, height_mm: np.ndarray) -> np.ndarray:
    """Slopes of a map of heights (size, size, 1), along the tangent and the bitangent, and 0: (size, size, 3)."""
    slopes = [layers.axes.slopes(height_mm, axis) for axis in (0, 1)]
    return np.concatenate([*slopes, np.zeros_like(slopes[0])], axis=2)


def _wrinkles(layers: Grown, image: int, axis: int) -> np.ndarray:
    """Slopes of four fold patterns along the tangent (axis 0) or the bitangent (1), (size, size, 4)."""
    heights, steeper = layers.furrows(image)
    return steeper * layers.axes.slopes(heights, axis)


def _masks(face: Surface, size: int, regions: tuple[str, ...]) -> np.ndarray:
    """Masks of at most three regions, (size, size, 3)."""
    columns = np.zeros((len(face.position_mm), 3), dtype=np.float32)
    for i, region in enumerate(regions):
        columns[:, i] = face.regions[region]
    return _draw(face, size, columns, np.zeros(3, dtype=np.float32))


def _anatomy(face: Surface, size: int) -> np.ndarray:
    rest = [ANATOMY.get(region, Rest()) for region in face.regions]
    table = np.array([[r.hemoglobin - 1.0, r.melanin - 1.0, r.oil - 1.0, r.oxygenation] for r in rest], dtype=np.float32)
    neutral = np.array([1.0, 1.0, 1.0, 0.0], dtype=np.float32)
    return _draw(face, size, face.region_weights @ table + neutral, neutral)


def _draw(face: Surface, size: int, per_vertex: np.ndarray, neutral: np.ndarray) -> np.ndarray:
    values = np.ascontiguousarray(per_vertex[face.corner_vertex], dtype=np.float32)
    return sanguine_core.rasterize_uv(face.uv, face.triangles, values, size, size, _PADDING, neutral)
