"""The panels: the tab "Sanguine" of the 3D view's sidebar, and the same among the properties of a face's material.

Each is drawn by one class, of which Blender gets one for either place. What a sub-panel holds follows from the groups of
the schema and of the effects.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

import bpy

from ..domain.blood import BLOOD_CONTROL, HEART_RATE_CONTROL, MOOD_SUFFIX, PACE_CONTROL, PULSE_CONTROL, STATES
from ..domain.effects import EFFECTS, Effect, Growth, residual, skin_map
from ..domain.facs import ACTION_UNITS, EMOTION_CONTROLS
from ..domain.parameters import PARAMETERS
from ..domain.people import class_at
from ..domain.plan import Plan
from ..domain.quality import PRESETS, WITHIN, Point, chosen_point
from ..domain.shading import EEVEE, OSL, not_shown
from .adopt import SANGUINE_OT_adopt, SANGUINE_OT_remove_skin, skinned_face
from .animation import (
    SANGUINE_OT_add_feeling,
    SANGUINE_OT_add_poses,
    SANGUINE_OT_bake_blood,
    SANGUINE_OT_clear_blood,
    SANGUINE_OT_load_profile,
    SANGUINE_OT_remove_feeling,
    rig_of,
)
from .bake import bake_state
from .blood import PROFILE
from .capture import SANGUINE_OT_import_capture
from .controls import CONTROL_BONE, OPTIONAL
from .example import SANGUINE_OT_add_head
from .headline import NEUTRAL, animated_emotions, emotion_of, shown_emotions
from .material import MARK, properties_read
from .migration import newer
from .operators import (
    SANGUINE_OT_apply_skin,
    SANGUINE_OT_draw_person,
    SANGUINE_OT_follow_working_space,
    SANGUINE_OT_read_picture,
    active_face,
    emotion_bone,
    live_plan,
    shading_of,
    strange_colours,
)
from .osl import renderer_of
from .plain import SANGUINE_OT_bake_plain
from .plan_view import changed_since, plan_view
from .presets import (
    SANGUINE_MT_skin_presets,
    SANGUINE_OT_export_preset,
    SANGUINE_OT_import_preset,
    SANGUINE_OT_keep_preset,
)
from .properties import images_of, point_of, skin_of, strength_property, switch_property
from .removal import has_skin
from .swatch import spectrum_icon, swatch_of

CLASSES: list[type[bpy.types.Panel]] = []
"""In the order in which they stand; a parent comes before its children."""

_SIDEBAR = {"bl_space_type": "VIEW_3D", "bl_region_type": "UI", "bl_category": "Sanguine"}
_MATERIAL = {"bl_space_type": "PROPERTIES", "bl_region_type": "WINDOW", "bl_context": "material"}
_SIDEBAR_ID, _MATERIAL_ID = "SANGUINE_PT_", "SANGUINE_PT_material_"


_BESIDE = 32
"""Letters of a name and its reason that find room side by side."""


class _Part:
    """What a panel draws. parent: the id of the panel that it is in."""

    parent = "main"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        face = active_face(context)
        return face is not None and (cls.bl_space_type == "VIEW_3D" or has_skin(face))


class _RigPart(_Part):
    """One that needs sliders."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and rig_of(context) is not None


def _panel(part: type[_Part]) -> type[bpy.types.Panel]:
    """`part`, named SANGUINE_PT_<id>, as a panel of the sidebar, which is returned, and as one of the material."""
    made = []
    for place, prefix in ((_SIDEBAR, _SIDEBAR_ID), (_MATERIAL, _MATERIAL_ID)):
        name = prefix + part.__name__.removeprefix(_SIDEBAR_ID)
        parent = {"bl_parent_id": prefix + part.parent} if part.parent else {}
        made.append(type(name, (part, bpy.types.Panel), {"bl_idname": name, **place, **parent, "__doc__": part.__doc__}))
    CLASSES.extend(made)
    return made[0]


