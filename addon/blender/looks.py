"""The looks of everything on a head that is not skin: eyes, mouth, lashes, brows, hair. Plain nodes, no OSL."""

from __future__ import annotations

from typing import Any

import bpy

from ..domain.head.eyes import LIMBUS_UV
from ..domain.head.presets import Preset
from .colour import from_rec709

RGB = tuple[float, float, float]


class Nodes:
    """A material's node tree, written as expressions: each call adds a node and returns its first output."""

    def __init__(self, name: str):
        self.material = bpy.data.materials.new(name)
        if not self.material.node_tree:  # 5.x makes the tree with the material and deprecates the switch
            self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.tree.nodes.clear()

    def add(self, kind: str, *values: Any, settings: dict[str, Any] | None = None, **inputs: Any) -> Any:
        node = self.tree.nodes.new(kind)
        for key, value in (settings or {}).items():
            setattr(node, key, value)
        named = [(node.inputs[k], v) for k, v in enumerate(values)] + [(node.inputs[k], v) for k, v in inputs.items()]
        for socket, value in named:
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, socket)
            elif value is not None:
                socket.default_value = (*from_rec709(value), 1.0) if socket.type == "RGBA" else value
        return next(socket for socket in node.outputs if socket.enabled)

    def math(self, operation: str, *values: Any) -> Any:
        return self.add("ShaderNodeMath", *values, settings={"operation": operation})

    def step(self, low: float, high: float, value: Any, out: tuple[float, float] = (0.0, 1.0)) -> Any:
        """Smooth step of `value` from out[0] below `low` to out[1] above `high`."""
        return self.add("ShaderNodeMapRange", value, low, high, *out, settings={"interpolation_type": "SMOOTHSTEP"})

    def mix(self, factor: Any, a: Any, b: Any, blend: str = "MIX") -> Any:
        node = self.tree.nodes.new("ShaderNodeMix")
        node.data_type, node.blend_type = "RGBA", blend
        sockets = {s.identifier: s for s in node.inputs}
        for identifier, value in (("Factor_Float", factor), ("A_Color", a), ("B_Color", b)):
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, sockets[identifier])
            else:
                sockets[identifier].default_value = value if identifier == "Factor_Float" else (*from_rec709(value), 1.0)
        return next(s for s in node.outputs if s.identifier == "Result_Color")

    def noise(self, vector: Any, scale: float, detail: float = 2.0, roughness: float = 0.5) -> Any:
        return self.add("ShaderNodeTexNoise", Vector=vector, Scale=scale, Detail=detail, Roughness=roughness)

    def surface(self, shader: Any) -> bpy.types.Material:
        self.tree.links.new(shader, self.tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
        return self.material

    def principled(self, **inputs: Any) -> bpy.types.Material:
        return self.surface(self.add("ShaderNodeBsdfPrincipled", **{k.replace("_", " "): v for k, v in inputs.items()}))


def eye(name: str, preset: Preset) -> bpy.types.Material:
    """Pupil, iris and sclera in polar coordinates about the optical axis (the eye's azimuthal UV map)."""
    n = Nodes(name)
    uv = n.add("ShaderNodeUVMap")
    centred = n.add("ShaderNodeVectorMath", uv, (-0.5, -0.5, 0.0), settings={"operation": "ADD"})
    polar = n.add("ShaderNodeVectorMath", centred, settings={"operation": "SCALE"}, Scale=1 / LIMBUS_UV)
    length = n.tree.nodes.new("ShaderNodeVectorMath")
    length.operation = "LENGTH"
    n.tree.links.new(polar, length.inputs[0])
    r = length.outputs["Value"]  # 0 in the pupil's middle, 1 at the limbus
    direction = n.add("ShaderNodeVectorMath", polar, settings={"operation": "NORMALIZE"})

    # Fibres: noise that varies fast round the iris and slowly along the radius.
    depth = n.add("ShaderNodeCombineXYZ", 0.0, 0.0, n.math("MULTIPLY", r, 0.22))
    spokes = n.add("ShaderNodeVectorMath", direction, depth, settings={"operation": "ADD"})
    fibre = n.step(0.35, 0.68, n.noise(spokes, 13.0, 3.0, 0.6), out=(0.35, 1.5))
    crypt = n.step(0.5, 0.68, n.noise(polar, 3.4, 2.0), out=(1.0, 0.6))
    wobble = n.math("ADD", r, n.math("MULTIPLY_ADD", n.noise(direction, 5.0), 0.24, -0.12))
    stroma = n.mix(n.step(preset.eyes.pupil, 0.74, wobble), preset.eyes.collarette, preset.eyes.iris)
    shade = n.math("MULTIPLY", n.math("MULTIPLY", fibre, crypt), n.step(0.74, 1.0, r, out=(1.0, 0.12)))
    iris = n.mix(1.0, stroma, n.add("ShaderNodeCombineColor", shade, shade, shade), "MULTIPLY")
    iris = n.mix(n.step(preset.eyes.pupil - 0.03, preset.eyes.pupil + 0.03, r), (0.001, 0.001, 0.001), iris)

    # Sclera: warm white, pinker toward the corners, with fine vessels that thin out toward the cornea.
    swirl = n.add("ShaderNodeVectorMath", polar, n.noise(polar, 1.6, 2.0), settings={"operation": "ADD"})
    ridge = n.math("ABSOLUTE", n.math("SUBTRACT", n.noise(swirl, 2.3, 4.0, 0.55), 0.5))
    vessel = n.math("MULTIPLY", n.step(0.0, 0.018, ridge, out=(0.5, 0.0)), n.step(1.15, 2.4, r))
    white = n.mix(n.step(1.2, 3.0, r), (0.70, 0.66, 0.61), (0.60, 0.40, 0.35))
    white = n.mix(vessel, white, (0.42, 0.10, 0.075))
    color = n.mix(n.step(0.93, 1.09, r), iris, white)
    return n.principled(Base_Color=color, Roughness=0.55, Specular_IOR_Level=0.1)


def cornea(name: str) -> bpy.types.Material:
    """The wet film: clear, with a mirror at its Fresnel share. Light passes straight through, so no dark caustics."""
    n = Nodes(name)
    fresnel = n.add("ShaderNodeFresnel", IOR=1.376)
    clear = n.add("ShaderNodeBsdfTransparent")
    mirror = n.add("ShaderNodeBsdfAnisotropic", Color=(1, 1, 1), Roughness=0.03)
    return n.surface(n.add("ShaderNodeMixShader", fresnel, clear, mirror))


def _wet(
    name: str, color: RGB, roughness: float = 0.25, radius: RGB = (1.0, 0.35, 0.2), scale_m: float = 0.002
) -> bpy.types.Material:
    """Soft tissue under saliva."""
    return Nodes(name).principled(
        Base_Color=color,
        Roughness=roughness,
        Subsurface_Weight=0.6,
        Subsurface_Radius=radius,
        Subsurface_Scale=scale_m,
        Coat_Weight=0.4,
        Coat_Roughness=0.12,
    )


def _fibre(name: str, color: RGB) -> bpy.types.Material:
    return Nodes(name).principled(Base_Color=color, Roughness=0.5, Specular_IOR_Level=0.12)


def _hair(name: str, melanin: float, redness: float) -> bpy.types.Material:
    n = Nodes(name)
    inputs = {
        "Melanin": melanin,
        "Melanin Redness": redness,
        "Roughness": 0.42,
        "Radial Roughness": 0.6,
        "Random Color": 0.15,
        "IOR": 1.38,  # below keratin's 1.55: what a coat of this few, thick hairs may mirror before it looks grey
    }
    return n.surface(n.add("ShaderNodeBsdfHairPrincipled", settings={"parametrization": "MELANIN"}, **inputs))


def undercoat(name: str, color: RGB) -> bpy.types.Material:
    """The shade between the hairs: as opaque as hair is dense, which the part's UV map holds in u."""
    n = Nodes(name)
    density = n.add("ShaderNodeSeparateXYZ", n.add("ShaderNodeUVMap"))
    clear = n.add("ShaderNodeBsdfTransparent")
    shade = n.add("ShaderNodeBsdfDiffuse", color)
    return n.surface(n.add("ShaderNodeMixShader", n.math("MULTIPLY", density, 0.85), clear, shade))


def looks(preset: Preset) -> dict[str, bpy.types.Material]:
    """A material for every slot of a head but the skin's."""
    name = f"{preset.id}_{{}}".format
    return {
        "eye": eye(name("eye"), preset),
        "cornea": cornea(name("cornea")),
        "teeth": _wet(name("teeth"), (0.72, 0.65, 0.54), 0.3, (1.0, 0.8, 0.6), 0.001),
        "gum": _wet(name("gum"), (0.42, 0.13, 0.12)),
        "tongue": _wet(name("tongue"), (0.40, 0.13, 0.12), 0.4),
        "mouth": _wet(name("mouth"), (0.30, 0.07, 0.06)),
        "lashes": _fibre(name("lashes"), (0.012, 0.008, 0.006)),
        "brows": _fibre(name("brows"), preset.brows.color),
        "undercoat": undercoat(name("undercoat"), preset.brows.color),
        "hair": _hair(name("hair"), preset.hair.melanin, preset.hair.redness),
    }
