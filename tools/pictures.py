#!/usr/bin/env python3
"""Makes pictures of docs/ anew, as tools/pictures.toml says: pictures.py [--only NAME,…] [--list]

A name is that of a picture, with or without its ending. All of them take hours.
"""

from __future__ import annotations

import argparse
import os
import shlex
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"


def makers() -> list[dict[str, Any]]:
    return tomllib.loads((ROOT / "tools/pictures.toml").read_text(encoding="utf-8"))["maker"]


def pictures_of(maker: dict[str, Any]) -> list[str]:
    """Names, those that a pattern stands for among what docs/ has."""
    return [
        name
        for pattern in maker["pictures"]
        for name in (sorted(path.name for path in DOCS.glob(pattern)) if "*" in pattern else [pattern])
    ]


def chosen(only: list[str]) -> list[dict[str, Any]]:
    """The makers of these pictures, of all when none is named. Exits with a line for a picture that there is not."""
    names = {name: maker for maker in makers() for picture in pictures_of(maker) for name in (picture, Path(picture).stem)}
    if unknown := [name for name in only if name not in names]:
        sys.exit(f"pictures: no picture {', '.join(unknown)}: {', '.join(name for name in names if '.' in name)}")
    wanted = [names[name] for name in only] or makers()
    return [maker for maker in makers() if maker in wanted]


def make(maker: dict[str, Any]) -> str:
    """Runs a maker. Returns what went wrong, "" if nothing did: a picture that it leaves as it was is not made."""
    before = time.time()
    command = [sys.executable if word == "python" else word for word in shlex.split(maker["command"])]
    bin_folder = str(Path(sys.executable).parent)
    done = subprocess.run(command, cwd=ROOT, env=os.environ | {"PATH": f"{bin_folder}:{os.environ['PATH']}"})
    if done.returncode:
        return f"{maker['command']}: exit status {done.returncode}" + (f" (it needs {maker['needs']})" if "needs" in maker else "")
    left = [name for name in pictures_of(maker) if not (DOCS / name).exists() or (DOCS / name).stat().st_mtime < before - 1.0]
    return f"{maker['command']}: did not make {', '.join(left)}" if left else ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", metavar="NAME,…")
    parser.add_argument("--list", action="store_true", help="print the pictures and their makers, make none")
    options = parser.parse_args()
    failed = []
    for maker in chosen([name for name in options.only.split(",") if name]):
        print(f"{', '.join(pictures_of(maker))}: {maker['command']}", flush=True)
        if options.list:
            continue
        start = time.monotonic()
        if why := make(maker):
            failed.append(why)
        print(f"  {time.monotonic() - start:.0f} s{': ' + why if why else ''}", flush=True)
    for why in failed:
        print(f"pictures: {why}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