def _wrapped(layout: bpy.types.UILayout, context: bpy.types.Context, text: str, icon: str = "NONE") -> None:
    """A sentence on as many lines as it takes: Blender cuts what is too long for a label."""
    region = getattr(context, "region", None)
    # About 7 pixels a letter at a scale of 1, and what stands left and right of them.
    room = (region.width / context.preferences.system.ui_scale - 60) / 6.5 if region is not None else 40
    column = layout.column(align=True)
    column.scale_y = 0.8
    for i, line in enumerate(textwrap.wrap(text, max(24, int(room)))):
        column.label(text=line, icon=icon if i == 0 else "BLANK1" if icon != "NONE" else "NONE")


def _parameters(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup, *groups: str) -> None:
    """Sliders of the parameters and the effects of these groups."""
    column = layout.column(align=True)
    for row in PARAMETERS.values():
        if row.group in groups:
            column.prop(settings, row.id)
    column = layout.column(align=True)
    for effect in EFFECTS:
        if effect.default_strength is not None and effect.group in groups:
            column.prop(settings, strength_property(effect.id), slider=True)


def _plan_or_why(layout: bpy.types.UILayout, context: bpy.types.Context, face: bpy.types.Object) -> Plan | None:
    """The plan of a face; of one that cannot have any (its blood profile is of another version), the reason as a label."""
    try:
        return live_plan(face)
    except ValueError as error:
        _wrapped(layout, context, str(error), "ERROR")
        return None


@_panel
class SANGUINE_PT_main(_Part):
    bl_label = "Sanguine"
    bl_options = set()
    parent = ""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return cls.bl_space_type == "VIEW_3D" or super().poll(context)

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        face = active_face(context)
        if face is None:
            layout.operator_menu_enum(SANGUINE_OT_add_head.bl_idname, "head", icon="ADD")
        if face is not None and not has_skin(face):
            row = layout.row()
            row.scale_y = 1.5
            row.operator_context = "INVOKE_DEFAULT"
            row.operator(SANGUINE_OT_adopt.bl_idname, icon="USER")
        layout.operator(SANGUINE_OT_apply_skin.bl_idname, icon="MATERIAL")
        if face is not None and (plan := _plan_or_why(layout, context, face)) is not None and changed_since(face, plan):
            layout.label(text="Changed: apply the skin to see it", icon="INFO")
        if skinned_face(context) is not None:
            layout.operator(SANGUINE_OT_remove_skin.bl_idname, icon="TRASH")
        if why := _not_shown(context.scene, face):
            _wrapped(layout, context, why.rstrip(":"), "INFO")
            if why.endswith(":"):
                layout.prop(context.scene.render, "engine", text="")
        if face and (why := newer(face)):
            _wrapped(layout, context, why, "ERROR")
            return
        if face and strange_colours(face):
            layout.label(text="Solved for another working space", icon="ERROR")
            layout.operator(SANGUINE_OT_follow_working_space.bl_idname, icon="COLOR")
        if face is not None:
            _headline(layout, context, face)


def _headline(layout: bpy.types.UILayout, context: bpy.types.Context, face: bpy.types.Object) -> None:
    """Emotion, intensity, quality."""
    settings, rig = face.sanguine, rig_of(context)
    column = layout.column(align=True)
    if rig is not None:
        row = column.row(align=True)
        row.prop(settings, "emotion", text="")
        row = row.row(align=True)
        row.enabled = emotion_of(face) != NEUTRAL
        row.prop(settings, "intensity", text="", slider=True)
    row = column.row(align=True)
    row.prop(settings, "quality", text="")
    if settings.quality == WITHIN:
        row.prop(settings, "delta_e")
    point = point_of(face)
    column = layout.column(align=True)
    column.scale_y = 0.8
    if settings.quality == WITHIN:
        column.label(text=point.means)
    column.label(text=point.measured)
    if rig is not None and (held := [name for name in animated_emotions(rig) if name in shown_emotions(rig)]):
        _wrapped(layout, context, f"{', '.join(held).capitalize()}: animated. Key the sliders in Blood", "ANIM")


