"""A Blender with a window on a virtual screen, seen by reading the screen and moved by mouse and keyboard.

Widgets are found by the words on them (Tesseract), as a user finds them: a label that is cut off is not found.
"""

import atexit
import csv
import difflib
import io
import json
import os
import socket
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

WIDTH, HEIGHT = 1400, 900
SCALE = 3  # Tesseract wants letters of some 30 pixels; Blender's have 10
ALIKE = 0.8  # share of the letters that have to be read right
STILL_S = 0.25  # a picture that did not change for so long is drawn
PATIENCE_S = 60.0


class Failed(Exception):
    """A step of a tour did not do what it should."""


@dataclass(frozen=True)
class Box:
    """Pixels of the screen, y downwards."""

    x: int
    y: int
    width: int
    height: int

    @property
    def middle(self) -> tuple[int, int]:
        return self.x + self.width // 2, self.y + self.height // 2


WHOLE = Box(0, 0, WIDTH, HEIGHT)


class Screen:
    """Xvfb and the Blender in it. `ask` and `do` run Python inside it (bridge.py)."""

    def __init__(self, folder: Path, *arguments: str, home: Path | None = None) -> None:
        self.folder = folder
        self.shots = folder / "shots"
        self.shots.mkdir(exist_ok=True)
        self.log = folder / "blender.log"
        path = str(folder / "bridge.socket")
        Path(path).unlink(missing_ok=True)
        geometry = f"{WIDTH}x{HEIGHT}x24"
        free, said = os.pipe()  # Xvfb takes a display that nobody has, and says which
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(said), "-screen", "0", geometry, "+extension", "GLX", "-nolisten", "tcp",
             "-fbdir", str(folder)], stderr=subprocess.DEVNULL, pass_fds=(said,)
        )  # fmt: skip
        os.close(said)
        with os.fdopen(free) as answer:
            display = answer.readline().strip()
        if not display:
            raise Failed("Xvfb does not start")
        self.pixels = folder / "Xvfb_screen0"  # what is on the screen, as a file
        where = {"HOME": str(home)} if home else {}
        self.environment = dict(os.environ | where, DISPLAY=f":{display}", LIBGL_ALWAYS_SOFTWARE="1", SANGUINE_BRIDGE=path)
        atexit.register(self.close)
        with self.log.open("ab") as log:
            self.blender = subprocess.Popen(
                ["blender", "-p", "0", "0", str(WIDTH), str(HEIGHT), *arguments, "--python", str(folder / "bridge.py")],
                env=self.environment, stdout=log, stderr=log,
            )
        self.bridge = socket.socket(socket.AF_UNIX)
        for _ in range(600):
            try:
                self.bridge.connect(path)
                break
            except OSError:
                if self.blender.poll() is not None:
                    raise Failed(f"Blender ended with {self.blender.returncode}: see {self.log.name}") from None
                time.sleep(0.1)
        self.answers = self.bridge.makefile("r")

    def close(self) -> None:
        for process in (self.blender, self.server):
            if process.poll() is None:
                process.terminate()
                process.wait(10)

    def cpu_s(self) -> float:
        """Processor time that Blender has taken so far."""
        fields = Path(f"/proc/{self.blender.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")  # utime, stime: proc(5)

    def _question(self, **question: str) -> Any:
        try:
            self.bridge.sendall(json.dumps(question).encode())
            answer = json.loads(self.answers.readline())
        except (OSError, ValueError):
            raise Failed(f"Blender is gone at {question}: see {self.log.name}") from None
        if "error" in answer:
            raise Failed(f"{question}:\n{answer['error']}")
        return answer["value"]

    def ask(self, expression: str) -> Any:
        return self._question(eval=expression)

    def do(self, statements: str) -> None:
        self._question(exec=statements)
        self.settle()

    def wait(self, expression: str, seconds: float = PATIENCE_S) -> None:
        """Until the expression is true."""
        until = time.monotonic() + seconds
        while not self.ask(expression):
            if time.monotonic() > until:
                raise Failed(f"never true: {expression}")
            time.sleep(0.1)

    def _run(self, *command: str, given: bytes | None = None) -> bytes:
        return subprocess.run(command, env=self.environment, input=given, capture_output=True, check=True).stdout

    def settle(self) -> None:
        """Until Blender has drawn what there is to draw: software OpenGL on a busy machine takes its time."""
        before, until = b"", time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            self.ask("0")  # it went through its events
            time.sleep(STILL_S)
            now = self.pixels.read_bytes()
            if now == before:
                return
            before = now
        raise Failed("the screen does not come to rest")

    def shot(self, name: str, box: Box = WHOLE) -> None:
        crop = f"{box.width}x{box.height}+{box.x}+{box.y}"
        self._run("convert", f"xwd:{self.pixels}", "-crop", crop, "+repage", str(self.shots / f"{name}.png"))

    def words(self, box: Box, turned: bool = False) -> list[tuple[str, Box]]:
        """What is written there, line by line. turned: text that runs downwards, as on the sidebar's tabs."""
        crop = f"{box.width}x{box.height}+{box.x}+{box.y}"
        turn = ["-rotate", "270"] if turned else []
        large = self._run(
            "convert", f"xwd:{self.pixels}", "-crop", crop, "+repage", *turn, "-colorspace", "Gray", "-filter", "Lanczos", "-resize", f"{100 * SCALE}%",
            "-level", "40%,80%", "-negate", "png:-",  # letters are the brightest there is
        )  # fmt: skip
        read = self._run("tesseract", "-", "-", "--psm", "11", "tsv", given=large).decode()
        found = []
        for row in csv.DictReader(io.StringIO(read), delimiter="\t", quoting=csv.QUOTE_NONE):
            if row["text"].strip():
                x, y, width, height = (int(row[key]) // SCALE for key in ("left", "top", "width", "height"))
                if turned:
                    x, y, width, height = box.width - y - height, x, height, width
                found.append((row["text"], Box(box.x + x, box.y + y, width, height)))
        return found

    def find(self, text: str, box: Box = WHOLE, turned: bool = False, begins: range | None = None) -> Box:
        """Where `text` is written; begins: at which x. Raises Failed with all that is written there."""
        wanted = "".join(text.lower().split())
        words = self.words(box, turned)
        best, place = 0.0, None
        for first in range(len(words)):
            if begins and words[first][1].x not in begins:
                continue
            for last in range(first, min(first + len(text.split()) + 1, len(words))):
                run = words[first : last + 1]
                if not turned and max(b.y for _, b in run) - min(b.y for _, b in run) > 6:
                    break
                ratio = difflib.SequenceMatcher(None, wanted, "".join(w for w, _ in run).lower()).ratio()
                if ratio > best:
                    x, y = min(b.x for _, b in run), min(b.y for _, b in run)
                    right, low = max(b.x + b.width for _, b in run), max(b.y + b.height for _, b in run)
                    best, place = ratio, Box(x, y, right - x, low - y)
        if place is None or best < ALIKE:
            raise Failed(f"'{text}' is not on the screen; there is: {' | '.join(word for word, _ in words)}")
        return place

    def move(self, x: int, y: int) -> None:
        self._run("xdotool", "mousemove", str(x), str(y))
        time.sleep(0.15)

    def press(self, x: int, y: int) -> None:
        """A click, without waiting for what comes of it."""
        self.move(x, y)
        self._run("xdotool", "click", "1")

    def press_key(self, key: str) -> None:
        self._run("xdotool", "key", key)

    def click(self, x: int, y: int, *held: str, button: int = 1) -> None:
        self.move(x, y)
        self._run("xdotool", *(["keydown", *held] if held else []), "click", str(button))
        if held:
            self._run("xdotool", "keyup", *held)
        self.settle()

    def scroll(self, x: int, y: int, notches: int) -> None:
        """Turns the wheel there; down is positive."""
        self.move(x, y)
        self._run("xdotool", "click", "--repeat", str(abs(notches)), "--delay", "20", "5" if notches > 0 else "4")
        self.settle()

    def drag(self, start: tuple[int, int], end: tuple[int, int], steps: int = 12) -> None:
        self.move(*start)
        self._run("xdotool", "mousedown", "1")
        time.sleep(0.1)
        for i in range(1, steps + 1):
            self._run("xdotool", "mousemove", *(str(a + (b - a) * i // steps) for a, b in zip(start, end, strict=True)))
            time.sleep(0.04)
        self._run("xdotool", "mouseup", "1")
        self.settle()

    def key(self, *keys: str) -> None:
        for key in keys:
            self._run("xdotool", "key", key)
            time.sleep(0.15)
        self.settle()

    def type(self, text: str) -> None:
        self._run("xdotool", "type", "--delay", "60", text)
        self.settle()

    def window(self, title: str, box: Box) -> None:
        """Puts a further window of Blender's there: without a window manager it opens wherever the mouse is."""
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            for number in self._run("xdotool", "search", "--onlyvisible", "--name", title).decode().split():
                self._run("xdotool", "windowsize", number, str(box.width), str(box.height))
                self._run("xdotool", "windowmove", number, str(box.x), str(box.y))
                self.settle()
                return
            time.sleep(0.1)
        raise Failed(f"no window '{title}'")

    def close_windows(self) -> None:
        """All but the first, as their frames' X would."""
        self.do(
            "for w in list(bpy.context.window_manager.windows)[1:]:\n"
            "    with bpy.context.temp_override(window=w): bpy.ops.wm.window_close()"
        )

    def region(self, kind: str = "UI", area: str = "VIEW_3D") -> Box:
        """A region of the window's first area of a type."""
        place = (
            f"next((r.x, r.y, r.width, r.height) for a in bpy.context.window.screen.areas if a.type == {area!r} "
            f"for r in a.regions if r.type == {kind!r})"
        )
        self.wait(f"min({place}[2:]) > 1")  # a region that was only just opened is a point at first
        x, y, width, height = self.ask(place)
        return Box(x, HEIGHT - y - height, width, height)

    def check(self, what: str, expression: str) -> None:
        """Fails unless the expression is true inside Blender, after it had time to redraw."""
        for _ in range(20):
            if value := self.ask(expression):
                return
            time.sleep(0.1)
        raise Failed(f"{what}: {expression} is {value}")


def tried(steps: list[tuple[str, Callable[[], None]]], screen: Screen | None = None) -> list[str]:
    """Runs every step, whatever became of the others; returns a line for each that failed, and keeps its picture."""
    failures = []
    for name, step in steps:
        try:
            step()
            print(f"ok      {name}", flush=True)
        except Failed as error:
            failures.append(f"{name}: {error}")
            print(f"FAILED  {name}: {error}", flush=True)
            if screen:
                screen.shot(f"failed_{name.lower().replace(' ', '_')}")
    return failures
