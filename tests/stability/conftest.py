"""Options of the stability suite, and the page it writes about itself.

    pytest tests/stability                               quick and repeatable: part of `make test`
    pytest tests/stability --soak                        fifty times as many examples, new ones every time; finer grids
    pytest tests/stability --soak=5                      five times as many
    pytest tests/stability --report docs/stability.md    writes the page from what the run saw
"""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from stability import extremes, page

HERE = Path(__file__).parent


def pytest_addoption(parser):
    group = parser.getgroup("stability")
    group.addoption("--soak", metavar="FACTOR", nargs="?", type=int, const=50, default=0,
                    help="new random examples, FACTOR times as many (50), and finer grids")
    group.addoption("--report", metavar="FILE", default=None, help="write docs/stability.md anew")


def pytest_configure(config):
    # `pytest tests` meets this file too late for its options to exist: then it is the quick run.
    extremes.SOAK = config.getoption("--soak", default=0)


@pytest.fixture(scope="session")
def seen() -> page.Seen:
    """What the hard cases and the random ones came to."""
    return page.SEEN


def pytest_runtest_logreport(report):
    if report.when == "call" and "stability" in report.nodeid:
        page.SEEN.outcomes.setdefault(report.nodeid.split("[")[0].split("::")[-1], []).append(
            (report.outcome, report.duration)
        )


def pytest_collection_finish(session):
    page.SEEN.started = time.perf_counter()
    for item in session.items:
        if HERE in item.path.parents:
            page.SEEN.properties.setdefault(item.originalname, item.function.__doc__)


def pytest_sessionfinish(session, exitstatus):
    target = session.config.getoption("--report", default=None)
    if target and exitstatus == pytest.ExitCode.OK:
        Path(target).write_text(page.text(page.SEEN), encoding="utf-8")


def pytest_terminal_summary(terminalreporter):
    if page.SEEN.tally:
        terminalreporter.section("stability: what became of the random stacks")
        for line in page.tally_lines(page.SEEN):
            terminalreporter.write_line(line)
