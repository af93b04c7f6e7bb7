"""A stage's graph (`domain/op_graph.py`) as ordinary nodes, in a node group that has the sockets of its OSL script."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import bpy
import numpy as np

from ..domain.op_graph import Closure, Graph, Op, Untranslatable

# Operation -> that of the Math node, of the Vector Math node.
_MATH = {
    "add": "ADD", "sub": "SUBTRACT", "mul": "MULTIPLY", "div": "DIVIDE", "min": "MINIMUM", "max": "MAXIMUM", "mod": "MODULO",
    "pow": "POWER", "less": "LESS_THAN", "equal": "COMPARE", "abs": "ABSOLUTE", "floor": "FLOOR", "ceil": "CEIL",
    "trunc": "TRUNC", "exp": "EXPONENT", "log": "LOGARITHM", "sqrt": "SQRT", "sin": "SINE", "cos": "COSINE", "tan": "TANGENT",
}
_VECTOR_MATH = {
    "add": "ADD", "sub": "SUBTRACT", "mul": "MULTIPLY", "div": "DIVIDE", "min": "MINIMUM", "max": "MAXIMUM", "mod": "MODULO",
    "abs": "ABSOLUTE", "floor": "FLOOR", "ceil": "CEIL", "sin": "SINE", "cos": "COSINE", "tan": "TANGENT", "scale": "SCALE",
    "dot": "DOT_PRODUCT", "cross": "CROSS_PRODUCT", "length": "LENGTH", "normalize": "NORMALIZE",
}
_SOCKETS = {
    "float": "NodeSocketFloat", "int": "NodeSocketFloat", "color": "NodeSocketColor", "vector": "NodeSocketVector",
    "normal": "NodeSocketVector", "point": "NodeSocketVector", "closure color": "NodeSocketShader",
}
_AXES = ("x", "y", "z")
_E = 2.718281828459045
# Named argument of a walk -> socket.
_WALK = {"ior": "IOR", "anisotropy": "Anisotropy"}
# Entries of a table that one texel holds: red, green, blue, alpha.
_PER_TEXEL = 4
_STEP_X, _STEP_Y = 200, 44

Table = Callable[[str, np.ndarray], bpy.types.Image]
"""Makes an image of numbers, (1, width, channels), by name."""


def plain_node(tree: bpy.types.NodeTree, name: str, graph: Graph, data_image: Table) -> bpy.types.Node:
    """A group node that computes what the OSL of `graph` does. Raises Untranslatable for what Blender has no node for."""
    group = bpy.data.node_groups.new(name, "ShaderNodeTree")
    try:
        _Emitter(name, group, graph, data_image).emit()
    except BaseException:
        bpy.data.node_groups.remove(group)
        raise
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    node.name = node.label = name
    return node


class _Emitter:
    def __init__(self, name: str, tree: bpy.types.NodeTree, graph: Graph, data_image: Table) -> None:
        self.name, self.tree, self.graph, self.data_image = name, tree, graph, data_image
        self.begin = tree.nodes.new("NodeGroupInput")
        self.sockets: dict[Op, bpy.types.NodeSocket] = {}
        self.split: dict[Op, bpy.types.Node] = {}
        self.images: dict[tuple, bpy.types.Image] = {}
        self.column: dict[str, int] = {self.begin.name: 0}
        ops = graph.ops()
        self.uses = Counter(arg for op in ops for arg in op.args)
        for result in graph.results.values():
            for op in (part for term in result.terms for part in term) if isinstance(result, Closure) else (result,):
                self.uses[op] += 1
        self.lookups = [op for op in ops if op.kind == "lookup"]

    def emit(self) -> None:
        face = self.tree.interface
        for port in self.graph.inputs:
            socket = face.new_socket(port.name, in_out="INPUT", socket_type=_SOCKETS[port.type])
            if port.type == "color":
                value = port.default if isinstance(port.default, tuple) else (port.default,) * 3
                socket.default_value = (*value, 1.0)
            else:
                socket.default_value = port.default
        end = self.tree.nodes.new("NodeGroupOutput")
        for port in self.graph.outputs:
            face.new_socket(port.name, in_out="OUTPUT", socket_type=_SOCKETS[port.type])
            result = self.graph.results[port.name]
            if isinstance(result, Closure):
                if (shader := self.closure(result)) is not None:
                    self.tree.links.new(shader, end.inputs[port.name])
            else:
                self.put(result, end.inputs[port.name])
        self.arrange(end)

    # -- values --------------------------------------------------------------------------------------------------------

    def put(self, op: Op, target: bpy.types.NodeSocket) -> None:
        """Gives an input the value of `op`."""
        if op.kind == "splat":
            op = op.args[0]  # Blender gives a number to all three
        if op.kind != "const":
            self.tree.links.new(self.socket(op), target)
            return
        value = op.value
        if target.type == "VALUE":
            target.default_value = value
        else:
            value = value if isinstance(value, tuple) else (value,) * 3
            target.default_value = (*value, 1.0) if target.type == "RGBA" else value

    def node(self, kind: str, operation: str | None = None, label: str = "") -> bpy.types.Node:
        node = self.tree.nodes.new(kind)
        if operation is not None:
            node.operation = operation
        node.label = label
        return node

    def socket(self, op: Op) -> bpy.types.NodeSocket:
        """The socket that carries a value; its node is made once."""
        if op not in self.sockets:
            make = getattr(self, f"_make_{op.kind}", None)
            if make is not None:
                self.sockets[op] = make(op)
            elif op.type == "vector" or op.kind in ("dot", "length"):
                self.sockets[op] = self.vector_math(op)
            else:
                self.sockets[op] = self.math(op)
        return self.sockets[op]

    def math(self, op: Op) -> bpy.types.NodeSocket:
        if op.kind not in _MATH:
            raise self.missing(op)
        if op.kind == "add" and (product := self.only_product(op)) is not None:
            node = self.node("ShaderNodeMath", "MULTIPLY_ADD", op.name)
            args = (*product.args, op.args[1] if op.args[0] is product else op.args[0])
        else:
            node = self.node("ShaderNodeMath", _MATH[op.kind], op.name)
            args = op.args
        for arg, target in zip(args, node.inputs, strict=False):
            self.put(arg, target)
        if op.kind == "log":
            node.inputs[1].default_value = _E
        elif op.kind == "equal":
            node.inputs[2].default_value = 0.0
        return node.outputs[0]

    def only_product(self, op: Op) -> Op | None:
        """An argument of a sum that is a product of the same type and needed nowhere else."""
        return next(
            (arg for arg in op.args if arg.kind == "mul" and arg.type in ("float", "int") and self.uses[arg] == 1), None
        )

    def vector_math(self, op: Op) -> bpy.types.NodeSocket:
        if op.kind in ("exp", "log", "sqrt", "pow"):
            parts = self.node("ShaderNodeCombineXYZ", label=op.name)
            for i, target in enumerate(parts.inputs):
                one = self.node("ShaderNodeMath", _MATH[op.kind])
                for arg, to in zip(op.args, one.inputs, strict=False):
                    self.tree.links.new(self.component(arg, i), to)
                if op.kind == "log":
                    one.inputs[1].default_value = _E
                self.tree.links.new(one.outputs[0], target)
            return parts.outputs[0]
        if op.kind not in _VECTOR_MATH:
            raise self.missing(op)
        node = self.node("ShaderNodeVectorMath", _VECTOR_MATH[op.kind], op.name)
        targets = (node.inputs[0], node.inputs["Scale"]) if op.kind == "scale" else node.inputs
        for arg, target in zip(op.args, targets, strict=False):
            self.put(arg, target)
        return node.outputs["Value" if op.type != "vector" else "Vector"]

    def component(self, op: Op, i: int) -> bpy.types.NodeSocket:
        if op not in self.split:
            self.split[op] = self.node("ShaderNodeSeparateXYZ", label=op.name)
            self.put(op, self.split[op].inputs[0])
        return self.split[op].outputs[i]

    def _make_const(self, op: Op) -> bpy.types.NodeSocket:
        socket = self.node("ShaderNodeValue").outputs[0]
        socket.default_value = op.value
        return socket

    def _make_input(self, op: Op) -> bpy.types.NodeSocket:
        return self.begin.outputs[op.value]

    def _make_normal(self, _op: Op) -> bpy.types.NodeSocket:
        return self.node("ShaderNodeNewGeometry").outputs["Normal"]

    def _make_incident(self, _op: Op) -> bpy.types.NodeSocket:
        node = self.node("ShaderNodeVectorMath", "SCALE", "incident")
        self.tree.links.new(self.node("ShaderNodeNewGeometry").outputs["Incoming"], node.inputs[0])
        node.inputs["Scale"].default_value = -1.0  # Blender's points to the eye, OSL's to the surface
        return node.outputs[0]

    def _make_x(self, op: Op) -> bpy.types.NodeSocket:
        return self.component(op.args[0], _AXES.index(op.kind))

    _make_y = _make_z = _make_x

    def _make_pack(self, op: Op) -> bpy.types.NodeSocket:
        node = self.node("ShaderNodeCombineXYZ", label=op.name)
        for arg, target in zip(op.args, node.inputs, strict=True):
            self.put(arg, target)
        return node.outputs[0]

    def _make_splat(self, op: Op) -> bpy.types.NodeSocket:
        return self.socket(op.args[0])

    def _make_mix(self, op: Op) -> bpy.types.NodeSocket:
        vector = op.type == "vector"
        node = self.node("ShaderNodeMix", label=op.name)
        node.data_type = "VECTOR" if vector else "FLOAT"
        node.clamp_factor = False
        kind = "Vector" if vector else "Float"
        inputs = {socket.identifier: socket for socket in node.inputs}
        for arg, name in zip(op.args, (f"A_{kind}", f"B_{kind}", "Factor_Float"), strict=True):
            self.put(arg, inputs[name])
        return next(socket for socket in node.outputs if socket.identifier == f"Result_{kind}")

    def _make_select(self, op: Op) -> bpy.types.NodeSocket:
        condition, then, otherwise = op.args
        if not (condition.kind in ("less", "equal") or self.is_flag(condition)):
            raise self.missing(op)
        return self._make_mix(Op("mix", op.type, (otherwise, then, condition), name=op.name))

    def is_flag(self, op: Op) -> bool:
        """Whether it is 0 or 1."""
        if op.kind in ("less", "equal"):
            return True
        if op.kind in ("min", "max"):
            return all(self.is_flag(arg) for arg in op.args)
        return op.kind == "sub" and op.args[0].kind == "const" and op.args[0].value == 1.0 and self.is_flag(op.args[1])

    def _make_clamp(self, op: Op) -> bpy.types.NodeSocket:
        value, low, high = op.args
        if op.type == "vector":
            node = self.node("ShaderNodeVectorMath", "MAXIMUM")
            last = self.node("ShaderNodeVectorMath", "MINIMUM", op.name)
            self.put(value, node.inputs[0])
            self.put(low, node.inputs[1])
            self.tree.links.new(node.outputs[0], last.inputs[0])
            self.put(high, last.inputs[1])
            return last.outputs[0]
        node = self.node("ShaderNodeClamp", label=op.name)
        for arg, target in zip(op.args, ("Value", "Min", "Max"), strict=True):
            self.put(arg, node.inputs[target])
        return node.outputs[0]

    def _make_smoothstep(self, op: Op) -> bpy.types.NodeSocket:
        node = self.node("ShaderNodeMapRange", label=op.name)
        node.interpolation_type = "SMOOTHSTEP"
        for arg, target in zip(op.args, ("From Min", "From Max", "Value"), strict=True):
            self.put(arg, node.inputs[target])
        return node.outputs["Result"]

    def _make_noise(self, op: Op) -> bpy.types.NodeSocket:
        """One octave, not normalised: the signed Perlin noise that OSL's is too."""
        node = self.node("ShaderNodeTexNoise", label=op.name)
        node.noise_dimensions, node.noise_type, node.normalize = "3D", "FBM", False
        place = op.args[0]
        scale = None
        if place.kind == "scale":
            place, scale = place.args
        self.put(place, node.inputs["Vector"])
        values = {"Scale": 1.0, "Detail": 0.0, "Roughness": 0.0, "Lacunarity": 1.0, "Distortion": 0.0}
        for key, value in values.items():
            node.inputs[key].default_value = value
        if scale is not None:
            self.put(scale, node.inputs["Scale"])
        return node.outputs[0]

    def _make_lookup(self, op: Op) -> bpy.types.NodeSocket:
        """From an image of one row. What is read at the same place up to a constant stands in one texel."""
        base, _ = _place(op)
        together = [other for other in self.lookups if other.value == op.value and _place(other)[0] is base]
        shifts = list(dict.fromkeys(_place(other)[1] for other in together))
        for first in range(0, len(shifts), _PER_TEXEL):
            mine = shifts[first : first + _PER_TEXEL]
            node = self.table(op.value, base, mine)
            colour = None
            for other in together:
                if (shift := _place(other)[1]) in mine:
                    channel = mine.index(shift)
                    if channel == 3:
                        self.sockets[other] = node.outputs["Alpha"]
                        continue
                    if colour is None:
                        colour = self.node("ShaderNodeSeparateXYZ")
                        self.tree.links.new(node.outputs["Color"], colour.inputs[0])
                    self.sockets[other] = colour.outputs[channel]
        return self.sockets[op]

    def table(self, values: tuple[float, ...], base: Op, shifts: list[int]) -> bpy.types.Node:
        count = len(values)
        texels = np.ones((1, count, _PER_TEXEL), dtype=np.float32)
        for channel, shift in enumerate(shifts):
            texels[0, :, channel] = np.asarray(values)[np.clip(np.arange(count) + shift, 0, count - 1)]
        place = self.node("ShaderNodeMath", "MULTIPLY_ADD", "texel")
        self.put(base, place.inputs[0])
        place.inputs[1].default_value, place.inputs[2].default_value = 1.0 / count, 0.5 / count
        where = self.node("ShaderNodeCombineXYZ")
        self.tree.links.new(place.outputs[0], where.inputs[0])
        where.inputs[1].default_value = 0.5
        node = self.node("ShaderNodeTexImage", label="table")
        node.image = self.data_image(f"{self.name} numbers", texels)
        node.interpolation, node.extension = "Closest", "EXTEND"
        self.tree.links.new(where.outputs[0], node.inputs["Vector"])
        return node

    # -- closures ------------------------------------------------------------------------------------------------------

    def closure(self, closure: Closure) -> bpy.types.NodeSocket | None:
        total = None
        for weight, leaf in closure.terms:
            total = self.sum(total, getattr(self, f"_shade_{leaf.kind}")(weight, leaf))
        return total

    def _shade_bssrdf(self, weight: Op, leaf: Op) -> bpy.types.NodeSocket:
        (method, *names), (normal, radius, albedo, *named) = leaf.value, leaf.args
        methods = {"burley": "BURLEY", "random_walk": "RANDOM_WALK", "random_walk_skin": "RANDOM_WALK_SKIN"}
        if method not in methods:
            raise Untranslatable(f"{self.name}: bssrdf of '{method}': a plain node has {', '.join(methods)}")
        if unknown := set(names) - set(_WALK):
            raise Untranslatable(f"{self.name}: bssrdf with '{unknown.pop()}': a plain node has {', '.join(_WALK)}")

        def node() -> bpy.types.Node:
            made = self.node("ShaderNodeSubsurfaceScattering", label="light under the skin")
            made.falloff = methods[method]
            made.inputs["Scale"].default_value = 1.0
            self.put(radius, made.inputs["Radius"])
            self.put_normal(normal, made)
            for name, value in zip(names, named, strict=True):
                self.put(value, made.inputs[_WALK[name]])
            return made

        # Burley's profile does not ask for the albedo, so its colour is the weight. A walk's colour is its albedo.
        if method == "burley":
            lobe = node()
            self.put(weight, lobe.inputs["Color"])
            return lobe.outputs[0]
        numbers, colours = _factors(weight)
        if albedo not in colours:
            raise Untranslatable(f"{self.name}: bssrdf of '{method}': its weight has to be its albedo, times whatever else")
        colours.remove(albedo)
        share = self.product([self.socket(number) for number in numbers])
        if not colours:
            walk = node()
            self.put(albedo, walk.inputs["Color"])
            return self.mixed(share, walk.outputs[0])
        # A closure can be given a share, but no share by channel: so each channel walks for itself.
        total = None
        for i in range(3):
            walk, alone = node(), self.node("ShaderNodeCombineXYZ", label="one channel")
            self.tree.links.new(self.component(albedo, i), alone.inputs[i])
            self.tree.links.new(alone.outputs[0], walk.inputs["Color"])
            mine = [*([share] if share is not None else []), *(self.component(colour, i) for colour in colours)]
            total = self.sum(total, self.mixed(self.product(mine), walk.outputs[0]))
        return total

    def product(self, sockets: list[bpy.types.NodeSocket]) -> bpy.types.NodeSocket | None:
        """Of numbers; None of none."""
        total = None
        for socket in sockets:
            if total is not None:
                node = self.node("ShaderNodeMath", "MULTIPLY")
                self.tree.links.new(total, node.inputs[0])
                self.tree.links.new(socket, node.inputs[1])
                socket = node.outputs[0]
            total = socket
        return total

    def sum(self, total: bpy.types.NodeSocket | None, shader: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        if total is None:
            return shader
        both = self.node("ShaderNodeAddShader")
        self.tree.links.new(total, both.inputs[0])
        self.tree.links.new(shader, both.inputs[1])
        return both.outputs[0]

    def mixed(self, share: bpy.types.NodeSocket | None, shader: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """A closure times a number from 0 to 1."""
        if share is None:
            return shader
        node = self.node("ShaderNodeMixShader")
        self.tree.links.new(share, node.inputs[0])
        self.tree.links.new(shader, node.inputs[2])
        return node.outputs[0]

    def _shade_dielectric_bsdf(self, weight: Op, leaf: Op) -> bpy.types.NodeSocket:
        """A reflection with a dielectric's own Fresnel curve: a Principled BSDF that has nothing below it."""
        normal, _tangent, reflect, transmit, roughness, other_roughness, ior = leaf.args[:7]
        white, black = (op.kind == "const" and set(op.value) == {v} for op, v in ((reflect, 1.0), (transmit, 0.0)))
        if not (white and black and roughness is other_roughness and leaf.value == ("ggx",) and weight.type != "vector"):
            raise Untranslatable(f"{self.name}: dielectric_bsdf: plain nodes have it white, reflecting alone, isotropic, ggx")
        node = self.node("ShaderNodeBsdfPrincipled", label="film")
        node.distribution = "GGX"
        node.inputs["Base Color"].default_value = (0.0, 0.0, 0.0, 1.0)
        self.put(ior, node.inputs["IOR"])
        root = self.node("ShaderNodeMath", "SQRT", "roughness")  # OSL's is the width of the facets' slopes
        self.put(roughness, root.inputs[0])
        self.tree.links.new(root.outputs[0], node.inputs["Roughness"])
        self.put_normal(normal, node)
        if weight.kind == "const":
            if weight.value == 1.0:
                return node.outputs[0]
            raise Untranslatable(f"{self.name}: dielectric_bsdf times a constant")
        return self.mixed(self.socket(weight), node.outputs[0])

    def put_normal(self, normal: Op, node: bpy.types.Node) -> None:
        if normal.kind != "normal":
            self.put(normal, node.inputs["Normal"])

    def missing(self, op: Op) -> Untranslatable:
        return Untranslatable(f"{self.name}: {op.kind} of {'vectors' if op.type == 'vector' else 'numbers'}: there is no node for it")

    # -- order for people ------------------------------------------------------------------------------------------------

    def arrange(self, end: bpy.types.Node) -> None:
        """Columns by how many nodes stand before one, so that a person can follow the links."""
        before: dict[str, set[str]] = {node.name: set() for node in self.tree.nodes}
        for link in self.tree.links:
            before[link.to_node.name].add(link.from_node.name)
        depth: dict[str, int] = {}

        def depth_of(name: str) -> int:
            if name not in depth:
                depth[name] = 1 + max((depth_of(other) for other in before[name]), default=-1)
            return depth[name]

        rows: Counter[int] = Counter()
        for node in self.tree.nodes:
            x = depth_of(node.name)
            node.location = (_STEP_X * x, -_STEP_Y * rows[x])
            node.hide = node not in (self.begin, end)
            rows[x] += 1


def _factors(weight: Op) -> tuple[list[Op], list[Op]]:
    """A product as numbers and colours."""
    if weight.kind == "scale":
        numbers, colours = _factors(weight.args[0])
        return [*numbers, weight.args[1]], colours
    if weight.kind == "mul" and weight.type == "vector":
        parts = [_factors(arg) for arg in weight.args]
        return [n for numbers, _ in parts for n in numbers], [c for _, colours in parts for c in colours]
    return ([], [weight]) if weight.type == "vector" else ([weight], [])


def _place(lookup: Op) -> tuple[Op, int]:
    """The index of a lookup as a value plus a constant."""
    (index,) = lookup.args
    if index.kind == "add" and index.args[1].kind == "const":
        return index.args[0], int(index.args[1].value)
    return index, 0
