"""Emotion, action-unit and blood sliders on a control bone, and the drivers of the shape keys that listen to them.

Nothing here runs after it is built: a file with these controls works without the add-on, with auto-run off,
and as a library override. That is why every driver is a simple expression and no handler exists.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from ..domain.blood import (
    BLOOD_CONTROL,
    BLOOD_CONTROL_MAX,
    HEART_RATE_CONTROL,
    MOOD_SUFFIX,
    PACE,
    PACE_CONTROL,
    PRESSURE_CONTROL,
    PULSE_CONTROL,
    STATES,
    StateRow,
)
from ..domain.errors import InputError, nearest
from ..domain.facs import (
    ACTION_UNITS,
    ARKIT,
    DEFAULT_EMOTIONS,
    EMOTION_CONTROLS,
    EMOTION_MAX,
    EMOTIONS,
    SHAPE_KEYS,
    UNIT_CONTROLS,
    VARIANTS,
    Formulas,
    formulas,
)
from ..domain.naming import mesh_responses, recognise
from ..domain.response import MAX_EXPRESSION, Formula, Sum, driver_text
from ..domain.vascular import HEART_RATE, HEART_RATE_AT_REST
from .curves import curves, drop_empty_animation

CONTROL_BONE = "sanguine"

# Intermediate values of `Formulas.properties` are custom properties of the armature object itself.
_INTERMEDIATE = ("unit_", "sum_")
_INTERMEDIATE_PATHS = tuple(f'["{prefix}' for prefix in _INTERMEDIATE)


@dataclass(frozen=True)
class Control:
    """One slider: a custom property of the control bone."""

    help: str
    default: float = 0.0
    maximum: float = 1.0
    soft_maximum: float = 1.0
    minimum: float = 0.0


_VARIANTS_HELP = ", ".join(f"{value:g} {name}" for name, value in VARIANTS.items())

OPTIONAL: dict[str, StateRow] = {
    PULSE_CONTROL: StateRow(label="Heartbeat", help="How strongly the heartbeat shows in baked blood: 1 as in life"),
    PRESSURE_CONTROL: StateRow(label="Pressure", help="How hard it presses where the face's pressure group says so"),
}
"""What is asked for as states are, though no blood of rigs/blood.toml follows it."""

CONTROLS: dict[str, Control] = {
    **{name: Control(f"{EMOTIONS[name].help}. {_VARIANTS_HELP}", maximum=EMOTION_MAX) for name in EMOTION_CONTROLS},
    **{name: Control(row.help) for name, row in STATES.items()},
    **{name: Control(row.help) for name, row in OPTIONAL.items()},
    HEART_RATE_CONTROL: Control(
        "Heartbeats per minute", HEART_RATE_AT_REST, HEART_RATE[1], HEART_RATE[1], minimum=HEART_RATE[0]
    ),
    **{
        name + MOOD_SUFFIX: Control(
            f"The blood of {name} without its muscles, for a captured performance. {_VARIANTS_HELP}", maximum=EMOTION_MAX
        )
        for name in EMOTION_CONTROLS
    },
    BLOOD_CONTROL: Control(
        "How strongly blood answers: 0 not at all, 1 as in life, above 1 exaggerated",
        1.0,
        BLOOD_CONTROL_MAX,
        BLOOD_CONTROL_MAX,
    ),
    PACE_CONTROL: Control(
        "How fast blood follows when it is baked: 1 as in life, above 1 hurried", 1.0, PACE[1], PACE[1], minimum=PACE[0]
    ),
    **{name: Control(help) for name, help in UNIT_CONTROLS.items()},
}
"""Every slider that a rig can have, in the order in which they are added."""

AT_REST: dict[str, float] = {name: control.default for name, control in CONTROLS.items()}
"""A still face with its blood as in life."""

ON_DEMAND: tuple[str, ...] = (*EMOTION_CONTROLS, *STATES, *OPTIONAL, *(name + MOOD_SUFFIX for name in EMOTION_CONTROLS))
"""Those that a rig has only if it was asked for them."""


@dataclass(frozen=True)
class DriveReport:
    """What became of the shape keys that the controls know.

    `driven` are names on the meshes, `missing` ARKit keys that a unit would move and none of them expresses. `notes`:
    keys known but not used, and why. `occupied` lists "mesh: key" for keys left alone because something else drives them
    already. `still` lists the action units of face and eyes that move none of the keys driven.
    """

    driven: tuple[str, ...]
    missing: tuple[str, ...]
    occupied: tuple[str, ...]
    still: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def lines(self) -> tuple[str, ...]:
        """What a user should know of it, a line each."""
        lines = [*self.notes, *(f"{key}: driven by something else, left alone" for key in self.occupied)]
        if self.missing:
            lines.append(f"no shape key does the work of {', '.join(self.missing)}")
        return tuple(lines)


def add_controls(
    armature: bpy.types.Object,
    emotions: Iterable[str] = DEFAULT_EMOTIONS,
    states: Iterable[str] = (),
    sides: bool = True,
) -> bpy.types.PoseBone:
    """Puts sliders on the control bone, which is made if the armature has none: for these emotions and states, for
    blood, for every action unit and (`sides`) for its halves.

    Done again, it adds what is new; values, animation and sliders that are there stay. Raises InputError for an
    emotion or a state that does not exist.
    """
    asked = {name for name in emotions if name != "neutral"} | set(states)
    for name in asked:
        if name not in ON_DEMAND:
            raise InputError(f"{name}: no such emotion or state, {nearest(name, ON_DEMAND)}")
    if PULSE_CONTROL in asked:
        asked.add(HEART_RATE_CONTROL)
    if CONTROL_BONE not in armature.data.bones:
        with _edit_bones(armature) as bones:
            bone = bones.new(CONTROL_BONE)
            bone.tail = (0.0, 0.0, 0.1)  # a bone of no length is deleted on leaving edit mode
            bone.use_deform = False
    if armature.pose is None:  # an armature made by a script has no pose until it is first evaluated
        bpy.context.view_layer.update()
    bone = armature.pose.bones[CONTROL_BONE]
    halves = {f"AU{side}" for unit in ACTION_UNITS.values() if unit.sided and not unit.one_sided for side in unit.sides}
    for name, control in CONTROLS.items():
        if name not in bone:
            if name in (*ON_DEMAND, HEART_RATE_CONTROL) and name not in asked or name in halves and not sides:
                continue
            bone[name] = control.default
        describe(bone, name, control.help, control.minimum, control.maximum, control.default, control.soft_maximum)
        bone.property_overridable_library_set(f'["{name}"]', True)
    # A driver that is evaluated before the armature's evaluated copy has this pose is marked invalid for good.
    armature.update_tag()
    bpy.context.view_layer.update()
    _drive_units(armature)
    return bone


def remove_emotion(armature: bpy.types.Object, name: str) -> None:
    """Takes one emotion or state off the rig. What else listens to it (blood) has to be driven anew; its animation
    stays in its action and plays again when the emotion is put back."""
    bone = armature.pose.bones[CONTROL_BONE]
    present = _on(armature, ON_DEMAND)
    if name not in present:
        raise InputError(f"{name}: not on this rig, {nearest(name, present)}")
    del bone[name]
    if name == PULSE_CONTROL:
        del bone[HEART_RATE_CONTROL]
    _drive_units(armature)


def controls_of(face: bpy.types.Object) -> bpy.types.Object | None:
    """The armature that carries the face's controls."""
    rigs = [face.parent, *(m.object for m in face.modifiers if m.type == "ARMATURE")]
    return next((rig for rig in rigs if rig is not None and rig.type == "ARMATURE"), None)


