"""What a sheet consists of, before it is a page: a verdict, and sections of text, tables and pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from pkmcal_cli.pictures.picture import Picture

Word = Literal[
    "PASS", "FAIL", "UNDECIDED", "CONFIRMED", "CHANGED", "CLEAN", "FOUND", "UNKNOWN", "IMPLAUSIBLE", "DONE"
]  # fmt: skip
Kind = Literal["text", "warning", "note", "command"]


@dataclass(frozen=True)
class Text:
    """A paragraph, a warning, a remark in small print, or a command to be run."""

    text: str
    kind: Kind = "text"

    form: Literal["text"] = field(default="text", init=False)


@dataclass(frozen=True)
class Table:
    """A table: title, headers, rows of texts of which the first `left` are words; widths are the browser's affair."""

    title: str
    headers: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    left: int = 1
    words: tuple[str, ...] = ()  # headers of further columns of words

    form: Literal["table"] = field(default="table", init=False)

    def is_word(self, k: int) -> bool:
        """Whether a column holds words rather than numbers."""
        return k < self.left or self.headers[k] in self.words


@dataclass(frozen=True)
class Figure:
    """A picture with what is to be seen in it."""

    picture: Picture
    caption: str

    form: Literal["figure"] = field(default="figure", init=False)


Block = Text | Table | Figure


@dataclass(frozen=True)
class Section:
    """A part of the sheet; `key`: what its place in the page is called."""

    key: str
    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Verdict:
    """One word, the sentence beside it, and what it rests on, a line each."""

    word: Word
    headline: str
    lines: tuple[str, ...] = ()

    @property
    def negative(self) -> bool:
        """Whether a gate would stop here."""
        return self.word in ("FAIL", "UNDECIDED", "CHANGED", "IMPLAUSIBLE")


@dataclass(frozen=True)
class Sheet:
    """The whole page; warnings: what nobody may overlook who reads the verdict."""

    machine: str
    subtitle: str
    verdict: Verdict
    warnings: tuple[str, ...]
    sections: tuple[Section, ...]
    footer: str


def section(key: str, title: str, blocks: Sequence[Block | None]) -> Section | None:
    """A section of those blocks that there are; None of none."""
    there = tuple(b for b in blocks if b is not None)
    return Section(key, title, there) if there else None
