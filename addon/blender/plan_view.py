"""What the panel shows of a plan: each effect with its reason and its cost. Cheap enough for a redraw: what takes longer
than a look at the sliders is kept until something it depends on has changed."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any

import bpy

from ..app.costs import EffectCost, effect_costs, entry_ms, map_costs
from ..domain.errors import InputError
from ..domain.parameters import PARAMETERS
from ..domain.plan import Plan
from ..domain.shading import AUTO
from ..domain.texel_density import map_sizes, mm_per_uv
from .material import MARK
from .properties import images_of, is_its_own, slider_of
from .skin import our_slot
from .surface import pixel_mm, read_surface

_KEPT = 8
_kept: OrderedDict[Hashable, Any] = OrderedDict()


def _once(key: Hashable, make: Callable[[], Any]) -> Any:
    """What `make` gave for this key the last time; of the few that were asked for last."""
    if key not in _kept:
        _kept[key] = make()
        if len(_kept) > 2 * _KEPT:
            _kept.popitem(last=False)
    _kept.move_to_end(key)
    return _kept[key]


@dataclass(frozen=True)
class PlanView:
    """costs: of the active effects. milliseconds: of the whole table, on one core. megabytes: of all maps, each counted
    once; None without a UV map."""

    costs: dict[str, EffectCost]
    milliseconds: float
    megabytes: float | None


def plan_view(face: bpy.types.Object, scene: bpy.types.Scene, plan: Plan) -> PlanView:
    layout = _once(("layout", *_shape_of(face, scene)), lambda: _layout(face))
    seen = pixel_mm(scene, face)
    sizes = map_sizes(layout[0], seen, plan.settings) if layout else None
    given = tuple((name, *image.size, image.is_float) for name, image in images_of(face).items())

    def make() -> PlanView:
        # Pictures of bytes take four a texel.
        megabytes = {name: width * height * (16 if floats else 4) / 1e6 for name, width, height, floats in given}
        if sizes is not None:
            megabytes |= {name: cost.megabytes for name, cost in map_costs(plan, sizes, layout[1]).items()}
        total = sum(megabytes.get(name, 0.0) for name in plan.maps) if sizes is not None else None
        return PlanView(effect_costs(plan, megabytes), plan.entries * entry_ms(plan.settings.lobes), total)

    return _once(("view", plan.fingerprint, sizes, layout, given), make)


def _shape_of(face: bpy.types.Object, scene: bpy.types.Scene) -> tuple:
    """Changes with the layout of the maps, but not with each stroke of a brush: sizes of the face in steps of 5 %."""
    mesh = face.data
    layer = next((each.name for each in mesh.uv_layers if each.active_render), None)
    steps = tuple(round(20.0 * math.log(side)) if side > 0.0 else None for side in face.dimensions)
    return mesh.session_uid, layer, len(mesh.vertices), len(mesh.loops), steps, scene.unit_settings.scale_length


def _layout(face: bpy.types.Object) -> tuple[float, int] | None:
    """Millimetres that a UV tile spans and how many tiles there are; None without a UV map."""
    try:
        surface = read_surface(face)
    except InputError:
        return None
    return mm_per_uv(surface.position_mm, surface.uv, surface.triangles, surface.corner_vertex), len(surface.tiles)


def changed_since(face: bpy.types.Object, plan: Plan) -> bool:
    """Whether the face's material was made from something else than `plan`, or of other nodes than are asked for. Of one
    that does not say: no."""
    slot = our_slot(face)
    if slot is None:
        return False
    held = face.material_slots[slot]
    mark, wanted = held.material[MARK], face.sanguine.shading
    if mark.get("fingerprint", plan.fingerprint) != plan.fingerprint:
        return True
    return wanted != AUTO and mark.get("shading", wanted) != wanted or not is_its_own(face, held) and _differs(face, held.material, plan)


def _differs(face: bpy.types.Object, material: bpy.types.Material, plan: Plan) -> bool:
    """Whether the material's sliders are not where the face's are."""
    rows = [PARAMETERS[name] for name in plan.sliders]
    sliders = {row.id: slider_of(material, row.label) for row in rows}
    return any(slider is not None and slider.default_value != getattr(face.sanguine, name) for name, slider in sliders.items())
