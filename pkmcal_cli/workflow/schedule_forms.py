"""A schedule as people and controls take it: a table to fill in, a program that goes there and waits, a list."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.errors import BadInput, Location, UsageError, did_you_mean
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.outputs import write_text
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.visible import in_line
from pkmcal_cli.correction.commanded_machine import axis_letters, too_many_axes
from pkmcal_cli.correction.remark_lines import remark_lines
from pkmcal_cli.correction.strained_pose import held_drives
from pkmcal_cli.csv_files.origin import Origin
from pkmcal_cli.csv_files.writer import Values, open_writer
from pkmcal_cli.model.model import Model
from pkmcal_cli.tables.columns import APPROACH
from pkmcal_cli.units.unit_text import parse_unit

_SIDES = {1.0: "from below", -1.0: "from above", 0.0: "at rest"}
_NGC = "https://www.nist.gov/publications/nist-rs274ngc-interpreter-version-3"

DWELL, FEED = 2.0, 1000.0
"""Seconds and mm/min, where nothing is stated."""
_MOST = 1e6


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """Rows in the order of measurement: ids, partners by column, sessions (none: one without a name), set values (n, h)
    of drives with units, where each approach begins and its sides (n, h); following: sides (n,) of drives that have no
    set value, by name; forces: headers, units and values (n,) of those that are commanded, SI; ways: set values (k, h)
    on the way from the row before, for programs; readings: headers and units of what is to be filled in.
    """

    machine: str
    ids: Sequence[str]
    partners: Sequence[Sequence[str]]
    sessions: Sequence[str]
    drives: Sequence[tuple[str, str, str]]  # name, column, unit
    there: Array
    begin: Array
    side: Array
    following: Mapping[str, Array]
    forces: Sequence[tuple[str, str | None, Values]]
    ways: Sequence[Array]
    readings: Sequence[tuple[str, str | None]]
    dwell: float
    feed: float
    origin: Origin


def _table(s: Schedule, target: str, inputs: Collection[str], force: bool) -> None:
    headers: list[tuple[str, str | None]] = [("id", None), *[("to", None) for _ in s.partners]]
    headers += [("session", None)] if s.sessions else []
    headers += [(column, unit) for _, column, unit in s.drives]
    headers += [(f"dir.{name}", None) for name in (*(n for n, _, _ in s.drives), *s.following)]
    headers += [(f"{APPROACH}{name}", unit) for name, _, unit in s.drives]
    headers += [(name, unit) for name, unit, _ in s.forces]
    named = [s.sessions] if s.sessions else []
    columns: list[Values] = [s.ids, *s.partners, *named, *s.there.T, *s.side.T, *s.following.values(), *s.begin.T]
    columns += [force for _, _, force in s.forces]
    blank, origin = np.full(len(s.ids), np.nan), None if is_stream(target) else s.origin
    with open_writer(target, [*headers, *s.readings], inputs, origin=origin, digits=9, force=force) as writer:
        writer.write([*columns, *(blank for _ in s.readings)])


def _program(s: Schedule, target: str, inputs: Collection[str], force: bool) -> None:
    """RS274/NGC for identity kinematics: to where the approach begins, to the pose, wait."""
    lengths = _lengths(unit for *_, unit in s.drives)
    units, letters = [parse_unit("mm" if length else "deg") for length in lengths], axis_letters(lengths)

    def words(row: Array) -> str:
        parts = zip(letters, units, row, strict=True)
        return " ".join(f"{letter}{unit.from_si(float(v)):.6f}" for letter, unit, v in parts)

    named = ", ".join(f"{letter} = {name}" for letter, (name, _, _) in zip(letters, s.drives, strict=True))
    head = [f"set values of drives, identity kinematics: {named}; mm, deg", _NGC]
    lines = [*remark_lines(";", head), "G21", "G90", "G94"]
    for k, name in enumerate(s.ids):
        moves = [*s.ways[k], s.begin[k], s.there[k]]
        session = f", session {in_line(s.sessions[k])}" if s.sessions else ""
        lines += [*remark_lines(";", [f"{name}{session}"]), *(f"G1 {words(row)} F{s.feed:g}" for row in moves)]
        lines += [f"G4 P{s.dwell:g}"]
    with write_text(target, inputs, force=force) as file:
        file.write("\n".join([*lines, "M2", ""]))


def _checklist(s: Schedule, target: str, inputs: Collection[str], force: bool) -> None:
    """Lines to tick off, with room for the readings."""
    units = [parse_unit(unit) for *_, unit in s.drives]
    blanks = "  ".join(f"{name} = ________ {unit or ''}".rstrip() for name, unit in s.readings)
    lines = [f"Measurement of {s.machine}: {len(s.ids)} rows. Wait {s.dwell:g} s at each, then read.", ""]
    for k, name in enumerate(s.ids):
        parts = zip(s.drives, units, s.begin[k], s.there[k], s.side[k], strict=True)
        moves = [
            f"{n}: {u.from_si(float(b)):.3f} -> {u.from_si(float(t)):.3f} {u.text} ({_SIDES[float(side)]})"
            for (n, _, _), u, b, t, side in parts
        ]
        moves += [f"{n}: {parse_unit(u or '1').format(float(force[k]), 6)}" for n, u, force in s.forces]
        joined = "".join(f", to {column[k]}" for column in s.partners if column[k])
        joined += f", session {in_line(s.sessions[k])}" if s.sessions else ""
        lines += [f"[ ] {k + 1:>3}  {name}{joined}", *(f"         {m}" for m in moves), f"         {blanks}", ""]
    with write_text(target, inputs, force=force) as file:
        file.write("\n".join(lines))


_FORMS: Mapping[str, Callable[[Schedule, str, Collection[str], bool], None]] = {
    "csv": _table,
    "gcode": _program,
    "checklist": _checklist,
}


def check_form(name: str, dwell: float, feed: float) -> None:
    """Whether there is such a form. Raises UsageError."""
    if name not in _FORMS:
        raise UsageError(f"--as: `{name}` is not a form of a plan", hint=did_you_mean(name, _FORMS))
    check_motion(dwell, feed, program=name != "csv")


def check_drives(name: str, target: str | None, model: Model) -> None:
    """Before the work: whether a form that is to be written can hold all drives with set values. Raises BadInput."""
    lengths = _lengths(model.actuators[a].unit for a in held_drives(model))
    if target is not None and name == "gcode" and (message := too_many_axes(lengths)):
        hint = "use `--as checklist`, or `--as csv`"
        raise BadInput.single(f"--as gcode: {message}", Location(model.name), hint, "format")


def _lengths(units: Iterable[str]) -> list[bool]:
    return [parse_unit(unit).dimension.name == "length" for unit in units]


def check_motion(dwell: float, feed: float, *, program: bool) -> None:
    """Whether seconds and mm/min are such, and a program has them. Raises UsageError."""
    for option, value, default in (("--dwell", dwell, DWELL), ("--feed", feed, FEED)):
        if not 0 < value < _MOST:
            hint = f"give, for example, `{option} {default:g}`"
            raise UsageError(f"{option}: {value:g} is not a positive number", hint=hint)
        if value != default and not program:
            raise UsageError(f"{option} is for programs", hint="add `--as gcode`")


def write_form(name: str, schedule: Schedule, target: str, inputs: Collection[str], force: bool) -> None:
    """A schedule as a table, a program or a list. Raises OutputError and BadInput."""
    _FORMS[name](schedule, target, inputs, force)
