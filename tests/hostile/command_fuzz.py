"""Mutated tables, machine files, parameter files and command lines through whole commands.

Exit codes are those of the table, no traceback, no word of Python's in a message, JSON that all can read; what
`simulate` gives back of the poses it was given is compared with what the plain reader reads.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import random
import re
import tempfile
from collections.abc import Iterator
from functools import cache
from itertools import dropwhile
from pathlib import Path

import pytest

from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.loading import load_machine
from tests.command import EXIT_CODES, MACHINES, Done, run
from tests.hostile import command_lines, machine_fuzz, table_fuzz
from tests.hostile.command_lines import chosen, mistyped
from tests.hostile.plain_table import Unsure, read_plain
from tests.hostile.plain_units import unit
from tests.hostile.sheets import Sheet, mutate
from tests.hostile.table_fuzz import Case
from tests.hostile.yaml_slips import Spot, spots
from tests.hostile.yaml_slips import mutate as mutate_yaml

_CLOSE = 1e-9  # tables are written with so many digits
_ROWS = 12  # of the other tables: enough for a fit
_PYTHON = re.compile(r"<class |object at 0x|np\.\w+\(|PosixPath|dtype|Ellipsis|\bNoneType\b|\w+Error\b")
_CASES = (*table_fuzz.CASES[:1] * 6, *table_fuzz.CASES)
_KINDS = (
    (command_lines.TABLE,) * 4 + (command_lines.MACHINE, command_lines.PARAMETERS) * 2 + (command_lines.OPTIONS,) * 2
)


@cache
def _parameters(machine: str) -> str:
    """A parameter file of a shipped machine."""
    done = run("calibrate", MACHINES / f"{machine}.yaml", MACHINES / f"{machine}.csv", "-o", "-")
    assert done.code == 0, done.err
    return done.out


@cache
def _spots(machine: str) -> list[Spot]:
    return spots(_parameters(machine))


@cache
def _read(machine: str) -> Machine:
    """A shipped machine as it is read from `m.yaml`, which is the name of its file in every command."""
    Path("m.yaml").write_text(machine_fuzz.base(machine)[0], encoding="utf-8")
    return read_machine("./m.yaml")


@contextlib.contextmanager
def _reading_once(machine: str, text: str) -> Iterator[None]:
    """Commands within read `m.yaml` as a machine no second time where it is the shipped one."""
    known = _read(machine) if text == machine_fuzz.base(machine)[0] else None

    def read(path: str) -> Machine:
        return known if known is not None and path == "./m.yaml" else read_machine(path)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(load_machine, "read_machine", read)
        yield


def judged(seed: int, folder: Path) -> tuple[str, str]:
    """A command with one mutated input, or mistyped: (outcome, what is wrong, "" if nothing)."""
    rng = random.Random(seed)
    kind = rng.choice(_KINDS)
    line, case = chosen(kind, rng), rng.choice(_CASES)
    sheet = table_fuzz.sheet_of(case, rng, rng.choice((table_fuzz.ROWS, table_fuzz.ROWS, _ROWS)))
    machine, parameters = machine_fuzz.base(case.machine)[0], _parameters(case.machine)
    if kind is command_lines.TABLE:
        mutate(sheet, rng)
    elif kind is command_lines.MACHINE:
        machine = mutate_yaml(*machine_fuzz.base(case.machine), rng)
    elif kind is command_lines.PARAMETERS:
        parameters = mutate_yaml(parameters, _spots(case.machine), rng)
    texts = {"m.yaml": machine, "p.yaml": parameters, "q.yaml": _parameters(case.machine)}
    with tempfile.TemporaryDirectory(dir=folder) as here, contextlib.chdir(here), _reading_once(case.machine, machine):
        for name, text in texts.items():
            Path(name).write_text(text, encoding="utf-8")
        Path("t.csv").write_bytes(sheet.data())
        names = {"m": "./m.yaml", "t": "./t.csv", "p": "./p.yaml", "q": "./q.yaml", "o": "./out"}
        words = [word.format(**names) for word in line.split()]
        words = mistyped(words, rng) if kind is command_lines.OPTIONS else words
        done = run(*words, stdin="")
    wrong = _ended(done, words)
    if not wrong and done.code == 0 and kind is command_lines.TABLE and line == "simulate {m} {t}":
        try:
            wrong = _given_back(done.out, sheet, case)
        except Unsure as error:
            wrong = f"read what is unsure: {error}"
    return (f"{line.split()[0]} failed", f"{words}: {wrong}") if wrong else ("done" if done.code < 2 else "refused", "")


def _ended(done: Done, words: list[str]) -> str:
    """What is wrong with the end of a command."""
    if done.code not in EXIT_CODES:
        return f"exit code {done.code}: {done.err[-300:]}"
    if "Traceback" in done.err or "Warning:" in done.err or _PYTHON.search(done.err):
        return done.err[-600:]
    if done.code < 2 and "--json" in words and done.out.startswith("{"):
        try:
            _ = done.json
        except (AssertionError, json.JSONDecodeError) as error:
            return f"JSON: {error}"
    return "" if done.code < 2 or "error[" in done.err else f"exit code {done.code} without an error"


def _given_back(out: str, sheet: Sheet, case: Case) -> str:
    """Readings of drives in a simulated table that are not those given."""
    lines = dropwhile(lambda line: line.startswith("#"), out.splitlines())
    header, *rows = csv.reader(io.StringIO("\n".join(lines)))
    plain = read_plain(sheet.data(), sheet.separator, sheet.decimal, dict(case.known))
    for place, cell in enumerate(header):
        name, _, text = cell.partition(" [")
        if f"dir.{name}" not in case.known or name not in plain.numbers:
            continue
        scale = unit(text.rstrip("]"))
        assert scale is not None
        given = [value for value in plain.numbers[name] if value == value]
        if len(given) != len(plain.lines):
            continue  # poses by coordinates
        if len(rows) != len(given):
            return f"{len(rows)} rows, not {len(given)}"
        for row, right in zip(rows, given, strict=True):
            if not abs(float(row[place]) * scale[0] - right) <= _CLOSE * max(abs(right), 1e-3):
                return f"{name}: {row[place]} of {right}"
    return ""
