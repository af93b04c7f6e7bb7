"""Readers of recorded faces: Live Link Face, OpenFace and MediaPipe CSV, told apart by their headers.

What comes out is a `Take`: true times and, per time, either the 52 ARKit keys or action units. A row without a face
is a gap, not a zero; nothing is put on an even grid here. Files are untrusted: every fault is one InputError line with
file, line, column and mend.

Formats, as found in public exports and importers:

- Live Link Face (Epic, iOS): `Timecode,BlendshapeCount,EyeBlinkLeft,…,RightEyeRoll`, timecode `HH:MM:SS:FF.mmm` where
  .mmm are thousandths of a frame. Its rotations have no documented unit; they read as radians (docs/capture.md).
- OpenFace 2 (Baltrusaitis, wiki "Output Format"): `frame, face_id, timestamp, confidence, success, gaze_angle_x, …,
  pose_Rx, …, AU01_r (0-5), …, AU01_c (0 or 1), …`, blanks after the commas in some versions.
- MediaPipe Face Landmarker has no export of its own: one row per frame, one column per blend shape, one for the time.
"""

from __future__ import annotations

import csv
import math
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from .errors import InputError
from .facs import ARKIT
from .files import read_text

Kind = Literal["live_link_face", "openface", "mediapipe"]

# Half an hour of OpenFace with every landmark, or three hours of Live Link Face.
MAX_BYTES = 512 * 1024 * 1024
MAX_ROWS, MAX_COLUMNS = 1_000_000, 4096
MAX_SECONDS = 3 * 3600.0
FRAME_RATES = (23.976, 24.0, 25.0, 29.97, 30.0, 48.0, 50.0, 59.94, 60.0, 90.0, 100.0, 120.0, 240.0)
MIN_CONFIDENCE = 0.5
"""OpenFace rows below are gaps. Its own `success` is set above 0.7 or so, depending on the version."""
_STANDARD_RATE = 0.003  # relative; 23.976 and 24 are 0.001 apart, so the nearest wins; what is farther is kept as it is
_LARGEST_TICK = 1e19  # nanoseconds since 1970 are 2e18
_LONGEST_DAY = 24 * 3600.0
_SLACK = 0.2  # how far outside 0-1 a tracker's noise may leave a value before the column is something else


@dataclass
class Take:
    """One recorded face.

    seconds : (N,) increasing, first 0
    fps     : the recording's own rate, detected
    keys    : ARKit key -> (N,) 0-1; empty for OpenFace
    units   : action unit id (both sides) -> (N,) 0-1; empty for the others
    head    : 'yaw', 'pitch', 'roll' -> (N,) radians; yaw to the subject's left, pitch up, roll onto the left shoulder
    gaze    : 'yaw', 'pitch' of the eyes in the head -> (N,) radians, same senses; empty where keys hold it
    notes   : what was done to the data, one line each
    """

    name: str
    kind: Kind
    seconds: np.ndarray
    fps: float
    keys: dict[str, np.ndarray] = field(default_factory=dict)
    units: dict[str, np.ndarray] = field(default_factory=dict)
    head: dict[str, np.ndarray] = field(default_factory=dict)
    gaze: dict[str, np.ndarray] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


@dataclass
class _Table:
    """A CSV's cells as text: `lines` are 1-based numbers in the file."""

    path: str
    header: list[str]
    lines: list[int]
    rows: list[list[str]]

    def where(self, row: int, column: str) -> str:
        return f"{self.path}: line {self.lines[row]}: {column}"

    def index(self) -> dict[str, int]:
        """Column name in lower case -> position. Raises InputError for one that stands twice."""
        found: dict[str, int] = {}
        for position, name in enumerate(self.header):
            if name and found.setdefault(name.casefold(), position) != position:
                raise InputError(f"{self.path}: line 1: {name}: stands twice in the header, remove one")
        return found

    def keep(self, rows: Sequence[int]) -> _Table:
        return _Table(self.path, self.header, [self.lines[i] for i in rows], [self.rows[i] for i in rows])

    def numbers(self, position: int) -> np.ndarray:
        """A column as floats. Raises InputError for the first cell that is none."""
        column = [row[position] for row in self.rows]
        try:
            values = np.array(column, dtype=np.float64)
        except ValueError:
            values = None
        if values is None or not np.isfinite(values).all():
            for row, cell in enumerate(column):
                _number(self.where(row, self.header[position]), cell)
        return values

    def share(self, position: int, notes: list[str], scale: float = 1.0) -> np.ndarray:
        """A column of 0 to `scale` as 0-1. What leaves the range a little is clipped and noted."""
        values = self.numbers(position) / scale
        beyond = np.flatnonzero((values < -_SLACK) | (values > 1 + _SLACK))
        if len(beyond):
            value = values[beyond[0]] * scale
            percent = scale == 1.0 and float(values.max()) > 2
            raise InputError(
                f"{self.where(beyond[0], self.header[position])}: {value:g} is outside 0 to {scale:g}"
                + (", these look like percent: divide them by 100" if percent else "")
            )
        if values.min(initial=0.0) < 0.0 or values.max(initial=0.0) > 1.0:
            notes.append(f"{self.header[position]}: {values.min():.3g} to {values.max():.3g}, clipped to 0 to 1")
        return np.clip(values, 0.0, 1.0)


