"""Other names for the same face: which of a mesh's shape keys are which ARKit key, action unit or emotion.

A convention is one file in rigs/names/: a row says of which of our names a foreign key is made. Spelling is no part of
it: case, separators, sides (`_L`, `.R`, `Left`, `r_`) and prefixes (`blendShape1.`, `head_`) are stripped here.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from .errors import InputError, nearest
from .facs import (
    ACTION_UNITS,
    ARKIT,
    EMOTION_CONTROLS,
    EMOTIONS,
    KNOWN_KEYS,
    UNIT_CONTROLS,
    Formulas,
    side_of,
    unit_alone,
)
from .resources import Row, read_table, rigs_path
from .response import Formula, Response

# A key that is moved by two of ours has shares of about 0.5; more than 2 would be a unit of another kind.
Share = Annotated[float, Field(gt=0.0, le=2.0)]
Shares = dict[str, float]

LEFT, RIGHT = "<", ">"  # a side inside a form; neither can stand in a word
_SIDES = {"l": LEFT, "left": LEFT, "lft": LEFT, "lf": LEFT, "r": RIGHT, "right": RIGHT, "rgt": RIGHT, "rt": RIGHT}
_MIRROR = str.maketrans(LEFT + RIGHT, RIGHT + LEFT)
_WORD = re.compile(r"[UD](?=[LR](?![A-Za-z]))|[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+|[^\W\d_]+")
_PART = re.compile(r"[^\W_]+")
_COPY = re.compile(r"\.\d{3}$")  # what Blender appends to a name that is taken
_PATH = re.compile(r"[.:|/]")
_IGNORED = frozenset({"basis", "base", "rest"})  # the key that others are relative to
_MOST_PREFIX_PARTS = 6
# A name of fewer letters after a dropped prefix could be anything ("hand_A"), unless other keys have the prefix too.
_STRONG_LETTERS = 7
_SHARED_PREFIX = 3
_SQUASHED_LETTERS = 4  # "jawl"
_MIRRORED_UNITS = {"61": "62", "62": "61", "51": "52", "52": "51", "55": "56", "56": "55"}


class KeyRow(Row):
    """One foreign key: its value is `gain` * sum of share * the value of ours, at most 1."""

    of: Annotated[dict[str, Share], Field(min_length=1)]
    gain: Annotated[float, Field(gt=0.0, le=4.0)] = 1.0
    note: str = ""

    @property
    def shares(self) -> Shares:
        return {name: self.gain * share for name, share in self.of.items()}


class Names(Row):
    """One file of rigs/names/.

    label    : for people; source: where the names were read
    prefixes : what the convention puts before every name
    at_least : so many of its keys a mesh must have before the convention is believed
    identity : all of our own names are rows as they are
    keys     : rows; "browDownLeft" and { browDownLeft = 1.0 } are short for { of = { browDownLeft = 1.0 } }
    aliases  : another spelling -> key
    absent   : keys that have no counterpart (`*` at the end: all that begin so, after the prefix) -> why
    """

    label: str
    source: Annotated[tuple[str, ...], Field(min_length=1)]
    prefixes: tuple[str, ...] = ()
    at_least: Annotated[int, Field(ge=1)] = 1
    identity: Literal["", "arkit", "units"] = ""
    keys: dict[str, KeyRow] = {}
    aliases: dict[str, str] = {}
    absent: dict[str, str] = {}

    @field_validator("keys", mode="before")
    @classmethod
    def _short_rows(cls, rows: Any) -> Any:
        if not isinstance(rows, dict):
            return rows
        return {key: _short_row(row) for key, row in rows.items()}

    def rows(self) -> dict[str, KeyRow]:
        """All rows, those of `identity` included."""
        own = {"": (), "arkit": KNOWN_KEYS, "units": UNIT_CONTROLS}[self.identity]
        return {**{name: KeyRow(of={name: 1.0}) for name in own}, **self.keys}


def _short_row(row: Any) -> Any:
    if isinstance(row, str):
        return {"of": {row: 1.0}}
    return row if not isinstance(row, dict) or "of" in row else {"of": row}


def known_targets() -> frozenset[str]:
    """What a foreign key may be made of: ARKit's keys and our own, action units (`AU12`, `AU12L`: the names of their
    sliders), emotions."""
    return frozenset((*KNOWN_KEYS, *UNIT_CONTROLS, *EMOTION_CONTROLS))


def form(name: str) -> str:
    """`name` without its spelling: words in lower case, numbers without leading zeros, a side as `<` or `>`; a single
    side stands at the end, wherever it was. `browDownLeft`, `BrowDown_L` and `l_brow_down` have the same form."""
    return _joined(_words(name))


def _words(name: str) -> list[str]:
    words = []
    for word in _WORD.findall(name):
        word = word.lower()
        words.append(_SIDES.get(word) or (str(int(word)) if word.isdecimal() else word))
    return words


def _joined(words: Iterable[str]) -> str:
    text = "".join(words)
    if text.count(LEFT) + text.count(RIGHT) == 1:
        side = LEFT if LEFT in text else RIGHT
        text = text.replace(side, "") + side
    return text


def mirrored(name: str) -> str:
    """The ARKit key, unit or emotion of the other side; the same one if it has none."""
    if name.startswith("AU"):
        unit = name[2:]
        swap = unit[:-1] + {"L": "R", "R": "L"}[unit[-1]] if unit[-1] in "LR" else _MIRRORED_UNITS.get(unit, unit)
        return f"AU{swap}"
    return re.sub("Left|Right", lambda side: "Right" if side[0] == "Left" else "Left", name)


def read_names(path: Path) -> Names:
    """A convention, of ours or a user's own.

    Raises InputError, one line, for what is not declared by `Names`, an unknown ARKit key, unit or emotion, a key that
    is there twice in two spellings, and a key without its other side.
    """
    names = read_table(path, Names)
    targets, rows = known_targets(), names.rows()
    for key, row in rows.items():
        for target in row.of:
            if target not in targets:
                hint = nearest(target, targets)
                raise InputError(f"{path}: keys.{key}: {target}: no such ARKit key, unit or emotion, {hint}")
    spelled: dict[str, str] = {}
    for key in (*rows, *names.aliases, *(key for key in names.absent if not key.endswith("*"))):
        if not (own := form(key)):
            raise InputError(f"{path}: {key}: a name needs letters or digits")
        if own in spelled:
            raise InputError(f"{path}: {key}: the same key as {spelled[own]}, remove one")
        spelled[own] = key
    for alias, key in names.aliases.items():
        if key not in rows and key not in names.absent:
            hint = nearest(key, (*rows, *names.absent))
            raise InputError(f"{path}: aliases.{alias}: {key}: no such key here, {hint}")
    for key, row in names.keys.items():
        other = rows.get(spelled.get(form(key).translate(_MIRROR), ""))
        if other is None:
            raise InputError(f"{path}: keys.{key}: its other side is missing")
        if {mirrored(target): share for target, share in other.shares.items()} != row.shares:
            raise InputError(f"{path}: keys.{key}: not the mirror image of {spelled[form(key).translate(_MIRROR)]}")
    return names


CONVENTIONS = ("arkit", "ict", "unified", "metahuman", "cc4", "mpfb", "vroid", "vrm", "rpm", "mpeg4", "facs")
"""Files of rigs/names/; where two fit a mesh equally well the first is taken."""


@functools.cache
def conventions() -> dict[str, Names]:
    """The conventions that come with Sanguine, by name; read when first asked for."""
    return {name: read_names(rigs_path(f"names/{name}.toml")) for name in CONVENTIONS}


@dataclass(frozen=True)
class Recognised:
    """What the shape keys of a mesh are.

    convention : the one most of them follow, None if no key is known
    sure       : 0 to 1, the share of the keys that it could explain and does, less when there are few of them
    followed   : convention -> how many keys are mapped by it, best first; mixed rigs have several
    mapping    : mesh key -> ((ARKit key, control of a unit or emotion; share), ...)
    missing    : ARKit keys that nothing on the mesh expresses
    unknown    : mesh keys that nobody knows
    absent     : mesh keys known to have no counterpart -> why
    spare      : mesh keys known but not used, as others move the same part of the face already -> which
    ambiguous  : name in the convention -> the mesh keys that could be it; the best spelled is used, none if they tie
    notes      : one line for a user about each that is spare or ambiguous
    """

    convention: str | None
    sure: float
    followed: dict[str, int]
    mapping: dict[str, tuple[tuple[str, float], ...]]
    missing: tuple[str, ...]
    unknown: tuple[str, ...]
    absent: dict[str, str] = field(default_factory=dict)
    spare: dict[str, tuple[str, ...]] = field(default_factory=dict)
    ambiguous: dict[str, tuple[str, ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def sources(self) -> dict[str, Shares]:
        """Mesh key -> shares of shape keys: ARKit's, or our own (rigs/own_keys.toml)."""
        return self._made_of(frozenset(KNOWN_KEYS))

    @property
    def units(self) -> dict[str, Shares]:
        """Mesh key -> shares of action units, or of one side of them."""
        return self._made_of(frozenset(UNIT_CONTROLS))

    @property
    def emotions(self) -> dict[str, Shares]:
        """Mesh key -> shares of emotions: keys that are whole expressions."""
        return self._made_of(frozenset(EMOTION_CONTROLS))

    def strongest(self) -> dict[str, str]:
        """Mesh key -> the one ARKit key that it shows best: where that one goes, it goes. Not one for both sides."""
        found = {}
        for key, shares in self.sources.items():
            first, *rest = sorted(shares, key=lambda name: -shares[name])
            if first in ARKIT.keys and not (rest and shares[rest[0]] == shares[first]):
                found[key] = first
        return found

    def expressed(self, keys: Iterable[str]) -> frozenset[str]:
        """The ARKit keys whose work these mesh keys do, whole expressions apart."""
        names = [name for key in keys for name, _ in self.mapping[key] if name not in EMOTIONS]
        return frozenset(_claims(names))

    def _made_of(self, kind: frozenset[str]) -> dict[str, Shares]:
        parts = {key: {name: share for name, share in row if name in kind} for key, row in self.mapping.items()}
        return {key: shares for key, shares in parts.items() if shares}


