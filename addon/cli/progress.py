"""Progress on standard error: a bar for people (rich, where it is installed), lines for logs, JSON for farms."""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Callable, Iterator

Progress = Callable[[str, int, int], None]
"""progress(what, done, total)"""


@contextlib.contextmanager
def reporter(as_json: bool) -> Iterator[Progress]:
    if as_json:
        yield lambda what, done, total: print(
            json.dumps({"stage": what, "done": done, "total": total}), file=sys.stderr, flush=True
        )
        return
    try:
        # Blender has no rich; a log file wants no bar.
        from rich.progress import Progress as Bar
    except ImportError:
        Bar = None
    if Bar is None or not sys.stderr.isatty():
        yield lambda what, done, total: print(f"{what} {done}/{total}", file=sys.stderr, flush=True)
        return
    from rich.console import Console
    from rich.markup import escape

    with Bar(console=Console(stderr=True)) as bar:
        task = bar.add_task("")
        yield lambda what, done, total: bar.update(task, description=escape(what), completed=done, total=total)
