"""Faults of tables beside those of a machine: all that can be told is told in one run."""

from __future__ import annotations

from collections.abc import Sequence

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.csv_files.reader import check_cells
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.tables.measurements import read_measurements


def with_tables(error: BadInput, machine: str, tables: Sequence[str]) -> BadInput:
    """The faults of a machine file and those of its tables."""
    faults, total = list(error.faults), error.total
    for also in _of_tables(machine, tables):
        faults, total = [*faults, *also.faults], total + also.total
    return BadInput(faults, total)


def _of_tables(path: str, tables: Sequence[str]) -> list[BadInput]:
    """By the columns of the machine where it could be read, else of their form."""
    try:
        machine = read_machine(path) if tables and not is_stream(path) else None
    except BadInput:
        machine = None
    errors: list[BadInput] = []
    for table in tables:
        try:
            if machine is not None and machine.sensors:
                read_measurements([table], machine)
            else:
                check_cells(table)
        except BadInput as error:
            errors.append(error)
    return errors
