"""How far the drives of a plan go, against their limits of travel."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.model import Model
from pkmcal_cli.units.unit_text import parse_unit


@dataclass
class Travels:
    """How far the drives go, block by block, against their limits of travel."""

    model: Model
    rows: int = 0
    outside: dict[int, int] = field(default_factory=dict)  # by number of the drive: positions outside
    worst: dict[int, float] = field(default_factory=dict)

    def add(self, readings: Array) -> None:
        """Count positions (N, A); unknown ones (nan) are inside."""
        self.rows += len(readings)
        for k, actuator in enumerate(self.model.actuators):
            excess = limit_excess(readings[:, k], actuator.limits)
            if (excess > 0).any():
                self.outside[k] = self.outside.get(k, 0) + int((excess > 0).sum())
                found = np.array([readings[excess.argmax(), k], self.worst.get(k, np.nan)])
                self.worst[k] = float(found[limit_excess(found, actuator.limits).argmax()])

    def warnings(self) -> list[str]:
        """One line for every drive that would leave its limits."""
        return [self._text(k, outside) for k, outside in self.outside.items()]

    def _text(self, k: int, outside: int) -> str:
        actuator = self.model.actuators[k]
        unit = parse_unit(actuator.unit)
        low, high, worst = (unit.format(v, 6) for v in (*actuator.limits, self.worst[k]))
        rows = f"{outside} of {count(self.rows, 'position')}"
        return f"warning: `{actuator.name}` would leave its limits ({low} to {high}) at {rows}, at worst {worst}"


def limit_excess(values: Array | float, limits: Array | tuple[float, float]) -> Array:
    """By how much values lie outside [low, high]; 0 inside, within rounding of a limit, and where unknown (nan)."""
    ends = np.asarray(limits)
    finite = ends[np.isfinite(ends)]
    slack = 1e-9 * float(np.abs(finite).max()) if finite.size else 0.0
    excess = np.maximum(ends[0] - values, values - ends[1])
    return np.where(excess > slack, excess, 0.0)
