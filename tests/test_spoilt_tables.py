"""Every shipped table with one thing wrong in it: every command ends with a result or with a fault that names it."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from tests.command import Done, clean, run
from tests.in_ci import in_ci
from tests.shipped import TABLES, machine_of

LIBRARY = re.compile(r"SVD|[Ss]ingular matrix|positive definite|infs or NaNs|array must|numpy|scipy|LAPACK|converge;")
"""What a linear-algebra library would say."""


QUICK = {
    "triglide": (), "triglide-nonredundant": (), "delta-printer": ("out_of_reach",),
    "hangprinter_2021-12-16": ("out_of_reach", "far_off"),
}  # fmt: skip
"""Tables of CI, in the plane, in space and of ropes; what makes their fits long is slow, as are all other tables."""


@dataclass(frozen=True)
class Csv:
    """A shipped table as cells: head lines, the header, rows; its machine, and columns of drives and of readings."""

    machine: Path
    head: str
    rows: tuple[tuple[str, ...], ...]
    drives: tuple[int, ...]
    channels: tuple[int, ...]

    @classmethod
    def of(cls, file: Path) -> Csv:
        lines = file.read_text(encoding="utf-8").splitlines()
        at = next(k for k, line in enumerate(lines) if not line.startswith("#"))
        names = [re.sub(r" *\[.*", "", name) for name in lines[at].split(",")]
        drives = [k for k, n in enumerate(names) if re.fullmatch(r"q\d|motor_[abc]_deg|TL|TR|z\d|X|Y\d", n)]
        reading = r"(\w+\.)?r?[xyz]|[xyz]_mm|\w*encoder\d|probe|BL"
        channels = [k for k, n in enumerate(names) if re.fullmatch(reading, n)]
        assert drives and channels, names
        rows = tuple(tuple(line.split(",")) for line in lines[at + 1 :])
        return cls(machine_of(file), "\n".join(lines[: at + 1]), rows, tuple(drives), tuple(channels))

    def with_cell(self, row: int, column: int, text: str) -> Csv:
        rows = [list(r) for r in self.rows]
        rows[row][column] = text
        return Csv(self.machine, self.head, tuple(map(tuple, rows)), self.drives, self.channels)

    def of_rows(self, rows: Sequence[tuple[str, ...]]) -> Csv:
        return Csv(self.machine, self.head, tuple(rows), self.drives, self.channels)

    def spread(self, column: int) -> float:
        values = [float(r[column]) for r in self.rows if r[column]]
        return float(np.ptp(values)) or abs(values[0]) or 1.0

    @property
    def text(self) -> str:
        return "\n".join([self.head, *(",".join(r) for r in self.rows), ""])


def _shifted(csv: Csv, row: int, column: int, share: float) -> Csv:
    return csv.with_cell(row, column, repr(float(csv.rows[row][column]) + share * csv.spread(column)))


def _middle(csv: Csv, column: int) -> int:
    """A row in the middle that has a number in a column."""
    return next(k for k in range(len(csv.rows) // 2, len(csv.rows)) if csv.rows[k][column])


def out_of_reach(csv: Csv) -> Csv:
    return _shifted(csv, _middle(csv, csv.drives[0]), csv.drives[0], 3.0)


def far_off(csv: Csv) -> Csv:
    return _shifted(csv, _middle(csv, csv.channels[0]), csv.channels[0], 0.6)


def nothing_measured(csv: Csv) -> Csv:
    row = len(csv.rows) // 2
    for column in csv.channels:
        csv = csv.with_cell(row, column, "")
    return csv


def only_separators(csv: Csv) -> Csv:
    row = len(csv.rows) // 2
    return csv.of_rows([*csv.rows[:row], ("",) * len(csv.rows[0]), *csv.rows[row:]])


def a_fifth_empty(csv: Csv) -> Csv:
    for row in range(2, len(csv.rows), 5):
        csv = csv.with_cell(row, csv.channels[0], "")
    return csv


def three_rows(csv: Csv) -> Csv:
    return csv.of_rows(csv.rows[:3])


SPOILT: tuple[Callable[[Csv], Csv], ...] = (
    out_of_reach, far_off, nothing_measured, only_separators, a_fifth_empty, three_rows,
)  # fmt: skip


GOOD = (out_of_reach, nothing_measured, a_fifth_empty)
"""What is wrong concerns few rows or readings: the others have a result."""


def looked_at(done: Done, how: Callable[[Csv], Csv]) -> Done:
    """A result, or a fault with a code; where the rest of the table is good, a result."""
    clean(done)
    assert done.code in ((0, 1) if how in GOOD else (0, 1, 3)), done.err
    assert done.code != 3 or re.search(r"error\[[a-z-]+\]: ", done.err), done.err
    assert not LIBRARY.search(done.err), done.err
    return done


def spoilt(table: Path, how: Callable[[Csv], Csv], folder: Path) -> tuple[str, str]:
    """The machine and the spoilt table, as files."""
    csv = Csv.of(table)
    file = folder / f"{how.__name__}.csv"
    file.write_text(how(csv).text, encoding="utf-8")
    return str(csv.machine), str(file)


def cases() -> list[object]:
    """Every table spoilt in every way."""
    quick = [f"{name}-{h.__name__}" for name, long in QUICK.items() for h in SPOILT if h.__name__ not in long]
    return in_ci(quick, product(TABLES, SPOILT), lambda value: str(getattr(value, "stem", None) or value.__name__))


@pytest.mark.parametrize(("table", "how"), cases())
def test_check_and_calibrate(table: Path, how: Callable[[Csv], Csv], tmp_path: Path) -> None:
    files = spoilt(table, how, tmp_path)
    looked_at(run("check", *files), how)
    looked_at(run("calibrate", *files, "--holdout", "none", "--starts", "1"), how)


@pytest.mark.slow
@pytest.mark.parametrize("how", SPOILT, ids=lambda how: how.__name__)
@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.stem)
@pytest.mark.parametrize("command", ["calibrate", "diagnose", "improve", "plan", "observability", "simulate"])
def test_every_command(command: str, table: Path, how: Callable[[Csv], Csv], tmp_path: Path) -> None:
    done = run(command, *spoilt(table, how, tmp_path))
    looked_at(done, how if command in ("calibrate", "diagnose", "plan") else three_rows)
