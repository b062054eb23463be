"""Binds the header of a measurement table to the columns of a machine."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.plural import listed, with_article
from pkmcal_cli.csv_files.cell_values import ColumnRules, FaultLog, Kind, Rule
from pkmcal_cli.csv_files.cells import is_time
from pkmcal_cli.csv_files.dialect import Flaw, HeaderCell
from pkmcal_cli.csv_files.reader import TableReader, check_header
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.tables.column_needs import Bound, Needs, Require
from pkmcal_cli.tables.columns import APPROACH, Column, Role, columns_of, temperature_column
from pkmcal_cli.units.file_units import Unit, UnitError, parse_unit

_POSITIVE = Rule(
    lambda values: values > 0, "a sigma must be positive", "leave it empty where the sigma of the machine file holds"
)
_BLANK = Rule(np.isnan, "the cells above are empty", "give the pose with the same columns in all rows")
_DIRECTION = Rule(
    lambda values: np.isin(values, (-1.0, 0.0, 1.0)), "a direction must be 1, -1 or 0 (unknown)", "write 1, -1 or 0"
)


@dataclass(frozen=True)
class Binding:
    """What a table has of a machine: columns, how to read them, whether the actuators give the poses.

    known: all columns that a table of the machine can have; spare: cells of the header, by index, that nothing is
    made of.
    """

    known: tuple[Column, ...]
    bound: tuple[Bound, ...]
    spare: Mapping[int, HeaderCell]
    column_rules: ColumnRules
    by_actuators: bool
    notes: tuple[str, ...]

    def of(self, *roles: Role) -> list[Bound]:
        """The found columns of some roles."""
        return [b for b in self.bound if b.column.role in roles]

    def named(self, name: str) -> Bound | None:
        """The found column of a name."""
        return next((b for b in self.bound if b.column.name == name), None)


def bind(reader: TableReader, machine: Machine, require: Require, log: FaultLog) -> Binding:
    """Bind the header of an open table; faults go to `log`."""
    log.separator = reader.format.separator
    known = columns_of(machine)
    matches = _matches(reader.header, machine, known)
    check_header(reader, log, [columns[0].name if columns else None for columns in matches])
    bound, misfits = _bound(reader, matches, log)
    no_use: set[Role] = {"target"} if require == "measured" else set()  # TCP coordinates that no sensor reads
    spare = {i: reader.header[i] for i, columns in enumerate(matches) if {c.role for c in columns} <= no_use}
    needs = Needs(reader, machine, known, bound, spare, log)
    by_actuators, required, blank = needs.check(require)
    if by_actuators:
        needs.doubt_machine(misfits)
    column_rules = ColumnRules(
        _kinds(reader, needs.bound), required, _rules(needs.bound) | dict.fromkeys(blank, _BLANK)
    )
    used = [b for b in needs.bound if b.index not in spare]
    taken = {reader.header[b.index].name for b in used}
    free = [c.header for c in known if c.header not in taken and c.role not in no_use]
    notes = [_unused(spare, free), _assumed(used, column_rules)]
    if require == "poses" and by_actuators and needs.targets():
        placed = any(actuator.holds for actuator in machine.actuators.values())
        pose = "the actuator columns give the poses" if placed else "no actuator holds a position"
        notes.append(f"{pose}; the TCP coordinates are not used")
    if require == "targets" and any(b.column.role == "actuator" for b in needs.bound):
        notes.append("the TCP coordinates are the targets; the actuator columns are not used")
    return Binding(
        known=known,
        bound=tuple(needs.bound),
        spare=spare,
        column_rules=column_rules,
        by_actuators=by_actuators,
        notes=tuple(note for note in notes if note),
    )


def _matches(header: Sequence[HeaderCell], machine: Machine, known: Sequence[Column]) -> list[list[Column]]:
    """The machine's columns that each cell of the header names, by its whole text or without the unit."""
    by_header: dict[str, list[Column]] = {}
    for column in known:
        by_header.setdefault(column.header, []).append(column)
    out = []
    for cell in header:
        part = temperature_column(cell.name, machine)
        out.append(by_header.get(cell.text) or by_header.get(cell.name) or ([part] if part else []))
    return out


