"""The columns that a machine's measurement tables can have: names, headers, roles, dimensions, units."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from pkmcal_cli.language.channels import channels_of
from pkmcal_cli.language.fields import PLANAR, SPATIAL
from pkmcal_cli.language.machine import Actuator, Machine
from pkmcal_cli.language.tool_point import tool_point_of
from pkmcal_cli.units.file_units import (
    ANGLE,
    FORCE,
    LENGTH,
    MASS,
    NUMBER,
    TEMPERATURE,
    TIME,
    TORQUE,
    UNITS,
    Dimension,
    Unit,
    parse_unit,
)  # fmt: skip

Role = Literal["actuator", "force", "channel", "target", "sigma", "covariate", "label"]
LABELS = ("id", "session", "tool", "part", "to")
"""Columns of text that every measurement table can have."""
APPROACH = "approach."
"""Before the name of a drive: where a plan has its approach begin."""

_PART = re.compile(r"T\.[A-Za-z][A-Za-z0-9_]*")
_DIMENSIONS: dict[str, Dimension] = {
    "length": LENGTH, "angle": ANGLE, "force": FORCE, "torque": TORQUE, "mass": MASS, "time": TIME,
    "temperature": TEMPERATURE, "none": NUMBER,
}  # fmt: skip
_NAMES = {dimension: name for name, dimension in _DIMENSIONS.items()}


@dataclass(frozen=True)
class Column:
    """A column that a machine can bind.

    name: the engine's name: "q1", "q1.force", "x" or "camera.x", "sigma.x", "time", "T.frame", "dir.q1", "id"
    header: its header in the file, without unit
    role: an actuator's reading; its force; a measured channel (a force-controlled actuator's reading is one);
        a TCP coordinate that no sensor reads; the sigma of a channel or actuator; a covariate; a label
    dimension: a key of `units:`, or "torque", or "none"
    unit: definition of that of the numbers if the header names none; None for plain numbers and labels
    scale: what the numbers are multiplied with besides (a force's `scale`)
    """

    name: str
    header: str
    role: Role
    dimension: str
    unit: str | None = None
    scale: float = 1.0

    @property
    def si_unit(self) -> Unit:
        """The unit of its numbers where the header names none."""
        return UNITS["1"] if self.unit is None else parse_unit(self.unit)

    @property
    def unit_name(self) -> str:
        """Its unit as a header names it; "" for plain numbers and labels."""
        return "" if self.unit is None else self.si_unit.text

    @property
    def physical(self) -> Dimension:
        """Its dimension."""
        return _DIMENSIONS[self.dimension]


def columns_of(machine: Machine) -> tuple[Column, ...]:
    """All columns that a table of this machine can have, but for the temperatures `T.PART` of its parts.

    First the actuators, then the channels (of the sensors, then of force-controlled actuators), each in the
    order of the machine file.
    """
    actuators = machine.actuators
    columns = [_reading(name, actuator, machine) for name, actuator in actuators.items()]
    columns += _channels(machine)
    columns += [_reading(n, a, machine, "channel") for n, a in actuators.items() if not a.holds]
    columns += _targets(machine, columns)
    columns += [_force(name, actuator, machine) for name, actuator in actuators.items()]
    columns += _sigmas(machine, columns)
    columns += _covariates(machine)
    return (*columns, *(Column(name, name, "label", "none") for name in LABELS))


def temperature_column(name: str, machine: Machine) -> Column | None:
    """The column of a part's temperature, `T.PART`; None for other names."""
    if not _PART.fullmatch(name):
        return None
    return _column(machine, name, "covariate", "temperature")


def coordinates_of(machine: Machine) -> tuple[str, ...]:
    """The TCP coordinates: x, y, rz in the plane, x, y, z, rx, ry, rz in space."""
    return PLANAR if machine.space == "planar" else SPATIAL


def channel_of_target(machine: Machine) -> dict[str, str]:
    """Channels that give coordinates of the tool point: those of the only sensor, if it measures there only."""
    channels, tool = channels_of(machine), tool_point_of(machine)
    in_tables = [c for c in channels if not c.measurand.once]
    alone = len({c.sensor for c in in_tables}) == 1
    alone = alone and {c.target for c in in_tables} == {tool.name if tool is not None else ""}
    if not alone or tool is None or not tool.sensor:
        return {}
    return {c.direction: c.name for c in channels if c.measurand.of_pose}


def _column(machine: Machine, name: str, role: Role, dimension: str, header: str = "") -> Column:
    """A column in the machine's unit of its dimension."""
    unit = None if dimension == "none" else machine.file_units.unit(_DIMENSIONS[dimension]).text
    return Column(name, header or name, role, dimension, unit)


def _reading(name: str, actuator: Actuator, machine: Machine, role: Role = "actuator") -> Column:
    dimension = "angle" if actuator.reading_dimension == ANGLE else "length"
    unit = actuator.unit or machine.file_units.unit(_DIMENSIONS[dimension]).text
    return Column(name, actuator.column or name, role, dimension, unit)


def _force(name: str, actuator: Actuator, machine: Machine) -> Column:
    """The force of an actuator; a crank's is a torque."""
    dimension = "torque" if actuator.travel_dimension == ANGLE else "force"
    unit = machine.file_units.unit(_DIMENSIONS[dimension])
    if actuator.force is None:
        return Column(f"{name}.force", f"{name}.force", "force", dimension, unit.text)
    factor = actuator.force.scale
    scale = factor.number(machine.nominal_values())
    if factor.dimension != NUMBER:  # force per number of the column
        scale /= unit.scale
    header = actuator.force.column or f"{name}.force"
    return Column(f"{name}.force", header, "force", dimension, unit.text, scale)


def _dimension_of(direction: str) -> str:
    return "angle" if direction.startswith("r") else "length"


def _channels(machine: Machine) -> Iterator[Column]:
    """Channels of the sensors."""
    for c in channels_of(machine):
        if not c.column:  # measured once: it stands in the machine file
            continue
        unit = None if c.dimension == NUMBER else c.unit.definition
        yield Column(c.name, c.column, "channel", _NAMES[c.dimension], unit)


def _targets(machine: Machine, columns: Sequence[Column]) -> list[Column]:
    """Coordinates of the tool point by their plain names, but for headers that mean something else in poses too.

    A header may be that of a channel where the only sensor measures at another point.
    """
    apart = len(machine.sensors) == 1 and not channel_of_target(machine)
    taken = {column.header for column in columns if not (apart and column.role == "channel")}
    free = [name for name in coordinates_of(machine) if name not in taken]
    return [_column(machine, name, "target", _dimension_of(name)) for name in free]


def _sigmas(machine: Machine, columns: Sequence[Column]) -> Iterator[Column]:
    """`sigma.CHANNEL` and `sigma.ACTUATOR`, the latter as travel, like an actuator's `sigma`."""
    seen = set()
    for column in columns:
        if column.role in ("actuator", "channel") and column.name not in seen:
            seen.add(column.name)
            actuator = machine.actuators.get(column.name) if column.role == "actuator" else None
            dimension = column.dimension
            if actuator is not None:
                dimension = "angle" if actuator.travel_dimension == ANGLE else "length"
            yield _column(machine, f"sigma.{column.name}", "sigma", dimension)


def _covariates(machine: Machine) -> Iterator[Column]:
    yield _column(machine, "time", "covariate", "time")
    yield _column(machine, "T", "covariate", "temperature")
    yield _column(machine, "payload", "covariate", "mass")
    yield _column(machine, "replicate", "covariate", "none")
    for name in machine.actuators:
        yield _column(machine, f"dir.{name}", "covariate", "none")