def emotions_of(armature: bpy.types.Object) -> tuple[str, ...]:
    """The emotions that are on a rig."""
    return _on(armature, EMOTION_CONTROLS)


def states_of(armature: bpy.types.Object) -> tuple[str, ...]:
    """The states of the body that are on a rig."""
    return _on(armature, (*STATES, *OPTIONAL))


def _on(armature: bpy.types.Object, names: Iterable[str]) -> tuple[str, ...]:
    bone = armature.pose.bones.get(CONTROL_BONE) if armature.pose else None
    return tuple(name for name in names if name in bone) if bone else ()


def remove_controls(armature: bpy.types.Object) -> None:
    """Removes the sliders and their bone. Remove the drivers that listen to them first."""
    if CONTROL_BONE in armature.data.bones:
        with _edit_bones(armature) as bones:
            bones.remove(bones[CONTROL_BONE])  # its custom properties go with it


def set_controls(armature: bpy.types.Object, values: Mapping[str, float]) -> None:
    """Sets sliders by name. Raises InputError for an unknown name or a value outside the slider.

    A slider that the rig has not is at rest: that may be asked for, anything else may not.
    """
    bone = armature.pose.bones[CONTROL_BONE]
    for name, value in values.items():
        if name in EMOTIONS and name not in CONTROLS:
            continue  # neutral is a face to ask for, not a slider
        if name not in CONTROLS:
            raise InputError(f"{name}: no such control, {nearest(name, CONTROLS)}")
        if name not in bone:
            if value in (0.0, CONTROLS[name].default):
                continue
            raise InputError(f"{name}: not on this rig, which has {', '.join(emotions_of(armature) + states_of(armature))}")
        low, high = CONTROLS[name].minimum, CONTROLS[name].maximum
        if not low <= value <= high:
            raise InputError(f"{name}: {value} is outside {low:g} to {high:g}")
        bone[name] = float(value)
    armature.update_tag()  # writing a custom property from Python does not by itself re-evaluate drivers


