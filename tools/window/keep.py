#!/usr/bin/env python3
"""Brings what a whole `make window` has seen into docs/: keep.py SHOTS DOCS

Screenshots as JPEG, and the counted clicks into the page between its marks. `make window KEEP=1` runs it.
"""

import re
import sys
from pathlib import Path

import numpy as np
import sanguine_core

WIDTH = 1400
# Picture of the page -> (screenshot, its box as left, top, right, bottom) side by side.
WHOLE = (0, 0, WIDTH, 900)
SIDEBAR = (1108, 80, 1375, 880)
PICTURES = {
    "window_install.jpg": [("install_from_disk", (140, 95, 1260, 765))],
    "window_adopted.jpg": [("first_emotion", (0, 0, 1160, 820))],
    "window_first_blush.jpg": [("first_rendered", (0, 0, 1160, 820))],
    "window_add_head.jpg": [("add_head_menu", (0, 0, 1160, 500))],
    "window_panels.jpg": [(name, SIDEBAR) for name in ("skin", "blood", "features", "plan")],
    "window_panels_more.jpg": [(name, SIDEBAR) for name in ("blood_in_time", "physiology", "action_units", "from_a_picture")],
    "window_emotions.jpg": [("anger", WHOLE)],
    "window_blood_in_time.jpg": [("baked", WHOLE)],
    "window_poses.jpg": [("poses", WHOLE)],
}
PAGE, MARKS = "first_blush.md", ("<!-- clicks -->\n", "<!-- /clicks -->\n")


def main(shots: Path, docs: Path) -> None:
    for target, pieces in PICTURES.items():
        columns = []
        for name, (left, top, right, bottom) in pieces:
            pixels = sanguine_core.read_image(str(shots / f"{name}.png"))[::-1, :, :3]
            columns.append(pixels[top:bottom, left:right])
        joined = np.ascontiguousarray(np.concatenate(columns, axis=1)[::-1])
        sanguine_core.write_image(str(docs / target), joined)
    page = docs / PAGE
    first, last = MARKS
    table = (shots / "clicks.md").read_text()
    text = re.sub(f"(?s){first}.*?{last}", lambda _: f"{first}{table}{last}", page.read_text())
    page.write_text(text)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
