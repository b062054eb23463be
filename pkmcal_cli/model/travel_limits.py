"""How far the drives of a plan go, against their limits of travel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.limits import limit_excess
from pkmcal_cli.model.model import Model
from pkmcal_cli.units.unit_text import parse_unit


@dataclass
class TravelLimits:
    """How far the drives go, block by block, against their limits of travel."""

    model: Model
    rows: int = 0
    outside: dict[int, int] = field(default_factory=dict)  # by number of the drive: positions outside
    worst: dict[int, tuple[float, float, str]] = field(default_factory=dict)  # how far outside, reading, where it is

    def add(self, readings: Array, row_origin: Callable[[int], object]) -> None:
        """Count positions (N, A), of which `row_origin` tells where they come from; unknown ones (nan) are inside."""
        self.rows += len(readings)
        for k, actuator in enumerate(self.model.actuators):
            excess = limit_excess(readings[:, k], actuator.limits)
            if (excess > 0).any():
                self.outside[k] = self.outside.get(k, 0) + int((excess > 0).sum())
                row = int(excess.argmax())
                if k not in self.worst or excess[row] > self.worst[k][0]:
                    self.worst[k] = float(excess[row]), float(readings[row, k]), str(row_origin(row))

    def warnings(self) -> list[str]:
        """One line for every drive that would leave its limits."""
        return [self._text(k, outside) for k, outside in self.outside.items()]

    def _text(self, k: int, outside: int) -> str:
        actuator = self.model.actuators[k]
        unit = parse_unit(actuator.unit)
        _, reading, where = self.worst[k]
        low, high, worst = (unit.format(v, 6) for v in (*actuator.limits, reading))
        rows = f"{outside} of {count(self.rows, 'pose')}"
        return f"warning: `{actuator.name}` exceeds its limits ({low} to {high}) at {rows}; worst: {worst} at {where}"
