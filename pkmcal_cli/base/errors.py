"""Faults and errors: what is wrong, where, and what to do about it.

A `Fault` is one finding in a file. A `PkmcalError` ends the run; the application turns it into
text and an exit code at one place. `BadInput` carries all the faults of a stage at once.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from pkmcal_cli.base.plural import gathered
from pkmcal_cli.base.visible import in_line, visible

MAX_FAULTS = 50
"""So many faults of a stage are told; the rest is counted."""

GIVE_UP = 1000
"""With so many faults reading is given up."""

_MAX_LINE = 140
_LIKE = 0.6  # similarity below which a name is not looked at
_BEGINNING = 3  # letters that are enough of a name


@dataclass(frozen=True, order=True)
class Location:
    """A place in a text file; line and column count from 1 (0: the whole line or file)."""

    file: str
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        file = in_line(self.file)
        location = f"{file}:{self.line}" if self.line else file
        return f"{location}:{self.column}" if self.column else location


@dataclass(frozen=True)
class Fault:
    """One finding: what is wrong, where, and the remedy.

    `source` is the text of the line that `where` names; it is shown with a caret below.
    """

    code: str
    what: str
    where: Location | None = None
    hint: str | None = None
    source: str | None = None
    severity: Literal["error", "warning"] = "error"

    def text(self) -> str:
        """The fault as it is shown: head line, source line, caret line, help."""
        head = f"{self.where}: " if self.where is not None else ""
        lines = [f"{head}{self.severity}[{self.code}]: {visible(self.what)}"]
        if self.where is not None and self.source is not None and self.where.column:
            lines += _excerpt(self.source, self.where.column)
        if self.hint:
            lines.append(f"help: {visible(self.hint)}")
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.text()


def _excerpt(source: str, column: int) -> list[str]:
    """The source line, cut around the column when it is long, and the caret line."""
    shown = "".join(c if c.isprintable() or c == "\t" else "\ufffd" for c in source.rstrip("\r\n"))
    at = min(column - 1, len(shown))
    if len(shown) > _MAX_LINE:
        start = max(0, min(at - _MAX_LINE // 2, len(shown) - _MAX_LINE))
        head = "..." if start else ""
        tail = "..." if start + _MAX_LINE < len(shown) else ""
        shown = head + shown[start : start + _MAX_LINE] + tail
        at = at - start + len(head)
    caret = "".join("\t" if c == "\t" else " " for c in shown[:at])
    return [shown, caret.ljust(at) + "^"]


class PkmcalError(Exception):
    """An error that the user can mend: what is wrong, where, and a hint.

    `exit_code` is the process's exit code; `where` is a place in a file, a name, or nothing.
    """

    exit_code = 70
    default_code = "error"

    def __init__(
        self,
        message: str,
        where: Location | str | None = None,
        hint: str | None = None,
        code: str | None = None,
    ) -> None:
        self.what = message
        self.where = where
        self.hint = hint
        self.code = code or self.default_code
        super().__init__(message)

    def text(self) -> str:
        """The error as it is shown to the user."""
        if isinstance(self.where, Location) or self.where is None:
            return Fault(self.code, self.what, self.where, self.hint).text()
        tail = f"\nhelp: {self.hint}" if self.hint else ""
        return visible(f"{in_line(self.where)}: error[{self.code}]: {self.what}{tail}")

    def __str__(self) -> str:
        return self.text()


class PkmcalWarning(UserWarning):
    """A result that cannot be used, told to who calls from Python."""


class UsageError(PkmcalError):
    """The command line is wrong (exit code 2)."""

    exit_code = 2
    default_code = "usage"


class BadInput(PkmcalError):
    """The machine, measurements or parameters are wrong (exit code 3): all faults of a stage."""

    exit_code = 3

    def __init__(self, faults: Sequence[Fault], total: int | None = None) -> None:
        first = faults[0] if faults else Fault("input", "the input is invalid")
        self.faults: tuple[Fault, ...] = tuple(faults)
        self.total = len(self.faults) if total is None else total
        super().__init__(first.what, first.where, first.hint, first.code)

    def __reduce__(self) -> tuple[type[BadInput], tuple[tuple[Fault, ...], int]]:
        return BadInput, (self.faults, self.total)

    @classmethod
    def single(
        cls,
        message: str,
        where: Location | None = None,
        hint: str | None = None,
        code: str = "input",
        source: str | None = None,
    ) -> BadInput:
        """A `BadInput` of one fault."""
        return cls([Fault(code, message, where, hint, source)])

    @property
    def is_unreadable(self) -> bool:
        """Whether a file could not be read at all: nothing in it was checked."""
        return all(fault.code == "file" for fault in self.faults)

    def text(self) -> str:
        """All faults, a blank line between them, and how many more there are."""
        parts = [fault.text() for fault in self.faults]
        if self.total > len(self.faults):
            parts.append(f"... and {self.total - len(self.faults)} more faults")
        return "\n\n".join(parts)


def numbers_fail() -> BadInput:
    """The error of equations that cannot be solved with the numbers that the files hold."""
    hint = "check the units of stiffnesses, lengths and readings"
    return BadInput.single("the computation fails with these numbers", None, hint, "numbers")


def too_large() -> BadInput:
    """The error of an input that needs more memory than there is."""
    return BadInput.single("not enough memory", None, "use fewer rows or positions at once", "memory")


class OutputError(PkmcalError):
    """A result cannot be written (exit code 4)."""

    exit_code = 4
    default_code = "output"


@dataclass
class FaultList:
    """Collects the faults of a stage; knows errors from warnings, sorts by place."""

    faults: dict[Fault, None] = field(default_factory=dict)

    def add(self, fault: Fault) -> None:
        """Take a fault, unless the same one has been taken at the same place.

        Raises `BadInput` when there are so many that the file cannot be meant.
        """
        self.faults[fault] = None
        if len(self.faults) >= GIVE_UP:
            self.raise_if_any()

    def __iter__(self) -> Iterator[Fault]:
        return iter(self.faults)

    def __len__(self) -> int:
        return len(self.faults)

    @property
    def errors(self) -> list[Fault]:
        """The faults that are no warnings, sorted by place, those of one entry of a file gathered."""
        return _sorted(f for f in self.faults if f.severity == "error")

    @property
    def warnings(self) -> list[Fault]:
        """The warnings, as the errors."""
        return _sorted(f for f in self.faults if f.severity == "warning")

    def raise_if_any(self) -> None:
        """Raise `BadInput` with the first `MAX_FAULTS` errors if there is any."""
        errors = self.errors
        if errors:
            raise BadInput(errors[:MAX_FAULTS], len(errors))


def warnings_among(faults: Iterable[Fault]) -> list[Fault]:
    """The warnings, sorted by place. Raises `BadInput` with the errors."""
    every = FaultList()
    for fault in faults:
        every.add(fault)
    every.raise_if_any()
    return every.warnings


def _sorted(faults: Iterable[Fault]) -> list[Fault]:
    nowhere = Location("", 0, 0)
    ordered = sorted(faults, key=lambda f: (f.where or nowhere, f.what))
    entries = [replace(f, what="" if f.where is not None and f.where.column else f.what) for f in ordered]
    texts = zip(entries, (f.what for f in ordered), strict=True)
    return [replace(ordered[k], what=text) for k, text in gathered(texts)]


def nearest(name: str, names: Iterable[str]) -> str | None:
    """The valid name that is most like `name`, if any is so near that a slip makes the one of the other."""
    lower: dict[str, str] = {}
    for candidate in names:
        lower.setdefault(candidate.lower(), candidate)
    close = difflib.get_close_matches(name.lower(), lower, n=3, cutoff=_LIKE)
    return next((lower[c] for c in close if _slip(name.lower(), c)), None)


def _slip(name: str, known_name: str) -> bool:
    """Whether one is the beginning of the other, or few letters differ: one of three, two of six, three of nine."""
    short, long = sorted((name, known_name), key=len)
    if len(short) >= _BEGINNING and long.startswith(short):
        return True
    return edits(name, known_name) <= max(1, len(long) // 3)


def edits(a: str, b: str) -> int:
    """How many letters are more, less or other, or exchanged with the next (optimal string alignment)."""
    before: list[int] = []
    row = list(range(len(b) + 1))
    for i, c in enumerate(a, start=1):
        last, row = row, [i]
        for j, d in enumerate(b, start=1):
            cost = min(last[j] + 1, row[j - 1] + 1, last[j - 1] + (c != d))
            if i > 1 and j > 1 and c == b[j - 2] and d == a[i - 2]:
                cost = min(cost, before[j - 2] + 1)
            row.append(cost)
        before = last
    return row[-1]


def did_you_mean(name: str, names: Iterable[str], otherwise: str | None = None) -> str | None:
    """A hint with the nearest valid name, else the short list of names, else `otherwise`."""
    candidates = list(names)
    best = nearest(name, candidates)
    if best is not None:
        return f"did you mean `{best}`?"
    if otherwise is not None:
        return otherwise
    if 0 < len(candidates) <= 12:
        return "use one of " + ", ".join(f"`{c}`" for c in candidates)
    return None