def drive_shape_keys(armature: bpy.types.Object, meshes: Iterable[bpy.types.Object]) -> DriveReport:
    """Drives every shape key of `meshes` whose name is known (rigs/names/) from the controls. Doing it twice changes
    nothing; after an emotion was put on the rig or taken off it, do it again.

    A key that someone else drives is left alone. Raises ValueError when a driver cannot be made, naming the key.
    """
    wanted, occupied, notes, expressed = [], [], [], set()
    for mesh in meshes:
        keys = getattr(mesh.data, "shape_keys", None)
        if keys is None:
            continue
        found = recognise(keys.key_blocks.keys())
        notes += [f"{mesh.name}: {note}" for note in found.notes]
        for name, response in mesh_responses(found, _formulas(armature), emotions_of(armature)).items():
            path = f'key_blocks["{bpy.utils.escape_identifier(name)}"].value'
            existing = _driver(keys, path)
            if existing and not _listens_to(existing, armature):
                occupied.append(f"{mesh.name}: {name}")
            elif len(driver_text(response)[0]) >= MAX_EXPRESSION:
                notes.append(f"{mesh.name}: {name}: not driven, it is made of more than fits in a driver")
            else:
                wanted.append((keys, path, name, response))
                expressed |= found.expressed([name])
    _drive_units(armature, {control for _, _, _, response in wanted for control in response.controls()})
    for keys, path, _, response in wanted:
        drive(keys, path, response, armature)
    driven = {name for _, _, name, _ in wanted}
    return DriveReport(
        driven=(*(name for name in SHAPE_KEYS if name in driven), *sorted(driven - set(SHAPE_KEYS))),
        missing=tuple(name for name in SHAPE_KEYS if name in ARKIT.keys and name not in expressed),
        occupied=tuple(occupied),
        still=tuple(unit.id for unit in ACTION_UNITS.values() if unit.keys and not expressed & set(unit.keys)),
        notes=tuple(notes),
    )


