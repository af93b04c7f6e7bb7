#!/usr/bin/env python3
"""Whether an installed wheel of sanguine_core works: solves a skin, writes a picture and reads it. For release builds."""

import tempfile
from pathlib import Path

import numpy as np
import sanguine_core

nm = np.arange(380.0, 781.0, 10.0)
row = np.array([[row["default"] for row in sanguine_core.parameters()]])
reflectance = sanguine_core.reflectance(row, nm)[0]
assert np.isfinite(reflectance).all() and 0.0 < reflectance.min() and reflectance.max() < 1.0
assert reflectance[nm == 700.0].item() > 1.5 * reflectance[nm == 540.0].item(), "blood and pigment take green, not red"
with tempfile.TemporaryDirectory() as folder:
    picture = np.linspace(0.0, 1.0, 8 * 4 * 3, dtype=np.float32).reshape(4, 8, 3)
    path = Path(folder) / "picture.exr"
    sanguine_core.write_image(str(path), picture)
    assert np.abs(sanguine_core.read_image(str(path)) - picture).max() < 1e-3, "half floats keep 11 bits"
print("well:", sanguine_core.__file__)
