"""A graph of operations on numbers, vectors and closures: what a stage of the shader computes, apart from how it is
written (`osl_graph.py` reads it from OSL) and from what runs it (`blender/plain_nodes.py` makes nodes of it)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .errors import InputError
from .head.surface import smoothstep


class Untranslatable(InputError):
    """OSL that has no plain nodes."""


@dataclass(frozen=True, eq=False)
class Op:
    """One operation. Equal operations of a graph are the same object.

    kind: "const" (value: a number, or three), "input" (value: its name), "normal", "incident" (toward the surface), a key of
    `FUNCTIONS`, "lookup" (value: the table; argument: the index), "noise" (signed Perlin of a place), or a closure: "bssrdf" or
    "dielectric_bsdf" (value: its texts, the names of its last arguments behind). type: "float", "int", "vector" or "closure". name: of an OSL variable that holds it.
    """

    kind: str
    type: str
    args: tuple[Op, ...] = ()
    value: Any = None
    name: str = field(default="", compare=False)


@dataclass(frozen=True)
class Closure:
    """A sum of closures, each with its weight, a float or a vector."""

    terms: tuple[tuple[Op, Op], ...]


@dataclass(frozen=True)
class Port:
    """An input or output of a stage. type: as OSL names it. default: a number, or three; of inputs alone."""

    name: str
    type: str
    default: float | tuple[float, ...] | None = None


@dataclass(frozen=True)
class Graph:
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    results: Mapping[str, Op | Closure]

    def ops(self, closures: bool = True) -> list[Op]:
        """Every operation that an output needs, each after those that it needs. closures: outputs that are such too."""
        found: dict[Op, None] = {}

        def visit(op: Op) -> None:
            if op not in found:
                for arg in op.args:
                    visit(arg)
                found[op] = None

        for result in self.results.values():
            if isinstance(result, Op):
                visit(result)
            elif closures:
                for op in (part for term in result.terms for part in term):
                    visit(op)
        return list(found)


def _safe_divide(a: Any, b: Any) -> Any:
    """As OSL and Cycles divide: by 0 gives 0."""
    b = np.asarray(b, dtype=float)
    return np.where(b == 0.0, 0.0, np.asarray(a, dtype=float) / np.where(b == 0.0, 1.0, b))


def _normalize(v: Any) -> Any:
    return _safe_divide(v, np.linalg.norm(v, axis=-1, keepdims=True))


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "add": np.add, "sub": np.subtract, "mul": np.multiply, "div": _safe_divide,
    "min": np.minimum, "max": np.maximum, "mod": lambda a, b: np.where(b == 0.0, 0.0, np.fmod(a, np.where(b == 0.0, 1.0, b))),
    "pow": lambda a, b: np.where((a < 0.0) & (b != np.floor(b)), 0.0, np.power(np.abs(a), b) * np.where((a < 0.0) & (b % 2 == 1), -1, 1)),
    "less": lambda a, b: np.less(a, b).astype(float),
    "equal": lambda a, b: np.equal(a, b).astype(float),
    "abs": np.abs, "floor": np.floor, "ceil": np.ceil, "trunc": np.trunc,
    "exp": np.exp, "log": lambda a: np.log(np.maximum(a, 1e-37)), "sqrt": lambda a: np.sqrt(np.maximum(a, 0.0)),
    "sin": np.sin, "cos": np.cos, "tan": np.tan,
    "clamp": lambda x, low, high: np.minimum(np.maximum(x, low), high),
    "mix": lambda a, b, t: a * (1.0 - t) + b * t,
    "smoothstep": smoothstep,
    "select": lambda c, a, b: np.where(c != 0.0, a, b),
    # Of vectors: the last axis has their three numbers.
    "scale": lambda v, f: v * np.asarray(f)[..., None],
    "splat": lambda f: np.repeat(np.asarray(f, dtype=float)[..., None], 3, axis=-1),
    "pack": lambda x, y, z: np.stack(np.broadcast_arrays(x, y, z), axis=-1),
    "x": lambda v: v[..., 0], "y": lambda v: v[..., 1], "z": lambda v: v[..., 2],
    "dot": lambda a, b: np.sum(a * b, axis=-1),
    "cross": np.cross,
    "length": lambda v: np.linalg.norm(v, axis=-1),
    "normalize": _normalize,
}
"""Operation -> what it computes, on numbers and arrays."""


def evaluate(
    graph: Graph, inputs: Mapping[str, Any], noise: Callable[[np.ndarray], np.ndarray] | None = None
) -> dict[str, np.ndarray]:
    """Numbers of the outputs that are no closures, for arrays of inputs (vectors: (..., 3)); defaults for those left out."""
    known: dict[Op, Any] = {}
    defaults = {port.name: port.default for port in graph.inputs}
    for op in graph.ops(closures=False):
        args = [known[arg] for arg in op.args]
        if op.kind == "const":
            known[op] = np.asarray(op.value, dtype=float)
        elif op.kind == "input":
            known[op] = np.asarray(inputs.get(op.value, defaults[op.value]), dtype=float)
        elif op.kind == "lookup":
            known[op] = np.asarray(op.value)[np.clip(args[0].astype(int), 0, len(op.value) - 1)]
        elif op.kind == "noise" and noise is not None:
            known[op] = noise(args[0])
        elif op.kind in FUNCTIONS:
            known[op] = FUNCTIONS[op.kind](*args)
        else:
            raise ValueError(f"{op.kind}: no number without a renderer")
    return {name: known[result] for name, result in graph.results.items() if isinstance(result, Op)}
