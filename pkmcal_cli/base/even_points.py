"""Points that fill a cube evenly, always the same."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array


def even_points(count: int, width: int, first: int = 1) -> Array:
    """Points (count, width) in [0, 1), numbers `first` and following: additive recurrence by powers of the generalised
    golden ratio (Roberts 2018), any run of which fills the cube evenly."""
    root = 2.0
    for _ in range(60):
        root = (1.0 + root) ** (1.0 / (width + 1))
    powers = root ** -np.arange(1.0, width + 1)
    return np.asarray((0.5 + np.arange(first, first + count)[:, None] * powers) % 1.0)
