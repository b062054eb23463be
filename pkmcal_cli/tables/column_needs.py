"""What a measurement table must have for a machine, and what is missing in it, with the remedy."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pkmcal_cli.base.errors import nearest
from pkmcal_cli.base.plural import listed
from pkmcal_cli.csv_files.cell_values import FaultLog, FloatArray
from pkmcal_cli.csv_files.dialect import Flaw, HeaderCell
from pkmcal_cli.csv_files.reader import TableReader
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.tables.columns import Column, channel_of_target, coordinates_of
from pkmcal_cli.tables.near_names import did_you_mean_column, is_near
from pkmcal_cli.tables.touches import known_readings
from pkmcal_cli.units.file_units import Unit

Require = Literal["actuators", "poses", "targets", "measured"]
"""What rows must have: actuator readings; these or TCP coordinates; those alone; readings and anywhere a channel."""


_EVERY_COORDINATE = "give all TCP coordinates of the table in every row"
_SEVERAL = 2  # drives without a column, from which on the table may be that of another machine


def _with_unit(column: Column) -> str:
    return f"`{column.header} [{column.unit_name}]`" if column.unit else f"`{column.header}`"


@dataclass(frozen=True)
class Bound:
    """A machine's column found at `index` of the header; `assumed` if not the header gives the `unit`."""

    column: Column
    index: int
    unit: Unit
    assumed: bool

    def to_si(self, values: FloatArray) -> FloatArray:
        """Values (n,) of the file in SI."""
        convert: Any = self.unit.to_si
        out = convert(values) if self.unit.text != "1" else values
        return np.asarray(out if self.column.scale == 1.0 else out * self.column.scale)


