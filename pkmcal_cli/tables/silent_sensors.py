"""Sensors without a reading in any table: an error where a column that nothing uses may be theirs, else a warning."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.csv_files.cell_values import FaultLog
from pkmcal_cli.csv_files.dialect import Flaw, HeaderCell
from pkmcal_cli.csv_files.reader import TableReader
from pkmcal_cli.language.channels import channels_of
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.tables.columns import Column, columns_of
from pkmcal_cli.tables.near_names import did_you_mean_column, is_like


@dataclass(frozen=True)
class TableUse:
    """What a table was used for: the channels that it has a reading of, and the cells of its header, by index, whose
    columns nothing is made of; the header's line: number and text."""

    read: frozenset[str]
    spare: Mapping[int, HeaderCell]
    file: str
    line: int
    source: str
    separator: str

    @classmethod
    def of(cls, reader: TableReader, read: Collection[str], spare: Mapping[int, HeaderCell]) -> TableUse:
        """That of an open table; spare columns that hold nothing, so far as its beginning shows, do not count."""
        form, filled = reader.format, {i: cell for i, cell in spare.items() if reader.first_cell(i)}
        return cls(frozenset(read), filled, reader.name, form.header_line, reader.header_source(), form.separator)


def silent_sensors(machine: Machine, tables: Sequence[TableUse]) -> list[Fault]:
    """What is to be said of sensors without a reading.

    Columns that may be theirs are errors where no table has a reading of the sensor, warnings where another table has.
    A sensor that nothing is found of, and no such column, is a warning.
    """
    columns = {c.name: c for c in columns_of(machine) if c.role == "channel"}
    channels: dict[str, list[Column]] = {}
    for channel in channels_of(machine):
        if channel.column:  # else it stands in the machine file
            channels.setdefault(channel.sensor, []).append(columns[channel.name])
    faults = []
    for sensor, channel_columns in channels.items():
        silent = [table for table in tables if not table.read & {column.name for column in channel_columns}]
        astray = [fault for table in silent for fault in _astray(sensor, channel_columns, table)]
        if len(silent) < len(tables):
            astray = [replace(fault, severity="warning") for fault in astray]
        faults += astray or ([_no_reading(machine, sensor)] if len(silent) == len(tables) else [])
    return faults


def _astray(sensor: str, expected: Sequence[Column], table: TableUse) -> list[Fault]:
    """The unused columns of a table that may be those of a sensor."""
    log = FaultLog(table.file, table.separator)
    for index, cell in table.spare.items():
        like = next((column for column in expected if is_like(cell, column)), None)
        if like is not None:
            message = f"column `{cell.text}` is not used and sensor `{sensor}` has no reading in this table"
            log.add(Flaw("csv-missing", message, did_you_mean_column(cell, like), table.line, index), table.source)
    return log.faults


def _no_reading(machine: Machine, sensor: str) -> Fault:
    message = f"sensor `{sensor}` has no reading in any table"
    hint = "if the sensor was used, add its column or fill it in"
    return machine.source.fault("no-reading", message, ("sensors", sensor), hint, at_key=True, warning=True)
