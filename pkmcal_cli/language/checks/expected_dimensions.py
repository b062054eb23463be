"""The dimension of a field where its siblings decide it: drives, sensors, and bare units there."""

from __future__ import annotations

from dataclasses import dataclass

from pkmcal_cli.language.channels import ORIENTATION, kind_of_sensor, measured_dimension, reading_unit
from pkmcal_cli.language.instruments import Actuator
from pkmcal_cli.language.machine import WrittenMachine
from pkmcal_cli.language.quantities import Written, WrittenValue
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
class ExpectedDimension:
    """What a field wants: its dimensions (a bare number takes the first) and the bare unit."""

    dimensions: tuple[Dimension, ...]
    bare: Unit | None = None


def expected_dimension(
    machine: WrittenMachine, path: Path, written: WrittenValue, units: FileUnits
) -> ExpectedDimension:
    """The dimensions of the field at a path of the machine."""
    section = path[0]
    if section == "actuators" and isinstance(path[1], str):
        special = _of_actuator(machine.actuators[path[1]], str(path[2]), units)
        if special is not None:
            return special
    if section == "workspace" and path[1] == "drives":
        actuator = machine.actuators.get(str(path[2]))
        special = None if actuator is None else _of_actuator(actuator, "limits", units)
        if special is not None:
            return special
    if section == "sensors":
        special = _of_sensor(machine, path, units)
        if special is not None:
            return special
    return ExpectedDimension(written.measure.dimensions)


def _of_actuator(actuator: Actuator[Written], field: str, units: FileUnits) -> ExpectedDimension | None:
    travel, reading = actuator.travel_dimension, actuator.reading_dimension
    reading_unit = parse_unit(actuator.unit) if actuator.unit else units.unit(reading)
    if field in ("force", "force_limit"):
        return ExpectedDimension((FORCE if travel == LENGTH else TORQUE,))
    if field == "stiffness":
        return ExpectedDimension((STIFFNESS if travel == LENGTH else ROTATIONAL_STIFFNESS,))
    if field == "limits":
        return ExpectedDimension((reading,), reading_unit)
    if field == "zero":
        return ExpectedDimension((travel,))
    if field in ("sigma", "period"):
        return ExpectedDimension((travel, reading))
    if field == "scale":
        return _of_scale(actuator, units, reading_unit)
    return None


def _of_scale(actuator: Actuator[Written], units: FileUnits, reading: Unit) -> ExpectedDimension:
    """Travel per reading."""
    if actuator.radius is not None:
        return ExpectedDimension((NUMBER,))
    return _per_reading(actuator.travel_dimension, reading, units)


def _per_reading(measured: Dimension, reading: Unit, units: FileUnits) -> ExpectedDimension:
    """What is measured per reading: a bare number is in file units of that per unit of the reading."""
    if measured == reading.dimension:
        return ExpectedDimension((NUMBER,))
    unit = units.unit(measured)
    factor, pi_power = unit.factor / reading.factor, unit.pi_power - reading.pi_power
    dimension = measured / reading.dimension
    return ExpectedDimension((dimension,), Unit(f"{unit.text}/{reading.text}", factor, dimension, pi_power))


def _of_sensor(machine: WrittenMachine, path: Path, units: FileUnits) -> ExpectedDimension | None:
    """Of a sensor's uncertainty, reading, zero and scale; where it reads one number, in the unit of that."""
    sensor, field = machine.sensors[str(path[1])], str(path[2])
    if field not in ("sigma", "zero", "scale", "reading") or path[-1] == "per_length":
        return None
    kind = kind_of_sensor(sensor)
    if kind.reads_coordinates and field == "sigma":
        channel = str(path[3]) if len(path) > 3 else ""
        every = tuple(sensor.reads) if channel == "" else (channel,)
        if not every:
            return None  # what it measures is not known: `reads` is missing, or its kind is misspelt
        turning = all(each in (*ORIENTATION, "orientation") for each in every)
        return ExpectedDimension((ANGLE if turning else LENGTH,))
    if kind.measurand.once:
        return None
    measured, reading = measured_dimension(machine, sensor), reading_unit(machine, sensor)
    if field in ("sigma", "reading"):
        return ExpectedDimension((reading.dimension,), reading)
    return ExpectedDimension((measured,)) if field == "zero" else _per_reading(measured, reading, units)
