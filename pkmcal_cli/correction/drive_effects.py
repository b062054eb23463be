"""What a drive's own effects do to its position: its backlash, scale and pitch belong in its own table.

Effects that depend on forces, temperatures or other circumstances are no function of its set value, and left out here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.effect_sites import PlacedEffect
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows, frozen
from pkmcal_cli.prediction.inputs import SiteInputs

_STEPS = 5  # of a fixed point: an effect is small beside the travel over which it changes


@dataclass(frozen=True)
class DriveEffects:
    """Effects of a machine at parameter values (P,) that depend on a drive's set value and side alone; rows: over which
    their shapes are spread."""

    machine: Model
    values: Array
    rows: Rows

    @cached_property
    def model(self) -> Model:
        """The machine, whatever rows are asked for."""
        return frozen(self.machine, self.rows)

    @cached_property
    def _placed(self) -> tuple[PlacedEffect, ...]:
        steady = (e for e in self.model.effects if not e.effect.reactive and not e.acts_in)
        return tuple(e for e in steady if e.effect.enters == "command" and {*e.effect.needs} <= {"direction"})

    @cached_property
    def _gains(self) -> Array:
        """Travel per reading of each drive (A,), with its sign."""
        coefficients = self.model.topology.coefficients.values(self.model.by_name(self.values))
        return np.asarray(coefficients[[a.gain_coefficient for a in self.model.actuators]])

    def corrections(self, set_values: Array, sides: Array) -> Array:
        """What these effects make of corrected set values (n, A) that come from some sides (n, A), SI of readings."""
        columns = {f"dir.{a.name}": sides[:, k] for k, a in enumerate(self.model.actuators)}
        rows, numbers = Rows(set_values, np.full(set_values.shape, np.nan), columns), self.model.by_name(self.values)
        out = np.zeros(set_values.shape)
        for e in self._placed:
            sizes = {n: numbers[p] for n, p in zip(e.numbers, e.parameters, strict=True)}
            for site in e.sites if any(sizes.values()) else ():
                out[:, site.actuator] -= e.effect.displacement(SiteInputs(site, self.model, rows, e, None), sizes)[:, 0]
        return out / self._gains

    def along(self, drive: int, commanded: Array, side: int) -> Array:
        """Corrections (n,) of one drive at commanded set values (n,)."""
        readings = np.zeros((len(commanded), len(self.model.actuators)))
        sides, out = np.full(readings.shape, float(side)), np.zeros(len(commanded))
        for _ in range(_STEPS):
            readings[:, drive] = commanded + out
            out = self.corrections(readings, sides)[:, drive]
        return out


def sided_by_force(model: Model) -> Index:
    """Drives whose reversal depends on their force, and so on the pose."""
    wound = (e for e in model.effects if "direction" in e.effect.needs and e.effect.reactive)
    return np.array(sorted({s.actuator for e in wound for s in e.sites}), dtype=np.intp)
