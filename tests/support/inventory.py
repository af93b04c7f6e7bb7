"""What is in a file, for comparisons of before and after: datablocks, properties, drivers, attributes, parents, values."""

import re

import bpy
from sanguine.blender.curves import _channels, curves

# Blender's own, or made by its window; "sanguine" and "cycles" are groups of registered properties, told by their values.
_ADDRESS = re.compile(r" at 0x[0-9a-f]+")
_GROUPS = {"sanguine", "cycles", "cycles_curves", "cycles_visibility"}


def inventory():
    """Nested dict that two equal files have equal."""
    kinds = [p.identifier for p in bpy.data.bl_rna.properties if p.type == "COLLECTION" and p.identifier != "window_managers"]
    found = {}
    for kind in kinds:
        for item in getattr(bpy.data, kind):
            if isinstance(item, bpy.types.ID):
                found[f"{kind}/{item.name_full}"] = _id(item)
    scene = bpy.context.scene.cycles
    found["cycles"] = {name: (getattr(scene, name), scene.is_property_set(name)) for name in ("shading_system", "samples")}
    return found


def counts(found):
    """Kind of datablock -> how many an inventory has."""
    kinds = [name.split("/")[0] for name in found]
    return {kind: kinds.count(kind) for kind in kinds}


def _id(item):
    known = {"users": item.users, "fake": item.use_fake_user, "properties": _properties(item)}
    animation = getattr(item, "animation_data", None)
    known["animation"] = animation and {
        "action": animation.action and animation.action.name,
        "drivers": sorted((c.data_path, c.array_index, c.driver.expression, c.mute) for c in animation.drivers),
        "tracks": len(animation.nla_tracks),
        "curves": sorted((c.data_path, c.array_index, len(c.keyframe_points), c.group and c.group.name) for c in curves(item)),
        "groups": sorted(group.name for group in channels.groups) if (channels := _channels(item)) else [],
    }
    settings = getattr(item, "sanguine", None)
    if settings is not None:
        known["settings"] = _settings(settings)
    tree = item if isinstance(item, bpy.types.NodeTree) else getattr(item, "node_tree", None)
    if tree is not None:
        known["nodes"] = _nodes(tree)
    if isinstance(item, bpy.types.Image):
        known["image"] = (tuple(item.size), [packed.packed_file and packed.packed_file.size for packed in item.packed_files])
    more = {bpy.types.Object: _object, bpy.types.Mesh: _mesh, bpy.types.Key: _key, bpy.types.Armature: _armature}
    return known | next((tell(item) for kind, tell in more.items() if isinstance(item, kind)), {})


def _properties(item):
    kept = {}
    for name in item.keys() if hasattr(item, "keys") else ():
        if name not in _GROUPS:
            value = item[name]
            kept[name] = _ADDRESS.sub("", repr(value.to_dict() if hasattr(value, "to_dict") else value))
    return kept


def _object(item):
    return {
        "parent": item.parent and item.parent.name,
        "parent_type": (item.parent_type, item.parent_bone, tuple(item.parent_vertices)),
        "place": [tuple(row) for row in (*item.matrix_parent_inverse, *item.matrix_basis)],
        "modifiers": [(m.type, m.name) for m in item.modifiers],
        "groups": [group.name for group in item.vertex_groups],
        "active_group": item.vertex_groups.active_index,
        "slots": [(slot.link, slot.material and slot.material.name) for slot in item.material_slots],
        "bones": {b.name: _properties(b) for b in item.pose.bones} if item.pose else None,
    }


def _nodes(tree):
    found = {}
    for node in tree.nodes:
        image = getattr(node, "image", None)
        values = [_plain(s.default_value) for s in node.inputs if hasattr(s, "default_value") and not s.is_linked]
        found[node.name] = (node.bl_idname, node.label, image and image.name, values)
    return found, sorted((l.from_node.name, l.from_socket.identifier, l.to_node.name, l.to_socket.identifier) for l in tree.links)


def _plain(value):
    return tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else value


def _settings(settings):
    names = [name for name in settings.bl_rna.properties.keys() if name != "rna_type" and settings.is_property_set(name)]
    return {name: getattr(value, "name_full", str(value)) for name in names if (value := getattr(settings, name)) is not None}


def _mesh(item):
    return {
        "attributes": sorted((a.name, a.domain, a.data_type) for a in item.attributes if not a.name.startswith(".")),
        "materials": [m and m.name for m in item.materials],
        "size": (len(item.vertices), len(item.polygons)),
    }


def _key(item):
    return {"values": {block.name: block.value for block in item.key_blocks}}


def _armature(item):
    return {"bones": sorted(bone.name for bone in item.bones)}
