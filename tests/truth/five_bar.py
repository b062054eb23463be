"""Five-bar linkage as circles: the tip is where the rods' circles about the cranks' ends meet. SI units.

Crank i turns about O1 = (0, 0), O2 = (base, 0), in the direction zero_i + q_i. An elbow's encoder reads the direction
of the rod against the crank, less elbow_i; the ballbar reads the distance of the tip from the ball.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from . import dimensions as dim
from .pinned import Array
from .pinned_machine import Parameters
from .planar import circles
from .self_measured import Sensing


class FiveBar(Sensing):
    """Readings: `ballbar`, `encoder1`, `encoder2`. Elbow 1 is on the left of its rod, elbow 2 on the right."""

    name = "five-bar"
    method = "closed form: intersections of circles"
    drives = ("q1", "q2")
    channels = ("ballbar", "encoder1", "encoder2")
    nominal = dim.FIVE_BAR
    ranges = dim.FIVE_BAR_RANGES
    sigma = dim.FIVE_BAR_SIGMA
    units = dim.FIVE_BAR_UNITS

    def elbows(self, q: Array, p: Parameters) -> tuple[Array, Array]:
        """Directions (2,) of the cranks, and their ends (2, 2)."""
        angles = np.array([p["zero1"], p["zero2"]]) + q
        feet = np.array([[0.0, 0.0], [p["base"], 0.0]])
        lengths = np.array([[p["crank1"]], [p["crank2"]]])
        return angles, feet + lengths * np.stack([np.cos(angles), np.sin(angles)], 1)

    def inverse(self, places: ArrayLike, parameters: Parameters | None = None) -> Array:
        """Drive readings (N, 2) that put the tip at places (N, 2)."""
        p = self.completed(parameters)
        out = []
        for tip in np.atleast_2d(np.asarray(places, float)):
            left = circles(np.zeros(2), tip, p["crank1"], p["rod1"], +1)
            foot = np.array([p["base"], 0.0])
            right = circles(foot, tip, p["crank2"], p["rod2"], -1) - foot
            out.append([np.arctan2(*left[::-1]) - p["zero1"], np.arctan2(*right[::-1]) - p["zero2"]])
        return np.array(out)

    def read(self, q: ArrayLike, parameters: Parameters | None = None, partner: ArrayLike | None = None) -> Array:
        """Readings (N, 3) at drive readings (N, 2)."""
        p, out = self.completed(parameters), []
        ball = np.array([p["ballx"], p["bally"]])
        for row in np.atleast_2d(np.asarray(q, float)):
            angles, ends = self.elbows(row, p)
            tip = circles(ends[0], ends[1], p["rod1"], p["rod2"], +1)
            rods = tip - ends
            bent = np.arctan2(rods[:, 1], rods[:, 0]) - angles
            bent -= 2 * np.pi * np.round(bent / (2 * np.pi))
            out.append([np.hypot(*(tip - ball)), *(bent - [p["elbow1"], p["elbow2"]])])
        return np.array(out)
