"""`Object.sanguine`: the skin of a face, one Blender property per row of the schema, effect strength and map, and its quality."""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy

from ..domain.effects import EFFECTS, Growth, residual, skin_map
from ..domain.effects.effect import Interval
from ..domain.parameters import PARAMETERS
from ..domain.people import AGES, SEEDS, Person
from ..domain.plan import default_strengths
from ..domain.quality import BEST_DELTA_E, DEFAULT, PRESETS, WITHIN, Point, Settings, chosen_point
from ..domain.shading import AUTO, NODES, OSL
from . import headline
from .images import measure_range, stored_range
from .material import MARK
from .swatch import swatch_of


# Not animatable: keys would move the number in the panel, and nothing of the skin. What moves in a shot has sliders on the rig.
_KEPT = {"override": {"LIBRARY_OVERRIDABLE"}, "options": set()}


def _skin_properties() -> dict[str, object]:
    made = {}
    for row in PARAMETERS.values():
        unit = "a share of 1" if row.unit in ("", "1") else row.unit
        made[row.id] = bpy.props.FloatProperty(
            name=row.caption,
            description=f"{row.help}. {row.hard_min:g} to {row.hard_max:g}, in {unit}. Source: {row.source}",
            default=row.default,
            min=row.hard_min,
            max=row.hard_max,
            soft_min=row.soft_min,
            soft_max=row.soft_max,
            precision=3,
            step=1,
            update=_follower(row.label, row.id),
            **_KEPT,
        )
    for effect in EFFECTS:
        if effect.default_strength is not None:
            made[strength_property(effect.id)] = bpy.props.FloatProperty(
                name=effect.label, description=f"{effect.help.rstrip('.')}. Strength, 0 (costs nothing) to 1",
                default=effect.default_strength, min=0.0, max=1.0,
                update=_follower(effect.label, strength_property(effect.id)), **_KEPT,
            )
        if effect.switchable:
            made[switch_property(effect.id)] = bpy.props.BoolProperty(
                name=effect.label, description=f"{effect.help.rstrip('.')}. Off, it costs nothing; apply the skin to see it",
                default=True, **_KEPT,
            )
    made |= _growth_properties()
    channels = "red {}, green {}, blue {}, alpha {}".format(*skin_map.CHANNELS)
    for effect, more in ((skin_map.EFFECT, f" {channels.capitalize()}"), (residual.EFFECT, "")):
        made[effect.id] = bpy.props.PointerProperty(
            type=bpy.types.Image, name=effect.label, description=effect.help + more, override={"LIBRARY_OVERRIDABLE"}
        )
    made["quality"] = bpy.props.EnumProperty(
        name="Quality",
        description="How finely the skin is simulated: samples change at once, the rest when the skin is applied. Delta E 2000 "
        "against path-traced layered skin, 95 of 100 pixels within it, and seconds of one core (docs/accuracy_picture.md)",
        items=[
            *((name, name.capitalize(), f"{point.measured} (one core); {point.means}") for name, point in PRESETS.items()),
            (WITHIN, "Cheapest Within", "The cheapest of all measured settings whose error is within the Delta E that you give"),
        ],
        default=DEFAULT,
        update=_set_samples,
        override={"LIBRARY_OVERRIDABLE"},
    )
    # Rounded up, so that what a slider shows can be met.
    best = math.ceil(100.0 * BEST_DELTA_E) / 100.0
    made["delta_e"] = bpy.props.FloatProperty(
        name="Delta E",
        description=f"The largest error allowed: Delta E 2000 that 95 of 100 pixels are within, {best:g} (the best that was "
        "measured) or more; 1 is about the least that an eye can tell side by side",
        default=2.0, min=best, max=20.0, soft_max=5.0, precision=2, step=10, update=_set_samples,
        override={"LIBRARY_OVERRIDABLE"},
    )
    made["skin_colour"] = bpy.props.FloatVectorProperty(
        name="Skin Colour",
        description="The skin as the sliders stand, at rest, in diffuse daylight (D65), without highlights: linear, in the "
        "file's working space. To look at, or to copy: the sliders change it",
        # What cannot be set is drawn paler, which is another colour.
        subtype="COLOR", size=3, min=0.0, max=1.0, get=_skin_colour, set=lambda _settings, _value: None, options=set(),
    )
    made["shading"] = bpy.props.EnumProperty(
        name="Material",
        description="What the skin's material is made of when it is applied: the same skin either way",
        items=[
            (AUTO, "Automatic", "Plain nodes: the picture that OSL gives, in less time, on every device and in EEVEE"),
            (OSL, "OSL", "Two or three short scripts that a person can read. Cycles alone shows them, on the CPU and OptiX"),
            (NODES, "Plain Nodes", "What the scripts compute, as Blender's own nodes: every device, EEVEE, every Blender"),
        ],
        default=AUTO,
        override={"LIBRARY_OVERRIDABLE"},
    )
    return made | headline.properties()


def _growth_properties() -> dict[str, object]:
    """Who grows the features: the fields of `Growth`."""
    common, default = _KEPT, Growth()
    return {
        "seed": bpy.props.IntProperty(
            name="Individual", description="Number of the individual: where freckles, moles and vessels lie",
            default=default.seed, min=SEEDS[0], max=SEEDS[1], **common,
        ),
        "age_years": bpy.props.FloatProperty(
            name="Age (years)", description="Years: spots and small vessels grow with them", default=default.age_years, min=AGES[0],
            max=AGES[1], soft_min=15.0, soft_max=90.0, precision=0, step=100, **common,
        ),
        "sun": bpy.props.FloatProperty(
            name="Sun", description="Exposure of a life: 0 none, 1 a life outdoors", default=default.sun, min=0.0, max=1.0, **common
        ),
        "masculinity": bpy.props.FloatProperty(
            name="Masculinity", description="0 female, 1 male: hair of the beard, thickness of vessels",
            default=default.masculinity, min=0.0, max=1.0, **common,
        ),
    }


