"""Limits of the drives, and how far values lie outside of limits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.parts import Actuator


def limit_excess(values: Array | float, limits: Array | tuple[float, float]) -> Array:
    """By how much values lie outside [low, high]; 0 inside, within rounding of a limit, and where unknown (nan)."""
    ends = np.asarray(limits)
    finite = ends[np.isfinite(ends)]
    slack = 1e-9 * float(np.abs(finite).max()) if finite.size else 0.0
    excess = np.maximum(ends[0] - values, values - ends[1])
    return np.where(excess > slack, excess, 0.0)


def drive_limits(actuators: Sequence[Actuator]) -> Array:
    """Lowest and highest readings of drives (A, 2), infinite where the machine file limits none."""
    return np.array([a.limits for a in actuators]).reshape(-1, 2)