@dataclass(frozen=True)
class _Entry:
    """A name of a convention, as the index finds it; row is None for one that has no counterpart."""

    convention: int
    name: str
    row: KeyRow | None
    why: str = ""


class Recogniser:
    """An index over conventions, by form; `conventions` in order of preference."""

    def __init__(self, conventions: Mapping[str, Names]):
        self.names = tuple(conventions)
        self.tables = tuple(conventions.values())
        self._forms: dict[str, list[_Entry]] = {}
        self._squashed: dict[str, list[_Entry]] = {}
        self._begins: list[tuple[str, _Entry]] = []
        self._ends: set[str] = set()
        self._sizes = []
        self._prefixes = sorted({form(p) for table in self.tables for p in table.prefixes}, key=len, reverse=True)
        for number, table in enumerate(self.tables):
            rows = table.rows()
            self._sizes.append(len(rows))
            entries = {name: _Entry(number, name, row) for name, row in rows.items()}
            entries |= {name: _Entry(number, name, None, why) for name, why in table.absent.items()}
            for alias, name in table.aliases.items():
                self._add(alias, entries[name])
            for name, entry in entries.items():
                if name.endswith("*"):
                    begin = name[:-1].lower()
                    self._begins += [(prefix.lower() + begin, entry) for prefix in table.prefixes or ("",)]
                else:
                    self._add(name, entry)

    def _add(self, name: str, entry: _Entry) -> None:
        words = _words(name)
        self._forms.setdefault(_joined(words), []).append(entry)
        self._ends.add(_last_word(words))
        for left, right in (("left", "right"), ("l", "r")):
            text = "".join({LEFT: left, RIGHT: right}.get(word, word) for word in words)
            if len(text) >= _SQUASHED_LETTERS:
                found = self._squashed.setdefault(text, [])
                if entry not in found:
                    found.append(entry)

    def __call__(self, key_names: Iterable[str]) -> Recognised:
        keys = [name for name in dict.fromkeys(key_names) if name.lower() not in _IGNORED]
        found = self._find_all(keys)
        ranked = self._ranked(found)
        mapping: dict[str, tuple[tuple[str, float], ...]] = {}
        absent: dict[str, str] = {}
        spare: dict[str, tuple[str, ...]] = {}
        ambiguous: dict[str, tuple[str, ...]] = {}
        followed: dict[str, int] = {}
        reached: dict[str, str] = {}
        left = set(found)
        for number in ranked:
            rows: dict[str, list[tuple[int, str]]] = {}
            for key in keys:
                if key in left and (entry := next((e for e in found[key][1] if e.convention == number), None)):
                    left.discard(key)
                    if entry.row is None:
                        absent[key] = entry.why
                    else:
                        rows.setdefault(entry.name, []).append((0 if entry.name == key else found[key][0], key))
            table = self.tables[number].rows()
            claimed: dict[str, str] = {}
            for name, candidates in rows.items():
                candidates.sort(key=lambda candidate: candidate[0])
                if len(candidates) > 1:
                    ambiguous[name] = tuple(key for _, key in candidates)
                    if candidates[0][0] == candidates[1][0]:
                        continue
                key, row = candidates[0][1], table[name]
                claims = _claims(row.of)
                halves = [rows[half] for half in (f"{name}L", f"{name}R") if half in rows]
                if halves and name in UNIT_CONTROLS:
                    spare[key] = tuple(half[0][1] for half in halves)
                    continue
                if taken := tuple(dict.fromkeys(reached[claim] for claim in claims if claim in reached)):
                    spare[key] = taken
                    continue
                mapping[key] = tuple(row.shares.items())
                followed[self.names[number]] = followed.get(self.names[number], 0) + 1
                claimed |= dict.fromkeys(claims, key)
            reached = {**claimed, **reached}
        best = ranked[0] if ranked and mapping else None
        expressed = set(_claims(name for row in mapping.values() for name, _ in row if name not in EMOTIONS))
        unknown = tuple(key for key in keys if key in left or key not in found)
        missing = tuple(key for key in ARKIT.keys if key not in expressed)
        return Recognised(
            convention=None if best is None else self.names[best],
            sure=0.0 if best is None else self._sure(best, found, len(keys)),
            followed=dict(sorted(followed.items(), key=lambda item: -item[1])),
            mapping={key: mapping[key] for key in keys if key in mapping},
            missing=missing,
            unknown=unknown,
            absent={key: absent[key] for key in keys if key in absent},
            spare=spare,
            ambiguous=ambiguous,
            notes=_notes(mapping, spare, ambiguous),
        )

    def _ranked(self, found: Mapping[str, tuple[int, list[_Entry]]]) -> list[int]:
        seen = self._seen(found)
        return [n for n in sorted(seen, key=lambda n: (-len(seen[n]), n)) if len(seen[n]) >= self.tables[n].at_least]

    def _seen(self, found: Mapping[str, tuple[int, list[_Entry]]]) -> dict[int, set[str]]:
        seen: dict[int, set[str]] = {}
        for _, entries in found.values():
            for entry in entries:
                if not entry.name.endswith("*"):  # "head_*" says little about who named it
                    seen.setdefault(entry.convention, set()).add(entry.name)
        return seen

    def _sure(self, number: int, found: Mapping[str, tuple[int, list[_Entry]]], keys: int) -> float:
        rows = sum(1 for _, es in found.values() if any(e.convention == number and e.row is not None for e in es))
        known = sum(1 for _, es in found.values() if any(e.convention == number for e in es))
        share = max(rows / min(keys, self._sizes[number]), known / keys)
        # As if two more keys had been seen that it does not explain: one match out of one is no certainty.
        return min(share, 1.0) * known / (known + 2)

    def _find_all(self, keys: list[str]) -> dict[str, tuple[int, list[_Entry]]]:
        """Mesh key -> (how it was found, the less the nearer; entries). Keys that nobody knows are not in it."""
        found: dict[str, tuple[int, list[_Entry]]] = {}
        dropped: dict[str, int] = {}
        weak: dict[str, tuple[str, list[_Entry]]] = {}
        for key in keys:
            bare = _COPY.sub("", key)
            words = _words(bare)
            if entries := self._forms.get(_joined(words)):
                found[key] = (1 if bare == key else 2, entries)
            elif entries := self._squashed.get("".join(_PART.findall(bare)).lower()):
                found[key] = (2, entries)
            elif entries := self._after_prefix(bare, words):
                found[key] = (2, entries)
            elif _last_word(words) in self._ends and (hit := self._inside(bare)):
                prefix, rest, entries = hit
                if sum(map(str.isalpha, rest)) >= _STRONG_LETTERS:
                    found[key] = (3, entries)
                    dropped[prefix] = dropped.get(prefix, 0) + 1
                else:
                    weak[key] = (prefix, entries)
        for key, (prefix, entries) in weak.items():
            if dropped.get(prefix, 0) >= _SHARED_PREFIX:
                found[key] = (3, entries)
        for key in keys:
            quality, entries = found.get(key, (4, []))
            if quality > 1:
                last = _PATH.split(key)[-1].lower()
                if begins := [entry for begin, entry in self._begins if last.startswith(begin)]:
                    found[key] = (quality, entries + begins)
        return found

    def _after_prefix(self, name: str, words: list[str]) -> list[_Entry]:
        """Entries of a name after a convention's own prefix, or after a path (`blendShape1.`, `Face:`)."""
        text = "".join(words)
        for prefix in self._prefixes:
            if text.startswith(prefix) and (entries := self._forms.get(_joined(_words_after(words, prefix)))):
                return [entry for entry in entries if prefix in map(form, self.tables[entry.convention].prefixes)]
        last = _PATH.split(name)[-1]
        return self._forms.get(form(last), []) if last != name else []

    def _inside(self, name: str) -> tuple[str, str, list[_Entry]] | None:
        """(what was dropped, what is left, entries) for a name behind a few parts of something else. A name behind
        another name is a corrective shape of both and not one of them."""
        parts = list(_PART.finditer(name))
        for part in parts[1 : 1 + _MOST_PREFIX_PARTS]:
            prefix, rest = name[: part.start()], name[part.start() :]
            if entries := self._forms.get(form(rest)):
                return None if self._mentions(prefix) else (prefix, rest, entries)
        return None

    def _mentions(self, prefix: str) -> bool:
        parts = [part.group() for part in _PART.finditer(prefix)]
        return any(
            form("_".join(parts[a:b])) in self._forms and sum(map(len, parts[a:b])) >= _STRONG_LETTERS
            for a in range(len(parts))
            for b in range(a + 1, len(parts) + 1)
        )


