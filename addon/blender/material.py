"""The skin material of a plan: a node group with ranges and tooltips around two OSL scripts and a packed table, or around
the plain nodes that the same text compiles to.

Everything the material reads at render time is a custom property, a mesh attribute or a packed image, so the
file renders the same without the add-on.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import bpy

from ..domain.effects import EFFECTS, ShaderInput, grown, residual, skin_map, strain, wrinkles
from ..domain.lut import Table, bake, relief_kept
from ..domain.parameters import PARAMETERS
from ..domain.plan import Plan
from ..domain.shader import TABLE_MIX, Shader, assemble, lobe_sockets, table_slices
from ..domain.shading import NODES, OSL
from .colour import sign_table, working_space
from .images import Pixels, data_image
from .osl import script_node

MARK = "sanguine"
"""Custom property of every skin material: what it simulates."""

Map = Pixels | bpy.types.Image
"""Numbers, which become a packed image of the material's own, or an image of numbers that somebody else keeps."""

_OF_THE_FACE = (skin_map.MAP, residual.MAP)
"""Maps that come with the face and stay when the material goes."""

# Maps that 16-bit floats hold: a rounding of 1 in 2000 does not show, and the file has half the size or less.
_HALF = (*strain.IMAGES, *wrinkles.IMAGES, *_OF_THE_FACE)

def _is_half(key: str) -> bool:
    return key in _HALF or grown.channels_of(key) is not None


_NUMBERED = re.compile(r"\.\d{3}$")

_BASE = {"skin_hemoglobin": "hemoglobin", "skin_oxygenation": "oxygenation", "skin_melanin": "melanin"}
# Heights come in mm; the Bump node wants the height of "1" in scene units.
_MM_PER_M = 1000.0


def build_skin_material(
    name: str, plan: Plan, maps: Mapping[str, Map], table: Table | None = None, shading: str = OSL
) -> bpy.types.Material:
    """A new material for `plan`. maps: map id -> what it shows, for each of `plan.maps`. table: solved here if left out.

    shading: OSL, or NODES for its plain twin.
    """
    if table is None:
        table = bake(plan.axes, plan.skin, working_space(), lobes=plan.settings.lobes, walk=plan.walk)
    material = bpy.data.materials.new(name)
    if not material.node_tree:  # since Blender 5.0 there always is one
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    group = tree.nodes.new("ShaderNodeGroup")
    group.node_tree = _group(name, plan, table, maps, shading)
    group.name = group.label = name
    group.width = 220
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    output.location = (300, 0)
    tree.links.new(group.outputs["BSDF"], output.inputs["Surface"])
    material[MARK] = {
        "effects": [effect.id for effect in plan.active], "entries": plan.entries, "fingerprint": plan.fingerprint,
        "shading": shading,
    }
    return material


def remove_skin_material(material: bpy.types.Material) -> None:
    """Removes a material of `build_skin_material` with the group, images and texts that were made for it alone."""
    groups = groups_of(material)
    bpy.data.materials.remove(material)
    for group in groups:
        parts = set(_parts(group))
        inner = {part for part in parts if isinstance(part, bpy.types.NodeTree)}
        parts -= inner
        for tree in (group, *inner):
            if not tree.users:
                bpy.data.node_groups.remove(tree)
        # Blender gives every text a fake user.
        bpy.data.batch_remove([held for held in parts if held.users == int(held.use_fake_user)])


def number_free(material: bpy.types.Material) -> None:
    """Takes off the numbers (".001") that Blender put behind names while the skin before this one still had them."""
    for group in groups_of(material):
        for item in (material, group, *_parts(group)):
            if _NUMBERED.search(item.name):
                item.name = _NUMBERED.sub("", item.name)  # a name that is taken gets a number again


def groups_of(material: bpy.types.Material) -> list[bpy.types.NodeTree]:
    """The skin's group, of which every material of ours has one."""
    nodes = material.node_tree.nodes if material.node_tree else ()
    return [node.node_tree for node in nodes if node.bl_idname == "ShaderNodeGroup" and node.node_tree]


def properties_read(material: bpy.types.Material) -> set[str]:
    """The object's properties that a skin reads."""
    nodes = (node for group in groups_of(material) for node in group.nodes if node.bl_idname == "ShaderNodeAttribute")
    return {node.attribute_name for node in nodes if node.attribute_type == "OBJECT"}


def _parts(group: bpy.types.NodeTree) -> Iterator[bpy.types.ID]:
    """Images, texts and inner groups of a skin's group, those that come with the face apart."""
    for node in group.nodes:
        if node.bl_idname == "ShaderNodeTexImage" and node.label not in _OF_THE_FACE and node.image:
            yield node.image
        elif node.bl_idname == "ShaderNodeScript" and node.script:
            yield node.script
        elif node.bl_idname == "ShaderNodeGroup" and node.node_tree:
            yield from _parts(node.node_tree)
            yield node.node_tree