@dataclass
class Needs:
    """What a table needs, and what is missing in it; `known`: all columns that it can have."""

    reader: TableReader
    machine: Machine
    known: tuple[Column, ...]
    bound: list[Bound]
    spare: Mapping[int, HeaderCell]
    log: FaultLog

    def __post_init__(self) -> None:
        self.columns = {(c.name, c.role): c for c in self.known}
        self.columns_bound = {(b.column.name, b.column.role): b for b in self.bound}

    def check(self, require: Require) -> tuple[bool, dict[int, str], set[int]]:
        """Whether actuators give the poses; why a column may have no empty cell; columns left empty."""
        placing = [name for name, actuator in self.machine.actuators.items() if actuator.holds]
        filled = [name for name in placing if (b := self.columns_bound.get((name, "actuator"))) and self._filled(b)]
        targets = [b for b in self.targets() if self._filled(b)]
        if not targets and require in ("poses", "targets") and not self._any_cell():
            targets = self.targets()  # a table without rows is told as that
        by_actuators = bool(filled) or require != "poses" or not targets or not placing
        required = self._forces()
        if require == "targets":
            by_actuators = False
            if not targets:
                self._no_targets()
            required |= {b.index: _EVERY_COORDINATE for b in targets}
        elif not by_actuators:
            required |= {b.index: _EVERY_COORDINATE for b in targets}
        elif require == "poses" and placing and not any((n, "actuator") in self.columns_bound for n in placing):
            self._no_pose(placing)
        else:
            required |= self._actuators(placing)
        if require == "measured":
            self._channels()
        session = self.columns_bound.get(("session", "label"))
        if session is not None:
            required[session.index] = "give the session in every row"
        blank = set()
        if not by_actuators:
            poses = [b for b in self.bound if b.column.role == "actuator" and b.column.name in placing]
            poses = poses if require == "poses" else []
            blank = {b.index for b in (*poses, *self.targets()) if not self._filled(b)}
        return by_actuators, required, blank

    def doubt_machine(self, misfits: Collection[int]) -> None:
        """Ask whether the table is one of this machine where most drives have no column that fits, nor one like it.

        misfits: columns of the header whose unit does not fit.
        """
        drives = [self.columns[name, "actuator"] for name, actuator in self.machine.actuators.items() if actuator.holds]
        lost = [c for c in drives if self._is_lost(c, misfits)]
        slips = all((c.name, c.role) in self.columns_bound for c in lost) and len(lost) < len(drives)
        if len(lost) < _SEVERAL or 2 * len(lost) <= len(drives) or slips:
            return
        channels = [c for c in self.columns.values() if c.role == "channel"]
        needed, read = (listed([_with_unit(c) for c in columns], 12) for columns in (drives, channels))
        message = f"{len(lost)} of {len(drives)} drives of this machine have no column that fits"
        hint = f"is this a table of this machine? It needs {needed}, and what was measured: {read}"
        self.log.conclude(Flaw("csv-missing", message, hint, self.reader.format.header_line))

    def _is_lost(self, column: Column, misfits: Collection[int]) -> bool:
        bound = self.columns_bound.get((column.name, column.role))
        return not self._remedy([column]).startswith("did you mean") if bound is None else bound.index in misfits

    def targets(self) -> list[Bound]:
        """The columns of TCP coordinates."""
        channels = channel_of_target(self.machine).values()
        return [b for b in self.bound if b.column.role == "target" or b.column.name in channels]

    def _filled(self, bound: Bound) -> bool:
        """Whether a column has anything in it, so far as the beginning of the file shows."""
        return bool(self.reader.first_cell(bound.index))

    def _any_cell(self) -> bool:
        """Whether anything stands below the header, so far as the beginning of the file shows."""
        return any(self.reader.first_cell(index) for index in range(len(self.reader.header)))

    def _actuators(self, names: Sequence[str]) -> dict[int, str]:
        required = {}
        for name in names:
            b = self.columns_bound.get((name, "actuator"))
            if b is None:
                column = self.columns[name, "actuator"]
                self._missing(f"missing column `{column.header}` (actuator {name})", column)
            else:
                required[b.index] = f"give the reading of actuator {name} in every row"
        return required

    def _forces(self) -> dict[int, str]:
        """Forces of force-controlled actuators that have no constant one."""
        required = {}
        for name, actuator in self.machine.actuators.items():
            column = self.columns[f"{name}.force", "force"]
            b = self.columns_bound.get((column.name, "force"))
            stated = actuator.force is not None and actuator.force.otherwise is not None
            if stated and b is None:
                self._astray([column], f"the force of actuator {name} has no column")
            elif actuator.control == "force" and not stated:
                if b is None:
                    message = f"missing column `{column.header}` (force of actuator {name})"
                    hint = f"{self._remedy([column])}; or state a constant `force` of {name} in the machine file"
                    self.log.add(Flaw("csv-missing", message, hint, self.reader.format.header_line))
                else:
                    required[b.index] = (
                        f"give the force of actuator {name} in every row, or `otherwise` in the machine file"
                    )
        return required

    def _channels(self) -> None:
        """Some channel, and none whose column is there under a name that is nearly its own."""
        channels = [c for c in self.columns.values() if c.role == "channel"]
        lost = [c for c in channels if (c.name, "channel") not in self.columns_bound]
        if len(lost) == len(channels) and not known_readings(self.machine):
            names = listed([f"`{c.header}`" for c in channels])
            message = (
                f"no measurements: the table has none of the columns {names}" if names else "the machine has no sensors"
            )
            self._missing(message, *channels)
            return
        self._astray(lost, "channel `{name}` has no column")

    def _astray(self, lost: Sequence[Column], text: str) -> None:
        """Columns that nothing is made of, and whose name is nearly that of a lost one."""
        for index, cell in self.spare.items():
            near = next((c for c in lost if is_near(cell, c)), None)
            if near is not None and self.reader.first_cell(index):
                message = f"column `{cell.text}` is not used and {text.format(name=near.name)}"
                line_column = self.reader.format.header_line, index
                flaw = Flaw("csv-missing", message, did_you_mean_column(cell, near), *line_column)
                self.log.add(flaw, self.reader.header_source())

    def _no_targets(self) -> None:
        if self._empty_coordinates("targets"):
            return
        coordinates = ", ".join(f"`{name}`" for name in coordinates_of(self.machine))
        message = f"the table has no targets: none of the TCP coordinates {coordinates}"
        self._missing(message, *(c for c in self.columns.values() if c.role in ("target", "channel")))

    def _empty_coordinates(self, noun: str) -> bool:
        """Whether the table has columns of TCP coordinates, which are then told to be empty."""
        empty = [f"`{b.column.header}`" for b in self.targets()]
        if empty:
            message = f"the table has no {noun}: nothing stands in {listed(empty)}"
            self.log.add(Flaw("csv-missing", message, _EVERY_COORDINATE, self.reader.format.header_line))
        return bool(empty)

    def _no_pose(self, placing: Sequence[str]) -> None:
        if self._empty_coordinates("poses"):
            return
        drives = [self.columns[name, "actuator"] for name in placing]
        names = ", ".join(f"`{column.header}`" for column in drives)
        coordinates = ", ".join(f"`{name}`" for name in coordinates_of(self.machine))
        message = f"the table has no poses: neither actuators ({names}) nor TCP coordinates ({coordinates})"
        others = [c for c in self.columns.values() if c.role in ("target", "channel")]
        self._missing(message, *drives, *others)

    def _missing(self, message: str, *columns: Column) -> None:
        self.log.add(Flaw("csv-missing", message, self._remedy(columns), self.reader.format.header_line))

    def _remedy(self, columns: Sequence[Column]) -> str:
        """The unused header that may be meant, or what the header has."""
        cells = [cell for cell in self.spare.values() if cell.name]
        for column in columns:
            for cell in cells:
                bare = re.split(r"[(/_,]", cell.text, maxsplit=1)[0].rstrip()
                if bare == column.header and cell.text != bare and not cell.unit:
                    return f"did you mean `{cell.text}`? Write units in square brackets: `{bare} [{column.unit_name}]`"
            names = [cell.name for cell in cells]
            only = (name for name in names if name.lower().endswith(f".{column.header.lower()}"))  # sensor: no SENSOR.x
            near = nearest(column.header, names) or next(only, None)
            if near is not None:
                where = "`reads`" if column.role in ("channel", "target") else "`column`"
                return f"did you mean `{near}`? Rename it, or name it in the machine file ({where})"
        there = [f"`{cell.text}`" for cell in self.reader.header]
        more = f" and {len(there) - 12} more" if len(there) > 12 else ""
        return f"add the missing column; the header has {', '.join(there[:12])}{more}"
