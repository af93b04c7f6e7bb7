#!/usr/bin/env python3
"""One room of `make chroots`, from within: what the zip does on a machine that has Blender and nothing of ours.

    inside.py ROOM              runs the checks (root, in the chroot); out/result.json
    inside.py --table ROOM ...  outside, from the top of the tree: prints the results side by side; status 1 unless all are well

Blender runs as a user who owns nothing but a home folder. Each check is a Blender of its own (check.py).
"""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import time
import tomllib
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
RESULTS = Path("out/chroots")
OUT = HERE / "out"
HOME = HERE / "home"
USER = 65533  # nobody's: owns nothing
SECONDS = 600

# What stands for a permission in Python; an extension that asks for `network` or `clipboard` has to use it, and the reverse.
NETWORK = {"socket", "ssl", "http", "urllib", "urllib3", "requests", "ftplib", "smtplib", "asyncio", "xmlrpc", "webbrowser"}
COMPILERS = ("cc", "gcc", "g++", "c++", "clang", "cmake", "ninja", "make")
# Debian's own Blender is linked to the system's OpenImageIO and OpenEXR; beside `bpy` there must be none.
IMAGE_LIBRARIES = ("libopenimageio", "libopenexr", "libimath", "libeigen", "libglm", "libopencv")
# Where a run of Blender may leave files: its user folder, the user's caches, temporary ones.
ALLOWED = (f"{HOME}/.config/blender/", f"{HOME}/.cache/", f"{OUT}/", "/tmp/")
# Cycles' own update of a script node leaves the compiled shader there (addons_core/cycles/osl.py, update_internal_script).
BLENDERS_OWN = re.compile(r"/tmp/tmp\w{8}\.oso")


class Wrong(Exception):
    """A check did not find what it should."""


def need(condition: object, otherwise: str) -> None:
    if not condition:
        raise Wrong(otherwise)


