"""Files of other versions of Sanguine: a face from an older one is brought up to date when something is done with it.

No handler runs when a file is opened. The skin of an old file renders as it is; what the add-on wrote for itself (the
settings of the face, what Remove Sanguine needs) is made new by the first operator that reads it.
"""

from __future__ import annotations

from typing import Any

import bpy

from ..domain.errors import InputError
from ..domain.migration import SCHEMA, UNNUMBERED, check_version, migrate, notes
from .controls import CONTROL_BONE
from .removal import BEFORE, controls_of, mark_rig
from .skin import VERSION, our_slot


def version_of(face: bpy.types.Object) -> int:
    """Which version wrote what is on a face. A face without a skin has nothing that an older one could mean otherwise.
    Raises InputError for a newer one."""
    if VERSION in face:
        return check_version(face[VERSION], face.name)
    return UNNUMBERED if BEFORE in face or our_slot(face) is not None else SCHEMA


def newer(face: bpy.types.Object) -> str:
    """Why this Sanguine leaves the face alone, one line; "" where it need not."""
    try:
        version_of(face)
    except InputError as error:
        return str(error)
    return ""


def bring_up_to_date(face: bpy.types.Object) -> list[str]:
    """Makes a face from an older version one of this. Returns what was done, a line each; nothing for a face of today.

    Raises InputError, with nothing changed, for a face from a newer version.
    """
    version = version_of(face)
    if version == SCHEMA:
        return []
    raw = _raw_settings(face)
    old = dict(raw) if raw is not None else {}
    new = migrate(old, version)
    if new != old:
        raw = _raw_settings(face, create=True)
        for name in old.keys() - new.keys():
            del raw[name]
        for name, value in new.items():
            raw[name] = value
    rig = controls_of(face)
    if version < 2 and rig is not None and BEFORE not in rig and [bone.name for bone in rig.data.bones] == [CONTROL_BONE]:
        mark_rig(rig)
    face[VERSION] = SCHEMA
    return [f"{face.name} comes from an older Sanguine (version {version} of its files, now {SCHEMA})", *notes(version)]


def _raw_settings(face: bpy.types.Object, create: bool = False) -> Any:
    """`face.sanguine` as it lies in the file: the names and numbers of the version that wrote it. None where nothing is set.

    Since Blender 5.0 such properties lie apart from the custom ones, and the copy among those is of no account.
    """
    if hasattr(face, "bl_system_properties_get"):
        holder = face.bl_system_properties_get(do_create=create)
    else:
        holder = face
    if holder is None:
        return None
    if create and "sanguine" not in holder:
        holder["sanguine"] = {}
    return holder.get("sanguine")
