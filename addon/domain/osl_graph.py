"""The OSL of a stage read as a graph of operations (`op_graph.py`), from which plain nodes are made.

The text is what `shader.assemble` gives. `pcpp` does its preprocessing, `lark` reads it by the grammar below, and
running it once on symbols instead of numbers leaves the graph: functions inlined, loops unrolled, constants folded, equal
operations shared, what no output needs never reached. A closure is kept as the sum of its weighted lobes.

OSL that is beyond this is an `Untranslatable`, one line that names the stage, the line and the construct.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from functools import cache
from typing import Any

import lark
import numpy as np
import pcpp

from .op_graph import FUNCTIONS, Closure, Graph, Op, Port, Untranslatable

_GRAMMAR = r"""
start: (function | shader)*
shader: "shader" NAME "(" [param ("," param)* ","?] ")" block
function: type NAME "(" [param ("," param)* ","?] ")" block
param: [OUTPUT] type NAME ["=" expr]
type: TYPE | CLOSURE TYPE -> closure_type
CLOSURE: "closure"
OUTPUT: "output"
TYPE.2: /(float|int|color|vector|normal|point|void|string)\b/

block: "{" statement* "}"
?statement: block
    | type declared ("," declared)* ";" -> declare
    | simple ";"
    | "if" "(" expr ")" statement ["else" statement] -> if_
    | "for" "(" [for_first] ";" expr ";" simple ")" statement -> for_
    | "while" "(" expr ")" statement -> while_
    | "return" [expr] ";" -> return_
    | ";" -> nothing
for_first: type declared ("," declared)* -> declare
    | simple
declared: NAME ["[" expr "]"] ["=" (expr | array)]
array: "{" expr ("," expr)* ","? "}"
?simple: target ASSIGN expr -> assign
    | target STEP -> step
    | expr -> evaluate
target: NAME ["[" expr "]"]
ASSIGN: /[-+*\/]?=(?!=)/
STEP: "++" | "--"

?expr: or_ | or_ "?" expr ":" expr -> ternary
?or_: and_ | or_ OR and_ -> binary
?and_: compare | and_ AND compare -> binary
?compare: sum | compare COMPARE sum -> binary
?sum: product | sum SUM product -> binary
?product: unary | product PRODUCT unary -> binary
?unary: SUM unary -> sign | NOT unary -> not_ | postfix
?postfix: atom | postfix "[" expr "]" -> index
?atom: NUMBER -> number | STRING -> string | NAME -> name
    | NAME "(" [expr ("," expr)*] ")" -> call
    | TYPE "(" [expr ("," expr)*] ")" -> construct
    | "(" TYPE ")" unary -> cast
    | "(" expr ")"