def _last_word(words: list[str]) -> str:
    """The last one that is no side, as a side may stand anywhere."""
    return next((word for word in reversed(words) if word not in (LEFT, RIGHT)), "")


def _words_after(words: list[str], prefix: str) -> list[str]:
    """`words` without the first ones, which make up `prefix`."""
    size = 0
    for number, word in enumerate(words):
        if size >= len(prefix):
            return words[number:]
        size += len(word)
    return []


def _claims(shares: Iterable[str]) -> tuple[str, ...]:
    """The ARKit keys whose work these names do: a unit does that of the keys it moves by half or more of its most."""
    claims: dict[str, None] = {}
    for name in shares:
        if name in EMOTIONS:
            full = {unit: shares[1] for unit, shares in EMOTIONS[name].units.items()}
            claims |= dict.fromkeys(_claims(f"AU{unit}" for unit, share in full.items() if share >= 0.5))
        elif name.startswith("AU"):
            keys, side = ACTION_UNITS[name[2:].rstrip("LR")].keys, name[-1] if name[-1] in "LR" else ""
            strong = [key for key, share in keys.items() if share >= 0.5 * max(keys.values(), default=0.0)]
            claims |= dict.fromkeys(key for key in strong if not side or side_of(key) in ("", side))
        else:
            claims[name] = None
    return tuple(claims)


