"""Readings of the bench that the rows of a table contradict, in words and for JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pkmcal_cli.base.errors import Location
from pkmcal_cli.calibration.bench_readings import BenchReading
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.number_format import readable, uncertain
from pkmcal_cli.units.unit_text import parse_unit


@dataclass(frozen=True)
class BenchText:
    """One such reading, of a sensor of a machine."""

    machine: Machine
    model: Model
    reading: BenchReading

    @property
    def name(self) -> str:
        """The sensor."""
        return self.model.channels[self.reading.channel].instrument

    @property
    def location(self) -> Location:
        """Where the reading stands in the machine file."""
        where = self.machine.source["sensors", self.name, "reading"]
        return Location(where.file or self.model.name, where.line)

    @property
    def text(self) -> str:
        """Which reading, what the rows tell instead, and by how much it is off."""
        r, unit = self.reading, parse_unit(self.model.channels[self.reading.channel].unit)
        instead = uncertain(unit.from_si(r.predicted), r.predicted_std / unit.scale, unit.text)
        read = f"{unit.from_si(r.reading):.9g}{'' if unit.text == '1' else f' {unit.text}'}"
        off = f"off by {readable(abs(r.off), unit)}, {abs(r.deviation):.3g} standard uncertainties"
        which = f"the bench reading of {self.name} ({self.location})"
        return f"{which} contradicts the table: {read} instead of {instead}, {off}"

    def json(self) -> dict[str, Any]:
        """The same for programs."""
        r, unit = self.reading, parse_unit(self.model.channels[self.reading.channel].unit)
        return {
            "name": self.name,
            "file": self.location.file,
            "line": self.location.line or None,
            "reading": unit.from_si(r.reading),
            "predicted": unit.from_si(r.predicted),
            "std": r.predicted_std / unit.scale,
            "off": r.off / unit.scale,
            "unit": unit.text,
            "deviation": r.deviation,
        }
