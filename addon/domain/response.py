"""A control's effect as one formula with two forms: a number here, and the text of a driver in Blender."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Response:
    """`gain * clamp(sum of weight * operand, low, high)`.

    An operand is the name of a control or another response. `gain`, if any, names a control. A response
    never leaves its limits, so mixing controls cannot overdrive what it drives.
    """

    terms: tuple[tuple[float, str | Response], ...]
    low: float = 0.0
    high: float = 1.0
    gain: str | None = None

    def value(self, controls: Mapping[str, float]) -> float:
        """The number for these control values; a control not named is at 0."""
        total = sum(
            weight * (operand.value(controls) if isinstance(operand, Response) else controls.get(operand, 0.0))
            for weight, operand in self.terms
        )
        clamped = min(max(total, self.low), self.high)
        return clamped if self.gain is None else controls.get(self.gain, 0.0) * clamped

    def expression(self) -> str:
        """The same formula in the subset of Python that Blender evaluates itself ("simple expressions")."""
        total = ""
        for weight, operand in self.terms:
            name = operand.expression() if isinstance(operand, Response) else operand
            sign = "-" if weight < 0 else "+" if total else ""
            total += sign + (name if abs(weight) == 1 else f"{number_text(abs(weight))}*{name}")
        # clamp() without limits is 0 to 1: worth its brevity, as Blender cuts a driver at 255 characters.
        limits = "" if (self.low, self.high) == (0.0, 1.0) else f",{number_text(self.low)},{number_text(self.high)}"
        return (f"{self.gain}*" if self.gain else "") + f"clamp({total}{limits})"

    def controls(self) -> tuple[str, ...]:
        """Names of all controls the formula reads, each once, in order."""
        names = [self.gain] if self.gain else []
        for _, operand in self.terms:
            names += operand.controls() if isinstance(operand, Response) else [operand]
        return tuple(dict.fromkeys(names))


def number_text(value: float) -> str:
    """Shortest decimal text, without the exponent that Blender's own parser might not read."""
    return f"{value:.9f}".rstrip("0").rstrip(".")