def growth_of(obj: bpy.types.Object) -> Growth:
    return Growth(**{name: getattr(obj.sanguine, name) for name in Growth.__dataclass_fields__})


def set_person(obj: bpy.types.Object, person: Person) -> None:
    """The properties of an individual: skin, strengths (the default of those that it has not) and growth."""
    for key, value in person.skin.items():
        setattr(obj.sanguine, key, value)
    for key, value in (default_strengths() | dict(person.strengths)).items():
        setattr(obj.sanguine, strength_property(key), value)
    for key in Growth.__dataclass_fields__:
        setattr(obj.sanguine, key, getattr(person.growth, key))


def _set_samples(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    context.scene.cycles.samples = chosen_point(settings.quality, settings.delta_e).samples


def _follower(label: str, name: str) -> Callable[[bpy.types.PropertyGroup, bpy.types.Context], None]:
    """What hands a value that somebody sets on to the slider of this label in the face's material, if it has one."""

    def follow(settings: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
        for slot in settings.id_data.material_slots:
            if slot.material is not None and MARK in slot.material and is_its_own(settings.id_data, slot):
                if (slider := slider_of(slot.material, label)) is not None:
                    slider.default_value = getattr(settings, name)

    return follow


def is_its_own(obj: bpy.types.Object, slot: bpy.types.MaterialSlot) -> bool:
    """Whether the material of a slot is this object's alone, and the file's. Of one that is shared, each face gets its own
    when its skin is applied."""
    shared = [slot.material, *([obj.data] if slot.link == "DATA" else [])]
    return slot.material.library is None and all(held.users - held.use_fake_user <= 1 for held in shared)


def slider_of(material: bpy.types.Material, label: str) -> bpy.types.NodeSocket | None:
    """The slider of the skin's group that is named so."""
    for node in material.node_tree.nodes:
        if node.bl_idname == "ShaderNodeGroup" and label in node.inputs:
            return node.inputs[label]
    return None


def _skin_colour(settings: bpy.types.PropertyGroup) -> tuple[float, float, float]:
    return swatch_of(skin_of(settings.id_data)).rgb


def strength_property(effect_id: str) -> str:
    return f"strength_{effect_id}"


def switch_property(effect_id: str) -> str:
    return f"use_{effect_id}"


_PROPERTIES = _skin_properties()

VIEWS = frozenset(name for name, made in _PROPERTIES.items() if "get" in made.keywords)
"""Properties that hold nothing themselves: they show, and set, what stands elsewhere."""

SkinSettings = type("SANGUINE_PG_skin", (bpy.types.PropertyGroup,), {"__annotations__": _PROPERTIES, "__doc__": __doc__})

CLASSES = (SkinSettings,)


def attach() -> None:
    bpy.types.Object.sanguine = bpy.props.PointerProperty(type=SkinSettings, override={"LIBRARY_OVERRIDABLE"})


def detach() -> None:
    del bpy.types.Object.sanguine


def skin_of(obj: bpy.types.Object) -> dict[str, float]:
    """The whole skin of an object. Blender keeps floats in single precision, which can step over a bound, and takes a NaN
    from a script, which counts as the default."""
    found = {row: getattr(obj.sanguine, row.id) for row in PARAMETERS.values()}
    return {
        row.id: row.default if math.isnan(value) else min(max(value, row.hard_min), row.hard_max) for row, value in found.items()
    }


def strengths_of(obj: bpy.types.Object) -> dict[str, float]:
    return {
        effect.id: getattr(obj.sanguine, strength_property(effect.id))
        for effect in EFFECTS
        if effect.default_strength is not None
    }


def switched_off(obj: bpy.types.Object) -> frozenset[str]:
    return frozenset(
        effect.id for effect in EFFECTS if effect.switchable and not getattr(obj.sanguine, switch_property(effect.id))
    )


def images_of(obj: bpy.types.Object) -> dict[str, bpy.types.Image]:
    """Map id -> image, of the maps that the object's properties point to; none where the add-on is not registered."""
    settings = getattr(obj, "sanguine", None)
    found = {name: getattr(settings, name, None) for name in (skin_map.MAP, residual.MAP)}
    return {name: image for name, image in found.items() if image is not None}


def map_ranges_of(obj: bpy.types.Object) -> dict[str, dict[str, Interval]]:
    """What `Scene.maps` wants to know of them. A skin map of unknown range is taken to reach as far as the sliders do."""
    whole = {name: (PARAMETERS[name].soft_min, PARAMETERS[name].soft_max) for name in skin_map.CHANNELS}
    return {
        name: (stored_range(image) or whole) if name == skin_map.MAP else {} for name, image in images_of(obj).items()
    }


def measure_maps(obj: bpy.types.Object) -> None:
    """Takes the ranges of the object's skin map anew: somebody may have painted on it."""
    if (image := images_of(obj).get(skin_map.MAP)) is not None:
        measure_range(image, skin_map.CHANNELS)


def point_of(obj: bpy.types.Object) -> Point:
    """The measured settings that somebody chose."""
    return chosen_point(obj.sanguine.quality, obj.sanguine.delta_e)


def quality_of(obj: bpy.types.Object) -> Settings:
    return point_of(obj).settings