def read_take(path: str | os.PathLike[str], source_fps: float | None = None) -> Take:
    """The recording in `path`. `source_fps` stands in for a time column, or corrects a timecode's rate.

    Raises InputError.
    """
    if source_fps is not None and not 1.0 <= source_fps <= 1000.0:
        raise InputError(f"--source-fps: {source_fps:g} is outside 1 to 1000")
    table = _read_table(path)
    names = {name.casefold() for name in table.header}
    keys = sum(_arkit_key(name) is not None for name in table.header)
    if "timecode" in names and keys:
        take = _live_link_face(table, source_fps)
    elif "confidence" in names and any(re.fullmatch(r"au\d\d_[rc]", name) for name in names):
        take = _openface(table, source_fps)
    elif keys >= len(ARKIT.keys) // 2:
        take = _mediapipe(table, source_fps)
    else:
        raise InputError(
            f"{path}: line 1: no recording of a face that is known: needs Timecode and blend shapes (Live Link Face), "
            f"confidence and AU01_r … (OpenFace), or blend shapes and a time (MediaPipe)"
        )
    take.seconds = take.seconds - take.seconds[0]
    if not take.seconds[-1] <= MAX_SECONDS:
        raise InputError(
            f"{path}: spans {take.seconds[-1] / 3600:.3g} hours, at most {MAX_SECONDS / 3600:g} are read: "
            "split the take"
        )
    return take


def _read_table(path: str | os.PathLike[str]) -> _Table:
    text = read_text(path, MAX_BYTES).removeprefix("\ufeff")
    if "\0" in text:
        raise InputError(f"{path}: holds zero bytes: not a text file")
    reader = csv.reader(text.splitlines(), strict=True)
    lines, rows = [], []
    try:
        for row in reader:
            if any(cell.strip() for cell in row):
                lines.append(reader.line_num)
                rows.append([cell.strip() for cell in row])
                if len(rows) > MAX_ROWS:
                    raise InputError(f"{path}: more than {MAX_ROWS} rows: split the take")
    except csv.Error as error:
        raise InputError(f"{path}: line {reader.line_num}: not valid CSV: {error}") from None
    if not rows:
        raise InputError(f"{path}: empty, needs a header and a row for each frame")
    header = rows.pop(0)
    lines.pop(0)
    while header and not header[-1]:  # a comma at the end of every line
        header.pop()
    if len(header) > MAX_COLUMNS:
        raise InputError(f"{path}: line 1: {len(header)} columns, at most {MAX_COLUMNS} are read")
    if not rows:
        raise InputError(f"{path}: holds a header and no frames")
    return _Table(str(path), header, lines, rows)


def _check_widths(table: _Table) -> None:
    width = len(table.header)
    for row, (line, cells) in enumerate(zip(table.lines, table.rows)):
        if len(cells) == width or (len(cells) > width and not any(cells[width:])):
            continue
        end = (
            ": the file ends in the middle of a row, remove it"
            if row == len(table.rows) - 1 and len(cells) < width
            else ""
        )
        raise InputError(f"{table.path}: line {line}: {len(cells)} cells, the header has {width}{end}")


def _number(where: str, cell: str) -> float:
    if not cell:
        raise InputError(f"{where}: missing")
    try:
        value = float(cell)
    except ValueError:
        hint = ", decimals need a point" if re.fullmatch(r"-?\d+,\d+", cell) else ""
        raise InputError(f"{where}: '{cell[:40]}' is not a number{hint}") from None
    if not math.isfinite(value):
        raise InputError(f"{where}: {cell} is not a finite number: remove the row to leave a gap")
    return value