@_panel
class SANGUINE_PT_skin(_Part):
    bl_label = "Skin"

    def draw(self, context: bpy.types.Context) -> None:
        layout, face = self.layout, active_face(context)
        row = layout.row(align=True)
        row.menu(SANGUINE_MT_skin_presets.__name__, text=SANGUINE_MT_skin_presets.bl_label)
        row.operator_context = "INVOKE_DEFAULT"
        row.operator(SANGUINE_OT_keep_preset.bl_idname, text="", icon="ADD")
        row.operator(SANGUINE_OT_keep_preset.bl_idname, text="", icon="REMOVE").remove_active = True
        row.operator(SANGUINE_OT_import_preset.bl_idname, text="", icon="IMPORT")
        row.operator(SANGUINE_OT_export_preset.bl_idname, text="", icon="EXPORT")
        _swatch(layout, face)
        _parameters(layout, face.sanguine, "pigment", "structure")


def _swatch(layout: bpy.types.UILayout, face: bpy.types.Object) -> None:
    """The colour and the spectrum of the skin as the sliders stand."""
    skin = skin_of(face)
    shown = swatch_of(skin)
    row = layout.row()
    left = row.column()
    colour = left.column()
    colour.scale_y = 2.0
    colour.prop(face.sanguine, "skin_colour", text="")
    numbers = left.column(align=True)
    numbers.scale_y = 0.8
    numbers.label(text="L* {:.0f}  a* {:.0f}  b* {:.0f}".format(*shown.lab))
    numbers.label(text=f"ITA {shown.ita:.0f}\N{DEGREE SIGN}, {class_at(shown.ita).replace('-', ' ')}")
    numbers.label(text="400\N{EN DASH}700 nm, 0\N{EN DASH}80 %")
    row.template_icon(spectrum_icon(skin), scale=6.5)
    if skin_map.MAP in images_of(face) and getattr(face.sanguine, switch_property(skin_map.MAP)):
        layout.label(text="A skin map stands in its place", icon="INFO")


@_panel
class SANGUINE_PT_blood(_Part):
    bl_label = "Blood"
    bl_options = set()

    def draw(self, context: bpy.types.Context) -> None:
        layout, face = self.layout, active_face(context)
        bone = emotion_bone(face)
        if bone is not None:
            states = [name for name in (*STATES, *OPTIONAL) if name != PULSE_CONTROL]  # the heart has its own panel
            for names in (EMOTION_CONTROLS, states, [BLOOD_CONTROL, PACE_CONTROL]):
                _sliders(layout, bone, names)
            row = layout.row(align=True)
            row.operator_context = "INVOKE_DEFAULT"
            row.operator(SANGUINE_OT_add_feeling.bl_idname, text="Add", icon="ADD")
            row.operator(SANGUINE_OT_remove_feeling.bl_idname, text="Remove", icon="REMOVE")
        layout.label(text="At Rest")
        _parameters(layout, face.sanguine, "blood")


def _sliders(layout: bpy.types.UILayout, bone: bpy.types.PoseBone, names: Iterable[str]) -> None:
    column = layout.column(align=True)
    for name in names:
        if name in bone:
            column.prop(bone, f'["{name}"]', text=_slider_label(bone, name), slider=True)


def _not_shown(scene: bpy.types.Scene, face: bpy.types.Object | None) -> str:
    """Why this Blender, as it is set, does not show the face's skin; "" where it does or there is none."""
    ours = (slot.material for slot in face.material_slots if slot.material and MARK in slot.material) if face else ()
    renderer = renderer_of(scene)
    lines = (not_shown(m[MARK].get("shading", OSL), renderer, len(properties_read(m))) for m in ours)
    return next(filter(None, lines), "")


def _slider_label(bone: bpy.types.PoseBone, name: str) -> str:
    if name == BLOOD_CONTROL and bone[name] > 1.0:
        return "Blood (exaggerated)"
    if name == PACE_CONTROL and bone[name] > 1.0:
        return "Blood pace (hurried)"
    if name == HEART_RATE_CONTROL:
        return "Heart rate (per minute)"
    rows = {**STATES, **OPTIONAL}
    return rows[name].label if name in rows else name.replace("_", " ").capitalize()