def drive_head(armature: bpy.types.Object, bone: str = "head") -> str:
    """Turns a bone by the units of the head (51-58). Returns why it cannot, one line, "" when it can.

    The bone's own rotation and location then belong to the units: a bone that somebody has animated or driven is
    left alone.
    """
    if bone not in armature.pose.bones:
        return f"no bone '{bone}': the head's units move nothing"
    head = armature.pose.bones[bone]
    stem = f'pose.bones["{bpy.utils.escape_identifier(bone)}"].'
    animation = armature.animation_data
    paths = {curve.data_path for curve in curves(armature)} if animation and animation.action else set()
    paths |= {c.data_path for c in animation.drivers if not _listens_to(c, armature)} if animation else set()
    if taken := sorted(path for path in paths if path.startswith((f"{stem}rotation", f"{stem}location"))):
        return f"{taken[0]}: animated already, so the head's units leave the bone alone"
    moves = _formulas(armature).head
    _drive_units(armature, {unit for formula in moves.values() for unit in formula.controls()})
    head.rotation_mode = "YXZ"
    axes = np.array(armature.data.bones[bone].matrix_local.to_3x3()).T  # rows: the bone's own axes in the armature
    # The subject looks along -Y, Z up: a turn to the left is about +Z, a nod down about +X, a tilt to the left about +Y.
    for field, kind, axis, unit in (
        ("nod_degrees", "rotation_euler", (1, 0, 0), math.radians(1.0)),
        ("tilt_degrees", "rotation_euler", (0, 1, 0), math.radians(1.0)),
        ("turn_degrees", "rotation_euler", (0, 0, 1), math.radians(1.0)),
        ("forward_mm", "location", (0, -1, 0), 0.001),
    ):
        along = axes @ np.array(axis, dtype=float)
        index = int(np.abs(along).argmax())
        formula = Sum(tuple((round(w * unit * float(np.sign(along[index])), 6), part) for w, part in moves[field].terms))
        drive(armature, f"{stem}{kind}", formula, armature, index)
    return ""


def remove_head_drivers(armature: bpy.types.Object, bone: str = "head") -> None:
    """Removes the drivers of `drive_head` and sets the bone back to rest."""
    if bone not in armature.pose.bones or not armature.animation_data:
        return
    head = armature.pose.bones[bone]
    stem = f'pose.bones["{bpy.utils.escape_identifier(bone)}"].'
    for curve in [c for c in armature.animation_data.drivers if c.data_path.startswith(stem) and _listens_to(c, armature)]:
        getattr(head, curve.data_path.removeprefix(stem))[curve.array_index] = 0.0
        armature.driver_remove(curve.data_path, curve.array_index)
    _drive_units(armature)


def remove_shape_key_drivers(armature: bpy.types.Object, meshes: Iterable[bpy.types.Object]) -> None:
    """Removes the drivers of `drive_shape_keys` and sets the keys back to rest."""
    for mesh in meshes:
        keys = getattr(mesh.data, "shape_keys", None)
        for path in remove_drivers(keys, armature) if keys else ():
            keys.path_resolve(path.removesuffix(".value")).value = 0.0
    _drive_units(armature)


def _formulas(armature: bpy.types.Object) -> Formulas:
    bone = armature.pose.bones[CONTROL_BONE]
    return formulas(emotions_of(armature), sided=any(f"AU{unit.id}L" in bone for unit in ACTION_UNITS.values() if not unit.one_sided))


def _drive_units(armature: bpy.types.Object, more: Iterable[str] = ()) -> None:
    """Makes the intermediate properties that drivers listen to, and `more`, as the rig's emotions want them; removes
    those that nobody needs."""
    owners = [armature, *bpy.data.shape_keys]
    heard = {
        target.data_path[2:-2]
        for owner in owners
        for curve in (owner.animation_data.drivers if owner.animation_data else ())
        if not (owner == armature and curve.data_path.startswith(_INTERMEDIATE_PATHS))
        for variable in curve.driver.variables
        for target in variable.targets
        if target.id == armature and target.data_path.startswith('["')
    }
    bone = armature.pose.bones.get(CONTROL_BONE)
    needed = _formulas(armature).needed({*heard, *more}) if bone else {}
    for name in [key for key in armature.keys() if key.startswith(_INTERMEDIATE) and key not in needed]:
        armature.driver_remove(f'["{name}"]')
        del armature[name]
    for name in needed:
        if name not in armature:
            armature[name] = 0.0
            describe(armature, name, f"Between the sliders and the face: {name.replace('_', ' of unit ')}, driven", 0.0, 1.0, 0.0)
    # As with the sliders: what a driver reads must be in the evaluated copy before.
    armature.update_tag()
    bpy.context.view_layer.update()
    for name, formula in needed.items():
        path = f'["{name}"]'
        existing = _driver(armature, path)
        if existing is None or existing.driver.expression != driver_text(formula)[0] or not _hears(existing, formula):
            drive(armature, path, formula, armature)
    drop_empty_animation(armature)


