"""Curves of the undeclared effects: harmonics instead of polynomials, and the ripple of a rail between its bolts."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
from numpy.polynomial import Legendre
from numpy.polynomial.legendre import leggauss

from .fast_pinned import Array

TOP = 8
BASE_TURN = 0.6 * np.pi
"""Lowest harmonic in rad per half travel: a period of 3.3 half travels."""
BOLTS = 4.5
"""Waves of the ripple over the travel."""
RIPPLE = 0.18
"""rms of the ripple over the rms of the curve."""


def waves(u: Array) -> Array:
    """Harmonics (TOP + 1, N) at u (N,): 1, sin, cos, sin 2, cos 2, ..."""
    rows = [np.sin((k + 1) // 2 * BASE_TURN * u) if k % 2 else np.cos(k // 2 * BASE_TURN * u) for k in range(TOP + 1)]
    return np.array(rows)


@cache
def mixing() -> Array:
    """Weights (TOP + 1, TOP + 1) of the harmonics whose sum k has Legendre coefficient 1 of order k, and 0 of the
    others up to TOP."""
    nodes, weights = leggauss(80)
    legendre = np.array([(2 * k + 1) / 2 * Legendre.basis(k)(nodes) for k in range(TOP + 1)])
    inverse: Array = np.linalg.inv((legendre * weights) @ waves(nodes).T)
    return inverse.T


def curve(u: Array, orders: Mapping[int, float], extra: float = 1.0) -> Array:
    """Sum of harmonics (N,) over travel u in [-1, 1] with the given Legendre coefficients, plus a ripple of 18 % times
    `extra`. Linear in the coefficients; same unit."""
    basis = mixing() @ waves(u)
    total = np.zeros(np.shape(u))
    for k, value in orders.items():
        ripple = np.sqrt(2 / (2 * k + 1)) * RIPPLE * extra * np.sin(BOLTS * np.pi * u + k)
        total = total + value * (basis[k] + ripple)
    return total


def settling(u: Array, value: float, extra: float = 1.0) -> Array:
    """Exponential settling (N,) over time u in [-1, 1] with Legendre coefficient `value` of order 1, mean 0; with
    `extra` 1 the middle is reached after 43 % of the time, with 0 it is a straight line."""
    if extra == 0:
        return value * u
    rate = 0.8 * extra
    nodes, weights = leggauss(40)
    raw = -np.exp(-rate * nodes)
    slope = 1.5 * (weights * nodes * raw).sum()
    mean = (weights * raw).sum() / 2
    settled: Array = value * (-np.exp(-rate * u) - mean) / slope
    return settled


def normalised(values: Array, low: float, high: float) -> Array:
    """Travel in [-1, 1] for positions between `low` and `high`."""
    return 2 * (values - low) / (high - low) - 1