OR: "||"
AND: "&&"
NOT: "!"
COMPARE: "<=" | ">=" | "==" | "!=" | "<" | ">"
SUM: "+" | "-"
PRODUCT: "*" | "/" | "%"
NAME: /[A-Za-z_]\w*/
NUMBER: /(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?f?/
STRING: /"[^"]*"/
%import common.WS
%ignore WS
"""

# Names that stdosl.h defines.
_CONSTANTS = {"M_PI": math.pi, "M_PI_2": math.pi / 2.0, "M_1_PI": 1.0 / math.pi, "M_2PI": 2.0 * math.pi, "M_E": math.e}
_VECTORS = ("color", "vector", "normal", "point")
_MOST_ROUNDS = 1024


_SPLIT = ("x", "y", "z")
_ELEMENTWISE = ("add", "sub", "mul", "div", "min", "max", "mod", "pow", "abs", "floor", "ceil", "exp", "log", "sqrt", "sin",
                "cos", "tan", "clamp")
_CALLS = {"fabs": "abs", "fmod": "mod", **{name: name for name in _ELEMENTWISE if name not in ("add", "sub", "mul", "div")}}
_OPERATORS = {"+": "add", "-": "sub", "*": "mul", "/": "div", "%": "mod"}
_CLOSURES = {"bssrdf": 4, "dielectric_bsdf": 8}
"""Closure -> how many arguments it has before its named ones."""


@cache
def _parser() -> lark.Lark:
    return lark.Lark(_GRAMMAR, parser="lalr", propagate_positions=True, maybe_placeholders=True)


class _Preprocessor(pcpp.Preprocessor):
    def on_include_not_found(self, is_malformed: bool, is_system_include: bool, curdir: str, includepath: str) -> None:
        raise pcpp.OutputDirective(pcpp.Action.IgnoreAndPassThrough)  # headers of OSL: what they declare is known here

    def on_error(self, file: str, line: int, msg: str) -> None:
        raise Untranslatable(f"line {line}: {msg}")


def _preprocess(source: str) -> tuple[str, list[int]]:
    """The text without directives, and the line of `source` that each of its lines comes from."""
    reader = _Preprocessor()
    reader.parse(source)
    written = io.StringIO()
    reader.write(written)
    lines, numbers, at = [], [], 1
    for line in written.getvalue().splitlines():
        if line.startswith("#line"):
            at = int(line.split()[1])
            continue
        lines.append("" if line.startswith("#") else line)
        numbers.append(at)
        at += 1
    return "\n".join(lines), numbers


def compile_stage(stage: str, source: str, given: tuple[str, ...] = ()) -> Graph:
    """The graph of the one shader in `source`.

    given: inputs that are linked although their default is no number (`Normal = N`); else the default is taken. Raises
    Untranslatable.
    """
    try:
        text, numbers = _preprocess(source)
    except Untranslatable as error:
        raise Untranslatable(f"{stage}: {error}") from None
    where: Callable[[int], str] = lambda line: f"{stage}: line {numbers[line - 1] if line <= len(numbers) else line}"
    try:
        tree = _parser().parse(text)
    except lark.UnexpectedToken as error:
        raise Untranslatable(f"{where(error.line)}: '{error.token}': plain nodes have nothing for it here") from None
    except lark.UnexpectedInput as error:
        raise Untranslatable(f"{where(error.line)}: plain nodes have nothing for what stands here") from None
    run = _Run(given)
    try:
        return run.shader(tree)
    except _Unknown as error:
        raise Untranslatable(f"{where(error.line or run.line)}: {error}: plain nodes have nothing for it") from None


class _Unknown(Exception):
    line = 0


class _Returned(Exception):
    def __init__(self, value: Any) -> None:
        self.value = value


class _Table(list):
    """An array: a list of operations."""


class _Run:
    """Runs a shader on symbols. A value is an Op, a Closure, a _Table or a text."""

    def __init__(self, given: tuple[str, ...]) -> None:
        self.given = given
        self.known: dict[Any, Op] = {}
        self.functions: dict[str, lark.Tree] = {}
        self.scopes: list[dict[str, Any]] = []
        self.types: dict[str, str] = {}
        self.line = 0
        self.depth = 0  # of branches that a value decides

    # -- operations ------------------------------------------------------------------------------------------------

    def op(self, kind: str, type: str, *args: Op, value: Any = None) -> Op:
        key = kind, type, args, value
        if key not in self.known:
            self.known[key] = Op(kind, type, args, value)
        return self.known[key]

    def const(self, value: Any, type: str = "float") -> Op:
        if type == "vector":
            return self.op("const", type, value=tuple(float(v) for v in value))
        return self.op("const", type, value=float(value))

    def make(self, kind: str, *args: Op) -> Op:
        """An operation of FUNCTIONS, in its simplest form."""
        if kind in _ELEMENTWISE or kind in ("mix", "smoothstep", "select"):
            type = "vector" if any(arg.type == "vector" for arg in args) else "float"
            if type == "float" and all(arg.type == "int" for arg in args) and kind in ("add", "sub", "mul", "div", "min", "max",
                                                                                         "mod", "abs", "clamp", "select"):
                type = "int"
            if type == "vector":
                if kind == "mul" and (by := next((arg for arg in args if arg.type != "vector"), None)) is not None:
                    return self.make("scale", next(arg for arg in args if arg.type == "vector"), by)
                uniform = {"mix": 2, "select": 0}.get(kind)
                args = tuple(
                    arg if arg.type == "vector" or i == uniform else self.make("splat", arg) for i, arg in enumerate(args)
                )
                if kind in ("smoothstep",) or (uniform is not None and args[uniform].type == "vector"):
                    return self.make("pack", *(self.make(kind, *(self.make(axis, arg) for arg in args)) for axis in _SPLIT))
        else:
            type = "vector" if kind in ("scale", "splat", "pack", "cross", "normalize") else "float"
            if kind == "trunc":
                type = "int"
        if all(arg.kind == "const" for arg in args):
            result = FUNCTIONS[kind](*(np.asarray(arg.value, dtype=float) for arg in args))
            if type == "int":
                result = np.trunc(result)
            return self.const(result, type)
        simple = self._simplify(kind, args)
        if simple is not None:
            return simple
        if kind == "div" and type == "int":
            return self.make("trunc", self.op(kind, "float", *args))
        if kind in ("add", "mul", "min", "max") and args[0].kind == "const":
            args = (args[1], args[0])  # so that equal sums are the same object
        return self.op(kind, type, *args)

    def _simplify(self, kind: str, args: tuple[Op, ...]) -> Op | None:
        """The same value by less, or None."""
        a, b = args[0], args[1] if len(args) > 1 else None
        if kind == "add":
            if _is(b, 0.0):
                return a
            if _is(a, 0.0):
                return b
            if a.kind == "const" and b.kind == "add" and b.args[1].kind == "const":
                a, b = b, a
            if b.kind == "const" and a.kind == "add" and a.args[1].kind == "const":
                return self.make("add", a.args[0], self.make("add", a.args[1], b))
        elif kind == "sub":
            if _is(b, 0.0):
                return a
            if b.kind == "const":
                return self.make("add", a, self.make("mul", b, self.const(-1.0, "int" if b.type == "int" else "float")))
        elif kind in ("mul", "scale"):
            if _is(b, 1.0):
                return a
            if kind == "mul" and _is(a, 1.0):
                return b
            if _is(a, 0.0) or _is(b, 0.0):
                return self.const((0.0,) * 3, "vector") if a.type == "vector" else self.const(0.0)
            if kind == "scale" and a.kind == "splat":
                return self.make("splat", self.make("mul", a.args[0], b))
            if kind == "scale" and a.kind == "scale":
                return self.make("scale", a.args[0], self.make("mul", a.args[1], b))
            if kind == "mul" and a.type == "vector":
                for one, other in ((a, b), (b, a)):
                    if other.kind == "splat":
                        return self.make("scale", one, other.args[0])
                    if other.kind == "const" and len(set(other.value)) == 1:
                        return self.make("scale", one, self.const(other.value[0]))
        elif kind == "div":
            if _is(b, 1.0):
                return a
            if b.kind == "const" and a.type != "int" and not _is(b, 0.0):
                return self.make("mul", a, self.make("div", self.const(1.0), b))
        elif kind == "mix":
            if _is(args[2], 0.0) or a is b:
                return a
            if _is(args[2], 1.0):
                return b
        elif kind == "select":
            if a.kind == "const":
                return args[1] if a.value else args[2]
            if args[1] is args[2]:
                return args[1]
        elif kind == "abs" and a.kind in ("mul", "scale") and _is(a.args[1], -1.0):
            return self.make("abs", a.args[0])
        elif kind == "dot":
            for one, other in ((a, b), (b, a)):
                if one.kind == "scale" and one.args[1].kind == "const":
                    return self.make("mul", self.make("dot", one.args[0], other), one.args[1])
        elif kind in _SPLIT:
            if a.kind == "pack":
                return a.args[_SPLIT.index(kind)]
            if a.kind == "splat":
                return a.args[0]
        elif kind == "pack" and all(arg.kind == axis for arg, axis in zip(args, _SPLIT, strict=True)):
            if args[0].args == args[1].args == args[2].args:
                return args[0].args[0]
        return None

    # -- shader, functions, statements -------------------------------------------------------------------------------

    def shader(self, tree: lark.Tree) -> Graph:
        self.functions = {str(item.children[1]): item for item in tree.children if item.data == "function"}
        shaders = [item for item in tree.children if item.data == "shader"]
        if len(shaders) != 1:
            raise self.unknown(f"{len(shaders)} shaders in one text")
        _, *params, body = shaders[0].children
        scope: dict[str, Any] = {}
        self.scopes = [scope]
        inputs, outputs = [], []
        for param in filter(None, params):
            output, type_, name, default = param.children
            self.at(param)
            declared, name = _type_name(type_), str(name)
            self.types[name] = declared
            value = self.convert(self.value(default), declared) if default is not None else None
            if output:
                outputs.append(Port(name, declared))
                scope[name] = value
            elif value.kind == "const" or name in self.given:
                inputs.append(Port(name, declared, value.value if value.kind == "const" else (0.0, 0.0, 0.0)))
                scope[name] = self.op("input", _kind_of(declared), value=name)
            else:
                scope[name] = value
        self.execute(body)
        return Graph(tuple(inputs), tuple(outputs), {port.name: scope[port.name] for port in outputs})

    def execute(self, tree: lark.Tree) -> None:
        self.at(tree)
        getattr(self, f"_do_{tree.data}", self._cannot)(tree)

    def _cannot(self, tree: lark.Tree) -> None:
        raise self.unknown(f"'{str(tree.data).rstrip('_')}'")

    def _do_block(self, tree: lark.Tree) -> None:
        self.scopes.append({})
        try:
            for item in tree.children:
                self.execute(item)
        finally:
            self.scopes.pop()

    def _do_nothing(self, tree: lark.Tree) -> None:
        pass

    def _do_declare(self, tree: lark.Tree) -> None:
        type_, *items = tree.children
        declared = _type_name(type_)
        for item in items:
            name, length, first = item.children
            if length is not None:
                if not isinstance(first, lark.Tree) or first.data != "array":
                    raise self.unknown(f"array '{name}' without its values")
                value: Any = _Table(self.convert(self.value(x), declared) for x in first.children)
            elif first is not None:
                value = self.convert(self.value(first), declared)
            else:
                value = Closure(()) if declared == "closure color" else self.convert(self.const(0.0), declared)
            self.types[str(name)] = declared
            self.scopes[-1][str(name)] = self.named(value, str(name))

    def _do_assign(self, tree: lark.Tree) -> None:
        target, sign, expr = tree.children
        value = self.value(expr)
        if sign != "=":
            value = self.binary(str(sign[0]), self.read(target), value)
        self.write(target, value)

    def _do_step(self, tree: lark.Tree) -> None:
        target, sign = tree.children
        self.write(target, self.binary(str(sign[0]), self.read(target), self.const(1.0, "int")))

    def _do_evaluate(self, tree: lark.Tree) -> None:
        self.value(tree.children[0])

    _do_for_first = _do_evaluate

    def _do_if_(self, tree: lark.Tree) -> None:
        condition, then, otherwise = tree.children
        chosen = self.value(condition)
        if chosen.kind == "const":
            if chosen.value:
                self.execute(then)
            elif otherwise is not None:
                self.execute(otherwise)
            return
        before = [dict(scope) for scope in self.scopes]
        self.depth += 1
        self.execute(then)
        changed = [dict(scope) for scope in self.scopes]
        for scope, old in zip(self.scopes, before, strict=True):
            scope.clear()
            scope.update(old)
        if otherwise is not None:
            self.execute(otherwise)
        self.depth -= 1
        for scope, one in zip(self.scopes, changed, strict=True):
            for name in scope:
                if one[name] is not scope[name]:
                    scope[name] = self.choose(chosen, one[name], scope[name])

    def _do_for_(self, tree: lark.Tree) -> None:
        first, condition, after, body = tree.children
        self.scopes.append({})
        if first is not None:
            self.execute(first if first.data == "declare" else first.children[0])
        self._loop(condition, body, after)
        self.scopes.pop()

    def _do_while_(self, tree: lark.Tree) -> None:
        self._loop(*tree.children, None)

    def _loop(self, condition: lark.Tree, body: lark.Tree, after: lark.Tree | None) -> None:
        for _ in range(_MOST_ROUNDS):
            going = self.value(condition)
            if going.kind != "const":
                raise self.unknown("a loop whose end is not known beforehand")
            if not going.value:
                return
            self.execute(body)
            if after is not None:
                self.execute(after)
        raise self.unknown(f"a loop of more than {_MOST_ROUNDS} rounds")

    def _do_return_(self, tree: lark.Tree) -> None:
        if self.depth:
            raise self.unknown("'return' in a branch that a value decides")
        raise _Returned(self.value(tree.children[0]) if tree.children[0] is not None else None)

    def call(self, function: lark.Tree, args: list[Any]) -> Any:
        type_, name, *params, body = function.children
        params = list(filter(None, params))
        if len(params) != len(args):
            raise self.unknown(f"{name} of {len(args)} arguments")
        scope = {}
        for param, value in zip(params, args, strict=True):
            output, declared, held, _ = param.children
            if output:
                raise self.unknown(f"{name}: an argument that it changes")
            scope[str(held)] = self.convert(value, _type_name(declared))
        scopes, depth, line, types = self.scopes, self.depth, self.line, self.types
        self.scopes, self.depth = [scope], 0
        self.types = {**types, **{str(param.children[2]): _type_name(param.children[1]) for param in params}}
        try:
            self.execute(body)
        except _Returned as returned:
            return self.convert(returned.value, _type_name(type_))
        finally:
            self.scopes, self.depth, self.line, self.types = scopes, depth, line, types
        raise self.unknown(f"{name} without a 'return'")

    # -- variables ---------------------------------------------------------------------------------------------------

    def scope_of(self, name: str) -> dict[str, Any]:
        for scope in reversed(self.scopes):
            if name in scope:
                return scope
        raise self.unknown(f"'{name}'")

    def read(self, target: lark.Tree) -> Any:
        name, index = target.children
        value = self.scope_of(str(name))[str(name)]
        return value if index is None else self.element(value, self.value(index))

    def write(self, target: lark.Tree, value: Any) -> None:
        name, index = str(target.children[0]), target.children[1]
        scope = self.scope_of(name)
        if index is None:
            scope[name] = self.named(self.convert(value, self.types[name]), name)
            return
        at, held = self.value(index), scope[name]
        if at.kind != "const":
            raise self.unknown(f"{name}[…] set at a place that is not known beforehand")
        parts = held if isinstance(held, _Table) else _Table(self.make(axis, held) for axis in _SPLIT)
        parts = _Table(value if i == int(at.value) else part for i, part in enumerate(parts))
        scope[name] = parts if isinstance(held, _Table) else self.make("pack", *parts)

    def named(self, value: Any, name: str) -> Any:
        if isinstance(value, Op) and not value.name and value.kind not in ("const", "input"):
            object.__setattr__(value, "name", name)  # a label, no part of what it is
        return value

    def element(self, value: Any, at: Op) -> Op:
        if isinstance(value, _Table):
            if at.kind == "const":
                if not 0 <= int(at.value) < len(value):
                    raise self.unknown(f"element {int(at.value)} of {len(value)}")
                return value[int(at.value)]
            if any(item.kind != "const" or item.type == "vector" for item in value):
                raise self.unknown("an array of what is not known beforehand, read at such a place")
            return self.op("lookup", "float", at, value=tuple(item.value for item in value))
        if at.kind != "const" or not isinstance(value, Op) or value.type != "vector":
            raise self.unknown("a component that is not known beforehand")
        return self.make(_SPLIT[int(at.value)], value)

    def convert(self, value: Any, type: str) -> Any:
        """`value` as a variable of an OSL type holds it."""
        if type == "closure color":
            if isinstance(value, Closure):
                return value
            if isinstance(value, Op) and _is(value, 0.0):
                return Closure(())
        elif type == "string" and isinstance(value, str):
            return value
        elif isinstance(value, Op):
            if _kind_of(type) == "vector":
                return value if value.type == "vector" else self.make("splat", value)
            if value.type != "vector":
                if type == "int" and value.type == "float":
                    return self.make("trunc", value)
                if type == "float" and value.kind == "const":
                    return self.const(value.value)
                return value
        raise self.unknown(f"a value that is no {type}")

    def choose(self, condition: Op, then: Any, otherwise: Any) -> Any:
        if isinstance(then, Closure) and isinstance(otherwise, Closure):
            on = self.make("sub", self.const(1.0), self.make("equal", condition, self.const(0.0)))
            return self.plus(self.times(then, on), self.times(otherwise, self.make("sub", self.const(1.0), on)))
        if isinstance(then, Op) and isinstance(otherwise, Op):
            return self.make("select", condition, then, otherwise)
        raise self.unknown("a choice between these")

    # -- expressions ---------------------------------------------------------------------------------------------------

    def value(self, tree: lark.Tree) -> Any:
        self.at(tree)
        return getattr(self, f"_is_{tree.data}")(*tree.children)

    def _is_number(self, text: str) -> Op:
        whole = text.isdigit()
        return self.const(float(text.rstrip("f")), "int" if whole else "float")

    def _is_string(self, text: str) -> str:
        return str(text[1:-1])

    def _is_name(self, name: str) -> Any:
        name = str(name)
        for scope in reversed(self.scopes):
            if name in scope:
                if scope[name] is None:
                    raise self.unknown(f"'{name}' before it has a value")
                return scope[name]
        if name in _CONSTANTS:
            return self.const(_CONSTANTS[name])
        if name == "N":
            return self.op("normal", "vector")
        if name == "I":
            return self.op("incident", "vector")
        raise self.unknown(f"'{name}'")

    def _is_ternary(self, condition: lark.Tree, then: lark.Tree, otherwise: lark.Tree) -> Any:
        chosen = self.value(condition)
        if chosen.kind == "const":
            return self.value(then if chosen.value else otherwise)
        return self.choose(chosen, self.value(then), self.value(otherwise))

    def _is_binary(self, left: lark.Tree, sign: str, right: lark.Tree) -> Any:
        return self.binary(str(sign), self.value(left), self.value(right))

    def _is_sign(self, sign: str, tree: lark.Tree) -> Any:
        value = self.value(tree)
        return value if sign == "+" else self.binary("*", value, self.const(-1.0, "int"))

    def _is_not_(self, _sign: str, tree: lark.Tree) -> Op:
        return self.make("equal", self.value(tree), self.const(0.0))

    def _is_index(self, tree: lark.Tree, at: lark.Tree) -> Op:
        return self.element(self.value(tree), self.value(at))

    def _is_cast(self, type: str, tree: lark.Tree) -> Any:
        return self.convert(self.value(tree), str(type))

    def _is_construct(self, type: str, *parts: lark.Tree | None) -> Any:
        values = [self.value(part) for part in parts if part is not None]
        if len(values) == 3 and str(type) in _VECTORS:
            return self.make("pack", *values)
        if len(values) != 1:
            raise self.unknown(f"{type} of {len(values)} values")
        return self.convert(values[0], str(type))

    def _is_call(self, name: str, *parts: lark.Tree | None) -> Any:
        name = str(name)
        args = [self.value(part) for part in parts if part is not None]
        if name in self.functions:
            return self.call(self.functions[name], args)
        if name == "noise" and len(args) == 2 and args[0] in ("perlin", "snoise") and args[1].type == "vector":
            return self.op("noise", "float", args[1])
        if name == "snoise" and len(args) == 1 and isinstance(args[0], Op) and args[0].type == "vector":
            return self.op("noise", "float", args[0])
        if name in _CLOSURES:
            return self.closure(name, args)
        if any(not isinstance(arg, Op) for arg in args):
            raise self.unknown(f"{name}({', '.join(repr(arg) for arg in args if isinstance(arg, str))})")
        kind = _CALLS.get(name, name if name in ("mix", "smoothstep", "dot", "cross", "length", "normalize") else None)
        if kind is None:
            raise self.unknown(f"{name}()")
        try:
            return self.make(kind, *args)
        except (TypeError, IndexError):
            raise self.unknown(f"{name} of {len(args)} arguments") from None

    def closure(self, name: str, args: list[Any]) -> Closure:
        """Texts among the arguments become its value; after as many as it has places come names with their values."""
        named = args[_CLOSURES[name] :: 2]
        if len(args) < _CLOSURES[name] or len(args) - _CLOSURES[name] != 2 * len(named):
            raise self.unknown(f"{name} of {len(args)} arguments")
        texts = tuple(arg for arg in args if isinstance(arg, str))
        if not all(isinstance(arg, str) for arg in named):
            raise self.unknown(f"{name} with arguments that have no name")
        ops = tuple(arg for arg in args if isinstance(arg, Op))
        leaf = self.op(name, "closure", *ops, value=texts)
        return Closure(((self.const(1.0), leaf),))

    def binary(self, sign: str, a: Any, b: Any) -> Any:
        if isinstance(a, Closure) or isinstance(b, Closure):
            if sign == "+" and isinstance(a, Closure) and isinstance(b, Closure):
                return self.plus(a, b)
            if sign == "*" and isinstance(a, Op):
                return self.times(b, a)
            if sign == "*" and isinstance(b, Op):
                return self.times(a, b)
            raise self.unknown(f"'{sign}' of closures")
        if isinstance(a, str) or isinstance(b, str) or isinstance(a, _Table) or isinstance(b, _Table):
            raise self.unknown(f"'{sign}' of these")
        if sign in _OPERATORS:
            return self.make(_OPERATORS[sign], a, b)
        if a.type == "vector" or b.type == "vector":
            raise self.unknown(f"'{sign}' of vectors")
        one = self.const(1.0)
        if sign in ("&&", "||"):
            yes = [self.make("sub", one, self.make("equal", value, self.const(0.0))) for value in (a, b)]
            return self.make("min" if sign == "&&" else "max", *yes)
        if sign in ("<", ">="):
            less = self.make("less", a, b)
        elif sign in (">", "<="):
            less = self.make("less", b, a)
        else:
            less = self.make("equal", a, b)
        return less if sign in ("<", ">", "==") else self.make("sub", one, less)

    def plus(self, a: Closure, b: Closure) -> Closure:
        return Closure(a.terms + b.terms)

    def times(self, closure: Closure, by: Op) -> Closure:
        terms = ((self.make("mul", weight, by), leaf) for weight, leaf in closure.terms)
        return Closure(tuple(term for term in terms if not _is(term[0], 0.0)))

    def at(self, tree: Any) -> None:
        self.line = getattr(getattr(tree, "meta", None), "line", None) or self.line

    def unknown(self, what: str) -> _Unknown:
        error = _Unknown(what)
        error.line = self.line
        return error


def _is(op: Op | None, value: float) -> bool:
    if op is None or op.kind != "const":
        return False
    return op.value == value if op.type != "vector" else all(v == value for v in op.value)


def _type_name(tree: lark.Tree) -> str:
    return f"closure {tree.children[1]}" if tree.data == "closure_type" else str(tree.children[0])


def _kind_of(type: str) -> str:
    return "vector" if type in _VECTORS else type

