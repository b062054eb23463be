"""The channels of a machine's sensors: names, columns, what they are and their units, in one place for all who ask."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from pkmcal_cli.language.instruments import Actuator
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Quantity, V
from pkmcal_cli.language.sensing import Sensor
from pkmcal_cli.language.stated_sigma import StatedSigma
from pkmcal_cli.sensors import SensorKind, sensor_kinds
from pkmcal_cli.units.dimensions import ANGLE, FORCE, LENGTH, TORQUE, Dimension
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.units.unit_text import Unit, parse_unit

ORIENTATION: Final = ("rx", "ry", "rz")


@dataclass(frozen=True, kw_only=True)
class SensorChannel:
    """One number that a sensor reads.

    target: the point; output: which of the kind's readings; column: its header, "" for what stands in the machine file.
    """

    name: str
    column: str
    sensor: str
    target: str
    direction: str
    output: int
    measurand: Measurand
    unit: Unit

    @property
    def dimension(self) -> Dimension:
        """Of its reading."""
        return self.unit.dimension


def kind_of_sensor(sensor: Sensor[Any]) -> SensorKind:
    """The kind of a sensor of the machine file."""
    return sensor_kinds()[sensor.kind]


def measured_dimension(machine: Machine[Any, Any], sensor: Sensor[Any]) -> Dimension:
    """Of what a sensor with one reading measures, before zero and scale."""
    kind = kind_of_sensor(sensor)
    if kind.measurand is Measurand.FORCE:
        drive: Actuator[Any] | None = machine.actuators.get(sensor.drive or "")
        return TORQUE if drive is not None and drive.travel_dimension == ANGLE else FORCE
    if sensor.of is not None:
        return sensor.of.dimension if isinstance(sensor.of, Quantity) else LENGTH
    return kind.measurand.dimension or LENGTH


def reading_unit(machine: Machine[Any, Any], sensor: Sensor[Any]) -> Unit:
    """Of the numbers that a sensor with one reading gives."""
    if sensor.unit is not None:
        return parse_unit(sensor.unit)
    return machine.file_units.unit(measured_dimension(machine, sensor))


def directions_read(sensor: Sensor[Any], planar: bool) -> tuple[str, ...]:
    """Names of what a sensor reads, among its kind's channels."""
    kind = kind_of_sensor(sensor)
    if "reads" not in (*kind.needs, *kind.may):
        return kind.channels[:1]
    known = tuple(d for d in sensor.reads if d in kind.channels)
    normal = kind.normal[planar]
    return known or ((normal,) if normal and not sensor.reads else ())


def channels_of(machine: Machine[Any, Any]) -> tuple[SensorChannel, ...]:
    """Channels of all sensors, in the order of the machine file."""
    one = sum(not kind_of_sensor(s).measurand.once for s in machine.sensors.values()) == 1  # a bench has no columns
    return tuple(c for name, sensor in machine.sensors.items() for c in _channels(machine, name, sensor, one))


def _channels(machine: Machine[Any, Any], name: str, sensor: Sensor[Any], one: bool) -> Iterator[SensorChannel]:
    kind = kind_of_sensor(sensor)
    read = directions_read(sensor, machine.space == "planar")
    if len(read) == 1 and not kind.reads_coordinates:
        column = "" if kind.measurand.once else sensor.column or next(iter(sensor.reads.values()), "") or name
        output = kind.channels.index(read[0])
        yield SensorChannel(
            name=name,
            column=column,
            sensor=name,
            target=_first(sensor),
            direction="",
            output=output,
            measurand=kind.measurand,
            unit=reading_unit(machine, sensor),
        )
        return
    for target in sensor.at:
        point = f"{target}." if len(sensor.at) > 1 else ""
        for direction in read:
            default = ("" if one else f"{name}.") + point + direction
            header = sensor.reads.get(direction, "")  # type: ignore[call-overload]
            column = point + header if header else default
            turning = direction in ORIENTATION
            unit = machine.file_units.angle if turning else reading_unit(machine, sensor)
            measurand = Measurand.ORIENTATION if turning else kind.measurand
            yield SensorChannel(
                name=default,
                column=column,
                sensor=name,
                target=target,
                direction=direction,
                output=kind.channels.index(direction),
                measurand=measurand,
                unit=unit,
            )


def _first(sensor: Sensor[Any]) -> str:
    return sensor.at[0] if sensor.at else ""


def stated_sigma(sensor: Sensor[V], direction: str) -> StatedSigma[V] | None:
    """The stated uncertainty of a channel: its own, that of its kind, or that of all; None without."""
    kind = "orientation" if direction in ORIENTATION else "position"
    return next((s for key in (direction, kind, "") if (s := sensor.sigma.get(key)) is not None), None)
