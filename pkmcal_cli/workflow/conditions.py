"""Circumstances on the command line: `--at "T=23 +- 0.5,payload=40,session=monday"`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.tables.columns import columns_of, temperature_column
from pkmcal_cli.units.unit_text import Unit
from pkmcal_cli.workflow.amounts import amount

_EXAMPLE = 'give, for example, --at "T=23 +- 0.5,payload=40"'
_SIDES = (-1.0, 1.0)


@dataclass(frozen=True)
class Conditions:
    """Values and standard uncertainties of columns of all rows, SI; their session, "" where it says none."""

    values: Mapping[str, float] = field(default_factory=dict)
    std: Mapping[str, float] = field(default_factory=dict)
    session: str = ""


def conditions(machine: Machine, text: str | None) -> Conditions:
    """What `--at` says. Raises UsageError."""
    values: dict[str, float] = {}
    std: dict[str, float] = {}
    known = {c.name: c for c in columns_of(machine) if c.role == "covariate" and c.name != "replicate"}
    parts = _parts(text)
    session = parts.pop("session", "")
    for name, stated in parts.items():
        column = known.get(name) or temperature_column(name, machine)
        if column is None:
            hint = did_you_mean(name, [*known, "session"], _EXAMPLE)
            raise UsageError(f"--at: unknown circumstance `{name}`", hint=hint)
        value, *more = re.split(r"\+-|\u00b1", stated)
        unit = column.si_unit
        values[name] = _amount(name, value, unit)
        if name.startswith("dir.") and values[name] not in _SIDES:
            raise UsageError(f"--at: `{name}` is 1 or -1", hint="1: approached towards larger readings")
        if more:
            std[name] = _amount(name, more[0], unit.difference)
            if len(more) > 1 or name.startswith("dir.") or std[name] < 0:
                raise UsageError(f"--at: `{name}={stated}` is not a circumstance", hint=_EXAMPLE)
    return Conditions(values, {name: u for name, u in std.items() if u > 0}, session)


def _parts(text: str | None) -> dict[str, str]:
    """What is stated, by name. Raises UsageError."""
    parts: dict[str, str] = {}
    for part in text.split(",") if text is not None else ():
        name, equals, stated = (t.strip() for t in part.partition("="))
        if not equals or not stated:
            raise UsageError(f"--at: `{part.strip()}` is not a circumstance", hint=_EXAMPLE)
        if name in parts:
            raise UsageError(f"--at: `{name}` is given twice", hint="give every circumstance only once")
        parts[name] = stated
    return parts


def _amount(name: str, text: str, expected: Unit) -> float:
    """A value in SI; a bare number is in the unit of the column. Raises UsageError."""
    value, unit = amount("--at", text.strip(), expected=expected)
    if unit.dimension != expected.dimension:
        hint = f"give it in {expected.text}" if expected.text != "1" else "give a number"
        raise UsageError(f"--at: `{name}`: `{unit.text}` is a unit of {unit.dimension}", hint=hint)
    return value