def _group(name: str, plan: Plan, table: Table, maps: Mapping[str, Map], shading: str) -> bpy.types.NodeTree:
    tree = bpy.data.node_groups.new(name, "ShaderNodeTree")
    build = _Builder(name, tree, plan, maps, shading)
    tree.interface.new_socket("BSDF", in_out="OUTPUT", socket_type="NodeSocketShader")
    shaders = assemble(plan)
    build.points = points = build.script("chromophores", shaders["chromophores"])
    lobes = build.script("surface", shaders["surface"], ("Normal",) if {"slopes", "relief"} & set(shaders) else ())
    build.base_values(points)
    unit_per_mm = 1.0 / (_MM_PER_M * bpy.context.scene.unit_settings.scale_length)
    lobes.inputs["unit_per_mm"].default_value = unit_per_mm
    if table.axes:
        build.read_table(table, points, lobes)
    else:
        for socket, value in zip(lobe_sockets(table.lobes, walk=table.walk), table.image.reshape(-1, 3), strict=True):
            lobes.inputs[socket].default_value = (*value.tolist(), 1.0)
    normal = lobes.inputs.get("Normal")  # plain nodes have it where it is linked
    if "relief" in shaders:
        bump = build.node("ShaderNodeBump")
        bump.inputs["Distance"].default_value = unit_per_mm
        build.link(build.script("relief", shaders["relief"]).outputs["height_mm"], bump.inputs["Height"])
        build.link(bump.outputs["Normal"], normal)
        normal = bump.inputs["Normal"]
    if "slopes" in shaders:
        # In the tangent space of the active render UV map, by which Image Texture nodes without a vector read too.
        bent = build.node("ShaderNodeNormalMap")
        build.link(build.script("slopes", shaders["slopes"]).outputs["tangent_normal"], bent.inputs["Color"])
        build.link(bent.outputs["Normal"], normal)
    end = build.node("NodeGroupOutput")
    shown = lobes.outputs["BSDF"]
    if "leaving" in lobes.outputs:
        lobes.inputs["relief_kept"].default_value = relief_kept(plan.skin)
        if shading == NODES:
            shown = build.unless_leaving(shown, lobes.outputs["leaving"])
    build.link(shown, end.inputs["BSDF"])
    build.arrange(points, lobes, end)
    return tree