@_panel
class SANGUINE_PT_time(_RigPart):
    bl_label = "Blood in Time"
    parent = "blood"

    def draw(self, context: bpy.types.Context) -> None:
        layout, rig = self.layout, rig_of(context)
        state = bake_state(active_face(context), rig, context.scene)
        if not state.baked:
            _wrapped(layout, context, "Blood is shown as it would settle. Bake Blood makes it follow in time", "INFO")
        elif state.stale:
            layout.label(text="Stale: bake again", icon="ERROR")
            _wrapped(layout, context, state.stale)
        else:
            layout.label(text="Baked", icon="CHECKMARK")
            if state.driven:
                _wrapped(layout, context, "Drivers move a slider: bake before rendering", "INFO")
        layout.operator(SANGUINE_OT_bake_blood.bl_idname, icon="FCURVE")
        layout.operator(SANGUINE_OT_clear_blood.bl_idname, icon="X")
        layout.operator(SANGUINE_OT_add_poses.bl_idname, icon="ASSET_MANAGER")
        _sliders(layout, rig.pose.bones[CONTROL_BONE], [name + MOOD_SUFFIX for name in EMOTION_CONTROLS])


@_panel
class SANGUINE_PT_oil(_Part):
    bl_label = "Oil and Sweat"

    def draw(self, context: bpy.types.Context) -> None:
        _parameters(self.layout, active_face(context).sanguine, "surface")


@_panel
class SANGUINE_PT_features(_Part):
    bl_label = "Features"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        settings = active_face(context).sanguine
        layout.operator_context = "INVOKE_DEFAULT"
        layout.operator(SANGUINE_OT_draw_person.bl_idname, icon="USER")
        column = layout.column(align=True)
        for name in Growth.__dataclass_fields__:
            column.prop(settings, name)
        layout.use_property_split = False  # their names are long
        _parameters(layout, settings, "features")


@_panel
class SANGUINE_PT_physiology(_RigPart):
    bl_label = "Physiology"

    def draw(self, context: bpy.types.Context) -> None:
        layout, rig = self.layout, rig_of(context)
        layout.operator(SANGUINE_OT_load_profile.bl_idname, icon="FILE_FOLDER")
        if PROFILE in rig:
            layout.label(text="Measured blood, of a profile", icon="CHECKMARK")
        bone = rig.pose.bones[CONTROL_BONE]
        if PULSE_CONTROL in bone:
            _sliders(layout, bone, [PULSE_CONTROL, HEART_RATE_CONTROL])
        else:
            row = layout.row()
            row.operator_context = "EXEC_DEFAULT"
            row.operator(SANGUINE_OT_add_feeling.bl_idname, text="Add Heartbeat", icon="ADD").feeling = PULSE_CONTROL


@_panel
class SANGUINE_PT_units(_RigPart):
    bl_label = "Action Units"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.operator(SANGUINE_OT_import_capture.bl_idname, icon="IMPORT")
        bone = rig_of(context).pose.bones[CONTROL_BONE]
        column = self.layout.column(align=True)
        for unit in ACTION_UNITS.values():
            if f"AU{unit.id}" in bone:
                column.prop(bone, f'["AU{unit.id}"]', text=f"{unit.id} {unit.name}", slider=True)


@_panel
class SANGUINE_PT_sides(_RigPart):
    # Of its own: beside the slider of both sides there is no room, and the names would be cut.
    bl_label = "Left and Right"
    parent = "units"

    def draw(self, context: bpy.types.Context) -> None:
        bone = rig_of(context).pose.bones[CONTROL_BONE]
        column = self.layout.column(align=True)
        for unit in ACTION_UNITS.values():
            row = column.row(align=True)
            for side, text in (("R", f"{unit.id} right"), ("L", "left")):  # as one sees them, face to face
                if f"AU{unit.id}{side}" in bone:
                    row.prop(bone, f'["AU{unit.id}{side}"]', text=text, slider=True)


@_panel
class SANGUINE_PT_picture(_Part):
    bl_label = "From a Picture"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.operator_context = "INVOKE_DEFAULT"
        layout.operator(SANGUINE_OT_read_picture.bl_idname, icon="IMAGE_DATA")
        for name in (skin_map.MAP, residual.MAP):
            layout.prop(active_face(context).sanguine, name)