def _bound(
    reader: TableReader, matches: Sequence[Sequence[Column]], log: FaultLog
) -> tuple[list[Bound], set[int]]:
    """The columns that are there, each once; cells of the header whose unit is a fault."""
    bound: dict[tuple[str, str], Bound] = {}
    misfits: set[int] = set()
    for index, columns in enumerate(matches):
        if columns:
            before = log.total
            unit, assumed = _unit_of(reader, columns[0], index, log)
            misfits |= {index} if log.total > before else set()
            for column in columns:
                bound.setdefault((column.name, column.role), Bound(column, index, unit, assumed))
    return list(bound.values()), misfits


def _unit_of(reader: TableReader, column: Column, index: int, log: FaultLog) -> tuple[Unit, bool]:
    """The unit of a found column and whether it is assumed; a unit that does not fit is a fault."""
    cell = reader.header[index]
    if cell.unit is None or cell.unit in ("", "-") or column.role == "label":
        return column.si_unit, column.unit is not None
    if cell.unit == column.unit_name:  # it may be the machine's own, of which nobody else knows
        return column.si_unit, False
    line_column = reader.format.header_line, index
    hint = f"write, for example, `{column.header} [{column.unit_name}]`" if column.unit else "delete the unit"
    try:
        unit = parse_unit(cell.unit, (column.physical,))
    except UnitError as error:
        near = error.hint if error.hint and error.hint.startswith("did you mean") else None
        log.add(
            Flaw("csv-unit", f"{error.message} in column `{cell.text}`", near or hint, *line_column),
            reader.header_source(),
        )
        return column.si_unit, False
    if unit.dimension != column.physical:
        message = (
            f"column `{cell.text}`: `{cell.unit}` is a unit of {unit.dimension}, but this is {_a(column.dimension)}"
        )
        log.add(Flaw("csv-unit", message, hint, *line_column), reader.header_source())
    return unit, False


def _a(dimension: str) -> str:
    if dimension == "none":
        return "a plain number"
    return with_article(dimension)


def _kinds(reader: TableReader, bound: Sequence[Bound]) -> tuple[Kind, ...]:
    kinds: list[Kind] = ["skip"] * len(reader.header)
    for b in bound:
        if b.column.role == "label":
            kinds[b.index] = "text"
        elif b.column.name == "time" and is_time(reader.first_cell(b.index)):
            kinds[b.index] = "time"
        else:
            kinds[b.index] = "number"
    return tuple(kinds)


def _rules(bound: Sequence[Bound]) -> dict[int, Rule]:
    rules = {b.index: _POSITIVE for b in bound if b.column.role == "sigma"}
    return rules | {b.index: _DIRECTION for b in bound if b.column.name.startswith("dir.")}


def _unused(spare: Mapping[int, HeaderCell], free: Sequence[str]) -> str:
    """The columns that nothing is made of, each with the one of the free headers that may be meant.

    Those in which a plan says where approaches begin are for the control, and are left alone.
    """
    texts = []
    for index, cell in spare.items():
        if cell.name.startswith(APPROACH):
            continue
        near = _likely(cell.name, free)
        name = f"`{cell.text}`" if cell.text else f"column {index + 1} without a name"
        texts.append(name + (f" (did you mean `{near}`?)" if near else ""))
    return f"columns not used: {listed(texts)}" if texts else ""


def _likely(name: str, names: Sequence[str]) -> str | None:
    """The name that is much like this one but for case."""
    lower = {other.lower(): other for other in names}
    close = difflib.get_close_matches(name.lower(), list(lower), n=1, cutoff=0.8)
    return lower[close[0]] if close else None


def _assumed(bound: Sequence[Bound], column_rules: ColumnRules) -> str:
    """The columns whose header has no unit, by the unit of the machine file that they are taken in."""
    units: dict[str, list[str]] = {}
    for b in bound:
        if b.assumed and column_rules.kinds[b.index] == "number":
            names = units.setdefault(b.unit.text, [])
            names += [b.column.header] if b.column.header not in names else []
    groups = [f"{unit} ({listed(names)})" for unit, names in units.items()]
    return f"no units in the header; the units of the machine file are used: {', '.join(groups)}" if groups else ""
