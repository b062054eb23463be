"""The dimension of a field where its siblings decide it: drives, sensors, and bare units there."""

from __future__ import annotations

from dataclasses import dataclass

from pkmcal_cli.language.channels import ORIENTATION, kind_of_sensor, measured_dimension, reading_unit
from pkmcal_cli.language.instruments import Actuator
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Draft
from pkmcal_cli.units.dimensions import (
    ANGLE,
    FORCE,
    LENGTH,
    NUMBER,
    ROTATIONAL_STIFFNESS,
    STIFFNESS,
    TORQUE,
    Dimension,
)
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.unit_text import Unit, parse_unit
from pkmcal_cli.yaml_source.tree import Path


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
    if section == "sensors":
        found = _of_sensor(machine, path, units)
        if found is not None:
            return found
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
    """Travel per reading."""
    if actuator.radius is not None:
        return Wanted((NUMBER,))
    return _per_reading(actuator.travel_dimension, reading, units)


def _per_reading(measured: Dimension, reading: Unit, units: FileUnits) -> Wanted:
    """What is measured per reading: a bare number is in file units of that per unit of the reading."""
    if measured == reading.dimension:
        return Wanted((NUMBER,))
    unit = units.unit(measured)
    factor, turns = unit.factor / reading.factor, unit.pi_power - reading.pi_power
    dimension = measured / reading.dimension
    return Wanted((dimension,), Unit(f"{unit.text}/{reading.text}", factor, dimension, turns))


def _of_sensor(machine: Machine, path: Path, units: FileUnits) -> Wanted | None:
    """Of a sensor's uncertainty, zero and scale; where it reads one number, in the unit of that."""
    sensor, field = machine.sensors[str(path[1])], str(path[2])
    if field not in ("sigma", "zero", "scale"):
        return None
    kind = kind_of_sensor(sensor)
    if kind.quantity in ("position", "orientation") and field == "sigma":
        channel = str(path[3]) if len(path) > 3 else ""
        every = tuple(sensor.reads) if channel == "" else (channel,)
        if not every:
            return None  # what it measures is not known: `reads` is missing, or its kind is misspelt
        turning = all(each in (*ORIENTATION, "orientation") for each in every)
        return Wanted((ANGLE if turning else LENGTH,))
    if kind.quantity == "bench":
        return None
    measured, reading = measured_dimension(machine, sensor), reading_unit(machine, sensor)
    if field == "sigma":
        return Wanted((reading.dimension,), reading)
    return Wanted((measured,)) if field == "zero" else _per_reading(measured, reading, units)
