"""Sensors put into a structure: points that they see, numbers of their laws, channels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pkmcal_cli.compiler.numbers import constant_vector, is_zero, number, unit, vector
from pkmcal_cli.compiler.sockets import TOOL
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.language.channels import SensorChannel, channels_of, kind_of_sensor, stated_sigma
from pkmcal_cli.language.machine import Machine, Sensor, axis_vector
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.mechanism.connection_points import Number, Point, Port
from pkmcal_cli.mechanism.topology import GROUND, Index
from pkmcal_cli.model.model import Channel
from pkmcal_cli.model.observed import Given, PlacedSensor, View
from pkmcal_cli.sensors import WIDTHS, SensorKind, Sight

_UNKNOWN = -1


@dataclass
class SensorTable:
    """Views of the structure and sensors, collected while a machine is compiled."""

    structure: Structure
    views: list[View] = field(default_factory=list)
    sensors: list[PlacedSensor] = field(default_factory=list)
    direct: list[tuple[int, int]] = field(default_factory=list)  # channels that are views as they are
    ports: dict[tuple[str, str], tuple[int, Port]] = field(default_factory=dict)  # (sensor, point name) -> number

    def view(self, quantity: str, index: int, component: int = 0) -> int:
        """Number of a view."""
        wanted = View(quantity, index, component)  # type: ignore[arg-type]
        if wanted not in self.views:
            self.views.append(wanted)
        return self.views.index(wanted)

    def place_all(self, machine: Machine) -> None:
        """Points of all sensors, those that can be the TCP first; then their laws."""
        ordered = sorted(machine.sensors.items(), key=lambda item: not kind_of_sensor(item[1]).sees_tool)
        for name, sensor in ordered:
            kind = kind_of_sensor(sensor)
            for target in sensor.at:
                self._place(name, sensor, target, kind)
            if "other" in kind.sees and sensor.to is not None:
                point = self.structure.port(sensor.to)
                self.ports[name, sensor.to] = self.structure.builder.reading_point(f"{name}.to", point), point
        channels = channels_of(machine)
        for name, sensor in machine.sensors.items():
            mine = [(k, c) for k, c in enumerate(channels) if c.sensor == name]
            numbers = self._numbers(name, sensor)
            for target in sensor.at or ("",):
                self._add(name, sensor, target, [(k, c) for k, c in mine if c.target == target], numbers)

    def _place(self, name: str, sensor: Sensor, target: str, kind: SensorKind) -> None:
        """The point that a sensor sees, with its tool offset and a place for effects."""
        structure = self.structure
        orientation = any(c.startswith("r") for c in sensor.reads) or kind.turns
        offset_tool = not is_zero(sensor.offset)
        port = structure.port(target, turning=orientation or offset_tool)
        if offset_tool:
            port = Port(port.point + structure.builder.offset(port.rotation, vector(sensor.offset), f"{name}.offset"),
                        port.rotation)  # fmt: skip
        if structure.receptive and kind.sees_tool:
            known = structure.anchors.get((TOOL, name))
            if known is None:
                error = structure.anchored(TOOL, name, port.rotation, (0.0, 0.0, 0.0), f"{name}.error")
            else:  # several points of one sensor are off alike
                error = Point(((port.rotation, 1.0, known),))
            port = Port(port.point + error, port.rotation)
        self.ports[name, target] = structure.builder.reading_point(name, port), port

    def _numbers(self, name: str, sensor: Sensor) -> dict[Sight, Index]:
        """Slots of the numbers of a sensor's law."""
        kind, slot = kind_of_sensor(sensor), self.structure.builder.slot
        values: dict[Sight, Sequence[Number]] = {}
        if "zero" in kind.sees:
            values["zero"] = [number(sensor.zero)]
        if "zero" in kind.sees or sensor.scale is not None:
            values["scale"] = [number(sensor.scale, 1.0)]
        if "value" in kind.sees:
            values["value"] = [number(sensor.of)]
        if "basis" in kind.sees:
            values["basis"] = self._basis(sensor, self.ports[name, sensor.at[0]][1].rotation)
        out: dict[Sight, Index] = {
            sight: np.array([slot(v, f"{name}.{sight}") for v in numbers]) for sight, numbers in values.items()
        }
        if "frame" in kind.sees and sensor.on is not None:
            out["frame"] = self._frame(sensor.on)
        if "motion" in kind.sees and self.structure.receptive:
            out["motion"] = np.array([slot(0.0, f"{name}.motion") for _ in range(WIDTHS["motion"])])
        return out

    def _basis(self, sensor: Sensor, rotation: int) -> list[float]:
        """Where an angle begins and where it goes, at the drawing: of the body's x and y for z, and so on."""
        axis = unit(constant_vector(axis_vector(sensor.axis or "z", 3), self.structure.nominal))
        first = np.eye(3)[(int(np.argmax(np.abs(axis))) + 1) % 3]
        first = unit(first - (first @ axis) * axis)
        builder = self.structure.builder
        drawn = builder.filed.get(rotation, builder.rotations[rotation][2])
        return [*(drawn @ first), *(drawn @ np.cross(axis, first))]

    def _frame(self, name: str) -> Index:
        """Slots of a frame: origin and rotation vector."""
        builder, (point, rotation) = self.structure.builder, self.structure.frames[name]
        return np.array([*builder.offsets[point.offsets[0][2]], *builder.rotations[rotation][3]])

    def _add(
        self,
        name: str,
        sensor: Sensor,
        target: str,
        channels: list[tuple[int, SensorChannel]],
        numbers: dict[Sight, Index],
    ) -> None:
        kind = kind_of_sensor(sensor)
        point, port = self.ports.get((name, target), (_UNKNOWN, None))
        rotation = port.rotation if port is not None else _UNKNOWN
        given: dict[Sight, Given] = {}
        if "motion" in kind.sees and not numbers:
            self.direct += [(k, self._plain(c, point, rotation)) for k, c in channels]
        else:
            turning = kind.turns or any(c.quantity == "orientation" for _, c in channels)
            for sight in kind.sees:
                if (sight == "turn" and not turning) or (sight == "scale" and sight not in numbers):
                    continue
                slots = numbers.get(sight)
                given[sight] = (
                    Given(np.full(len(slots), -1), slots)
                    if slots is not None
                    else self._seen(sight, sensor, name, point, rotation)
                )
        where = np.array([k for k, _ in channels], dtype=np.intp)
        outputs = np.array([c.output for _, c in channels], dtype=np.intp)
        self.sensors.append(
            PlacedSensor(
                name=name, kind=kind, channels=where, outputs=outputs, given=given, point=point, rotation=rotation
            )
        )

    def _plain(self, channel: SensorChannel, point: int, rotation: int) -> int:
        if channel.quantity == "orientation":
            return self.view("orientation", rotation, channel.output - 3)
        return self.view("position", point, channel.output)

    def _seen(self, sight: Sight, sensor: Sensor, name: str, point: int, rotation: int) -> Given:
        """Views of what a law is given."""
        axes = 2 if self.structure.planar else 3
        views = np.full(WIDTHS[sight], -1)
        if sight == "force":
            views[0] = self.view("force", list(self.structure.machine.actuators).index(sensor.drive or ""))
        elif sight == "turn" and rotation != GROUND:
            for k in [2] if self.structure.planar else range(3):
                views[k] = self.view("orientation", rotation, k)
        elif sight in ("place", "other"):
            seen = self.ports[name, sensor.to][0] if sight == "other" and sensor.to is not None else point
            views[:axes] = [self.view("position", seen, k) for k in range(axes)]
        return Given(views, np.full(len(views), -1))

    @property
    def tcp(self) -> int:
        """Rotation of the TCP, that of the first sensor that sees it."""
        return next((s.rotation for s in self.sensors if s.kind.sees_tool), GROUND)

    def channels(self, machine: Machine) -> list[Channel]:
        """Channels of the sensors."""
        nominal, out = machine.nominal_values(), []
        by_channel = {int(k): s for s in self.sensors for k in s.channels}
        for k, c in enumerate(channels_of(machine)):
            sensor, placed = machine.sensors[c.sensor], by_channel[k]
            sigma = stated_sigma(sensor, c.direction)
            stated = sigma.number(nominal) if isinstance(sigma, Quantity) else math.nan
            growth = 0.0 if sensor.sigma_per_length is None else sensor.sigma_per_length.number(nominal)
            index = placed.rotation if c.quantity == "orientation" else placed.point
            component = max(c.output - 3, 0) if c.quantity == "orientation" else c.output
            once = sensor.reading.number(nominal) if sensor.reading is not None else math.nan
            out.append(
                Channel(
                    name=c.name,
                    quantity=c.quantity,
                    index=index,
                    component=component,
                    sigma=stated,
                    unit=c.unit.text,
                    dimension=c.dimension.name,
                    sigma_per_length=growth,
                    once=once,
                )
            )
        return out

    def correlated(self, machine: Machine) -> tuple[tuple[int, int, float], ...]:
        """Pairs of channels whose noise is correlated."""
        channels, nominal, out = channels_of(machine), machine.nominal_values(), []
        for placed in self.sensors:
            mine = {channels[k].direction: int(k) for k in placed.channels}
            for pair, share in machine.sensors[placed.name].correlation.items():
                first, second = pair.split("_")
                out.append((mine[first], mine[second], share.number(nominal)))
        return tuple(out)
