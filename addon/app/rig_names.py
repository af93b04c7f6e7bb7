"""`sanguine names`: which shape keys a rig has, and what each of them is to the controls."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import sanguine_core

from ..domain.errors import InputError
from ..domain.files import read_json, read_text
from ..domain.naming import Names, conventions, recognise

_GLB_MAGIC, _JSON_CHUNK = 0x46546C67, 0x4E4F534A  # "glTF", "JSON" (glTF 2.0 specification, section 4.4)
_MOST_JSON_BYTES = 256 * 1024 * 1024


def read_key_names(path: str) -> dict[str, tuple[str, ...]]:
    """Mesh -> names of its shape keys, from a glTF 2.0 file (.gltf, .glb, .vrm) or a text file with a name per line.

    Raises InputError, one line, for a file that is neither or has no shape keys.
    """
    suffix = Path(path).suffix.lower()
    if suffix in (".glb", ".vrm"):
        return _of_gltf(_glb_json(path), path)
    if suffix == ".gltf":
        return _of_gltf(read_json(path), path)
    names = tuple(line.strip() for line in read_text(path).splitlines() if line.strip())
    if not names:
        raise InputError(f"{path}: no names: one on each line is expected, or a .gltf, .glb or .vrm file")
    return {"": names}


def _glb_json(path: str) -> Any:
    try:
        with open(path, "rb") as file:
            magic, version, _, size, chunk = struct.unpack("<5I", file.read(20))
            if (magic, version, chunk) != (_GLB_MAGIC, 2, _JSON_CHUNK) or size > _MOST_JSON_BYTES:
                raise ValueError
            text = file.read(size)
        return json.loads(text)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, struct.error, RecursionError):
        raise InputError(f"{path}: not a binary glTF 2.0 file") from None


def _of_gltf(data: Any, path: str) -> dict[str, tuple[str, ...]]:
    """Names of morph targets stand in `extras.targetNames` of the mesh, by custom of all exporters, or of a primitive."""
    meshes: dict[str, tuple[str, ...]] = {}
    try:
        for number, mesh in enumerate(data.get("meshes", ())):
            holders = [mesh, *mesh.get("primitives", ())]
            names = next((h["extras"]["targetNames"] for h in holders if (h.get("extras") or {}).get("targetNames")), ())
            if names:
                meshes[f"{number} {mesh.get('name', '')}".strip()] = tuple(map(str, names))
    except (AttributeError, TypeError, KeyError):
        raise InputError(f"{path}: not a glTF 2.0 file") from None
    if not meshes:
        raise InputError(f"{path}: no mesh in it has shape keys with names (extras.targetNames)")
    return meshes


def names_report(path: str, own: Mapping[str, Names]) -> dict[str, Any]:
    """What the keys of a file are, mesh by mesh. `own`: the user's conventions, by name."""
    labels = {name: names.label for name, names in {**own, **conventions()}.items()}
    meshes = []
    for mesh, keys in read_key_names(path).items():
        found = recognise(keys, own)
        meshes.append({
            "mesh": mesh,
            "convention": found.convention,
            "label": labels.get(found.convention or "", ""),
            "sure": round(found.sure, 3),
            "followed": found.followed,
            "keys": {key: dict(row) for key, row in found.mapping.items()},
            "missing": list(found.missing),
            "unknown": list(found.unknown),
            "absent": found.absent,
            "spare": {key: list(others) for key, others in found.spare.items()},
            "ambiguous": {name: list(candidates) for name, candidates in found.ambiguous.items()},
            "notes": list(found.notes),
        })  # fmt: skip
    return {"sanguine": sanguine_core.__version__, "meshes": meshes}
