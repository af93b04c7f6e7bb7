"""What a skin's material is made of: OSL scripts, or the plain nodes that they compile to; and which of the two serves."""

from __future__ import annotations

from dataclasses import dataclass

from .errors import InputError, nearest

AUTO, OSL, NODES = "AUTO", "OSL", "NODES"
SHADINGS = (AUTO, OSL, NODES)

CYCLES = "CYCLES"
EEVEE = ("BLENDER_EEVEE", "BLENDER_EEVEE_NEXT")
"""It has had two names."""
EEVEE_PROPERTIES = 8
"""Properties of an object that EEVEE hands to a material (GPU_MAX_UNIFORM_ATTR in Blender's source, the same since 3.0);
the others it takes for 0, without a word."""
# Devices of Cycles that run OSL, as its preferences name them.
_RUN_OSL = ("CPU", "OPTIX")


@dataclass(frozen=True)
class Renderer:
    """Facts about a Blender. engine: as the scene names it. no_osl: why its Cycles runs no OSL, "" where it does.
    device: "CPU", or the kind of GPU that the scene is rendered on."""

    engine: str = CYCLES
    no_osl: str = ""
    device: str = "CPU"


@dataclass(frozen=True)
class Choice:
    """OSL or NODES, and why."""

    shading: str
    because: str

    @property
    def line(self) -> str:
        return f"made of {'OSL' if self.shading == OSL else 'plain nodes'}: {self.because}"


def choose(wanted: str, renderer: Renderer) -> Choice:
    """Raises InputError where OSL is wanted and cannot be."""
    if wanted not in SHADINGS:
        raise InputError(f"material: no such kind '{wanted}', {nearest(wanted, SHADINGS)}")
    if wanted == OSL and renderer.no_osl:
        raise InputError(f"material is OSL, but {renderer.no_osl}; AUTO and NODES work here")
    if wanted != AUTO:
        return Choice(wanted, "asked for")
    return Choice(NODES, "the picture that OSL gives, in less time and on every device (docs/twins.md)")


def not_shown(shading: str, renderer: Renderer, properties: int = 0) -> str:
    """Why this Blender does not show a skin of this kind, a line for people, "" where it does. properties: how many of
    the object's its material reads."""
    if shading == NODES:
        if renderer.engine in EEVEE and properties > EEVEE_PROPERTIES:
            return f"EEVEE reads {EEVEE_PROPERTIES} of {properties} values: bake to plain"
        return "" if renderer.engine in (CYCLES, *EEVEE) else "Only Cycles and EEVEE show the skin:"
    if renderer.engine != CYCLES:
        return "Only Cycles shows a skin of OSL:"
    if renderer.no_osl:
        return "The skin is OSL, not to be had here: apply it again"
    if renderer.device not in _RUN_OSL:
        return f"No OSL on {renderer.device}: apply the skin as plain nodes"
    return ""
