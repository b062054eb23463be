"""Where a machine may be sent: limits of the tool point's coordinates and of drive readings, in SI."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array, dot
from pkmcal_cli.model.limits import limit_excess


@dataclass(frozen=True)
class Cylinder:
    """Points p with |(p - base) x axis| <= radius and 0 <= (p - base) . axis <= height (infinite: no limit)."""

    base: Array  # (3,) m
    axis: Array  # (3,) unit vector
    radius: float
    height: float

    def holds(self, places: Array) -> NDArray[np.bool_]:
        """Which places (N, 3) lie in it, its surface included."""
        apart = places - self.base
        along = dot(apart, self.axis)
        across = apart - along[:, None] * self.axis
        inside = limit_excess(np.sqrt(dot(across, across)), (-np.inf, self.radius)) == 0
        if np.isfinite(self.height):
            inside &= limit_excess(along, (0.0, self.height)) == 0
        return np.asarray(inside & np.isfinite(along))

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates (3,); infinite along an axis without limit."""
        wide = self.radius * np.sqrt(np.maximum(1 - self.axis**2, 0.0))
        if np.isfinite(self.height):
            tip = self.base + self.height * self.axis
            return np.minimum(self.base, tip) - wide, np.maximum(self.base, tip) + wide
        far = np.where(np.abs(self.axis) > 1e-12, np.inf, wide)
        return self.base - far, self.base + far


@dataclass(frozen=True)
class Workspace:
    """Limits that hold together: of coordinates (6,), a cylinder or None, of drive readings (A, 2)."""

    low: Array
    high: Array
    cylinder: Cylinder | None
    drives: Array

    def holds(self, poses: Array, readings: Array) -> NDArray[np.bool_]:
        """Which poses (N, 6) at readings (N, A) lie in it, their limits included; none that is not known."""
        inside = np.isfinite(poses).all(axis=1) & np.isfinite(readings).all(axis=1)
        for values, limits in ((poses, np.stack([self.low, self.high], axis=1)), (readings, self.drives)):
            for k, (low, high) in enumerate(limits):
                inside &= limit_excess(values[:, k], (low, high)) == 0
        if self.cylinder is not None:
            inside &= self.cylinder.holds(poses[:, :3])
        return np.asarray(inside)

    @classmethod
    def of_drives(cls, limits: Array) -> Workspace:
        """All that limits (A, 2) of drive readings leave."""
        far = np.full(6, np.inf)
        return cls(-far, far, None, limits)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates (6,) that box and cylinder allow."""
        low, high = self.low.copy(), self.high.copy()
        if self.cylinder is not None:
            lowest, highest = self.cylinder.bounds
            low[:3], high[:3] = np.maximum(low[:3], lowest), np.minimum(high[:3], highest)
        return low, high
