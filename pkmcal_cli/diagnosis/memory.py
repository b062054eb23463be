"""Noise with a memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Memory:
    """Noise of which successive rows, in this order (N,), are correlated: x <- (x - rho x before) / sqrt(1 - rho^2)."""

    order: NDArray[np.intp]
    correlation: float
    measured: NDArray[np.bool_]  # (N, C); a value after one that is missing stays as it is
