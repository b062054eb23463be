"""Faults of tables beside those of a machine: all that can be told is told in one run."""

from __future__ import annotations

from collections.abc import Sequence

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.csv_files.reader import check_cells
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.tables.measurements import read_measurements


def with_tables(error: BadInput, path: str, tables: Sequence[str]) -> BadInput:
    """The faults of a machine file and those of its tables: by its columns where it could be read, else of form."""
    try:
        machine = None if is_stream(path) else read_machine(path)
    except BadInput:
        machine = None
    errors = [error]
    for table in tables:
        try:
            if machine is not None and machine.sensors:
                read_measurements([table], machine)
            else:
                check_cells(table)
        except BadInput as also:
            errors.append(also)
    return BadInput([fault for each in errors for fault in each.faults], sum(each.total for each in errors))
