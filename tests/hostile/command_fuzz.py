"""Mutated tables, machine files and parameter files through whole commands: exit codes of the table, no traceback.

What `simulate` gives back of the poses it was given is compared with what the plain reader reads.
"""

from __future__ import annotations

import csv
import io
import random
from functools import cache
from pathlib import Path

from tests.command import EXIT_CODES, MACHINES, Done, run
from tests.hostile import machine_fuzz, table_fuzz
from tests.hostile.plain_table import Unsure, read_plain
from tests.hostile.plain_units import unit
from tests.hostile.sheets import mutate
from tests.hostile.yaml_slips import mutate as mutate_yaml
from tests.hostile.yaml_slips import spots

_CLOSE = 1e-9  # tables are written with so many digits
_TABLE = (
    "simulate {m} {t}", "simulate {m} {t}", "simulate {m} {t}", "check {m} {t}", "check {m} {t} --json",
    "sensitivity {m} {t}", "correct {m} {t} -p {p}", "observability {m} {t} --json",
)  # fmt: skip
_MACHINE = ("check {m}", "check {m} --json", "sensitivity {m} --json", "check {m} --format github")
_PARAMETERS = ("compare {p} {q}", "check {m} -p {p}", "simulate {m} {t} -p {p}", "compare {p} {q} --json")


@cache
def _parameters() -> str:
    """A parameter file of the Biglide."""
    done = run("calibrate", MACHINES / "biglide.yaml", MACHINES / "biglide.csv", "-o", "-")
    assert done.code == 0, done.err
    return done.out


def judged(seed: int, folder: Path) -> tuple[str, str]:
    """A command with one mutated input: (outcome, what is wrong, "" if nothing)."""
    rng = random.Random(seed)
    names = {
        key: str(folder / name) for key, name in (("m", "m.yaml"), ("t", "t.csv"), ("p", "p.yaml"), ("q", "q.yaml"))
    }
    case = table_fuzz.CASES[0]
    sheet, machine, parameters = table_fuzz.sheet_of(case, rng), machine_fuzz.base("biglide")[0], _parameters()
    kind = rng.choice((_TABLE, _TABLE, _MACHINE, _PARAMETERS))
    Path(names["q"]).write_text(parameters, encoding="utf-8")
    if kind is _TABLE:
        mutate(sheet, rng)
    elif kind is _MACHINE:
        machine = mutate_yaml(*machine_fuzz.base("biglide"), rng)
    else:
        parameters = mutate_yaml(parameters, _spots(), rng)
    Path(names["m"]).write_text(machine, encoding="utf-8")
    Path(names["p"]).write_text(parameters, encoding="utf-8")
    Path(names["t"]).write_bytes(sheet.data())
    command = rng.choice(kind)
    done = run(*(word.format(**names) for word in command.split()))
    wrong = _ended(done)
    if not wrong and done.code == 0 and kind is _TABLE and command.startswith("simulate"):
        try:
            wrong = _given_back(done.out, sheet.data(), sheet.separator, sheet.decimal)
        except Unsure as error:
            wrong = f"read what is unsure: {error}"
    return (
        (f"{command.split()[0]} failed", f"{command}: {wrong}")
        if wrong
        else ("done" if done.code < 2 else "refused", "")
    )


@cache
def _spots():  # type: ignore[no-untyped-def]
    return spots(_parameters())


def _ended(done: Done) -> str:
    """What is wrong with the end of a command."""
    if done.code not in EXIT_CODES:
        return f"exit code {done.code}: {done.err[-300:]}"
    if "Traceback" in done.err or "Warning:" in done.err:
        return done.err[-300:]
    return "" if done.code < 2 or "error[" in done.err else f"exit code {done.code} without an error"


def _given_back(out: str, data: bytes, separator: str, decimal: str) -> str:
    """Readings of drives in a simulated table that are not those given."""
    lines = [line for line in out.splitlines() if not line.startswith("#")]
    header, *rows = csv.reader(io.StringIO("\n".join(lines)))
    plain = read_plain(data, separator, decimal, dict(table_fuzz.CASES[0].known))
    for place, cell in enumerate(header):
        name, _, text = cell.partition(" [")
        if name not in ("q1", "q2", "q3") or name not in plain.numbers:
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
