"""Sensors put into a structure: points that they see, numbers of their observation equations, channels."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pkmcal_cli.compiler.axes import LETTERS, carried, nominal_axis, triad_of
from pkmcal_cli.compiler.coefficient_values import is_zero, number, vector
from pkmcal_cli.compiler.instrument_sites import OTHER
from pkmcal_cli.compiler.site_coefficients import TOOL
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.equilibrium.readings import ObservedQuantity
from pkmcal_cli.language.channels import SensorChannel, channels_of, kind_of_sensor, stated_sigma
from pkmcal_cli.language.machine import Machine, Sensor
from pkmcal_cli.language.stated_sigma import StatedSigma
from pkmcal_cli.language.tool_point import tool_point_of
from pkmcal_cli.mechanism.connection_points import ConnectionPoint, Number, Point
from pkmcal_cli.mechanism.topology import GROUND, Index
from pkmcal_cli.model.observed import KnownValues, PlacedSensor
from pkmcal_cli.model.parts import Channel
from pkmcal_cli.sensors import WIDTHS, SensorKind, Variable
from pkmcal_cli.units.measurands import Measurand

_UNKNOWN = -1
_OF_EFFECTS: tuple[Variable, ...] = ("motion", "reading_error")
_OPTIONAL: tuple[Variable, ...] = ("scale", *_OF_EFFECTS)
"""Variables that effects set; those that an observation equation does without."""


@dataclass(frozen=True)
class PlacedPoint:
    """A point that is read: its number, its connection, the name of the sensor that sees it, or its own."""

    point: int
    at: ConnectionPoint
    name: str


@dataclass
class SensorTable:
    """Views of the structure and sensors, collected while a machine is compiled."""

    structure: Structure
    observed: list[ObservedQuantity] = field(default_factory=list)
    sensors: list[PlacedSensor] = field(default_factory=list)
    direct: list[tuple[int, int]] = field(default_factory=list)  # channels that are observed as they are
    connections: dict[tuple[str, str], tuple[int, ConnectionPoint]] = field(
        default_factory=dict
    )  # (sensor, point name) -> number

    def quantity(self, measurand: Measurand, index: int, component: int = 0) -> int:
        """Index of an observed quantity."""
        observed_quantity = ObservedQuantity(measurand, index, component)
        if observed_quantity not in self.observed:
            self.observed.append(observed_quantity)
        return self.observed.index(observed_quantity)

    def place_all(self, machine: Machine) -> None:
        """Points of all sensors; then their observation equations."""
        for name, sensor in machine.sensors.items():
            kind = kind_of_sensor(sensor)
            for target in sensor.at:
                self._place(name, sensor, target, kind)
            if "other" in kind.variables and sensor.to is not None:
                point = self._other(name, sensor.to, kind)
                self.connections[name, sensor.to] = self.structure.builder.reading_point(point), point
        channels = channels_of(machine)
        for name, sensor in machine.sensors.items():
            of_sensor = [(k, c) for k, c in enumerate(channels) if c.sensor == name]
            numbers = self._numbers(name, sensor)
            for target in sensor.at or ("",):
                self._add(name, sensor, target, [(k, c) for k, c in of_sensor if c.target == target], numbers)

    def _other(self, name: str, target: str, kind: SensorKind) -> ConnectionPoint:
        """The other end of a distance or line; that of a distance with a place for effects."""
        point = self.structure.connection(target)
        if not self.structure.receptive or kind.rotates:
            return point
        error = self.structure.anchored(OTHER, name, point.rotation, (0.0, 0.0, 0.0), f"{name}.to.error")
        return ConnectionPoint(point.point + error, point.rotation)

    def _place(self, name: str, sensor: Sensor, target: str, kind: SensorKind) -> None:
        """The point that a sensor sees, with its tool offset and a place for effects."""
        structure = self.structure
        orientation = any(c.startswith("r") for c in sensor.reads) or kind.rotates
        offset_tool = not is_zero(sensor.offset)
        connection = structure.connection(target, rotating=orientation or offset_tool)
        if offset_tool:
            connection = ConnectionPoint(connection.point + structure.builder.offset(connection.rotation,
            vector(sensor.offset), f"{name}.offset"),
                        connection.rotation)  # fmt: skip
        if structure.receptive and kind.sees_tool:
            known = structure.anchors.get((TOOL, name))
            if known is None:
                error = structure.anchored(TOOL, name, connection.rotation, (0.0, 0.0, 0.0), f"{name}.error")
            else:  # several points of one sensor are off alike
                error = Point(((connection.rotation, 1.0, known),))
            connection = ConnectionPoint(connection.point + error, connection.rotation)
        self.connections[name, target] = structure.builder.reading_point(connection), connection

    def _numbers(self, name: str, sensor: Sensor) -> dict[Variable, Index]:
        """Coefficients of the numbers of a sensor's observation equation."""
        kind, coefficient = kind_of_sensor(sensor), self.structure.builder.coefficient
        values: dict[Variable, Sequence[Number]] = {}
        if "zero" in kind.variables:
            values["zero"] = [number(sensor.zero)]
        if "zero" in kind.variables or sensor.scale is not None:
            values["scale"] = [number(sensor.scale, 1.0)]
        if "value" in kind.variables:
            values["value"] = [number(sensor.of)]
        if "basis" in kind.variables:
            values["basis"] = self._basis(sensor, self.connections[name, sensor.at[0]][1].rotation)
        out: dict[Variable, Index] = {
            variable: np.array([coefficient(v, f"{name}.{variable}") for v in numbers])
            for variable, numbers in values.items()
        }
        if "frame" in kind.variables and sensor.surface is not None:
            out["frame"] = self._frame(sensor.surface)
        for variable in _OF_EFFECTS:
            if variable in kind.variables and self.structure.receptive:
                out[variable] = np.array([coefficient(0.0, f"{name}.{variable}") for _ in range(WIDTHS[variable])])
        return out

    def _basis(self, sensor: Sensor, rotation: int) -> list[Number]:
        """Where an angle begins and where it goes as filed: the body's x and y for an angle about z, and so on."""
        axis, nominal = sensor.axis or "z", self.structure.nominal
        largest = int(np.argmax(np.abs(nominal_axis(axis, nominal))))
        _, first, second = triad_of(axis, LETTERS[(largest + 1) % 3], nominal)
        builder = self.structure.builder
        reference = builder.filed.get(rotation, builder.rotations[rotation][2])
        return [*carried(first, reference), *carried(second, reference)]

    def _frame(self, name: str) -> Index:
        """Coefficients of a frame: origin and rotation vector."""
        builder, (point, rotation) = self.structure.builder, self.structure.rails.frame(name)
        return np.array([*builder.offsets[point.offsets[0][2]], *builder.rotations[rotation][3]])

    def _add(
        self,
        name: str,
        sensor: Sensor,
        target: str,
        channels: list[tuple[int, SensorChannel]],
        numbers: dict[Variable, Index],
    ) -> None:
        kind = kind_of_sensor(sensor)
        point, connection = self.connections.get((name, target), (_UNKNOWN, None))
        rotation = connection.rotation if connection is not None else _UNKNOWN
        known: dict[Variable, KnownValues] = {}
        rotations = sum(c.measurand is Measurand.ORIENTATION for _, c in channels)
        in_part = not self.structure.planar and rotations in (1, 2)  # which way round, the whole rotation tells
        if kind.reads_coordinates and not numbers and not in_part:
            self.direct += [(k, self._plain(c, point, rotation)) for k, c in channels]
        else:
            rotating = kind.rotates or rotations > 0
            for variable in kind.variables:
                if (variable == "rotation" and not rotating) or (variable in _OPTIONAL and variable not in numbers):
                    continue
                coefficients = numbers.get(variable)
                known[variable] = (
                    KnownValues(np.full(len(coefficients), -1), coefficients)
                    if coefficients is not None
                    else self._seen(variable, sensor, name, point, rotation)
                )
        where = np.array([k for k, _ in channels], dtype=np.intp)
        outputs = np.array([c.output for _, c in channels], dtype=np.intp)
        self.sensors.append(
            PlacedSensor(
                name=name, kind=kind, channels=where, outputs=outputs, known=known, point=point, rotation=rotation
            )
        )

    def _plain(self, channel: SensorChannel, point: int, rotation: int) -> int:
        if channel.measurand is Measurand.ORIENTATION:
            return self.quantity(Measurand.ORIENTATION, rotation, channel.output - 3)
        return self.quantity(Measurand.POSITION, point, channel.output)

    def _seen(self, variable: Variable, sensor: Sensor, name: str, point: int, rotation: int) -> KnownValues:
        """Observed quantities that a variable of the observation equation stands for."""
        axes = 2 if self.structure.planar else 3
        observed = np.full(WIDTHS[variable], -1)
        if variable == "force":
            observed[0] = self.quantity(
                Measurand.FORCE, list(self.structure.machine.actuators).index(sensor.drive or "")
            )
        elif variable == "rotation" and rotation != GROUND:
            for k in [2] if self.structure.planar else range(3):
                observed[k] = self.quantity(Measurand.ORIENTATION, rotation, k)
        elif variable in ("place", "other"):
            seen = self.connections[name, sensor.to][0] if variable == "other" and sensor.to is not None else point
            observed[:axes] = [self.quantity(Measurand.POSITION, seen, k) for k in range(axes)]
        return KnownValues(observed, np.full(len(observed), -1))

    def measured(self, machine: Machine) -> PlacedPoint | None:
        """Where the first `tcp` sensor measures."""
        first = next(((n, s.at[0]) for n, s in machine.sensors.items() if s.kind == "tcp"), None)
        return None if first is None else PlacedPoint(*self.connections[first], name=first[0])

    def tool(self, machine: Machine) -> PlacedPoint:
        """The tool point; in a machine without one, what its first sensor sees, or its last node or body."""
        tool = tool_point_of(machine)
        sees = ((n, s.at[0]) for n, s in machine.sensors.items() if kind_of_sensor(s).sees_tool)
        seen = (tool.sensor, tool.name) if tool is not None else next(sees, None)
        if seen in self.connections:
            return PlacedPoint(*self.connections[seen], name=seen[0])
        name = seen[1] if seen is not None else [*machine.bodies, *machine.nodes][-1]
        connection = self.structure.connection(name)
        return PlacedPoint(self.structure.builder.reading_point(connection), connection, name)

    def channels(self, machine: Machine) -> list[Channel]:
        """Channels of the sensors."""
        nominal, out = machine.nominal_values(), []
        by_channel = {int(k): s for s in self.sensors for k in s.channels}
        for k, c in enumerate(channels_of(machine)):
            sensor, placed = machine.sensors[c.sensor], by_channel[k]
            sigma = stated_sigma(sensor, c.direction)
            stated, slope = (math.nan, 0.0) if sigma is None else _sigma(sigma, nominal)
            growth = 0.0 if sensor.sigma_per_length is None else sensor.sigma_per_length.number(nominal)
            index = placed.rotation if c.measurand is Measurand.ORIENTATION else placed.point
            component = max(c.output - 3, 0) if c.measurand is Measurand.ORIENTATION else c.output
            reading = sensor.reading.number(nominal) if sensor.reading is not None else math.nan
            if c.measurand.once:  # its length is known
                stated, slope = stated + slope * abs(reading), 0.0
            out.append(
                Channel(
                    name=c.name,
                    measurand=c.measurand,
                    index=index,
                    component=component,
                    sigma=stated,
                    unit=c.unit.definition,
                    dimension=c.dimension.name,
                    sigma_slope=slope,
                    sigma_per_length=growth,
                    once=reading if c.measurand.once else math.nan,
                    known=math.nan if c.measurand.once else reading,
                    instrument=c.sensor,
                    sigma_is=sensor.sigma_is,
                )
            )
        return out

    def correlated(self, machine: Machine) -> tuple[tuple[int, int, float], ...]:
        """Pairs of channels whose noise is correlated."""
        channels, nominal, out = channels_of(machine), machine.nominal_values(), []
        for placed in self.sensors:
            by_direction = {channels[k].direction: int(k) for k in placed.channels}
            for pair, share in machine.sensors[placed.name].correlation.items():
                first, second = pair.split("_")
                out.append((by_direction[first], by_direction[second], share.number(nominal)))
        return tuple(out)


def _sigma(stated: StatedSigma, nominal: Mapping[str, float]) -> tuple[float, float]:
    """A standard uncertainty at length 0, SI, and its growth."""
    slope = 0.0 if stated.per_length is None else stated.per_length.number(nominal)
    return stated.constant.number(nominal), slope
