"""Every number of a machine file replaced in turn, and what the commands make of it."""

from __future__ import annotations

import random
import re
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import yaml

from tests.command import MACHINES, Done, run
from tests.support import SHIPPED

VALUES = ("0", "-1", "1e308", "1e-308")
_NUMBER = re.compile(r"(?<![A-Za-z0-9_.])(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?(?![A-Za-z0-9_.])")
_FOREIGN = re.compile(
    r"Traceback|internal error|LinAlg|numpy|scipy|SVD|[Ss]ingular matrix|infs or NaNs|array must not|leading minor|"
    r"Matrix is not|Warning|math domain|\bnan\b",
)
"""Words of libraries, and numbers that are none."""
ROWS = 24
SECONDS, FIT = 30, 300
"""Of computing that a command may take; a fit that explains nothing gets help from further starts before it says so."""


class TooLong(Exception):
    """A command that does not come to an end."""


@dataclass(frozen=True)
class Case:
    """A machine in which the number from `start` to `stop` of its file becomes `value`."""

    machine: str
    start: int
    stop: int
    value: str

    @property
    def text(self) -> str:
        """The changed file."""
        text = source(self.machine)
        return text[: self.start] + self.value + text[self.stop :]

    def __str__(self) -> str:
        text = source(self.machine)
        line = text.count("\n", 0, self.start) + 1
        column = self.start - text.rfind("\n", 0, self.start)
        return f"{self.machine}.yaml:{line}:{column} {text[self.start : self.stop]} -> {self.value}"


def source(machine: str) -> str:
    """A shipped machine's file."""
    return (MACHINES / f"{machine}.yaml").read_text(encoding="utf-8")


def numbers(machine: str) -> list[tuple[int, int]]:
    """Where the numbers of a file stand: in its scalars, also within expressions, beside units and in lists."""
    text, found = source(machine), []
    for token in yaml.scan(text):
        if isinstance(token, yaml.ScalarToken):
            start, stop = token.start_mark.index, token.end_mark.index
            found += [(start + m.start(), start + m.end()) for m in _NUMBER.finditer(text[start:stop])]
    return found


def cases(machine: str) -> list[Case]:
    """All of a machine."""
    return [Case(machine, start, stop, value) for start, stop in numbers(machine) for value in VALUES]


def sample(count: int, seed: int = 0) -> list[Case]:
    """Some of all machines, the same every time."""
    every = [case for machine in SHIPPED for case in cases(machine)]
    return sorted(random.Random(seed).sample(every, count), key=str)


def table_of(machine: str, folder: Path) -> Path:
    """Some rows of a machine's measurements."""
    data = min(MACHINES.glob(f"{machine}*.csv"), key=lambda p: (p.stem != machine, p.name))
    head, *rows = [line for line in data.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    every = max(1, len(rows) // ROWS)
    table = folder / f"{machine}.csv"
    table.write_text("\n".join([head, *rows[::every], ""]), encoding="utf-8")
    return table


def commands(machine: Path, table: Path, folder: Path, every: bool = True) -> Iterator[tuple[str | Path, ...]]:
    """What is run on a machine that `check` has nothing against; `every`: also what may take long."""
    yield "effects", machine
    yield "simulate", machine, table, "-o", folder / "out.csv", "--force", "--json"
    yield "sensitivity", machine, table, "--json"
    yield "observability", machine, table, "--json"
    if not every:
        return
    yield "calibrate", machine, table, "--holdout", "none", "--json"
    yield "plan", machine, table, "--json"


def faults(case: Case, folder: Path, every: bool = True) -> list[str]:
    """What a command did that it must not, for one changed machine."""
    file, table = folder / f"{case.machine}.yaml", table_of(case.machine, folder)
    file.write_text(case.text, encoding="utf-8")
    found = list(_looked_at(case, ("check", file)))
    if found or run("check", file, "-q", "--json").code != 0:
        return found
    for command in commands(file, table, folder, every):
        found += _looked_at(case, command)
    return found


def _looked_at(case: Case, command: tuple[str | Path, ...]) -> Iterator[str]:
    done = _timed(command)
    foreign = _FOREIGN.search(done.err)
    if done.code not in (0, 1, 2, 3):
        yield f"{case}: {command[0]} ended with {done.code}: {_last(done)}"
    elif foreign:
        yield f"{case}: {command[0]} says `{foreign[0]}`: {_last(done)}"
    elif "--json" in command and done.code < 2 and done.json is None:
        yield f"{case}: {command[0]} writes no JSON"
    elif done.code > 1 and not re.search(r"^(\S.*)?error\[", done.err, re.MULTILINE):
        yield f"{case}: {command[0]} does not say what is wrong: {_last(done)}"


def _last(done: Done) -> str:
    lines = [line for line in done.err.splitlines() if re.search(r"error|" + _FOREIGN.pattern, line)]
    return (lines or done.err.splitlines() or [""])[0][:300]


def _timed(command: tuple[str | Path, ...]) -> Done:
    """A command that is stopped when it takes too long: it ends with 70 then."""

    def stop(_: int, __: FrameType | None) -> None:
        raise TooLong(f"longer than {limit} s")

    limit = FIT if command[0] == "calibrate" else SECONDS
    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, limit)
    try:
        return run(*command)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)