def blender(*arguments: str, real: bool, command: bool = False) -> str:
    """Output of a Blender: the program, or the module; `command`: its own extension tool."""
    if command:
        tool = ["blender", "--command", "extension"] if real else ["/opt/blender/bin/python", "-B", str(extension_tool())]
        line = [*tool, *arguments]
    elif real:
        line = ["blender", "--background", "--factory-startup", "--python-exit-code", "1", "--python", str(HERE / "check.py"), "--", *arguments]
    else:
        line = ["/opt/blender/bin/python", "-B", str(HERE / "check.py"), *arguments]
    environment = {"PATH": "/usr/bin:/bin", "LANG": "C.UTF-8", "HOME": str(HOME), "USER": "artist"}
    done = subprocess.run(
        line, env=environment, cwd=HOME, user=USER, group=USER, extra_groups=[], timeout=SECONDS,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    with (OUT / "log.txt").open("a") as log:
        log.write(f"$ {' '.join(line)}\n{done.stdout}\n")
    lines = [text for text in done.stdout.splitlines() if text.strip()]
    need(done.returncode == 0 and "Traceback" not in done.stdout, f"status {done.returncode}: " + " / ".join(lines[-6:]))
    return done.stdout


def extension_tool() -> Path:
    (tool,) = Path("/opt/blender/lib").glob("python3.*/site-packages/bpy/*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    return tool


def files() -> dict[str, tuple[int, int]]:
    """Every file of this system -> (time of its last change of any kind, size)."""
    found = {}
    for folder, names, here in os.walk("/"):
        names[:] = [name for name in names if os.path.join(folder, name) not in ("/proc", "/sys", "/mnt", "/dev")]
        for name in here:
            path = os.path.join(folder, name)
            try:
                state = os.lstat(path)
            except FileNotFoundError:
                continue
            found[path] = (state.st_ctime_ns, state.st_size)
    return found


class Room:
    def __init__(self, name: str) -> None:
        self.real = name == "window"
        (self.archive,) = HERE.glob("sanguine-*.zip")
        self.before: dict[str, tuple[int, int]] = {}

    def bare(self) -> str:
        found = [name for name in COMPILERS if shutil.which(name)]
        need(not found, f"there is a compiler: {found}")
        listed = subprocess.run(["dpkg-query", "--show", "--showformat=${Package}\n"], capture_output=True, text=True, check=True)
        names = listed.stdout.split()
        images = [name for name in names if name.startswith(IMAGE_LIBRARIES)]
        need(self.real or not images, f"there are image libraries: {images}")
        return f"{len(names)} packages"

    def network(self) -> str:
        try:
            socket.create_connection(("1.1.1.1", 53), timeout=2).close()
        except OSError as error:
            return error.strerror or "none"
        raise Wrong("this room is not cut off")

    def validate(self) -> str:
        blender("validate", str(self.archive), real=self.real, command=True)
        return f"{self.archive.stat().st_size / 1e6:.1f} MB"

    def permissions(self) -> str:
        used = {"files"}  # maps and pictures are what it is for
        with zipfile.ZipFile(self.archive) as content:
            manifest = tomllib.loads(content.read("blender_manifest.toml").decode())
            for name in content.namelist():
                if not name.endswith(".py"):
                    continue
                for node in ast.walk(ast.parse(content.read(name))):
                    modules = [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
                    modules += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                    used |= {"network"} if NETWORK & {module.split(".")[0] for module in modules} else set()
                    used |= {"clipboard"} if isinstance(node, ast.Attribute) and node.attr == "clipboard" else set()
        asked = set(manifest.get("permissions", {}))
        need(asked == used, f"asks for {sorted(asked)}, uses {sorted(used)}")
        return ", ".join(sorted(asked))

    def install(self) -> str:
        started = time.monotonic()
        if self.real:
            blender("install-file", "-r", "user_default", "-e", str(self.archive), real=True, command=True)
        else:
            blender("install", str(self.archive), real=False)
        found = list((HOME / ".config/blender").glob("*/extensions/user_default/sanguine/blender_manifest.toml"))
        need(len(found) == 1, f"installed: {found}")
        self.extension = found[0].parent
        self.installed = self.own_files()
        return f"{time.monotonic() - started:.0f} s"

    def own_files(self) -> set[tuple[str, int]]:
        """The extension's files and when they were written; Python's compiled ones are Blender's own doing."""
        return {(str(p), p.stat().st_mtime_ns) for p in self.extension.rglob("*") if p.is_file() and p.suffix != ".pyc"}

    def check(self, stage: str) -> str:
        output = blender(stage, real=self.real)
        (said,) = re.findall(r"^SAID (.*)$", output, re.MULTILINE)
        return said

    def writes(self) -> str:
        after = files()
        changed = [path for path, state in after.items() if self.before.get(path) != state]
        gone = [path for path in self.before if path not in after]
        outside = [path for path in changed + gone if not path.startswith(ALLOWED)]
        need(not outside, f"outside: {outside[:5]}")
        left = [path for path in changed if path.startswith("/tmp/") and not path.startswith(f"{HERE}/")]
        left = [path for path in left if not BLENDERS_OWN.fullmatch(path)]
        need(not left, f"left in /tmp: {left[:5]}")
        changed_own = sorted({path for path, _ in self.own_files() ^ self.installed})
        need(not changed_own, f"in the extension's own folder: {changed_own[:5]}")
        cached = sum(path.startswith(f"{HOME}/.cache/sanguine/") for path in changed)
        return f"{len(changed)} files in its user folder, {cached} of them cached maps"

    def steps(self):
        return [
            ("bare", self.bare),
            ("no network", self.network),
            ("validate", self.validate),
            ("permissions", self.permissions),
            ("install, enable", self.install),
            ("solves as outside", lambda: self.check("solve")),
            ("own libraries only", lambda: self.check("libraries")),
            ("Blender's OpenImageIO, oslquery after it", lambda: self.check("after")),
            ("and before it", lambda: self.check("before")),
            ("Add Head", lambda: self.check("head")),
            ("Adopt, render", lambda: self.check("face")),
            ("disable, enable again", lambda: self.check("again")),
            ("writes", self.writes),
        ]  # fmt: skip


def run(name: str) -> int:
    room = Room(name)
    for folder in (OUT, HOME):
        folder.mkdir()
        os.chown(folder, USER, USER)
    room.before = files()
    results = []
    for what, step in room.steps():
        try:
            results.append({"check": what, "well": True, "said": step()})
        except (Wrong, subprocess.TimeoutExpired, ValueError, AttributeError) as error:
            results.append({"check": what, "well": False, "said": str(error)})
        print(f"{'ok    ' if results[-1]['well'] else 'FAILED'}  {what}: {results[-1]['said']}", flush=True)
    (OUT / "result.json").write_text(json.dumps(results))
    return not all(row["well"] for row in results)


def table(names: list[str]) -> int:
    rooms = {}
    for name in names:
        path = RESULTS / name / "result.json"
        rooms[name] = {row["check"]: row for row in json.loads(path.read_text())} if path.is_file() else {}
    checks = list(dict.fromkeys(check for room in rooms.values() for check in room))
    wrong = [name for name, room in rooms.items() if not room]
    print("| | " + " | ".join(names) + " |\n" + "|---" * (len(names) + 1) + "|")
    for check in checks:
        cells = []
        for name, room in rooms.items():
            row = room.get(check, {"well": False, "said": "not run"})
            cells.append(row["said"] if row["well"] else f"FAILED: {row['said'][:200]}")
            if not row["well"]:
                wrong.append(f"{name}: {check}")
        print(f"| {check} | " + " | ".join(cells) + " |")
    if wrong:
        print("failed: " + ", ".join(wrong), file=sys.stderr)
    return len(wrong) > 0


if __name__ == "__main__":
    sys.exit(table(sys.argv[2:]) if sys.argv[1] == "--table" else run(sys.argv[1]))
