#!/usr/bin/env python3
"""Writes docs/facs.md from the tables in rigs/; a test compares the committed page with it."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
VARIANTS = "0.25", "1", "1.5"


def table(header: str, rows: list[str]) -> list[str]:
    return [header, "|" + "---|" * (header.count("|") - 1), *rows, ""]


def keys_text(row: dict) -> str:
    """Pairs of keys once, without their sides."""
    stems: dict[str, str] = {}
    for key, weight in row.get("keys", {}).items():
        stem = key.removesuffix("Left").removesuffix("Right")
        stems[stem] = f"{stem} {weight:g}" if weight != 1.0 else stem
    moves = {
        "turn_degrees": "head turns {:g} deg",
        "nod_degrees": "head nods {:g} deg",
        "tilt_degrees": "head tilts {:g} deg",
        "forward_mm": "head forward {:g} mm",
    }
    return ", ".join([*stems.values(), *(moves[k].format(v) for k, v in row.get("head", {}).items())])


def unit_row(row: dict) -> str:
    sides = {key[-4:] for key in row.get("keys", {})} & {"Left", "ight"}
    controls = f"AU{row['id']}L, AU{row['id']}R" if row.get("one_sided") else f"AU{row['id']}" + (" L R" if sides else "")
    return f"| {controls} | {row['name']} | {'; '.join(row['muscles'])} | {keys_text(row)} | {row['fit']} | {row.get('note', '')} |"


def page() -> str:
    units = tomllib.loads((ROOT / "rigs/action_units.toml").read_text(encoding="utf-8"))
    emotions = tomllib.loads((ROOT / "rigs/emotions.toml").read_text(encoding="utf-8"))
    arkit = tomllib.loads((ROOT / "rigs/arkit.toml").read_text(encoding="utf-8"))
    own = tomllib.loads((ROOT / "rigs/own_keys.toml").read_text(encoding="utf-8"))
    names = {row["id"]: row["name"] for row in units["unit"]}
    whole = [row["id"] for row in units["unit"] if row.get("keys") and not any("Left" in key for key in row["keys"])]
    shown = [name for name, row in emotions["emotion"].items() if row["units"]]
    lines = [
        "# The face: action units and emotions",
        "",
        "Written by `make docs` from `rigs/action_units.toml`, `emotions.toml`, `arkit.toml` and `own_keys.toml`.",
        "",
        "![Ten emotions, subtle, full and extreme, on both example heads](emotions.jpg)",
        "",
        f"Rows: {', '.join(shown)}. Columns: subtle, full, extreme on the female head, then on the male one. A plain "
        "material, no blood: the shapes alone.",
        "",
        "## From a slider to a shape key",
        "",
        "What the emotions ask of a unit and the unit's own sliders (`AU12` both sides, `AU12L` and `AU12R` one) add up "
        "and are clamped to 0-1; units that exclude each other fade; a shape key is the clamped sum of what is left of its "
        "units. So no mix overdrives a unit or a key. The FACS intensities A B C D E are 0.2 0.4 0.6 0.8 1.0.",
        "",
        "In Blender the armature object carries one driven property per unit (`unit_12L`) and per unit that emotions ask "
        "for (`sum_12`); shape keys listen to the units. All drivers are simple expressions under 255 characters. An "
        "emotion that is not on the rig is in none of them. What that costs while scrubbing, beside the same shape keys keyed "
        "plainly: [emotion in time](emotion_in_time.md#what-a-frame-costs-in-the-viewport).",
        "",
        "## Emotions",
        "",
        "Each number is a unit's share at the emotion's slider at " + ", ".join(VARIANTS) + " (subtle, full, extreme); "
        "straight lines between, from 0 at 0.",
        "",
    ]
    for name in shown:
        row = emotions["emotion"][name]
        sources = "; ".join(emotions["sources"][source] for source in row["source"])
        lines += [f"**{name}**: {row['help']}. {sources}.", ""]
        lines += table(
            "| unit | | " + " | ".join(VARIANTS) + " |",
            [
                f"| {unit} | {names[unit.rstrip('LR')]} | " + " | ".join(f"{share:g}" for share in shares) + " |"
                for unit, shares in sorted(row["units"].items(), key=lambda item: int(item[0].rstrip("LR")))
            ],
        )
    lines += [
        "## Units",
        "",
        f"{units['source']} fit: *same* one key or pair of keys is this action; *near* built of several, reads as the "
        "action; *weak* a stand-in. Weights of keys are ours.",
        "",
        *table("| controls | unit | muscles | keys | fit | note |", [unit_row(row) for row in units["unit"]]),
        "## Interferences",
        "",
        "A unit loses this share of its effect at full strength of the other.",
        "",
        *table(
            "| unit | by | share | only through | why |",
            [
                f"| {', '.join(row['units'])} | {', '.join(row['by'])} | {', '.join(f'{v:g}' for v in dict.fromkeys(row['by'].values()))} "
                f"| {', '.join(row.get('keys', []))} | {row['reason']} |"
                for row in units["interference"]
            ],
        ),
        *table(
            "| unit | shows only as far as | why |",
            [
                f"| {row['unit']} | {', '.join(f'{u} ({v:g})' for u, v in row['of'].items())} | {row['reason']} |"
                for row in units["need"]
            ],
        ),
        "## Keys of our own",
        "",
        "Pairs that the example heads have beyond ARKit's 52. A rig without them does what ARKit's keys can.",
        "",
        *table("| key | what it does |", [f"| `{row['name']}` | {row['help']} |" for row in own["key"]]),
        "## What cannot be shown",
        "",
        *table(
            "| code | name | why |",
            [f"| {row['id']} | {row['name']} | {row['reason']} |" for row in units["inexpressible"]],
        ),
        f"One side alone of {', '.join(whole)}: their keys have no sides (ARKit has one inner brow, one jaw, one pair of "
        "rolled or pushed lips). Units of both kinds of keys (the middle of the upper lip in 25, the rolled lips of 23) are one-sided in part: half of "
        "what has no side moves.",
        "",
        *table("| ARKit key | driven by no unit because |", [f"| `{key}` | {why} |" for key, why in arkit["unreached"].items()]),
    ]
    return "\n".join(lines).rstrip() + "\n"


if __name__ == "__main__":
    (ROOT / "docs/facs.md").write_text(page(), encoding="utf-8")
