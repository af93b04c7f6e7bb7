"""What emotions and states do to the colour of skin, next to what is published, and how fast: docs/blood.md.

    python bench/blood_colour.py              # the tables and the plot, seconds
    python bench/blood_colour.py --extremes   # the rendered faces too, some minutes
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from sanguine.app.blood_report import (
    REGIONS, TONES, colours, delta_e, kinetics_rows, pulse_rows, region_skin, report, tone_skins,
)
from sanguine.domain.blood import BLOOD, ELSEWHERE
from sanguine.domain.vascular import VASCULAR, Controls, blood_over_time

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "blood.md"
SKINS = tone_skins()
LIGHT, DARK = SKINS["light"], SKINS["dark"]

# What is asked of each time course: (control, seconds that it is on, seconds shown).
COURSES = (("anger", 20.0, 120.0), ("fear", 20.0, 120.0), ("shame", 20.0, 120.0), ("exertion", 180.0, 720.0))
SHOWN = {"cheeks": "#b5413a", "nose": "#3b6ea5", "forehead": "#c99a2e"}

PEOPLE = (
    {"id": "light", "rig": {"head": "female"}, "person": {"tone": "light", "age": 25}},
    {"id": "dark", "rig": {"head": "male"}, "person": {"tone": "dark", "sex": "male", "age": 30}},
)
EXTREMES = {
    "at rest": "",
    "anger and exertion, 1": "emotions = { anger = 1.0 }\nstates = { exertion = 1.0 }",
    "pallor and hypoxia, 1": "states = { pallor = 1.0, hypoxia = 1.0 }",
}


def signed(values: Any) -> str:
    return " ".join(f"{value:+.1f}" for value in values)


def change(skin: dict[str, float], region: str, hemoglobin: float = 0.0, oxygenation: float = 0.0) -> tuple[np.ndarray, float]:
    """Delta L*a*b* and Delta E 2000 of a change of a region."""
    before, after = colours([region_skin(skin, region), region_skin(skin, region, (hemoglobin, oxygenation))])
    return after.lab - before.lab, float(delta_e(before.lab, after.lab)[0])


def tones() -> list[str]:
    lines = ["| skin | ITA of the face | melanin | cheek L* a* b* | lips L* a* b* |", "|---|---|---|---|---|"]
    for name, skin in SKINS.items():
        cheek, lips = colours([region_skin(skin, region) for region in ("cheeks", "lips")])
        at = [" ".join(f"{v:.1f}" for v in colour.lab) for colour in (cheek, lips)]
        lines.append(f"| {name} | {TONES[name]:.0f} degrees | {skin['melanin']:.3f} | {at[0]} | {at[1]} |")
    return lines


def changes() -> list[str]:
    lines = [
        "| | region | blood | of its rest | oxygenation | without oxygen | " + " | ".join(SKINS) + " |",
        "|---|---|---|---|---|---|" + "---|" * len(SKINS),
    ]
    skins = report(SKINS.items())["skins"]
    for group in zip(*(skin["changes"] for skin in skins), strict=True):
        rows = zip(*(of["regions"] for of in group), strict=True)
        for i, row in enumerate(sorted(rows, key=lambda row: REGIONS.index(row[0]["region"]))):
            at_rest = BLOOD.at_rest(row[0]["region"], "hemoglobin")
            seen = " | ".join(f"{signed(r['delta_Lab'])} ({r['delta_e_2000']:.1f})" for r in row)
            lines.append(
                f"| {'**' + group[0]['name'].replace('_', ' ') + '**' if i == 0 else ''} | {row[0]['region']} "
                f"| {row[0]['hemoglobin_change']:+.4f} | {100 * row[0]['hemoglobin_change'] / at_rest:+.0f} % "
                f"| {row[0]['oxygenation_change']:+.2f} | {row[0]['deoxyhemoglobin_change']:+.4f} | {seen} |"
            )
    return lines


def published() -> list[str]:
    def flow(region: str, share: float) -> str:
        rest = BLOOD.at_rest(region, "hemoglobin")
        return f"Delta E {change(LIGHT, region, share * rest)[1]:.1f} if blood went with flow"

    def ours(control: str, region: str) -> str:
        rows = report([("light", LIGHT)])["skins"][0]["changes"]
        row = next(r for c in rows if c["name"] == control for r in c["regions"] if r["region"] == region)
        share = row["hemoglobin_change"] / BLOOD.at_rest(region, "hemoglobin")
        return f"{control.replace('_', ' ')} {100 * share:+.0f} % ({signed(row['delta_Lab'])})"

    def oxygen(skin: dict[str, float], region: str, drop: float) -> str:
        return f"{change(skin, region, oxygenation=-drop)[1]:.1f}"

    anemic = {**LIGHT, "hemoglobin": 0.4 * LIGHT["hemoglobin"]}
    swings = {r["region"]: r["green_swing"] for r in pulse_rows(LIGHT)}
    rows = [
        ("cold pressor: forehead, lids, cheek, lips", "flow +6 to +8 % (Kashima 2013)", flow("cheeks", 0.07), ours("pain", "cheeks")),
        ("cold pressor: nose", "flow -5 % (Kashima 2013)", flow("nose", -0.05), ours("pain", "nose")),
        ("static handgrip: cheek", "flow +6 to +10 % (Kashima 2013)", flow("cheeks", 0.08), ours("exertion", "cheeks")),
        ("exercise, 120 to 160 beats a minute", "up in all skin; lips not at 160 (Hayashi 2021)", "", ours("exertion", "forehead") + ", " + ours("exertion", "lips")),
        ("warm bath: forehead, cheek", "flow 3 to 9 times that in the cold (Rasch & Cabanac 1993)", "", ours("fever", "cheeks")),
        ("arm at 44 degrees", "blood 0.08 to 0.63 %, 8 times (Fredriksson 2008)", "", "most of any slider: " + f"{1 + max(c.high / BLOOD.at_rest(r, q) for (r, q), c in BLOOD.channels(['exertion', 'anger', 'alcohol']).items() if q == 'hemoglobin'):.1f} times"),
        ("happy: cheeks redder, chin bluer", "pictures (Benitez-Quiroz 2018)", "", ours("happy", "cheeks") + ", chin " + signed(change(LIGHT, "chin", oxygenation=-0.03)[0])),
        ("surprise: cheeks and forehead redder", "pictures (Benitez-Quiroz 2018)", "", ours("surprise", "cheeks") + ", " + ours("surprise", "forehead")),
        ("disgust: bitter taste", "nose, cheek, forehead down (Kashima 2011, 2014)", "", ours("disgust", "nose")),
        ("embarrassment: cheeks, ears, forehead", "up (Shearn 1990; Drummond & Mirco 2004)", "", ours("shame", "cheeks") + ", " + ours("shame", "ears")),
        ("heartbeat, green of light skin", "0.5 to 0.6 % (remembered)", f"forehead {100 * swings['forehead']:.2f} %, cheeks {100 * swings['cheeks']:.2f} %", f"`pulse` = 1, depth {VASCULAR.pulse.depth:g}"),
        ("cyanosis seen at SaO2 80 to 87 %", "tissue about 10 to 17 % below its rest", f"lips Delta E {oxygen(LIGHT, 'lips', 0.10)} to {oxygen(LIGHT, 'lips', 0.17)}, cheeks {oxygen(LIGHT, 'cheeks', 0.10)} to {oxygen(LIGHT, 'cheeks', 0.17)}", "hypoxia 0.3 to 0.5; an eye tells apart about 1"),
        ("in dark skin at about 75 %", "22 % below", f"dark lips Delta E {oxygen(DARK, 'lips', 0.22)}, cheeks {oxygen(DARK, 'cheeks', 0.22)}", "hypoxia 0.6"),
        ("with 6 g/dL hemoglobin at 60 %", "37 % below, with 0.4 of the blood's hemoglobin", f"lips Delta E {oxygen(anemic, 'lips', 0.37)} (with all of it {oxygen(LIGHT, 'lips', 0.37)})", "hypoxia 1"),
    ]
    return ["| what | published | by our optics, light skin | ours at 1 |", "|---|---|---|---|"] + [f"| {' | '.join(row)} |" for row in rows]


def pulse() -> list[str]:
    lines = ["| region | later by | swing of the blood | green, " + " | green, ".join(SKINS) + " |", "|---|---|---|" + "---|" * len(SKINS)]
    for rows in zip(*(pulse_rows(skin) for skin in SKINS.values()), strict=True):
        seen = " | ".join(f"{100 * row['green_swing']:.2f} %" for row in rows)
        lines.append(f"| {rows[0]['region']} | {1000 * rows[0]['delay_s']:.0f} ms | {rows[0]['hemoglobin_swing']:.5f} | {seen} |")
    return lines


def kinetics() -> list[str]:
    lines = ["| time course | waits | comes | goes | of | basis | source |", "|---|---|---|---|---|---|---|"]
    for row in kinetics_rows():
        told = ", ".join(row["source"]) or "none"
        used = ", ".join(name.replace("_", " ") for name in row["used_by"]) or "pressure"
        note = f". {row['note'][0].upper()}{row['note'][1:]}" if row["note"] else ""
        lines.append(
            f"| {row['label']} (`{row['id']}`) | {row['delay_s']:g} s | {row['attack_s']:g} s | {row['decay_s']:g} s | {used} "
            f"| {row['basis']} | {told}{note} |"
        )
    for row in VASCULAR.region:
        lines.append(
            f"| {row.region}: {', '.join(row.kinetics)} | +{row.delay_s:g} s | x {row.attack:g} | x {row.decay:g} | "
            f"| {row.basis} | {', '.join(row.source) or 'none'}. {row.note[:1].upper()}{row.note[1:]} |"
        )
    return lines


TABLES: dict[str, Callable[[], list[str]]] = {
    "tones": tones, "changes": changes, "published": published, "pulse": pulse, "kinetics": kinetics,
}


def written(text: str) -> str:
    """The page with its tables anew."""
    for mark, table in TABLES.items():
        head, rest = text.split(f"<!-- {mark} -->")
        tail = rest.split(f"<!-- /{mark} -->")[1]
        text = head + f"<!-- {mark} -->\n" + "\n".join(table()) + f"\n<!-- /{mark} -->" + tail
    return text


def plot(file: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, len(COURSES), figsize=(13, 5.4), sharex="col", constrained_layout=True)
    for (control, on_s, shown_s), (above, below) in zip(COURSES, axes.T, strict=True):
        time_s = np.arange(0.0, shown_s, shown_s / 600)
        level = ((time_s > 0.0) & (time_s < on_s)).astype(float)
        moved = blood_over_time(Controls(time_s, {control: level}))
        for region, colour in SHOWN.items():
            rest = BLOOD.at_rest(region, "hemoglobin")
            none = np.zeros_like(time_s)
            blood, oxygen = moved.get((region, "hemoglobin"), none), moved.get((region, "oxygenation"), none)
            above.plot(time_s, 100 * blood / rest, color=colour, label=region)
            skins = [region_skin(LIGHT, region, pair) for pair in zip(blood[::6], oxygen[::6], strict=True)]
            lab = np.array([seen.lab for seen in colours(skins)])
            below.plot(time_s[::6], lab[:, 1] - lab[0, 1], color=colour)
        for axis in (above, below):
            axis.axvspan(0.0, on_s, color="0.92", zorder=0)
            axis.axhline(0.0, color="0.6", linewidth=0.6)
            axis.spines[["top", "right"]].set_visible(False)
        above.set_title(f"{control}, 1 for {on_s:g} s")
        below.set_xlabel("seconds")
    axes[0, 0].set_ylabel("blood, % of rest")
    axes[1, 0].set_ylabel("change of a*, light skin")
    axes[0, 0].legend(frameon=False)
    figure.savefig(file, dpi=90)


def extremes(file: Path) -> None:
    """The faces at their extremes, rendered by `sanguine render`, as one picture."""
    import sanguine_core
    from sanguine.cli.main import main as sanguine

    with tempfile.TemporaryDirectory() as scratch:
        shot = Path(scratch) / "shot.toml"
        lines = ['quality = "draft"', "[image]", "width = 256", "height = 320", "samples = 24"]
        for person in PEOPLE:
            who = ", ".join(f'{k} = "{v}"' if isinstance(v, str) else f"{k} = {v}" for k, v in person["person"].items())
            lines += ["[[subject]]", f'id = "{person["id"]}"', f'rig = {{ head = "{person["rig"]["head"]}" }}', f"person = {{ {who} }}"]
        for i, pose in enumerate(EXTREMES.values()):
            lines += ["[[expression]]", f'id = "x{i}"', pose]
        shot.write_text("\n".join(lines), encoding="utf-8")
        if sanguine(["render", str(shot), "--out", f"{scratch}/out"]) != 0:
            raise SystemExit("the pictures were not rendered")
        made = [(Path(scratch) / "out" / f"{p['id']}_x{i}.png", name) for p in PEOPLE for i, name in enumerate(EXTREMES)]
        sanguine_core.contact_sheet([path for path, _ in made], [name for _, name in made], file, columns=len(EXTREMES))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--extremes", action="store_true", help="render the faces at their extremes too")
    options = parser.parse_args()
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    plot(PAGE.parent / "blood_time_courses.png")
    if options.extremes:
        extremes(PAGE.parent / "blood_extremes.jpg")
    print(f"wrote {PAGE.relative_to(ROOT)}", file=sys.stderr)


if __name__ == "__main__":
    main()
