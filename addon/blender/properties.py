"""`Object.sanguine`: the skin of a face, one Blender property per row of the schema, effect strength and map, and its quality."""

from __future__ import annotations

import bpy

from ..domain.effects import EFFECTS, Growth, residual, skin_map
from ..domain.effects.effect import Interval
from ..domain.parameters import PARAMETERS
from ..domain.people import AGES, SEEDS, Person
from ..domain.plan import default_strengths
from ..domain.quality import DEFAULT, PRESETS, Settings, preset
from .images import measure_range, stored_range


def _skin_properties() -> dict[str, object]:
    made = {}
    for row in PARAMETERS.values():
        unit = f" [{row.unit}]" if row.unit not in ("", "1") else ""
        made[row.id] = bpy.props.FloatProperty(
            name=row.label,
            description=f"{row.help}{unit}. Source: {row.source}",
            default=row.default,
            min=row.hard_min,
            max=row.hard_max,
            soft_min=row.soft_min,
            soft_max=row.soft_max,
            precision=3,
            step=1,
            override={"LIBRARY_OVERRIDABLE"},
        )
    for effect in EFFECTS:
        if effect.default_strength is not None:
            made[strength_property(effect.id)] = bpy.props.FloatProperty(
                name=effect.label, description=effect.help, default=effect.default_strength, min=0.0, max=1.0,
                override={"LIBRARY_OVERRIDABLE"},
            )
    made |= _growth_properties()
    channels = "red {}, green {}, blue {}, alpha {}".format(*skin_map.CHANNELS)
    for effect, more in ((skin_map.EFFECT, f" {channels.capitalize()}"), (residual.EFFECT, "")):
        made[effect.id] = bpy.props.PointerProperty(
            type=bpy.types.Image, name=effect.label, description=effect.help + more, override={"LIBRARY_OVERRIDABLE"}
        )
    made["quality"] = bpy.props.EnumProperty(
        name="Quality",
        description="How finely the skin is simulated: samples change at once, the rest when the skin is applied",
        items=[(name, name.capitalize(), f"{point.measured} (one core)") for name, point in PRESETS.items()],
        default=DEFAULT,
        update=_set_samples,
        override={"LIBRARY_OVERRIDABLE"},
    )
    return made


def _growth_properties() -> dict[str, object]:
    """Who grows the features: the fields of `Growth`."""
    common = {"override": {"LIBRARY_OVERRIDABLE"}}
    default = Growth()
    return {
        "seed": bpy.props.IntProperty(
            name="Individual", description="Number of the individual: where freckles, moles and vessels lie",
            default=default.seed, min=SEEDS[0], max=SEEDS[1], **common,
        ),
        "age_years": bpy.props.FloatProperty(
            name="Age", description="Years: spots and small vessels grow with them", default=default.age_years, min=AGES[0],
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
    context.scene.cycles.samples = preset(settings.quality).samples


def strength_property(effect_id: str) -> str:
    return f"strength_{effect_id}"


SkinSettings = type(
    "SANGUINE_PG_skin", (bpy.types.PropertyGroup,), {"__annotations__": _skin_properties(), "__doc__": __doc__}
)

CLASSES = (SkinSettings,)


def attach() -> None:
    bpy.types.Object.sanguine = bpy.props.PointerProperty(type=SkinSettings, override={"LIBRARY_OVERRIDABLE"})


def detach() -> None:
    del bpy.types.Object.sanguine


def skin_of(obj: bpy.types.Object) -> dict[str, float]:
    """The whole skin of an object. Blender keeps floats in single precision, which can step over a bound."""
    return {
        row.id: min(max(getattr(obj.sanguine, row.id), row.hard_min), row.hard_max) for row in PARAMETERS.values()
    }


def strengths_of(obj: bpy.types.Object) -> dict[str, float]:
    return {
        effect.id: getattr(obj.sanguine, strength_property(effect.id))
        for effect in EFFECTS
        if effect.default_strength is not None
    }


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


def quality_of(obj: bpy.types.Object) -> Settings:
    return preset(obj.sanguine.quality).settings
