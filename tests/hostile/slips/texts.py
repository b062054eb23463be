"""Reads the lists of slips: one line each, under the codes of which one must be told.

`python -m tests.hostile.slips.texts` tells which slips get another answer.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.tables.measurements import MeasurementStream
from tests.command import MACHINES

FOLDER = Path(__file__).resolve().parent
_CORRECTED = "# What follows was expected to be told otherwise"
Codes = set[str]


@dataclass(frozen=True)
class Slip:
    """The first `old` of a shipped file, written as `new`; `expected`: codes, one of which is told, or `ok`.

    corrected: whether something else was expected before the answer was looked at.
    """

    file: str
    old: str
    new: str
    expected: frozenset[str]
    corrected: bool = False

    def text(self, ending: str) -> str:
        """The file with the slip in it. Raises ValueError where there is nothing to change."""
        text = (MACHINES / f"{self.file}.{ending}").read_text(encoding="utf-8")
        if self.old not in text or self.old == self.new:
            raise ValueError(f"nothing to change: {self}")
        return text.replace(self.old, self.new, 1)

    def right(self, told: Codes) -> bool:
        """Whether one of the codes is told, or nothing where nothing is wrong."""
        return not told if "ok" in self.expected else bool(told & self.expected)


def _plain(text: str) -> str:
    for written, meant in (("\\n", "\n"), ("\\t", "\t"), ("\\s", " "), ("\\x00", "\0")):
        text = text.replace(written, meant)
    return text


def slips(name: str) -> tuple[Slip, ...]:
    """All of a list `NAME.txt`."""
    found, expected, corrected = [], frozenset[str](), False
    for line in (FOLDER / f"{name}.txt").read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            expected = frozenset(line.strip("[]").split(" | "))
        elif line.startswith(_CORRECTED):
            corrected = True
        elif line and not line.startswith("#"):
            file, _, change = line.partition(": ")
            old, _, new = change.partition(" =>")
            old, new = _plain(old), _plain(new.removeprefix(" "))
            found.append(Slip(file, old, new, expected, corrected))
    return tuple(found)


def told_of_machine(slip: Slip, folder: Path) -> Codes:
    """Codes of all faults and warnings of a machine file."""
    file = folder / "slip.yaml"
    file.write_text(slip.text("yaml"), encoding="utf-8")
    try:
        loaded = load_machine(str(file))
    except BadInput as error:
        return {fault.code for fault in error.faults}
    return {fault.code for fault in (*loaded.warnings, *loaded.remarks)}


@cache
def _machine(table: str) -> Machine:
    return read_machine(MACHINES / f"{'scissors' if table == 'scissors-shopfloor' else table}.yaml")


def _notes(stream: MeasurementStream) -> set[str]:
    """Without the file that they are of."""
    return {note.partition(": ")[2] for note in stream.notes}


@cache
def _shipped_notes(table: str) -> set[str]:
    """Those of a table as it is shipped."""
    stream = MeasurementStream([MACHINES / f"{table}.csv"], _machine(table))
    list(stream)
    return _notes(stream)


def told_of_table(slip: Slip, folder: Path) -> Codes:
    """Codes of all faults and warnings of a table, `note` where only a note is told that the shipped table has not."""
    file = folder / "slip.csv"
    file.write_bytes(slip.text("csv").encode("utf-8"))
    stream = MeasurementStream([file], _machine(slip.file))
    try:
        list(stream)
    except BadInput as error:
        return {fault.code for fault in error.faults}
    notes = _notes(stream) - _shipped_notes(slip.file)
    return {fault.code for fault in stream.warnings} | ({"note"} if notes else set())


LISTS: dict[str, Callable[[Slip, Path], Codes]] = {"machines": told_of_machine, "tables": told_of_table}


def first_of_each(name: str, count: int) -> tuple[Slip, ...]:
    """The first slips of a list for every answer that is expected."""
    seen = Counter[frozenset[str]]()
    chosen = []
    for slip in slips(name):
        seen[slip.expected] += 1
        if seen[slip.expected] <= count:
            chosen.append(slip)
    return tuple(chosen)


def wrong(name: str, some: Sequence[Slip] | None = None) -> list[tuple[Slip, Codes]]:
    """Slips of a list, or some of them, that get another answer, and what is told of them."""
    with tempfile.TemporaryDirectory() as folder:
        answers = [(slip, LISTS[name](slip, Path(folder))) for slip in (slips(name) if some is None else some)]
    return [(slip, told) for slip, told in answers if not slip.right(told)]


def main() -> int:
    """All lists."""
    count = 0
    for name in LISTS:
        found = wrong(name)
        for slip, told in found:
            shown = " | ".join(sorted(told)) or "nothing"
            expected = " | ".join(sorted(slip.expected))
            print(f"{name}: {slip.file}: {slip.old!r} => {slip.new!r}: {shown}, not {expected}")
        every, corrected = len(slips(name)), sum(slip.corrected for slip in slips(name))
        print(f"{name}: {every - len(found)} of {every} get the message that is expected; "
              f"{corrected} expectations were corrected after the answer")  # fmt: skip
        count += len(found)
    return int(count > 0)


if __name__ == "__main__":
    sys.exit(main())
