"""Acceptance figures from measured repeats: of an axis (ISO 230-2), of a circle (ISO 230-4), of a pose (ISO 9283)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from pkmcal_cli.base.rotation import Array

FEWEST_APPROACHES = 5
"""From each side of each target, ISO 230-2."""
FEWEST_TARGETS = 5
"""Of an axis, ISO 230-2."""
FEWEST_CYCLES = 30
"""Of a pose, ISO 9283."""


@dataclass(frozen=True, kw_only=True)
class AxisAccuracy:
    """Figures of an axis by ISO 230-2:2014, m: accuracy A, repeatability R, systematic error E, its mean M, reversal B.

    `forward` and `backward`: A, R, E of one side of approach; targets (m,), m, with means (m, 2) and standard
    deviations (m, 2) of the deviations by side.
    """

    targets: Array
    means: Array
    spreads: Array
    approaches: int
    A: float
    R: float
    E: float
    M: float
    B: float
    forward: tuple[float, float, float]
    backward: tuple[float, float, float]


def axis_accuracy(targets: Array, deviations: tuple[tuple[Array, Array], ...]) -> AxisAccuracy:
    """Of targets (m,), m, and for each the deviations (n,) measured - commanded, m, from below and from above.

    ISO 230-2:2014, 3.7 to 3.21. Raises ValueError where a side of a target has too few approaches, or targets are few.
    """
    sizes = [len(side) for pair in deviations for side in pair]
    if len(targets) < FEWEST_TARGETS or min(sizes, default=0) < FEWEST_APPROACHES:
        raise ValueError("too few targets or approaches")
    mean = np.array([[side.mean() for side in pair] for pair in deviations])  # (m, 2)
    s = np.array([[side.std(ddof=1) for side in pair] for pair in deviations])
    reversal = mean[:, 0] - mean[:, 1]
    both = np.maximum(2 * s.sum(axis=1) + np.abs(reversal), 4 * s.max(axis=1))
    upper, lower, middle = mean + 2 * s, mean - 2 * s, mean.mean(axis=1)
    one_way = [
        (float(np.ptp([upper[:, k].max(), lower[:, k].min()])), float(4 * s[:, k].max()), float(np.ptp(mean[:, k])))
        for k in (0, 1)
    ]
    return AxisAccuracy(
        targets=targets,
        means=mean,
        spreads=s,
        approaches=min(sizes),
        A=float(upper.max() - lower.min()),
        R=float(both.max()),
        E=float(np.ptp(mean)),
        M=float(np.ptp(middle)),
        B=float(np.abs(reversal).max()),
        forward=one_way[0],
        backward=one_way[1],
    )


@dataclass(frozen=True)
class CircleDeviation:
    """Radius (m) and circular deviation (G) of a path, m: the range of its radii about the centre of least squares.

    `largest` and `smallest`: radial deviation from the nominal path about that centre, m.
    """

    radius: float
    circular: float
    largest: float
    smallest: float


def circle_deviation(path: Array, nominal_radius: float) -> CircleDeviation:
    """Of points (n, 2), m, of a measured path (ISO 230-4:2022, 3.4 and 3.6, centred by least squares)."""
    middle = path.mean(axis=0)
    scaled = (path - middle) / nominal_radius

    def off(centre: Array) -> Array:
        radii = np.linalg.norm(scaled - centre, axis=1)
        return np.asarray(radii - radii.mean())

    optimum = least_squares(off, np.zeros(2), jac="3-point", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    radii = np.linalg.norm(path - middle - nominal_radius * optimum.x, axis=1)
    return CircleDeviation(
        float(radii.mean()),
        float(np.ptp(radii)),
        float(radii.max() - nominal_radius),
        float(radii.min() - nominal_radius),
    )


@dataclass(frozen=True)
class PoseAccuracy:
    """Positioning accuracy (AP) and repeatability (RP) of a pose by ISO 9283:1998, 7.2, m; of so many cycles."""

    accuracy: float
    repeatability: float
    cycles: int


def pose_accuracy(attained: Array, commanded: Array) -> PoseAccuracy:
    """Of attained positions (n, d), m, and the commanded one (d,). Raises ValueError for fewer than 30 cycles."""
    if len(attained) < FEWEST_CYCLES:
        raise ValueError("too few cycles")
    middle = attained.mean(axis=0)
    distance = np.linalg.norm(attained - middle, axis=1)
    repeat = float(distance.mean() + 3 * distance.std(ddof=1))
    return PoseAccuracy(float(np.linalg.norm(middle - commanded)), repeat, len(attained))
