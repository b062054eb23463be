"""Warnings of numbers of a machine file that are far from what they may be, with the unit that may be meant."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.language.checks.magnitudes import unit_meant
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.units.dimensions import Dimension
from pkmcal_cli.units.unit_text import Unit, UnitError, parse_unit, parse_value
from pkmcal_cli.yaml_source.tree import Path

Band = tuple[float, float]


@dataclass(frozen=True)
class Number:
    """A quantity of the file, with the name of what it is and its place."""

    label: str
    path: Path
    quantity: Quantity


class Doubts:
    """Warnings of one machine."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.values = machine.nominal_values()

    def size(self, number: Number) -> float:
        """The magnitude at nominal, SI."""
        return abs(number.quantity.number(self.values))

    def outside(self, number: Number, band: Band, hint: str | None = None) -> Iterator[Fault]:
        """A warning where the number is outside, but for 0, which is none that was slipped."""
        value = self.size(number)
        if value and not band[0] <= value <= band[1]:
            yield self.of_number(number, band, hint)

    def of_number(self, number: Number, band: Band, hint: str | None = None) -> Fault:
        """The warning of a number where it is written."""
        path, unit, dimension = self._written_at(number), self.unit_of(number), number.quantity.dimension
        return self.of_value(number.label, path, self.size(number), dimension, band, unit=unit, hint=hint)

    def of_value(
        self, label: str, path: Path, value: float, dimension: Dimension, band: Band, *,
        unit: Unit | None = None, hint: str | None = None,
    ) -> Fault:  # fmt: skip
        """The warning: the number, the unit that would make it usual, and what is usual."""
        in_file = self.machine.file_units.unit(dimension)
        unit = unit or in_file
        likely = unit_meant(value / unit.scale, unit, band, dimension)
        message = f"{label} = {unit.format(value, 3)}"
        message += f": did you mean {value / unit.scale:g} {likely}?" if likely else " is far outside the usual range"
        low, high = (in_file.format(limit, 3) for limit in band)
        hint = hint or f"check the unit; typical: {f'{low} to {high}' if band[0] else f'up to {high}'}"
        return self.fault("magnitude", message, path, hint)

    def fault(self, code: str, message: str, path: Path, hint: str) -> Fault:
        """A warning at a path, or at the nearest one above it that the file has."""
        while path:
            try:
                self.machine.source[path]
            except (KeyError, IndexError, TypeError):
                path = path[:-1]
            else:
                break
        return self.machine.source.fault(code, message, path, hint, warning=True)

    def _written_at(self, number: Number) -> Path:
        """The place of a number: of the parameter that it is, else its own."""
        text = number.quantity.text.strip()
        return ("parameters", text, "nominal") if text in self.machine.parameters else number.path

    def unit_of(self, number: Number) -> Unit | None:
        """That which is written behind it, if any."""
        text = number.quantity.text.strip()
        try:
            if text in self.machine.parameters:
                return parse_unit(self.machine.parameters[text].unit)
            unit = parse_value(text)[1]
        except UnitError:
            return None
        return unit if unit.dimension == number.quantity.dimension else None


def numbers_of(path: Path, entity: Any, keys: tuple[str, ...]) -> Iterator[Number]:
    """Those keys of an entity that are set to numbers."""
    for key in keys:
        value = getattr(entity, key, None)
        for quantity in value if isinstance(value, tuple) else (value,):
            if isinstance(quantity, Quantity):
                yield Number(f"{key} of {path[-1]}", (*path, key), quantity)
