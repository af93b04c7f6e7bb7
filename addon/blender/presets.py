"""Skins to keep: Blender's own presets (Python, in its preset folder), those that come with Sanguine, and JSON files."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from bl_operators.presets import AddPresetBase
from bpy_extras.io_utils import ExportHelper, ImportHelper

from ..domain.effects import Growth
from ..domain.parameters import PARAMETERS
from ..domain.plan import default_strengths
from ..domain.resources import rigs_path
from ..domain.skin_preset import SkinPreset, make_preset, read_preset, write_preset
from .operators import active_face, may_change, tell_up_to_date
from .properties import growth_of, skin_of, strength_property, strengths_of

SUBDIR = "sanguine/skin"
_SHIPPED = str(rigs_path("presets").parent)

PROPERTIES = (
    *PARAMETERS,
    *(strength_property(name) for name in default_strengths()),
    *Growth.__dataclass_fields__,
    "quality",
    "delta_e",
)
"""What a preset holds of `Object.sanguine`."""


def preset_of_face(face: bpy.types.Object, label: str = "") -> SkinPreset:
    return make_preset(
        _short(skin_of(face)),
        _short(strengths_of(face)),
        Growth(**{name: value if name == "seed" else _shortest(value) for name, value in vars(growth_of(face)).items()}),
        label=label,
        quality=face.sanguine.quality,
        delta_e=_shortest(face.sanguine.delta_e),
    )


def _short(values: dict[str, float]) -> dict[str, float]:
    return {name: _shortest(value) for name, value in values.items()}


def _shortest(value: float) -> float:
    """The shortest number that is the same in Blender's single precision."""
    return float(str(np.float32(value)))


def set_preset(face: bpy.types.Object, preset: SkinPreset) -> None:
    settings = face.sanguine
    for name, value in preset.skin.items():
        setattr(settings, name, value)
    for name, value in preset.effects.items():
        setattr(settings, strength_property(name), value)
    for name, value in vars(preset.grown).items():
        setattr(settings, name, value)
    if preset.delta_e is not None:
        settings.delta_e = preset.delta_e
    if preset.quality is not None:
        settings.quality = preset.quality


class SANGUINE_MT_skin_presets(bpy.types.Menu):
    bl_label = "Skin Presets"
    bl_description = "Skins that were kept, and the middle of each class of measured skin"
    preset_subdir = SUBDIR
    preset_operator = "sanguine.use_preset"
    preset_extensions = {".py", ".json"}
    draw = bpy.types.Menu.draw_preset


class _OfAFace:
    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return may_change(cls, active_face(context))


class SANGUINE_OT_use_preset(_OfAFace, bpy.types.Operator):
    bl_idname = "sanguine.use_preset"
    bl_label = "Use Skin Preset"
    bl_description = "Set the skin, the strengths of its effects and whose features grow to those of this preset. Apply the skin to see it"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    filepath: bpy.props.StringProperty(name="File", subtype="FILE_PATH", options={"SKIP_SAVE", "HIDDEN"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        face, path = active_face(context), bpy.path.abspath(self.filepath)
        tell_up_to_date(self, face)
        try:
            if path.endswith(".json"):
                set_preset(face, read_preset(path))
            else:
                # As all of Blender's presets: lines of Python, which speak of the active object.
                with context.temp_override(object=face, active_object=face):
                    bpy.utils.execfile(path)
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        except Exception as error:  # whatever somebody's Python may raise
            self.report({"ERROR"}, f"{path}: cannot be used: {type(error).__name__}: {error}")
            return {"CANCELLED"}
        name = bpy.path.display_name(Path(path).name, title_case=False)
        SANGUINE_MT_skin_presets.bl_label = name
        self.report({"INFO"}, f"{name}. Apply the skin to see it")
        return {"FINISHED"}


class SANGUINE_OT_keep_preset(_OfAFace, AddPresetBase, bpy.types.Operator):
    bl_idname = "sanguine.keep_preset"
    bl_label = "Keep Skin Preset"
    bl_description = "Keep the skin of the panel under a name, in Blender's folder of presets; or remove the one that is chosen"

    preset_menu = "SANGUINE_MT_skin_presets"
    preset_subdir = SUBDIR
    preset_defines = ["skin = bpy.context.object.sanguine"]
    preset_values = [f"skin.{name}" for name in PROPERTIES]

    def execute(self, context: bpy.types.Context) -> set[str]:
        chosen = SANGUINE_MT_skin_presets.bl_label if self.remove_active else self.name
        if (self.remove_active or self.remove_name) and not bpy.utils.preset_find(chosen, SUBDIR, display_name=True):
            comes_with_us = bpy.utils.preset_find(chosen, SUBDIR, display_name=True, ext=".json")
            self.report({"WARNING"}, f"{chosen} comes with Sanguine" if comes_with_us else "Choose a preset first")
            return {"CANCELLED"}
        face = active_face(context)
        with context.temp_override(object=face, active_object=face):
            return super().execute(context)


class SANGUINE_OT_export_preset(_OfAFace, ExportHelper, bpy.types.Operator):
    bl_idname = "sanguine.export_preset"
    bl_label = "Export Skin"
    bl_description = "Write the skin, its effects' strengths, whose features grow and the quality as a JSON file, to send or to keep"

    filename_ext = ".json"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        face, path = active_face(context), bpy.path.abspath(self.filepath)
        try:
            write_preset(path, preset_of_face(face, face.name[:200]))
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Written: {path}")
        return {"FINISHED"}


class SANGUINE_OT_import_preset(_OfAFace, ImportHelper, bpy.types.Operator):
    bl_idname = "sanguine.import_preset"
    bl_label = "Import Skin"
    bl_description = "Read a skin from a JSON file that Export Skin wrote. The file is checked and cannot run anything"
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".json"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        path = bpy.path.abspath(self.filepath)
        try:
            preset = read_preset(path)
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        face = active_face(context)
        tell_up_to_date(self, face)
        set_preset(face, preset)
        self.report({"INFO"}, f"{preset.label or Path(path).stem}. Apply the skin to see it")
        return {"FINISHED"}


def register() -> None:
    bpy.utils.register_preset_path(_SHIPPED)


def unregister() -> None:
    bpy.utils.unregister_preset_path(_SHIPPED)
    SANGUINE_MT_skin_presets.bl_label = "Skin Presets"


CLASSES = (
    SANGUINE_MT_skin_presets,
    SANGUINE_OT_use_preset,
    SANGUINE_OT_keep_preset,
    SANGUINE_OT_export_preset,
    SANGUINE_OT_import_preset,
)
