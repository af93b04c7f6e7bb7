"""Drivers from shape keys to the components of strain and wrinkles: custom properties that the material reads.

Each property holds three numbers, components of one image in one half of the face, or of the alphas of several. The
drivers are simple expressions that listen to the keys' values, whatever moves these (keyframes, drivers, capture), so a
file with them works without the add-on and with auto-run off.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ..domain.effects import strain, wrinkles
from ..domain.effects.packed import NUMBERS
from ..domain.effects.strain import HALVES
from ..domain.key_sums import KeySum, key_sums
from ..domain.response import MAX_EXPRESSION

# Coefficients below this share of a component are left out: half of all. That adds at most a tenth to the error that so
# few components have anyway (bench/strain.py), and halves what their drivers cost per frame (bench/scrubbing.py).
LEAST = 0.02
_PART = "_part"


def drive_components(
    face: bpy.types.Object, driven: Sequence[str], keys: Sequence[str], coefficients: np.ndarray, one_sided: bool
) -> None:
    """Puts the driven properties `<driven>_left`, …, of `packed_components` on `face`.

    coefficients: (2, C, K), four components each. one_sided: what is below 0 counts as 0. A sum too long for one
    driver is taken in parts, each a property of its own.
    """
    for half, name in enumerate(HALVES):
        for stem, held in strain.packed_components(tuple(driven)).items():
            rows = [coefficients[half, i] for i in held]
            sums = [key_sums({k: c for k, c in zip(keys, row, strict=True) if abs(c) >= LEAST}) for row in rows]
            _drive_property(face, f"{stem}_{name}", sums, one_sided)


def remove_components(face: bpy.types.Object) -> None:
    """Removes the properties of `drive_components` and their drivers, also as versions before 3 had them."""
    stems = [stem for driven in (strain.IMAGES, wrinkles.DRIVEN) for stem in strain.packed_components(driven)]
    ours = {f"{stem}_{half}" for stem in stems for half in HALVES}
    for name in [key for key in face.keys() if key.partition(_PART)[0] in ours]:
        face.driver_remove(f'["{name}"]', -1)
        del face[name]


def _drive_property(face: bpy.types.Object, name: str, sums: list[list[KeySum]], one_sided: bool) -> None:
    face[name] = [0.0] * NUMBERS
    _describe(face, name)
    for i, several in enumerate(sums):
        if not several:
            continue
        if len(several) == 1:
            expression = f"max(0,{several[0].expression})" if one_sided else several[0].expression
            if len(expression) < MAX_EXPRESSION:
                _drive(face, name, i, expression, {v: _value_of(face, key) for v, key in several[0].keys.items()})
                continue
        chain = {}
        for part, one in enumerate(several):
            part_name = f"{name}{_PART}{part}"
            if part_name not in face:
                face[part_name] = [0.0] * NUMBERS
                _describe(face, part_name)
            _drive(face, part_name, i, one.expression, {v: _value_of(face, key) for v, key in one.keys.items()})
            chain[f"s{part}"] = ("OBJECT", face, f'["{part_name}"][{i}]')
        total = "+".join(chain)
        _drive(face, name, i, f"max(0,{total})" if one_sided else total, chain)


Target = tuple[str, bpy.types.ID, str]


def _value_of(face: bpy.types.Object, key: str) -> Target:
    return "KEY", face.data.shape_keys, f'key_blocks["{bpy.utils.escape_identifier(key)}"].value'


def _drive(face: bpy.types.Object, name: str, index: int, expression: str, variables: dict[str, Target]) -> None:
    curve = face.driver_add(f'["{name}"]', index)
    curve.keyframe_points.clear()  # the default curve is an identity that rounds; without keys values pass as they are
    driver = curve.driver
    driver.type = "SCRIPTED"
    for variable, (kind, owner, path) in variables.items():
        made = driver.variables.new()
        made.name = variable
        made.targets[0].id_type = kind
        made.targets[0].id = owner
        made.targets[0].data_path = path
    driver.expression = expression
    if not (driver.is_valid and driver.is_simple_expression):
        raise ValueError(f"{name}[{index}]: Blender does not take this as a simple expression: {expression}")


def _describe(face: bpy.types.Object, name: str) -> None:
    face.id_properties_ui(name).update(description="How far the shape keys drive the maps of strain or wrinkles")
