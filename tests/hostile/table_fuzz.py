"""Mutated measurement tables through the program's reader, against the plain one."""

from __future__ import annotations

import csv
import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import cycle
from pathlib import Path

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.tables.measurements import Measurements, read_measurements
from tests.command import MACHINES
from tests.hostile.plain_table import Known, PlainTable, Unsure, read_plain
from tests.hostile.sheets import Sheet, mutate

ROWS = 5
_CLOSE = 1e-12


@dataclass(frozen=True)
class Case:
    """A shipped machine with its table, more columns put in, and all the columns that such a table can have."""

    machine: str
    more: Mapping[str, Sequence[str]]
    known: Mapping[str, Known]


_COMMON = {"time": Known("T", "s"), "T": Known("K", "degC"), "payload": Known("M", "kg"), "replicate": Known("", "")}
_MM, _DEG, _RAD, _N = Known("L", "mm"), Known("A", "deg"), Known("A", "rad"), Known("F", "N")


def _case(machine: str, drives: Mapping[str, Known], channels: Mapping[str, Known], more: dict[str, list[str]]) -> Case:
    """`time` to `dir` go with every machine; the force of a crank is a torque."""
    known = dict(_COMMON) | dict(drives) | dict(channels)
    known |= {f"sigma.{name}": Known(k.letters, "mm" if k.letters == "L" else "deg") for name, k in known.items()
              if name in drives or name in channels}  # fmt: skip
    known |= {f"dir.{name}": Known("", "") for name in drives}
    known |= {f"{name}.force": _N if k.letters == "L" else Known("FL", "Nmm") for name, k in drives.items()}
    return Case(machine, more, known)


CASES = (
    _case("biglide", dict.fromkeys(("q1", "q2", "q3"), _MM), {"x": _MM, "y": _MM}, {
        "time [s]": ["0", "10.5", "21", "31.25", "40"], "T [degC]": ["20", "20.5", "21", "21.5", ""],
        "sigma.x [um]": ["5", "5", "5", "", "10"], "session": ["a", "a", "b", "b", "b"]}),
    _case("five-bar", dict.fromkeys(("q1", "q2"), _DEG), {"ballbar": _MM, "encoder1": _DEG, "encoder2": _DEG}, {
        "dir.q1": ["1", "-1", "0", "1", ""], "payload [kg]": ["0", "1", "1.5", "2", "0"]}),
    _case("gantry", dict.fromkeys(("Y1", "Y2", "X"), _MM), dict.fromkeys(("x", "y", "z"), _MM), {
        "time": ["2021-12-16T10:30:00", "2021-12-16T10:31:00", "2021-12-16T10:32:30", "2021-12-16T11:00:00",
                 "2021-12-17T10:30:00"], "X.force [N]": ["10", "", "-5.5", "0", "1e3"]}),
)  # fmt: skip


@cache
def _machine(name: str) -> Machine:
    return read_machine(MACHINES / f"{name}.yaml")


@cache
def _cells(name: str) -> list[list[str]]:
    with open(MACHINES / f"{name}.csv", encoding="utf-8") as file:
        return list(csv.reader(file))


def sheet_of(case: Case, rng: random.Random, count: int = ROWS) -> Sheet:
    """The first rows of the shipped table, with some of the other columns, whose cells come again after five rows."""
    header, *rows = [list(cells) for cells in _cells(case.machine)[: count + 1]]
    for name, texts in case.more.items():
        if rng.random() < 0.5:
            header.append(name)
            for cells, text in zip(rows, cycle(texts), strict=False):
                cells.append(text)
    return Sheet(header=header, rows=rows)


def judged(seed: int, folder: Path) -> tuple[str, str]:
    """A mutated table: (outcome, what is wrong with it, "" if nothing).

    Outcomes: `refused`, `agreed`, or what went wrong.
    """
    rng = random.Random(seed)
    case = rng.choice(CASES)
    sheet = sheet_of(case, rng)
    mutate(sheet, rng)
    data = sheet.data()
    file = folder / "t.csv"
    file.write_bytes(data)
    try:
        read = read_measurements([file], _machine(case.machine))
    except BadInput as error:
        return ("refused", "") if error.text().strip() else ("nothing told", "an error without a text")
    try:
        plain = read_plain(data, sheet.separator, sheet.decimal, dict(case.known))
    except Unsure as error:
        return "read what is unsure", str(error)
    wrong = next(differences(read, plain, case.known), "")
    return ("silent shift" if wrong else "agreed"), wrong


def differences(read: Measurements, plain: PlainTable, known: Mapping[str, Known]):  # type: ignore[no-untyped-def]
    """What the program read otherwise."""
    if read.line.tolist() != plain.lines:
        yield f"rows in lines {read.line.tolist()}, not {plain.lines}"
        return
    found = dict(zip(read.actuator_names, read.actuators.T.tolist(), strict=True))
    found |= dict(zip(read.channels, read.readings.T.tolist(), strict=True))
    found |= dict(zip((f"sigma.{n}" for n in read.channels), read.sigma.T.tolist(), strict=True))
    found |= dict(zip((f"sigma.{n}" for n in read.actuator_names), read.actuator_sigma.T.tolist(), strict=True))
    found |= dict(zip((f"{n}.force" for n in read.actuator_names), read.forces.T.tolist(), strict=True))
    found |= {name: values.tolist() for name, values in read.covariates.items()}
    for name in known:
        here, there = found.get(name), plain.numbers.get(name)
        for row in range(len(plain.lines)):
            a, b = here[row] if here else math.nan, there[row] if there else math.nan
            if not (a == b or (a != a and b != b) or abs(a - b) <= _CLOSE * abs(b)):
                yield f"{name} in line {plain.lines[row]}: {a}, not {b}"
    for name, texts in plain.labels.items():
        if list(read.labels.get(name, ())) != texts:
            yield f"{name}: {read.labels.get(name)}, not {texts}"
