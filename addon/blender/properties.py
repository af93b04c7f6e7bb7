"""`Object.sanguine`: the skin of a face, one Blender property per row of the schema and per effect strength, and its quality."""

from __future__ import annotations

import bpy

from ..domain.effects import EFFECTS
from ..domain.parameters import PARAMETERS
from ..domain.quality import DEFAULT, PRESETS, Settings, preset


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
    made["quality"] = bpy.props.EnumProperty(
        name="Quality",
        description="How finely the skin is simulated: samples change at once, the rest when the skin is applied",
        items=[(name, name.capitalize(), f"{point.measured} (one core)") for name, point in PRESETS.items()],
        default=DEFAULT,
        update=_set_samples,
        override={"LIBRARY_OVERRIDABLE"},
    )
    return made


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


def quality_of(obj: bpy.types.Object) -> Settings:
    return preset(obj.sanguine.quality).settings
