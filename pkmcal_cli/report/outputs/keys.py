"""Keys of an output, a line each: `parameters[].std number?: standard uncertainty`.

A word in capitals stands for any name, `[]` for the entries of a list. Types: text, number, integer, flag, any, or
the words that a text is one of (`a|b`). `?` behind a type or a part of the path: may be null; `~` behind a part: may
be absent. What begins with blanks belongs to the line before. Parts of a page are apart by `---`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

_LINE = re.compile(r"(\S+) ([^:]+):(?: (.*))?")
_MARKS = re.compile(r"[?~]")
TYPES = {"text": "string", "number": "number", "integer": "integer", "flag": "boolean"}


@dataclass(frozen=True)
class Key:
    """A path with its marks, a type, what it means ("": as above)."""

    marked: str
    kind: str
    meaning: str

    @property
    def path(self) -> str:
        """As the page shows it."""
        return _MARKS.sub("", self.marked)


@dataclass(frozen=True)
class Output:
    """What a command writes: keyword is its name, version that of the interface."""

    keyword: str
    text: str
    version: int = 1

    @property
    def schema(self) -> str:
        """Its name in the output."""
        return f"pkmcal/{self.keyword}/{self.version}"

    @property
    def parts(self) -> tuple[tuple[Key, ...], ...]:
        """Keys, by part of the page."""
        return tuple(keys_of(part) for part in self.text.split("\n---\n"))


COMMON = """
schema text: which output this is, and the version of its keys: `pkmcal/calibrate/1`
verdict text: the result in a word, see each command
provenance.program text: name and version
provenance.python text: version
provenance.numpy text: version
provenance.scipy text: version
provenance.created~ text: time, UTC
provenance.arguments~[] text: the command line
provenance.inputs.FILE text: SHA-256 of every input file
"""
"""Keys of every output."""


def keys_of(text: str) -> tuple[Key, ...]:
    """Keys from their lines. Raises ValueError for a line that is none."""
    lines: list[str] = []
    for line in text.strip().splitlines():
        if line.startswith(" "):
            lines[-1] += f" {line.strip()}"
        else:
            lines.append(line)
    return tuple(_key(line) for line in lines)


def _key(line: str) -> Key:
    match = _LINE.fullmatch(line)
    if match is None:
        raise ValueError(f"no key: {line}")
    return Key(match[1], match[2], match[3] or "")


def steps_of(marked: str) -> list[tuple[str, bool, bool, int]]:
    """Parts of a path: name, may be absent, may be null, how many lists its value is in."""
    steps = []
    for part in marked.split("."):
        name, lists = part.rstrip("?~[]"), part.count("[]")
        marks: Sequence[str] = part[len(name) :]
        steps.append((name, "~" in marks, "?" in marks, lists))
    return steps
