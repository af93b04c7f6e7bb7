#!/usr/bin/env python3
"""Fills the tables of docs/ that follow from the code: between `<!-- made: NAME -->` and `<!-- /made -->`.

A test compares the committed pages with what this makes.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from sanguine.cli.main import _parser
from sanguine.domain.blood import STATES
from sanguine.domain.effects import EFFECTS
from sanguine.domain.facs import DEFAULT_EMOTIONS, EMOTION_CONTROLS
from sanguine.domain.parameters import PARAMETERS
from sanguine.domain.quality import DEFAULT, POINTS, PRESETS, Point
from sanguine.domain.shot import Shot

DOCS = Path(__file__).resolve().parents[1] / "docs"
_BLOCK = re.compile(r"(<!-- made: (.+?) -->\n).*?(<!-- /made -->)", re.DOTALL)

# What a picture costs is told for these sizes.
SIZES = ((640, 800), (1920, 1080))


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    lines = [tuple(head), *(tuple(row) for row in rows)]
    cells = [" | ".join(cell.replace("|", "\\|") for cell in line) for line in lines]
    return "\n".join([f"| {cells[0]} |", "|" + "---|" * len(lines[0]), *(f"| {line} |" for line in cells[1:])]) + "\n"


def sliders(*groups: str) -> str:
    """Those that a sub-panel of these groups draws, in its order."""
    rows = []
    for row in PARAMETERS.values():
        if row.group in groups:
            rows.append((f"**{row.caption}**", f"{row.default:g}", f"{row.soft_min:g} to {row.soft_max:g}", f"{row.help}."))
    for effect in EFFECTS:
        if effect.default_strength is not None and effect.group in groups:
            rows.append((f"**{effect.label}**", f"{effect.default_strength:g}", "0 to 1", _first(effect.help)))
    return table(("slider", "at first", "it goes", "what it is"), rows)


def effects() -> str:
    """What runs without a slider of its own."""
    rows = (
        (f"**{effect.label}**", "yes" if effect.switchable else "no", _first(effect.help))
        for effect in EFFECTS if effect.default_strength is None
    )
    return table(("effect", "switch", "what it does"), rows)


def feelings() -> str:
    others = [name for name in EMOTION_CONTROLS if name not in DEFAULT_EMOTIONS]
    return (
        f"On every rig: {_listed(DEFAULT_EMOTIONS)}. To add: {_listed(others)}; and states of the body: "
        f"{', '.join(row.label.lower() for row in STATES.values())}.\n"
    )


def presets() -> str:
    head = ("preset", "samples", "lobes", "maps", "Delta E, 95 of 100 pixels", "Delta E, median", "prepare",
            *(f"{width} x {height}" for width, height in SIZES))
    rows = []
    for name, point in PRESETS.items():
        label = name.capitalize() + (" (at first)" if name == DEFAULT else "")
        times = (_seconds(_picture_seconds(point, *size)) for size in SIZES)
        rows.append((f"**{label}**", str(point.samples), str(point.lobes), str(point.map_size), f"{point.delta_e:.2f}",
                     f"{point.delta_e_median:.2f}", f"{point.prepare_seconds:.2g} s", *times))
    return table(head, rows)


def front() -> str:
    head = ("Delta E within", "samples", "lobes", "maps", "step of the table", "seconds per megapixel")
    return table(head, (
        (f"{p.delta_e:.2f}", str(p.samples), str(p.lobes), str(p.map_size), f"{p.table_step:g}", f"{p.seconds_per_megapixel:.0f}")
        for p in _cheapest()
    ))


def verbs() -> str:
    return table(("verb", "what it answers"), ((f"[`{name}`](#{name})", _sentence(verb.description)) for name, verb in _verbs().items()))


def options() -> str:
    parts = []
    for name, verb in _verbs().items():
        usage = " ".join(verb.format_usage().split()).removeprefix("usage: ")
        parts += [f"### {name}", "", _sentence(verb.description), "", "```text", usage, "```", ""]
        rows = []
        for action in verb._actions:
            if isinstance(action, argparse._HelpAction) or action.dest == "json_progress":
                continue
            shown = action.metavar or ("\\|".join(map(str, action.choices)) if action.choices else action.dest.upper())
            flag = action.option_strings[-1] if action.option_strings else ""
            text = " ".join(filter(None, (flag, "" if action.nargs == 0 else str(shown).replace("\\|", "|"))))
            rows.append((f"`{text}`", action.help % vars(action) if action.help else ""))
        parts += [table(("argument", "what it is"), rows)]
    return "\n".join(parts) + "\n"


def shot() -> str:
    """Every key of a SHOT.toml, by table."""
    schema = Shot.model_json_schema()
    rows: list[tuple[str, str, str]] = []
    _keys(schema, schema["$defs"], "", rows)
    return table(("key", "what is allowed", "left out"), rows)


def _keys(model: dict[str, Any], known: dict[str, Any], prefix: str, rows: list[tuple[str, str, str]]) -> None:
    for key, field in model["properties"].items():
        kinds = [kind for kind in field.get("anyOf", [field]) if kind.get("type") != "null"]
        kind, = kinds[:1]
        item = kind.get("items", {})
        if (name := kind.get("$ref") or item.get("$ref")) is not None:
            below = f"[[{prefix}{key}]]" if item else f"{prefix}{key}"
            _keys(known[name.rsplit("/")[-1]], known, f"{below}." if not item else f"{below} ", rows)
            continue
        needed = key in model.get("required", ())
        rows.append((f"`{prefix}{key}`", _allowed(kind), "needed" if needed else _default(field.get("default"))))


def _allowed(kind: dict[str, Any]) -> str:
    if "enum" in kind:
        return ", ".join(f"`{value}`" for value in kind["enum"])
    if kind.get("type") == "object":
        return "names = numbers"
    text = {"string": "text", "integer": "whole number", "number": "number", "boolean": "true or false"}[kind["type"]]
    if "minimum" in kind and "maximum" in kind:
        return f"{text}, {kind['minimum']:g} to {kind['maximum']:g}" if kind["maximum"] < 1e6 else f"{text} from {kind['minimum']:g}"
    return f"{text} from {kind['minimum']:g}" if "minimum" in kind else text


def _default(value: Any) -> str:
    if value in (None, {}, [], ""):
        return "-"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def _verbs() -> dict[str, argparse.ArgumentParser]:
    return next(action.choices for action in _parser()._actions if isinstance(action, argparse._SubParsersAction))


def _cheapest() -> list[Point]:
    """The points that `--delta-e` can choose: each better than all that are faster."""
    kept: list[Point] = []
    for point in POINTS:
        if not kept or point.delta_e < kept[-1].delta_e:
            kept.append(point)
    return kept


def _picture_seconds(point: Point, width: int, height: int) -> float:
    return point.prepare_seconds + point.seconds_per_megapixel * width * height / 1e6


def _seconds(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"


def _first(text: str) -> str:
    return text.split(". ")[0].rstrip(".") + "."


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:].rstrip(".") + "."


def _listed(names: Iterable[str]) -> str:
    return ", ".join(name.replace("_", " ") for name in names)


_BY_NAME = {"effects": effects, "feelings": feelings, "presets": presets, "front": front, "verbs": verbs, "options": options,
            "shot": shot, "sliders": sliders}


def filled(text: str) -> str:
    """A page with its tables made anew."""

    def made(match: re.Match[str]) -> str:
        name, *arguments = match.group(2).split()
        return f"{match.group(1)}\n{_BY_NAME[name](*arguments)}\n{match.group(3)}"

    return _BLOCK.sub(made, text)


if __name__ == "__main__":
    for page in sorted(DOCS.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        if (new := filled(text)) != text:
            page.write_text(new, encoding="utf-8")
