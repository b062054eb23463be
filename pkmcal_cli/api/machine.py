"""Machines: files of one's own, and those that are shipped."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.base.files import AtHand
from pkmcal_cli.base.shipped import machine_file, shipped_file, shipped_machines
from pkmcal_cli.loading.load_machine import LoadedMachine, load_machine, loaded_machine
from pkmcal_cli.report.machine_report import machine_json
from pkmcal_cli.tables.columns import columns_of
from pkmcal_cli.units.unit_text import parse_unit

from .computing import computing
from .tables import file_of


@dataclass(frozen=True, eq=False)
class Machine:
    """A machine, read, checked and compiled; made by `load`."""

    file: str
    loaded: LoadedMachine = field(repr=False)  # not stable

    @property
    def name(self) -> str:
        """Its file without folder and ending."""
        return Path(self.file).stem

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is doubtful about the file."""
        return tuple(fault.text() for fault in self.loaded.warnings)

    @property
    def parameters(self) -> pd.DataFrame:
        """Declared parameters by name: nominal, range (half-width), unit, identified by default."""
        rows = []
        for p in self.loaded.model.parameters:
            unit = parse_unit(p.unit or "1")
            rows.append((p.name, unit.from_si(p.nominal), p.range / unit.scale, unit.text, p.identify))
        head = ["name", "nominal", "range", "unit", "identify"]
        return pd.DataFrame(rows, columns=head).set_index("name")

    @property
    def columns(self) -> pd.DataFrame:
        """Columns that a table of this machine can have, by header: role, unit of numbers without one."""
        rows = [(c.header, c.role, c.unit_name) for c in columns_of(self.loaded.machine)]
        return pd.DataFrame(rows, columns=["column", "role", "unit"]).set_index("column")

    def json(self) -> dict[str, Any]:
        """What `pkmcal check --json` says of it."""
        with computing():
            return machine_json(self.loaded.machine, self.loaded.compiled)

    @cached_property
    def receptive(self) -> LoadedMachine:
        """The machine that effects can enter which it does not declare; not stable."""
        with computing():
            return loaded_machine(self.loaded.machine, receptive=True)


def load(machine: str | os.PathLike[str] | Machine) -> Machine:
    """A machine of a file, or a shipped one by its name (`machines()`). Raises BadInput with all faults, UsageError."""
    if isinstance(machine, Machine):
        return machine
    name = machine if isinstance(machine, AtHand) else _existing_file(file_of(machine))
    with computing():
        return Machine(str(name), load_machine(name))


def _existing_file(name: str) -> str:
    """The file of a machine. Raises UsageError for a name of none."""
    file = machine_file(name)
    if not Path(name).suffix and Path(name).name == name and not os.path.exists(file):
        hint = did_you_mean(name, shipped_machines(), "name a file that ends with .yaml, or one of `machines()`")
        raise UsageError(f"no shipped machine `{name}`", hint=hint)
    return file


def machines() -> tuple[str, ...]:
    """Names of the shipped machines."""
    return shipped_machines()


def shipped(name: str) -> Path:
    """A shipped file: a machine, a table (`triglide.csv`) or a schema. Raises BadInput for a name of none."""
    return shipped_file(name)


def number(value: float | None) -> float:
    """A number of a table; nan for none."""
    return float("nan") if value is None else float(np.float64(value))