@_panel
class SANGUINE_PT_quality(_Part):
    bl_label = "Quality"

    def draw(self, context: bpy.types.Context) -> None:
        """Every preset with what was measured of it, to compare before one chooses."""
        layout, face = self.layout, active_face(context)
        settings, render = face.sanguine, context.scene.render
        share = render.resolution_percentage / 100.0
        width, height = round(share * render.resolution_x), round(share * render.resolution_y)
        megapixels = width * height / 1e6
        _wrapped(layout, context, f"Delta E, and seconds of one core for {width} x {height}")
        column = layout.column(align=True)
        for name, point in PRESETS.items():
            _quality_row(column, settings, name, point, megapixels)
        row = layout.column(align=True)
        within = chosen_point(WITHIN, settings.delta_e)
        _quality_row(row, settings, WITHIN, within, megapixels)
        row.prop(settings, "delta_e", text="Within Delta E")
        _wrapped(layout, context, point_of(face).means)


def _quality_row(
    column: bpy.types.UILayout, settings: bpy.types.PropertyGroup, name: str, point: Point, megapixels: float
) -> None:
    split = column.split(factor=0.55, align=True)
    split.prop_enum(settings, "quality", name)
    split.label(text=f"{point.delta_e:.1f}, {_seconds(point.prepare_seconds + megapixels * point.seconds_per_megapixel)}")


def _seconds(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 600.0 else f"{seconds / 60.0:.0f} min"


@_panel
class SANGUINE_PT_plan(_Part):
    bl_label = "Plan"

    def draw(self, context: bpy.types.Context) -> None:
        """What runs, and what somebody has switched off."""
        layout, face = self.layout, active_face(context)
        plan = _plan_or_why(layout, context, face)
        if plan is None:
            return
        view = plan_view(face, context.scene, plan)
        layout.label(text="Time to solve, memory of maps")
        for effect in EFFECTS:
            decision = plan.decisions[effect.id]
            if not decision.active and effect.id not in plan.scene.switched_off:
                continue
            box = layout.column(align=True)
            row = box.row(align=True)
            _switch(row, face, effect)
            right = row.row(align=True)
            right.alignment = "RIGHT"
            if decision.active:
                cost = view.costs[effect.id]
                right.label(text=f"{_time(cost.milliseconds)}, {_megabytes(cost.megabytes)}{' shared' if cost.shared else ''}")
            _wrapped(box, context, decision.because, "BLANK1")
        table = f"{plan.entries} skins in the table: {_time(view.milliseconds)} of one core"
        maps = "no UV map, so no maps" if view.megabytes is None else f"{_megabytes(view.megabytes)} of maps"
        _wrapped(layout, context, f"{table}; {maps}")
        layout.prop(face.sanguine, "shading")
        bake = layout.operator(SANGUINE_OT_bake_plain.bl_idname, icon="NODE_MATERIAL")
        bake.eevee = context.scene.render.engine in EEVEE
        try:
            _wrapped(layout, context, "Skin is " + shading_of(context.scene, face).line)
        except ValueError as error:
            _wrapped(layout, context, str(error), "ERROR")


def _switch(row: bpy.types.UILayout, face: bpy.types.Object, effect: Effect) -> None:
    if effect.switchable:
        row.prop(face.sanguine, switch_property(effect.id))
    else:
        row.label(text=effect.label, icon="CHECKMARK")


@_panel
class SANGUINE_PT_idle(_Part):
    bl_label = "Not Called For"
    parent = "plan"

    def draw(self, context: bpy.types.Context) -> None:
        """What does not run, and why."""
        face = active_face(context)
        plan = _plan_or_why(self.layout, context, face)
        for effect in EFFECTS if plan is not None else ():
            decision = plan.decisions[effect.id]
            if not decision.active and effect.id not in plan.scene.switched_off:
                column = self.layout.column(align=True)
                row = column.row(align=True)
                _switch(row, face, effect)
                if len(effect.label) + len(decision.because) <= _BESIDE:
                    right = row.row()
                    right.alignment = "RIGHT"
                    right.label(text=decision.because)
                else:
                    _wrapped(column, context, decision.because, "BLANK1")


def _time(milliseconds: float) -> str:
    return f"{milliseconds:.0f} ms" if milliseconds < 1000.0 else f"{milliseconds / 1000.0:.1f} s"


def _megabytes(megabytes: float) -> str:
    return f"{megabytes:.1f} MB" if 0.0 < megabytes < 10.0 else f"{megabytes:.0f} MB"
