"""Probes whose reading is known wherever they touch: in which rows of a table they do.

The column of such a probe says it: cells with a reading touch, empty cells do not. A table without it is a table of
touches if it has no column of any other sensor that sees the tool: the machine was moved until the probe touched.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from pkmcal_cli.base.plural import count
from pkmcal_cli.language.channels import channels_of, kind_of_sensor
from pkmcal_cli.language.machine import Machine


@dataclass(frozen=True)
class Touches:
    """What a table without a column of a probe says of it: channels with their readings (SI) that hold in every row.

    unclear: probes of which one must have touched, but no column says which.
    """

    readings: dict[str, float]
    sensor: str = ""
    unclear: tuple[str, ...] = ()

    def note(self, machine: Machine, rows: int) -> str:
        """What is to be announced; "" where nothing is."""
        if not self.readings:
            return ""
        reading = machine.sensors[self.sensor].reading
        text = "" if reading is None else reading.text
        hint = "give it, with empty cells, if there are rows without a touch"
        return f"no column `{self.sensor}`: it touches (reading {text}) in all {count(rows, 'row')}; {hint}"


def implied_touches(machine: Machine, columns: Collection[str], measured: bool) -> Touches:
    """The touches of a table with columns of these channels; `measured`: of measurements, else of poses only.

    A table of poses has no columns of instruments: other instruments that the machine has may be meant.
    """
    touching = known_readings(machine)
    none = Touches({})
    if not touching:
        return none
    tool = {c.name: c.sensor for c in channels_of(machine) if kind_of_sensor(machine.sensors[c.sensor]).sees_tool}
    others = set(tool.values()) - touching.keys()
    stated = {tool[name] for name in columns if name in tool}
    if stated or (others and not measured):
        return none
    if len(touching) > 1:
        return Touches({}, unclear=tuple(touching))
    ((sensor, reading),) = touching.items()
    return Touches({name: reading for name, owner in tool.items() if owner == sensor}, sensor)


def known_readings(machine: Machine) -> dict[str, float]:
    """Sensors whose reading is known wherever they touch, and the reading, SI."""
    nominal = machine.nominal_values()
    return {
        name: sensor.reading.number(nominal)
        for name, sensor in machine.sensors.items()
        if sensor.reading is not None and not kind_of_sensor(sensor).measurand.once
    }


def unclear_touches(names: Collection[str]) -> tuple[str, str]:
    """What is wrong where no column says which probe touched, and the remedy."""
    listed = ", ".join(f"`{name}`" for name in names)
    message = f"nothing says which of {listed} touches in a row"
    return message, "add a column for each: its reading in rows where it touches, empty elsewhere"
