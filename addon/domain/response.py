"""A control's effect as one formula with two forms: a number here, and the text of a driver in Blender."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

# Blender stores a driver's expression in 256 bytes and cuts what is longer without a word.
MAX_EXPRESSION = 255


class Formula(Protocol):
    """What the classes below have in common; `names` of `expression` are the variables to write for the controls."""

    def value(self, controls: Mapping[str, float]) -> float: ...

    def expression(self, names: Mapping[str, str] | None = None) -> str: ...

    def controls(self) -> tuple[str, ...]: ...


Terms = tuple[tuple[float, "str | Formula"], ...]


def _total(terms: Terms, controls: Mapping[str, float]) -> float:
    return sum(
        weight * (controls.get(operand, 0.0) if isinstance(operand, str) else operand.value(controls))
        for weight, operand in terms
    )


def _total_text(terms: Terms, names: Mapping[str, str] | None, total: str = "") -> str:
    for weight, operand in terms:
        name = (names or {}).get(operand, operand) if isinstance(operand, str) else operand.expression(names)
        sign = "-" if weight < 0 else "+" if total else ""
        total += sign + (name if abs(weight) == 1 else f"{number_text(abs(weight))}*{name}")
    return total


def _controls(operands: tuple[str | Formula, ...]) -> tuple[str, ...]:
    names: list[str] = []
    for operand in operands:
        names += [operand] if isinstance(operand, str) else operand.controls()
    return tuple(dict.fromkeys(names))


@dataclass(frozen=True)
class Above:
    """`max(control - knee, 0)`: the bend of a piecewise linear curve."""

    control: str
    knee: float

    def value(self, controls: Mapping[str, float]) -> float:
        return max(controls.get(self.control, 0.0) - self.knee, 0.0)

    def expression(self, names: Mapping[str, str] | None = None) -> str:
        return f"max({(names or {}).get(self.control, self.control)}-{number_text(self.knee)},0)"

    def controls(self) -> tuple[str, ...]:
        return (self.control,)


@dataclass(frozen=True)
class Sum:
    """`constant + sum of weight * operand`, without limits."""

    terms: Terms
    constant: float = 0.0

    def value(self, controls: Mapping[str, float]) -> float:
        return self.constant + _total(self.terms, controls)

    def expression(self, names: Mapping[str, str] | None = None) -> str:
        return f"({_total_text(self.terms, names, number_text(self.constant) if self.constant else '')})"

    def controls(self) -> tuple[str, ...]:
        return _controls(tuple(operand for _, operand in self.terms))


@dataclass(frozen=True)
class Product:
    """`factor * factor * ...`"""

    factors: tuple[str | Formula, ...]

    def value(self, controls: Mapping[str, float]) -> float:
        result = 1.0
        for factor in self.factors:
            result *= controls.get(factor, 0.0) if isinstance(factor, str) else factor.value(controls)
        return result

    def expression(self, names: Mapping[str, str] | None = None) -> str:
        return "*".join(
            (names or {}).get(factor, factor) if isinstance(factor, str) else factor.expression(names)
            for factor in self.factors
        )

    def controls(self) -> tuple[str, ...]:
        return _controls(self.factors)


@dataclass(frozen=True)
class Response:
    """`gain * clamp(sum of weight * operand, low, high)`.

    An operand is the name of a control or another formula. `gain`, if any, names a control. A response
    never leaves its limits, so mixing controls cannot overdrive what it drives.
    """

    terms: Terms
    low: float = 0.0
    high: float = 1.0
    gain: str | None = None

    def value(self, controls: Mapping[str, float]) -> float:
        """The number for these control values; a control not named is at 0."""
        clamped = min(max(_total(self.terms, controls), self.low), self.high)
        return clamped if self.gain is None else controls.get(self.gain, 0.0) * clamped

    def expression(self, names: Mapping[str, str] | None = None) -> str:
        """The same formula in the subset of Python that Blender evaluates itself ("simple expressions")."""
        # clamp() without limits is 0 to 1: worth its brevity, as Blender cuts a driver at 255 characters.
        limits = "" if (self.low, self.high) == (0.0, 1.0) else f",{number_text(self.low)},{number_text(self.high)}"
        gain = f"{(names or {}).get(self.gain, self.gain)}*" if self.gain else ""
        return f"{gain}clamp({_total_text(self.terms, names)}{limits})"

    def controls(self) -> tuple[str, ...]:
        """Names of all controls the formula reads, each once, in order."""
        return _controls((*((self.gain,) if self.gain else ()), *(operand for _, operand in self.terms)))


def driver_text(formula: Formula) -> tuple[str, dict[str, str]]:
    """The formula as a driver's expression, and its variables with the control that each stands for.

    Variables are called like their controls; where that is too long for Blender, a, b, c, …. It is the caller's to
    check that what comes out is shorter than MAX_EXPRESSION.
    """
    controls = formula.controls()
    text = formula.expression()
    if len(text) < MAX_EXPRESSION:
        return text, {name: name for name in controls}
    names = {name: chr(ord("a") + i) if i < 26 else f"v{i}" for i, name in enumerate(controls)}
    return formula.expression(names), {variable: name for name, variable in names.items()}


def number_text(value: float) -> str:
    """Shortest decimal text, without the exponent that Blender's own parser might not read."""
    return f"{value:.9f}".rstrip("0").rstrip(".")