def _notes(mapping, spare, ambiguous) -> tuple[str, ...]:
    notes = []
    for key, others in spare.items():
        notes.append(f"{key}: not used, {others[0]} moves the same part of the face")
    for name, keys in ambiguous.items():
        used = f"{keys[0]} is used" if keys[0] in mapping or keys[0] in spare else "none is used, rename one"
        notes.append(f"{', '.join(keys)}: all of them could be {name}; {used}")
    return tuple(notes)


@functools.cache
def _recogniser() -> Recogniser:
    return Recogniser(conventions())


def recognise(key_names: Iterable[str], extra: Mapping[str, Names] | None = None) -> Recognised:
    """What the shape keys of a mesh are. `extra`: conventions of one's own by name (`read_names`), which come first."""
    return (Recogniser({**extra, **conventions()}) if extra else _recogniser())(key_names)


def mesh_responses(found: Recognised, formulas: Formulas, emotions: Iterable[str]) -> dict[str, Response]:
    """Mesh key -> how the controls of a rig with these `emotions` move it. A key made only of what no control moves
    (mouthLeft) is not in it.

    An emotion that has a key of its own moves it and not, once more, the parts of expressions beside it.
    """
    emotions = tuple(emotions)
    whole = {name for shares in found.emotions.values() for name in shares}
    others = tuple(name for name in emotions if name not in whole)
    responses = {}
    for key, row in found.mapping.items():
        terms: list[tuple[float, str | Formula]] = []
        for name, share in row:
            if name in formulas.keys:
                terms.append((share, formulas.keys[name]))
            elif name in emotions:
                terms.append((share, name))
            elif name in UNIT_CONTROLS and whole:
                terms.append((share, unit_alone(name, others)))
            elif name in UNIT_CONTROLS:
                unit = ACTION_UNITS[name[2:].rstrip("LR")]
                sides = [side for side in unit.sides if name == f"AU{unit.id}" or name == f"AU{side}"]
                terms += [(share / len(sides), formulas.units[side]) for side in sides]
        if len(terms) == 1 and terms[0][0] == 1.0 and isinstance(terms[0][1], Response):
            responses[key] = terms[0][1]
        elif terms:
            responses[key] = Response(tuple(terms))
    return responses
