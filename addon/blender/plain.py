"""Bake to Plain Material: the scripts of a skin give way to the nodes that they compile to, in a file that then needs
nothing of ours."""

from __future__ import annotations

import re

import bpy

from ..domain.errors import InputError
from ..domain.shading import NODES
from .images import data_image
from .material import MARK, groups_of
from .operators import active_face, may_change
from .osl import has_scripts
from .removal import nothing_left_behind
from .skin import our_slot

_STAGE = re.compile(r"\bshader\s+sanguine_(\w+)")


def bake_plain(face: bpy.types.Object, eevee: bool = False) -> str:
    """Replaces the script nodes of a face's skin by plain nodes and packs its images. Returns what was done, a line.

    Table, maps, sliders and what drives them stay as they are. eevee: what the material reads of the object becomes
    drivers, as EEVEE reads no more than eight properties. Raises InputError, before anything is changed, for a script
    without plain nodes or an image without pixels.
    """
    material = face.material_slots[our_slot(face)].material
    if eevee and material.users - int(material.use_fake_user) > 1:
        raise InputError(f"{face.name}: other objects have its skin too, whose drivers would follow this one: make it single-user")
    groups = groups_of(material)
    images = [node.image for group in groups for node in group.nodes if node.bl_idname == "ShaderNodeTexImage" and node.image]
    for image in images:
        if not image.packed_files and not image.has_data and not image.size[0]:
            raise InputError(f"{face.name}: the image '{image.name}' has no pixels: its file is missing")
    replaced = [
        (group, node, _plain(group, node)) for group in groups for node in group.nodes if node.bl_idname == "ShaderNodeScript"
    ]
    for group, script, plain in replaced:
        _take_over(group, script, plain)
    driven = sum(_drive(face, group) for group in groups) if eevee else 0
    packed = 0
    for image in dict.fromkeys(images):
        if not image.packed_files and image.library is None:
            image.pack()
            packed += 1
    mark = material[MARK]
    mark["shading"] = NODES
    for scene in bpy.data.scenes:
        if not has_scripts() and face.name in scene.objects:
            scene.cycles.shading_system = False  # Cycles' own nodes are faster
    nodes = sum(len(plain.node_tree.nodes) for _, _, plain in replaced)
    more = f"; {driven} values are drivers" if eevee else ""
    return f"{len(replaced)} scripts are {nodes} nodes{more}; {packed} images packed, all are in the file"


def _plain(group: bpy.types.NodeTree, script: bpy.types.Node) -> bpy.types.Node:
    """A plain node beside a script node."""
    # Its libraries are read only where a plain material is made.
    from ..domain.osl_graph import compile_stage
    from .plain_nodes import plain_node

    if script.script is None:
        raise InputError(f"{group.name}: {script.name}: its text is gone: apply the skin again")
    source = script.script.as_string()
    found = _STAGE.search(source)
    given = tuple(socket.name for socket in script.inputs if socket.is_linked)
    return plain_node(group, script.name, compile_stage(found[1] if found else script.name, source, given), data_image)


def _take_over(group: bpy.types.NodeTree, script: bpy.types.Node, plain: bpy.types.Node) -> None:
    """Links, values, place and name of `script` become those of `plain`; `script` and its text go."""
    for socket in script.inputs:
        if (mine := plain.inputs.get(socket.name)) is None:
            continue
        if socket.is_linked:
            group.links.new(socket.links[0].from_socket, mine)
        elif hasattr(socket, "default_value"):
            mine.default_value = socket.default_value
    for socket in script.outputs:
        for link in list(socket.links):
            group.links.new(plain.outputs[socket.name], link.to_socket)
    plain.location, plain.width, name, text = script.location, script.width, script.name, script.script
    group.nodes.remove(script)
    plain.name = plain.label = name
    if text.users <= int(text.use_fake_user):
        bpy.data.texts.remove(text)


def _drive(face: bpy.types.Object, group: bpy.types.NodeTree) -> int:
    """Drivers in the place of the nodes that read the object's properties. Returns how many values they drive."""
    count = 0
    for node in [n for n in group.nodes if n.bl_idname == "ShaderNodeAttribute" and n.attribute_type == "OBJECT"]:
        path = f'["{node.attribute_name}"]'
        for source, kind, index in (("Fac", "ShaderNodeValue", ""), ("Alpha", "ShaderNodeValue", "[3]"), ("Color", "ShaderNodeCombineXYZ", "")):
            if not node.outputs[source].is_linked:
                continue
            value = group.nodes.new(kind)
            value.label, value.location, value.hide = f"{node.attribute_name}{index}", node.location, True
            for link in list(node.outputs[source].links):
                group.links.new(value.outputs[0], link.to_socket)
            sockets = value.inputs if source == "Color" else value.outputs
            for i, socket in enumerate(sockets):
                at = path + (f"[{i}]" if source == "Color" else index)
                try:
                    socket.default_value = face.path_resolve(at)
                except ValueError:
                    socket.default_value = 0.0  # as of an Attribute node: no such property
                    continue
                driver = socket.driver_add("default_value").driver
                driver.type = "SUM"
                variable = driver.variables.new()
                variable.targets[0].id, variable.targets[0].data_path = face, at
                count += 1
        group.nodes.remove(node)
    return count


class SANGUINE_OT_bake_plain(bpy.types.Operator):
    bl_idname = "sanguine.bake_plain"
    bl_label = "Bake to Plain Material"
    bl_description = (
        "Replace the scripts of the face's skin by Blender's own nodes and pack its images: the file then needs neither this "
        "add-on nor OSL, on any device and in EEVEE. Sliders and animation go on working; no picture is baked. Applying the "
        "skin again makes what Material says"
    )
    bl_options = {"REGISTER", "UNDO"}

    eevee: bpy.props.BoolProperty(
        name="For EEVEE",
        description="EEVEE hands eight properties of an object to a material and takes the rest for 0. With this, drivers of the "
        "material read them, which then is this object's alone",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        face = active_face(context)
        if not may_change(cls, face):
            return False
        slot = our_slot(face)
        if slot is None:
            cls.poll_message_set("The face has no skin of Sanguine: apply one first")
        elif face.material_slots[slot].material.library or face.material_slots[slot].material.override_library:
            cls.poll_message_set("The skin's material is linked: make it local first")
        else:
            return True
        return False

    def execute(self, context: bpy.types.Context) -> set[str]:
        face = active_face(context)
        try:
            with nothing_left_behind():
                done = bake_plain(face, self.eevee)
        except (ValueError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{face.name}: {done}")
        return {"FINISHED"}


CLASSES = (SANGUINE_OT_bake_plain,)
