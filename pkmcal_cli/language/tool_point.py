"""The tool point: the point, and its body, that poses, grids, sensitivity and error maps mean."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pkmcal_cli.language.channels import kind_of_sensor
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.language.sensing import Sensor

REMEDY = "add `tool_point: NAME`, the name of a node, a body or a point of a body"


@dataclass(frozen=True)
class ToolPoint:
    """`name`: node, body or point of a body; `sensor`: the first one that sees just this point, "" where none does.

    beside: the first one that sees a point at an offset from it, where the tool point is declared; "" where none does.
    """

    name: str
    sensor: str
    beside: str = ""

    @property
    def text(self) -> str:
        """For people."""
        if self.sensor:
            return f"tool point: {self.name}, of sensor {self.sensor}"
        return f"tool point: {self.name}" + (f", without the `offset` of sensor {self.beside}" if self.beside else "")


def tool_point_of(machine: Machine[Any, Any]) -> ToolPoint | None:
    """The declared one, else that of the first `tcp` sensor; None without either."""
    if machine.tool_point is not None:
        there = {n: s for n, s in machine.sensors.items() if machine.tool_point in s.at and kind_of_sensor(s).sees_tool}
        seen = [name for name, sensor in there.items() if _sees_point(sensor)]
        beside = [name for name in there if name not in seen]
        return ToolPoint(machine.tool_point, seen[0] if seen else "", beside[0] if beside else "")
    first = next((name for name, sensor in machine.sensors.items() if sensor.kind == "tcp"), None)
    return None if first is None else ToolPoint(machine.sensors[first].at[0], first)


def _sees_point(sensor: Sensor[Any]) -> bool:
    """Whether a sensor sees the point that it names, not one at an offset from it."""
    return not any(_apart(value) for value in sensor.offset)


def _apart(value: object) -> bool:
    return isinstance(value, Quantity) and bool(value.names or value.number({}))
