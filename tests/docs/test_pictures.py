"""Every picture of docs/ has a maker in tools/pictures.toml, and every maker its pictures."""

from __future__ import annotations

import fnmatch
import importlib.util
import re
import shlex
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
SHOWN = re.compile(r"!\[[^\]]*\]\((?:docs/)?([^)\s]+)\)")


def _tool():
    spec = importlib.util.spec_from_file_location("pictures", ROOT / "tools/pictures.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


TOOL = _tool()
MAKERS = TOOL.makers()
FILES = {path.name for path in DOCS.iterdir() if path.suffix in (".png", ".jpg", ".svg", ".webp", ".gif")}


def test_every_picture_has_one_maker_and_every_maker_its_pictures():
    made = Counter(name for maker in MAKERS for name in TOOL.pictures_of(maker))
    assert set(made) == FILES
    assert set(made.values()) == {1}
    for maker in MAKERS:
        for pattern in maker["pictures"]:
            assert any(fnmatch.fnmatch(name, pattern) for name in FILES), f"there is no {pattern}"


def test_every_picture_is_shown_somewhere():
    pages = [*DOCS.glob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    linked = set(SHOWN.findall(text)) | set(re.findall(r"\]\((?:docs/)?([^)\s]+\.(?:png|jpg))\)", text))
    assert FILES <= linked


@pytest.mark.parametrize("maker", MAKERS, ids=lambda maker: maker["pictures"][0])
def test_makers_name_their_pictures(maker):
    """The script is there, is part of the command or what it runs, and knows what it is to write."""
    script = ROOT / maker["script"]
    text = script.read_text(encoding="utf-8")
    for name in TOOL.pictures_of(maker):
        prefixed = f"{name.partition('_')[0]}_{{" in text  # an f-string that puts a prefix before a plot's name
        assert name in text or prefixed, f"{maker['script']} does not write {name}"
    words = shlex.split(maker["command"])
    assert words[0] in ("python", "make")
    if words[0] == "python" and words[1] != "-m":
        assert (ROOT / words[1]).is_file()
    if words[0] == "make":
        assert re.search(rf"(?m)^{words[1]}:", (ROOT / "Makefile").read_text(encoding="utf-8"))


def test_makers_are_chosen_by_name():
    first = MAKERS[0]["pictures"][0]
    assert TOOL.chosen([first]) == TOOL.chosen([Path(first).stem]) == [MAKERS[0]]
    assert TOOL.chosen([]) == MAKERS
    with pytest.raises(SystemExit, match="no picture nobody"):
        TOOL.chosen(["nobody"])


def test_a_maker_that_makes_nothing_fails(tmp_path, monkeypatch):
    monkeypatch.setattr(TOOL, "DOCS", tmp_path)
    monkeypatch.setattr(TOOL, "ROOT", tmp_path)
    picture = tmp_path / "a.png"
    write = f"import pathlib; pathlib.Path({str(picture)!r}).write_text('new')"
    good = {"pictures": ["a.png"], "command": shlex.join(["python", "-c", write])}
    idle = {"pictures": ["a.png"], "command": "python -c pass"}
    assert "did not make a.png" in TOOL.make(idle)
    assert TOOL.make(good) == ""
    assert "exit status 3" in TOOL.make({"pictures": ["a.png"], "command": "python -c 'raise SystemExit(3)'"})