def _spellings() -> dict[str, str]:
    """Letters of a blend shape's name in lower case -> ARKit's own spelling."""
    names: dict[str, str] = {}
    for key in ARKIT.keys:
        names[key.casefold()] = key
        short = re.sub("(Left|Right)$", lambda side: side[0][0], key)
        names.setdefault(short.casefold(), key)
    return names


_SPELLINGS = _spellings()


def _arkit_key(name: str) -> str | None:
    """ARKit's spelling of EyeBlinkLeft, eyeBlink_L, eye_blink_left, eyeBlink.L …, or None."""
    return _SPELLINGS.get(re.sub("[^a-z]", "", name.casefold()))


def _key_columns(table: _Table, optional: Iterable[str] = ()) -> dict[str, int]:
    found: dict[str, int] = {}
    for position, name in enumerate(table.header):
        key = _arkit_key(name)
        if key is not None and found.setdefault(key, position) != position:
            raise InputError(
                f"{table.path}: line 1: {name}: the same blend shape as {table.header[found[key]]}, remove one"
            )
    missing = [key for key in ARKIT.keys if key not in found and key not in optional]
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise InputError(
            f"{table.path}: line 1: {missing[0]}{more}: missing, all {len(ARKIT.keys)} blend shapes are needed"
        )
    return found


# Live Link Face


def _live_link_face(table: _Table, source_fps: float | None) -> Take:
    columns = table.index()
    timecode, count = columns["timecode"], columns.get("blendshapecount")
    notes: list[str] = []
    if count is not None:
        table = _without_face(table, count, notes)
    _check_widths(table)
    keys = _key_columns(table)
    if count is not None:
        values = len(table.header) - 2
        for row, cells in enumerate(table.rows):
            if _number(table.where(row, table.header[count]), cells[count]) != values:
                raise InputError(
                    f"{table.where(row, table.header[count])}: {cells[count]}, but the header names {values} values"
                )
    seconds, fps = _timecodes(table, timecode, source_fps, notes)
    head = {}
    for name, column, sign in (("yaw", "headyaw", 1.0), ("pitch", "headpitch", -1.0), ("roll", "headroll", 1.0)):
        if column in columns:
            head[name] = sign * table.numbers(columns[column])
    take = Take(
        name=Path(table.path).stem,
        kind="live_link_face",
        seconds=seconds,
        fps=fps,
        keys={key: table.share(position, notes) for key, position in keys.items()},
        head=head,
        notes=notes,
    )
    return _in_order(take, table)


def _without_face(table: _Table, count: int, notes: list[str]) -> _Table:
    """Rows whose count is 0 hold no values: the phone saw no face."""
    seen = [row for row, cells in enumerate(table.rows) if len(cells) <= count or cells[count] not in ("0", "0.0")]
    if not seen:
        raise InputError(f"{table.path}: no row holds a face: BlendshapeCount is 0 throughout")
    if len(seen) < len(table.rows):
        notes.append(f"{len(table.rows) - len(seen)} frames without a face, left as gaps")
    return table.keep(seen)


_TIMECODE = re.compile(r"(\d{1,2}):(\d{1,2}):(\d{1,2})([:;])(\d{1,3})(?:\.(\d{1,9}))?")


