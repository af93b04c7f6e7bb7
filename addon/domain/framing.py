"""Where the portrait's camera stands, and how fine it sees: known before any scene is built."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

SENSOR_MM = 36.0  # along the height of the picture

# The picture's height in heights of the head (chin to crown): it holds the hair and the neck.
_HEADS = 1.6
# Of the head's height, above the chin: what the picture is centred on.
_CENTRE = 0.42


@dataclass(frozen=True)
class Framing:
    """A camera that looks at `middle` from `distance_m` away, horizontally. toward: unit vector from there to it."""

    middle: tuple[float, float, float]
    toward: tuple[float, float, float]
    distance_m: float
    height_m: float  # of what the picture shows around `middle`

    def pixel_mm(self, position_mm: np.ndarray, pixels: int) -> float | None:
        """What a pixel covers where the camera is nearest to the box around (V, 3) positions; None inside of it.

        pixels: of the picture's height.
        """
        corners = np.array(np.meshgrid(*np.stack([position_mm.min(0), position_mm.max(0)], axis=1))).reshape(3, -1).T / 1000.0
        depth = self.distance_m - ((corners - self.middle) @ self.toward).max()
        return float(1000.0 * self.height_m * depth / self.distance_m / pixels) if depth > 0 else None


def portrait(eyes, chin, crown, lens_mm: float, turn_degrees: float) -> Framing:
    """The portrait of a head whose landmarks (3,) are given in metres, Z up, face toward -Y.

    turn_degrees: the camera walks round the head, + toward the subject's left.
    """
    head_height = crown[2] - chin[2]
    height = _HEADS * head_height
    turn = math.radians(turn_degrees)
    return Framing(
        middle=(0.0, float(eyes[1] + crown[1]) / 2, float(chin[2] + _CENTRE * head_height)),
        toward=(math.sin(turn), -math.cos(turn), 0.0),
        distance_m=float(height * lens_mm / SENSOR_MM),
        height_m=float(height),
    )
