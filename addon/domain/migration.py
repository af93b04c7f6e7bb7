"""How what an older Sanguine wrote into a file becomes what this one reads.

Ids are for ever. Where one changes after all, or a number gets another meaning, a step here says how, and `SCHEMA` grows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .errors import InputError

UNNUMBERED = 1
"""Version of the files from before they had a number."""


@dataclass(frozen=True)
class Step:
    """What changed with version `to`, of the settings of a face (a parameter's id, `strength_` and an effect's, ...).

    renamed: old id -> new id. factors: id, the new one -> new value / old value. untouched: id -> what it was where
    nobody had set it, if the default is another since. note: for people.
    """

    to: int
    renamed: Mapping[str, str] = field(default_factory=dict)
    factors: Mapping[str, float] = field(default_factory=dict)
    untouched: Mapping[str, Any] = field(default_factory=dict)
    note: str = ""


STEPS = (
    Step(2, note="its rig is known to be Sanguine's own, so that Remove Sanguine takes it off too"),
    Step(3, note="a skin that is applied again reads blood and strain three numbers at a time, which renders faster"),
)

SCHEMA = STEPS[-1].to
"""Version of what this Sanguine writes into files."""


def check_version(version: Any, name: str) -> int:
    """Raises InputError, naming the file or the face, for what only a newer Sanguine reads."""
    if isinstance(version, bool) or not isinstance(version, int) or version < UNNUMBERED:
        raise InputError(f"{name}: {version!r} is no version of Sanguine's files: {UNNUMBERED} to {SCHEMA} are read")
    if version > SCHEMA:
        raise InputError(
            f"{name}: made by a newer Sanguine (files of version {version}, this one reads up to {SCHEMA}): update the add-on"
        )
    return version


def migrate(values: Mapping[str, Any], version: int, steps: tuple[Step, ...] = STEPS) -> dict[str, Any]:
    """Settings as `version` wrote them (only those that somebody has set) as the last of `steps` wants them.

    Where old and new name are both there, the new one was set later, and stays.
    """
    made = dict(values)
    for step in steps:
        if step.to <= version:
            continue
        later = {name: made.pop(name) for name in step.renamed.values() if name in made}
        named = {step.renamed.get(name, name): value for name, value in made.items()}
        scaled = {name: value * step.factors[name] if name in step.factors else value for name, value in named.items()}
        made = {**step.untouched, **scaled, **later}
    return made


def notes(version: int, steps: tuple[Step, ...] = STEPS) -> list[str]:
    return [step.note for step in steps if step.to > version and step.note]
