"""Recorded faces made to measure: performances with known truth, and the CSV files recorders would write of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from sanguine.domain.facs import ARKIT, EMOTION_MAX, emotion_units, shape_key_values

# The order of the app's own files.
LIVE_LINK_NAMES = (
    "EyeBlinkLeft EyeLookDownLeft EyeLookInLeft EyeLookOutLeft EyeLookUpLeft EyeSquintLeft EyeWideLeft "
    "EyeBlinkRight EyeLookDownRight EyeLookInRight EyeLookOutRight EyeLookUpRight EyeSquintRight EyeWideRight "
    "JawForward JawRight JawLeft JawOpen MouthClose MouthFunnel MouthPucker MouthRight MouthLeft MouthSmileLeft "
    "MouthSmileRight MouthFrownLeft MouthFrownRight MouthDimpleLeft MouthDimpleRight MouthStretchLeft "
    "MouthStretchRight MouthRollLower MouthRollUpper MouthShrugLower MouthShrugUpper MouthPressLeft "
    "MouthPressRight MouthLowerDownLeft MouthLowerDownRight MouthUpperUpLeft MouthUpperUpRight BrowDownLeft "
    "BrowDownRight BrowInnerUp BrowOuterUpLeft BrowOuterUpRight CheekPuff CheekSquintLeft CheekSquintRight "
    "NoseSneerLeft NoseSneerRight TongueOut"
).split()
ROTATIONS = (
    "HeadYaw HeadPitch HeadRoll LeftEyeYaw LeftEyePitch LeftEyeRoll RightEyeYaw RightEyePitch RightEyeRoll".split()
)
OPENFACE_UNITS = "01 02 04 05 06 07 09 10 12 14 15 17 20 23 25 26 45".split()


def blink(seconds, at, length=0.13):
    """A lid closing and opening: faster down than up."""
    phase = np.clip((seconds - at) / length, 0, 1)
    return np.where(phase < 0.4, np.sin(np.pi / 2 * phase / 0.4), np.cos(np.pi / 2 * (phase - 0.4) / 0.6)).clip(0) * (
        (phase > 0) & (phase < 1)
    )


def blinks(seconds, rng):
    """A blink every 2 to 5 seconds, 100 to 150 ms long."""
    total, at = np.zeros_like(seconds), rng.uniform(0.5, 3)
    while at < seconds[-1]:
        total = np.maximum(total, blink(seconds, at, rng.uniform(0.1, 0.15)))
        at += rng.uniform(2, 5)
    return total


def rise_and_fall(seconds, start, stop, rise=0.5, fall=0.8):
    smooth = lambda x: x * x * (3 - 2 * x)  # noqa: E731
    return smooth(np.clip((seconds - start) / rise, 0, 1)) * smooth(np.clip((stop - seconds) / fall, 0, 1))


def talking(seconds, rng, amount=1.0):
    """Keys of speech: syllables at 3 to 6 a second in phrases with pauses."""
    beats = int(seconds[-1]) + 2
    phrase = np.interp(seconds, np.arange(beats), rng.uniform(0, 1, beats) > 0.25)
    phase = 2 * np.pi * np.cumsum(rng.uniform(3, 6, len(seconds))) * np.median(np.diff(seconds))
    keys = {}
    for name, size in (
        ("jawOpen", 0.35),
        ("mouthFunnel", 0.3),
        ("mouthPucker", 0.35),
        ("mouthLowerDown", 0.3),
        ("mouthUpperUp", 0.2),
        ("mouthClose", 0.15),
        ("mouthStretch", 0.15),
        ("mouthPress", 0.2),
        ("mouthShrugLower", 0.15),
        ("mouthRollLower", 0.15),
        ("mouthSmile", 0.1),
        ("mouthDimple", 0.1),
        ("mouthShrugUpper", 0.1),
    ):
        wave = np.maximum(np.sin(phase * rng.uniform(0.6, 1.1) + rng.uniform(0, 6)), 0) ** 1.5
        swell = np.interp(seconds, np.linspace(0, seconds[-1], 8), rng.uniform(0.5, 1, 8))
        keys[name] = amount * size * wave * swell * phrase
    return {
        side: values
        for name, values in keys.items()
        for side in ([name] if name in ARKIT.keys else [f"{name}Left", f"{name}Right"])
    }


def showing(emotion, level, seconds, rng, start=3.0, stop=9.0, missing=0):
    """Keys of a face that shows an emotion from `start` to `stop`: an individual, each unit a quarter more or less than
    the table's, `missing` of them not there at all."""
    gain = {
        unit: rng.uniform(0.75, 1.25) for unit in sorted({unit.rstrip("LR") for unit in emotion_units(emotion, 1.0)})
    }
    gain |= dict.fromkeys(rng.choice(sorted(gain), missing, replace=False), 0.0)
    levels = np.linspace(0, EMOTION_MAX, 13)
    faces = [
        shape_key_values(
            {f"AU{u}": min(1.0, v * gain.get(u.rstrip("LR"), 1.0)) for u, v in emotion_units(emotion, at).items()}
        )
        for at in levels
    ]
    course = level * rise_and_fall(seconds, start, stop)
    return {key: np.interp(course, levels, [face[key] for face in faces]) for key in faces[0]}