def _hears(curve: bpy.types.FCurve, formula: Formula) -> bool:
    """Whether the variables of a driver are those of the formula: short texts say a, b, c for any control."""
    wanted = {variable: _target_path(name) for variable, name in driver_text(formula)[1].items()}
    return {v.name: v.targets[0].data_path for v in curve.driver.variables} == wanted


def describe(
    owner, name: str, help: str, low: float, high: float, default: float, soft_high: float | None = None
) -> None:
    owner.id_properties_ui(name).update(
        description=help,
        min=low,
        max=high,
        soft_min=low,
        soft_max=high if soft_high is None else soft_high,
        default=default,
        step=1.0,
        precision=3,
    )


@contextmanager
def _edit_bones(armature: bpy.types.Object) -> Iterator[bpy.types.ArmatureEditBones]:
    """The armature's edit bones, with mode and active object as they were afterwards."""
    bpy.context.view_layer.update()  # objects just linked by a script are not in the layer before
    if not armature.visible_get():
        raise InputError(f"{armature.name}: hidden or not in the view layer, so its bones cannot be edited: show it first")
    objects = bpy.context.view_layer.objects
    active = objects.active
    if active and active.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        yield armature.data.edit_bones
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
        objects.active = active


def drive(
    owner: bpy.types.ID,
    path: str,
    formula: Formula,
    armature: bpy.types.Object,
    index: int = -1,
    own: Collection[str] = (),
) -> None:
    """Drives `path` (of an array: its element `index`) of `owner` by a formula of controls, of which `own` are custom
    properties of the owner itself. Raises ValueError, naming the path, where Blender cannot."""
    expression, variables = driver_text(formula)
    if len(expression) >= MAX_EXPRESSION:
        raise ValueError(f"{path}: driver of {len(expression)} characters, Blender keeps {MAX_EXPRESSION - 1}: split it")
    owner.driver_remove(path, index)
    curve = owner.driver_add(path, index)
    curve.keyframe_points.clear()  # the default curve is an identity that rounds; without keys the value passes as it is
    driver = curve.driver
    driver.type = "SCRIPTED"
    for name, control in variables.items():
        variable = driver.variables.new()
        variable.name = name
        variable.targets[0].id = owner if control in own else armature
        variable.targets[0].data_path = f'["{control}"]' if control in own else _target_path(control)
    driver.expression = expression
    if not (driver.is_valid and driver.is_simple_expression):
        owner.driver_remove(path, index)
        raise ValueError(f"{path}: Blender does not take this as a simple expression: {expression}")


def control_path(name: str) -> str:
    """Where the armature object keeps a slider."""
    return f'pose.bones["{CONTROL_BONE}"]["{name}"]'


def _target_path(name: str) -> str:
    """Where the armature object keeps a control or an intermediate value."""
    return f'["{name}"]' if name.startswith(_INTERMEDIATE) else control_path(name)


def _driver(owner: bpy.types.ID, path: str) -> bpy.types.FCurve | None:
    return owner.animation_data.drivers.find(path) if owner.animation_data else None


def _listens_to(curve: bpy.types.FCurve, armature: bpy.types.Object) -> bool:
    return any(
        target.id == armature and target.data_path.startswith((f'pose.bones["{CONTROL_BONE}"]', *_INTERMEDIATE_PATHS))
        for variable in curve.driver.variables
        for target in variable.targets
    )


def remove_drivers(owner: bpy.types.ID, armature: bpy.types.Object) -> list[str]:
    """Removes the drivers of `owner` that listen to the controls; returns their paths."""
    curves = owner.animation_data.drivers if owner.animation_data else ()
    paths = [curve.data_path for curve in curves if _listens_to(curve, armature)]
    for path in paths:
        owner.driver_remove(path)
    drop_empty_animation(owner)
    return paths
