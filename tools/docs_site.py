"""What MkDocs does not know of itself (a hook of mkdocs.yml): pages that stand nowhere, links out of docs/."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
MORE = "More"

# [text](target), not a picture, not in a line of code.
_LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(((?:\.\./)[^)#\s]+)(#[^)\s]*)?\)")


def on_config(config: Any) -> Any:
    """Adds what docs/ has and `nav` has not, so that no page is out of reach."""
    folder = Path(config["docs_dir"])
    left = sorted({path.relative_to(folder).as_posix() for path in folder.rglob("*.md")} - set(_pages(config["nav"])))
    if left:
        config["nav"] = [*config["nav"], {MORE: left}]
    return config


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """A link to a file of the sources becomes its path: the site holds docs/ alone."""
    folder = (ROOT / "docs" / page.file.src_uri).parent

    def path_of(match: re.Match[str]) -> str:
        text, target = match.group(1).strip("`"), match.group(2)
        path = Path(os.path.normpath(folder / target))
        if not path.exists():
            return match.group(0)  # MkDocs warns, and a warning is an error
        name = path.relative_to(ROOT).as_posix()
        return f"`{name}`" if Path(text).name == path.name else f"{match.group(1)} (`{name}`)"

    return _LINK.sub(path_of, markdown)


def _pages(nav: Any) -> Iterator[str]:
    if isinstance(nav, str):
        yield nav
    for item in nav.values() if isinstance(nav, dict) else nav if isinstance(nav, list) else ():
        yield from _pages(item)