def blinking(seconds, rng):
    """Blinks as trackers see them: the lids, and a little of what is around them."""
    lids = blinks(seconds, rng)
    return {
        f"{key}{side}": size * lids
        for key, size in (("eyeBlink", 1.0), ("eyeSquint", 0.3), ("browDown", 0.1))
        for side in ("Left", "Right")
    }


def noisy(keys, seconds, rng, size=0.015):
    """All 52 keys with a tracker's noise and the small offsets of a resting face."""
    count = len(seconds)
    return {
        key: np.clip(keys.get(key, np.zeros(count)) + rng.uniform(0, 0.04) + rng.normal(0, size, count), 0, 1)
        for key in ARKIT.keys
    }


def add(*parts):
    total = {}
    for part in parts:
        for key, values in part.items():
            total[key] = total.get(key, 0) + values
    return total


def timecode(frame, rate=60, drop=False):
    """SMPTE text of a count of frames, sub-frames in thousandths."""
    whole, part = int(frame // 1), frame % 1
    if drop:
        skip = rate // 15
        tens, rest = divmod(whole, rate * 600 - 9 * skip)
        whole += 9 * skip * tens + (skip * ((rest - skip) // (rate * 60 - skip)) if rest >= skip else 0)
    seconds, frames = divmod(whole, rate)
    clock = f"{seconds // 3600 % 24:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
    return f"{clock}{';' if drop else ':'}{frames:02d}.{int(part * 1000):03d}"


def write_live_link(path: Path, frames, keys, rate=60, drop=False, rotations=None, start=0):
    """`frames` (N,) are counts of the timecode, which may be lost, doubled or fractional."""
    lines = [",".join(("Timecode", "BlendshapeCount", *LIVE_LINK_NAMES, *ROTATIONS))]
    order = [name[0].lower() + name[1:] for name in LIVE_LINK_NAMES]
    for i, frame in enumerate(frames):
        values = [keys[key][i] for key in order] + [
            (rotations or {}).get(name, np.zeros(i + 1))[i] for name in ROTATIONS
        ]
        lines.append(",".join((timecode(start + frame, rate, drop), "61", *(f"{value:.10f}" for value in values))))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def write_mediapipe(path: Path, seconds, keys, clock="timestamp_ms"):
    names = ["_neutral", *(key for key in ARKIT.keys if key != "tongueOut")]
    lines = [",".join((clock, *names))]
    for i, second in enumerate(seconds):
        tick = f"{second * 1000:.0f}" if clock.endswith("ms") else f"{i}" if clock == "frame" else f"{second:.6f}"
        lines.append(",".join((tick, "0.000001", *(f"{keys[key][i]:.8g}" for key in names[1:]))))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def write_openface(path: Path, seconds, units, lost=(), pose=None, blanks=True):
    """`units`: '12' -> (N,) 0-1. Rows in `lost` are those of a tracker that saw no face."""
    columns = ["frame", "face_id", "timestamp", "confidence", "success", "gaze_angle_x", "gaze_angle_y"]
    columns += ["pose_Tx", "pose_Rx", "pose_Ry", "pose_Rz", *(f"AU{u}_r" for u in OPENFACE_UNITS), "AU28_c", "AU45_c"]
    lines = [(", " if blanks else ",").join(columns)]
    for i, second in enumerate(seconds):
        gone = i in lost
        turn = [
            (pose or {}).get(name, np.zeros(i + 1))[i]
            for name in ("gaze_angle_x", "gaze_angle_y", "pose_Rx", "pose_Ry", "pose_Rz")
        ]
        cells = [
            str(i + 1),
            "0",
            f"{second:.3f}",
            "0.00" if gone else "0.98",
            "0" if gone else "1",
            f"{turn[0]:.3f}",
            f"{turn[1]:.3f}",
        ]
        cells += ["1.0", f"{turn[2]:.3f}", f"{turn[3]:.3f}", f"{turn[4]:.3f}"]
        cells += [
            "0.00" if gone else f"{5 * units.get(str(int(u)), np.zeros(i + 1))[i]:.2f}" for u in OPENFACE_UNITS
        ] + ["0.00", "0.00"]
        lines.append((", " if blanks else ",").join(cells))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
