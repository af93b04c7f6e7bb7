#!/usr/bin/env python3
"""Writes rigs/presets/sanguine/skin/*.json, the presets that come with the panel; a test compares the committed ones.

One for each class of skin in rigs/people_measured.toml: nobody in particular, the middle of the people measured.
"""

from __future__ import annotations

from pathlib import Path

from sanguine.domain.people import CLASSES, typical
from sanguine.domain.skin_preset import SkinPreset, preset_of, write_preset

FOLDER = Path(__file__).resolve().parent.parent / "rigs/presets/sanguine/skin"
SOURCE = (
    "The mean of {people} people of the class '{name}', ITA {low:g} to {high:g} degrees, in the International Skin Spectra "
    "Archive (Lu et al. 2025, Sci. Data 12, doi 10.1038/s41597-025-04857-5) as fitted in rigs/people_measured.toml; "
    "features: what rigs/people.toml gives more than half of the women and of the men, at its median strength"
)


def presets() -> dict[str, SkinPreset]:
    """File name -> preset."""
    made = {}
    for name, row in CLASSES.items():
        label = name.replace("-", " ").capitalize()
        source = SOURCE.format(people=row.people, name=name, low=row.ita_low, high=row.ita_high)
        made[f"{label.replace(' ', '_')}.json"] = preset_of(typical(name), label, source)
    return made


if __name__ == "__main__":
    for name, preset in presets().items():
        write_preset(FOLDER / name, preset)