def _timecodes(table: _Table, position: int, source_fps: float | None, notes: list[str]) -> tuple[np.ndarray, float]:
    """Seconds and the rate of `HH:MM:SS:FF.mmm`: counts of frames, of which some rates skip a few a minute."""
    parts = np.empty((len(table.rows), 4))
    drop = False
    for row, cells in enumerate(table.rows):
        match = _TIMECODE.fullmatch(cells[position])
        where = table.where(row, table.header[position])
        if match is None:
            raise InputError(f"{where}: '{cells[position][:40]}' is not HH:MM:SS:FF or HH:MM:SS:FF.mmm")
        hours, minutes, seconds, mark, frame, part = match.groups()
        if int(minutes) > 59 or int(seconds) > 59 or int(hours) > 23:
            raise InputError(f"{where}: '{cells[position]}': hours go to 23, minutes and seconds to 59")
        drop = drop or mark == ";"
        parts[row] = int(hours), int(minutes), int(seconds), float(f"{frame}.{part or 0}")
    count = _frames_per_second(parts, notes)
    if source_fps is not None and 0.9 * count <= source_fps <= 1.1 * count:
        count = round(source_fps)  # 29.97 and 59.94 count to 30 and 60
    if parts[:, 3].max() >= count:
        row = int(parts[:, 3].argmax())
        raise InputError(
            f"{table.where(row, table.header[position])}: frame {parts[row, 3]:g} at {count} frames a second"
        )
    drop = drop or (count in (30, 60) and _skips_frames(parts, count))
    minutes = parts[:, 0] * 60 + parts[:, 1]
    frames = (minutes * 60 + parts[:, 2]) * count + parts[:, 3]
    rate = float(count)
    if drop:
        # SMPTE ST 12-1: at 29.97 the counts 0 and 1 (at 59.94, 0 to 3) are left out in every minute but the tenth.
        frames -= (count // 15) * (minutes - minutes // 10)
        rate = count * 1000.0 / 1001.0
        notes.append(f"drop-frame timecode: {rate:.2f} frames a second")
    if source_fps is not None and abs(source_fps / rate - 1) < 0.1:
        rate = source_fps
    seconds = frames / rate
    wraps = np.flatnonzero(np.diff(seconds) < -_LONGEST_DAY / 2)
    for wrap in wraps:  # a take over midnight
        seconds[wrap + 1 :] += _LONGEST_DAY
    doubles = _doubled(frames)
    if doubles > 1:
        # The phone ran faster than its timecode: two (or four) rows to each count, without sub-frames. They are spread
        # over the frame, in their order; merged they would lose half of the take.
        starts = np.r_[True, np.diff(frames) != 0]
        rank = np.arange(len(frames)) - np.flatnonzero(starts)[np.cumsum(starts) - 1]
        seconds = seconds + np.minimum(rank, doubles - 1) / (doubles * rate)
        notes.append(f"{doubles} rows to each timecode, spread: {doubles * rate:g} frames a second")
        rate *= doubles
    elif len(frames) > 1:
        rate /= max(1, round(float(np.median(np.diff(frames)))))  # 30 rows a second may count in sixtieths
    return seconds, source_fps if source_fps is not None else rate


def _frames_per_second(parts: np.ndarray, notes: list[str]) -> int:
    """How far the frames of a timecode count: seen where a second turns over, else from the largest count."""
    frames = parts[:, 3]
    same_second = np.all(np.diff(parts[:, :3], axis=0) == 0, axis=1)
    steps = np.diff(frames)
    inside = steps[same_second & (steps > 0)]
    whole = (parts[:, 0] * 60 + parts[:, 1]) * 60 + parts[:, 2]
    turns = np.flatnonzero(np.diff(whole) == 1)
    at_least = int(frames.max()) + 1
    rates = sorted({round(rate) for rate in FRAME_RATES})
    if len(turns) and len(inside):
        # A row lost at a turn lowers one estimate, so the median of all turns counts.
        seen = float(np.median(frames[turns] + np.median(inside) - frames[turns + 1]))
        nearest = min(rates, key=lambda rate: (abs(rate - seen), rate))
        if nearest >= at_least and abs(nearest - seen) <= 1.0:
            return nearest
    rate = next((rate for rate in rates if rate >= at_least), at_least)
    notes.append(
        f"the timecode never turns a second over cleanly: {rate} frames a second is a guess, --source-fps says it"
    )
    return rate


def _skips_frames(parts: np.ndarray, count: int) -> bool:
    """Whether every minute but the tenth begins with the count that drop-frame timecode begins with."""
    minutes = parts[:, 0] * 60 + parts[:, 1]
    turns = np.flatnonzero((np.diff(minutes) == 1) & (parts[1:, 2] == 0) & (parts[1:, 1] % 10 != 0))
    whole = turns[np.floor(parts[turns, 3]) == count - 1]  # with the last count of the minute before
    return len(whole) > 0 and bool(np.all(np.floor(parts[whole + 1, 3]) == count // 15))


def _doubled(frames: np.ndarray) -> int:
    """How many rows share a timecode, where nearly all do; else 1."""
    _, counts = np.unique(frames, return_counts=True)
    usual = int(np.median(counts))
    return usual if usual > 1 and np.mean(counts == usual) > 0.8 else 1


# OpenFace


def _openface(table: _Table, source_fps: float | None) -> Take:
    _check_widths(table)
    columns = table.index()
    notes: list[str] = []
    if "face_id" in columns:
        table = _one_face(table, columns["face_id"], notes)
    table = _tracked(table, columns, notes)
    units: dict[str, np.ndarray] = {}
    for name, position in columns.items():
        if match := re.fullmatch(r"au(\d\d)_r", name):
            units[str(int(match[1]))] = table.share(position, notes, 5.0)
    for name, position in columns.items():
        match = re.fullmatch(r"au(\d\d)_c", name)
        if match and str(int(match[1])) not in units:
            # Presence without an intensity (28): FACS intensity C, a guess.
            units[str(int(match[1]))] = 0.6 * table.share(position, notes)
            notes.append(f"{table.header[position]}: presence alone, taken as intensity C (0.6)")
    if not units:
        raise InputError(f"{table.path}: line 1: AU01_r: missing, no action unit is there: run OpenFace with -aus")
    seconds, fps = _clock(table, columns, ("timestamp",), ("frame",), source_fps, notes, unit=1.0)
    # OpenFace's camera looks along z, x to the right and y down, R = Rx Ry Rz: the face, looking along -z at rest,
    # turns to its own right with Ry, down with Rx and onto its left shoulder with Rz. gaze_angle_x grows toward the
    # subject's left and gaze_angle_y down, both in the camera's frame: less the head's turn they are the eyes' own.
    head, gaze = {}, {}
    for name, column, sign in (("yaw", "pose_ry", -1.0), ("pitch", "pose_rx", -1.0), ("roll", "pose_rz", 1.0)):
        if column in columns:
            head[name] = sign * table.numbers(columns[column])
    for name, column, sign in (("yaw", "gaze_angle_x", 1.0), ("pitch", "gaze_angle_y", -1.0)):
        if column in columns:
            gaze[name] = sign * table.numbers(columns[column]) - head.get(name, 0.0)
    take = Take(Path(table.path).stem, "openface", seconds, fps, units=units, head=head, gaze=gaze, notes=notes)
    return _in_order(take, table)


def _one_face(table: _Table, position: int, notes: list[str]) -> _Table:
    faces: dict[str, list[int]] = {}
    for row, cells in enumerate(table.rows):
        faces.setdefault(cells[position], []).append(row)
    if len(faces) > 1:
        face = max(faces, key=lambda name: len(faces[name]))
        notes.append(f"{len(faces)} faces, the one seen most (face_id {face}) is taken")
        return table.keep(faces[face])
    return table


def _tracked(table: _Table, columns: dict[str, int], notes: list[str]) -> _Table:
    good = table.numbers(columns["confidence"]) >= MIN_CONFIDENCE
    if "success" in columns:
        good &= table.numbers(columns["success"]) > 0
    if not good.any():
        raise InputError(
            f"{table.path}: no row holds a face: success is 0 or confidence below {MIN_CONFIDENCE} throughout"
        )
    if not good.all():
        notes.append(f"{np.sum(~good)} frames that the tracker lost, left as gaps")
        return table.keep(np.flatnonzero(good).tolist())
    return table


# MediaPipe and everything else that writes ARKit keys with a time


_SECONDS = {
    "seconds": 1.0,
    "time_s": 1.0,
    "timestamp_s": 1.0,
    "time_sec": 1.0,
    "time_seconds": 1.0,
    "timestamp_sec": 1.0,
    "time_ms": 1e-3,
    "timestamp_ms": 1e-3,
    "milliseconds": 1e-3,
    "timestamp_us": 1e-6,
    "time_us": 1e-6,
}
_CLOCKS = ("timestamp", "time", "t")
_FRAMES = ("frame", "frame_idx", "frame_index", "frame_id", "frame_number", "frameindex", "framenumber")


def _mediapipe(table: _Table, source_fps: float | None) -> Take:
    _check_widths(table)
    columns = table.index()
    notes: list[str] = []
    keys = _key_columns(table, optional=("tongueOut",))
    if "tongueOut" not in keys:
        notes.append("tongueOut: not in the file (MediaPipe has none)")
    named = next((name for name in _SECONDS if name in columns), None)
    if named is not None:
        seconds, fps = _clock(table, columns, (named,), (), source_fps, notes, unit=_SECONDS[named])
    else:
        seconds, fps = _clock(table, columns, _CLOCKS, _FRAMES, source_fps, notes, unit=None)
    values = {key: table.share(position, notes) for key, position in keys.items()}
    return _in_order(Take(Path(table.path).stem, "mediapipe", seconds, fps, keys=values, notes=notes), table)


def _clock(
    table: _Table,
    columns: dict[str, int],
    clocks: Sequence[str],
    counters: Sequence[str],
    source_fps: float | None,
    notes: list[str],
    unit: float | None,
) -> tuple[np.ndarray, float]:
    """Seconds and rate, from the first column of `clocks`, else by counting frames. `unit` None: from its steps."""
    clock = next((name for name in clocks if name in columns), None)
    if clock is not None:
        values = table.numbers(columns[clock])
        steps = np.diff(np.sort(values))
        if np.any(steps > 0):
            if np.abs(values).max() > _LARGEST_TICK:
                row = int(np.abs(values).argmax())
                raise InputError(f"{table.where(row, table.header[columns[clock]])}: {values[row]:g} is no time")
            scale = unit if unit is not None else _unit_of(float(np.median(steps[steps > 0])), clock, notes)
            seconds = (values - values.min()) * scale
            return seconds, source_fps or detected_rate(seconds)
    counter = next((name for name in counters if name in columns), None)
    if source_fps is None:
        if len(table.rows) == 1:
            return np.zeros(1), 24.0
        has = f"{table.header[columns[clock]]} never advances" if clock else "no column tells the time"
        raise InputError(
            f"{table.path}: line 1: {has}: "
            f"needs {clocks[0]} ({'seconds' if unit == 1.0 else 'a time'}), or --source-fps"
        )
    frames = table.numbers(columns[counter]) if counter else np.arange(len(table.rows), dtype=float)
    return frames / source_fps, source_fps


def _unit_of(step: float, clock: str, notes: list[str]) -> float:
    """Seconds in one tick of a clock of unknown unit: faces are filmed at 2 to 500 frames a second."""
    most = {"s": 0.5, "ms": 500.0, "µs": 5e5, "ns": math.inf}
    name = next(name for name in most if step <= most[name])
    notes.append(f"{clock}: steps of {step:g}, taken as {name}")
    return {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9}[name]


# Time


def detected_rate(seconds: np.ndarray) -> float:
    """Frames a second of times (N,), in any order, some lost: a standard rate where one is near."""
    steps = np.diff(np.sort(seconds))
    steps = steps[steps > 1e-6]
    if not len(steps):
        return 24.0
    frames = np.round(steps / np.median(steps))
    # Clocks rounded to the millisecond (OpenFace) need the whole span, less the gaps, to tell 29.97 from 30.
    near = (frames >= 1) & (np.abs(steps / np.median(steps) - frames) < 0.25)
    rate = float(frames[near].sum() / steps[near].sum())
    standard = min(FRAME_RATES, key=lambda known: abs(known - rate))
    return standard if abs(standard / rate - 1) < _STANDARD_RATE else rate


def _in_order(take: Take, table: _Table) -> Take:
    """Sorts small disorder, merges rows at one time, notes gaps. Raises InputError where time runs back."""
    seconds, frame = take.seconds, 1.0 / take.fps
    if len(seconds) > 1:
        back = np.flatnonzero(np.diff(seconds) < -2.5 * frame)
        if len(back):
            line = table.lines[back[0] + 1]
            raise InputError(
                f"{table.path}: line {line}: time runs back {-np.diff(seconds)[back[0]]:.3f} s: split the takes"
            )
    order = np.argsort(seconds, kind="stable")
    ordered = seconds[order]
    # Rows nearer than a quarter of a frame are one frame seen twice.
    first = np.r_[True, np.diff(ordered) > 0.25 * frame]
    group = np.cumsum(first) - 1
    merged = len(seconds) - int(first.sum())
    share = 1.0 / np.bincount(group)

    def merge(values: np.ndarray) -> np.ndarray:
        return np.bincount(group, values[order]) * share

    if merged:
        take.notes.append(f"{merged} rows at a time that was there already, merged")
    take.seconds = merge(seconds)
    for curves in (take.keys, take.units, take.head, take.gaze):
        for name, values in curves.items():
            curves[name] = merge(values)
    lost = np.round(np.diff(take.seconds) / frame).astype(int) - 1
    if np.any(lost > 0):
        take.notes.append(
            f"{lost[lost > 0].sum()} frames lost in {np.sum(lost > 0)} gaps, "
            f"the longest {np.diff(take.seconds).max():.2f} s, bridged by straight lines"
        )
    return take
