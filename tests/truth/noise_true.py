"""Noise of the instrument, and rows that went wrong."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .fast_pinned import Array

CORRELATION = 0.7
"""Of successive rows of "ar1"."""
GROSS = (8.0, 30.0)
"""Shift of a bad row over the stated noise."""


def unit_noise(kind: str, rows: int, channels: int, rng: np.random.Generator) -> Array:
    """Noise (rows, channels) of variance 1: "normal", "t4" or "ar1"."""
    if kind == "normal":
        return rng.normal(size=(rows, channels))
    if kind == "t4":
        return rng.standard_t(4, size=(rows, channels)) / np.sqrt(2)
    if kind != "ar1":
        raise ValueError(f"no noise {kind!r}")
    fresh = rng.normal(size=(rows, channels))
    drawn = fresh.copy()
    for n in range(1, rows):
        drawn[n] = CORRELATION * drawn[n - 1] + np.sqrt(1 - CORRELATION**2) * fresh[n]
    return drawn


def gross_shifts(share: float, sigma: Array, rows: int, rng: np.random.Generator) -> tuple[Array, NDArray[np.bool_]]:
    """Shifts (rows, C) in the unit of `sigma` (C,), 8 to 30 of it in a random direction, in a share of the rows (at
    least one where it is above 0), and which rows (rows,) have one."""
    bad = np.zeros(rows, bool)
    count = max(1, round(share * rows)) if share > 0 else 0
    bad[rng.choice(rows, size=count, replace=False)] = True
    direction = rng.normal(size=(rows, len(sigma)))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    size = rng.uniform(*GROSS, size=rows)
    return np.where(bad[:, None], size[:, None] * direction * sigma, 0.0), bad
