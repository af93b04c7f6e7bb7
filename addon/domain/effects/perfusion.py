"""Perfusion: emotion fills or empties the vessels of each region (flush, blush, pallor)."""

from .blood_change import blood_effect

EFFECT = blood_effect(
    "perfusion", "Perfusion", "Emotion brings blood to each region or drives it out: flush, blush, pallor.", "hemoglobin"
)
