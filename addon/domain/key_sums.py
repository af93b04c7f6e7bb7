"""Sums over shape keys as chains of short driver expressions, each within what Blender keeps of one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from .response import MAX_EXPRESSION, number_text


@dataclass(frozen=True)
class KeySum:
    """`expression` in variables; `keys`: variable -> the shape key whose value it is."""

    expression: str
    keys: Mapping[str, str]


def key_sums(coefficients: Mapping[str, float], digits: int = 4) -> list[KeySum]:
    """Partial sums of coefficient x value of the key, whose total is the whole sum; empty when nothing counts."""
    sums: list[KeySum] = []
    text, keys = "", {}
    for key, coefficient in coefficients.items():
        written = number_text(round(abs(coefficient), digits))
        if written == "0":
            continue
        variable = f"k{len(keys)}"
        sign = "-" if coefficient < 0.0 else "+" if text else ""
        term = f"{sign}{written}*{variable}"
        if len(text) + len(term) >= MAX_EXPRESSION:
            sums.append(KeySum(text, keys))
            text, keys = "", {}
            term = f"{'-' if coefficient < 0.0 else ''}{written}*k0"
            variable = "k0"
        text += term
        keys[variable] = key
    return [*sums, KeySum(text, keys)] if text else sums
