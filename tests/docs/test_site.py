"""The site of docs/: it builds, nothing in it is broken or fetched, and what it says of the program is so."""

from __future__ import annotations

import ast
import html.parser
import importlib.util
import itertools
import os
import re
import shlex
import subprocess
import sys
import tomllib
import urllib.parse
from pathlib import Path

import pytest
import yaml

from sanguine.cli.main import _parser
from sanguine.domain.effects import EFFECTS
from sanguine.domain.errors import InputError
from sanguine.domain.shot import Shot, read_shot

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
WITH_COMMANDS = [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
ADDON = ROOT / "addon"


def _load(name: str):
    spec = importlib.util.spec_from_file_location(name, ROOT / "tools" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# -- the built site ---------------------------------------------------------------------------------------------------


class _Page(html.parser.HTMLParser):
    """What a page shows, links to and loads."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        found = dict(attributes)
        self.ids |= {value for name in ("id", "name") if (value := found.get(name))}
        if tag == "a" and found.get("href"):
            self.links.append(found["href"])
        if tag in ("img", "script", "iframe", "source", "video") and found.get("src"):
            self.loads.append(found["src"])
        if tag == "link" and found.get("rel") not in ("canonical", "prev", "next") and found.get("href"):
            self.loads.append(found["href"])


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("site")
    # Without a network namespace of its own it could fetch; with no proxy that answers, it would fail if it tried.
    dead = {name: "http://127.0.0.1:9" for name in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY")}
    done = subprocess.run([sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", out], cwd=ROOT, text=True,
                          capture_output=True, env=os.environ | dead | {"NO_MKDOCS_2_WARNING": "1"})
    assert done.returncode == 0, done.stdout + done.stderr
    return out


@pytest.fixture(scope="module")
def built(site) -> dict[Path, _Page]:
    return {path: _Page(path.read_text(encoding="utf-8")) for path in site.glob("**/*.html")}


def test_every_page_is_built_and_in_the_navigation(site, built):
    start = built[site / "index.html"]
    for page in PAGES:
        assert (site / f"{page.stem}.html") in built
        assert f"{page.stem}.html" in start.links, f"{page.name}: stands nowhere in the navigation"


def test_nothing_is_fetched(site, built):
    for path, page in built.items():
        for target in page.loads:
            assert not urllib.parse.urlsplit(target).scheme and not target.startswith("//"), f"{path.name} loads {target}"
        # The theme's script would fetch what draws these.
        assert 'class="mermaid"' not in path.read_text(encoding="utf-8"), path.name
    for style in site.glob("**/*.css"):
        text = style.read_text(encoding="utf-8")
        assert not re.search(r"(@import|url\(\s*['\"]?\s*(https?:)?//)", text), style.name


def test_links_anchors_and_pictures_are_there(site, built):
    missing = []
    for path, page in built.items():
        if path.name == "404.html":
            continue  # its links are from the root of a server
        for target in page.links + page.loads:
            parts = urllib.parse.urlsplit(target)
            if parts.scheme or target.startswith("//"):
                continue
            file = (path.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else path
            if file.is_dir():
                file /= "index.html"
            anchor = urllib.parse.unquote(parts.fragment)
            if not file.is_file() or (anchor and file in built and anchor not in built[file].ids):
                missing.append(f"{path.name}: {target}")
    assert not missing


def test_lists_and_tables_are_seen_as_such(built):
    """A list or table straight below a line of text is one to GitHub and none to MkDocs."""
    assert not [path.name for path in built if "|---" in path.read_text(encoding="utf-8")]
    for page in PAGES:
        lines = re.sub(r"(?ms)^```.*?^```$", "", page.read_text(encoding="utf-8")).split("\n")
        for above, line in itertools.pairwise(lines):
            begins = re.match(r"([-*] |1\. |\|.*\|$)", line)
            if begins and above.strip() and not re.match(r"\s|[-*] |\d+\. |\||<!--", above):
                pytest.fail(f"{page.name}: put an empty line above {line[:60]!r}")


# -- what follows from the code ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_tables_are_current(page):
    text = page.read_text(encoding="utf-8")
    assert text == _load("write_docs_tables").filled(text), "run `make docs`"


# -- commands ---------------------------------------------------------------------------------------------------------

_COMMAND = re.compile(r"^(?:\.venv/bin/|blender --command )?sanguine ")


def _blocks(text: str) -> list[tuple[str, str]]:
    """(language, text) of each block of code, fenced or indented ("")."""
    fenced = [(m.group(1), m.group(2)) for m in re.finditer(r"(?ms)^```(\w*)\n(.*?)^```$", text)]
    rest = re.sub(r"(?ms)^```.*?^```$", "", text)
    indented = re.finditer(r"(?m)(?:(?<=\n\n)|\A)((?:    .*\n|\n(?=    ))+)", rest)
    return fenced + [("", re.sub(r"(?m)^    ", "", m.group(1))) for m in indented]


def _commands() -> list[tuple[str, str]]:
    found = []
    for page in WITH_COMMANDS:
        for language, block in _blocks(page.read_text(encoding="utf-8")):
            if language in ("", "sh", "shell", "bash"):
                found += [(page.name, line) for line in block.splitlines() if _COMMAND.match(line)]
    return found


def _inline() -> list[tuple[str, str]]:
    found = []
    for page in WITH_COMMANDS:
        text = re.sub(r"(?ms)^```.*?^```$", "", page.read_text(encoding="utf-8"))
        found += [(page.name, span) for span in re.findall(r"`([^`\n]+)`", text) if _COMMAND.match(span)]
    return found


def _words(line: str) -> list[str]:
    return shlex.split(_COMMAND.sub("", line), comments=True)


def test_there_are_commands_to_check():
    assert len(_commands()) > 30 and len(_inline()) > 10  # else the search is broken, not the pages


@pytest.mark.parametrize("page, line", _commands(), ids=lambda value: value[:60])
def test_commands_parse(page, line):
    _parser().parse_args(_words(line))


@pytest.mark.parametrize("page, span", sorted(set(_inline())), ids=lambda value: value[:60])
def test_commands_within_a_sentence_have_their_verb_and_flags(page, span):
    verb, *rest = _words(span)
    if verb in ("…", "VERB", "--version"):
        return
    known = _load("write_docs_tables")._verbs()
    assert verb in known, f"no verb {verb}"
    flags = {flag for action in known[verb]._actions for flag in action.option_strings}
    assert {word for word in re.findall(r"--[a-z][a-z-]*", " ".join(rest))} <= flags


def test_a_wrong_command_is_found():
    with pytest.raises(InputError):
        _parser().parse_args(_words("sanguine render shot.toml --outt out"))


# -- SHOT.toml --------------------------------------------------------------------------------------------------------


def _shots() -> list[tuple[str, str]]:
    found = []
    for page in WITH_COMMANDS:
        for language, block in _blocks(page.read_text(encoding="utf-8")):
            if language == "toml" or (not language and block.lstrip().startswith("[")):
                keys = re.findall(r"(?m)^(?:\[+([a-z_]+)|([a-z_]+) *=)", block)
                if {a or b for a, b in keys[:1]} & set(Shot.model_fields):
                    found.append((page.name, block))
    return found


def test_there_are_shots_to_check():
    assert {"scripting.md", "people.md", "maps.md"} <= {page for page, _ in _shots()}


@pytest.mark.parametrize("page, block", _shots(), ids=lambda value: value[:30])
def test_shots_are_valid(page, block, tmp_path):
    """What a fragment leaves out (whose face, which pictures) is put in; files that it names are not asked for."""
    given = tomllib.loads(block)
    for maps in [given.get("maps", {}), *(subject.get("maps", {}) for subject in given.get("subject", ()))]:
        for name in maps.values():
            file = tmp_path / name.replace("<UDIM>", "1001")
            file.parent.mkdir(parents=True, exist_ok=True)
            file.touch()
    whole = block if {"rig", "subject"} & given.keys() else f'{block}\n[rig]\nhead = "female"\n'
    if not {"expression", "timeline"} & given.keys():
        whole += '\n[[expression]]\nid = "neutral"\n'
    path = tmp_path / "shot.toml"
    path.write_text(whole, encoding="utf-8")
    read_shot(path)


# -- words of the window ----------------------------------------------------------------------------------------------


def _texts() -> list[str]:
    """Every text in the add-on's code, its variable parts as "…"."""
    found = []
    for file in sorted(ADDON.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, (ast.Constant, ast.JoinedStr)) and (text := _text_of(node)):
                found.append(text)
    return found


def _text_of(node: ast.expr) -> str:
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "…" for part in node.values)
    if isinstance(node, ast.BinOp):
        return _text_of(node.left) + _text_of(node.right)
    return "…"


def _quoted() -> list[str]:
    """What the tables of troubleshooting.md say that Sanguine says."""
    text = (DOCS / "troubleshooting.md").read_text(encoding="utf-8")
    firsts = re.findall(r"(?m)^\| (\*.*?\*)(?:[ ,…]+|) \|", text) + re.findall(r"(?m)^\| (\*[^|]*\*) \|", text)
    return sorted({message for first in firsts for message in re.findall(r"\*([^*]+)\*", first)})


def _pieces(message: str) -> list[str]:
    return [piece.strip(" :;,'") for piece in message.split("…") if len(piece.strip(" :;,'.()")) > 3]


@pytest.fixture(scope="module")
def texts() -> list[str]:
    return _texts()


@pytest.mark.parametrize("message", _quoted())
def test_messages_are_those_of_the_program(message, texts):
    """Each piece between two "…" stands in the code's texts as it is quoted."""
    assert _pieces(message)
    for piece in _pieces(message):
        assert any(piece in text for text in texts), f"nothing says {piece!r}"


def test_every_reason_of_a_grey_button_is_explained():
    page = " ".join((DOCS / "troubleshooting.md").read_text(encoding="utf-8").split())
    for file in sorted((ADDON / "blender").glob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "poll_message_set" and node.args:
                for piece in _pieces(_text_of(node.args[0])):
                    assert piece in page, f"docs/troubleshooting.md does not say what to do about {piece!r} ({file.name})"


# What only a script meets: names, values and curves that no button asks for.
_OF_SCRIPTS = ("controls.py", "strain.py")


def test_every_refusal_of_blenders_side_is_explained():
    page = " ".join((DOCS / "troubleshooting.md").read_text(encoding="utf-8").split())
    for file in sorted((ADDON / "blender").glob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and getattr(node.exc.func, "id", "") == "InputError"):
                continue
            for piece in _pieces(_text_of(node.exc.args[0])) if file.name not in _OF_SCRIPTS else ():
                assert piece in page, f"docs/troubleshooting.md does not say what to do about {piece!r} ({file.name})"


def _labels() -> set[str]:
    """Of panels, buttons, menus, properties, items of lists, sliders of the rig."""
    from sanguine.blender.properties import SkinSettings

    # As they are written: the menu of presets changes its label to the preset that was chosen last.
    sources = [file.read_text(encoding="utf-8") for file in (ADDON / "blender").glob("*.py")]
    found = {label for text in sources for label in re.findall(r'(?m)^    bl_label = "([^"]+)"', text)}
    for made in SkinSettings.__annotations__.values():
        found.add(made.keywords.get("name", ""))
        items = made.keywords.get("items", ())
        found |= {item[1] for item in items} if not callable(items) else set()
    return found | {effect.label for effect in EFFECTS} | {"Blood"}


def test_words_of_the_panel_are_the_panels_own():
    text = (DOCS / "panel.md").read_text(encoding="utf-8")
    bold = set(re.findall(r"\*\*([^*]+)\*\*", text)) - {"bold"}
    assert len(bold) > 40
    assert not bold - _labels()


def test_the_page_has_every_panel_in_its_order():
    from sanguine.blender.panels import CLASSES

    shown = [made for made in CLASSES if made.bl_space_type == "VIEW_3D"]
    wanted = [("### " if made.parent not in ("", "main") else "## ") + made.bl_label for made in shown]
    text = (DOCS / "panel.md").read_text(encoding="utf-8")
    assert re.findall(r"(?m)^##+ .*$", text) == wanted


def test_pythons_examples_name_what_there_is():
    import bpy  # noqa: F401

    from sanguine.blender import adopt, animation, capture, example, operators, plain, presets
    from sanguine.blender.properties import SkinSettings

    modules = (adopt, animation, capture, example, operators, plain, presets)
    operators_ = {made.bl_idname for module in modules for made in module.CLASSES if hasattr(made, "bl_idname")}
    count = 0
    for page in PAGES:
        for language, block in _blocks(page.read_text(encoding="utf-8")):
            if language != "python":
                continue
            ast.parse(block)
            for name in re.findall(r"bpy\.ops\.(sanguine\.\w+)", block):
                assert name in operators_, name
                count += 1
            for name in re.findall(r"\.sanguine\.(\w+) =", block):
                assert name in SkinSettings.__annotations__, name
                count += 1
    assert count >= 5


# -- pages that people look for ---------------------------------------------------------------------------------------


def test_the_readme_has_two_commands_and_leads_to_the_pages():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    commands = re.search(r"## Two commands\n(.*?)\n## ", text, re.DOTALL).group(1)
    assert re.findall(r"(?m)^    make (\w+)", commands) == ["demo", "test"]
    linked = set(re.findall(r"\]\(docs/([a-z_]+)\.md\)", text))
    assert {"index", "install", "first_blush", "adopt", "panel", "quality", "scripting", "troubleshooting", "science"} <= linked


def _settings() -> dict:
    return yaml.load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"), Loader=yaml.SafeLoader)


def test_no_page_stands_twice_in_the_navigation():
    pages = list(_load("docs_site")._pages(_settings()["nav"]))
    assert len(pages) == len(set(pages)), sorted(page for page in pages if pages.count(page) > 1)


def test_the_sites_settings_fetch_nothing():
    settings = _settings()
    assert settings["theme"]["font"] is False and settings["strict"] is True
