"""By how much drives run past a set value and back, so that they come to it from a side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.model import Model

_OVERRUN = 0.01  # of a drive's travel among the rows, and of its limits
LEAST = 1e-3  # m or rad: where it hardly travels, unless the machine is so small that this is far
_FAR = 0.1  # of the longest travel of the drives of its kind


def overruns(model: Model, readings: Array, drives: Sequence[int] | Index) -> Array:
    """Overruns (d,) of some drives at readings (N, A), m or rad."""
    travel = np.ptp(readings[:, drives], axis=0)
    chosen = [model.actuators[a] for a in drives]
    least = [min(LEAST, _OVERRUN * (a.limits[1] - a.limits[0])) for a in chosen]
    longest = [max(t for t, b in zip(travel, chosen, strict=True) if b.dimension == a.dimension) for a in chosen]
    least = [min(size, _FAR * most) if most > 0 else size for size, most in zip(least, longest, strict=True)]
    return np.asarray(np.maximum(_OVERRUN * travel, least))