class _Builder:
    """Nodes of one group, each source of a value made once."""

    points: bpy.types.Node  # the first script, once it is made

    def __init__(
        self, name: str, tree: bpy.types.NodeTree, plan: Plan, maps: Mapping[str, Map], shading: str
    ) -> None:
        self.name, self.tree, self.plan, self.shading = name, tree, plan, shading
        self.begin = tree.nodes.new("NodeGroupInput")
        self.sources: dict[tuple[str, str], bpy.types.NodeSocket] = {}
        self.images = {key: self._image(key, maps[key]) for key in plan.maps}

    def _image(self, key: str, shown: Map) -> bpy.types.Image:
        return shown if isinstance(shown, bpy.types.Image) else data_image(f"{self.name} {key}", shown, _is_half(key))

    def node(self, kind: str) -> bpy.types.Node:
        return self.tree.nodes.new(kind)

    def link(self, source: bpy.types.NodeSocket, target: bpy.types.NodeSocket) -> None:
        self.tree.links.new(source, target)

    def script(self, stage: str, shader: Shader, given: tuple[str, ...] = ()) -> bpy.types.Node:
        """The node of a stage. given: sockets that are linked later on, although their default is no number."""
        name = f"{self.name} {stage}"
        if self.shading == NODES:
            # Its libraries are read only where a plain material is made.
            from ..domain.osl_graph import compile_stage
            from .plain_nodes import plain_node

            node = plain_node(self.tree, name, compile_stage(stage, shader.source, given), data_image)
        else:
            node = script_node(self.tree, name, shader.source)
        for item in shader.inputs:
            self.link(self.source(item), node.inputs[item.name])
        return node

    def base_values(self, points: bpy.types.Node) -> None:
        """The skin's own values: a slider where the table or a film can follow it, a number where it is fixed."""
        follows = {axis.id for axis in self.plan.axes} - set(skin_map.held(self.plan.scene))
        for socket, key in _BASE.items():
            if key in follows:
                self.link(self.source(ShaderInput(socket, "float", "parameter", key)), points.inputs[socket])
            else:
                points.inputs[socket].default_value = self.plan.skin[key]
        if "film" in points.outputs and "oil" not in skin_map.held(self.plan.scene):
            self.link(self.source(ShaderInput("skin_oil", "float", "parameter", "oil")), points.inputs["skin_oil"])

    def source(self, item: ShaderInput) -> bpy.types.NodeSocket:
        """The socket that carries the value of `item`."""
        at = (item.source, item.key)
        if at not in self.sources:
            self.sources[at] = getattr(self, "_from_" + item.source.replace(":", "_"))(item.key)
        return self.sources[at]

    def _from_parameter(self, key: str) -> bpy.types.NodeSocket:
        row = PARAMETERS[key]
        return self._slider(row.label, self.plan.scene.skin[key], row.hard_min, row.hard_max, row.help)

    def _from_strength(self, key: str) -> bpy.types.NodeSocket:
        effect = next(effect for effect in EFFECTS if effect.id == key)
        return self._slider(effect.label, self.plan.scene.strengths[key], 0.0, 1.0, effect.help)

    def _slider(self, label: str, value: float, low: float, high: float, help: str) -> bpy.types.NodeSocket:
        socket = self.tree.interface.new_socket(label, in_out="INPUT", socket_type="NodeSocketFloat")
        socket.min_value, socket.max_value = low, high
        socket.default_value = value
        socket.description = help
        return self.begin.outputs[label]

    def _from_object(self, key: str) -> bpy.types.NodeSocket:
        """Its color alone: Cycles looks every linked output up by itself."""
        return self._attribute("OBJECT", key).outputs["Color"]

    def _from_vertex_weight(self, key: str) -> bpy.types.NodeSocket:
        return self._attribute("GEOMETRY", key).outputs["Fac"]

    def _from_vertex(self, key: str) -> bpy.types.NodeSocket:
        return self._attribute("GEOMETRY", key).outputs["Vector"]

    def _attribute(self, kind: str, key: str) -> bpy.types.Node:
        node = self.node("ShaderNodeAttribute")
        node.attribute_type = kind
        node.attribute_name = key
        return node

    def _from_chromophores(self, key: str) -> bpy.types.NodeSocket:
        return self.points.outputs[key]

    def _from_map(self, key: str) -> bpy.types.NodeSocket:
        node = self.node("ShaderNodeTexImage")
        node.image = self.images[key]
        node.interpolation = "Linear"
        node.extension = "EXTEND"
        node.label = key
        self.sources["map", key] = node.outputs["Color"]
        self.sources["map:alpha", key] = node.outputs["Alpha"]
        return node.outputs["Color"]

    def _from_map_alpha(self, key: str) -> bpy.types.NodeSocket:
        self._from_map(key)
        return self.sources["map:alpha", key]

    def read_table(self, table: Table, points: bpy.types.Node, lobes: bpy.types.Node) -> None:
        """One Image Texture node per quantity (and slice), all on one packed image."""
        image = data_image(f"{self.name} table", table.image)
        sign_table(image, table, self.plan.skin)
        for suffix, coordinates in table_slices(table.axes).items():
            for quantity, socket in enumerate(lobe_sockets(table.lobes, suffix, table.walk)):
                shift = self.node("ShaderNodeVectorMath")
                shift.operation = "ADD"
                shift.inputs[1].default_value = (table.quantity_offset(quantity), 0.0, 0.0)
                self.link(points.outputs[coordinates], shift.inputs[0])
                node = self.node("ShaderNodeTexImage")
                node.image = image
                node.interpolation = "Linear"
                node.extension = "EXTEND"
                node.label = socket
                self.link(shift.outputs["Vector"], node.inputs["Vector"])
                self.link(node.outputs["Color"], lobes.inputs[socket])
        if TABLE_MIX in points.outputs:
            self.link(points.outputs[TABLE_MIX], lobes.inputs[TABLE_MIX])

    def unless_leaving(self, whole: bpy.types.NodeSocket, leaving: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """`whole`, but `leaving` where Cycles asks for the normal at which light leaves the skin: on a path that is no
        longer the camera's and has not bounced. A mix by 0 or 1 runs one side alone."""
        path, far, mix = (self.node(f"ShaderNode{kind}") for kind in ("LightPath", "Math", "MixShader"))
        far.operation = "ADD"
        far.use_clamp = True
        self.link(path.outputs["Is Camera Ray"], far.inputs[0])
        self.link(path.outputs["Ray Depth"], far.inputs[1])
        self.link(far.outputs[0], mix.inputs[0])
        self.link(leaving, mix.inputs[1])
        self.link(whole, mix.inputs[2])
        return mix.outputs[0]

    def arrange(self, points: bpy.types.Node, lobes: bpy.types.Node, end: bpy.types.Node) -> None:
        """Columns from left to right, so that a person can read the group."""
        points.location, lobes.location, end.location = (0, 0), (900, 0), (1200, 0)
        columns = {
            "ShaderNodeAttribute": -600, "ShaderNodeVectorMath": 300, "ShaderNodeBump": 600, "ShaderNodeNormalMap": 600,
            "ShaderNodeScript": 300,
        }
        heights: dict[int, int] = {}
        self.begin.location = (-600, 500)
        for node in self.tree.nodes:
            if node in (points, lobes, end, self.begin):
                continue
            if node.bl_idname == "ShaderNodeTexImage":
                x = 550 if node.inputs["Vector"].is_linked else -300
            else:
                x = columns.get(node.bl_idname, 300)
            y = heights.get(x, 0)
            node.hide = True
            node.location = (x, y)
            heights[x] = y - 60
