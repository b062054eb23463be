"""The dimension of a field where its siblings decide it: drives, sensors, and bare units there."""

from __future__ import annotations

from dataclasses import dataclass

from pkmcal_cli.language.dimensions import (
    ANGLE,
    FORCE,
    LENGTH,
    NUMBER,
    ROTATIONAL_STIFFNESS,
    STIFFNESS,
    TORQUE,
    Dimension,
)
from pkmcal_cli.language.instruments import Actuator
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Draft
from pkmcal_cli.language.unit_text import Unit, parse_unit
from pkmcal_cli.language.units import FileUnits
from pkmcal_cli.language.yaml_tree import Path

ORIENTATION = ("rx", "ry", "rz")


@dataclass(frozen=True)
class Wanted:
    """What a field wants: its dimensions (a bare number takes the first) and the bare unit."""

    dimensions: tuple[Dimension, ...]
    bare: Unit | None = None


def wanted(machine: Machine, path: Path, draft: Draft, units: FileUnits) -> Wanted:
    """The dimensions of the field at a path of the machine."""
    section = path[0]
    if section == "actuators" and isinstance(path[1], str):
        found = _of_actuator(machine.actuators[path[1]], str(path[2]), units)
        if found is not None:
            return found
    if section == "sensors" and path[2] == "sigma":
        return Wanted((_of_sigma(machine, path),))
    return Wanted(draft.measure.dimensions)


def _of_actuator(actuator: Actuator, field: str, units: FileUnits) -> Wanted | None:
    travel, reading = actuator.travel_dimension, actuator.reading_dimension
    reading_unit = parse_unit(actuator.unit) if actuator.unit else units.unit(reading)
    if field == "force":
        return Wanted((FORCE if travel == LENGTH else TORQUE,))
    if field == "stiffness":
        return Wanted((STIFFNESS if travel == LENGTH else ROTATIONAL_STIFFNESS,))
    if field == "limits":
        return Wanted((reading,), reading_unit)
    if field == "zero":
        return Wanted((travel,))
    if field in ("sigma", "period"):
        return Wanted((travel, reading))
    if field == "scale":
        return _of_scale(actuator, units, reading_unit)
    return None


def _of_scale(actuator: Actuator, units: FileUnits, reading: Unit) -> Wanted:
    """Travel per reading: a bare number is in file units of travel per unit of the reading."""
    travel = actuator.travel_dimension
    if actuator.radius is not None or travel == reading.dimension:
        return Wanted((NUMBER,))
    unit = units.unit(travel)
    factor, turns = unit.factor / reading.factor, unit.pi_power - reading.pi_power
    dimension = travel / reading.dimension
    return Wanted((dimension,), Unit(f"{unit.text}/{reading.text}", factor, dimension, turns))


def _of_sigma(machine: Machine, path: Path) -> Dimension:
    """Length or angle, by the channel; a single value by what the sensor reads."""
    channel = str(path[3]) if len(path) > 3 else ""
    if channel == "":
        reads = machine.sensors[str(path[1])].reads
        return ANGLE if all(each in ORIENTATION for each in reads) else LENGTH
    return ANGLE if channel in (*ORIENTATION, "orientation") else LENGTH
