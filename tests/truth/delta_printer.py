"""Linear delta printer as three spheres: the nozzle is where the rods' spheres about the carriages meet. SI units.

Carriage i: joint at radius `radius` and angle 210 deg + turn1, 330 deg + turn2, 90 deg, at height stop_i + q_i. The bed
is the plane z = 0; what is read is the nozzle's height.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from . import dimensions as dim
from .pinned import Array
from .pinned_machine import Parameters
from .self_measured import Sensing
from .spatial import spheres


class DeltaPrinter(Sensing):
    """Readings: `probe`, the nozzle's height."""

    name = "delta-printer"
    method = "closed form: intersection of three spheres"
    drives = ("q1", "q2", "q3")
    channels = ("probe",)
    nominal = dim.DELTA_PRINTER
    ranges = dim.DELTA_PRINTER_RANGES
    sigma = dim.DELTA_PRINTER_SIGMA
    units = dim.DELTA_PRINTER_UNITS

    def towers(self, p: Parameters) -> Array:
        """Places (3, 2) of the carriages' joints seen from above."""
        angles = np.add(dim.DELTA_PRINTER_TOWERS, (p["turn1"], p["turn2"], 0.0))
        out: Array = p["radius"] * np.stack([np.cos(angles), np.sin(angles)], 1)
        return out

    def stops(self, p: Parameters) -> Array:
        """Heights (3,) of the carriages' joints at reading 0."""
        return np.array([p["stop1"], p["stop2"], p["stop3"]])

    def places(self, q: ArrayLike, p: Parameters) -> Array:
        """Nozzle (N, 3) at drive readings (N, 3)."""
        towers, rods = self.towers(p), np.full(3, p["rod"])
        heights = np.atleast_2d(np.asarray(q, float)) + self.stops(p)
        return np.array([spheres(np.column_stack([towers, h]), rods, -1) for h in heights])

    def inverse(self, places: ArrayLike, parameters: Parameters | None = None) -> Array:
        """Drive readings (N, 3) that put the nozzle at places (N, 3)."""
        p = self.completed(parameters)
        goal = np.atleast_2d(np.asarray(places, float))
        level = goal[:, None, :2] - self.towers(p)
        out: Array = goal[:, 2:] + np.sqrt(p["rod"] ** 2 - (level**2).sum(2)) - self.stops(p)
        return out

    def read(self, q: ArrayLike, parameters: Parameters | None = None, partner: ArrayLike | None = None) -> Array:
        """Readings (N, 1) at drive readings (N, 3)."""
        return self.places(q, self.completed(parameters))[:, 2:]
