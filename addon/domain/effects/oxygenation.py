"""Oxygenation: emotion changes how much of the blood carries oxygen."""

from .blood_change import blood_effect

EFFECT = blood_effect(
    "oxygenation",
    "Oxygenation",
    "Emotion changes the oxygenation of each region's blood: fuller red or duller, bluer.",
    "oxygenation",
)
