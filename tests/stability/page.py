"""docs/stability.md, from what a run of the suite saw."""

from __future__ import annotations

import inspect
import re
import time
from collections import Counter
from dataclasses import dataclass, field

from . import extremes


@dataclass
class Row:
    """One hard case."""

    case: str
    why: str
    classical: str
    multipole: str
    monte_carlo: str
    ours: str
    solver: str
    error: str
    milliseconds: float


@dataclass
class Seen:
    started: float = field(default_factory=time.perf_counter)
    rows: list[Row] = field(default_factory=list)
    refusals: list[tuple[str, str]] = field(default_factory=list)
    tally: dict[str, Counter] = field(default_factory=dict)
    properties: dict[str, str | None] = field(default_factory=dict)
    outcomes: dict[str, list[tuple[str, float]]] = field(default_factory=dict)

    def count(self, solver: str, what: str) -> None:
        self.tally.setdefault(solver, Counter())[what] += 1


SEEN = Seen()


def tally_lines(seen: Seen) -> list[str]:
    return [
        f"{solver}: " + ", ".join(f"{what} {n}" for what, n in sorted(counts.items(), key=lambda pair: -pair[1]))
        for solver, counts in sorted(seen.tally.items())
    ]


def share(value: float) -> str:
    """Four digits; negative or impossible light in bold."""
    value += 0.0  # no -0
    text = f"{value:.4f}" if 1e-3 <= abs(value) < 10 or value == 0 else f"{value:.1e}"
    return text if 0 <= value <= 1 + extremes.ENERGY else f"**{text}**"


def _table(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    def line(cells):
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"

    return [line(header), line(tuple("---" for _ in header)), *(line(row) for row in rows)]


def text(seen: Seen) -> str:
    lines = [
        "# Stability",
        "",
        "Written by the suite itself; not edited by hand:",
        "",
        "    .venv/bin/python -m pytest tests/stability --report docs/stability.md",
        "",
        "## Hard cases",
        "",
        "Shares of the incident light. *Classical* is Donner and Jensen 2005 as it is usually programmed "
        "(`tests/stability/classical.py`: 21 dipoles, FFT on 256 x 256 pixels of 0.05 mm, no guard); R / T of the light "
        "that enters, and the part of R(x, y) that comes out negative. Bold: no light can be that. `multipole` is the "
        "same method as a rung of our ladder: an answer with its measured error, or a refusal. *Monte Carlo* (three "
        "standard errors) checks what `auto` says: Rd / Tt, which are the scattered reflectance and all that leaves "
        "the bottom.",
        "",
        *_table(
            ("case", "classical R / T, negative", "`multipole` Rd / Tt", "Monte Carlo Rd / Tt",
             "`auto` Rd / Tt", "by", "error", "ms"),
            [(f"{r.case}: {r.why}", r.classical, r.multipole, r.monte_carlo, r.ours, r.solver, r.error,
              f"{r.milliseconds:.1f}") for r in seen.rows],
        ),
        "",
        "What is not a stack is refused:",
        "",
        *_table(("case", "answer"), [(name, f"`{reason}`") for name, reason in seen.refusals]),
        "",
        "## What is asserted",
        "",
        f"{'Soak' if extremes.SOAK else 'Quick'} run; every line is a test in `tests/stability` that passed, with its "
        "tolerance and the reason for it.",
        "",
    ]  # fmt: skip
    for name, doc in seen.properties.items():
        results = seen.outcomes.get(name, [])
        passed = sum(outcome == "passed" for outcome, _ in results)
        title = name.removeprefix("test_").replace("_", " ")
        lines.append(f"- **{title}** ({passed} of {len(results)}, {sum(s for _, s in results):.1f} s). "
                     + re.sub(r"\s+", " ", inspect.cleandoc(doc or "")))  # fmt: skip
    lines += [
        "",
        "## What became of the random stacks",
        "",
        *(f"- {line}" for line in tally_lines(seen)),
        "",
        f"The run took {time.perf_counter() - seen.started:.0f} s.",
        "",
    ]
    return "\n".join(lines)
