#!/usr/bin/env python3
"""Writes docs/parameters.md from native/schema/parameters.toml; a test compares the committed page with it."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def page() -> str:
    rows = tomllib.loads((ROOT / "native/schema/parameters.toml").read_text(encoding="utf-8"))["parameter"]
    lines = [
        "# Parameters",
        "",
        "Written by `make docs` from `native/schema/parameters.toml`, where each is declared once.",
        "",
        "| id | unit | default | allowed | slider | what it is | source |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        unit = "fraction" if row["unit"] == "1" else row["unit"]
        lines.append(
            f"| `{row['id']}` | {unit} | {row['default']:g} | {row['hard_min']:g} to {row['hard_max']:g} "
            f"| {row['soft_min']:g} to {row['soft_max']:g} | {row['help']} | {row['source']} |"
        )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    (ROOT / "docs/parameters.md").write_text(page(), encoding="utf-8")
